"""Sizes of functions: the median and nine of ten are short, in every package."""

import ast
import statistics
from pathlib import Path

import pytest

from tests.meta.imports import sources, statements

PACKAGES = ("mbref", "crosscheck", "reports")
MEDIAN, MOST, SHARE = 7, 20, 0.9  # lines of a function's body; SHARE of the functions have at most MOST


def body_lines(function: ast.FunctionDef) -> int:
    """Lines from the first statement to the last, without the docstring."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return int(body[-1].end_lineno) - body[0].lineno + 1 if body else 0


def sizes(paths: list[Path]) -> dict[str, int]:
    """Lines of every function of the files, nested ones and methods too."""
    return {
        f"{path.name}:{node.lineno} {node.name}": body_lines(node)
        for path in paths
        for node in statements(path)
        if isinstance(node, ast.FunctionDef)
    }


@pytest.mark.parametrize("package", PACKAGES)
def test_half_of_the_functions_have_at_most_7_lines_and_nine_tenths_at_most_20(package):
    """Lines of the body without its docstring."""
    found = sizes(list(sources(package).values()))
    long = {name: size for name, size in found.items() if size > MOST}
    assert statistics.median(found.values()) <= MEDIAN, statistics.median(found.values())
    assert len(long) <= (1 - SHARE) * len(found), f"{len(long)} of {len(found)} are longer: {long}"


def test_lines_of_a_body_are_counted_without_its_docstring(tmp_path):
    """A docstring of three lines, a statement, a blank line and another statement are three."""
    path = tmp_path / "code.py"
    path.write_text('def f():\n    """Says.\n\n    More."""\n    a = 1\n\n    return a\n')
    assert sizes([path]) == {"code.py:1 f": 3}
