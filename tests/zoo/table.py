"""The table of cards and the defects that prove them, written by ``python -m tests.zoo.table
docs/conformance.md``, and the same as data for reports."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from crosscheck.conformance import suite
from crosscheck.conformance.suite import Verdict, abouts
from tests.zoo.defects import DEFECTS

FOR_REPORTS = Path(suite.__file__).with_name("proved_by.toml")
HEAD = f"""# Conformance cards

This page lists the checks ("cards") of the conformance suite, for readers of a verdict by
`crosscheck verify ENGINE`. [Verify your engine](verify-your-engine.md) explains how to run it. A card passes,
fails, or does not apply, with a reason. The number of a card increases when its check changes, so that
verdicts of different checks are never compared.

Each card has been tested with defects: {len(DEFECTS)} changes of one line, planted one at a time in
`examples/spatial_engine` (`tests/zoo/defects.toml`). With a defect the card in its row fails on the scene in
its row, and passes without it (`pytest tests/zoo`). This page is written by
`python -m tests.zoo.table docs/conformance.md`.
"""


def page() -> str:
    """The whole page."""
    return "\n".join([HEAD, *_cards(), "", "## Defects", "", *_defects()]) + "\n"


def _cards() -> Iterator[str]:
    yield "## Cards"
    yield ""
    yield "| card | what it checks | defects |"
    yield "| --- | --- | --: |"
    for name, about in abouts().items():
        count = sum(defect.card == name for defect in DEFECTS.values())
        yield f"| {Verdict(name, '', '').card()} | {about} | {count} |"


def _defects() -> Iterator[str]:
    yield "| defect | scene | card that fails |"
    yield "| --- | --- | --- |"
    for defect in DEFECTS.values():
        yield f"| {defect.about} | {defect.scene} | {defect.card} |"


def data() -> str:
    """The defects, each with the scene and the card that detects it, as TOML."""
    lines = ("[[defect]]", "about = {about!r}", "scene = {scene!r}", "card = {card!r}", "")
    head = "# Written by `python -m tests.zoo.table docs/conformance.md`.\n\n"
    told = (line.format(**defect._asdict()) for defect in DEFECTS.values() for line in lines)
    return head + "\n".join(told)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page())
    FOR_REPORTS.write_text(data())
