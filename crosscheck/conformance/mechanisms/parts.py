"""Parts of mechanisms: bars and linkages in the xy-plane, rods with products of inertia, chains of joints,
rounded numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from crosscheck.conformance.changes.isometry import Isometry
from mbref import rotations
from mbref.scene import (
    JOINT_TYPES,
    Body,
    Joint,
    Revolute,
    Scene,
    Spherical,
    Translational,
)

GRAVITY, DOWN = (0.0, -9.81, 0.0), (0.0, 0.0, -9.81)
Z = (0.0, 0.0, 1.0)
Triple = tuple[float, float, float]
Rng: TypeAlias = np.random.Generator
Place: TypeAlias = Sequence[float] | np.ndarray


def triple(values: Any) -> Triple:
    """Return three numbers as Python floats."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def rows(matrix: np.ndarray) -> tuple[Triple, Triple, Triple]:
    """Return a matrix (3, 3) as tuples, as the scene format stores it."""
    x, y, z = (triple(row) for row in matrix)
    return x, y, z


def direction(rng: Rng) -> np.ndarray:
    """Return a random unit vector (3,)."""
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def bar(name: str, start: Place, stop: Place, mass: float = 1.0) -> Body:
    """Return a bar between two points of the xy-plane, with its x axis along the bar."""
    way = np.subtract(stop, start)
    half, length = math.atan2(way[1], way[0]) / 2, float(np.linalg.norm(way))
    long = mass * length**2 / 12
    return Body(
        name=name,
        mass=mass,
        inertia=(0.1 * long, long, 1.1 * long),
        orientation=_q(half),
        position=tuple((np.add(start, stop) / 2).tolist()),
    )


def _q(half: float) -> tuple[float, float, float, float]:
    return math.cos(half), 0.0, 0.0, math.sin(half)


def hinge(name: str, first: str, second: str, place: Place) -> Revolute:
    """Return a hinge about z."""
    x, y, z = place
    return Revolute(name=name, bodies=(first, second), anchor=(x, y, z), axis=Z)


def linkage(name: str, places: Sequence[Place], masses: Sequence[float] = (1.0, 1.0, 1.0)) -> Scene:
    """Return bars between successive points, hinged to each other and to the ground at both ends."""
    names = ["ground", *(f"bar{k}" for k in range(len(places) - 1)), "ground"]
    bars = [bar(n, p, q, m) for n, p, q, m in zip(names[1:-1], places[:-1], places[1:], masses, strict=True)]
    pins = [
        hinge(f"P{k}", a, b, p) for k, (a, b, p) in enumerate(zip(names[:-1], names[1:], places, strict=True))
    ]
    return Scene(name=name, gravity=GRAVITY, duration=0.5, body=tuple(bars), joint=tuple(pins))


def turning(scene: Scene, rate: float) -> Scene:
    """Return the linkage with the first bar at a given rate (rad/s)."""
    first = scene.body[0].model_copy(update={"angular_velocity": (0.0, 0.0, rate)})
    return scene.with_(body=(first, *scene.body[1:]))


def turned(rng: Rng, scene: Scene) -> Scene:
    """Return the scene rotated and shifted, so that its numbers are rounded."""
    turn = rotations.to_matrix(rotations.from_vector(rng.normal(size=3)))
    return Isometry(turn, rng.normal(size=3)).change(scene)


def rod(name: str, start: Place, stop: Place, rng: Rng, thickness: float = 0.05) -> Body:
    """Return a body between two points with products of inertia."""
    way = np.subtract(stop, start)
    length, mass = float(np.linalg.norm(way)), float(rng.uniform(0.3, 3.0))
    along = way / length
    across = np.eye(3) - np.outer(along, along) + thickness**2 * np.outer(along, along)
    turn = rotations.to_matrix(rotations.from_vector(0.2 * rng.normal(size=3)))
    inertia = mass * length**2 / 12 * (turn @ across @ turn.T)
    return Body(
        name=name,
        mass=mass,
        position=triple(np.add(start, stop) / 2),
        inertia=rows((inertia + inertia.T) / 2),
    )


def ring(rng: Rng, name: str, kinds: Sequence[str], axes: Sequence[np.ndarray], points: np.ndarray) -> Scene:
    """Return rods through points (k, 3) from the ground back to the ground, with a joint of given kind and
    axis at each point."""
    names = ["ground", *(f"link{k}" for k in range(len(points) - 1)), "ground"]
    bodies = [rod(n, p, q, rng) for n, p, q in zip(names[1:-1], points[:-1], points[1:], strict=True)]
    joints = [
        joint(f"J{k}", kind, (names[k], names[k + 1]), triple(points[k]), axes[k])
        for k, kind in enumerate(kinds)
    ]
    return Scene(name=name, gravity=DOWN, duration=0.5, body=tuple(bodies), joint=tuple(joints))


def joint(name: str, kind: str, bodies: tuple[str, str], place: Any, axis: np.ndarray) -> Joint:
    """Return a joint at a point with the given axis, which is the first axis of a joint with two
    perpendicular axes."""
    other = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    axes = (triple(axis), triple(other / np.linalg.norm(other)))
    return JOINT_TYPES[kind].at(
        name, bodies, anchor=place, axis=triple(axis), axes=axes, anchors=(place, place)
    )


def turning_first(scene: Scene, spin: np.ndarray) -> Scene:
    """Return the scene with the given angular velocity of the first body."""
    first = scene.body[0].model_copy(update={"angular_velocity": triple(spin)})
    return scene.with_(body=(first, *scene.body[1:]))


def slider_crank(angle: float, crank: float, length: float) -> Scene:
    """Return a planar slider-crank at a given crank angle."""
    b = np.array([crank * math.cos(angle), crank * math.sin(angle), 0.0])
    c = np.array([b[0] + math.sqrt(length**2 - b[1] ** 2), 0.0, 0.0])
    bodies = (
        bar("crank", (0, 0, 0), triple(b)),
        bar("rod", triple(b), triple(c)),
        Body(name="slider", mass=2.0, inertia=(0.01, 0.01, 0.01), position=triple(c)),
    )
    joints = (
        hinge("A", "ground", "crank", (0, 0, 0)),
        hinge("B", "crank", "rod", b),
        Spherical(name="C", bodies=("rod", "slider"), anchor=triple(c)),
        Translational(name="D", bodies=("slider", "ground"), anchor=triple(c), axis=(1.0, 0.0, 0.0)),
    )
    return Scene(name="slider_crank", gravity=(0.0, -9.81, 0.0), body=bodies, joint=joints)
