"""The tables of docs/speed.md in Markdown, from files of ``speed.py --out``.

    python benchmarks/speed_tables.py FILE.json …

A number is the cost of the cheapest opponent over the cost of mbref's cheapest family at an error of 1e-3,
1e-6 and 1e-9, or, against the limit, the reverse.
"""

from __future__ import annotations

import json
import math
from argparse import ArgumentParser
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from speed import OPPONENTS, OURS, OURSELVES, advantage, least_costs, rows_of

Rows = Sequence[dict[str, Any]]  # families with engine and costs (s) at the three errors
Group = Callable[[Rows], Rows]
LEVELS = ("1e-3", "1e-6", "1e-9")


def opponents(name: str) -> Group:
    """Return the group of opponents of this name."""
    return lambda rows: rows_of(rows, *OPPONENTS[name])


def engine(name: str) -> Group:
    """Return the group of all families of an engine."""
    return lambda rows: rows_of(rows, (name,))


def ours(belongs: Callable[[str], bool]) -> Group:
    """Return the group of mbref's families whose names pass a test."""
    return lambda rows: [row for row in rows_of(rows, (OURS,)) if belongs(row["family"])]


SERIES = ours(OURSELVES["series"])
DUAL = ours(lambda family: family.startswith("alf-dual"))
TABLES: tuple[tuple[str, tuple[tuple[str, Group, Group], ...]], ...] = (
    (
        "Against the engines",
        (("`taylor`", opponents("engines"), SERIES), ("`alf-dual`", opponents("engines"), DUAL)),
    ),
    (
        "Against the engines' own integrators, and the limit",
        (
            ("own integrators / mbref", opponents("own integrators"), SERIES),
            ("mbref / limit", SERIES, opponents("limit")),
        ),
    ),
    ("Against generated code", (("CasADi", engine("casadi"), SERIES), ("heyoka", engine("heyoka"), SERIES))),
)


def read(paths: Iterable[Path]) -> dict[str, Rows]:
    """Return the families of each scene with their costs, infinite where a family misses an error."""
    return {
        scene: [
            {**curve, "cost": [math.inf if cost is None else cost for cost in curve["cost"]]}
            for curve in stored["curves"]
        ]
        for path in paths
        for scene, stored in json.loads(path.read_text(encoding="utf-8"))["scenes"].items()
    }


def main() -> None:
    """Print the tables."""
    parser = ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", nargs="+", type=Path, help="of speed.py --out")
    scenes = read(parser.parse_args().file)
    for title, columns in TABLES:
        heads = [f"{name}: at {LEVELS[0]} | " + " | ".join(LEVELS[1:]) for name, _, _ in columns]
        print(f"\n{title}\n\n| scene | {' | '.join(heads)} |\n|---|{'--:|' * 3 * len(columns)}")
        for scene, rows in scenes.items():
            pairs = [(least_costs(above(rows)), least_costs(below(rows))) for _, above, below in columns]
            cells = [advantage(a, b) for above, below in pairs for a, b in zip(above, below, strict=True)]
            print(f"| `{scene}` | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
