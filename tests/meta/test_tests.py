"""Tests go through doors: no private names, few patches at listed seams, no stand-ins, clear names."""

import ast
import functools
import re
from collections.abc import Iterator
from pathlib import Path

from tests.meta.imports import parsed

ROOT = Path(__file__).parents[2]
PRODUCT = ("mbref", "crosscheck", "reports")
TESTS = sorted(path for path in (ROOT / "tests").rglob("*.py") if "meta" not in path.parts)
STAND_INS = {"SimpleNamespace", "mock", "mocker", "Mock", "MagicMock", "__new__"}
PATCHING = ("setattr", "setitem", "delattr", "delitem")  # methods of ``monkeypatch``
MOST_PATCHES = 60
MOST_RATIO = 0.55  # lines of tests over lines of the product
VAGUE = ("by_hand", "_parts", "details", "seldom", "rare", "interpreted", "limits_of", "misc")
# Seams at which tests may patch the product: what a machine, a clock or an outside package does.
SEAMS = {
    "crosscheck.engine.installed": "an engine that is not installed",
    "crosscheck.cli.request.missing_package": "an engine that is not installed",
    "crosscheck.cli.certifying.importlib.util.find_spec": "a package that is not installed",
    "reports.__main__.find_spec": "a package that is not installed",
    "mbref.formats.entry_points": "formats of installed packages",
    "crosscheck.processes.pool.READY_SECONDS": "a time limit",
}


def name_of(path: Path) -> str:
    """Return a file's path from the root."""
    return path.relative_to(ROOT).as_posix()


def is_private(name: str) -> bool:
    """Return whether a name is private; names that also end with an underscore belong to protocols."""
    return name.startswith("_") and not name.endswith("_")


DEFINED = re.compile(  # definitions, and targets of assignments and loops, which may have several names
    r"\b(?:def|class|as|for)\s+(_\w+)|\b(_\w+)(?=(?:,\s*[*\w.]+)*\)?\s*(?::[^=\n]*)?=(?!=))"
)


@functools.cache
def private_names() -> frozenset[str]:
    """Return the private names of functions, classes, constants and attributes of the product."""
    paths = [path for package in PRODUCT for path in (ROOT / package).rglob("*.py")]
    found = {name for path in paths for names in DEFINED.findall(path.read_text()) for name in names}
    return frozenset(name for name in found if is_private(name))


def imported_from_product(path: Path) -> dict[str, str]:
    """Return local name → dotted name of everything that a file imports from the product."""
    found = {}
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in PRODUCT:
            found |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            roots = {alias: alias.name.partition(".")[0] for alias in node.names}
            found |= {each.asname or root: each.name for each, root in roots.items() if root in PRODUCT}
    return found


def private_uses(path: Path) -> Iterator[str]:
    """Yield private names of the product that a test file imports or reads from an object."""
    if private_names().isdisjoint(re.findall(r"(?<!\w)_\w+", path.read_text())):
        return  # parsing takes long
    nodes = list(ast.walk(parsed(path)))
    own = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    own |= {n.attr for n in nodes if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
    for name, full in imported_from_product(path).items():
        if is_private(full.rpartition(".")[2]):
            yield name
    for node in nodes:
        if isinstance(node, ast.Attribute) and node.attr in private_names() - own:
            yield node.attr
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "getattr":
            named = {each.value for each in named_in(node.args[1:2])}
            yield from sorted(named & private_names() - own)


def test_tests_use_no_private_name_of_the_product():
    """Private names begin with an underscore: a change inside the product breaks no test."""
    found = {name_of(path): names for path in TESTS if (names := sorted(set(private_uses(path))))}
    assert not found, found


ASSIGNED = re.compile(r"monkeypatch|^[^=#()\n]*[.\]][^=#()\n]*=[^=]", flags=re.M)  # an attribute or element


def patches(path: Path) -> Iterator[str]:
    """Yield the names of the product that a test file replaces, by ``monkeypatch`` or by assignment."""
    if not ASSIGNED.search(path.read_text()):
        return  # parsing takes long
    product = imported_from_product(path)
    for node in ast.walk(parsed(path)):
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Attribute) and called.attr in PATCHING and node.args:
            target, last = node.args[0], "".join(f".{ast.literal_eval(a)}" for a in named_in(node.args[1:2]))
        elif isinstance(node, ast.Attribute | ast.Subscript) and isinstance(node.ctx, ast.Store):
            target, last = node, ""
        else:
            continue
        if isinstance(target, ast.Constant) and str(target.value).partition(".")[0] in PRODUCT:
            yield str(target.value)
        root = target
        while isinstance(root, ast.Attribute | ast.Subscript):
            root = root.value
        if isinstance(root, ast.Name) and root.id in product:
            yield f"{product[root.id]}{ast.unparse(target).removeprefix(root.id)}{last}"


def named_in(arguments: list[ast.expr]) -> list[ast.expr]:
    """Return the arguments that are names given as text."""
    return [each for each in arguments if isinstance(each, ast.Constant) and isinstance(each.value, str)]


def test_tests_patch_the_product_only_at_listed_seams():
    """At most 60 patches, and each at a name in SEAMS."""
    found = {name_of(path): list(patches(path)) for path in TESTS}
    beside = {path: names for path, each in found.items() if (names := [n for n in each if n not in SEAMS])}
    assert not beside, beside
    assert sum(map(len, found.values())) <= MOST_PATCHES


def stand_ins(tree: ast.AST) -> set[str]:
    """Return the makers of stand-ins that a file imports, reads, or takes as a fixture."""
    found = set()
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name) | ast.alias(name=name):
                found |= {*name.split(".")}
            case ast.ImportFrom(module=str(name)):
                found |= {*name.split(".")}
    return found & STAND_INS


def test_tests_use_no_mocks():
    """A stand-in repeats the fields of a product's object, and does not change with them. The files read are
    hundreds; the first lines here show uses that are found."""
    uses = ("from unittest import mock", "import unittest.mock as m", "def test_it(mocker): pass", "Mock()")
    assert all(stand_ins(ast.parse(use)) for use in uses)
    named = [path for path in TESTS if any(word in path.read_text() for word in STAND_INS)]
    found = {name_of(path): used for path in named if (used := stand_ins(parsed(path)))}
    assert len(TESTS) > 100 and not found, found


def test_names_of_test_files_contain_no_vague_word():
    """VAGUE lists words that name no behaviour."""
    vague = [name_of(path) for path in TESTS if any(word in path.stem.split("test_")[-1] for word in VAGUE)]
    assert not vague, vague


def lines(folders: tuple[str, ...]) -> int:
    """Return the number of lines of Python in folders."""
    return sum(path.read_text().count("\n") for folder in folders for path in (ROOT / folder).rglob("*.py"))


def test_tests_have_at_most_55_lines_for_100_of_the_product():
    """A line of tests costs as much to keep as a line of the product."""
    ratio = lines(("tests",)) / lines(PRODUCT)
    assert ratio <= MOST_RATIO, f"{ratio:.2f} lines of tests for a line of the product"
