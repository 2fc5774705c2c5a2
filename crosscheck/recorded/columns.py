"""Names, units and values of the columns of a motion, such as rod.position.x in m."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from crosscheck.judge.constraints import joint_coordinates, joint_rates, scene_length
from crosscheck.judge.joint_coordinates import COORDINATES
from crosscheck.judge.pieces import always_held
from crosscheck.judge.start import start_coordinates, started
from crosscheck.recorded.actions import action_names, actions
from crosscheck.recorded.reactions import reaction_names, reactions
from mbref.motions.trajectory import Trajectory
from mbref.scene import JointLoad, Scene
from mbref.scene.joints import ANGLE, DISPLACEMENT

# SI unit → other units in which columns are found by mistake, with their factors to SI
KNOWN_UNITS: dict[str, dict[str, float]] = {
    "s": {"ms": 1e-3, "min": 60.0},
    "m": {"mm": 1e-3, "cm": 1e-2, "km": 1e3, "um": 1e-6, "in": 0.0254, "ft": 0.3048},
    "rad": {"deg": np.pi / 180, "rev": 2 * np.pi},
    "m/s": {"mm/s": 1e-3, "cm/s": 1e-2},
    "rad/s": {"deg/s": np.pi / 180, "rpm": np.pi / 30},
    "m/s²": {"m/s2": 1.0, "m/s^2": 1.0, "mm/s²": 1e-3, "mm/s2": 1e-3, "mm/s^2": 1e-3},
    "rad/s²": {"rad/s2": 1.0, "rad/s^2": 1.0, "deg/s²": np.pi / 180, "deg/s2": np.pi / 180},
    "N": {"kN": 1e3, "mN": 1e-3},
    "N m": {"Nm": 1.0, "N*m": 1.0, "N mm": 1e-3, "Nmm": 1e-3, "N*mm": 1e-3},
    "W": {"mW": 1e-3, "kW": 1e3},
    "J": {"mJ": 1e-3, "kJ": 1e3},
    "1": {},
}
SI = {
    "time": "s",
    "position": "m",
    "orientation": "1",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "acceleration": "m/s²",
    "angular_acceleration": "rad/s²",
    "angle": "rad",
    "displacement": "m",
    "rate": "rad/s",
    "displacement_rate": "m/s",
    "length": "m",
    "length_rate": "m/s",
    "force": "N",
    "torque": "N m",
    "moment": "N m",
    "power": "W",
    "kinetic_energy": "J",
    "potential_energy": "J",
    "energy": "J",
}
VECTORS = {
    "position": "xyz",
    "orientation": "wxyz",
    "velocity": "xyz",
    "angular_velocity": "xyz",
    "acceleration": "xyz",
    "angular_acceleration": "xyz",
}
RATES = {ANGLE: "rate", DISPLACEMENT: "displacement_rate"}


def kind_of(column: str) -> str:
    """Return the quantity of a column: position for ``rod.position.x``, angle for ``A.angle``."""
    parts = column.split(".")
    return next((part for part in reversed(parts) if part in SI), "")


def names(scene: Scene) -> list[str]:
    """Return the names of all columns that a motion of the scene can have, without time. Where constraints
    come and go, drivers, reactions and joints that do not always hold have none."""
    held = always_held(scene)
    found = [
        f"{body.name}.{kind}.{axis}" for body in scene.body for kind, axes in VECTORS.items() for axis in axes
    ]
    moving = [joint for joint in held.joint if joint.facts.coordinates]
    found += [f"{joint.name}.{kind}" for joint in moving for kind in COORDINATES]
    found += [f"{joint.name}.{RATES[kind]}" for joint in moving for kind in joint.facts.coordinates]
    return found + action_names(held) + (reaction_names(scene) if held is scene else [])


def values(scene: Scene, motion: Trajectory, wanted: Collection[str] | None = None) -> dict[str, np.ndarray]:
    """Return columns (k,) of a motion, in SI units: all but reactions, or at least the ``wanted`` ones."""
    held, found = always_held(scene), dict[str, np.ndarray]()
    for b, body in enumerate(scene.body):
        for kind, axes in VECTORS.items():
            array = getattr(motion, kind)
            if array is not None:
                array = _continuous(array[:, b]) if kind == "orientation" else array[:, b]
                found.update({f"{body.name}.{kind}.{axis}": array[:, i] for i, axis in enumerate(axes)})
    pose = motion.position, motion.orientation
    coordinates = joint_coordinates(held, motion.times, *pose, motion.angular_velocity, motion.angles)
    rates = joint_rates(held, *pose, motion.velocity, motion.angular_velocity)
    for joint in held.joint:
        if joint.facts.coordinates:
            for i, kind in enumerate(COORDINATES):
                found[f"{joint.name}.{kind}"] = coordinates[joint.name][:, i]
                if kind in joint.facts.coordinates:
                    found[f"{joint.name}.{RATES[kind]}"] = rates[joint.name][:, i]
    if wanted is None or not set(wanted) <= set(found):
        found.update(actions(held, motion, found))
    return {**found, **(reactions(scene, motion, wanted or ()) if held is scene else {})}


def start_columns(scene: Scene) -> dict[str, float]:
    """Return the start values of joints' columns, which are zero in ``values``, for a scene whose couplings
    have offsets; an empty result without offsets."""
    if started(scene) is scene:
        return {}
    start = start_coordinates(scene)
    found = {
        f"{name}.{kind}": float(x)
        for name, both in start.items()
        for kind, x in zip(COORDINATES, both, strict=True)
    }
    for place, load in enumerate(scene.load):
        if isinstance(load, JointLoad):
            found[f"load({place}).{load.coordinate}"] = found[f"{load.joint}.{load.coordinate}"]
    return found


def _continuous(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions (k, 4) with signs that are continuous along the motion."""
    turns = np.einsum("ki,ki->k", quaternions[1:], quaternions[:-1]) < 0
    signs = np.where(np.cumsum(turns) % 2 == 1, -1.0, 1.0)
    return np.concatenate([quaternions[:1], signs[:, None] * quaternions[1:]])


def scales(scene: Scene, motion: Trajectory, columns: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return the size of each quantity in the motion, by which errors of different quantities are
    compared.

    Lengths and angles have the mechanism's length and 1 rad. Other quantities have the largest value in the
    ``columns``, at least what the mechanism's mass, length, gravity and the scene's duration give.
    """
    length, duration = scene_length(scene), scene.duration
    speed = float(np.linalg.norm(motion.velocity, axis=-1).max(initial=0.0))
    turning = float(np.linalg.norm(motion.angular_velocity, axis=-1).max(initial=0.0))
    acceleration = float(np.linalg.norm(scene.gravity)) + length / duration**2
    weight = sum(body.mass or 0.0 for body in scene.body) * acceleration
    found = {kind: {"m": length}.get(unit, 1.0) for kind, unit in SI.items()}
    least = {"m/s": max(speed, length / duration), "rad/s": max(turning, 1 / duration)}
    least |= {"m/s²": acceleration, "rad/s²": acceleration / length}
    least |= {"N": weight, "N m": weight * length, "J": weight * length, "W": weight * length / duration}
    for unit, size in least.items():
        kinds = [kind for kind, si in SI.items() if si == unit]
        whole = [np.abs(c).max(initial=0.0) for n, c in columns.items() if kind_of(n) in kinds]
        found.update(dict.fromkeys(kinds, max([size, *whole]) or 1.0))
    return found
