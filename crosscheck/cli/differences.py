"""`crosscheck diff`: changes between two sets of records that exceed the noise of errors and times."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence

from rich.console import Console

from crosscheck.cli.request import RequestError
from crosscheck.cli.tables import listing_table
from crosscheck.study.difference import (
    ERROR_RATIO,
    MEASURE_NOISE,
    NOISE,
    SINGLE_RATIO,
    TIME_RATIO,
    Change,
    changes,
    circumstances,
    load,
)
from crosscheck.study.words.text import runs

COUNT = (
    "{} of {} runs of both sets changed. Changes are: another outcome or end; an error "
    f"(above {NOISE:g}) or another metric (above {MEASURE_NOISE:g}) by more than {ERROR_RATIO:g} times; "
    f"on the same machine a time by more than {TIME_RATIO:g} times, {SINGLE_RATIO:g} where it was measured "
    "once."
)
NONE_OF_BOTH = "The two sets have no run in common, so nothing is compared."
HEADER = ("scene", "engine", "family", "settings", "change")


def show(console: Console, old: str, new: str, is_all: bool) -> bool:
    """Print versions, machines, the numbers of runs that only one set has, and the changed runs or all runs;
    returns whether any run changed.

    Raises RequestError for a file without records.
    """
    try:
        before, after = load(old), load(new)
    except ValueError as error:
        raise RequestError(str(error)) from None
    found = changes(before, after)
    changed = [change for change in found if change.sentences]
    for sentence in circumstances(before, after):
        console.print(sentence, soft_wrap=True)
    if not is_all:
        for sentence in _of_one_set(changed):
            console.print(sentence, soft_wrap=True)
    if shown := found if is_all else [change for change in changed if change.old and change.new]:
        table = listing_table("runs", HEADER)
        for change in shown:
            table.add_row(*_row(change))
        console.print(table)
    both = [change for change in found if change.old and change.new]
    count = COUNT.format(sum(bool(change.sentences) for change in both), len(both))
    console.print(count if both else NONE_OF_BOTH, soft_wrap=True)
    return bool(changed)


def _of_one_set(changed: Sequence[Change]) -> Iterator[str]:
    """Return for each engine the number of runs that only one of the two sets has."""
    alone = [change for change in changed if change.old is None or change.new is None]
    counts = Counter((change.identity[1], *change.sentences) for change in alone)
    yield from (f"{engine}: {runs(number)} {sentence}" for (engine, sentence), number in counts.items())


def _row(change: Change) -> tuple[str, ...]:
    scene, engine, family, options, _ = change.identity
    settings = ", ".join(f"{name}={value}" for name, value in json.loads(options).items())
    return scene, engine, family, settings, "; ".join(change.sentences) or "none"
