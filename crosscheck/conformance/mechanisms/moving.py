"""Test scenes in motion: bodies that tumble, joints and loads between moving bodies, loops that spin in
space.

In every scene the centres of mass are off the joints, inertias are full matrices, body frames are rotated,
and gravity is along no axis. Initial velocities satisfy the joints. So every term of the equations
contributes.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crosscheck.conformance.changes.copies import replaced
from crosscheck.conformance.mechanisms.features import DRIVERS, JOINTS, LOADS
from crosscheck.conformance.mechanisms.random_mechanisms import null_space
from mbref import rotations
from mbref.scene import (
    Body,
    Coupling,
    Driver,
    Force,
    Joint,
    Load,
    Moment,
    PointDamper,
    Revolute,
    RotationalDamper,
    Scene,
    Sine,
    Spherical,
    Spring,
    TorsionSpring,
    Universal,
)
from mbref.scenes.planar_slider_crank import slider_crank

GRAVITY = (2.0, -6.5, -5.0)
DURATION = 0.2  # s: the bodies turn by about half a radian
HUB = Body(
    name="hub", mass=2.0, inertia=((0.05, -0.004, 0.006), (-0.004, 0.04, 0.003), (0.006, 0.003, 0.06)),
    position=(-0.25, 0.15, -0.1),
    orientation=tuple(rotations.from_vector(np.array([-0.5, 0.9, 0.4])).tolist()),
)  # fmt: skip
BODY = Body(
    name="body", mass=1.5, inertia=((0.02, 0.004, -0.003), (0.004, 0.03, 0.005), (-0.003, 0.005, 0.026)),
    position=(0.3, -0.2, 0.1), orientation=tuple(rotations.from_vector(np.array([0.3, -1.2, 0.5])).tolist()),
)  # fmt: skip
BEARING = Spherical(name="bearing", bodies=("ground", "hub"), anchor=(-0.4, 0.3, 0.1))
HINGE = Revolute(name="H", bodies=("ground", "hub"), anchor=(-0.4, 0.3, 0.1), axis=(0.3, -0.4, 1.0))
BALL = Spherical(name="J", bodies=("hub", "body"), anchor=(0.0, 0.0, 0.0))
SPIN = (1.5, -2.0, 2.5)  # rad/s
DRIVEN = Driver(joint="J", polynomial=(-0.3 * float(np.sin(0.7)), 0.8, -0.5),
                sine=Sine(amplitude=0.3, frequency=6.0, phase=0.7))  # fmt: skip


def moving_probes() -> dict[str, Scene]:
    """Return scenes by feature; the names of joints, drivers and loads agree with `feature_scenes`."""
    found = {f"{kind} joint": _pair(joint) for kind, joint in JOINTS.items()}
    found |= {f"{kind} driver": _pair(JOINTS[kind], driver=(DRIVEN,)) for kind in DRIVERS}
    found |= {f"{kind} load": _pair(_carrier(kind), load=(_load(kind),)) for kind in LOADS}
    found |= {
        "tumbling body": _alone(load=()),
        "pushed body": _alone(load=(_load("force"), _load("moment"))),
        "heavy top": heavy_top(),
        "spinning loop": spinning_loop(),
        "door": door(),
        "wound spring": wound_spring(),
        "floating pair": floating_pair(),
        "two drivers": two_drivers(),
        "several springs": several_springs(),
        "dampers alone": dampers_alone(),
        "two torsion springs": two_torsion_springs(),
        "rounded velocities": rounded_velocities(),
        "light and heavy": light_and_heavy(),
    }
    return {name: scene.with_(name=name) for name, scene in found.items()}


def dead_end() -> Scene:
    """Return a slider-crank (crank 0.3 m, rod 0.25 m) driven beyond the angle at which the rod is
    perpendicular to the slider's line.

    At that angle the slider's speed grows without bound; the mechanism has no pose beyond the angle.
    """
    crank = Driver(joint="A", polynomial=(0.0, 4.0))
    return slider_crank(0.3, 0.25, 0.2, "dead end").with_(driver=(crank,), duration=0.5)


def heavy_top() -> Scene:
    """Return a spinning, nutating symmetric top on its tip: I₁ = 0.02, I₃ = 0.012 kg m² about its centre of
    mass."""
    turned = rotations.from_vector(np.array([0.6, 0.0, 0.0]))
    arm = rotations.rotate(turned, np.array([0.0, 0.0, 0.15]))
    spin = rotations.rotate(turned, np.array([0.5, 1.0, 40.0]))
    top = Body(name="top", mass=1.0, inertia=(0.02, 0.02, 0.012), position=arm.tolist(),
               orientation=turned.tolist(), velocity=np.cross(spin, arm).tolist(),
               angular_velocity=spin.tolist())  # fmt: skip
    tip = Spherical(name="tip", bodies=("ground", "top"), anchor=(0.0, 0.0, 0.0))
    return Scene(name="heavy top", gravity=(0.0, 0.0, -9.81), duration=0.3, body=(top,), joint=(tip,))


def spinning_loop() -> Scene:
    """Return a closed spatial loop of crank, rod and lever with hinge, universal, ball and skew hinge."""
    rng = np.random.default_rng(5)
    crank, rod, lever = (
        BODY.model_copy(update={"name": name, "position": place, "orientation": _turn(rng)})
        for name, place in (
            ("crank", (0.1, 0.1, 0.05)),
            ("rod", (0.4, 0.3, 0.2)),
            ("lever", (0.75, 0.2, 0.1)),
        )
    )
    joints = (
        Revolute(name="A", bodies=("ground", "crank"), anchor=(0.0, 0.0, 0.0), axis=(0.2, -0.1, 1.0)),
        Universal(name="B", bodies=("crank", "rod"), anchor=(0.2, 0.25, 0.1),
                  axes=((0.3, 0.2, 1.0), (1.0, -1.0, -0.1))),
        Spherical(name="C", bodies=("rod", "lever"), anchor=(0.65, 0.35, 0.3)),
        Revolute(name="D", bodies=("lever", "ground"), anchor=(0.8, 0.0, 0.0), axis=(-0.5, 0.3, 1.0)),
    )  # fmt: skip
    return launched("loop", (crank, rod, lever), joints)


def door() -> Scene:
    """Return a body on two hinges with a common inclined axis: five redundant rows."""
    axis = np.array([0.3, -0.2, 1.0])
    hinges = tuple(
        Revolute(name=name, bodies=("ground", "body"), anchor=(0.1 + h * axis).tolist(), axis=axis.tolist())
        for name, h in (("low", -0.4), ("high", 0.5))
    )
    return launched("door", (BODY,), hinges)


def wound_spring() -> Scene:
    """Return a body that makes several turns about an inclined hinge, against a torsion spring and its
    weight."""
    hinge = JOINTS["revolute"]
    axis = rotations.unit(hinge.directions[0])
    swing = np.cross(40.0 * axis, BODY.position)  # the hinge goes through the origin
    body = replaced(BODY, angular_velocity=40.0 * axis, velocity=swing)
    spring = TorsionSpring(joint="J", stiffness=0.4, damping=0.01, natural_angle=0.4)
    return Scene(name="wound spring", gravity=GRAVITY, duration=0.45, body=(body,), joint=(hinge,),
                 load=(spring,))  # fmt: skip


def floating_pair() -> Scene:
    """Return two bodies in flight connected by a hinge, with a damped spring and a damped torsion spring
    between them."""
    springs = (_load("spring"), TorsionSpring(joint="J", stiffness=4.0, damping=0.1, natural_angle=-0.6))
    scene = Scene(name="floating", gravity=GRAVITY, duration=0.3, body=(HUB, BODY), load=springs,
                  joint=(between(JOINTS["revolute"]),))  # fmt: skip
    twists = ((0.4, 1.0, -0.5, 1.0, -3.0, 2.0), (0.4, 1.0, -0.5, -2.0, 4.0, 3.0))
    return consistent(scene, np.array(twists))


def two_drivers() -> Scene:
    """Return two successive driven hinges: one by a quartic polynomial and a wave, one by a wave of negative
    amplitude."""
    drivers = (
        Driver(joint="H", polynomial=(0.0, 0.8, -0.5, 0.9, -0.3), sine=Sine(amplitude=0.2, frequency=4.0)),
        Driver(joint="J", polynomial=(0.0, -0.6), sine=Sine(amplitude=-0.3, frequency=6.0)),
    )
    joints = (HINGE, between(JOINTS["revolute"]))
    return Scene(name="drivers", gravity=GRAVITY, duration=1.5, body=(HUB, BODY), joint=joints,
                 driver=drivers)  # fmt: skip


def several_springs() -> Scene:
    """Return two bodies on ball joints with two springs (one in tension, one in compression), two forces, and
    two moments on one body."""
    points = ((-0.3, 0.6, 0.0), (0.4, -0.1, 0.1))
    springs = (
        Spring(bodies=("hub", "body"), points=points, stiffness=30.0, damping=0.5, natural_length=0.5),
        Spring(bodies=("body", "ground"), points=(points[1], (0.9, -0.6, 0.4)), stiffness=60.0, damping=0.2,
               natural_length=1.1),
    )  # fmt: skip
    pushes = (
        Force(body="body", point=(0.5, -0.1, 0.2), force=(1.0, -2.0, 3.0)),
        Force(body="body", point=(0.4, 0.1, 0.2), force=(-0.4, -2.0, 3.0)),
        Moment(body="hub", moment=(0.3, 0.2, -0.4)),
        Moment(body="hub", moment=(0.1, -0.2, 0.5)),
    )
    return launched("springs", (HUB, BODY), (BEARING, BALL), springs + pushes)


def dampers_alone() -> Scene:
    """Return two bodies on ball joints with a damper without stiffness and a spring of zero natural
    length."""
    ends = ((-0.3, 0.6, 0.0), (0.4, -0.1, 0.1))
    links = (
        Spring(bodies=("hub", "body"), points=ends, stiffness=0.0, damping=6.0, natural_length=0.5),
        Spring(bodies=("ground", "body"), points=((0.9, -0.6, 0.4), ends[1]), stiffness=40.0,
               natural_length=0.0),
    )  # fmt: skip
    return launched("dampers", (HUB, BODY), (BEARING, BALL), links)


def two_torsion_springs() -> Scene:
    """Return two successive hinges: the first with a damper only, the second with a stiff torsion spring."""
    joints = (HINGE, between(JOINTS["revolute"]))
    springs = (TorsionSpring(joint="H", stiffness=0.0, damping=0.3, natural_angle=2.0),
               TorsionSpring(joint="J", stiffness=9.0, damping=0.0, natural_angle=-0.6))  # fmt: skip
    return launched("torsions", (HUB, BODY), joints, springs)


def light_and_heavy() -> Scene:
    """Return a light, small body on a heavy hub; the masses differ by a factor of about 1e5."""
    heavy = replaced(HUB, mass=200.0, inertia=100.0 * np.array(HUB.inertia))
    light = replaced(BODY, mass=0.00075, inertia=np.array(BODY.inertia) / 200000.0)
    joints = (BEARING, between(JOINTS["revolute"]))
    return launched("masses", (heavy, light), joints)


def rounded_velocities() -> Scene:
    """Return the spinning loop with velocities rounded to two digits, which violate the joints slightly."""
    scene = spinning_loop()
    names = ("velocity", "angular_velocity")
    bodies = [
        replaced(body, **{name: np.round(np.array(getattr(body, name)), 2) for name in names})
        for body in scene.body
    ]
    return scene.with_(body=tuple(bodies))


def consistent(scene: Scene, twists: np.ndarray) -> Scene:
    """Return the scene with the velocities that its joints allow and that are nearest to twists (nb, 6) in
    world axes."""
    free = null_space(scene.with_(driver=()))
    found = (free @ (free.T @ np.ravel(twists))).reshape(-1, 6)
    bodies = [
        replaced(body, velocity=x[:3], angular_velocity=x[3:])
        for body, x in zip(scene.body, found, strict=True)
    ]
    return scene.with_(body=tuple(bodies))


def _pair(joint: Joint, driver: tuple[Driver, ...] = (), load: tuple[Load, ...] = ()) -> Scene:
    """Return ground, a hub on a ball joint, and a body on the given joint; a driver starts at the joint's
    initial coordinate."""
    moving = launched("pair", (HUB, BODY), (BEARING, between(joint)), load, driver)
    if not driver:
        return moving
    hub, body = moving.body  # the driver determines the motion of the body relative to the hub
    return moving.with_(body=(hub, replaced(body, velocity=None, angular_velocity=None)))


def between(joint: Joint) -> Joint:
    """Return the joint between the hub and the body."""
    return replaced(joint, bodies=("hub", "body"))


def launched(
    name: str,
    bodies: tuple[Body, ...],
    joints: tuple[Joint, ...],
    loads: tuple[Load, ...] = (),
    drivers: tuple[Driver, ...] = (),
    couplings: tuple[Coupling, ...] = (),
) -> Scene:
    """Return a scene whose neighbouring bodies turn in opposite directions, as their joints allow."""
    scene = Scene(name=name, gravity=GRAVITY, duration=DURATION, body=bodies, joint=joints, load=loads,
                  driver=drivers, coupling=couplings)  # fmt: skip
    sides = np.array([[1.0 if k % 2 else -0.8] for k in range(len(bodies))])
    return consistent(scene, np.tile([0.4, 0.3, -0.5, *SPIN], (len(bodies), 1)) * sides)


def _alone(load: tuple[Load, ...]) -> Scene:
    body = replaced(BODY, velocity=(1.0, 0.5, -0.7), angular_velocity=(3.0, -6.0, 8.0))
    return Scene(name="alone", gravity=GRAVITY, duration=DURATION, body=(body,), load=load)


def _load(kind: str) -> Load:
    kinds: Mapping[str, Load] = {
        "moment": Moment(body="body", moment=(0.3, 0.2, -0.4)),
        "force": Force(body="body", point=(0.5, -0.1, 0.2), force=(1.0, -2.0, 3.0)),
        "spring": Spring(bodies=("hub", "body"), points=((-0.3, 0.6, 0.0), (0.4, -0.1, 0.1)), stiffness=30.0,
                         damping=0.5, natural_length=0.5),
        "rotational_damper": RotationalDamper(bodies=("hub", "body"), damping=0.06),
        "point_damper": PointDamper(bodies=("hub", "body"), point=(0.5, -0.1, 0.2), damping=0.8),
        "torsion_spring": TorsionSpring(joint="J", stiffness=4.0, damping=0.1, natural_angle=0.4),
    }  # fmt: skip
    return kinds.get(kind, LOADS[kind])


def _carrier(load: str) -> Joint:
    return JOINTS["cylindrical" if LOADS[load].acts_on == "joint" else "spherical"]


def _turn(rng: np.random.Generator) -> tuple[float, ...]:
    return tuple(rotations.from_vector(rng.normal(size=3)).tolist())
