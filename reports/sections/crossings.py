"""Section: singular positions that a motion passes, with their times, the branches that meet there, and the
branch taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from crosscheck.setting import BRANCHES, option_text
from crosscheck.study.grid import Record
from mbref.motions.trajectory import Outcome

from .. import mechanisms
from ..blocks import Block, Heading, Moving, Table, Text
from ..runs import Run, SceneRuns

DIGITS = 12  # decimals of displayed times (s)
SHOWN = 12  # largest number of singular positions of a motion in the table
CAPTION = (
    "Positions at which the rank of the constraint Jacobian drops, passed by {label}; "
    "`mbref run --branch NUMBER=BRANCH` asks for another branch."
)
SMOOTH = 1  # number of the smooth branch, which is taken unless the user chooses another
BESIDE = (
    "Singular position {number} at t = {time:.5g} s: {sentence}. In colour the mechanism on each branch, in "
    "grey on the smooth one, from {start:.4g} s to {end:.4g} s; the line of time has a mark at the position. "
    "`mbref animate scenes/{scene}.toml --branches --crossing {number}` shows the same."
)


def render(scene_runs: SceneRuns) -> list[Block]:
    """Return the table for the run of least error among runs that search for singular positions; empty if the
    motion passes none."""
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
        *_pictures(scene_runs),
        *(Text(sentence) for sentence in _open_reactions(run)),
    ]


def _looked(scene_runs: SceneRuns) -> Run | None:
    passed = [r for r in scene_runs.best().values() if r.completed and r.record.get("crossings")]
    return min(passed, key=lambda run: run.by_error, default=None)


def _pictures(scene_runs: SceneRuns) -> Iterator[Moving]:
    """Return pictures of the mechanism on every recorded branch of each singular position, side by side."""
    by_number: dict[int, list[Record]] = {}
    for record in sorted(scene_runs.branches, key=_asked):
        if len(record["crossings"] or ()) >= _asked(record)[0]:
            by_number.setdefault(_asked(record)[0], []).append(record)
    for number, records in by_number.items():
        yield _beside(scene_runs, number, records)


def _beside(scene_runs: SceneRuns, number: int, records: Sequence[Record]) -> Moving:
    scene, crossing = scene_runs.scene, records[0]["crossings"][number - 1]
    motions = {_title(record): mechanisms.motion_of(scene, record) for record in records}
    pictures = mechanisms.branches(scene, motions, crossing["time"], records[0]["engine"])
    start, *_, end = (round(time, DIGITS) for time in records[0]["times"])
    caption = BESIDE.format(
        number=number,
        time=crossing["time"],
        sentence=crossing["sentence"],
        start=start,
        end=end,
        scene=scene.name,
    )
    return Moving(caption, list(pictures.items()))


def _asked(record: Record) -> tuple[int, int]:
    """Return the number of a singular position and of the branch that a run was requested to take there."""
    [[number, branch]] = record["asked"]["options"][BRANCHES]
    return number, branch


def _title(record: Record) -> str:
    """Return the name of a branch, with the end of its run if the run ended early."""
    branch = _asked(record)[1]
    name = f"Branch {branch}{', smooth' * (branch == SMOOTH)}"
    if record["outcome"] == Outcome.COMPLETED.label:
        return name
    return f"{name}; ended at t = {record['t_end']:.4g} s: {record['outcome']}"


def _open_reactions(run: Run) -> Iterator[str]:
    """Return a sentence on the samples at which equilibrium determines fewer components of the reactions than
    at other samples."""
    marks = {part: np.array(row) for part, row in (run.record.get("open_reactions") or {}).items()}
    marks = {joint: marks[joint] for joint in run.record["reactions"] if joint in marks}
    if not marks:
        return
    more = {joint: row > row.min() for joint, row in marks.items() if row.size}
    times = np.array(run.record["times"])[np.any(list(more.values()), axis=0)] if more else np.zeros(0)
    if times.size:
        joints = ", ".join(joint for joint, row in more.items() if row.any())
        yield (
            f"Equilibrium determines fewer components of the reactions of {joints} at t = "
            f"{', '.join(option_text(float(t)) for t in times[:SHOWN])} s than elsewhere."
        )
    else:
        yield "No sample lies so near a singular position that a reaction is undetermined for that reason."
