"""Which mutants are drawn of the packages."""

from __future__ import annotations

import functools
import random
from collections.abc import Iterator

from crosscheck import engine as crosscheck_engine
from tests.mutants.operators import Mutant, mutants
from tests.mutants.tree import PACKAGES, ROOT

ADAPTERS = "crosscheck/engines/"


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


def engines() -> list[str]:
    """Return the names of the engines whose adapter is a folder."""
    return sorted(path.parent.name for path in (ROOT / ADAPTERS).glob("*/adapter.py"))
