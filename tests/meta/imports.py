"""Imports of the packages as a graph of modules, read from the source and never by importing."""

import ast
import functools
from collections.abc import Iterator, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[2]
Graph = Mapping[str, set[str]]


def module_name(path: Path) -> str:
    """``crosscheck.paper.runs`` of crosscheck/paper/runs.py, ``crosscheck.paper`` of its __init__.py."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@functools.cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of a file, parsed once for all tests; nobody changes it."""
    return ast.parse(path.read_text())


@functools.cache
def statements(path: Path) -> tuple[ast.AST, ...]:
    """Return the statements of a file, nested ones and branches too, without their expressions."""
    return _nested(parsed(path).body)


def _nested(body: Sequence[ast.AST]) -> tuple[ast.AST, ...]:
    found, left = [], list(body)
    while left:
        found.append(node := left.pop())
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            left += getattr(node, part, ())
    return tuple(found)


@functools.cache
def sources(package: str) -> dict[str, Path]:
    """Every module of a package and its file."""
    return {module_name(path): path for path in sorted((ROOT / package).rglob("*.py"))}


def imported(path: Path) -> Iterator[str]:
    """Yield the dotted names that a file imports anywhere: of ``from a import b`` both ``a`` and ``a.b``."""
    for node in _imports(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            module = origin(path, node)
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


def origin(path: Path, node: ast.ImportFrom) -> str:
    """Return the full name of the module from which a statement of a file imports. Only ``reports`` imports
    relatively, since a wheel has it as ``crosscheck.reports``."""
    if not node.level:
        return str(node.module)
    package = path.relative_to(ROOT).parts[: -node.level]
    assert package[:1] == ("reports",), f"{path}: relative import"
    return ".".join([*package, *filter(None, [node.module])])


@functools.cache
def graph(package: str) -> dict[str, set[str]]:
    """Return module → modules of its package that it imports, also inside functions and for types alone. Only
    an ``__init__`` may import under TYPE_CHECKING what it re-exports on first use: no arrow. The package's
    ``__init__`` modules count only where they are imported from by name."""
    modules = sources(package)
    return {name: _targets(path, modules) - {name} for name, path in modules.items()}


def _targets(path: Path, modules: Mapping[str, Path]) -> set[str]:
    """Return the modules imported; ``from a import b`` is b if b is a module, otherwise a."""
    found = set()
    for node in _imports(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        else:
            for alias in node.names:
                whole = f"{origin(path, node)}.{alias.name}"
                found.add(whole if whole in modules else origin(path, node))
    return found & set(modules)


@functools.cache
def _imports(path: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """Return the imports of a file, in an ``__init__`` without those under TYPE_CHECKING."""
    body = parsed(path).body
    if path.name == "__init__.py":
        body = [n for n in body if not (isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")]
    return tuple(node for node in _nested(body) if isinstance(node, ast.Import | ast.ImportFrom))


def children(arrows: Graph, folder: str) -> dict[str, set[str]]:
    """Return the modules and folders directly in a folder, each with those of them that it imports from."""
    depth, inside = folder.count(".") + 1, f"{folder}."
    found: dict[str, set[str]] = {}
    for module, targets in arrows.items():
        if module.startswith(inside):
            own = module.split(".")[depth]
            others = {target.split(".")[depth] for target in targets if target.startswith(inside)}
            found.setdefault(own, set()).update(others - {own})
    return found


def circle(arrows: Graph) -> list[str]:
    """Return the sorted modules of a circle of imports; none if there is no circle."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return sorted(set(error.args[1]))
    return []


def floors(arrows: Graph) -> dict[str, int]:
    """Return the floor of each module of a graph without circles: one above the highest that it imports."""
    found: dict[str, int] = {}

    def floor(module: str) -> int:
        if module not in found:
            found[module] = 1 + max(map(floor, arrows[module]), default=0)
        return found[module]

    for module in arrows:
        floor(module)
    return found


def upward(arrows: Graph, floors: Sequence[Sequence[str]]) -> list[str]:
    """Arrows from a lower floor to a higher one; ``floors`` lists the parts of a package, lowest first. A
    part is a folder or module below the package; the package's own __init__ stands above all. Raises
    ValueError for a part on no floor."""
    level = {part: i for i, floor in enumerate(floors) for part in floor}
    parts = {module: module.split(".")[1] if "." in module else "" for module in arrows}
    if missing := sorted({part for part in parts.values() if part} - set(level)):
        raise ValueError(f"on no floor: {', '.join(missing)}")
    return [
        f"{module} → {target}"
        for module, targets in arrows.items()
        for target in sorted(targets)
        if parts[module] and parts[target] and level[parts[module]] < level[parts[target]]
    ]
