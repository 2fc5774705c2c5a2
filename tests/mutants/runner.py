"""Run tests in forks of a process that has imported the libraries, in a copy of the sources. A fork begins in
a fraction of a second. It imports the project's packages anew, with the mutant that stands in the copy, as
plain Python (``NUMBA_DISABLE_JIT=1``)."""

import compileall
import contextlib
import functools
import hashlib
import itertools
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import coverage
import pytest

from tests.mutants.drawing import PACKAGES
from tests.mutants.operators import Mutant, places

COPIED = (*PACKAGES, "tests", "examples", "benchmarks", "docs", "pyproject.toml", "README.md")
OPTIONS = ("-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
KILLED, SURVIVED, UNREACHED, OUT_OF_TIME = "killed", "survived", "not run by any test", "out of time"
LONGEST = 10.0  # CPU s of a test without mutants, beyond which it is left out
WAITING = 10.0  # wall time / CPU time, after which a test waits for something that does not come
SPARE, HANGS = 20.0, 10.0  # CPU s, and CPU time / usual time, beyond both of which a mutant loops for ever
ENDS = (pytest.ExitCode.OK, pytest.ExitCode.INTERRUPTED, pytest.ExitCode.NO_TESTS_COLLECTED)
BATCHES = (10, 40, 160, 640)  # first tests of a mutant, whose files pytest collects together


class Recorded(NamedTuple):
    """A test without mutants: CPU s, whether it passes, and the lines that it runs (bits) of each source."""

    name: str
    seconds: float
    passes: bool
    lines: dict[str, str]

    def cost(self) -> float:
        """Return CPU s × lines: a test that runs few lines asks more of each of them."""
        return self.seconds * sum(int(bits, 16).bit_count() for bits in self.lines.values())

    def runs(self, wanted: dict[str, int]) -> bool:
        """Return whether the test runs one of the wanted lines (bits) of the sources."""
        return any(int(self.lines.get(file, "0"), 16) & bits for file, bits in wanted.items())


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
        self._tests: list[Recorded] = []
        self._planted = 0

    def record(self, file: str) -> None:
        """Record the lines that each test of a file runs; a recording is kept until the file changes."""
        self.kept.mkdir(parents=True, exist_ok=True)
        path = self.kept / f"{digest(file + (self.place / file).read_text())}.jsonl"
        found, part = read(path), path.with_suffix(".part")
        while not path.exists():
            left = [test.name for test in read(part)]
            work = functools.partial(_record, file, left, part)
            _, answer = _forked(self.place, work, 20 * self.limit)
            if answer or len(read(part)) == len(left):  # at the end, or no test was begun
                part.touch()
                part.rename(path)
            found = read(path)
        for test in found:
            if not test.passes:
                print(f"left out, since it fails or takes {LONGEST:g} CPU s: {test.name}", flush=True)
        self._tests += [test for test in found if test.passes]

    def tests(self, mutant: Mutant) -> list[Recorded]:
        """Return the tests that run the line of a mutant, the cheapest and closest first. Other tests of
        their files come last: only the first test of a file may run a line."""
        wanted = places(self.place, PACKAGES, mutant)
        ordered = sorted(self._tests, key=Recorded.cost)
        first = [test for test in ordered if test.runs(wanted)]
        files, names = {_file(test.name) for test in first}, {test.name for test in first}
        return first + [test for test in ordered if _file(test.name) in files and test.name not in names]

    def result(self, mutant: Mutant) -> tuple[str, str]:
        """Return KILLED, SURVIVED, UNREACHED or OUT_OF_TIME, and the test that sees the mutant."""
        tests = self.tests(mutant)
        if not tests:
            return UNREACHED, ""
        with self._plant(mutant):
            used, answer = _forked(self.place, lambda out: _run(tests, self.limit, out), self.limit)
        if answer is None:
            return (KILLED, "an endless loop") if used < self.limit - 1 else (OUT_OF_TIME, "")
        failed = answer.get("failed", ["the process ended"])
        return (KILLED, failed[0]) if failed else (answer["result"], "")

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


def read(path: Path) -> list[Recorded]:
    """Return the recorded tests of a file with a line for each, none where there is no file."""
    lines = path.read_text().splitlines() if path.exists() else []
    return list({test.name: test for test in (Recorded(*json.loads(line)) for line in lines)}.values())


def _file(test: str) -> str:
    return test.partition("::")[0]


def _forked(place: Path, work: Callable[[Path], None], limit: float) -> tuple[float, dict[str, Any] | None]:
    """Return the CPU s of a fork in a copy of the sources, and the answer that it writes: nothing where it
    crashes, None where it exceeds its CPU s, or waits too long, which counts as all its CPU s."""
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
        status, seconds = _wait(child, end)
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
            return max(seconds, limit * (os.WTERMSIG(status) == signal.SIGKILL)), None
        return seconds, json.loads(out.read_text()) if out.exists() else {}


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


def _wait(child: int, end: float) -> tuple[int, float]:
    """Return status and CPU s of a fork; it is killed at the end, its children in any case."""
    ended = 0
    while not ended:
        ended, status, used = os.wait4(child, os.WNOHANG)
        if not ended and time.monotonic() > end:
            os.killpg(child, signal.SIGKILL)
            ended, status, used = os.wait4(child, 0)
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return status, used.ru_utime + used.ru_stime


def _seconds() -> float:
    """Return the CPU s of this process and its children that have ended."""
    return sum(os.times()[:4])


def _limit(seconds: float) -> None:
    """Let this process end after some CPU s from now, and not later than it would."""
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (min(int(time.process_time() + seconds) + 1, hard - 2), hard))


class _Failures:
    """A pytest plugin that notes the tests that fail, or the files that cannot be collected; it runs the
    given tests alone, in their order, and stops at the CPU time ``end`` (s)."""

    def __init__(self, tests: list[Recorded], end: float) -> None:
        self.names: list[str] = []
        self.usual, self.end = {test.name: test.seconds for test in tests}, end

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Choose and order the tests; some names of cases cannot be arguments of pytest."""
        places = {name: k for k, name in enumerate(self.usual)}
        items[:] = sorted((i for i in items if i.nodeid in places), key=lambda i: places[i.nodeid])

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Limit the CPU s of a test; none follows when the time has come."""
        _limit(SPARE + HANGS * self.usual[item.nodeid])
        done = yield
        _limit(self.end)  # of all tests: collecting the next ones is no endless loop
        if _seconds() > self.end:
            item.session.shouldstop = "out of time"
        return done

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a test."""
        self.names += [report.nodeid] if report.failed else []

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file."""
        self.names += [report.nodeid] if report.failed else []


def _run(tests: list[Recorded], limit: float, out: Path) -> None:
    """Write the first failure of tests, which pytest collects in batches."""
    sys.dont_write_bytecode = True
    failed: list[str] = []
    ends = [0, *(end for end in BATCHES if end < len(tests)), len(tests)]
    for batch in (tests[first:last] for first, last in itertools.pairwise(ends)):
        plugin, files = _Failures(batch, limit), dict.fromkeys(_file(test.name) for test in batch)
        status = pytest.main([*OPTIONS, "-x", *files], plugins=[plugin])
        failed = plugin.names or ([] if status in ENDS else [*files][:1])
        if failed or _seconds() > limit:
            break
    result = OUT_OF_TIME if _seconds() > limit else SURVIVED
    out.write_text(json.dumps({"failed": failed, "result": result}))


class _Recorder:
    """A pytest plugin that writes a line for each test."""

    def __init__(self, place: Path, part: Path) -> None:
        folders = [str(place / name) for name in PACKAGES]
        self.place, self.part, self.passes = place, part, True
        self.lines = coverage.Coverage(data_file=None, config_file=False, source=folders, messages=False)
        self.lines.set_option("run:disable_warnings", ["no-data-collected", "module-not-imported"])

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Write a test that fails before it begins, and again when it has ended."""
        self._write(item.nodeid, 0.0, False, {})
        _limit(LONGEST)
        self.lines.erase()
        self.passes, before = True, _seconds()
        self.lines.start()
        done = yield
        self.lines.stop()
        data, found = self.lines.get_data(), {}
        for path in map(Path, data.measured_files()):
            bits = sum(1 << line for line in data.lines(str(path)) or ())
            found[path.relative_to(self.place).as_posix()] = f"{bits:x}"
        self._write(item.nodeid, round(_seconds() - before, 4), self.passes, found)
        return done

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note whether a test passes."""
        self.passes &= not report.failed

    def _write(self, *recorded: Any) -> None:
        with self.part.open("a") as file:
            file.write(json.dumps(recorded) + "\n")


def _record(file: str, left: list[str], part: Path, out: Path) -> None:
    """Write the lines of the tests of a file, except some."""
    deselected = (f"--deselect={test}" for test in left)
    pytest.main([*OPTIONS, file, *deselected], plugins=[_Recorder(Path.cwd(), part)])
    out.write_text(json.dumps({"ended": True}))
