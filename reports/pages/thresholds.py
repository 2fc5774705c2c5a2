"""The page on the thresholds of mbref outside ``mbref.taylor.crossing``: its constants and their comments."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mbref

from ..blocks import Block, Fold, Table, Within

SOURCES = Path(mbref.__file__).parent
LEFT_OUT = (
    "cli/",
    "motions/drawing/",
    "scenes/",
    "taylor/crossing/thresholds.py",
)  # layouts, data, a table of its own
NUMBERS = {
    "MOST_BYTES", "CACHE_LINE", "WORDS", "CHANGED", "SINGULAR_AHEAD", "NONE_TAKEN", "SMOOTH", "C",
    "POINTERS", "ORDER_ARGUMENTS", "CENTRAL", "GOLDEN", "NEGATIVE", "FACTOR_FAILED", "UNIT", "INFINITE",
    "FINEST",
}  # fmt: skip
# names and modules of numbers that change time, memory or the size of an output only
COSTS = {
    "MOST_KEPT", "MOST_GEOMETRIES", "MOST_NAMES", "MOST_PARTS", "MOST_PATTERNS", "MOST_SHAPES",
    "MOST_CHECKED", "MOST_KEYS", "MOST_OF_A_KEY", "MOST_STRUCTURES", "MOST_OF_ONE", "MOST_LOADED",
    "MOST_GAP", "LARGEST_COUNT", "MOST_ROWS_ALONG", "MOST_BRANCHED_ROWS", "MOST_DIAGNOSED_ROWS",
    "MOST_OPEN_ROWS", "MOST_DRIVEN_ROWS", "MOST_ADVISED_ROWS", "LARGE", "MOST_AT_ONCE", "SECONDS",
    "LEAST_FREE", "MOST_VECTORS", "PARALLEL_SUMS", "AT_ONCE", "KEPT", "SAMPLES", "POSES_ALONG",
    "MODE_SAMPLES", "AMPLITUDE", "MOST_EXCHANGES", "MOST_TRIALS", "MOST_STEPS_ALONG",
    "MOST_COMPARED_STEPS", "MOST_TERMS", "MOST_FACTORS", "MOST_KINEMATIC", "AIM", "POSES", "INSTANTS",
    "STARTS", "STRIDE", "STEP_SHARES",
}  # fmt: skip
COLUMNS = ("file", "name", "value", "quantity and reason", "acts on")


class Threshold(NamedTuple):
    """A numeric constant: its module below mbref, name, value as written, and the comment on it."""

    module: str
    name: str
    value: str
    comment: str


def thresholds() -> list[Threshold]:
    """Return all numeric constants of mbref that have a comment."""
    paths = sorted(SOURCES.rglob("*.py"))
    names = [path.relative_to(SOURCES).as_posix() for path in paths]
    chosen = [(name, path) for name, path in zip(names, paths, strict=True) if not name.startswith(LEFT_OUT)]
    return [found for name, path in chosen for found in constants(name, path.read_text())]


def constants(name: str, text: str) -> Iterator[Threshold]:
    """Yield the numeric constants with a comment of a file, by its name below mbref and its text."""
    lines, module = text.splitlines(), name.removesuffix(".py").replace("/", ".")
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign) or not (comment := _comment(lines, node)):
            continue
        pairs: list[tuple[ast.expr, ast.expr]] = []
        for target in node.targets:
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs += zip(target.elts, node.value.elts, strict=True)
            else:
                pairs.append((target, node.value))
        for each, value in pairs:
            if isinstance(each, ast.Name) and _is_number(value):
                yield Threshold(module, each.id, ast.unparse(value), comment)


def _comment(lines: list[str], node: ast.Assign) -> str:
    """Return the comment behind an assignment, or the lines of comment before it."""
    if found := re.search(r"  # (.+)$", lines[(node.end_lineno or node.lineno) - 1]):
        return found[1]
    before, k = list[str](), node.lineno - 2
    while k >= 0 and lines[k].startswith("# "):
        before.insert(0, lines[k].removeprefix("# "))
        k -= 1
    return " ".join(before)


def _is_number(node: ast.expr) -> bool:
    """Return whether an expression is a number, an expression of numbers, or several of them."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    if isinstance(node, ast.BinOp):
        return all(isinstance(part, ast.Name) or _is_number(part) for part in (node.left, node.right))
    if isinstance(node, ast.Tuple):
        return all(map(_is_number, node.elts))
    return isinstance(node, ast.Dict) and all(map(_is_number, node.values))


def parts() -> dict[str, list[Block]]:
    """Return ``tables``: the number of thresholds in each folder of mbref, and a folded table for each."""
    rows = dict[str, list[tuple[str, ...]]]()
    for each in thresholds():
        if each.name not in NUMBERS:
            mark = "cost" if each.name in COSTS else "result"
            folder, _, file = each.module.rpartition(".")
            cells = (f"`{file}`", f"`{each.name}`", f"`{each.value}`", each.comment, mark)
            rows.setdefault(folder or "root", []).append(cells)
    counts = [
        (Within(folder, f"#{folder}"), str(len(of)), str(sum(row[-1] == "cost" for row in of)))
        for folder, of in rows.items()
    ]
    overview = Table("Folders of mbref.", ("folder", "numbers", "of cost only"), counts, frozenset({1, 2}))
    tables = [Fold(folder, folder, [Table("Constants.", COLUMNS, of)]) for folder, of in rows.items()]
    return {"tables": [overview, *tables]}
