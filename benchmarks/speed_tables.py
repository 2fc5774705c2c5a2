"""The tables of docs/speed.md in Markdown, from files of ``speed.py --out``.

    python benchmarks/speed_tables.py FILE.json …

A number is the cost of the cheapest opponent over the cost of mbref's cheapest family at an error of 1e-3,
1e-6 and 1e-9, or, against the limit, the reverse.
"""

from __future__ import annotations

import json
import math
from argparse import ArgumentParser
from collections.abc import Callable, Iterable
from pathlib import Path

from speed import ENGINES, LIMIT_NAME, OURS, OWN, SERIES, advantage, owner_of_integrator

Costs = dict[tuple[str, str], list[float]]  # by engine and family, seconds at the three errors
Chosen = Callable[[str, str], bool]  # whether a family of an engine belongs to a group
LEVELS = ("1e-3", "1e-6", "1e-9")


def series(engine: str, family: str) -> bool:
    """Whether a family is mbref's series, with or without generated code."""
    return engine == OURS and family.startswith(SERIES)


def dual(engine: str, family: str) -> bool:
    """Whether a family is mbref's sparse method."""
    return engine == OURS and family.startswith("alf-dual")


def engines(engine: str, family: str) -> bool:
    """Whether a family is an engine's, by any integrator."""
    return engine in ENGINES[1:4]


def own_integrators(engine: str, family: str) -> bool:
    """Whether a family is an engine's by its own integrator."""
    return engines(engine, family) and owner_of_integrator(engine, family) == OWN


def of(name: str) -> Chosen:
    """Return the group of all families of an engine."""
    return lambda engine, family: engine == name


TABLES: tuple[tuple[str, tuple[tuple[str, Chosen, Chosen], ...]], ...] = (
    ("Against the engines", (("`taylor`", engines, series), ("`alf-dual`", engines, dual))),
    (
        "Against the engines' own integrators, and the limit",
        (("own integrators / mbref", own_integrators, series), ("mbref / limit", series, of(LIMIT_NAME))),
    ),
    ("Against generated code", (("CasADi", of("casadi"), series), ("heyoka", of("heyoka"), series))),
)


def least(costs: Costs, group: Chosen) -> list[float]:
    """Return the least cost (s) of a group at each error."""
    rows = [cost for name, cost in costs.items() if group(*name)]
    return [min((row[level] for row in rows), default=math.inf) for level in range(len(LEVELS))]


def read(paths: Iterable[Path]) -> dict[str, Costs]:
    """Return the costs of each scene."""
    found = {}
    for path in paths:
        for scene, stored in json.loads(path.read_text(encoding="utf-8"))["scenes"].items():
            found[scene] = {
                (curve["engine"], curve["family"]): [math.inf if c is None else c for c in curve["cost"]]
                for curve in stored["curves"]
            }
    return found


def main() -> None:
    """Print the tables."""
    parser = ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", nargs="+", type=Path, help="of speed.py --out")
    scenes = read(parser.parse_args().file)
    for title, columns in TABLES:
        heads = [f"{name}: at {LEVELS[0]} | " + " | ".join(LEVELS[1:]) for name, _, _ in columns]
        print(f"\n{title}\n\n| scene | {' | '.join(heads)} |\n|---|{'--:|' * 3 * len(columns)}")
        for scene, costs in scenes.items():
            pairs = [(least(costs, a), least(costs, b)) for _, a, b in columns]
            cells = [advantage(a, b) for above, below in pairs for a, b in zip(above, below, strict=True)]
            print(f"| `{scene}` | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
