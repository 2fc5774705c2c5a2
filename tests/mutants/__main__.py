"""Plant drawn mutants one at a time in a copy of the tree, and see whether a test fails that runs the line.

``python -m tests.mutants --seed 1 --count 300`` draws so many places of the syntax trees of the packages, and
prints a line for each and the score of each package.  A mutant is killed where a test fails; where the tests
run out of time it is counted apart.  ``--only mbref/taylor`` draws from files of that path alone, and
``--list`` prints the mutants without running tests; ``--tests FILE …`` runs these test files alone, such as
the unit tests of the file.  Mutants that change nothing are listed with the reason
in ``tests/mutants/equivalent.py``.  No mutant is drawn of an adapter whose engine is not installed.

First every test runs once, and its lines are recorded in ``build/``; later runs record only test files that
have changed. Remove ``build/lines*.jsonl`` after you add a source, since no test is known to run its lines.
Against a mutant run the test files that run its line, those first that are quick and name its function or
module: each for 5 s of CPU time at most, until a test fails or 20 s are over; other work on the machine does
not end them. ``--budget 8`` gives them 8 s in all and 2 s each. A test is left out that fails or takes longer
than a file may without the mutant, too, or that fails only after other tests.
Results stay in ``build/mutants.jsonl`` as long as the file and its tests are the same, so that an interrupted
run goes on where it ended. ``--budget 100`` runs mutants again that survived a smaller budget. Tests of files
beside kernels run as plain Python, so that no kernel is compiled for a mutant. A mutant that only a test of a
stored text sees is counted apart. Exit status 1 where a mutant survives, is seen by a stored text alone or
runs out of time.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from rich.progress import Progress, TaskID

from tests.mutants.drawing import drawn
from tests.mutants.equivalent import reason
from tests.mutants.operators import Mutant
from tests.mutants.tree import (
    BUDGET,
    BY_TEXT,
    EQUIVALENT,
    KILLED,
    PACKAGES,
    ROOT,
    SURVIVED,
    TIMED_OUT,
    UNTESTED,
    Tree,
    is_plain,
)

KEPT = ROOT / "build" / "mutants.jsonl"
TREE = ROOT / "build" / "mutants" / "tree"
RECORDED = {False: ROOT / "build" / "lines.jsonl", True: ROOT / "build" / "lines_in_plain_python.jsonl"}


def key(mutant: Mutant, tests: Iterable[str], root: Path) -> str:
    """Return a digest of the mutant, its file and its tests."""
    texts = [*map(str, mutant), *((root / name).read_text() for name in (mutant.file, *sorted(tests)))]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def known(budget: float, path: Path = KEPT) -> dict[str, str]:
    """Return the results of runs before, by key; a kill, or what tests with at least that budget found."""
    return {
        record["key"]: record["result"]
        for record in _records(path)
        if record["result"] == KILLED or record.get("budget", BUDGET) >= budget
    }


def _records(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def run(
    chosen: Sequence[Mutant], seconds: float, alone: Sequence[str] = (), budget: float = BUDGET
) -> dict[Mutant, str]:
    """Return the result of each mutant; none is begun after that time.

    Test files that run ``alone`` replace the tests that run the mutant's line.
    """
    found, before, end = {}, known(budget), time.monotonic() + seconds
    with closing(Tree(TREE, budget=budget)) as tree:
        if not alone:
            recorded(tree, chosen)
        for k, mutant in enumerate(chosen, 1):
            tests = dict.fromkeys(alone) or tree.tests(mutant)
            name, by = key(mutant, tests, tree.place), ""
            if why := reason(mutant, (tree.place / mutant.file).read_text()):
                before[name] = EQUIVALENT
            elif name not in before:
                if time.monotonic() > end:
                    break
                before[name], by = tree.result(mutant, tests, not alone)
                with KEPT.open("a") as file:
                    record = {"key": name, "result": before[name], "by": by, "budget": budget}
                    print(json.dumps({**record, "mutant": _line(mutant)}), file=file)
            found[mutant] = before[name]
            print(f"{k:3} of {len(chosen)}: {found[mutant]:10} {_line(mutant)}  {why or by}", flush=True)
    return found


def recorded(tree: Tree, chosen: Sequence[Mutant]) -> None:
    """Record which tests run which lines, with and without compilation as the mutants need."""
    for plain in sorted({is_plain(m.file, (tree.place / m.file).read_text()) for m in chosen}):
        with Progress(transient=True) as bar:
            task = bar.add_task("recording the lines that tests run" + (", in plain Python" if plain else ""))

            def tell(done: int, total: int, bar: Progress = bar, task: TaskID = task) -> None:
                bar.update(task, completed=done, total=total)

            tree.record(plain, RECORDED[plain], os.cpu_count() or 1, tell)


def _line(mutant: Mutant) -> str:
    old, new = (" ".join(text.split()) for text in (mutant.old, mutant.new))
    return f"{mutant.file}:{mutant.line} {mutant.kind}: {old} → {new}"


def score(results: Sequence[str]) -> str:
    """Return the killed mutants of those that change something, and the numbers of the others."""
    real = [result for result in results if result != EQUIVALENT]
    killed = real.count(KILLED)
    others = [
        f"{results.count(r)} {r}"
        for r in (BY_TEXT, TIMED_OUT, SURVIVED, UNTESTED, EQUIVALENT)
        if r in results
    ]
    return ", ".join([f"{killed} of {len(real)} killed ({killed / max(1, len(real)):.0%})", *others])


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutants",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="default: 1")
    parser.add_argument("--count", type=int, default=300, metavar="N", help="default: 300")
    parser.add_argument("--only", default="", metavar="PATH", help="files whose path begins so")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no mutant after these")
    parser.add_argument("--list", action="store_true", help="print the mutants, run nothing")
    parser.add_argument("--tests", nargs="+", default=(), metavar="FILE", help="run these test files alone")
    parser.add_argument(
        "--budget", type=float, default=BUDGET, metavar="S", help="CPU s for a mutant's tests"
    )
    options = parser.parse_args()
    chosen = drawn(options.seed, options.count, options.only)
    if options.list:
        print(*map(_line, chosen), sep="\n")
        return 0
    found = run(chosen, 60 * options.minutes, options.tests, options.budget)
    for package in PACKAGES:
        if results := [result for mutant, result in found.items() if mutant.file.startswith(f"{package}/")]:
            print(f"{package}: {score(results)}")
    left = len(chosen) - len(found)
    print(f"all: {score([*found.values()])}" + (f", {left} not run" if left else ""))
    return 0 if not left and set(found.values()) <= {KILLED, EQUIVALENT} else 1


if __name__ == "__main__":
    sys.exit(main())
