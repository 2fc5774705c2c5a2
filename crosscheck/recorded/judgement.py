"""Comparison of a recorded motion with the exact motion: the error of each column, the time at which it
begins, and likely causes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.judge.pieces import has_pieces
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.start import started
from crosscheck.judge.tolerances import FLOOR
from crosscheck.recorded.column_errors import ColumnError, Columns, Compared, aligned
from crosscheck.recorded.columns import kind_of, names, scales, start_columns
from crosscheck.recorded.exact import DENSE, Exact, dense_exact, uncounted
from crosscheck.recorded.explanations import Explanation, with_signs
from crosscheck.recorded.leaps import leaps, with_sides
from crosscheck.recorded.reading import Recording, read
from crosscheck.recorded.search import SECONDS as SEARCHED
from crosscheck.recorded.search import Search, search
from crosscheck.recorded.splines import Pieces, splines
from mbref.scene import Scene, SceneError

ROUNDINGS = 4 * float(np.finfo(float).eps)  # relative error of numbers such as angles of many turns
FINER = 8  # times as many further samples, if moved times leave errors: they may be of the splines


@dataclass(frozen=True)
class Judgement:
    """Errors by column, explanations with the best first, and the reason if the exact motion ends early."""

    columns: tuple[ColumnError, ...]
    explanations: tuple[Explanation, ...]
    until: float
    reason: str
    left: tuple[str, ...] = ()  # columns that the judge cannot determine
    uncounted: tuple[str, ...] = ()  # columns left because full turns between times cannot be counted
    alike: int = 0  # number of changes that explain the difference and that the table does not tell apart
    is_complete: bool = True  # False if the search for explanations ended by its limit of CPU time
    is_whole: bool = True  # False if the exact motion ends before the table
    ignored: tuple[str, ...] = ()  # columns of the table that are not of the scene
    is_searched: bool = True  # False for scenes with events, of which no explanations are known

    @property
    def is_right(self) -> bool:
        """Return whether every column that the judge can determine is right, to the end of the table."""
        return bool(self.columns) and self.is_whole and all(column.is_right for column in self.columns)

    def to_record(self) -> dict[str, Any]:
        """Return the judgement as numbers, lists and text, for JSON."""
        return {
            "right": self.is_right,
            "until": self.until,
            "reason": self.reason,
            "not judged": list(self.left),
            "not counted": list(self.uncounted),
            "alike": self.alike,
            "searched": self.is_complete and self.is_searched,
            "ignored": list(self.ignored),
            "columns": [{**vars(c), "right": c.is_right} for c in self.columns],
            "explanations": [vars(e) for e in self.explanations],
        }


def judge_motion(
    scene: Scene,
    motion: str | Path | Mapping[str, np.ndarray] | Recording,
    seconds: float = SECONDS,
    tolerance: float = FLOOR,
    progress: Callable[[str], None] | None = None,
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
    progress : callable, optional
        Called with a sentence before long work.

    Raises
    ------
    SceneError
        If the table has no column of the scene, or the scene has no reference.
    """
    recording = _as_recording(scene, motion)
    scene = scene.reaching(max(recording.times, default=0.0))
    recording, scene = _from_start(scene, recording), started(scene)
    times = _with_sides_of_leaps(scene, recording)
    found, columns = dense_exact(scene, times, seconds, recording.columns)
    if len(sides := _with_sides_of_leaps(scene, recording, found.events)) > len(times):
        times = sides
        found, columns = dense_exact(scene, times, seconds, recording.columns)
    if not (found.motion.times >= recording.times[0]).any():
        raise SceneError([f"{scene.name}: has no reference: {found.reason}"])
    compared, later = _compared(scene, recording, found, columns, tolerance)
    if not compared.is_right and not np.isin(compared.times, recording.times).all():
        finer, its_columns = dense_exact(scene, times, seconds, recording.columns, FINER * DENSE)
        if finer.motion.times.max(initial=0.0) >= found.motion.times[-1]:
            found, columns = finer, its_columns
            compared, later = _compared(scene, recording, found, columns, tolerance)
    return _judged(scene, recording, found, (columns, compared, later), progress)


def _with_sides_of_leaps(scene: Scene, recording: Recording, events: Sequence[float] = ()) -> np.ndarray:
    """Return the times (s) of a recording, with both sides of leaps at which it has samples."""
    return np.union1d(recording.times, [*leaps(scene, recording.times, events).values()])


def _as_recording(scene: Scene, motion: Any) -> Recording:
    if isinstance(motion, Recording):
        return motion
    if isinstance(motion, Mapping):
        return _of_columns(scene, {name: np.asarray(column, dtype=float) for name, column in motion.items()})
    return read(Path(motion), scene, {})


def _of_columns(scene: Scene, columns: dict[str, np.ndarray]) -> Recording:
    """Return columns as a recording; raises SceneError if a column is missing, too short or not finite."""
    if "time" not in columns:
        raise SceneError(["the motion has no column time; give the times of its rows (s)"])
    times, known = columns.pop("time"), names(scene)
    found = {name: column for name, column in columns.items() if name in known}
    if not found:
        raise SceneError([f"the motion has no column of the scene, such as {known[0]}"])
    for name, column in {"time": times, **found}.items():
        if column.shape != times.shape or column.ndim != 1 or not len(column):
            raise SceneError([f"column {name}: must have one number for each time"])
        if not np.isfinite(column).all():
            raise SceneError([f"column {name}: is not finite; leave out such columns or rows"])
    if times[0] < 0 or np.any(np.diff(times) <= 0):
        raise SceneError(["column time: times must not be negative and must increase"])
    return Recording(times, found, ignored=[name for name in columns if name not in found])


def _from_start(scene: Scene, recording: Recording) -> Recording:
    """Return the recording with joint coordinates that count from the start, as the reference's do."""
    start = start_columns(scene)
    columns = {name: column - start.get(name, 0.0) for name, column in recording.columns.items()}
    return replace(recording, columns=columns)


def _compared(
    scene: Scene, recording: Recording, found: Exact, columns: Columns, tolerance: float
) -> tuple[Compared, dict[str, Pieces]]:
    """Return the comparison of the columns that the judge can determine, and these as functions of time."""
    known = recording.times <= found.motion.times[-1]
    times = recording.times[known]
    places = np.searchsorted(found.motion.times, times)
    whole = {n: c for n, c in columns.items() if np.isfinite(c).all()}
    judged = [n for n in recording.columns if n in whole]
    size = scales(scene, found.motion, whole)
    scale = {n: size[kind_of(n)] for n in judged}
    exact = {n: whole[n][places] for n in judged}
    recorded = with_signs(exact, {n: recording.columns[n][known] for n in judged})
    rounding = {n: recording.rounding[n][known] if n in recording.rounding else 0 * times for n in judged}
    error = float(found.bound[places].max())
    later = splines(scene, found.motion.times, whole, found.events)
    compared = Compared(
        times,
        recorded,
        exact,
        {n: scale[n] * error + rounding[n] + ROUNDINGS * np.abs(exact[n]) for n in judged},
        {n: tolerance * scale[n] for n in judged},
        rounding,
        recording.digits,
        scale,
    )
    near = leaps(scene, times, found.events)
    sides = {k: both for k, both in near.items() if both[1] <= found.motion.times[-1]}
    compared = with_sides(compared, sides, found.motion.times, whole)
    if "time" in recording.rounding:
        compared = aligned(compared, recording.rounding["time"][known], later)
    return compared, later


def _judged(
    scene: Scene,
    recording: Recording,
    found: Exact,
    parts: tuple[Columns, Compared, dict[str, Pieces]],
    progress: Callable[[str], None] | None,
) -> Judgement:
    columns, compared, later = parts
    errors, causes = compared.errors(), Search()
    if not (compared.is_right or has_pieces(scene)):
        if progress is not None:
            progress(f"searching for an explanation, at most {SEARCHED:g} CPU s")
        causes = search(scene, compared, later, float(found.motion.times[-1]))
    left = tuple(n for n in recording.columns if n not in compared.recorded)
    turning = tuple(n for n in uncounted(columns) if n in left)
    known = recording.times <= found.motion.times[-1]
    until, searched = float(recording.times[known][-1]), (causes.alike, causes.is_complete)
    return Judgement(
        errors,
        causes.explanations,
        until,
        found.reason,
        left,
        turning,
        *searched,
        is_whole=bool(known.all()),
        ignored=tuple(recording.ignored),
        is_searched=not has_pieces(scene),
    )
