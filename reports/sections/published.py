"""Section: published problems, with each engine's error in the problem's own measure, and whether it is
accepted."""

from __future__ import annotations

import math
from collections.abc import Sequence

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.published import BY_SCENE, problem_of
from crosscheck.study.record_view import error_bound

from ..blocks import Block, Heading, Table, Text
from ..runs import Run, SceneRuns, duration, power

LEAST = 1e-14  # smaller values are rounding in double precision
HEADER = ("Engine", "Family", "Settings", "Error", "Accepted", "Time")


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return one table for each published problem among the scenes."""
    found = [group for group in groups if problem_of(group.scene)]
    text = (
        "Benchmark problems from the literature, each with its own error measure and accepted error. A row "
        "has the run of a family whose error, compared with the truth, is least."
    )
    return [Heading("Published problems", 2), Text(text), *map(_table, found)] if found else []


def _table(group: SceneRuns) -> Table:
    name, problem = BY_SCENE[group.scene.name]
    end, rows = group.scene.duration, [_row(group, run) for run in group.best().values()]
    caption = (
        f"{name}: {group.scene.name} to t = {end:g} s. Error: {problem.words}; accepted up to "
        f"{problem.level}. Source: {problem.source}."
    )
    return Table(caption, HEADER, rows, right=frozenset({3, 5}))


def _row(group: SceneRuns, run: Run) -> tuple[str, ...]:
    if not run.completed:
        ended = f"ended at {run.t_end:.3g} s"
        return *run.curve, group.varied_settings(run), "–", ended, duration(run.seconds)
    _, problem = BY_SCENE[group.scene.name]
    exact = group.exact_part(run.trajectory)
    error = problem.measure(group.scene, run.trajectory, exact)
    said = "not known" if error is None else "yes" if error <= problem.acceptance else "no"
    if exact is not None and len(exact.times) < len(run.trajectory.times):
        said += f", truth to {exact.times[-1]:.3g} s"
    return *run.curve, group.varied_settings(run), _shown(group, error, run), said, duration(run.seconds)


def _shown(group: SceneRuns, error: float | None, run: Run) -> str:
    """Return the error for a table cell: ``< 3e-12`` if it is below rounding or the bound on the truth's
    error."""
    _, problem = BY_SCENE[group.scene.name]
    asks_truth = problem.measure(group.scene, run.trajectory, None) is None
    bound = error_bound(run.record)  # relative to the mechanism's length
    least = max(LEAST, bound * max(1.0, scene_length(group.scene)) if asks_truth else 0.0)
    if error is None or error >= least:
        return power(math.nan if error is None else error)
    return f"< {least:.0e}"
