"""Mechanisms that are hard for the reference solution: stiff, nearly singular, rounded, fast or badly scaled.

Most motions have no closed form.  Each mechanism starts from rest, or the velocity of one body determines all
other velocities.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from crosscheck.conformance.changes.isometry import ASKEW, Isometry
from crosscheck.conformance.mechanisms.parts import GRAVITY, Z, bar, hinge, linkage, turning
from mbref.scene import (
    Body,
    Distance,
    Driver,
    Force,
    Planar,
    Scene,
    Sine,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
    Universal,
)

TURNED = Isometry(ASKEW, np.array([0.3, -0.7, 0.45]))


FOUR = ((0.0, 0.0, 0.0), (0.1, 0.3, 0.0), (0.6, 0.5, 0.0), (0.7, -0.1, 0.0))


def stiff_spring() -> Scene:
    """Return a four-bar with a diagonal spring of 1e6 N/m, which vibrates at 3000 rad/s."""
    spring = Spring(
        bodies=("bar0", "bar2"),
        points=((0.05, 0.15, 0), (0.65, 0.2, 0)),
        stiffness=1e6,
        damping=20.0,
        natural_length=0.6,
    )
    return linkage("stiff_spring", FOUR).with_(load=(spring,), duration=0.1)


def strong_damping() -> Scene:
    """Return a four-bar with a strongly damped hinge: its damping over its inertia is about 1000 1/s."""
    spring = TorsionSpring(joint="P1", stiffness=10.0, damping=100.0, natural_angle=0.5)
    return linkage("strong_damping", FOUR).with_(load=(spring,), duration=0.3)


def near_singular() -> Scene:
    """Return an almost-parallelogram that passes its straight position at a distance of 1e-3 of its size."""
    places = ((0.0, 0.0, 0.0), (0.3, 0.4, 0.0), (1.3, 0.4, 0.0), (1.0004, 0.0, 0.0))
    return linkage("near_singular", places).with_(duration=1.0)


def start_near_singular() -> Scene:
    """Return a four-bar whose coupler and rocker start 1e-3 rad from their dead centre, at a given rate of
    the crank.

    The motion amplifies small differences of the crank's rate.
    """
    crank, coupler, rocker, ground = 0.3, 0.8, 0.6, 1.5
    reach = coupler + rocker - 1e-7
    x = (crank**2 + ground**2 - reach**2) / (2 * ground)
    pin = np.array([x, math.sqrt(crank**2 - x**2), 0.0])
    way = (np.array([ground, 0.0, 0.0]) - pin) / reach
    along = (coupler**2 + reach**2 - rocker**2) / (2 * reach)
    aside = math.sqrt(coupler**2 - along**2) * np.array([-way[1], way[0], 0.0])
    places = ((0.0, 0.0, 0.0), pin.tolist(), (pin + along * way + aside).tolist(), (ground, 0.0, 0.0))
    return turning(linkage("start_near_singular", places), 1e-3).with_(duration=0.3)


def two_crossings() -> Scene:
    """Return a parallelogram with sides in the ratio 5 : 3 : 4 that falls through both straight positions."""
    base = linkage("two_crossings", ((0, 0, 0), (0.375, 0.5, 0), (1.375, 0.5, 0), (1, 0, 0)))
    return turning(base, -6.0).with_(duration=0.8)


def rounded_redundancy() -> Scene:
    """Return a rotated six-bar of eight parallel hinges: six rows are redundant, and its numbers are
    rounded."""
    base = linkage("rounded_redundancy", FOUR)
    mid, far, low = (0.35, 0.4, 0.0), (0.45, 1.0, 0.0), (1.0, 0.7, 0.0)
    bars = (*base.body, bar("bar3", mid, far), bar("bar4", far, low))
    pins = (
        *base.joint,
        hinge("P4", "bar1", "bar3", mid),
        hinge("P5", "bar3", "bar4", far),
        hinge("P6", "bar4", "ground", low),
    )
    return TURNED.change(base.with_(body=bars, joint=pins, duration=0.3))


def fast_driver() -> Scene:
    """Return a driven slider-crank whose crank rate oscillates at 400 rad/s with a phase of 1.3 rad."""
    b, c = (0.1, 0.1, 0.0), (0.5, 0.0, 0.0)
    slider = Body(name="slider", mass=0.5, inertia=(1e-3, 1e-3, 1e-3), position=c)
    joints = (
        hinge("A", "ground", "crank", (0, 0, 0)),
        hinge("B", "crank", "rod", b),
        Spherical(name="C", bodies=("rod", "slider"), anchor=c),
        Translational(name="D", bodies=("slider", "ground"), anchor=c, axis=(1.0, 0.0, 0.0)),
    )
    wave = Sine(amplitude=0.05, frequency=400.0, phase=1.3)
    driver = Driver(joint="A", polynomial=(-0.05 * math.sin(1.3), 20.0, 3.0), sine=wave)
    bodies = (bar("crank", (0, 0, 0), b), bar("rod", b, c), slider)
    return Scene(
        name="fast_driver", gravity=GRAVITY, duration=0.3, body=bodies, joint=joints, driver=(driver,)
    )


def point_masses() -> Scene:
    """Return four bodies of 1e-8 kg m² at the ends of five bars of fixed length, pulled together by a
    spring."""
    places = [(0.5, 0.0, 0.0), (0.5, 0.0, 0.6), (1.0, 0.3, 0.2), (0.2, 0.7, 0.4)]
    names = ["p0", "p1", "p2", "p3"]
    bodies = [
        Body(name=n, mass=1.0 + k, inertia=(1e-8, 1e-8, 1e-8), position=p)
        for k, (n, p) in enumerate(zip(names, places, strict=True))
    ]
    pairs = ((None, 0), (0, 1), (1, 2), (0, 2), (2, 3))
    rods = [
        Distance(
            name=f"L{k}",
            bodies=("ground" if i is None else names[i], names[j]),
            anchors=((0.0, 0.1, 0.0) if i is None else places[i], places[j]),
        )
        for k, (i, j) in enumerate(pairs)
    ]
    pull = Spring(
        bodies=("p0", "p3"), points=(places[0], places[3]), stiffness=50.0, damping=1.0, natural_length=0.4
    )
    return Scene(
        name="point_masses",
        gravity=GRAVITY,
        duration=1.0,
        body=tuple(bodies),
        joint=tuple(rods),
        load=(pull,),
    )


def free_bodies() -> Scene:
    """Return two free bodies connected by a damped spring; one tumbles about its intermediate principal
    axis."""
    racket = Body(
        name="racket",
        mass=1.0,
        inertia=(0.01, 0.02, 0.03),
        position=(0.0, 0.0, 0.0),
        angular_velocity=(1e-3, 12.0, 0.0),
    )
    stone = Body(
        name="stone",
        mass=3.0,
        inertia=((0.05, 0.01, 0), (0.01, 0.04, 0), (0, 0, 0.06)),
        position=(0.6, 0.2, 0.1),
        velocity=(0.0, -0.3, 0.1),
        angular_velocity=(0.0, 2.0, -4.0),
    )
    spring = Spring(
        bodies=("racket", "stone"),
        points=((0.1, 0.05, 0.0), (0.5, 0.2, 0.0)),
        stiffness=300.0,
        damping=2.0,
        natural_length=0.3,
    )
    push = Force(body="stone", point=(0.6, 0.3, 0.1), force=(0.5, 1.0, -1.0))
    return Scene(name="free_bodies", duration=2.0, body=(racket, stone), load=(spring, push))


def whip() -> Scene:
    """Return eight bodies on ball and universal joints between two points of the ground."""
    places = np.array([(0.25 * k, 0.1 * (k % 2), 0.05 * (k % 3)) for k in range(9)])
    names, bars, pins = ["ground", *(f"b{k}" for k in range(8))], [], []
    for k in range(8):
        middle, pair = tuple(places[k : k + 2].mean(axis=0).tolist()), (names[k], names[k + 1])
        bars.append(Body(name=names[k + 1], mass=0.4, inertia=(0.003, 0.002, 0.0015), position=middle))
        anchor = tuple(places[k].tolist())
        ball = Spherical(name=f"J{k}", bodies=pair, anchor=anchor)
        cross = Universal(name=f"J{k}", bodies=pair, anchor=anchor, axes=(Z, (0.0, 1.0, 0.0)))
        pins.append(cross if k % 2 else ball)
    rod = Distance(name="rod", bodies=("b7", "ground"), anchors=(tuple(places[8].tolist()), (2.2, -1.0, 0.3)))
    return Scene(name="whip", gravity=GRAVITY, duration=0.5, body=tuple(bars), joint=(*pins, rod))


def mass_ratio() -> Scene:
    """Return a milligram body between bodies of a kilogram and half a ton."""
    places = ((0.0, 0.0, 0.0), (0.4, 0.2, 0.0), (0.9, 0.1, 0.0), (1.2, -0.3, 0.0))
    return linkage("mass_ratio", places, (1.0, 1e-6, 500.0)).with_(duration=1.0)


def planes() -> Scene:
    """Return a block on a slope with a pendulum, which a bar of fixed length connects to another block."""
    slope = (0.0, 1.0, 0.4)
    first, second = (0.0, 0.0, 0.0), (0.8, 0.0, 0.3)
    inertia = ((0.02, 0.001, 0.0), (0.001, 0.03, 0.002), (0.0, 0.002, 0.025))
    blocks = [
        Body(name=n, mass=m, inertia=inertia, position=p)
        for n, m, p in (("one", 1.0, first), ("two", 2.5, second))
    ]
    bob = Body(name="bob", mass=0.7, inertia=(0.01, 0.002, 0.01), position=(0.1, -0.4, 0.1))
    joints = (
        Planar(name="S1", bodies=("ground", "one"), anchor=first, axis=slope),
        Planar(name="S2", bodies=("ground", "two"), anchor=second, axis=(0.1, 1.0, 0.2)),
        Spherical(name="H", bodies=("one", "bob"), anchor=(0.0, 0.0, 0.05)),
        Distance(name="L", bodies=("bob", "two"), anchors=((0.1, -0.6, 0.1), second)),
    )
    return Scene(name="planes", gravity=GRAVITY, duration=1.0, body=(*blocks, bob), joint=joints)


HARD: dict[str, Callable[[], Scene]] = {
    make.__name__: make
    for make in (
        stiff_spring,
        strong_damping,
        near_singular,
        start_near_singular,
        two_crossings,
        rounded_redundancy,
        fast_driver,
        point_masses,
        free_bodies,
        whip,
        mass_ratio,
        planes,
    )
}
