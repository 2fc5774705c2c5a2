"""Singular positions that a motion passes: their times, the branches that meet there, and the one taken."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reports.blocks import Block, Heading, Table, Text
from reports.runs import Run, SceneRuns, plain

SHOWN = 12  # singular positions of one motion
CAPTION = (
    "Positions at which the rank of the constraint Jacobian drops, passed by {label}; "
    "`mbref run --branch NUMBER=BRANCH` asks for another branch."
)


def render(scene_runs: SceneRuns) -> list[Block]:
    """The table of the run of least error that looks for singular positions; nothing where none is passed."""
    run = _looked(scene_runs)
    if run is None:
        return []
    crossings = run.record["crossings"]
    rows = [
        (str(number), f"{c['time']:.8g}", c["sentence"], str(c["taken"]))
        for number, c in enumerate(crossings[:SHOWN], 1)
    ]
    caption = CAPTION.format(label=run.label)
    if len(crossings) > SHOWN:
        caption += f" The first {SHOWN} of {len(crossings)}."
    header = ("Number", "t, s", "Branches", "Taken")
    return [
        Heading("Singular positions"),
        Table(caption, header, rows, right=frozenset({0, 1, 3})),
        *(Text(sentence) for sentence in _open_reactions(run)),
    ]


def _looked(scene_runs: SceneRuns) -> Run | None:
    passed = [r for r in scene_runs.best().values() if r.completed and r.record.get("crossings")]
    return min(passed, key=lambda run: run.by_error, default=None)


def _open_reactions(run: Run) -> Iterator[str]:
    """A sentence on the samples at which equilibrium determines less of the reactions than elsewhere."""
    marks = {joint: np.array(row) for joint, row in (run.record.get("open_reactions") or {}).items()}
    if not marks:
        return
    more = {joint: row > row.min() for joint, row in marks.items() if row.size}
    times = np.array(run.record["times"])[np.any(list(more.values()), axis=0)] if more else np.zeros(0)
    if times.size:
        joints = ", ".join(joint for joint, row in more.items() if row.any())
        yield (
            f"Equilibrium determines fewer components of the reactions of {joints} at t = "
            f"{', '.join(plain(float(t)) for t in times[:SHOWN])} s than elsewhere."
        )
    else:
        yield "No sample lies so near a singular position that a reaction is undetermined for that reason."
