"""Run tests in forks of one process that has imported the libraries, so that each run begins in 0.2 s.

The process reads requests from its input, one JSON object a line, and answers in one line each.  It imports
none of the project's packages: each fork imports them anew, with the mutant that stands in the tree.

A request has ``files`` (test files in order), ``out`` (ids of tests that are left out), ``only`` (the id
of the one test that runs; empty: all), ``words`` and ``known`` (CPU s of tests: of a file those run first
whose ids have one of the words, then the quickest),
``of_file`` and ``budget`` (CPU s of a file and of all files, after which no test begins; a test that takes
longer than a file may is ended), ``limit`` (CPU s of the fork) and ``waiting`` (s of wall time).  The answer
has ``status`` (pytest's exit status; none: the time was up), ``failed`` (the id of the test that failed
first, or the file that could not be collected), ``ended`` (the ids of tests that took too long) and
``seconds`` (CPU s by file and by test).
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import numba
import pydantic
import pytest
import rich.progress
import scipy.integrate
import scipy.interpolate
import scipy.optimize
import scipy.sparse.linalg

LIBRARIES = (hypothesis, numba, pydantic, rich, scipy)
OPTIONAL = ("jinja2", "matplotlib.figure", "matplotlib.backends.backend_svg", "mujoco", "pinocchio")
OPTIONS = ("-q", "-x", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
CRASHED = 3  # status of a fork that ended without an answer


class Session:
    """A pytest plugin that leaves out tests and stops when the time is up."""

    def __init__(self, request: dict[str, Any]) -> None:
        self._out, self._only, self._of_file = set(request["out"]), request["only"], request["of_file"]
        self._words: list[str] = request["words"]
        self._known: dict[str, float] = request["known"]
        self._end = 0.0  # CPU s
        self.failed = ""
        self.ended: list[str] = []
        self.seconds: dict[str, float] = {}

    def pytest_collection_finish(self) -> None:
        """Begin the time of a file after its imports, which take seconds in a new process."""
        self._end = _cpu() + self._of_file

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave out tests, and let those with the words and the quickest begin."""
        kept = [item for item in items if item.nodeid not in self._out and self._only in ("", item.nodeid)]
        items[:] = sorted(kept, key=lambda item: self._rank(item.nodeid))

    def _rank(self, test: str) -> tuple[bool, float]:
        name = test.partition("::")[2]
        return not any(word in name for word in self._words), self._known.get(test, 0.0)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        """Limit the time of the fixtures."""
        with self._limited(item):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        """Limit the time of a test."""
        with self._limited(item):
            return (yield)

    @contextlib.contextmanager
    def _limited(self, item: pytest.Item) -> Iterator[None]:
        """End a test that takes longer than a file may, and note its time."""

        def end(signum: int, frame: object) -> None:
            self.ended.append(item.nodeid)
            raise pytest.skip.Exception("too long")

        signal.signal(signal.SIGPROF, end)
        begun = _cpu()
        signal.setitimer(signal.ITIMER_PROF, self._of_file)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            self.seconds[item.nodeid] = self.seconds.get(item.nodeid, 0.0) + _cpu() - begun

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """End where the time of the file is up."""
        if _cpu() > self._end:
            pytest.exit("long enough", returncode=5)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the first test that fails."""
        self.failed = self.failed or (report.nodeid if report.failed else "")

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note the first file that cannot be collected."""
        self.failed = self.failed or (report.nodeid if report.failed else "")


def _cpu() -> float:
    """Return the CPU seconds of this process and of the children that have ended."""
    return sum(os.times()[:4])


def work(request: dict[str, Any], answer: Path) -> None:
    """Run the tests of a request in this process and write the answer."""
    resource.setrlimit(resource.RLIMIT_CPU, (int(request["limit"]), int(request["limit"]) + 5))
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(null, stream)
    session = Session(request)

    def report(status: int, failed: str) -> None:
        found = {"status": status, "failed": failed, "ended": session.ended, "seconds": session.seconds}
        answer.write_text(json.dumps(found))

    report(0, "")
    for file in request["files"]:
        report(CRASHED, file)  # the answer if this process does not return from the file
        begun = _cpu()
        status = int(pytest.main([*OPTIONS, file], plugins=[session]))
        session.seconds[file] = _cpu() - begun
        has_passed = status in (0, 5)
        report(status, session.failed or ("" if has_passed else file))
        if not has_passed or _cpu() > request["budget"]:
            break


def answer_of(request: dict[str, Any]) -> dict[str, Any]:
    """Fork, wait for the end or the limit, and return the answer."""
    with tempfile.TemporaryDirectory() as place:
        path, end = Path(place) / "answer", time.monotonic() + request["waiting"]
        sys.stdout.flush()
        child = os.fork()
        if not child:
            os.setpgid(0, 0)
            try:
                work(request, path)
            finally:
                os._exit(0)
        status = _wait(child, end)
        is_late = os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
        if path.exists() and not is_late:
            return json.loads(path.read_text())
    return {"status": None if is_late else CRASHED, "failed": "", "ended": [], "seconds": {}}


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


def main() -> None:
    """Answer requests until the input ends."""
    for name in OPTIONAL:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    sys.path.insert(0, os.getcwd())
    for line in sys.stdin:
        print(json.dumps(answer_of(json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
