"""Random mechanisms, each with one numerical difficulty: fast tops, thin links, stiff dampers, drivers with a
phase, and the loops of `awkward_loops.py`.

Poses satisfy the joints by construction. Initial velocities follow from a few given velocities.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from crosscheck.conformance.mechanisms.awkward_loops import (
    locking,
    nearly_folding,
    nearly_parallel,
    planar_loop,
    pushed_dead_centre,
    rccc,
    rounded_door,
    rounded_platform,
    two_straight,
    universal_loop,
)
from crosscheck.conformance.mechanisms.parts import (
    DOWN,
    Rng,
    Z,
    bar,
    direction,
    hinge,
    joint,
    linkage,
    ring,
    rod,
    rows,
    triple,
    turned,
)
from mbref import rotations
from mbref.scene import (
    Body,
    Driver,
    Force,
    Moment,
    Revolute,
    Scene,
    Sine,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
)


def rods(steps: np.ndarray, rng: Rng, thickness: float = 0.05) -> tuple[list[str], np.ndarray, list[Body]]:
    """Return names, the ground's first, points (n + 1, 3) and rods b0, b1, … of a chain from the origin."""
    points = np.cumsum(np.vstack([np.zeros(3), steps]), axis=0)
    names = [f"b{k}" for k in range(len(steps))]
    bodies = [rod(n, p, q, rng, thickness) for n, p, q in zip(names, points[:-1], points[1:], strict=True)]
    return ["ground", *names], points, bodies


# --- tops ------------------------------------------------------------------------------------------------
def fast_top(rng: Rng) -> Scene:
    """Return an unsymmetric top on a ball joint at 100 to 300 rad/s, with a principal axis inclined to the
    body's axis."""
    place = 0.3 * direction(rng)
    principal = np.array([1.0, 1.3, 1.9]) * rng.uniform(0.01, 0.05)
    turn = rotations.to_matrix(rotations.from_vector(rng.normal(size=3)))
    inertia = turn @ np.diag(principal) @ turn.T
    spin = triple(rng.uniform(100, 300) * place / 0.3 + rng.normal(size=3))
    body = Body(
        name="top",
        mass=2.0,
        inertia=rows((inertia + inertia.T) / 2),
        position=triple(place),
        angular_velocity=spin,
    )
    ball = Spherical(name="tip", bodies=("ground", "top"), anchor=(0.0, 0.0, 0.0))
    return Scene(name="fast_top", gravity=DOWN, duration=0.3, body=(body,), joint=(ball,))


def gimbal(rng: Rng) -> Scene:
    """Return a rotor in two gimbal rings with an inclined inner axis, on a torsion spring."""
    axes = [direction(rng) for _ in range(3)]
    names = ("ground", "outer", "inner", "rotor")
    bodies = [
        rod(n, (-0.1, 0, 0), 0.1 * direction(rng), rng).model_copy(update={"position": (0.0, 0.0, 0.0)})
        for n in names[1:]
    ]
    bodies[2] = bodies[2].model_copy(update={"angular_velocity": triple(150 * axes[2])})
    joints = [
        Revolute(name=f"R{k}", bodies=(names[k], names[k + 1]), anchor=(0.0, 0.0, 0.0), axis=triple(a))
        for k, a in enumerate(axes)
    ]
    spring = TorsionSpring(joint="R0", stiffness=20.0, damping=0.3, natural_angle=0.5)
    push = Moment(body="inner", moment=triple(rng.normal(size=3)))
    return Scene(name="gimbal", duration=0.2, body=tuple(bodies), joint=tuple(joints), load=(spring, push))


def tumbling_chain(rng: Rng) -> Scene:
    """Return three bodies on ball and universal joints with large velocities: eight or nine degrees of
    freedom, chaotic within seconds."""
    steps = 0.4 * np.array([direction(rng) for _ in range(3)])
    kinds, axes = ("spherical", "universal", "spherical"), [direction(rng) for _ in range(3)]
    names, points, bodies = rods(steps, rng)
    spin = triple(5 * rng.normal(size=3))
    bodies[0] = bodies[0].model_copy(update={"angular_velocity": spin})
    joints = [
        joint(f"J{k}", kinds[k], pair, triple(points[k]), axes[k]) for k, pair in enumerate(pairwise(names))
    ]
    return Scene(name="tumbling_chain", gravity=DOWN, duration=1.0, body=tuple(bodies), joint=tuple(joints))


# --- sizes and stiffness -----------------------------------------------------------------------------------
def thin_links(rng: Rng) -> Scene:
    """Return a spatial loop R-S-S-R whose coupler can spin freely; its inertia about its own axis is 1e-7 of
    its inertia across the axis."""
    points = np.array([(0, 0, 0), (0.1, 0.3, 0.1), (1.5, 0.6, -0.2), (1.6, 0.0, 0.1)])
    points[1:] += 0.05 * rng.normal(size=(3, 3))
    axes = [direction(rng) for _ in points]
    scene = ring(rng, "thin_links", ("revolute", "spherical", "spherical", "revolute"), axes, points)
    thin = rod("link1", points[1], points[2], rng, 3e-4)
    return scene.with_(body=(scene.body[0], thin, scene.body[2]), duration=0.4)


def stiff_dampers(rng: Rng) -> Scene:
    """Return a four-bar with a diagonal spring of 1e4 to 1e6 N/m and a damping of a hundred times the
    critical one."""
    places = np.array([(0, 0, 0), (0.1, 0.3, 0), (0.6, 0.5, 0), (0.7, -0.1, 0)])
    places[:, :2] += 0.03 * rng.normal(size=(4, 2))
    stiffness = 10.0 ** rng.uniform(4, 6)
    spring = Spring(
        bodies=("bar0", "bar2"),
        points=((0.05, 0.15, 0.0), (0.65, 0.2, 0.0)),
        stiffness=stiffness,
        damping=100 * 2 * math.sqrt(stiffness),
        natural_length=0.55,
    )
    base = linkage("stiff_dampers", [triple(p) for p in places])
    return turned(rng, base.with_(load=(spring,), duration=1.0))


def stiff_chain(rng: Rng) -> Scene:
    """Return a tree of three degrees of freedom with torsion springs, one of which is damped 1e3 to 1e5 times
    beyond critical."""
    steps = 0.3 * np.array([direction(rng) for _ in range(3)])
    axes = [direction(rng) for _ in range(3)]
    names, points, bodies = rods(steps, rng)
    joints = [
        Revolute(name=f"R{k}", bodies=pair, anchor=triple(points[k]), axis=triple(axes[k]))
        for k, pair in enumerate(pairwise(names))
    ]
    dampings = (0.1, 10.0 ** rng.uniform(1, 3), 0.01)
    loads = [
        TorsionSpring(joint=f"R{k}", stiffness=10.0 * c, damping=c, natural_angle=0.4)
        for k, c in enumerate(dampings)
    ]
    return Scene(
        name="stiff_chain",
        gravity=DOWN,
        duration=2.0,
        body=tuple(bodies),
        joint=tuple(joints),
        load=tuple(loads),
    )


def mass_ratios(rng: Rng) -> Scene:
    """Return a rotated planar five-bar with masses from a milligram to a ton."""
    places = np.array([(0, 0, 0), (0.2, 0.4, 0), (0.6, 0.7, 0), (1.0, 0.3, 0), (1.1, -0.2, 0)])
    places[:, :2] += 0.05 * rng.normal(size=(5, 2))
    masses = rng.permutation([1e-6, 1.0, 1e-3, 1e3]).tolist()
    return turned(rng, linkage("mass_ratios", [triple(p) for p in places], masses).with_(duration=0.5))


def millimetres(rng: Rng) -> Scene:
    """Return a slider-crank in millimetres, tonnes and newtons, far from the origin."""
    far, crank, length = 1e3 * rng.normal(size=3), rng.uniform(30, 60), rng.uniform(120, 180)
    angle = rng.uniform(0.3, 2.5)
    b = np.array([crank * math.cos(angle), crank * math.sin(angle), 0.0])
    c = np.array([b[0] + math.sqrt(length**2 - b[1] ** 2), 0.0, 0.0])
    a, b, c = far, far + b, far + c
    bodies = (
        bar("crank", a, b, 2e-4),
        bar("rod", b, c, 5e-4),
        Body(name="slider", mass=1e-3, inertia=(0.1, 0.1, 0.1), position=triple(c)),
    )
    joints = (
        hinge("A", "ground", "crank", a),
        hinge("B", "crank", "rod", b),
        hinge("C", "rod", "slider", c),
        Translational(name="D", bodies=("slider", "ground"), anchor=triple(c), axis=(1.0, 0.0, 0.0)),
    )
    push = Moment(body="crank", moment=(0.0, 0.0, float(rng.uniform(5, 20))))
    scene = Scene(name="millimetres", gravity=(0.0, -9810.0, 0.0), duration=0.3, body=bodies, joint=joints)
    return scene.with_(load=(push,))


# --- drivers -----------------------------------------------------------------------------------------------
def wave(rng: Rng, rate: float) -> Driver:
    """Return a driver of joint J0: a steady rate, a small acceleration, and a sine wave with a phase."""
    size, frequency, phase = rng.uniform(0.02, 0.1), rng.uniform(20, 80), rng.uniform(-3, 3)
    sine = Sine(amplitude=float(size), frequency=float(frequency), phase=float(phase))
    return Driver(joint="J0", polynomial=(float(-size * math.sin(phase)), rate, 0.7), sine=sine)


def phased_crank(rng: Rng) -> Scene:
    """Return a spatial crank-rocker R-S-U-R whose driver has a phase; the coupler cannot spin about its
    axis."""
    points = np.array([(0, 0, 0), (0.05, 0.12, 0.0), (0.8, 0.5, 0.2), (0.9, -0.1, 0.0)])
    points[2:] += 0.03 * rng.normal(size=(2, 3))
    axes = [np.array(Z), direction(rng), direction(rng), np.array([0.1, 0.2, 1.0])]
    scene = ring(rng, "phased_crank", ("revolute", "spherical", "universal", "revolute"), axes, points)
    return turned(rng, scene.with_(driver=(wave(rng, 8.0),), duration=0.5))


def phased_slide(rng: Rng) -> Scene:
    """Return a slide driven by a wave with a phase; it shakes a pendulum on a universal joint with a
    spring."""
    names, axis = ("ground", "cart", "bob"), direction(rng)
    cart = rod("cart", (-0.1, 0, 0), (0.1, 0, 0), rng)
    bob = rod("bob", (0, 0, 0), 0.5 * direction(rng), rng)
    slide = Translational(name="J0", bodies=names[:2], anchor=(0.0, 0.0, 0.0), axis=triple(axis))
    cross = joint("U", "universal", names[1:], (0.0, 0.0, 0.0), direction(rng))
    spring = Spring(
        bodies=("ground", "bob"),
        points=((0.7, 0.5, 0.3), bob.position),
        stiffness=80.0,
        damping=1.0,
        natural_length=0.3,
    )
    return Scene(
        name="phased_slide",
        gravity=DOWN,
        duration=0.5,
        body=(cart, bob),
        joint=(slide, cross),
        driver=(wave(rng, 0.2),),
        load=(spring,),
    )


# --- many bodies -------------------------------------------------------------------------------------------
def chain_of_twenty(rng: Rng) -> Scene:
    """Return twenty rods on alternating ball joints and hinges that hang nearly straight, with a spring at
    the last rod."""
    steps = np.array([0.0, 0.0, -0.1]) + 0.01 * rng.normal(size=(20, 3))
    names, points, bodies = rods(steps, rng, 0.3)
    joints = [
        joint(f"J{k}", "revolute" if k % 2 else "universal", pair, triple(points[k]), direction(rng))
        for k, pair in enumerate(pairwise(names))
    ]
    spring = Spring(
        bodies=("b19", "ground"),
        points=(triple(points[-1]), (0.5, 0.5, -2.0)),
        stiffness=50.0,
        damping=2.0,
        natural_length=0.4,
    )
    return Scene(
        name="chain_of_twenty",
        gravity=DOWN,
        duration=0.3,
        body=tuple(bodies),
        joint=tuple(joints),
        load=(spring,),
    )


def every_load(rng: Rng) -> Scene:
    """Return a loop of three degrees of freedom and a free body, with every type of load."""
    scene = universal_loop(rng).with_(name="every_load", duration=0.5)
    free = rod("free", (0.5, 1.0, 0.5), (0.8, 1.2, 0.6), rng)
    free = free.model_copy(update={"angular_velocity": triple(3 * rng.normal(size=3))})
    loads = (
        Moment(body="link1", moment=triple(rng.normal(size=3))),
        Force(body="link2", point=scene.body[2].position, force=triple(3 * rng.normal(size=3))),
        Spring(
            bodies=("link1", "free"),
            points=(scene.body[1].position, (0.55, 1.0, 0.5)),
            stiffness=60.0,
            damping=1.5,
            natural_length=0.4,
        ),
        TorsionSpring(joint="J0", stiffness=4.0, damping=0.2, natural_angle=-0.3),
        TorsionSpring(joint="J2", stiffness=2.0, damping=0.1, natural_angle=0.5),
    )
    return scene.with_(body=(*scene.body, free), load=loads)


AWKWARD: dict[str, Callable[[Rng], Scene]] = {
    make.__name__: make
    for make in (
        fast_top,
        gimbal,
        tumbling_chain,
        thin_links,
        stiff_dampers,
        stiff_chain,
        mass_ratios,
        millimetres,
        phased_crank,
        phased_slide,
        rccc,
        universal_loop,
        planar_loop,
        rounded_door,
        rounded_platform,
        pushed_dead_centre,
        nearly_folding,
        nearly_parallel,
        two_straight,
        locking,
        chain_of_twenty,
        every_load,
    )
}


def awkward(name: str, seed: int) -> Scene:
    """Return the mechanism of a kind for a seed."""
    return AWKWARD[name](np.random.default_rng(seed)).with_(name=f"{name}_{seed}")
