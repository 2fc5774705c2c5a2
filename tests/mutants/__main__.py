"""Plant drawn mutants one at a time in a copy of the tree, and see whether tests fail that import the file.

``python -m tests.mutants --seed 1 --count 300`` draws so many places of the syntax trees of the packages, and
prints a line for each and the score of each package.  A mutant is killed where a test fails; where the tests
run out of time it is counted apart.  ``--only mbref/taylor`` draws from files of that path alone, and
``--list`` prints the mutants without running tests.  Mutants that change nothing are listed with the reason
in ``tests/mutants/equivalent.py``.  No mutant is drawn of an adapter whose engine is not installed.

The tests of a mutant run in one process, the quickest first.  Their limits are CPU time, so that other work
on the machine does not end them.  Results and the times of tests stay in ``build/mutants.jsonl`` as long as
the file and its tests are the same, so that an interrupted run goes on where it ended.  Kernels run as plain
Python, so that none is compiled for a mutant.  Exit status 1 where a mutant survives or runs out of time.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from crosscheck.engine import installed
from tests.mutants.equivalent import reason
from tests.mutants.importers import ADAPTERS, PACKAGES, engines, importers
from tests.mutants.operators import Mutant, mutants

ROOT = Path(__file__).parents[2]
COPIED = (*PACKAGES, "tests", "examples", "benchmarks", "docs", "pyproject.toml", "README.md")
KEPT = ROOT / "build" / "mutants.jsonl"
KILLED, SURVIVED, TIMED_OUT = "killed", "survived", "timed out"
EQUIVALENT, UNTESTED = "equivalent", "untested"
LEAST, FACTOR = 20.0, 4.0  # CPU s that tests may take with a mutant, and multiples of their time without
LONGEST = 60.0  # CPU s that a test file may take without; others are left out
WAITING = 50.0  # wall time / CPU time, after which tests wait for something that does not come
JITTED = ("mbref/kernels/",)  # what plain Python does not run


class Tree:
    """A copy of the sources, in which mutants are planted; it keeps the CPU times of tests in a file."""

    def __init__(
        self, place: Path, root: Path = ROOT, copied: Sequence[str] = COPIED, kept: Path = KEPT
    ) -> None:
        self.place, self._kept = place, kept
        self._seconds = {r["time of"]: r["seconds"] for r in _records(kept) if "time of" in r}
        for name in (name for name in copied if (root / name).exists()):
            copy = shutil.copytree if (root / name).is_dir() else shutil.copy
            copy(root / name, place / name)

    def result(self, mutant: Mutant, tests: Sequence[str]) -> str:
        """Return whether the tests see a mutant: KILLED, SURVIVED or TIMED_OUT, or UNTESTED where no test
        passes without it.  The tree is left as it was."""
        jitted = mutant.file.startswith(JITTED)
        seconds = {test: self._time(test, jitted) for test in tests}
        sound = sorted((test for test in tests if seconds[test] <= LONGEST), key=lambda test: seconds[test])
        if not sound:
            return UNTESTED
        path = self.place / mutant.file
        good = path.read_text()
        path.write_text(mutant.planted(good))
        try:
            limit = max(LEAST, FACTOR * sum(seconds[test] for test in sound))
            status, _ = self._run(sound, jitted, limit)
        finally:
            path.write_text(good)
        return TIMED_OUT if status is None else SURVIVED if status == 0 else KILLED

    def _time(self, test: str, jitted: bool) -> float:
        """The CPU seconds that a test file takes without a mutant; infinite where it fails."""
        text = f"{test} {jitted} {(self.place / test).read_text()}"
        name = hashlib.sha256(text.encode()).hexdigest()[:16]
        if name not in self._seconds:
            status, seconds = self._run([test], jitted, LONGEST)
            self._seconds[name] = seconds if status == 0 else float("inf")
            with self._kept.open("a") as file:
                record = {"time of": name, "seconds": self._seconds[name], "test": test}
                print(json.dumps(record), file=file)
        return self._seconds[name]

    def _run(self, tests: Sequence[str], jitted: bool, limit: float) -> tuple[int | None, float]:
        """Return the exit status of pytest and its CPU seconds: 0 passed, 1 failed, 2 not even collected; 0
        where there is no test; None when the time was up."""
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.place),
            "PYTHONDONTWRITEBYTECODE": "1",
            "HYPOTHESIS_PROFILE": "first",
        }
        if not jitted:
            environment["NUMBA_DISABLE_JIT"] = "1"
        command = [sys.executable, "-P", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
        begun = _children_seconds()
        try:
            done = subprocess.run(
                command,
                cwd=self.place,
                env=environment,
                capture_output=True,
                text=True,
                timeout=WAITING * limit,
                check=False,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5)),
            )
        except subprocess.TimeoutExpired:
            return None, _children_seconds() - begun
        status = {5: 0, -signal.SIGXCPU: None, -signal.SIGKILL: None}.get(done.returncode, done.returncode)
        return status, _children_seconds() - begun


def _children_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def drawn(seed: int, count: int, only: str = "") -> list[Mutant]:
    """Return ``count`` mutants, or all where there are fewer, of the files whose path begins with ``only``.

    Half of them are drawn by file and then by place, the others by place alone, so that small files are seen,
    too.
    """
    files = {name: mutants(name, (ROOT / name).read_text()) for name in _files(only)}
    files = {name: found for name, found in files.items() if found}
    draw = random.Random(f"{seed} {only}")
    places = [mutant for found in files.values() for mutant in found]
    chosen: dict[Mutant, None] = {}
    while len(chosen) < min(count, len(places)):
        pool = places if len(chosen) % 2 else files[draw.choice(list(files))]
        chosen[draw.choice(pool)] = None
    return list(chosen)


def _files(only: str) -> Iterator[str]:
    absent = tuple(f"{ADAPTERS}{name}/" for name in engines() if not installed(name))
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if name.startswith(only) and not name.startswith(absent):
                yield name


def key(mutant: Mutant, tests: Sequence[str]) -> str:
    """Return a digest of the mutant, its file and its tests."""
    texts = [*map(str, mutant), *((ROOT / name).read_text() for name in (mutant.file, *tests))]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def known(path: Path = KEPT) -> dict[str, str]:
    """Return the results of runs before, by key."""
    return {record["key"]: record["result"] for record in _records(path) if "result" in record}


def _records(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def run(chosen: Sequence[Mutant], seconds: float) -> dict[Mutant, str]:
    """Return the result of each mutant; none is begun after that time."""
    found, before, end = {}, known(), time.monotonic() + seconds
    KEPT.parent.mkdir(exist_ok=True)
    with ExitStack() as stack:
        tree: Tree | None = None
        for k, mutant in enumerate(chosen, 1):
            tests = importers(mutant.file)
            name = key(mutant, tests)
            if why := reason(mutant, (ROOT / mutant.file).read_text()):
                before[name] = EQUIVALENT
            elif name not in before:
                if time.monotonic() > end:
                    break
                tree = tree or Tree(Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mutants-"))))
                before[name] = tree.result(mutant, tests)
                with KEPT.open("a") as file:
                    print(json.dumps({"key": name, "result": before[name]}), file=file)
            found[mutant] = before[name]
            print(f"{k:3} of {len(chosen)}: {found[mutant]:10} {_line(mutant)}  {why or ''}", flush=True)
    return found


def _line(mutant: Mutant) -> str:
    old, new = (" ".join(text.split()) for text in (mutant.old, mutant.new))
    return f"{mutant.file}:{mutant.line} {mutant.kind}: {old} → {new}"


def score(results: Sequence[str]) -> str:
    """Return the killed mutants of those that change something, and the numbers of the others."""
    real = [result for result in results if result != EQUIVALENT]
    killed = real.count(KILLED)
    others = [f"{results.count(r)} {r}" for r in (TIMED_OUT, SURVIVED, UNTESTED, EQUIVALENT) if r in results]
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
    parser.add_argument("--list", action="store_true", help="print the mutants and their tests, run nothing")
    options = parser.parse_args()
    chosen = drawn(options.seed, options.count, options.only)
    if options.list:
        for mutant in chosen:
            print(f"{_line(mutant)}   ({' '.join(importers(mutant.file)) or 'no test imports it'})")
        return 0
    found = run(chosen, 60 * options.minutes)
    for package in PACKAGES:
        if results := [result for mutant, result in found.items() if mutant.file.startswith(f"{package}/")]:
            print(f"{package}: {score(results)}")
    left = len(chosen) - len(found)
    print(f"all: {score([*found.values()])}" + (f", {left} not run" if left else ""))
    return 0 if not left and set(found.values()) <= {KILLED, EQUIVALENT} else 1


if __name__ == "__main__":
    sys.exit(main())
