"""Slider-crank in space: crank on a revolute, rod on a universal and a spherical joint, slider on a line.

The slider's position is the intersection of the line with a sphere about the crank pin whose radius is the
rod's length.  The rod turns with x, its direction, and with z, its own axis of the universal joint, which
keeps its angle to x and stays perpendicular to the crank's axis e: ω = x × x' + λ x with λ such that e·z
stays zero.
"""

from __future__ import annotations

import numpy as np

from crosscheck.judge.loads import cross, initial_rotations
from crosscheck.judge.truth.one_dof import Path, Pose, circle, turned
from crosscheck.judge.truth.parallelogram import turning_driver, unit
from crosscheck.judge.truth.picard import REAL
from crosscheck.judge.truth.planar_slider_crank import parts_of
from mbref.scene import Scene, Universal

ALONG = 1 - 1e-6  # cosine of the angle of two unit vectors, above which one of them is along the other


def spatial_slider_crank(scene: Scene) -> Path | None:
    """Return the path of a scene that may be a spatial slider-crank, or None."""
    parts = parts_of(scene, Universal)
    if parts is None:
        return None
    crank, rod, slider, pivot, pin, end, guide = parts
    axis, line = unit(pivot.axis), unit(guide.axis)
    first = pin.bodies.index(scene.body[crank].name)
    e0, z0 = unit(pin.axes[first]), unit(pin.axes[1 - first])
    centre, b0, c0 = (np.array(joint.anchor, dtype=REAL) for joint in (pivot, pin, end))
    x0 = unit(c0 - b0)
    if _is_along(z0, x0) or _is_along(e0, x0):
        return None
    arm, length, lean = b0 - centre, np.sqrt(np.sum((c0 - b0) ** 2)), z0 @ x0
    side = float(np.sign((c0 - b0) @ line))
    hand = np.sign(np.cross(e0, x0) @ z0)
    rotation0 = initial_rotations(scene)
    position0 = np.array([body.position for body in scene.body])
    triad0 = _triad(x0[None], z0[None])[0]

    def poses(q: np.ndarray) -> Pose:
        pins, slides = circle(axis, q, arm), _slide(circle(axis, q, arm), c0 - centre, line, length, side)
        x, dx, ddx = (
            ((n == 0) * (c0 - centre) + slides[n][:, None] * line - pins[n]) / length for n in range(3)
        )
        e = turned(axis, q) @ e0
        z = _held(x, e, lean, hand)
        w, dw = _spin(x, dx, ddx, z, e, np.broadcast_to(axis, e.shape))
        rod_rotation = _triad(x, z) @ triad0.T @ rotation0[rod]
        offset = (rod_rotation @ rotation0[rod].T) @ (position0[rod] - b0)
        swing, still = cross(w, offset), 0 * x
        bend = cross(dw, offset) + cross(w, swing)
        along = [s[:, None] * line for s in slides]
        crank_path = circle(axis, q, position0[crank] - centre)
        paths = {
            crank: (centre + crank_path[0], *crank_path[1:], axis + still, still),
            rod: (centre + pins[0] + offset, pins[1] + swing, pins[2] + bend, w, dw),
            slider: (position0[slider] + along[0], *along[1:], still, still),
        }
        rotations = {
            crank: turned(axis, q) @ rotation0[crank],
            rod: rod_rotation,
            slider: rotation0[slider] + 0 * rod_rotation,
        }
        turns = {crank: q, rod: np.full_like(q, np.nan), slider: 0 * q}
        position, dposition, ddposition, spin, dspin = (
            np.stack([paths[i][n] for i in range(3)], axis=1) for n in range(5)
        )
        rotation, turn = (np.stack([of[i] for i in range(3)], axis=1) for of in (rotations, turns))
        return Pose(position, rotation, turn, dposition, ddposition, spin, dspin)

    with_q = np.where(np.arange(3) == crank, 1.0, np.nan)
    return Path("spatial_slider_crank", poses, axis, turning_driver(scene, axis, with_q))


def _is_along(first: np.ndarray, second: np.ndarray) -> bool:
    """Return whether two unit vectors (3,) are so nearly parallel that they span no plane."""
    return bool(abs(first @ second) > ALONG)


def _slide(
    pins: tuple[np.ndarray, ...], c0: np.ndarray, line: np.ndarray, length: float, side: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the displacement s (k,) along the line that keeps |c0 + s line - pin| = length, and s', s''."""
    gap = c0 - pins[0]
    along = gap @ line
    root = side * np.sqrt(along**2 - np.sum(gap * gap, axis=-1) + length**2)
    s = root - along
    rod = gap + s[:, None] * line
    ds = np.sum(rod * pins[1], axis=-1) / root
    rate = ds[:, None] * line - pins[1]
    return s, ds, (np.sum(rod * pins[2], axis=-1) - np.sum(rate * rate, axis=-1)) / root


def _held(x: np.ndarray, e: np.ndarray, lean: float, hand: float) -> np.ndarray:
    """Return unit vectors z with z·e = 0, z·x = lean, on the given side of the plane of e and x."""
    p = x - e * np.sum(x * e, axis=-1, keepdims=True)
    size = np.sqrt(np.sum(p * p, axis=-1, keepdims=True))
    share = lean / size
    return share * p / size + hand * np.sqrt(1 - share**2) * cross(e, p / size)


def _spin(
    x: np.ndarray, dx: np.ndarray, ddx: np.ndarray, z: np.ndarray, e: np.ndarray, axis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rod's angular velocity for unit crank rate, and its derivative by the crank angle."""
    normal = cross(z, e)
    base, down = axis - cross(x, dx), np.sum(x * normal, axis=-1, keepdims=True)
    roll = np.sum(base * normal, axis=-1, keepdims=True) / down
    w = cross(x, dx) + roll * x
    dnormal = cross(cross(w, z), e) + cross(z, cross(axis, e))
    up = np.sum(base * dnormal - cross(x, ddx) * normal, axis=-1, keepdims=True)
    droll = (up - roll * np.sum(dx * normal + x * dnormal, axis=-1, keepdims=True)) / down
    return w, cross(x, ddx) + droll * x + roll * dx


def _triad(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return rotation matrices (k, 3, 3) with x as first column and z in the plane of first and third."""
    third = z - x * np.sum(x * z, axis=-1, keepdims=True)
    third = third / np.sqrt(np.sum(third * third, axis=-1, keepdims=True))
    return np.stack([x, cross(third, x), third], axis=-1)
