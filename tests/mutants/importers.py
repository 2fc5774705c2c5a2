"""The tests that import a source file, the nearest first; ``engine("name")`` and BUILT_IN import adapters."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import crosscheck.engine
from tests.meta.imports import ROOT, imported, module_name, sources

PACKAGES = ("mbref", "crosscheck", "reports")
ADAPTERS = "crosscheck/engines/"
LISTS = ("BUILT_IN", "OPTIONAL", "GENERATORS", "LARGE", "ON_REQUEST")
WHOLE = "tests/mbref/test_short_runs.py", "tests/mbref/interpreted_commands.py"  # they reach most of mbref
FEWEST = 12  # test files that are run, where so many reach the source
FARTHEST = 7  # imports between a test and the source
NAMES = "test_*.py", "interpreted_*.py"  # files of tests; some of them run with interpreted kernels alone
SNAPSHOTS = (  # they see that a text changed, not that it is wrong
    "tests/reports/test_reference_report.py",
    "tests/reports/test_committed_paper.py",
    "tests/test_transcripts.py",
)


def importers(file: str) -> list[str]:
    """Return the test files that import a source file, directly or through other sources, until there are
    FEWEST of them, and WHOLE; tests that only compare a stored text are left out."""
    wanted, seen = {_module(file)}, {_module(file)}
    found: list[str] = []
    for _ in range(FARTHEST):
        found += [test for test in _tests() if test not in found and _tests()[test] & wanted]
        if len(found) >= FEWEST:
            break
        wanted = {module for module, targets in _arrows().items() if targets & seen}
        seen |= wanted
    return found + [test for test in WHOLE if file.startswith("mbref/") and test not in found]


def _module(file: str) -> str:
    return module_name(ROOT / file)


@cache
def _arrows() -> Mapping[str, set[str]]:
    """Module → modules of the packages that it imports."""
    modules = {name: path for package in PACKAGES for name, path in sources(package).items()}
    return {name: _known(path, modules) - {name} for name, path in modules.items()}


@cache
def _tests() -> Mapping[str, set[str]]:
    """Test file → modules that it imports; helpers that it imports count as a part of it."""
    modules = [name for package in PACKAGES for name in sources(package)]
    helpers = {module_name(path): path for path in sorted((ROOT / "tests").rglob("*.py"))}
    found = {}
    for path in sorted(path for kind in NAMES for path in (ROOT / "tests").rglob(kind)):
        name = path.relative_to(ROOT).as_posix()
        if name in SNAPSHOTS or name.startswith(("tests/meta/", "tests/mutants/")):
            continue
        used = _known(path, modules) | _adapters(path)
        for helper in _known(path, helpers):
            used |= _known(helpers[helper], modules) | _adapters(helpers[helper])
        found[name] = used
    return found


def _known(path: Path, modules: Sequence[str] | Mapping[str, Path]) -> set[str]:
    """The modules, of those given, that a file imports."""
    return set(imported(path)) & set(modules)


def engines() -> list[str]:
    """Return the names of the engines whose adapter is a folder."""
    return sorted(path.parent.name for path in (ROOT / ADAPTERS).glob("*/adapter.py"))


def _adapters(path: Path) -> set[str]:
    """The modules of the engines that a test asks for by name, or by a list of names of crosscheck.engine."""
    text = path.read_text()
    lists = [getattr(crosscheck.engine, name) for name in LISTS if re.search(rf"\b{name}\b", text)]
    named = {*re.findall(r"""\bengine\("(\w+)"\)""", text), *itertools.chain(*lists)} & set(engines())
    inside = tuple(f"crosscheck.engines.{name}." for name in named)
    return {module for module in sources("crosscheck") if inside and module.startswith(inside)}
