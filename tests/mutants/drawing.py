"""Which mutants are drawn of the packages."""

import random
import re
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

from tests.mutants.operators import Mutant, mutants

PACKAGES = ("mbref", "crosscheck", "reports")


def drawn(root: Path, seed: int, count: int, only: Sequence[str] = ()) -> list[Mutant]:
    """Return ``count`` mutants, or all where there are fewer, of the files whose paths begin with one of
    ``only``; each place is as probable as another."""
    found = [mutant for name in _files(root, only) for mutant in mutants(name, (root / name).read_text())]
    return random.Random(seed).sample(found, min(count, len(found)))


def _files(root: Path, only: Sequence[str]) -> Iterator[str]:
    """Yield the files of the packages, without adapters of engines that are not installed."""
    absent = tuple(f"{path.parent.relative_to(root).as_posix()}/" for path in _adapters(root))
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            name = path.relative_to(root).as_posix()
            if name.startswith(tuple(only) or "") and not name.startswith(absent):
                yield name


def _adapters(root: Path) -> Iterator[Path]:
    """Yield the adapters in folders of their own whose engines cannot be imported."""
    for path in sorted((root / "crosscheck" / "engines").glob("*/adapter.py")):
        named = re.search(r'^ +modules[^=]* = \("(\w+)', path.read_text(), re.MULTILINE)
        if named and find_spec(named[1]) is None:
            yield path
