"""Plant every defect in turn in a copy of the tree, and see whether its tests fail.

``python -m tests.mutants`` prints a line a defect and the score; exit status 1 where a defect survives.
Kernels run as plain Python, so that none is compiled for a defect.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.mutants.defects import DEFECTS, Defect

ROOT = Path(__file__).parents[2]
COPIED = ("mbref", "crosscheck", "reports", "tests", "examples", "benchmarks", "pyproject.toml", "README.md")
MINUTES = 10  # after which the tests of a defect count as failed: it hangs
JITTED = ("mbref/kernels/",)  # what plain Python does not run


def killed(defect: Defect, tree: Path) -> bool:
    """Whether its tests fail with the defect in the tree, which is left as it was."""
    path = tree / defect.file
    good = path.read_text()
    if good.count(defect.old) != 1:
        raise ValueError(f"{defect.file}: has {defect.old!r} {good.count(defect.old)} times, not once")
    path.write_text(good.replace(defect.old, defect.new))
    try:
        return not passes(defect.tests, tree, defect.file.startswith(JITTED))
    finally:
        path.write_text(good)


def passes(tests: str, tree: Path, jitted: bool) -> bool:
    """Whether the tests pass in the tree."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    if not jitted:
        environment["NUMBA_DISABLE_JIT"] = "1"
    command = [sys.executable, "-P", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", tests]
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True,
                              timeout=60 * MINUTES, check=False)  # fmt: skip
    except subprocess.TimeoutExpired:
        return False
    if done.returncode not in (0, 1, 2):  # passed, failed, or not even collected
        raise RuntimeError(done.stdout + done.stderr)
    return done.returncode == 0


def planted(first: int, count: int | None) -> Iterator[tuple[Defect, bool]]:
    """Defects from a number on, and whether they were killed."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        tree = Path(folder)
        for name in COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, tree / name)
        sound: dict[str, bool] = {}
        chosen = DEFECTS[first:] if count is None else DEFECTS[first : first + count]
        for defect in chosen:
            if defect.tests not in sound:
                sound[defect.tests] = passes(defect.tests, tree, jitted=False)
            if not sound[defect.tests]:
                raise RuntimeError(f"{defect.tests}: fails without a defect")
            yield defect, killed(defect, tree)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--first", type=int, default=0, help="number of the first defect")
    parser.add_argument("--count", type=int, help="how many (default: all from there)")
    options = parser.parse_args()
    found = []
    for defect, dead in planted(options.first, options.count):
        found.append(dead)
        word = "killed  " if dead else "SURVIVED"
        print(f"{word} {defect.file}: {defect.old!r} → {defect.new!r}   ({defect.tests})", flush=True)
    print(f"{sum(found)} of {len(found)} killed")
    return 0 if all(found) else 1


if __name__ == "__main__":
    sys.exit(main())
