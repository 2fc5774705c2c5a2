"""Mechanisms on which derivatives of engines are compared if no scene is given."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from crosscheck.closed_loops.mechanisms import FOLDER
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from mbref.scene import Body, Scene
from mbref.scenes import find_scene

FINDINGS = Path(__file__).parents[1] / "findings"
FAST = 10.0  # factor on velocities: terms of velocities are a hundred times as large as in the slow mechanism
NEAR = 0.01  # rad from a singular position
LENGTH = 0.5  # m, of crank and rod
RATE = 3.0  # rad/s


class Mechanism(NamedTuple):
    """A mechanism with loops: its name, the sentence on its difficulty, and the function that makes it."""

    name: str
    about: str
    make: Callable[[], Scene]


def _of_file(path: Path, body: str = "", rate: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    """Return the scene of a file, in which a body turns at a rate (rad/s), so that the others move."""
    scene = find_scene(str(path))
    return _turning(scene, body, rate) if body else scene


def _turning(scene: Scene, name: str, rate: tuple[float, float, float]) -> Scene:
    moved = [b.model_copy(update={"angular_velocity": rate}) if b.name == name else b for b in scene.body]
    return scene.with_(body=moved)


def _fast() -> Scene:
    found = _of_file(FINDINGS / "ball_four_bar.toml")
    bodies = [body.model_copy(update=_scaled(body)) for body in found.body]
    return found.with_(name="fast_four_bar", body=bodies)


def _scaled(body: Body) -> dict[str, Any]:
    given = {name: getattr(body, name) for name in ("velocity", "angular_velocity")}
    return {name: tuple(FAST * x for x in value) for name, value in given.items() if value is not None}


def _near_singular() -> Scene:
    """Return a slider-crank of equal crank and rod, whose slider is near the crank's pin."""
    angle = math.pi / 2 - NEAR
    x, y = LENGTH * math.cos(angle), LENGTH * math.sin(angle)
    hinge = {"type": "revolute", "axis": [0.0, 0.0, 1.0]}
    pins = (
        ("A", "ground", "crank", (0.0, 0.0)),
        ("B", "crank", "rod", (x, y)),
        ("C", "rod", "slider", (2 * x, 0.0)),
    )
    joints = [{**hinge, "name": n, "bodies": [a, b], "anchor": [*at, 0.0]} for n, a, b, at in pins]
    rail = {"name": "D", "type": "translational", "bodies": ["ground", "slider"], "axis": [1.0, 0.0, 0.0]}
    bodies = [
        _rod("crank", 1.0, x / 2, y / 2) | {"angular_velocity": [0.0, 0.0, RATE]},
        _rod("rod", 1.2, 1.5 * x, y / 2),
        _rod("slider", 0.8, 2 * x, 0.0),
    ]
    joints.append({**rail, "anchor": [2 * x, 0.0, 0.0]})
    return Scene(name="near_singular", gravity=(0.0, -9.81, 0.0), duration=0.001, body=bodies, joint=joints)


def _rod(name: str, mass: float, x: float, y: float) -> dict[str, Any]:
    return {"name": name, "mass": mass, "inertia": [0.01, 0.02, 0.03], "position": [x, y, 0.0]}


def _whirling() -> Scene:
    """Return a body that turns about a ball joint while a link of constant length to the point P holds its
    point Q. Its angular velocity, Q + P, is perpendicular to Q × P, so that the link keeps its length."""
    p, q = (0.7, -0.3, 0.6), (0.5, 0.4, 0.2)
    ball = {"name": "ball", "type": "spherical", "bodies": ["ground", "b"], "anchor": [0.0, 0.0, 0.0]}
    link = {"name": "link", "type": "distance", "bodies": ["ground", "b"], "anchors": [p, q]}
    spin = tuple(a + b for a, b in zip(p, q, strict=True))
    body = _rod("b", 1.3, 0.4, 0.2) | {"inertia": [0.2, 0.3, 0.4], "angular_velocity": spin}
    body["position"] = [0.4, 0.2, 0.1]
    return Scene(name="whirling", gravity=(0.0, -3.0, -9.0), duration=1.0, body=[body], joint=[ball, link])


def _coupled(law: dict[str, Any]) -> Scene:
    """Return a crank that a coupling joins to a wheel, and a rod on the wheel's rim of which a link of
    constant length holds the end to the crank."""
    axis = {"type": "revolute", "axis": [0.0, 0.0, 1.0]}
    pins = (
        ("A", "ground", "crank", (0.0, 0.0)),
        ("W", "ground", "wheel", (0.6, 0.0)),
        ("P", "wheel", "rod", (0.8, 0.1)),
    )
    joints = [{**axis, "name": n, "bodies": [a, b], "anchor": [*at, 0.0]} for n, a, b, at in pins]
    ends = [[0.1, 0.3, 0.0], [0.7, 0.5, 0.0]]
    joints.append({"name": "link", "type": "distance", "bodies": ["crank", "rod"], "anchors": ends})
    bodies = [
        _rod("crank", 1.0, 0.05, 0.15) | {"angular_velocity": [0.0, 0.0, RATE]},
        _rod("wheel", 2.0, 0.6, 0.0),
        _rod("rod", 0.7, 0.75, 0.3),
    ]
    coupling = [{"name": "gears", "joints": ["A", "W"], **law}]
    return Scene(
        name="coupled", gravity=(0.0, -9.81, 0.0), duration=1.0, body=bodies, joint=joints, coupling=coupling
    )


def _point() -> Scene:
    return _of_file(FINDINGS / "ball_four_bar.toml")


def _weld() -> Scene:
    return _of_file(FINDINGS / "hinged_four_bar.toml")


def _cranks() -> Scene:
    return _of_file(FOLDER / "three_cranks.toml", "crank1", (0.0, 0.0, RATE))


def _bennett() -> Scene:
    return _of_file(FINDINGS / "bennett.toml", "link3", (0.0, 0.0, RATE))


MECHANISMS = (
    Mechanism("ball_four_bar", "A planar four-bar whose loop a ball joint closes.", _point),
    Mechanism("hinged_four_bar", "A planar four-bar of four hinges; three rows are redundant.", _weld),
    Mechanism("three_cranks", "A coupler on three parallel cranks; one crank more than needed.", _cranks),
    Mechanism("bennett", "Bennett's spatial four-bar of four hinges; three rows are redundant.", _bennett),
    Mechanism(
        "random_0",
        "A spatial mechanism with universal, spherical and cylindrical joints.",
        lambda: random_mechanism(0),
    ),
    Mechanism(
        "random_2",
        "A spatial mechanism whose loop a point closes between bodies.",
        lambda: random_mechanism(2),
    ),
    Mechanism(
        "fast_four_bar", "The first mechanism, ten times as fast: terms of velocities dominate.", _fast
    ),
    Mechanism(
        "near_singular",
        f"A slider-crank with equal crank and rod, {NEAR:g} rad from its singular position.",
        _near_singular,
    ),
)

BY_NAME = {mechanism.name: mechanism for mechanism in MECHANISMS}
# mechanisms of the cards
SPATIAL = (
    Mechanism("whirling", "A body on a ball joint and a link; its principal axes turn.", _whirling),
    BY_NAME["ball_four_bar"],
    BY_NAME["random_2"],
)
FAST_LOOP, REDUNDANT = (BY_NAME["fast_four_bar"],), (BY_NAME["hinged_four_bar"],)
COUPLED = (
    Mechanism("geared", "A gear pair in a loop.", lambda: _coupled({"ratio": -0.5})),
    Mechanism("cam", "A cam of degree 2 in a loop.", lambda: _coupled({"polynomial": [-0.5, 0.3]})),
)
