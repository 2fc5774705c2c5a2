"""Plant drawn mutants one at a time in a copy of the tree, and see whether tests fail that import the file.

``python -m tests.mutants --seed 1 --count 300`` draws so many places of the syntax trees of the packages, and
prints a line for each and the score of each package.  A mutant is killed where a test fails; where the tests
run out of time it is counted apart.  ``--only mbref/taylor`` draws from files of that path alone, and
``--list`` prints the mutants without running tests; ``--tests FILE …`` runs these test files alone, such as
the unit tests of the file.  Mutants that change nothing are listed with the reason
in ``tests/mutants/equivalent.py``.  No mutant is drawn of an adapter whose engine is not installed.

The test files that killed other mutants of the folder run first, then files that are quick and name the
mutant's function or module, each for 5 s of CPU time at most, until a test fails or 20 s are over; other
work on the machine does not end them. ``--budget 8`` gives them 8 s in all and 2 s each. A test is left out
that fails or takes longer than a file may without the mutant, too, or that fails only after other tests.
Results stay in ``build/mutants.jsonl`` as long as the file and its tests are the same, so that an interrupted
run goes on where it ended. Tests of mbref and of kernels run as plain Python, so that no kernel is compiled
for a mutant. A mutant that only a test of a stored text sees is counted apart. Exit status 1 where a mutant
survives, is seen by a stored text alone or runs out of time.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from crosscheck import engine as crosscheck_engine
from tests.mutants.equivalent import reason
from tests.mutants.importers import ADAPTERS, PACKAGES, SNAPSHOTS, engines, importers
from tests.mutants.operators import Mutant, mutants
from tests.mutants.order import around, ordered

ROOT = Path(__file__).parents[2]
COPIED = (*PACKAGES, "tests", "examples", "benchmarks", "docs", "pyproject.toml", "README.md")
KEPT = ROOT / "build" / "mutants.jsonl"
TREE = ROOT / "build" / "mutants" / "tree"
WORKERS = Path(__file__).with_name("workers.py")
KILLED, SURVIVED, TIMED_OUT = "killed", "survived", "timed out"
BY_TEXT, EQUIVALENT, UNTESTED = "killed by a stored text alone", "equivalent", "untested"
# packages whose numbers stand in stored texts
RENDERED = "reports/", "crosscheck/study/", "crosscheck/judge/"
BUDGET = 20.0  # CPU s of all files of a mutant, after which no test begins
# parts of the budget after which no test of a file begins, and after which a test is ended
OF_FILE, LIMIT = 1 / 4, 3 / 2
WAITING = 50.0  # wall time / CPU time, after which tests wait for something that does not come
COMPILING = (  # plain Python does not run them
    "mbref/kernels/compilation.py",
    "mbref/kernels/disk_cache.py",
    "mbref/kernels/named_memory.py",
)


class Tree:
    """A copy of the sources, in which mutants are planted; processes of its own run the tests.

    The copy stands always in the same place, since compiled kernels are kept by the path of their source.
    """

    def __init__(
        self, place: Path, root: Path = ROOT, copied: Sequence[str] = COPIED, budget: float = BUDGET
    ) -> None:
        self.place, self._planted, self._begun, self._budget = place, 0, time.time(), budget
        self._workers: dict[bool, subprocess.Popen[str]] = {}
        self._seconds: dict[str, float] = {}  # CPU s of files and tests
        self._kills: Counter[tuple[str, str]] = Counter()  # by folder of the mutant and test file
        self._sound: dict[bool, dict[str, bool]] = {True: {}, False: {}}
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        for name in (name for name in copied if (root / name).exists()):
            copy = shutil.copytree if (root / name).is_dir() else shutil.copy2
            copy(root / name, place / name)

    def result(self, mutant: Mutant, tests: Sequence[str], with_texts: bool = True) -> tuple[str, str]:
        """Return whether tests see a mutant, KILLED, BY_TEXT, SURVIVED or TIMED_OUT, and the first test that
        does.

        A test that fails without the mutant, too, is left out.  Where no test fails, stored texts are tested
        if ``with_texts`` is true.  The tree is left as it was.
        """
        if not tests:
            return UNTESTED, ""
        source = (self.place / mutant.file).read_text()
        plain = is_plain(mutant.file, source)
        texts = {test: (self.place / test).read_text() for test in tests}
        folder = str(Path(mutant.file).parent)
        kills = {test: self._kills[folder, test] for test in tests}
        files = ordered(mutant, source, texts, self._seconds, kills)
        result, test = self._seen(mutant, source, files, plain)
        if result == KILLED:
            self._kills[folder, test.partition("::")[0]] += 1
        if with_texts and result == SURVIVED and mutant.file.startswith(RENDERED):
            result, test = self._seen(mutant, source, SNAPSHOTS, plain)
            result = BY_TEXT if result == KILLED else SURVIVED  # a text that takes too long sees nothing
        return result, test

    def _seen(self, mutant: Mutant, source: str, files: Sequence[str], plain: bool) -> tuple[str, str]:
        """Return KILLED, SURVIVED or TIMED_OUT, and the test that fails or takes too long."""
        words = [Path(mutant.file).stem, *around(source, mutant)]
        while True:
            with self._plant(mutant, source):
                answer = self._ask(plain, files, words=words)
            test = answer["failed"]
            if answer["status"] in (0, 5):
                late = [test for test in answer["ended"] if self._is_sound(test, plain)]
                return (TIMED_OUT, late[0]) if late else (SURVIVED, "")
            if answer["status"] is None:
                return TIMED_OUT, ""
            if not test and self._ask(plain, files)["status"] not in (0, 5):
                raise RuntimeError(f"the tests end early without a mutant, too: {' '.join(files)}")
            if not test or self._is_sound(test, plain):
                if not test or self._fails_alone(mutant, source, test, plain):
                    return KILLED, test
                self._sound[plain][test] = False  # it fails after other tests alone
            files = [file for file in files if file != test]

    def _is_sound(self, test: str, plain: bool) -> bool:
        """Return whether a test passes without a mutant, in the time of a file; others are left out."""
        if test not in self._sound[plain]:
            only = test if "::" in test else ""
            answer = self._ask(plain, [test.split("::", maxsplit=1)[0]], only)
            self._sound[plain][test] = answer["status"] == 0 and not answer["ended"]
        return self._sound[plain][test]

    def _fails_alone(self, mutant: Mutant, source: str, test: str, plain: bool) -> bool:
        """Return whether a test that fails after other tests fails without these, too."""
        with self._plant(mutant, source):
            answer = self._ask(plain, [test.split("::", maxsplit=1)[0]], test if "::" in test else "")
        return answer["status"] not in (0, 5)

    @contextmanager
    def _plant(self, mutant: Mutant, source: str) -> Iterator[None]:
        """Plant a mutant for the ``with`` block, with a time that the file never had."""
        path = self.place / mutant.file
        before = path.stat()
        self._planted += 1
        path.write_text(mutant.planted(source))
        os.utime(path, (before.st_atime, self._begun + 2 * self._planted))
        try:
            yield
        finally:
            path.write_text(source)
            os.utime(path, (before.st_atime, before.st_mtime))

    def _ask(
        self, plain: bool, files: Sequence[str], only: str = "", words: Sequence[str] = ()
    ) -> dict[str, Any]:
        """Return the answer of a process that runs tests."""
        if plain not in self._workers:
            self._workers[plain] = subprocess.Popen(
                [sys.executable, "-P", str(WORKERS)],
                cwd=self.place,
                env={
                    **os.environ,
                    "PYTHONPATH": str(self.place),
                    "HYPOTHESIS_PROFILE": "first",
                    **({"NUMBA_DISABLE_JIT": "1"} if plain else {}),
                },
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        worker = self._workers[plain]
        assert worker.stdin and worker.stdout
        request = {
            "files": files,
            "out": [test for test, is_sound in self._sound[plain].items() if not is_sound],
            "only": only,
            "words": words,
            "known": {test: s for test, s in self._seconds.items() if test.split("::")[0] in files},
            "of_file": OF_FILE * self._budget,
            "budget": self._budget,
            "limit": LIMIT * self._budget,
            "waiting": WAITING * LIMIT * self._budget,
        }
        print(json.dumps(request), file=worker.stdin, flush=True)
        answer = json.loads(worker.stdout.readline())
        for test, seconds in answer["seconds"].items():
            self._seconds[test] = max(seconds, self._seconds.get(test, 0.0))
        return answer

    def close(self) -> None:
        """End the processes."""
        for worker in self._workers.values():
            worker.kill()
            worker.communicate()


def is_plain(file: str, source: str) -> bool:
    """Return whether the tests of a file run without compilation: of mbref, and where it has kernels."""
    has_kernels = file.startswith("mbref/") or re.search(r"^(from|import) numba\b", source, re.MULTILINE)
    return bool(has_kernels) and file not in COMPILING


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
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if name.startswith(only) and not _is_absent(name):
                yield name


@functools.cache
def installed(engine: str) -> bool:
    """Return whether an engine is installed."""
    return crosscheck_engine.installed(engine)


def _is_absent(file: str) -> bool:
    """Return whether a file belongs to the adapter of an engine that is not installed."""
    folder = file.removeprefix(ADAPTERS).partition("/")[0]
    return file.startswith(ADAPTERS) and folder in engines() and not installed(folder)


def key(mutant: Mutant, tests: Sequence[str], root: Path) -> str:
    """Return a digest of the mutant, its file and its tests."""
    texts = [*map(str, mutant), *((root / name).read_text() for name in (mutant.file, *tests))]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def known(path: Path = KEPT) -> dict[str, str]:
    """Return the results of runs before, by key."""
    return {record["key"]: record["result"] for record in _records(path) if "result" in record}


def _records(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def run(
    chosen: Sequence[Mutant], seconds: float, alone: Sequence[str] = (), budget: float = BUDGET
) -> dict[Mutant, str]:
    """Return the result of each mutant; none is begun after that time.

    Test files that run ``alone`` replace those that import the mutant's file.
    """
    found, before, end = {}, known(), time.monotonic() + seconds
    with closing(Tree(TREE, budget=budget)) as tree:
        for k, mutant in enumerate(chosen, 1):
            tests = alone or importers(mutant.file)
            name, by = key(mutant, tests, tree.place), ""
            if why := reason(mutant, (tree.place / mutant.file).read_text()):
                before[name] = EQUIVALENT
            elif name not in before:
                if time.monotonic() > end:
                    break
                before[name], by = tree.result(mutant, tests, not alone)
                with KEPT.open("a") as file:
                    record = {"key": name, "result": before[name], "by": by, "mutant": _line(mutant)}
                    print(json.dumps(record), file=file)
            found[mutant] = before[name]
            print(f"{k:3} of {len(chosen)}: {found[mutant]:10} {_line(mutant)}  {why or by}", flush=True)
    return found


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
    parser.add_argument("--list", action="store_true", help="print the mutants and their tests, run nothing")
    parser.add_argument("--tests", nargs="+", default=(), metavar="FILE", help="run these test files alone")
    parser.add_argument(
        "--budget", type=float, default=BUDGET, metavar="S", help="CPU s for a mutant's tests"
    )
    options = parser.parse_args()
    chosen = drawn(options.seed, options.count, options.only)
    if options.list:
        for mutant in chosen:
            print(f"{_line(mutant)}   ({' '.join(importers(mutant.file)) or 'no test imports it'})")
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
