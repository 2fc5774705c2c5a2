"""The exact motion at any times with the bound on its error, as an object and as a table."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crosscheck.judge.reference.reference import SECONDS, NoReference, reference
from crosscheck.judge.start import started
from crosscheck.judge.truth import NoSolution, closed_form
from crosscheck.judge.truth.reference_truth import trajectory
from crosscheck.recorded.columns import SI, kind_of, start_columns, values
from mbref.files import replaced
from mbref.scene import Scene
from mbref.trajectory import Trajectory


@dataclass(frozen=True)
class Exact:
    """The exact motion at the times (k,) at which it is known, the bound (k,) on its error, and the reason
    for its end.

    The bound is a distance over the mechanism's length, or an angle (rad).
    """

    motion: Trajectory
    bound: np.ndarray
    reason: str


def exact(scene: Scene, times: Sequence[float] | np.ndarray, seconds: float = SECONDS) -> Exact:
    """Return the exact motion at increasing times (s): a closed form, or the reference computed within CPU
    seconds."""
    times = np.asarray(times, dtype=float)
    family, reason = closed_form(scene), ""
    if family is not None:
        try:
            motion = family.poses(times)
        except NoSolution as end:
            motion, reason = family.poses(times[times <= end.until]), str(end)
        return Exact(motion, np.full(len(motion.times), family.accuracy), reason)
    found = reference(scene, times.tolist(), seconds)
    part = found.part if isinstance(found, NoReference) else found
    return Exact(trajectory(scene, part), part.bound, getattr(found, "reason", ""))


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
    assembled, start = started(scene), start_columns(scene)
    found = exact(assembled, times, seconds)
    columns = {name: x + start.get(name, 0.0) for name, x in values(assembled, found.motion).items()}
    return {"time": found.motion.times, "bound": found.bound, **columns}


def write(table: dict[str, np.ndarray], path: Path) -> None:
    """Write columns as CSV, the unit of each in its header: ``rod.position.x [m]``."""
    headers = [f"{name} [{SI['time'] if name == 'time' else SI.get(kind_of(name), '1')}]" for name in table]
    with replaced(path) as fresh, fresh.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(headers)
        writer.writerows(zip(*(map(repr, column.tolist()) for column in table.values()), strict=True))
