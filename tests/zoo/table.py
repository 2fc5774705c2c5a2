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
HEAD = f"""# What the conformance suite checks, and what proves that it does

`crosscheck verify ENGINE` holds an engine against the cards below; `docs/verify-your-engine.md` tells how.
A card passes, fails, or says why it does not apply: the engine cannot run the scene, or the scene is outside
the card's domain. A card's number counts up when its check becomes another, so that verdicts of different
checks are never compared.

Every card is proved by defects: {len(DEFECTS)} changes of one line, planted one at a time in
`examples/spatial_engine` (`tests/zoo/defects.toml`). Each makes the card beside it fail on the scene named,
where the unchanged engine passes (`pytest tests/zoo`). This file is written by
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
    """The defects, each with the scene and the card that tells it, as TOML."""
    lines = ("[[defect]]", "about = {about!r}", "scene = {scene!r}", "card = {card!r}", "")
    head = "# Written by `python -m tests.zoo.table docs/conformance.md`.\n\n"
    told = (line.format(**defect._asdict()) for defect in DEFECTS.values() for line in lines)
    return head + "\n".join(told)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page())
    FOR_REPORTS.write_text(data())
