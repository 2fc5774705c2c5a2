"""Section: the records of all runs, each with its numbers, its origin, and the command that repeats it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from crosscheck.study.command import command
from crosscheck.study.grades import grade
from mbref.files import file_name

from .. import places
from ..blocks import Block, Card, Heading, Record, Text
from ..engine_looks import SIGNS, named, tone
from ..runs import Run, SceneRuns, duration, power

NUMBERS = {
    "Joints open by": "violation_position",
    "Energy is off by": "energy_error",
    "Reactions are off by": "reaction_error",
}


def render(groups: Sequence[SceneRuns]) -> list[Block]:
    """Return one block for every family on every scene."""
    text = (
        "Every mark in a figure and every cell of the matrix links to the records of its runs. Run the "
        "commands in the folder of this page; each repeats its run and prints an equal error."
    )
    found = [_record(group, curve, runs) for group in groups for curve, runs in group.curves().items()]
    return [Heading("Records", 2), Text(text), *found]


def path(group: SceneRuns) -> str:
    """Return the path of the scene's file relative to the page, as a word of a shell."""
    return shlex.quote(f"scenes/{file_name(group.scene.name)}.toml")


def _record(group: SceneRuns, curve: tuple[str, str], runs: Sequence[Run]) -> Record:
    name = group.scene.name
    cards = [_card(group, run) for run in runs]
    return Record(
        places.of_family(name, curve), name, named(*curve), tone(curve[0]), cards, places.of_cell(name, curve)
    )


def _card(group: SceneRuns, run: Run) -> Card:
    found, record = grade(run.record), run.record
    numbers = {"Error": run.said, "Time of stepping": duration(run.seconds) if run.seconds else "–"}
    numbers |= {"Outcome": f"{run.outcome.label.lower().replace('_', ' ')}, t = {run.t_end:.4g} s"}
    numbers |= {label: power(run.metric(name)) for label, name in NUMBERS.items()}
    settings = group.varied_settings(run) or "no options"
    return Card(
        places.of_run(run),
        settings,
        str(found),
        SIGNS[found],
        numbers,
        record["message"],
        command(record, path(group)),
        _made(run),
    )


def _made(run: Run) -> str:
    """Return the record's id, version, commit, date and machine."""
    record = run.record
    facts = {
        "record": record["key"][:12],
        record["engine"]: record["version"],
        "commit": record.get("commit"),
        "made": record.get("date"),
        "on": record["machine"].get("cpu"),
    }
    return ", ".join(f"{name} {value}" for name, value in facts.items() if value)
