"""The page on engines and closed loops."""

from __future__ import annotations

from pathlib import Path

from crosscheck.closed_loops.records import FILE
from crosscheck.study.store import read_runs

from ..blocks import Block, Prose
from ..sections.closed_loops import overview, runs

TITLE = "Engines on closed loops"
HEAD = """
This page helps to choose an engine for a mechanism with closed loops. An engine closes a loop where the last
joint of the loop stays closed and the motion is right. Each row is an engine, each column a mechanism that
is hard in one way. A cell has the largest error of any body at any sample, against a closed form or the
[reference solution](../reference.md). The name of an engine leads to its settings, reasons and commands.

```sh
crosscheck closed-loops                        # print the two tables; nothing is simulated
crosscheck closed-loops --run --engine drake   # measure an engine that is installed here
crosscheck closed-loops --force --page docs/results/closed-loops.md
```
"""


def blocks(records: Path = FILE) -> list[Block]:
    """Return the page of the records in a file."""
    found = read_runs(records)
    return [Prose(HEAD), *overview(found), *runs(found)]
