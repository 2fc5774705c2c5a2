"""Fuzz the doors of both packages: ``python -m tests.fuzz scene_file --count 20000 --seed 0``. Every case
runs in a child process, so that a signal or a hang is found as an exception is. Prints how the cases ended,
and every defect with its seeds; exit status 1 where there is one."""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator

from crosscheck.processes.child import Child, ChildFailed
from tests.fuzz import targets

COMPILING = 1200.0  # s, once a machine
PATIENCE = 3 * targets.LONG  # s; a case that has not heard its interrupt by then hangs


def fuzz(target: str, count: int, seed: int) -> Iterator[tuple[int, str, str]]:
    """(seed, ending, defect) of every case."""
    child = _ready()
    try:
        for k in range(seed, seed + count):
            try:
                yield k, *child.call(targets.case, (target, k), PATIENCE).value
            except ChildFailed as failure:
                yield k, failure.outcome.name, str(failure)
                child.close()
                child = _ready()
    finally:
        child.close()


def _ready() -> Child:
    """A child that has compiled."""
    child = Child()
    child.call(targets.compile_all, (), COMPILING)
    return child


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("target", choices=tuple(targets.TARGETS))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    parser.add_argument("--verbose", action="store_true", help="every case on standard error")
    options = parser.parse_args()
    endings: Counter[str] = Counter()
    found: dict[str, list[int]] = {}
    for seed, ending, defect in fuzz(options.target, options.count, options.seed):
        endings[ending] += 1
        if defect:
            found.setdefault(defect, []).append(seed)
        if options.verbose:
            print(seed, ending, defect, file=sys.stderr, flush=True)
    for defect, seeds in sorted(found.items(), key=lambda item: -len(item[1])):
        print(f"{len(seeds)} × {defect}   seeds {seeds[:5]}")
    counts = ", ".join(f"{ending} {n}" for ending, n in endings.most_common())
    print(f"{options.target}: {options.count} cases from seed {options.seed}: {counts}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
