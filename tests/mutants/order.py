"""The order in which test files run against a mutant."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from pathlib import Path

from tests.mutants.operators import Mutant

STARTING = 1.0  # CPU s until the first test of a file runs
PER_SECOND = 4000  # characters of a test file that take a second, before its time is known
# part of the name, or text, of files whose tests are short: by hand, or with interpreted kernels alone
BY_HAND, INTERPRETED, FASTER = "by_hand", "not PLAIN", 4.0
NEARER = 4.0


def ordered(
    mutant: Mutant,
    source: str,
    tests: Mapping[str, str],
    seconds: Mapping[str, float],
    kills: Mapping[str, int],
) -> list[str]:
    """Return the names of test files with these texts.

    Files that have killed most mutants of the same folder come first, then files with the least time for each
    of these names that they contain: the functions and classes around a mutant, its module, a part of the
    module, and its package. Files with BY_HAND or INTERPRETED count as FASTER, tests of the
    mutant's package as NEARER.
    """
    package, module = ".".join(Path(mutant.file).parent.parts), Path(mutant.file).stem
    folder = f"tests/{package.partition('.')[0]}/"
    words = {re.escape(package), module, rf"{module}(\.\w+| import)", *around(source, mutant)}
    places = list(tests)

    def rank(test: str) -> tuple[int, float, int]:
        named = sum(bool(re.search(rf"\b{word}\b", tests[test])) for word in words)
        needed = seconds.get(test, STARTING + len(tests[test]) / PER_SECOND)
        needed /= 1 + named
        needed /= FASTER if BY_HAND in test or INTERPRETED in tests[test] else 1.0
        needed /= NEARER if test.startswith(folder) else 1.0
        return -kills.get(test, 0), needed, places.index(test)

    return sorted(tests, key=rank)


def around(source: str, mutant: Mutant) -> list[str]:
    """Return the names of the functions and classes that contain a mutant."""
    return [
        node.name
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and node.lineno <= mutant.line <= (node.end_lineno or 0)
    ]
