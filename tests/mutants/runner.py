"""Run tests in forks of a process that has imported the libraries, in a copy of the sources.

A fork begins in a fraction of a second. It imports the project's packages anew, with the mutant that stands
in the copy, as plain Python (``NUMBA_DISABLE_JIT=1``).
"""

from __future__ import annotations

import compileall
import contextlib
import hashlib
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import coverage
import pytest

from tests.mutants.drawing import PACKAGES
from tests.mutants.operators import Mutant, statement

COPIED = (*PACKAGES, "tests", "examples", "benchmarks", "docs", "pyproject.toml", "README.md")
OPTIONS = ("-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
KILLED, SURVIVED, UNREACHED, OUT_OF_TIME = "killed", "survived", "not run by any test", "out of time"
WAITING = 20.0  # wall time / CPU time, after which a test waits for something that does not come
HANGS = 3.0  # CPU time / that without the mutant, beyond which a mutant has caused an endless loop
NO_TESTS = pytest.ExitCode.NO_TESTS_COLLECTED


class Recorded(NamedTuple):
    """A test file without mutants: CPU s, tests that fail, and digests of sources with the lines that run."""

    seconds: float
    failed: list[str]
    lines: dict[str, tuple[str, list[int]]]


class Copy:
    """A copy of the sources, in which mutants are planted; ``kept`` is a folder for the recordings."""

    def __init__(self, root: Path, place: Path, kept: Path, limit: float) -> None:
        self.place, self.kept, self.limit = place, kept, limit
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        for name in (name for name in COPIED if (root / name).exists()):
            copy = shutil.copytree if (root / name).is_dir() else shutil.copy2
            copy(root / name, place / name)
        for package in PACKAGES:
            compileall.compile_dir(place / package, quiet=2)
        self._reached: dict[str, Recorded] = {}
        self._planted = 0

    def record(self, files: Iterable[str]) -> None:
        """Record the lines that each test file runs; a recording is kept until the file changes."""
        self.kept.mkdir(parents=True, exist_ok=True)
        for file in files:
            path = self.kept / f"{digest(file + (self.place / file).read_text())}.json"
            if not path.exists():
                answer = _forked(self.place, lambda out, file=file: _record(file, out), 20 * self.limit)
                path.write_text(json.dumps(answer or {"seconds": 0.0, "failed": [file], "lines": {}}))
            self._reached[file] = found = Recorded(**json.loads(path.read_text()))
            for test in found.failed:
                print(f"left out, since it fails without a mutant: {test}", flush=True)

    def tests(self, mutant: Mutant) -> list[str]:
        """Return the sound test files that run the line of a mutant, the quickest first."""
        source, found = (self.place / mutant.file).read_text(), []
        now, wanted = digest(source), {*statement(source, mutant.line)}
        for file, recorded in self._reached.items():
            then, lines = recorded.lines.get(mutant.file, ("", []))
            if file not in recorded.failed and then and (then != now or wanted & {*lines}):
                found.append(file)
        return sorted(found, key=lambda file: self._reached[file].seconds)

    def result(self, mutant: Mutant) -> tuple[str, str]:
        """Return KILLED, SURVIVED, UNREACHED or OUT_OF_TIME, and the test that sees the mutant."""
        files = self.tests(mutant)
        if not files:
            return UNREACHED, ""
        out_of_it = [test for file in files for test in self._reached[file].failed]
        with self._plant(mutant):
            answer = _forked(self.place, lambda out: _run(files, out_of_it, out), self.limit)
        if answer is None:
            usual = sum(self._reached[file].seconds for file in files)
            return (KILLED, "an endless loop") if HANGS * usual < self.limit else (OUT_OF_TIME, "")
        failed = answer.get("failed", ["the process ended"])
        return (KILLED, failed[0]) if failed else (SURVIVED, "")

    @contextlib.contextmanager
    def _plant(self, mutant: Mutant) -> Iterator[None]:
        """Plant a mutant for the ``with`` block, with a time that the file never had."""
        path = self.place / mutant.file
        source, before = path.read_text(), path.stat()
        self._planted += 1
        path.write_text(mutant.planted(source))
        os.utime(path, (before.st_atime, before.st_mtime + 2 * self._planted))
        try:
            yield
        finally:
            path.write_text(source)
            os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def digest(text: str) -> str:
    """Return a digest of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _forked(place: Path, work: Callable[[Path], None], limit: float) -> dict[str, Any] | None:
    """Return the answer that a fork writes in a copy of the sources; nothing where it crashes, None where it
    exceeds its CPU s."""
    with tempfile.TemporaryDirectory() as folder:
        out, end = Path(folder) / "answer", time.monotonic() + WAITING * limit
        sys.stdout.flush()
        child = os.fork()
        if not child:
            os.setpgid(0, 0)
            try:
                _enter(place, Path(folder), limit)
                work(out)
            finally:
                os._exit(0)
        status = _wait(child, end)
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
            return None
        return json.loads(out.read_text()) if out.exists() else {}


def _enter(place: Path, folder: Path, limit: float) -> None:
    """Let this process run the copy: its modules, its folder, caches of its own, no output, a limit."""
    resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 2))
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(null, stream)
    for name in [name for name in sys.modules if name.partition(".")[0] in (*PACKAGES, "tests")]:
        del sys.modules[name]
    os.chdir(place)
    sys.path[:] = [str(place), *(path for path in sys.path if path not in ("", str(place)))]
    os.environ |= {"PYTHONPATH": str(place), "XDG_CACHE_HOME": str(folder), "HYPOTHESIS_PROFILE": "first"}


def _wait(child: int, end: float) -> int:
    """Return the status with which a fork ends; it is killed at the end, and its children in any case."""
    ended, status = 0, 0
    while not ended:
        ended, status = os.waitpid(child, os.WNOHANG)
        if not ended and time.monotonic() > end:
            os.killpg(child, signal.SIGKILL)
            ended, status = os.waitpid(child, 0)
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return status


class _Failures:
    """A pytest plugin that notes the tests that fail, or the files that cannot be collected."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a test."""
        self.names += [report.nodeid] if report.failed else []

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file."""
        self.names += [report.nodeid] if report.failed else []


def _pytest(files: list[str], *arguments: str) -> list[str]:
    """Run pytest, and return the tests that fail, or the first file where pytest itself does."""
    failures = _Failures()
    status = pytest.main([*OPTIONS, *files, *arguments], plugins=[failures])
    return failures.names or ([] if status in (pytest.ExitCode.OK, NO_TESTS) else files[:1])


def _run(files: list[str], without: list[str], out: Path) -> None:
    """Write the first failure of test files without some tests."""
    sys.dont_write_bytecode = True
    out.write_text(json.dumps({"failed": _pytest(files, "-x", *(f"--deselect={test}" for test in without))}))


def _record(file: str, out: Path) -> None:
    """Write the CPU s, the failures and the lines of the packages of a test file."""
    place, before = Path.cwd(), time.process_time()
    lines = coverage.Coverage(
        data_file=None, config_file=False, source=[str(place / name) for name in PACKAGES], messages=False
    )
    lines.start()
    failed = _pytest([file])
    lines.stop()
    data, found = lines.get_data(), {}
    for path in map(Path, data.measured_files()):
        if run := data.lines(str(path)):
            found[path.relative_to(place).as_posix()] = digest(path.read_text()), sorted(run)
    out.write_text(json.dumps({"seconds": time.process_time() - before, "failed": failed, "lines": found}))
