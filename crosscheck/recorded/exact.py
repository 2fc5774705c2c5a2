"""The exact motion at any times with the bound on its error, as an object and as a table."""

from __future__ import annotations

import csv
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crosscheck.judge.full_turns import DENSE, FINEST, with_dense
from crosscheck.judge.reference.reference import SECONDS, NoReference, reference
from crosscheck.judge.start import started
from crosscheck.judge.truth import NoSolution, closed_form
from crosscheck.judge.truth.reference_truth import trajectory
from crosscheck.recorded.columns import SI, kind_of, start_columns, values
from mbref.files import replaced
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


@dataclass(frozen=True)
class Exact:
    """The exact motion at the times (k,) at which it is known, the bound (k,) on its error, the reason for
    its end, and the times (s) of events, at which constraints come or go or stops are met.

    The bound is a distance over the mechanism's length, or an angle (rad).
    """

    motion: Trajectory
    bound: np.ndarray
    reason: str
    events: tuple[float, ...] = ()


def exact(scene: Scene, times: Sequence[float] | np.ndarray, seconds: float = SECONDS) -> Exact:
    """Return the exact motion at increasing times (s): a closed form, or, without one after the start, the
    reference computed within CPU seconds."""
    times = np.asarray(times, dtype=float)
    family, reason = closed_form(scene), ""
    if family is not None:
        try:
            motion: Trajectory | None = family.poses(times)
        except NoSolution as end:
            known, reason = times[times <= end.until], str(end)
            motion = family.poses(known) if known.max(initial=0.0) > 0 else None
        if motion is not None:
            return Exact(motion, np.full(len(motion.times), family.accuracy), reason)
    found = reference(scene, times.tolist(), seconds)
    part = found.part if isinstance(found, NoReference) else found
    return Exact(
        trajectory(scene, part), part.bound, getattr(found, "reason", ""), tuple(part.events.tolist())
    )


def dense_exact(
    scene: Scene,
    times: np.ndarray,
    seconds: float = SECONDS,
    wanted: Collection[str] | None = None,
    dense: int = DENSE,
) -> tuple[Exact, dict[str, np.ndarray]]:
    """Return the exact motion at the times (k,) and at further times from 0 on, and its columns.

    The further times, at least ``dense``, are so dense that full turns of joints are counted, whatever the
    given times are. ``wanted`` are the columns that are needed, by default all but reactions of joints.
    """
    while True:
        found = exact(scene, with_dense(times, dense), seconds)
        columns = values(scene, found.motion, wanted)
        turns = (c for n, c in columns.items() if kind_of(n) == "angle")
        if dense >= FINEST * DENSE or all(np.isfinite(c).all() for c in turns):
            return found, columns
        dense *= 4


def uncounted(columns: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Return the columns (k,) that end in NaN because full turns between times cannot be counted."""
    unknown = {name: column for name, column in columns.items() if np.isnan(column).any()}
    if not any(kind_of(name) == "angle" for name in unknown):
        return ()
    return tuple(n for n, column in unknown.items() if kind_of(n) == "angle" or np.isfinite(column[0]))


def reference_table(
    scene: Scene, times: Sequence[float] | np.ndarray, seconds: float = SECONDS
) -> dict[str, np.ndarray]:
    """Return the reference motion as columns: ``time``, ``bound`` and every column of ``values``.

    Parameters
    ----------
    scene : Scene
        The mechanism.
    times : sequence of float
        Increasing sample times ≥ 0, s.
    seconds : float
        CPU time that the reference may take, s.

    Returns
    -------
    dict of str to ndarray, shape (k,)
        SI units, world frame. ``bound`` is on the error: a distance over the mechanism's length, or an angle
        (rad). The columns end where the reference ends.

    Raises
    ------
    SceneError
        If the scene's velocities contradict its joints.
    """
    times = np.asarray(times, dtype=float)
    scene = scene.reaching(max(times, default=0.0))
    assembled, start = started(scene), start_columns(scene)
    found, columns = dense_exact(assembled, times, seconds)
    there = np.isin(found.motion.times, times)
    shifted = {name: column[there] + start.get(name, 0.0) for name, column in columns.items()}
    return {"time": found.motion.times[there], "bound": found.bound[there], **shifted}


def write(table: dict[str, np.ndarray], path: Path) -> None:
    """Write columns as CSV, the unit of each in its header: ``rod.position.x [m]``."""
    headers = [f"{name} [{SI['time'] if name == 'time' else SI.get(kind_of(name), '1')}]" for name in table]
    with replaced(path) as fresh, fresh.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(headers)
        writer.writerows(zip(*(map(repr, column.tolist()) for column in table.values()), strict=True))
