"""Plain words in docstrings and comments: a verb or a noun at the beginning, and no private words."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.meta.imports import parsed, statements

ROOT = Path(__file__).parents[2]
PACKAGES = ("mbref", "crosscheck", "reports")
FILES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
BEGINNINGS = re.compile(r"(Have|Those|The same|Of|As|What|That|How|Whether those)\b")
WORDS = re.compile(
    r"\b(told|tells|untold|but for|or why|those of|that of|as by|so is|beside it|dear|the other ones)\b"
)
CODE = re.compile(r"``.*?``|`.*?`|\"[^\"]*\"", re.S)  # names and quotations


def docstrings(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every docstring of a file."""
    for node in (parsed(path), *statements(path)):
        has_one = isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module)
        if has_one and (text := ast.get_docstring(node)):
            yield getattr(node, "lineno", 1), text


def comments(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of every comment of a file."""
    for token in tokenize.generate_tokens(io.StringIO(path.read_text()).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def faults(path: Path) -> list[str]:
    """Places of a file at which a docstring begins with a word of BEGINNINGS, or a private word stands."""
    described = list(docstrings(path))
    found = [(line, text) for line, text in described if BEGINNINGS.match(text)]
    every = [*described, *(comments(path) if WORDS.search(path.read_text()) else ())]
    found += [(line, text) for line, text in every if WORDS.search(CODE.sub("", text))]
    return [f"{path.name}:{line}: {text[:80]}" for line, text in found]


def test_docstrings_and_comments_contain_no_private_word():
    """More than 200 files of the product are read; ``faults`` finds WORDS and wrong BEGINNINGS."""
    found = [fault for path in FILES for fault in faults(path)]
    assert len(FILES) > 200 and not found, "\n".join(found)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ('"""Those of the rows."""\n', 1),  # a verbless beginning
        ('"""Return the rows."""\n', 0),
        ('"""Rows, but for one."""\n', 1),  # "but for"
        ("x = 1  # that of the other\n", 1),  # "that of"
        ('"""Return ``told`` rows."""\n', 0),
        ('told = "or why"\n', 0),
    ],
)
def test_private_words_and_verbless_beginnings_are_found(tmp_path, text, count):
    """In docstrings and comments, not in code and quotations."""
    path = tmp_path / "module.py"
    path.write_text(text)
    assert len(faults(path)) == count
