"""Hypothesis profiles: ``check`` is reproducible, ``deep`` searches, ``first`` ends at a failure. Processes
that run all tests begin with those that need hardly a kernel, and share the compilation of those that are not
compiled by then. Each computes with one thread: more would wait for each other. ``slow.toml`` lists cases
with the mark slow."""

import functools
import gc
import os
import sys
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import Phase, settings

os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

settings.register_profile("check", max_examples=10, deadline=None, derandomize=True, database=None)
settings.register_profile("deep", max_examples=100, deadline=None, print_blob=True)
settings.register_profile("first", settings.get_profile("check"), phases=(Phase.generate,))
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "check"))

HERE = Path(__file__).parent
SLOW = tomllib.loads((HERE / "slow.toml").read_text())  # file: test: patterns of the slow cases
OWN_FOLDERS = {".pytest_cache", ".hypothesis", "__pycache__", ".coverage"}  # of the tests' own tools
MANY = 2000  # tests, among which every kernel is needed
# of two processes, folders whose tests need hardly a kernel; without files that run mbref
FIRST = (("meta", "reports", "zoo"), ("doors/judge",))
RUNS_MBREF = ("test_impacts", "test_published.", "test_rounded", "test_small", "test_tables_of")


def pytest_collection(session: pytest.Session) -> None:
    """Let the second process that runs all tests import their files from the last one on: each process finds
    the half that the other one has compiled."""
    config = session.config
    if os.environ.get("PYTEST_XDIST_WORKER") != "gw1" or config.args != config.getini("testpaths"):
        return
    for path in sorted(HERE.rglob("test_*.py"), reverse=True):
        with suppress(pytest.skip.Exception):
            import_module(".".join(path.relative_to(HERE.parent).with_suffix("").parts))


def patterns(item: pytest.Item) -> list[str]:
    """Return the patterns of slow cases of an item's test."""
    file = SLOW.get(item.path.relative_to(HERE).as_posix(), {})
    return file.get(getattr(item, "originalname", item.name), [])


def case(item: pytest.Item) -> str:
    """Return the name of an item's parameters, empty without parameters."""
    return item.name.partition("[")[2].removesuffix("]")


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark the cases that slow.toml lists. A pattern that begins with "!" names cases that stay unmarked."""
    listed = [pattern for pattern in patterns(item) if fnmatchcase(case(item), pattern.removeprefix("!"))]
    if listed and not any(pattern.startswith("!") for pattern in listed):
        item.add_marker(pytest.mark.slow)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Raise UsageError if slow.toml lists a case that a collected test does not have."""
    if any("::" in argument for argument in config.args):
        return
    found: dict[tuple[str, str], set[str]] = {}
    for item in items:
        test = item.path.relative_to(HERE).as_posix(), getattr(item, "originalname", item.name)
        found.setdefault(test, set()).add(case(item))
    wrong = [
        f"{file}::{name}[{pattern}]"
        for (file, name), cases in found.items()
        for pattern in SLOW.get(file, {}).get(name, [])
        if not any(fnmatchcase(each, pattern.removeprefix("!")) for each in cases)
        and not names_missing_engine(pattern)
    ]
    if wrong:
        fault = f"tests/slow.toml lists cases that do not exist: {', '.join(wrong)}"
        print(fault, file=sys.stderr)  # pytest-xdist hides the error of a worker
        raise pytest.UsageError(fault)


def names_missing_engine(pattern: str) -> bool:
    """Return whether a pattern of cases names an engine that is not installed."""
    from crosscheck.engine import BUILT_IN, ON_REQUEST, OPTIONAL, installed

    return any(name in pattern and not installed(name) for name in BUILT_IN + OPTIONAL + ON_REQUEST)


def group(item: pytest.Item) -> int:
    """Return the index of the group of FIRST with an item's folder; 2 if there is none, or if the file runs
    mbref."""
    folder, runs = item.path.parent.relative_to(HERE).as_posix(), item.path.name.startswith(RUNS_MBREF)
    return next((k for k, folders in enumerate(FIRST) if folder in folders and not runs), 2)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_finish(session: pytest.Session) -> None:
    """Let each of two processes begin with a group of FIRST: one begins with the first test, the other one
    with the test in the middle. What has been imported is not searched for garbage again."""
    gc.freeze()
    if "PYTEST_XDIST_WORKER" in os.environ:
        items = session.items
        first, second, others = ([item for item in items if group(item) == k] for k in range(3))
        middle = max(0, len(items) // 2 - len(first))
        items[:] = [*first, *others[:middle], *second, *others[middle:]]


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Compile the kernels, or load them, before the first test outside of FIRST."""
    if "PYTEST_XDIST_WORKER" in os.environ and len(item.session.items) >= MANY and group(item) == len(FIRST):
        prepare_kernels()


@functools.cache
def prepare_kernels() -> None:
    """Compile or load the kernels that the tests need; two processes begin at both ends."""
    from tests.kernels import prepare

    prepare(backwards=os.environ["PYTEST_XDIST_WORKER"] != "gw0")


@pytest.fixture(autouse=True)
def nothing_is_written_into_the_working_folder() -> Iterator[None]:
    """Fail a test after which the working folder has files that it did not have before."""
    folder = Path.cwd()
    before = set(os.listdir(folder))
    yield
    if Path.cwd() == folder and (new := set(os.listdir(folder)) - before - OWN_FOLDERS):
        pytest.fail(f"the working folder has new files: {', '.join(sorted(new))}")
