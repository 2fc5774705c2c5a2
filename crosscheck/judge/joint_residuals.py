"""One joint as a mate of two frames: its packing, and its residuals at three levels.

The frames have their third axis along the joint's axis and coincide at t = 0; those of a universal joint
share the origin only, and each follows its own axis.  The residuals are the components of the relative
displacement (m, resolved in the first frame) and of the relative rotation (rad) that the joint forbids;
the driver's residual stands last.  Arrays have any leading shape (…), and the ground as their last body.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mbref import rotations
from mbref.scene import GROUND, Driver, Joint, Scene

DISPLACEMENT = {"fixed": 3, "revolute": 3, "universal": 3, "spherical": 3,
                "translational": 2, "cylindrical": 2}  # fmt: skip
ROTATION = {"fixed": 3, "revolute": 2, "translational": 3, "cylindrical": 2}  # leading components forbidden
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Mate:
    """A joint packed for arrays: body indices (-1 ground), frames on the bodies, and its driver."""

    name: str
    type: str
    bodies: tuple[int, ...]
    points: np.ndarray  # (2, 3) frame origins, in the body frames
    frames: np.ndarray  # (2, 4) frame orientations, frame to body
    length: float  # of a distance joint, else 0
    driver: Driver | None


@functools.lru_cache(maxsize=64)
def mates(scene: Scene) -> tuple[Mate, ...]:
    """The joints of a scene, packed."""
    drivers = {driver.joint: driver for driver in scene.driver}
    return tuple(_mate(scene, joint, drivers.get(joint.name)) for joint in scene.joint)


def _mate(scene: Scene, joint: Joint, driver: Driver | None) -> Mate:
    anchors = np.array(joint.anchors if joint.type == "distance" else (joint.anchor,) * 2)
    frames = np.array([_frame(axis) for axis in _axes(joint)])
    points = anchors.copy()
    for k, name in enumerate(joint.bodies):
        if name != GROUND:
            body = scene.body[scene.body_index(name)]
            back = rotations.conjugate(np.array(body.orientation))
            points[k] = rotations.rotate(back, anchors[k] - body.position)
            frames[k] = rotations.multiply(back, frames[k])
    indices = tuple(scene.body_index(name) for name in joint.bodies)
    length = float(np.linalg.norm(anchors[1] - anchors[0]))
    return Mate(joint.name, joint.type, indices, points, frames, length, driver)


def _axes(joint: Joint) -> Sequence[Sequence[float]]:
    if joint.type == "universal":
        return joint.axes
    if joint.type in ("revolute", "translational", "cylindrical"):
        return (joint.axis,) * 2
    return ((0.0, 0.0, 1.0),) * 2


def _frame(axis: Sequence[float]) -> np.ndarray:
    """Quaternion of a frame whose third axis is along `axis`."""
    z = np.array(axis, dtype=float) / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return rotations.from_matrix(np.column_stack([x, np.cross(z, x), z]))


def driver_value(driver: Driver, t: np.ndarray | float, derivative: int = 0) -> np.ndarray:
    """Value of a driver, or its first or second time derivative, at times t (…)."""
    t = np.asarray(t, dtype=float)
    polynomial = np.polynomial.Polynomial(driver.polynomial)
    total = np.asarray((polynomial.deriv(derivative) if derivative else polynomial)(t)) + np.zeros_like(t)
    if driver.sine is None:
        return total
    w = driver.sine.frequency
    angle = w * t + driver.sine.phase + derivative * np.pi / 2
    return total + driver.sine.amplitude * w**derivative * np.sin(angle)


def are_lengths(mate: Mate) -> np.ndarray:
    """Which of a mate's residuals are lengths (True, m), which angles (False, rad)."""
    if mate.type == "distance":
        return np.array([True])
    angles = ROTATION.get(mate.type, int(mate.type == "universal"))
    driver = [mate.type == "translational"] if mate.driver else []
    return np.array([True] * DISPLACEMENT[mate.type] + [False] * angles + driver)


def position_rows(mate: Mate, t: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Residuals (…, rows), m and rad, of positions (…, nb + 1, 3) and quaternions (…, nb + 1, 4)."""
    _, offset, frames = _in_world(mate, position, orientation)
    if mate.type == "distance":
        return np.linalg.norm(offset, axis=-1, keepdims=True) - mate.length
    relative = rotations.multiply(rotations.conjugate(frames[0]), frames[1])
    local = _resolve(frames[0], offset)
    rows = [local[..., : DISPLACEMENT[mate.type]]]
    if mate.type == "universal":
        rows.append(np.arcsin(np.clip(rotations.to_matrix(relative)[..., 2, 2:], -1, 1)))
    elif mate.type in ROTATION:
        rows.append(_turn(relative) if ROTATION[mate.type] == 3 else _tilt(relative))
    if mate.driver:
        value = driver_value(mate.driver, t)
        slides = mate.type == "translational"
        rows.append((local[..., 2] - value if slides else wrapped(_twist(relative) - value))[..., None])
    return np.concatenate(rows, axis=-1)


def velocity_rows(
    mate: Mate, t: np.ndarray, position: np.ndarray, orientation: np.ndarray,
    velocity: np.ndarray, spin: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Forbidden components (…, rows) of the frames' relative twist, of world velocities (…, nb + 1, 3)."""
    arms, offset, frames = _in_world(mate, position, orientation)
    w = [spin[..., b, :] for b in mate.bodies]
    dv = _difference(velocity[..., b, :] + np.cross(w[k], arms[k]) for k, b in enumerate(mate.bodies))
    if mate.type == "distance":
        return _dot(offset, dv) / np.linalg.norm(offset, axis=-1, keepdims=True)
    linear = _resolve(frames[0], dv - np.cross(w[0], offset))
    angular = _resolve(frames[0], w[1] - w[0])
    crossing = [_dot(w[1] - w[0], _crossing(frames)[0])] if mate.type == "universal" else []
    return _rows(mate, linear, angular, crossing, t, 1)


def acceleration_rows(
    mate: Mate, t: np.ndarray, position: np.ndarray, orientation: np.ndarray,
    velocity: np.ndarray, spin: np.ndarray, acceleration: np.ndarray, spin_rate: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Time derivative (…, rows) of `velocity_rows`, of world accelerations (…, nb + 1, 3)."""
    arms, offset, frames = _in_world(mate, position, orientation)
    w = [spin[..., b, :] for b in mate.bodies]
    dw = [spin_rate[..., b, :] for b in mate.bodies]
    dv = _difference(velocity[..., b, :] + np.cross(w[k], arms[k]) for k, b in enumerate(mate.bodies))
    da = _difference(
        acceleration[..., b, :] + np.cross(dw[k], arms[k]) + np.cross(w[k], np.cross(w[k], arms[k]))
        for k, b in enumerate(mate.bodies)
    )
    if mate.type == "distance":
        length = np.linalg.norm(offset, axis=-1, keepdims=True)
        along = _dot(offset, dv) / length
        return (_dot(offset, da) + _dot(dv, dv) - along**2) / length
    seen = da - np.cross(dw[0], offset) - 2 * np.cross(w[0], dv) + np.cross(w[0], np.cross(w[0], offset))
    angular = _resolve(frames[0], dw[1] - dw[0] - np.cross(w[0], w[1]))
    crossing = [_crossing_acceleration(frames, w, dw)] if mate.type == "universal" else []
    return _rows(mate, _resolve(frames[0], seen), angular, crossing, t, 2)


def coordinates(
    mate: Mate, times: np.ndarray, position: np.ndarray, orientation: np.ndarray, spin: np.ndarray
) -> np.ndarray:
    """(k, 2) unwrapped angle about the axis and displacement along it since t = 0, over k samples."""
    _, offset, frames = _in_world(mate, position, orientation)
    twist = _twist(rotations.multiply(rotations.conjugate(frames[0]), frames[1]))
    rate = _resolve(frames[0], spin[..., mate.bodies[1], :] - spin[..., mate.bodies[0], :])[..., 2]
    return np.stack([counted(times, twist, rate), _resolve(frames[0], offset)[..., 2]], axis=-1)


def counted(times: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Angles (k,), known up to turns and zero at t = 0, with their turns counted by the rates (k,).

    Between samples the change nearest to the trapezoid of the rates is taken; NaN from where the rates
    near a sample differ so much that this does not tell the turn.
    """
    before, step = np.concatenate([rate[:1], rate[:-1]]), np.diff(times, prepend=0.0)
    expected = step * (rate + before) / 2
    change = expected + wrapped(np.diff(angle, prepend=0.0) - expected)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(rate, 2, mode="edge"), 5, axis=0)
    doubt = step * (near.max(axis=-1) - near.min(axis=-1))
    doubt[:1] = np.abs(step[:1] * rate[:1])
    return np.where(np.cumsum(doubt >= np.pi) > 0, np.nan, np.cumsum(change))


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles (…) brought to [-π, π] by turns."""
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def _in_world(
    mate: Mate, position: np.ndarray, orientation: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray, list[np.ndarray]]:
    """Arms from the centres to the origins (…, 3), offset between the origins, frame quaternions."""
    p = [orientation[..., b, :] for b in mate.bodies]
    arms = [rotations.rotate(p[k], mate.points[k]) for k in (0, 1)]
    offset = _difference(position[..., b, :] + arms[k] for k, b in enumerate(mate.bodies))
    return arms, offset, [rotations.multiply(p[k], mate.frames[k]) for k in (0, 1)]


def _rows(
    mate: Mate, linear: np.ndarray, angular: np.ndarray, crossing: list, t: np.ndarray, derivative: int
) -> np.ndarray:
    """Rows of a rate: forbidden displacement, forbidden rotation (or the universal's), then the driver."""
    rows = [linear[..., : DISPLACEMENT[mate.type]], angular[..., : ROTATION.get(mate.type, 0)], *crossing]
    if mate.driver:
        done = (linear if mate.type == "translational" else angular)[..., 2:]
        rows.append(done - driver_value(mate.driver, t, derivative)[..., None])
    return np.concatenate(rows, axis=-1)


def _crossing(frames: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Unit normal of a universal's two axes, the sine of the angle between them, and the axes (world)."""
    axes = [rotations.rotate(frame, Z) for frame in frames]
    normal = np.cross(axes[1], axes[0])
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal / size, size, axes


def _crossing_acceleration(frames: list, w: list[np.ndarray], dw: list[np.ndarray]) -> np.ndarray:
    normal, size, axes = _crossing(frames)
    turning = np.cross(np.cross(w[1], axes[1]), axes[0]) + np.cross(axes[1], np.cross(w[0], axes[0]))
    turning = (turning - normal * _dot(normal, turning)) / size
    return _dot(dw[1] - dw[0], normal) + _dot(w[1] - w[0], turning)


def _resolve(frame: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return rotations.rotate(rotations.conjugate(frame), vector)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1, keepdims=True)


def _difference(pair: Iterable[np.ndarray]) -> np.ndarray:
    first, second = pair
    return second - first


def _turn(q: np.ndarray) -> np.ndarray:
    """Rotation vectors (…, 3), length ≤ π, of unit quaternions."""
    q = np.where(q[..., :1] < 0, -q, q)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    return 2 * np.arctan2(size, q[..., :1]) * q[..., 1:] / np.where(size > 0, size, 1)


def _tilt(q: np.ndarray) -> np.ndarray:
    """First two components (…, 2) of the shortest rotation vector from one third axis to the other."""
    x, y, z = np.moveaxis(rotations.to_matrix(q)[..., 2], -1, 0)
    sine = np.hypot(x, y)
    size = np.where(sine > 0, sine, 1)
    unit = np.stack([np.where(sine > 0, -y / size, 1.0), x / size], axis=-1)  # any direction when opposite
    return unit * np.arctan2(sine, z)[..., None]


def _twist(q: np.ndarray) -> np.ndarray:
    """Angle about the third axis, up to turns."""
    return 2 * np.arctan2(q[..., 3], q[..., 0])
