"""Plant drawn mutants one at a time in a copy of the sources, and see whether a test of the line fails.
``python -m tests.mutants --seed 1 --count 50`` draws so many places of the syntax trees of the packages, and
prints a line for each, the numbers of killed mutants by folder, and the lines that survive. Tests run as
plain Python. Once for each test its lines are recorded in ``build/mutants``. Against a mutant run the tests
that run its line, until a test fails or 60 CPU s are over: first the quick tests that run few other lines.
This is a tool to find cases that the tests lack: a mutant survives where no test shows the difference,
or where the line makes none."""

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIBRARIES = ("numpy", "scipy.linalg", "scipy.integrate", "scipy.optimize", "scipy.interpolate", "hypothesis")
LIBRARIES += ("scipy.sparse.linalg", "pydantic", "numba", "rich.progress", "jinja2", "matplotlib.figure")
LIBRARIES += ("mujoco",)
TESTS = ("tests/doors", "tests/contracts", "tests/properties", "tests/reports")
BUDGET = 60.0  # CPU s of the tests of a mutant


def main() -> int:
    """Run the command line."""
    given = {"description": __doc__, "formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", **given)
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="default: 1")
    parser.add_argument("--count", type=int, default=50, metavar="N", help="default: 50")
    parser.add_argument("--only", nargs="+", default=(), metavar="PATH", help="paths of sources begin so")
    shown = f"default: {' '.join(TESTS)}"
    parser.add_argument("--tests", nargs="+", default=TESTS, metavar="PATH", help=shown)
    parser.add_argument("--budget", type=float, default=BUDGET, metavar="S", help="CPU s of a mutant's tests")
    parser.add_argument("--list", action="store_true", help="print the mutants, run nothing")
    options = parser.parse_args()
    prepare()
    from tests.mutants.drawing import drawn
    from tests.mutants.runner import KILLED, Copy

    chosen = drawn(ROOT, options.seed, options.count, options.only)
    if options.list:
        print(*(f"{mutant.file}:{mutant.line} {mutant.kind}" for mutant in chosen), sep="\n")
        return 0
    build = ROOT / "build" / "mutants"
    copy = Copy(ROOT, build / "copy", build / "lines", options.budget)
    for file in files_of(options.tests):
        copy.record(file)
    results = {}
    for k, mutant in enumerate(chosen, 1):
        results[mutant], by = copy.result(mutant)
        line = f"{k:3} of {len(chosen)}: {results[mutant]} {mutant.file}:{mutant.line} {by}"
        print(line.rstrip(), flush=True)
    print(*table([(mutant.file, result == KILLED) for mutant, result in results.items()]), sep="\n")
    for mutant, result in results.items():
        if result != KILLED:
            head = f"\n{mutant.file}:{mutant.line} {mutant.kind}, {result}"
            print(head, *mutant.difference(ROOT), sep="\n")
    return 0


def prepare() -> None:
    """Choose plain Python, one thread, and import the libraries, which forks then need not."""
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_DISABLE_JIT"), "1")
    for name in LIBRARIES:
        if find_spec(name.partition(".")[0]):
            import_module(name)


def files_of(paths: Sequence[str]) -> list[str]:
    """Return the test files of files and folders, relative to the sources."""
    found = {file for path in paths for file in [ROOT / path, *(ROOT / path).rglob("test_*.py")]}
    return sorted(file.relative_to(ROOT).as_posix() for file in found if file.is_file())


def table(results: Sequence[tuple[str, bool]]) -> Iterator[str]:
    """Yield a line for each folder, and one for all, from files of mutants and whether these are killed."""
    folders: dict[str, list[bool]] = {}
    for file, is_killed in results:
        folders.setdefault("/".join(Path(file).parts[:-1][:2]), []).append(is_killed)
    for name, killed in [*sorted(folders.items()), ("all", [is_killed for _, is_killed in results])]:
        yield f"{name}: {sum(killed)} of {len(killed)} killed ({sum(killed) / max(1, len(killed)):.0%})"


if __name__ == "__main__":
    sys.exit(main())
