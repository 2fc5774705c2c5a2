"""Section: the mechanism in motion, and the numbers of its coordinates and constraints."""

from __future__ import annotations

from functools import partial

import mbref

from .. import mechanisms
from ..blocks import Block, Figure, Heading, Table, Text
from ..runs import Run, SceneRuns


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return the counts and the poses of the most accurate run; only the counts if no run has a state."""
    blocks: list[Block] = [Heading("The mechanism"), _counts(scene_runs)]
    shown = _most_accurate(scene_runs)
    if shown is None:
        return [*blocks, Text("No run reached a sample, so there is no motion to show.")]
    caption = (
        f"Poses of {shown.label} ({scene_runs.varied_settings(shown) or 'no settings'}; "
        f"error {shown.said}) from t = {shown.trajectory.times[0]:g} s to "
        f"{shown.trajectory.times[-1]:g} s, the last darkest; "
        f"triangles are joints to the ground, dashed lines their guides, thin grey lines the paths of the "
        f"centres of mass."
    )
    draw = partial(mechanisms.poses, scene_runs.scene, shown.trajectory)
    return [*blocks, Figure(f"{scene_runs.scene.name}-mechanism", caption, draw)]


def _most_accurate(scene_runs: SceneRuns) -> Run | None:
    best = [run for run in scene_runs.best().values() if len(run.trajectory.times)]
    return min(best, key=lambda run: (not run.completed, run.error), default=None)


def _counts(scene_runs: SceneRuns) -> Table:
    counts = mbref.counts(scene_runs.scene)
    joints = {joint.name: joint.type for joint in scene_runs.scene.joint}
    columns = {
        "Coordinates": counts.coordinates,
        **{f"{name} {joints.get(name, '')}".strip(): rows for name, rows in counts.rows_by_joint.items()},
        "Rows": counts.rows,
        "Rank": counts.rank,
        "Redundant rows": counts.redundant,
        "Degrees of freedom": counts.degrees_of_freedom,
    }
    caption = (
        "Counts at t = 0: velocity coordinates, six a body; the rows of every joint, its driver's included; "
        "all rows, how many are independent, and the freedom that is left."
    )
    cells = [str(number) for number in columns.values()]
    return Table(caption, tuple(columns), [cells], right=frozenset(range(len(cells))))
