"""Bodies and joints of test scenes in a few words; all numbers are given, none is random."""

from typing import Any

import numpy as np

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SKEW = (0.36, 0.48, 0.8)
Entry = dict[str, Any]
Point = tuple[float, ...]


def block(name: str, position: Point, mass: float = 1.5, **fields: Any) -> Entry:
    """Return a body without symmetry: its moments differ and its axes are turned."""
    return {
        "name": name,
        "mass": mass,
        "inertia": [0.05 * mass, 0.07 * mass, 0.09 * mass],
        "position": list(position),
        "orientation": [0.8, 0.2, -0.4, 0.4],
        **fields,
    }


def rod(name: str, start: Point, stop: Point, mass: float = 1.0) -> Entry:
    """Return a rod: m l² / 12 across it and m l² / 1000 about it. Its axes are the world's."""
    (x, y, z), (u, v, w) = start, stop
    length = np.linalg.norm(np.subtract(stop, start))
    across, thin = mass * length**2 / 12, 1e-3 * mass * length**2
    along = np.subtract(stop, start) / length
    inertia = across * np.eye(3) + (thin - across) * np.outer(along, along)
    middle = [(x + u) / 2, (y + v) / 2, (z + w) / 2]
    return {"name": name, "mass": mass, "inertia": inertia.tolist(), "position": middle}


def joint(name: str, kind: str, first: str, second: str, at: Point = (0.0, 0.0, 0.0), **fields: Any) -> Entry:
    """Return a joint of a type between two bodies, at a point of the world at t = 0."""
    place = {"anchors": fields.pop("anchors")} if kind == "distance" else {"anchor": list(at)}
    return {"name": name, "type": kind, "bodies": [first, second], **place, **fields}


def hinge(name: str, first: str, second: str, at: Point, axis: Point = Z, **fields: Any) -> Entry:
    """Return a revolute joint."""
    return joint(name, "revolute", first, second, at, axis=list(axis), **fields)


def slide(name: str, first: str, second: str, at: Point, axis: Point = X, **fields: Any) -> Entry:
    """Return a translational joint."""
    return joint(name, "translational", first, second, at, axis=list(axis), **fields)


def spring(
    first: str, start: Point, second: str, stop: Point, stiffness: float, natural_length: float,
    damping: float = 0.0,
) -> Entry:  # fmt: skip
    """Return a spring between points of two bodies (m, at t = 0)."""
    ends = {"bodies": [first, second], "points": [start, stop], "natural_length": natural_length}
    return {"type": "spring", **ends, "stiffness": stiffness, "damping": damping}


def turning_about(anchor: Point, axis: Point, rate: float, body: Entry) -> Entry:
    """Return the body with the velocities of a rotation about a fixed axis."""
    spin = rate * np.array(axis) / np.linalg.norm(axis)
    velocity = np.cross(spin, np.subtract(body["position"], anchor))
    return {**body, "velocity": velocity.tolist(), "angular_velocity": spin.tolist()}
