"""The table of cards and the defects that prove them: ``python -m tests.zoo.table docs/conformance.md``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from crosscheck.conformance.suite import Verdict, abouts
from tests.zoo.defects import DEFECTS

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


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page())
