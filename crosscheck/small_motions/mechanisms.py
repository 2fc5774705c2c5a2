"""Mechanisms whose equilibria or steady motions, and eigenvalues, are known in closed form."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import acos, cos, sin, sqrt
from typing import Any

import numpy as np
from scipy.optimize import brentq

from mbref.scene import Scene
from mbref.scenes import find_scene

G = 9.81
DOWN = (0.0, 0.0, -G)
ROD, ARM, INERTIA = 2.0, 0.7, 0.3  # kg, m, kg m² of the pendulums
Known = Sequence[tuple[complex, ...]]  # eigenvalues (1/s) of each equilibrium


@dataclass(frozen=True)
class Mechanism:
    """A mechanism with eigenvalues of some or all of its equilibria; ``about`` is its line in the page."""

    name: str
    about: str
    make: Callable[[], Scene]
    known: Callable[[], Known]


def pendulum() -> Scene:
    """Return a rod that hangs from a hinge to the ground."""
    rod = {"name": "rod", "mass": ROD, "inertia": [INERTIA] * 3, "position": [ARM, 0.0, 0.0]}
    return _scene(name="pendulum", gravity=DOWN, body=[rod], joint=[_hinge("A", "ground", "rod", (0.0,) * 3)])


def _pendulum() -> Known:
    rate = sqrt(ROD * G * ARM / (INERTIA + ROD * ARM**2))
    return [(1j * rate, -1j * rate), (-rate, rate)]


def double_pendulum() -> Scene:
    """Return two equal slender rods of length 1 m and mass 1 kg, one below the other."""
    rod = {"mass": 1.0, "inertia": [1e-5, 1 / 12, 1 / 12]}
    bodies = [
        {**rod, "name": "upper", "position": [0.5, 0.0, 0.0]},
        {**rod, "name": "lower", "position": [1.5, 0.0, 0.0]},
    ]
    joints = [_hinge("A", "ground", "upper", (0.0,) * 3), _hinge("B", "upper", "lower", (1.0, 0.0, 0.0))]
    return _scene(name="double_pendulum", gravity=DOWN, body=bodies, joint=joints)


def _double_pendulum() -> Known:
    """Return the roots of det(s² M + K), K = g diag(± 3/2, ± 1/2), for each direction of the two rods."""
    found = []
    for upper in (1, -1):
        for lower in (1, -1):
            mass = np.array([[4 / 3, upper * lower / 2], [upper * lower / 2, 1 / 3]])
            squares = -np.linalg.eigvals(np.linalg.solve(mass, G * np.diag([1.5 * upper, 0.5 * lower])))
            found.append(_roots_of_squares(squares))
    return found


def damped_slides() -> Scene:
    """Return two sliders on one line with springs and unequal dampers between them and the ground."""
    bodies = [
        {"name": name, "mass": mass, "inertia": [0.1] * 3, "position": [x, 0.0, 0.0]}
        for name, mass, x in (("first", 2.0, 0.5), ("second", 1.0, 1.0))
    ]
    line = {"type": "translational", "axis": [1.0, 0.0, 0.0]}
    joints = [
        {**line, "name": "A", "bodies": ["ground", "first"], "anchor": [0.5, 0.0, 0.0]},
        {**line, "name": "B", "bodies": ["first", "second"], "anchor": [1.0, 0.0, 0.0]},
    ]
    loads = [
        {"type": "slide_spring", "joint": "A", "stiffness": 50.0, "damping": 3.0},
        {"type": "slide_spring", "joint": "B", "stiffness": 30.0, "damping": 0.4},
    ]
    return _scene(name="damped_slides", body=bodies, joint=joints, load=loads)


def _damped_slides() -> Known:
    """Return the roots of det(s² M + s C + K) of the two displacements, a polynomial of degree 4."""
    first = np.array([2.0, 3.4, 80.0])
    return [
        tuple(np.roots(np.polysub(np.polymul(first, [1.0, 0.4, 30.0]), np.polymul([0.4, 30.0], [0.4, 30.0]))))
    ]


SPRING, DAMPER, DIAGONAL = 25.0, 1.0, sqrt(2.0)  # N/m, N s/m, m: natural length of the spring


def spring_four_bar() -> Scene:
    """Return the IFToMM benchmark "Fourbar linkage with diagonal spring": three rods of 1 m and 1 kg."""
    rods = {"crank": ((0.0, 0.5), 90.0), "coupler": ((0.5, 1.0), 0.0), "rocker": ((1.0, 0.5), 90.0)}
    bodies = []
    for name, ((x, z), angle) in rods.items():
        half = np.radians(angle) / 2
        turn = [cos(half), 0.0, -sin(half), 0.0]
        rod = {"name": name, "mass": 1.0, "inertia": [1e-5, 1 / 12, 1 / 12], "position": [x, 0.0, z]}
        bodies.append({**rod, "orientation": turn})
    places = {
        "A": ("ground", "crank", (0.0, 0.0, 0.0)),
        "B": ("crank", "coupler", (0.0, 0.0, 1.0)),
        "C": ("coupler", "rocker", (1.0, 0.0, 1.0)),
        "D": ("ground", "rocker", (1.0, 0.0, 0.0)),
    }
    spring = {
        "type": "spring",
        "bodies": ["ground", "coupler"],
        "points": [[0.0] * 3, [1.0, 0.0, 1.0]],
        "stiffness": SPRING,
        "damping": DAMPER,
        "natural_length": DIAGONAL,
    }
    joints = [_hinge(name, *place) for name, place in places.items()]
    return _scene(name="spring_four_bar", gravity=DOWN, body=bodies, joint=joints, load=[spring])


def _spring_four_bar() -> Known:
    """Return the roots of I s² + c d'² s + V'' of the angle φ of the crank; d = 2 cos(φ/2).

    V = 2 m g sin φ + k (d - d₀)²/2 and I = 5/3 m l². V' vanishes at φ = 2.23433101902 rad; the benchmark
    prints 2.23433101898.
    """

    def slope(angle: float) -> float:
        stretch = 2 * cos(angle / 2) - DIAGONAL
        return 2 * G * cos(angle) - SPRING * stretch * sin(angle / 2)

    angle = float(brentq(slope, 2.0, 2.5, xtol=1e-15))
    stretch, half = 2 * cos(angle / 2) - DIAGONAL, sin(angle / 2)
    curvature = -2 * G * sin(angle) + SPRING * (half**2 - stretch * cos(angle / 2) / 2)
    return [tuple(np.roots([5 / 3, DAMPER * half**2, curvature]))]


def _parallelogram() -> Known:
    scene, length = find_scene("four_bar_gravity"), 0.5
    mass = [float(body.mass or 0.0) for body in scene.body]
    spin = [float(np.ravel(body.inertia or 0.0)[-1]) for body in scene.body]
    weight = G * length * (mass[0] / 2 + mass[1] + mass[2] / 2)
    turning = sum(spin[k] + mass[k] * length**2 / 4 for k in (0, 2))
    rate = sqrt(weight / (turning + mass[1] * length**2))
    return [(1j * rate, -1j * rate), (-rate, rate)]


RATE = 6.0  # rad/s of the spindle of the turning mechanisms


def turning_pendulum() -> Scene:
    """Return a ball on an arm that hangs from a spindle, which turns about the vertical."""
    shaft = {"name": "spindle", "mass": 1.0, "inertia": [0.1] * 3, "position": [0.0] * 3}
    ball = {"name": "ball", "mass": 1.5, "inertia": [0.02] * 3, "position": [0.3, 0.0, -0.4]}
    return _scene(
        name="turning_pendulum",
        gravity=DOWN,
        body=[shaft, ball],
        joint=[_spindle("spindle"), _hinge("B", "spindle", "ball", (0.0,) * 3)],
        driver=[{"joint": "A", "polynomial": [0.0, RATE]}],
    )


def _turning_pendulum() -> Known:
    """Return exponents beside, below and above: s² = -U''/I, U = -m g l cos α - m l² Ω² sin² α / 2."""
    mass, length, own = 1.5, 0.5, 0.02
    inertia = own + mass * length**2
    beside = acos(G / (length * RATE**2))

    def squared(angle: float) -> float:
        bend = mass * G * length * cos(angle) - mass * length**2 * RATE**2 * cos(2 * angle)
        return -bend / inertia

    return [_roots_of_squares([squared(angle)]) for angle in (beside, 0.0, np.pi)]


BALL, SLEEVE, LINK, TOP = 0.8, 1.2, 0.4, 0.0  # kg, kg, m, m of Watt's governor


def governor() -> Scene:
    """Return Watt's governor: two balls on arms, and a sleeve on the spindle below, held by two links."""
    angle = 0.9
    x, z = LINK * sin(angle), -LINK * cos(angle)
    bodies = [
        {"name": "spindle", "mass": 1.0, "inertia": [0.1] * 3, "position": [0.0, 0.0, TOP]},
        {"name": "left", "mass": BALL, "inertia": [0.01] * 3, "position": [-x, 0.0, z]},
        {"name": "right", "mass": BALL, "inertia": [0.01] * 3, "position": [x, 0.0, z]},
        {"name": "sleeve", "mass": SLEEVE, "inertia": [0.02] * 3, "position": [0.0, 0.0, 2 * z]},
    ]
    slide = {"name": "S", "type": "translational", "bodies": ["spindle", "sleeve"]}
    joints = [
        _spindle("spindle"),
        _hinge("L", "spindle", "left", (0.0,) * 3),
        _hinge("R", "spindle", "right", (0.0,) * 3),
        {**slide, "anchor": [0.0, 0.0, 2 * z], "axis": [0.0, 0.0, 1.0]},
        *(
            {"name": f"{side} link", "type": "distance", "bodies": [side, "sleeve"], "anchors": ends}
            for side, ends in (
                ("left", [[-x, 0.0, z], [0.0, 0.0, 2 * z]]),
                ("right", [[x, 0.0, z], [0.0, 0.0, 2 * z]]),
            )
        ),
    ]
    driver = [{"joint": "A", "polynomial": [0.0, RATE + 4.0]}]
    return _scene(name="governor", gravity=DOWN, body=bodies, joint=joints, driver=driver)


def _governor() -> Known:
    """Return the exponents of the steady angle α of the arms: s² = -U''/I.

    U = -2 (m + M) g l cos α - m l² Ω² sin² α and I = 2 (J + m l²) + 4 M l² sin² α.
    """
    rate = RATE + 4.0
    cosine = (BALL + SLEEVE) * G / (BALL * LINK * rate**2)
    angle = acos(cosine)
    bend = 2 * (BALL + SLEEVE) * G * LINK * cosine - 2 * BALL * LINK**2 * rate**2 * cos(2 * angle)
    inertia = 2 * (0.01 + BALL * LINK**2) + 4 * SLEEVE * LINK**2 * sin(angle) ** 2
    return [_roots_of_squares([-bend / inertia])]


def _scene(**parts: Any) -> Scene:
    return Scene(**parts)


def _roots_of_squares(squares: Sequence[float] | np.ndarray) -> tuple[complex, ...]:
    """Return ± √s² of each square."""
    roots = np.sqrt(np.asarray(squares, dtype=complex))
    return tuple(np.concatenate([roots, -roots]).tolist())


def _hinge(name: str, first: str, second: str, anchor: Sequence[float]) -> Mapping[str, Any]:
    """Return a revolute joint about the y axis; a positive angle lowers a body that points along x."""
    return {
        "name": name,
        "type": "revolute",
        "bodies": [first, second],
        "anchor": list(anchor),
        "axis": [0.0, 1.0, 0.0],
    }


def _spindle(body: str) -> Mapping[str, Any]:
    hinge = {"name": "A", "type": "revolute", "bodies": ["ground", body]}
    return {**hinge, "anchor": [0.0] * 3, "axis": [0.0, 0.0, 1.0]}


MECHANISMS = (
    Mechanism("pendulum", "a rod on a hinge, below and above it", pendulum, _pendulum),
    Mechanism("double_pendulum", "two slender rods, each below or above", double_pendulum, _double_pendulum),
    Mechanism("damped_slides", "two sliders on a line, with unequal dampers", damped_slides, _damped_slides),
    Mechanism(
        "four_bar_gravity",
        "the parallelogram of hinges of the paper, three redundant rows",
        lambda: find_scene("four_bar_gravity"),
        _parallelogram,
    ),
    Mechanism(
        "spring_four_bar",
        "the IFToMM benchmark: rods of 1 m and 1 kg, a diagonal spring of 25 N/m and 1 N s/m",
        spring_four_bar,
        _spring_four_bar,
    ),
    Mechanism(
        "turning_pendulum",
        "a ball on an arm on a spindle that turns at 6 rad/s: beside, below and above the axis",
        turning_pendulum,
        _turning_pendulum,
    ),
    Mechanism("governor", "Watt's governor at 10 rad/s, with a sleeve", governor, _governor),
)
