"""`crosscheck diff`: what changed beyond noise between two sets of records."""

from __future__ import annotations

import json

from rich.console import Console

from crosscheck.cli.request import RequestError
from crosscheck.cli.tables import listing_table
from crosscheck.study.difference import ERROR_RATIO, NOISE, TIME_RATIO, Change, changes, circumstances, load

COUNT = (
    f"{{}} of {{}} runs changed: another outcome, an error above {NOISE:g} that changed by more than "
    f"{ERROR_RATIO:g} times, or a time that changed by more than {TIME_RATIO:g} times on the same machine."
)
HEADER = ("scene", "engine", "family", "settings", "change")


def show(console: Console, old: str, new: str, is_all: bool) -> bool:
    """Print versions, machines and runs that changed, or all runs; returns whether any did.

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
    if shown := found if is_all else changed:
        table = listing_table("runs", HEADER)
        for change in shown:
            table.add_row(*_row(change))
        console.print(table)
    console.print(COUNT.format(len(changed), len(found)), soft_wrap=True)
    return bool(changed)


def _row(change: Change) -> tuple[str, ...]:
    scene, engine, family, options, _ = change.identity
    settings = ", ".join(f"{name}={value}" for name, value in json.loads(options).items())
    return scene, engine, family, settings, "; ".join(change.sentences) or "none"
