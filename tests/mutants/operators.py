"""The mutants of a source: every change of one place in its syntax tree that an operator makes."""

import ast
import difflib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

SIGNS = {ast.Add: "-", ast.Sub: "+"}
FACTORS = {ast.Mult: "/", ast.Div: "*"}
COMPARISONS = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.In: "not in",
    ast.NotIn: "in",
    ast.Is: "is not",
    ast.IsNot: "is",
}
EXTREMES = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "argmin": "argmax",
    "argmax": "argmin",
    "any": "all",
    "all": "any",
    "sin": "cos",
    "cos": "sin",
}
UNCHANGED = {"min", "max", "minimum", "maximum", "hypot", "isclose", "allclose"}
UNCHANGED |= {"logical_or", "logical_and", "dot", "inner", "array_equal"}
"""Functions that give the same for arguments in any order."""
KINDS = ("sign", "factor", "comparison", "constant", "index", "extreme", "argument order", "statement")
KINDS += ("condition", "bodies")


class Mutant(NamedTuple):
    """The bytes ``start`` to ``end`` of a file, in a ``line``, become ``new`` instead of ``old``."""

    file: str
    line: int
    kind: str
    old: str
    new: str
    start: int
    end: int

    def difference(self, root: Path) -> Iterator[str]:
        """Yield the lines of the source before and after the change, as ``diff`` shows them."""
        source = (root / self.file).read_text()
        texts = source.splitlines(), self.planted(source).splitlines()
        for line in difflib.unified_diff(*texts, n=0, lineterm=""):
            if not line.startswith(("---", "+++", "@@")):
                yield line

    def planted(self, source: str) -> str:
        """Return the source with the mutant."""
        data = source.encode()
        return (data[: self.start] + self.new.encode() + data[self.end :]).decode()


def mutants(file: str, source: str) -> list[Mutant]:
    """Return all mutants of a file by place; none of annotations, docstrings, texts, type imports."""
    lines = source.encode().splitlines(keepends=True)
    starts = [sum(map(len, lines[:k])) for k in range(len(lines))]

    def place(node: ast.AST) -> tuple[int, int]:
        at = starts[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
        return at, starts[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]

    found = []
    for node in _nodes(ast.parse(source)):
        makers = (_operations, _comparisons, _numbers, _calls, _statements, _conditions)
        for kind, part, new in [change for made in makers for change in made(node)]:
            start, end = place(part)
            old = source.encode()[start:end].decode()
            found.append(Mutant(file, part.lineno, kind, old, new, start, end))  # type: ignore[attr-defined]
    return sorted(set(found), key=lambda m: (m.start, m.end, m.new))


def places(root: Path, packages: Sequence[str], mutant: Mutant) -> dict[str, int]:
    """Return the lines (bits) of the sources whose tests can see a mutant: the innermost statement at its
    line; for a function's head, its body; for a name's value outside functions, the lines with that name."""
    source = (root / mutant.file).read_text()
    tree = ast.parse(source)
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.stmt)]
    around = [node for node in nodes if node.lineno <= mutant.line <= (node.end_lineno or 0)]
    innermost = max(around, key=lambda node: node.lineno)
    if isinstance(innermost, ast.FunctionDef):
        return {mutant.file: _bits(innermost.body[0].lineno, innermost.body[-1].end_lineno)}
    if any(isinstance(node, ast.FunctionDef) for node in around):
        inner = [node.lineno for node in ast.walk(innermost) if isinstance(node, ast.stmt)]
        inner = [line for line in inner if line > mutant.line]
        return {mutant.file: _bits(innermost.lineno, min(inner) - 1 if inner else innermost.end_lineno)}
    inner = [node for node in ast.walk(innermost) if isinstance(node, ast.Name)]
    names = [node.id for node in inner if isinstance(node.ctx, ast.Store)]
    if not names:
        return {mutant.file: _bits(1, len(source.splitlines()))}
    named = re.compile(rf"\b({'|'.join(names)})\b")
    found, module = {}, re.compile(rf"\b{re.sub(r'(/__init__)?[.]py$', '', mutant.file).split('/')[-1]}\b")
    for path in sorted(path for package in packages for path in (root / package).rglob("*.py")):
        name, text = path.relative_to(root).as_posix(), path.read_text()
        lines = text.splitlines() if name == mutant.file or module.search(text) else []
        at = [k for k, line in enumerate(lines, 1) if named.search(line)]
        found[name] = sum(1 << k for k in at)
    found[mutant.file] &= ~_bits(innermost.lineno, innermost.end_lineno)
    return found


def _bits(first: int, last: int | None) -> int:
    return sum(1 << line for line in range(first, (last or first) + 1))


def _nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a tree whose changes can be seen."""
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list") or isinstance(value, ast.JoinedStr):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not _is_left(child):
                yield from _nodes(child)


def _is_left(node: ast.AST) -> bool:
    if isinstance(node, ast.If):
        return ast.unparse(node.test) == "TYPE_CHECKING"
    if isinstance(node, ast.keyword):
        return node.arg == "strict"  # of zip: a check of lengths that are equal
    return isinstance(node, ast.JoinedStr)


Changes = Iterator[tuple[str, ast.AST, str]]


def _operations(node: ast.AST) -> Changes:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "sign", node, f"(+{ast.unparse(node.operand)})"
    if not isinstance(node, ast.BinOp) or _is_text(node.left) or _is_text(node.right):
        return
    for kind, table in (("sign", SIGNS), ("factor", FACTORS)):
        if type(node.op) in table:
            left, right = f"({ast.unparse(node.left)})", f"({ast.unparse(node.right)})"
            yield kind, node, f"({left} {table[type(node.op)]} {right})"


def _is_text(node: ast.AST) -> bool:
    is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return is_text or isinstance(node, ast.JoinedStr | ast.List)


def _comparisons(node: ast.AST) -> Changes:
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARISONS:
        left, right = ast.unparse(node.left), ast.unparse(node.comparators[0])
        yield "comparison", node, f"({left} {COMPARISONS[type(node.ops[0])]} {right})"


def _numbers(node: ast.AST) -> Changes:
    if isinstance(node, ast.Subscript) and not isinstance(node.value, ast.Name | ast.Attribute):
        return
    if isinstance(node, ast.Subscript) and (isinstance(node.slice, ast.Constant)):
        if type(node.slice.value) is int:
            yield "index", node.slice, str(node.slice.value + 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield "constant", node, str(not node.value)
    elif isinstance(node, ast.Constant) and type(node.value) is int:
        yield "constant", node, str(node.value + 1)
    elif isinstance(node, ast.Constant) and type(node.value) is float:
        yield "constant", node, repr(2 * node.value or 1.0)


def _calls(node: ast.AST) -> Changes:
    if not isinstance(node, ast.Call):
        return
    called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if called in EXTREMES:
        whole = ast.unparse(node.func)
        yield "extreme", node.func, whole.removesuffix(called) + EXTREMES[called]
    pairs = zip(node.args, node.args[1:], strict=False)
    if called in (*UNCHANGED, "isinstance", "getattr", "hasattr", "replace", "open"):
        return
    for k, (first, second) in enumerate(pairs):
        if isinstance(first, ast.Starred) or isinstance(second, ast.Starred):
            continue
        if ast.unparse(first) != ast.unparse(second):
            swapped = [*node.args[:k], second, first, *node.args[k + 2 :]]
            changed = ast.Call(node.func, swapped, node.keywords)
            yield "argument order", node, ast.unparse(changed)


def _statements(node: ast.AST) -> Changes:
    is_call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call | ast.Yield | ast.YieldFrom)
    if is_call or isinstance(node, ast.AugAssign | ast.Break | ast.Continue | ast.Raise):
        yield "statement", node, "pass"


def _conditions(node: ast.AST) -> Changes:
    if isinstance(node, ast.BoolOp):
        for k in range(len(node.values)):
            rest = [*node.values[:k], *node.values[k + 1 :]]
            text = ast.unparse(rest[0] if len(rest) == 1 else ast.BoolOp(node.op, rest))
            yield "condition", node, f"({text})"
    if isinstance(node, ast.comprehension):
        for test in node.ifs:
            yield "condition", test, "True"
    if isinstance(node, ast.If | ast.While):
        yield "condition", node.test, f"(not ({ast.unparse(node.test)}))"
    if isinstance(node, ast.IfExp):
        orelse, test, body = (ast.unparse(part) for part in (node.orelse, node.test, node.body))
        yield "bodies", node, f"({orelse} if {test} else {body})"
