"""Digits of a run's numbers: single precision is detected, and noise between neighbouring samples is
measured."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from crosscheck.judge.constraints import scene_length
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

SIMPLE = 12  # bits of the significand; shorter numbers, such as halves and eighths, do not show the precision
SMALL = 2.0**-12  # fraction of the scale; smaller numbers may have lost bits by cancellation
STATES = ("position", "orientation", "velocity", "angular_velocity")
PUSHES = ("acceleration", "angular_acceleration")
EVIDENCE = 4  # least count of numbers that show the precision; a double is a float32 by chance once in 2²⁹
LEAST = 1e-300  # N; scale of forces if nothing has mass
ORDER = 6  # order of the differences that remove a smooth motion
WEIGHTS = np.array([(-1.0) ** k * comb(ORDER, k) for k in range(ORDER + 1)])
Series = tuple[str, np.ndarray, np.ndarray]  # item, its numbers (k, w), and the scales (w,) of these numbers


def single_precision(scene: Scene, run: Trajectory) -> list[str]:
    """Return the items of a run whose varying numbers are all of single precision.

    Items are states and accelerations of a body, and reactions of a joint. Constant, simple or small numbers
    are ignored.
    """
    items = [*_of_bodies(scene, run), *_of_joints(scene, run)]
    return [name for name, series, scale in items if _is_single(series / scale, series)]


def not_finite(run: Trajectory) -> list[str]:
    """Return the names of a run's arrays that contain a number which is not finite."""
    arrays = {name: getattr(run, name) for name in (*STATES, *PUSHES)}
    arrays |= {f"reaction in {joint}": wrench for joint, wrench in (run.reactions or {}).items()}
    return [name for name, array in arrays.items() if array is not None and not np.isfinite(array).all()]


def _of_bodies(scene: Scene, run: Trajectory) -> Iterator[Series]:
    length, rate = scene_length(scene), motion_rate(scene, run)
    push = _acceleration(scene, run)
    scales = {
        "position": length,
        "orientation": 1.0,
        "velocity": length * rate,
        "angular_velocity": rate,
        "acceleration": push,
        "angular_acceleration": push / length,
    }
    for name, scale in scales.items():
        if (array := getattr(run, name)) is not None:
            unit = np.full(array.shape[-1], scale)
            reported = name.replace("_", " ")
            yield from ((f"{reported} of {body}", array[:, b], unit) for b, body in enumerate(run.bodies))


def _of_joints(scene: Scene, run: Trajectory) -> Iterator[Series]:
    force = sum(body.mass or 0.0 for body in scene.body) * _acceleration(scene, run)
    unit = np.maximum(force, LEAST) * np.repeat([1.0, scene_length(scene)], 3)
    found = run.reactions or {}
    largest = max((float(np.abs(wrench / unit).max(initial=1.0)) for wrench in found.values()), default=1.0)
    yield from ((f"reaction in {joint}", wrench, largest * unit) for joint, wrench in found.items())


def _acceleration(scene: Scene, run: Trajectory) -> float:
    """Return the largest acceleration of a motion; at least gravity, and at least the scene's length times
    the rate squared."""
    found = 0.0 if run.acceleration is None else float(np.abs(run.acceleration).max(initial=0.0))
    return max(
        found, float(np.linalg.norm(scene.gravity)), scene_length(scene) * motion_rate(scene, run) ** 2
    )


def _is_single(relative: np.ndarray, series: np.ndarray) -> bool:
    """Return whether the numbers of a series (k, w), also relative to their scales, are float32."""
    telling = (np.ptp(series, axis=0) > 0) & (np.abs(relative) > SMALL)
    significands = np.frexp(series[telling])[0] * 2.0**SIMPLE
    numbers = significands[significands != np.round(significands)]
    return len(numbers) >= EVIDENCE and bool(np.all(numbers == numbers.astype(np.float32)))


def grain(scene: Scene, run: Trajectory) -> tuple[float, str]:
    """Return the largest noise of positions, orientations, velocities and angular velocities, and the body
    that has it.

    The k > 6 samples are equally spaced and so near that sixth differences of the motion vanish. Lengths are
    relative to the scene's length, rates to the largest rate of the motion.
    """
    length = scene_length(scene)
    rate = motion_rate(scene, run)
    first = run.orientation[:1]
    is_turned = np.sum(run.orientation * first, axis=2, keepdims=True) < 0
    parts = {
        "positions": run.position / length,
        "orientations": np.where(is_turned, -run.orientation, run.orientation),
        "velocities": run.velocity / (length * rate),
        "angular velocities": run.angular_velocity / rate,
    }
    return max((_noise(series), name) for name, series in parts.items())


def motion_rate(scene: Scene, run: Trajectory) -> float:
    """Return the largest rate (1/s) of a motion: angular velocity, or speed over the scene's length; at least
    one over the scene's duration."""
    moved = np.linalg.norm(run.velocity, axis=-1).max() / scene_length(scene)
    turned = np.linalg.norm(run.angular_velocity, axis=-1).max()
    return max(float(moved), float(turned), 1 / scene.duration)


def _noise(series: np.ndarray) -> float:
    """Return the largest sixth difference of series (k, …), divided by the sixth difference of unit noise."""
    left = [np.tensordot(WEIGHTS, series[k : k + ORDER + 1], 1) for k in range(len(series) - ORDER)]
    return float(np.abs(left).max() / np.linalg.norm(WEIGHTS))
