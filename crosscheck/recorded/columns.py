"""Names, units and values of the columns of a motion, such as rod.position.x in m."""

from __future__ import annotations

import numpy as np

from crosscheck.judge.constraints import joint_coordinates, scene_length
from crosscheck.judge.joint_coordinates import COORDINATES
from crosscheck.judge.start import start_coordinates, started
from mbref.scene import Scene
from mbref.trajectory import Trajectory

UNITS = {  # name → factor to SI
    "s": 1.0,
    "ms": 1e-3,
    "min": 60.0,
    "m": 1.0,
    "mm": 1e-3,
    "cm": 1e-2,
    "um": 1e-6,
    "in": 0.0254,
    "ft": 0.3048,
    "rad": 1.0,
    "deg": np.pi / 180,
    "rev": 2 * np.pi,
    "m/s": 1.0,
    "mm/s": 1e-3,
    "cm/s": 1e-2,
    "rad/s": 1.0,
    "deg/s": np.pi / 180,
    "rpm": np.pi / 30,
    "1": 1.0,
    "": 1.0,
}
SI = {
    "time": "s",
    "position": "m",
    "orientation": "1",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "angle": "rad",
    "displacement": "m",
}
VECTORS = {"position": "xyz", "orientation": "wxyz", "velocity": "xyz", "angular_velocity": "xyz"}


def kind_of(column: str) -> str:
    """Return the quantity of a column: position for ``rod.position.x``, angle for ``A.angle``."""
    parts = column.split(".")
    return next((part for part in reversed(parts) if part in SI), "")


def names(scene: Scene) -> list[str]:
    """Return the names of all columns that a motion of the scene can have, without time."""
    found = [
        f"{body.name}.{kind}.{axis}" for body in scene.body for kind, axes in VECTORS.items() for axis in axes
    ]
    driven = [joint.name for joint in scene.joint if joint.facts.driven]
    return found + [f"{joint}.{kind}" for joint in driven for kind in ("angle", "displacement")]


def values(scene: Scene, motion: Trajectory) -> dict[str, np.ndarray]:
    """Return every column (k,) of a motion, in SI units."""
    found: dict[str, np.ndarray] = {}
    for b, body in enumerate(scene.body):
        for kind, axes in VECTORS.items():
            array = getattr(motion, kind)[:, b]
            array = _continuous(array) if kind == "orientation" else array
            found.update({f"{body.name}.{kind}.{axis}": array[:, i] for i, axis in enumerate(axes)})
    coordinates = joint_coordinates(
        scene, motion.times, motion.position, motion.orientation, motion.angular_velocity
    )
    for joint, both in coordinates.items():
        found[f"{joint}.angle"], found[f"{joint}.displacement"] = both[:, 0], both[:, 1]
    return found


def start_columns(scene: Scene) -> dict[str, float]:
    """Return the start values of joints' columns, which are zero in ``values``, for a scene whose couplings
    have offsets; an empty result without offsets."""
    if started(scene) is scene:
        return {}
    pairs = start_coordinates(scene).items()
    return {
        f"{name}.{kind}": float(x) for name, both in pairs for kind, x in zip(COORDINATES, both, strict=True)
    }


def _continuous(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions (k, 4) with signs that are continuous along the motion."""
    turns = np.einsum("ki,ki->k", quaternions[1:], quaternions[:-1]) < 0
    signs = np.where(np.cumsum(turns) % 2 == 1, -1.0, 1.0)
    return np.concatenate([quaternions[:1], signs[:, None] * quaternions[1:]])


def scales(scene: Scene, motion: Trajectory) -> dict[str, float]:
    """Return the size of each quantity in the motion, by which errors of different quantities are
    compared."""
    length = scene_length(scene)
    speed = float(np.linalg.norm(motion.velocity, axis=2).max(initial=0.0))
    turning = float(np.linalg.norm(motion.angular_velocity, axis=2).max(initial=0.0))
    least = length / scene.duration
    return {
        "position": length,
        "displacement": length,
        "orientation": 1.0,
        "angle": 1.0,
        "velocity": max(speed, least),
        "angular_velocity": max(turning, least / length),
    }
