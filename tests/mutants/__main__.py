"""Plant every defect in turn in a copy of the tree, and see whether its tests fail.

``python -m tests.mutants`` prints a line a defect and the score; exit status 1 where a defect survives whose
table gives no reason.  Results stay in ``build/mutants.jsonl``, and are taken from there as long as the
defect, its file and its tests are the same: an interrupted run goes on where it ended.
Kernels run as plain Python, so that none is compiled for a defect.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from tests.mutants.defects import DEFECTS, Defect

ROOT = Path(__file__).parents[2]
COPIED = ("mbref", "crosscheck", "reports", "tests", "examples", "benchmarks", "pyproject.toml", "README.md")
KEPT = ROOT / "build" / "mutants.jsonl"
MINUTES = 4  # after which the tests of a defect count as failed: it hangs
JITTED = ("mbref/kernels/",)  # what plain Python does not run


class Tree:
    """A copy of the sources, in which defects are planted."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self.sound: set[str] = set()
        for name in COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, place / name)

    def kills(self, defect: Defect) -> bool:
        """Whether the defect's tests, which pass without it, fail with it; the tree is left as it was."""
        jitted = defect.file.startswith(JITTED)
        self._check_soundness(defect.tests, jitted)
        path = self.place / defect.file
        good = path.read_text()
        if good.count(defect.old) != 1:
            raise ValueError(f"{defect.file}: has {defect.old!r} {good.count(defect.old)} times, not once")
        path.write_text(good.replace(defect.old, defect.new))
        try:
            return not self._passes(defect.tests, jitted)
        finally:
            path.write_text(good)

    def _check_soundness(self, tests: str, jitted: bool) -> None:
        if tests not in self.sound and not self._passes(tests, jitted):
            raise RuntimeError(f"{tests}: fails without a defect, or takes longer than {MINUTES} minutes")
        self.sound.add(tests)

    def _passes(self, tests: str, jitted: bool) -> bool:
        environment = {**os.environ, "PYTHONPATH": str(self.place), "PYTHONDONTWRITEBYTECODE": "1",
                       "HYPOTHESIS_PROFILE": "first"}  # fmt: skip
        if not jitted:
            environment["NUMBA_DISABLE_JIT"] = "1"
        command = [sys.executable, "-P", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests.split()]
        try:
            done = subprocess.run(command, cwd=self.place, env=environment, capture_output=True, text=True,
                                  timeout=60 * MINUTES, check=False)  # fmt: skip
        except subprocess.TimeoutExpired:
            return False
        if done.returncode not in (0, 1, 2):  # passed, failed, or not even collected
            raise RuntimeError(done.stdout + done.stderr)
        return done.returncode == 0


def key(defect: Defect) -> str:
    """A digest of the defect, its file and its tests."""
    files = [defect.file, *(node.split("::")[0] for node in defect.tests.split())]
    texts = [*map(str, defect), *((ROOT / name).read_text() for name in files)]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def known() -> dict[str, bool]:
    """Results of runs before, by key."""
    lines = KEPT.read_text().splitlines() if KEPT.exists() else []
    return {record["key"]: record["killed"] for record in map(json.loads, lines)}


def run(chosen: Sequence[Defect], seconds: float) -> dict[Defect, bool]:
    """Which of the defects were killed; none is begun after that time."""
    found, before, end = {}, known(), time.monotonic() + seconds
    KEPT.parent.mkdir(exist_ok=True)
    with ExitStack() as stack:
        tree: Tree | None = None
        for k, defect in enumerate(chosen, 1):
            name = key(defect)
            if name not in before:
                if time.monotonic() > end:
                    break
                tree = tree or Tree(Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mutants-"))))
                before[name] = tree.kills(defect)
                with KEPT.open("a") as file:
                    print(json.dumps({"key": name, "killed": before[name]}), file=file)
            found[defect] = before[name]
            print(f"{k:3} of {len(chosen)}: {_line(defect, found[defect])}", flush=True)
    return found


def _line(defect: Defect, killed: bool) -> str:
    word = "killed  " if killed else "SURVIVED" if not defect.unseen else "unseen  "
    return f"{word} {defect.file}: {defect.old!r} → {defect.new!r}   ({defect.unseen or defect.tests})"


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument(
        "--only", default="", metavar="TEXT", help="defects whose file or tests have the text"
    )
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no defect after these")
    options = parser.parse_args()
    chosen = [d for d in DEFECTS if options.only in f"{d.file} {d.tests}"]
    found = run(chosen, 60 * options.minutes)
    areas = sorted({_area(d) for d in found})
    print(", ".join(f"{area} {_score([found[d] for d in found if _area(d) == area])}" for area in areas))
    left = len(chosen) - len(found)
    print(f"{_score([*found.values()])} killed" + (f", {left} not run" if left else ""))
    return 0 if not left and all(dead or defect.unseen for defect, dead in found.items()) else 1


def _area(defect: Defect) -> str:
    return defect.file.rsplit("/", 1)[0]


def _score(killed: Sequence[bool]) -> str:
    return f"{sum(killed)} of {len(killed)} ({sum(killed) / max(1, len(killed)):.0%})"


if __name__ == "__main__":
    sys.exit(main())
