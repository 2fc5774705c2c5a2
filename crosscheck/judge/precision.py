"""Digits of a run's numbers: those that single precision leaves, and noise between neighbouring samples."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from crosscheck.judge.constraints import scene_length
from mbref.scene import Scene
from mbref.trajectory import Trajectory

SIMPLE = 12  # bits of the significand: shorter numbers, such as halves and eighths, are no evidence
SMALL = 2.0**-12  # fraction of the scale: smaller numbers may have lost bits by cancellation
STATES = ("position", "orientation", "velocity", "angular_velocity")
PUSHES = ("acceleration", "angular_acceleration")
EVIDENCE = 4  # numbers of an item that are neither; a double is a float32 by chance once in 2²⁹
LEAST = 1e-300  # N, where nothing has mass
ORDER = 6  # order of the differences that remove a smooth motion
WEIGHTS = np.array([(-1.0) ** k * comb(ORDER, k) for k in range(ORDER + 1)])
Series = tuple[str, np.ndarray, np.ndarray]  # the item, its numbers (k, w), and the scales of those (w,)


def single_precision(scene: Scene, run: Trajectory) -> list[str]:
    """Items of a run whose varying numbers are all of single precision: states and accelerations of a body,
    reactions of a joint.  Numbers that are constant, simple or small are no evidence."""
    items = [*_of_bodies(scene, run), *_of_joints(scene, run)]
    return [name for name, series, scale in items if _is_single(series / scale, series)]


def not_finite(run: Trajectory) -> list[str]:
    """Arrays of a run that hold a number which is not finite."""
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
    largest = max([1.0, *(float(np.abs(wrench / unit).max(initial=0.0)) for wrench in found.values())])
    yield from ((f"reaction in {joint}", wrench, largest * unit) for joint, wrench in found.items())


def _acceleration(scene: Scene, run: Trajectory) -> float:
    """Largest acceleration of a motion; no less than gravity, and than its rates make of the length."""
    found = 0.0 if run.acceleration is None else float(np.abs(run.acceleration).max(initial=0.0))
    return max(
        found, float(np.linalg.norm(scene.gravity)), scene_length(scene) * motion_rate(scene, run) ** 2
    )


def _is_single(relative: np.ndarray, series: np.ndarray) -> bool:
    """Whether the numbers of a series (k, w), given relative to their scales too, are float32."""
    telling = (np.ptp(series, axis=0) > 0) & (np.abs(relative) > SMALL)
    significands = np.frexp(series[telling])[0] * 2.0**SIMPLE
    numbers = significands[significands != np.round(significands)]
    return len(numbers) >= EVIDENCE and bool(np.all(numbers == numbers.astype(np.float32)))


def grain(scene: Scene, run: Trajectory) -> tuple[float, str]:
    """Largest noise of positions, orientations, velocities and angular velocities at evenly spaced times
    (k > 6) so near that sixth differences leave nothing of the motion, and whose it is: lengths over the
    scene's, rates over the largest of the motion."""
    length = scene_length(scene)
    rate = motion_rate(scene, run)
    first = run.orientation[:1]
    sides = np.where(np.sum(run.orientation * first, axis=-1, keepdims=True) < 0, -1.0, 1.0)
    parts = {
        "positions": run.position / length,
        "orientations": run.orientation * sides,
        "velocities": run.velocity / (length * rate),
        "angular velocities": run.angular_velocity / rate,
    }
    return max((_noise(series), name) for name, series in parts.items())


def motion_rate(scene: Scene, run: Trajectory) -> float:
    """Largest rate (1/s) of a motion: of its turning, or of its speed over the scene's length; no less than
    one over the scene's duration."""
    moved = np.linalg.norm(run.velocity, axis=-1).max() / scene_length(scene)
    turned = np.linalg.norm(run.angular_velocity, axis=-1).max()
    return max(float(moved), float(turned), 1 / scene.duration)


def _noise(series: np.ndarray) -> float:
    """Largest sixth difference of series (k, …), over the sixth difference of noise of size one."""
    left = [np.tensordot(WEIGHTS, series[k : k + ORDER + 1], 1) for k in range(len(series) - ORDER)]
    return float(np.abs(left).max() / np.linalg.norm(WEIGHTS))
