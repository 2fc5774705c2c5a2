"""Every sentence of `crosscheck compare` on scenes, recomputed from the records of the runs.

``python -m tests.crosscheck.sentences_of SCENE ...`` runs the comparisons, and prints each verdict that the
records do not confirm.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import crosscheck
from crosscheck.cli.comparison import Comparison
from crosscheck.engine import engine
from tests.crosscheck import recomputed


def faults(found: Comparison) -> Iterator[str]:
    """Yield a line for each part of a verdict that differs from the records."""
    judged, said = found.judged, found.verdict
    unlike = dict(judged.differences)
    records = [r for r in judged.records if r["engine"] not in unlike]
    ours = {name: list(engine(name).integrated_here) for name in recomputed.names(records)}
    bound = judged.truth["bound"] or 0.0
    checks: dict[str, Callable[[], None]] = {
        "headline": lambda: recomputed.headline(said.headline, records, list(unlike)),
        "right": lambda: recomputed.right(said.right, records, bound, unlike),
        "fast": lambda: recomputed.fast(said.fast, list(judged.records), ours, list(unlike)),
        "breaks": lambda: recomputed.breaks(said.breaks, records),
    }
    if not judged.is_judged:  # no error is known
        return
    for name, check in checks.items():
        try:
            check()
        except AssertionError as fault:
            yield f"{name}: {fault}"


def main(paths: list[str]) -> int:
    """Print the verdicts and their faults; return the number of faults."""
    count = 0
    for path in paths:
        found = crosscheck.compare(path)
        differing = list(faults(found))
        count += len(differing)
        print(f"{path}: {len(found.records)} runs, {len(differing)} faults")
        for line in (*differing, *found.verdict):
            print(f"  {line}", flush=True)
    return count


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
