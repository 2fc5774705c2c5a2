"""Run tests in forks of one process that has imported the libraries, so that each run begins in 0.2 s.

The process reads requests from its input, one JSON object a line, and answers in one line each.  It imports
none of the project's packages: each fork imports them anew, with the mutant that stands in the tree.

A request has ``tests`` (by test file, in order, the ids of the tests that run, in order; none: all tests
of the file), ``out`` (ids of tests that are left out), ``of_file`` and ``budget`` (CPU s of a file and of all
files, after which no test begins; a test that takes longer than a file may is ended), ``limit`` (CPU s of the
fork) and ``waiting`` (s of wall time).  The answer has ``status`` (pytest's exit status; none: the time was
up), ``failed`` (the id of the test that failed first, or the file that could not be collected), ``alone``
(whether no test ran before it) and ``ended`` (the ids of tests that took too long).

A request with ``packages``, names of folders, records one test file: the answer has ``starting`` (CPU s until
its first test), ``seconds`` (CPU s of each test that passes or that ``of_test`` ends) and ``reached``: by
source file, the lines that these tests run, as pairs of a number whose bits are lines and the tests that run
just these, and the lines that run outside of tests, at imports and in fixtures.
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
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import coverage
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
OPTIONS = ("-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
AGAIN = 0.01  # CPU s until a test is ended that could not be
CRASHED = 3  # status of a fork that ended without an answer


class Session:
    """A pytest plugin that runs the wanted tests of a file and stops when the time is up."""

    def __init__(self, of_file: float, wanted: Sequence[str] | None, out: Collection[str]) -> None:
        self._of_file, self._wanted, self._out, self._end = of_file, wanted, out, 0.0
        self.failed, self.begun = "", 0
        self.ended: list[str] = []

    def pytest_collection_finish(self) -> None:
        """Begin the time of a file after its imports, which take seconds in a new process."""
        self._end = _cpu() + self._of_file

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep the wanted tests, in their order."""
        found = {item.nodeid: item for item in items if item.nodeid not in self._out}
        items[:] = [found[test] for test in self._wanted or found if test in found]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        """Limit the time of the fixtures, and count the test."""
        self.begun += 1
        with self._limited(item):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        """Limit the time of a test."""
        with self._limited(item):
            return (yield)

    @contextlib.contextmanager
    def _limited(self, item: pytest.Item) -> Iterator[None]:
        """End a test that takes longer than a file may."""

        def end(signum: int, frame: FrameType | None) -> None:
            self.ended.append(item.nodeid)
            raise pytest.skip.Exception("too long")

        with cpu_limit(self._of_file, end):
            yield

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


class Recording:
    """A pytest plugin that notes the time of each test, and counts its lines."""

    def __init__(self, lines: coverage.Coverage, of_test: float, of_file: float) -> None:
        self._lines, self._of_test, self._of_file, self._end = lines, of_test, of_file, 0.0
        self.starting = 0.0
        self.seconds: dict[str, float] = {}

    def pytest_collection_finish(self) -> None:
        """Note the time of the imports."""
        self.starting = _cpu()
        self._end = self.starting + self._of_file

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        """Count the lines of a test for it, and its time; one that takes too long is ended."""

        def end(signum: int, frame: FrameType | None) -> None:
            if _is_counting(frame):  # it may hold a lock
                signal.setitimer(signal.ITIMER_PROF, AGAIN)
            else:
                self.seconds[item.nodeid] = _cpu() - begun
                raise TimeoutError(item.nodeid)

        begun = _cpu()
        self._lines.switch_context(item.nodeid)
        try:
            with cpu_limit(self._of_test, end):
                result = yield
            self.seconds[item.nodeid] = _cpu() - begun
            return result
        finally:
            self._lines.switch_context("")

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """End where the time of the file is up."""
        if _cpu() > self._end:
            pytest.exit("long enough", returncode=5)


@contextlib.contextmanager
def cpu_limit(seconds: float, end: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Call ``end`` as a signal's handler after so many seconds of this process' CPU time."""
    signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _is_counting(frame: FrameType | None) -> bool:
    """Return whether a function of coverage runs."""
    folder = str(Path(coverage.__file__).parent)
    return frame is not None and (frame.f_code.co_filename.startswith(folder) or _is_counting(frame.f_back))


def _cpu() -> float:
    """Return the CPU seconds of this process and of the children that have ended."""
    return sum(os.times()[:4])


def work(request: dict[str, Any], answer: Path) -> None:
    """Carry out a request in this process and write the answer."""
    resource.setrlimit(resource.RLIMIT_CPU, (int(request["limit"]), int(request["limit"]) + 5))
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(null, stream)
    if "packages" in request:
        answer.write_text(json.dumps(recorded(request)))
    else:
        run(request, answer)


def run(request: dict[str, Any], answer: Path) -> None:
    """Run tests until one fails or the time is up."""
    ended: list[str] = []
    begun = 0

    def report(status: int, failed: str) -> None:
        found = {"status": status, "failed": failed, "ended": ended, "alone": begun <= 1}
        answer.write_text(json.dumps(found))

    report(0, "")
    for file, wanted in request["tests"].items():
        report(CRASHED, file)  # the answer if this process does not return from the file
        session = Session(request["of_file"], wanted, request["out"])
        status = int(pytest.main([*OPTIONS, "-x", file], plugins=[session]))
        ended += session.ended
        begun += session.begun
        has_passed = status in (0, 5)
        report(status, session.failed or ("" if has_passed else file))
        if not has_passed or _cpu() > request["budget"]:
            break


def recorded(request: dict[str, Any]) -> dict[str, Any]:
    """Return the times of the tests of one file, and which lines of the packages they run."""
    place = Path.cwd()
    [file] = request["tests"]
    lines = coverage.Coverage(
        data_file=None,
        config_file=False,
        source=[str(place / name) for name in request["packages"]],
        messages=False,
    )
    session = Recording(lines, request["of_test"], request["of_file"])
    lines.start()
    pytest.main([*OPTIONS, file], plugins=[session])
    lines.stop()
    data = lines.get_data()
    reached = {
        Path(path).relative_to(place).as_posix(): _by_lines(data.contexts_by_lineno(path), session.seconds)
        for path in data.measured_files()
        if data.lines(path)
    }
    return {"starting": session.starting, "seconds": session.seconds, "reached": reached}


def _by_lines(tests: Mapping[int, Sequence[str]], timed: Collection[str]) -> dict[str, Any]:
    """Return the lines that timed tests run and the lines that run outside of tests, from the tests of each
    line."""
    bits: dict[str, int] = {}
    for line, names in tests.items():
        for name in names:
            bits[name] = bits.get(name, 0) | 1 << line
    outside = bits.pop("", 0)
    alike: dict[int, list[str]] = {}
    for name in sorted(bits.keys() & set(timed)):
        alike.setdefault(bits[name], []).append(name)
    return {"outside": f"{outside:x}", "tests": [[f"{lines:x}", names] for lines, names in alike.items()]}


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
    return {"status": None if is_late else CRASHED, "failed": "", "ended": [], "alone": False}


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
