"""Planar test scenes: closed loops of hinges and slides in one plane, for engines of planar mechanisms.

All hinge axes are along z, and all centres of mass lie in the plane z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from crosscheck.conformance.mechanisms.features import feature_scenes
from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.engine import Engine
from mbref.scene import (
    Body,
    Driver,
    Force,
    Joint,
    Load,
    Moment,
    Revolute,
    Scene,
    Sine,
    Spring,
    TorsionSpring,
    Translational,
)

Z, DOWN = (0.0, 0.0, 1.0), (0.0, -9.81, 0.0)
DURATION = 0.1  # s; in this time no loop comes to a singular position
Point = tuple[float, float]
Links = Mapping[str, tuple[Point, Point]]  # name → ends of a rod at t = 0


def planar_loops() -> dict[str, Scene]:
    """Return scenes by name: each mechanism under gravity, with a force, a moment, a spring, a torsion spring
    and a driver."""
    driver = Driver(joint="A", polynomial=(0.0, 1.0), sine=Sine(amplitude=0.1, frequency=5.0))
    found = {}
    for name, (links, joints) in MECHANISMS.items():
        first, last, place = next(iter(links)), [*links][-1], _middle(*[*links.values()][-1])
        ends = (0.1, 0.9, 0.0), place
        spring = Spring(bodies=("ground", last), points=ends, stiffness=20.0, damping=0.3, natural_length=0.4)
        twist = TorsionSpring(joint="A", stiffness=3.0, damping=0.05, natural_angle=0.5)
        parts: dict[str, dict[str, tuple[Load | Driver, ...]]] = {
            "gravity": {},
            "force": {"load": (Force(body=last, point=place, force=(2.0, -1.0, 0.0)),)},
            "moment": {"load": (Moment(body=first, moment=(0.0, 0.0, 0.4)),)},
            "spring": {"load": (spring,)},
            "torsion spring": {"load": (twist,)},
            "driver": {"driver": (driver,)},
        }
        bodies = tuple(_rod(body, *ends) for body, ends in links.items())
        plain = Scene(name=name, gravity=DOWN, duration=DURATION, body=bodies, joint=tuple(joints))
        for part, given in parts.items():
            found[f"planar {name}: {part}"] = plain.with_(name=f"planar {name}: {part}", **given)
    return found


def planar_specimens() -> list[Specimen]:
    """Return the planar loops as specimens of the suite."""
    return [Specimen(scene) for scene in planar_loops().values()]


def left_out(simulator: Engine | None) -> set[str]:
    """Return the names of the planar loops if an engine refuses spatial ones, otherwise nothing."""
    return set() if simulator is not None and is_planar(simulator) else set(planar_loops())


def is_planar(simulator: Engine) -> bool:
    """Return whether an engine runs planar loops, but not a spatial one."""
    spatial = feature_scenes()["loop"]
    under_gravity = planar_loops()["planar four-bar: gravity"]
    return simulator.cannot(spatial) is not None and simulator.cannot(under_gravity) is None


def _middle(first: Point, second: Point) -> tuple[float, float, float]:
    return (first[0] + second[0]) / 2, (first[1] + second[1]) / 2, 0.0


def _rod(name: str, first: Point, second: Point) -> Body:
    """Return a uniform rod of 2 kg/m between two points, or a block of 0.5 kg if the points coincide."""
    length = math.dist(first, second)
    mass = 2.0 * length if length else 0.5
    across = mass * length**2 / 12 + 1e-4
    angle = math.atan2(second[1] - first[1], second[0] - first[0])
    return Body(
        name=name,
        mass=mass,
        inertia=(2e-4, across, across),
        position=_middle(first, second),
        orientation=(math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)),
    )


def _hinge(name: str, bodies: tuple[str, str], at: Point) -> Joint:
    return Revolute(name=name, bodies=bodies, anchor=(*at, 0.0), axis=Z)


def _slide(name: str, bodies: tuple[str, str], at: Point, along: Point) -> Joint:
    return Translational(name=name, bodies=bodies, anchor=(*at, 0.0), axis=(*along, 0.0))


def _loop(
    names: Sequence[str], points: Sequence[Point], slides: Mapping[str, Point]
) -> tuple[Links, Sequence[Joint]]:
    """Return rods between successive points, with joints A, B, … at the points, the first and the last one to
    the ground; ``slides`` has the directions of joints that are no hinges."""
    pairs = [("ground", names[0]), *pairwise(names), ("ground", names[-1])]
    return dict(zip(names, pairwise(points), strict=True)), [
        _slide(name, pair, at, slides[name]) if name in slides else _hinge(name, pair, at)
        for name, pair, at in zip("ABCDE", pairs, points, strict=False)
    ]


def _inverted_slider_crank() -> tuple[Links, Sequence[Joint]]:
    """Return a crank whose pin slides along a rocker."""
    links = {
        "crank": ((0.0, 0.0), (0.15, 0.2)),
        "pin": ((0.15, 0.2), (0.15, 0.2)),
        "rocker": ((0.5, 0.0), (0.15, 0.2)),
    }
    return links, (
        _hinge("A", ("ground", "crank"), (0.0, 0.0)),
        _hinge("B", ("crank", "pin"), (0.15, 0.2)),
        _slide("C", ("rocker", "pin"), (0.15, 0.2), (-0.35, 0.2)),
        _hinge("D", ("ground", "rocker"), (0.5, 0.0)),
    )


FOUR_BAR = _loop(("crank", "coupler", "rocker"), ((0.0, 0.0), (0.1, 0.2), (0.6, 0.35), (0.5, 0.0)), {})


def _six_bar() -> tuple[Links, Sequence[Joint]]:
    """Return Watt's six-bar linkage: a four-bar whose rocker drives a second loop."""
    links, joints = FOUR_BAR
    more = {"link": ((0.55, 0.175), (0.9, 0.3)), "arm": ((0.9, 0.3), (1.0, 0.0))}
    return {**links, **more}, (
        *joints,
        _hinge("E", ("rocker", "link"), (0.55, 0.175)),
        _hinge("F", ("link", "arm"), (0.9, 0.3)),
        _hinge("G", ("ground", "arm"), (1.0, 0.0)),
    )


MECHANISMS: dict[str, tuple[Links, Sequence[Joint]]] = {
    "four-bar": FOUR_BAR,
    "slider-crank": _loop(
        ("crank", "rod", "piston"), ((0.0, 0.0), (0.1, 0.15), (0.5, 0.05), (0.5, 0.05)), {"D": (1.0, 0.0)}
    ),
    "inverted slider-crank": _inverted_slider_crank(),
    "five-bar": _loop(
        ("left", "upper left", "upper right", "right"),
        ((0.0, 0.0), (-0.1, 0.25), (0.2, 0.5), (0.5, 0.3), (0.4, 0.0)),
        {},
    ),
    "six-bar": _six_bar(),
}
