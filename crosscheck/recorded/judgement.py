"""Comparison of a recorded motion with the exact motion: the error of each column, the time at which it
begins, and likely causes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.start import started
from crosscheck.judge.tolerances import FLOOR
from crosscheck.recorded.changed_scenes import changed
from crosscheck.recorded.columns import kind_of, scales, start_columns, values
from crosscheck.recorded.exact import Exact, exact
from crosscheck.recorded.explanations import Difference, Explanation, ranked, simple, with_signs
from crosscheck.recorded.pairs_of_explanations import pairs
from crosscheck.recorded.reading import Recording, read
from mbref.scene import Scene, SceneError

BEGINS = 0.01  # fraction of the largest error at which an error is said to begin
DENSE = 400  # number of further times at which the exact motion is computed, for shifts in time
TRIED = 20.0  # CPU seconds for the simulation of changed scenes, and for pairs of causes
EXACT = 1e-5  # fraction of the difference: changed scenes are tried if simpler causes leave more
EXPLAINED = 1e-3  # fraction of the difference: pairs of causes are tried if single causes leave more


@dataclass(frozen=True)
class ColumnError:
    """Largest error of a column, the bound below which an error means nothing, the largest error that counts
    as right, and the time (s) at which the error first exceeds the part BEGINS of the largest error (None for
    a right column)."""

    name: str
    largest: float
    bound: float  # of the reference, plus the last digit of the table
    allowed: float  # the bound, or the tolerance times the size of the quantity if that is larger
    begins: float | None

    @property
    def is_right(self) -> bool:
        """Return whether the error is within the bound or within the tolerance."""
        return self.largest <= self.allowed


@dataclass(frozen=True)
class Judgement:
    """Errors by column, explanations with the best first, and the reason if the exact motion ends early."""

    columns: tuple[ColumnError, ...]
    explanations: tuple[Explanation, ...]
    until: float
    reason: str

    @property
    def is_right(self) -> bool:
        """Return whether every column is right."""
        return all(column.is_right for column in self.columns)

    def to_record(self) -> dict[str, Any]:
        """Return the judgement as numbers, lists and text, for JSON."""
        return {
            "right": self.is_right,
            "until": self.until,
            "reason": self.reason,
            "columns": [{**vars(c), "right": c.is_right} for c in self.columns],
            "explanations": [vars(e) for e in self.explanations],
        }


def judge_motion(
    scene: Scene,
    motion: str | Path | Mapping[str, np.ndarray] | Recording,
    seconds: float = SECONDS,
    tolerance: float = FLOOR,
) -> Judgement:
    """Return the errors of a recorded motion and their possible explanations.

    Parameters
    ----------
    scene : Scene
        The mechanism.
    motion : str, Path, mapping of str to ndarray of shape (k,), or Recording
        A table, or its columns in SI units: ``time`` and columns such as ``rod.position.x``.
    seconds : float
        CPU time that the reference may take, s.
    tolerance : float
        Largest error of a right column, relative to the size of its quantity: the mechanism's length, 1 rad,
        the largest velocity or angular velocity of a body. 0 judges by the bound of the reference alone.

    Raises
    ------
    SceneError
        If the table has no column of the scene, or the scene has no reference.
    """
    recording = _from_start(scene, _as_recording(scene, motion))
    scene = started(scene)
    found = exact(scene, _with_dense(recording.times), seconds)
    if not len(found.motion.times):
        raise SceneError([f"{scene.name}: has no reference: {found.reason}"])
    return _judged(scene, recording, found, tolerance)


def _with_dense(times: np.ndarray) -> np.ndarray:
    """Return times (k,) and further times from 0 to their end. A further time has at least a tenth of a step
    to a given time."""
    dense = np.linspace(0.0, times[-1], DENSE + 1)
    after = np.minimum(np.searchsorted(times, dense), len(times) - 1)
    nearest = np.minimum(np.abs(times[after] - dense), np.abs(times[np.maximum(after - 1, 0)] - dense))
    return np.union1d(times, dense[nearest > 0.1 * times[-1] / DENSE])


def _as_recording(scene: Scene, motion: Any) -> Recording:
    if isinstance(motion, Recording):
        return motion
    if isinstance(motion, Mapping):
        columns = {name: np.asarray(column, dtype=float) for name, column in motion.items()}
        times = columns.pop("time")
        return Recording(times, {n: c for n, c in columns.items() if kind_of(n)})
    return read(Path(motion), scene, {})


def _from_start(scene: Scene, recording: Recording) -> Recording:
    """Return the recording with joint coordinates that count from the start, as the reference's do."""
    start = start_columns(scene)
    columns = {name: column - start.get(name, 0.0) for name, column in recording.columns.items()}
    return replace(recording, columns=columns)


def _judged(scene: Scene, recording: Recording, found: Exact, tolerance: float) -> Judgement:
    known = recording.times <= found.motion.times[-1]
    times = recording.times[known]
    places = np.searchsorted(found.motion.times, times)
    size = scales(scene, found.motion)
    whole = {n: c for n, c in values(scene, found.motion).items() if np.isfinite(c).all()}
    recorded = {n: c[known] for n, c in recording.columns.items() if n in whole}
    right = with_signs(recorded, {n: whole[n][places] for n in whole})
    scale = {n: size[kind_of(n)] for n in recorded}
    known_to, digit = float(found.bound[places].max()), recording.resolution
    errors = tuple(
        _column(
            n, recorded[n] - right[n], times, scale[n] * known_to + digit.get(n, 0.0), tolerance * scale[n]
        )
        for n in recorded
    )
    explanations: list[Explanation] = []
    if not all(e.is_right for e in errors):
        later = _splines(found.motion.times, whole)
        exact_columns = {n: right[n] for n in recorded}
        difference = Difference(times, recorded, exact_columns, scale, later)
        noise = float(np.sqrt(np.mean([(e.bound / scale[e.name]) ** 2 for e in errors])))
        explanations = _explanations(scene, difference, noise)
    return Judgement(errors, tuple(explanations), float(times[-1]), found.reason)


def _explanations(scene: Scene, difference: Difference, noise: float) -> list[Explanation]:
    """Return the best explanations: changed scenes and pairs of causes are tried if simpler causes leave too
    much."""
    causes, noisy = list(simple(difference)), 3 * noise / difference.size({})
    found = ranked(difference, causes, noise)
    if not found or found[0].remains > max(EXACT, noisy):
        causes += changed(scene, difference, TRIED)
        found = ranked(difference, causes, noise)
    if not found or found[0].remains > max(EXPLAINED, noisy):
        found = ranked(difference, [*causes, *pairs(difference, causes, TRIED)], noise)
    return found


def _column(name: str, error: np.ndarray, times: np.ndarray, bound: float, allowed: float) -> ColumnError:
    size = np.abs(error)
    largest, allowed = float(size.max()), max(bound, allowed)
    begins = float(times[int(np.argmax(size > BEGINS * largest))]) if largest > allowed else None
    return ColumnError(name, largest, bound, allowed, begins)


def _splines(times: np.ndarray, whole: Mapping[str, np.ndarray]) -> Any:
    splines = {name: CubicSpline(times, column) for name, column in whole.items()}
    return lambda t: {name: spline(t) for name, spline in splines.items()}
