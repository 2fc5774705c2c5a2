"""A copy of the sources, in which mutants are planted; processes of its own run the tests."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mbref.kernels.compilation import WITH_KERNELS
from tests.mutants.operators import Mutant
from tests.mutants.reach import SNAPSHOTS, Reach

ROOT = Path(__file__).parents[2]
PACKAGES = ("mbref", "crosscheck", "reports")
COPIED = (*PACKAGES, "tests", "examples", "benchmarks", "docs", "pyproject.toml", "README.md")
WORKERS = Path(__file__).with_name("workers.py")
KILLED, SURVIVED, TIMED_OUT = "killed", "survived", "timed out"
BY_TEXT, EQUIVALENT, UNTESTED = "killed by a stored text alone", "equivalent", "untested"
# packages whose numbers stand in stored texts
RENDERED = "reports/", "crosscheck/study/", "crosscheck/judge/"
BUDGET = 20.0  # CPU s of all files of a mutant, after which no test begins
# parts of the budget after which no test of a file begins, and after which a test is ended
OF_FILE, LIMIT = 1 / 4, 3 / 2
WAITING = 50.0  # wall time / CPU time, after which tests wait for something that does not come
OF_TEST, OF_RECORDED = 3.0, 20.0  # CPU s of a test and of the tests of a file that are recorded
KERNELS = tuple(f"mbref/{folder}/" for folder in WITH_KERNELS)
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
        self._reach: dict[bool, Reach] = {}
        self._kills: Counter[tuple[str, str]] = Counter()  # by folder of the mutant and test file
        self._sound: dict[bool, dict[str, bool]] = {True: {}, False: {}}
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        for name in (name for name in copied if (root / name).exists()):
            copy = shutil.copytree if (root / name).is_dir() else shutil.copy2
            copy(root / name, place / name)

    def record(self, plain: bool, kept: Path, processes: int, tell: Callable[[int, int], object]) -> None:
        """Record which tests run which lines, of the test files whose recording in ``kept`` does not hold.

        ``tell`` gets the number of test files that are done and their number in all.
        """
        self._reach[plain] = reach = Reach(kept, self.place)
        missing = reach.missing()
        if missing and not plain and (self.place / "tests/kernels.py").exists():
            self._compile()
        workers = [self._worker(plain) for _ in range(min(processes, len(missing)))]
        idle = [*workers]
        request = {"packages": PACKAGES, "of_test": OF_TEST, "of_file": OF_RECORDED}

        def answer(file: str) -> dict[str, Any]:
            worker = idle.pop()
            try:
                limits = {"limit": 3 * OF_RECORDED, "waiting": 10 * OF_RECORDED}
                return ask(worker, {"tests": {file: None}, **request, **limits})
            finally:
                idle.append(worker)

        with ThreadPoolExecutor(max(1, len(workers))) as pool:
            futures = {pool.submit(answer, file): file for file in missing}
            for k, future in enumerate(as_completed(futures), 1):
                reach.add(futures[future], future.result())
                tell(k, len(missing))
        for worker in workers:
            end(worker)

    def tests(self, mutant: Mutant) -> dict[str, list[str]]:
        """Return the tests that run the line of a mutant, by file, in the order in which they run."""
        source = (self.place / mutant.file).read_text()
        folder = str(Path(mutant.file).parent)
        kills = {file: count for (where, file), count in self._kills.items() if where == folder}
        return self._reach[is_plain(mutant.file, source)].ordered(mutant, source, kills)

    def result(
        self, mutant: Mutant, tests: Mapping[str, Sequence[str] | None], with_texts: bool = True
    ) -> tuple[str, str]:
        """Return whether tests see a mutant, KILLED, BY_TEXT, SURVIVED or TIMED_OUT, and the first test that
        does.

        A test that fails without the mutant, too, is left out.  Where no test fails, stored texts are tested
        if ``with_texts`` is true.  The tree is left as it was.
        """
        if not tests:
            return UNTESTED, ""
        source = (self.place / mutant.file).read_text()
        plain = is_plain(mutant.file, source)
        result, test = self._seen(mutant, source, tests, plain)
        if result == KILLED:
            self._kills[str(Path(mutant.file).parent), test.partition("::")[0]] += 1
        if with_texts and result == SURVIVED and mutant.file.startswith(RENDERED):
            result, test = self._seen(mutant, source, dict.fromkeys(SNAPSHOTS), plain)
            result = BY_TEXT if result == KILLED else SURVIVED  # a text that takes too long sees nothing
        return result, test

    def _seen(
        self, mutant: Mutant, source: str, tests: Mapping[str, Sequence[str] | None], plain: bool
    ) -> tuple[str, str]:
        """Return KILLED, SURVIVED or TIMED_OUT, and the test that fails or takes too long."""
        while True:
            with self._plant(mutant, source):
                answer = self._ask(plain, tests)
            test = answer["failed"]
            if answer["status"] in (0, 5):
                late = [test for test in answer["ended"] if self._is_sound(test, plain)]
                return (TIMED_OUT, late[0]) if late else (SURVIVED, "")
            if answer["status"] is None:
                return TIMED_OUT, ""
            if not test and self._ask(plain, tests)["status"] not in (0, 5):
                raise RuntimeError(f"the tests end early without a mutant, too: {' '.join(tests)}")
            if not test or self._is_sound(test, plain):
                if not test or answer["alone"] or self._fails_alone(mutant, source, test, plain):
                    return KILLED, test
                self._sound[plain][test] = False  # it fails after other tests alone
            tests = {file: wanted for file, wanted in tests.items() if file != test}

    def _is_sound(self, test: str, plain: bool) -> bool:
        """Return whether a test passes without a mutant, in the time of a file; others are left out."""
        if test not in self._sound[plain]:
            answer = self._ask(plain, alone(test))
            self._sound[plain][test] = answer["status"] == 0 and not answer["ended"]
        return self._sound[plain][test]

    def _fails_alone(self, mutant: Mutant, source: str, test: str, plain: bool) -> bool:
        """Return whether a test that fails after other tests fails without these, too."""
        with self._plant(mutant, source):
            return self._ask(plain, alone(test))["status"] not in (0, 5)

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

    def _ask(self, plain: bool, tests: Mapping[str, Sequence[str] | None]) -> dict[str, Any]:
        """Return the answer of a process that runs tests."""
        if plain not in self._workers:
            self._workers[plain] = self._worker(plain)
        out = {test for test, is_sound in self._sound[plain].items() if not is_sound}
        request = {
            "tests": {file: wanted for file, wanted in tests.items() if file not in out},
            "out": sorted(out),
            "of_file": OF_FILE * self._budget,
            "budget": self._budget,
            "limit": LIMIT * self._budget,
            "waiting": WAITING * LIMIT * self._budget,
        }
        return ask(self._workers[plain], request)

    def _compile(self) -> None:
        """Compile the kernels that the tests need, which takes longer than a test file may."""
        command = [sys.executable, "-P", "-m", "tests.kernels"]
        subprocess.run(command, cwd=self.place, env=self._environment(False), check=True)

    def _worker(self, plain: bool) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-P", str(WORKERS)],
            cwd=self.place,
            env=self._environment(plain),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def _environment(self, plain: bool) -> dict[str, str]:
        own = {"PYTHONPATH": str(self.place), "HYPOTHESIS_PROFILE": "first"}
        return {**os.environ, **own, **({"NUMBA_DISABLE_JIT": "1"} if plain else {})}

    def close(self) -> None:
        """End the processes."""
        for worker in self._workers.values():
            end(worker)


def alone(test: str) -> dict[str, list[str] | None]:
    """Return a test, or all tests of a file, as tests by file."""
    file = test.split("::", maxsplit=1)[0]
    return {file: [test] if "::" in test else None}


def ask(worker: subprocess.Popen[str], request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answer of a process to a request."""
    assert worker.stdin and worker.stdout
    print(json.dumps(request), file=worker.stdin, flush=True)
    return json.loads(worker.stdout.readline())


def end(worker: subprocess.Popen[str]) -> None:
    """End a process."""
    worker.kill()
    worker.communicate()


def is_plain(file: str, source: str) -> bool:
    """Return whether the tests of a file run without compilation: where its change would compile kernels
    anew."""
    has_kernels = re.search(r"^(from|import) numba\b", source, re.MULTILINE)
    return bool(has_kernels or file.startswith(KERNELS)) and file not in COMPILING
