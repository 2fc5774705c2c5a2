"""Which tests run a line of a source, from a recording of every test file, and in which order they run.

A recording holds as long as the test file is the same. Of a source that has changed since then, every line
counts as run by each test that ran one of its lines.
"""

from __future__ import annotations

import ast
import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.mutants.operators import Mutant

NAMES = "test_*.py", "interpreted_*.py"  # files of tests; some of them run with interpreted kernels alone
SNAPSHOTS = (  # they see that a text changed, not that it is wrong
    "tests/reports/test_reference_report.py",
    "tests/reports/test_committed_paper.py",
    "tests/test_transcripts.py",
)
LEFT = "tests/meta/", "tests/mutants/"
NEARER = 4.0  # tests of the mutant's package run before others that take so many times less
STARTING = 0.5  # CPU s of any file


def test_files(root: Path) -> list[str]:
    """Return the files of tests below a folder that may kill mutants."""
    found = sorted({path for kind in NAMES for path in (root / "tests").rglob(kind)})
    names = [path.relative_to(root).as_posix() for path in found]
    return [name for name in names if name not in SNAPSHOTS and not name.startswith(LEFT)]


class Reach:
    """The recordings of test files, kept in a file with a line for each."""

    def __init__(self, kept: Path, root: Path) -> None:
        self._kept, self._root = kept, root
        self._digests: dict[str, str] = {}
        self._texts = {file: (root / file).read_text() for file in test_files(root)}
        self._records: dict[str, dict[str, Any]] = {}
        if kept.exists():
            records = map(json.loads, kept.read_text().splitlines())
            self._records = {record["file"]: record for record in records}

    def missing(self) -> list[str]:
        """Return the test files without a recording that holds."""
        kept = {file: record["digest"] for file, record in self._records.items()}
        return [file for file in self._texts if kept.get(file) != self._digest(file)]

    def add(self, file: str, answer: Mapping[str, Any]) -> None:
        """Keep the answer of a process that recorded a test file; it has no lines where its time was up."""
        answer = {"starting": 0.0, "seconds": {}, "reached": {}, **answer}
        digests = {source: self._digest(source) for source in answer["reached"]}
        record = {"file": file, "digest": self._digest(file), "sources": digests, **answer}
        self._records[file] = record
        with self._kept.open("a") as out:
            print(json.dumps(record), file=out)

    def _digest(self, file: str) -> str:
        if file not in self._digests:
            self._digests[file] = hashlib.sha256((self._root / file).read_bytes()).hexdigest()[:16]
        return self._digests[file]

    def tests(self, mutant: Mutant, source: str) -> dict[str, list[str]]:
        """Return the tests that run a mutant's line, by file.

        Where no test runs it, those of every file that reaches the source, for instance in another process.
        """
        wanted = lines_of(source, mutant.line)
        found = {file: self._of_file(file, mutant.file, wanted) for file in self._texts}
        if not any(found.values()):
            found = {file: self._of_file(file, mutant.file, -1) for file in found}
        return {file: tests for file, tests in found.items() if tests}

    def _of_file(self, file: str, source: str, wanted: int) -> list[str]:
        record = self._records.get(file, {})
        if source not in record.get("reached", ()):
            return []
        reached = record["reached"][source]
        if record["sources"][source] != self._digest(source):
            wanted = -1
        if int(reached["outside"], 16) & wanted:
            return list(record["seconds"])
        return [name for bits, tests in reached["tests"] if int(bits, 16) & wanted for name in tests]

    def ordered(self, mutant: Mutant, source: str, kills: Mapping[str, int]) -> dict[str, list[str]]:
        """Return the test files in the order in which they run, each with all of its tests.

        Files come first that take little time, that contain many names, and that have killed many mutants of
        the same folder. The names are the functions and classes around a mutant, or a constant and the
        functions that use it, its module and its package. In a file, tests that run the line come first, then
        tests with one of the names, then the quickest. Tests that do not run the line may use a result that
        another test has left in memory.
        """
        tests, names = self.tests(mutant, source), around(source, mutant)
        package, module = ".".join(Path(mutant.file).parent.parts), Path(mutant.file).stem
        words = [re.escape(package), module, rf"{module}(\.\w+| import)", *names]
        named = re.compile("|".join(map(re.escape, [*names, module])))

        def rank(file: str) -> float:
            count = sum(bool(re.search(rf"\b{word}\b", self._texts[file])) for word in words)
            seconds = min(self._records[file]["seconds"][test] for test in tests[file])
            needed = STARTING + self._records[file]["starting"] + seconds
            nearer = NEARER if file.startswith(f"tests/{package.partition('.')[0]}/") else 1.0
            return needed / (1 + count) / (1 + math.log2(1 + kills.get(file, 0))) / nearer

        def in_order(file: str) -> list[str]:
            seconds, running = self._records[file]["seconds"], set(tests[file])
            return sorted(
                seconds,
                key=lambda test: (
                    test not in running,
                    not named.search(test.partition("::")[2]),
                    seconds[test],
                ),
            )

        return {file: in_order(file) for file in sorted(tests, key=rank)}


def lines_of(source: str, line: int) -> int:
    """Return the lines whose tests see a change of a line, as the bits of a number.

    Within a function these are the lines of its statement, and of a default the lines of the function. Of a
    constant of a module or a class, these are the lines of functions that name it; all lines of the source if
    there are none.
    """
    tree = ast.parse(source)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    if inside := [node for node in functions if _has(node, line)]:
        innermost = max(inside, key=lambda node: node.lineno)
        if line < innermost.body[0].lineno:
            return _bits(innermost.body[0].lineno, innermost.end_lineno or 0)
        statements = [node for node in ast.walk(innermost) if isinstance(node, ast.stmt) and _has(node, line)]
        last = max(statements, key=lambda node: node.lineno)
        return _bits(last.lineno, _last_of_head(last))
    names = _constants(tree, line)
    users = {node.lineno for function in functions for node in ast.walk(function) if _names(node) & names}
    return sum(1 << k for k in users) or -1


def _has(node: ast.AST, line: int) -> bool:
    first, last = getattr(node, "lineno", None), getattr(node, "end_lineno", None)
    return first is not None and last is not None and first <= line <= last


def _last_of_head(statement: ast.stmt) -> int:
    """Return the last line of a statement before the statements that it contains."""
    inner = [n.lineno for n in ast.walk(statement) if isinstance(n, ast.stmt) and n is not statement]
    last = min(inner) - 1 if inner else statement.end_lineno or 0
    return max(statement.lineno, last)


def _bits(first: int, last: int) -> int:
    return sum(1 << line for line in range(first, last + 1))


def _targets(node: ast.AST) -> Iterator[str]:
    """Yield the names that an assignment defines."""
    if isinstance(node, ast.Assign | ast.AnnAssign):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        yield from (name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name))


def _constants(tree: ast.AST, line: int) -> set[str]:
    """Return the names that the assignments at a line define."""
    return {name for node in ast.walk(tree) if _has(node, line) for name in _targets(node)}


def _names(node: ast.AST) -> set[str]:
    """Return the name that a node reads, in a set."""
    return (
        {node.id} if isinstance(node, ast.Name) else {node.attr} if isinstance(node, ast.Attribute) else set()
    )


def around(source: str, mutant: Mutant) -> list[str]:
    """Return the names of the functions and classes that contain a mutant.

    Of a constant of a module or a class, these are its name and the names of the functions that use it, too.
    """
    tree = ast.parse(source)
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    found = [node.name for node in nodes if _has(node, mutant.line)]
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    if any(_has(node, mutant.line) for node in functions):
        return found
    constants = _constants(tree, mutant.line)
    using = [f.name for f in functions if any(_names(node) & constants for node in ast.walk(f))]
    return [*found, *sorted(constants), *using]
