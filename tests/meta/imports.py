"""Imports of the packages as a graph of modules, read from the source and never by importing."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
Graph = Mapping[str, set[str]]


def module_name(path: Path) -> str:
    """``crosscheck.paper.runs`` of crosscheck/paper/runs.py, ``crosscheck.paper`` of its __init__.py."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def sources(package: str) -> dict[str, Path]:
    """Every module of a package and its file."""
    return {module_name(path): path for path in sorted((ROOT / package).rglob("*.py"))}


def imported(path: Path, everywhere: bool = True) -> Iterator[str]:
    """Full dotted names that a file imports: of ``from a import b`` both ``a`` and ``a.b``.

    Those inside functions and under TYPE_CHECKING only if ``everywhere``.
    """
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree) if everywhere else tree.body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: relative import"
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def graph(package: str) -> dict[str, set[str]]:
    """Module → modules of its package that it imports while it is itself imported.

    The package's ``__init__`` modules count only where they are imported from by name.
    """
    modules = sources(package)
    return {name: _targets(path, modules) - {name} for name, path in modules.items()}


def _targets(path: Path, modules: Mapping[str, Path]) -> set[str]:
    """The modules imported; ``from a import b`` is b where b is a module, else a."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found.add(whole if whole in modules else str(node.module))
    return found & set(modules)


def circles(arrows: Graph) -> list[list[str]]:
    """The strongly connected components of more than one module, by Tarjan's algorithm."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in sorted(arrows[node]):
            if target not in index:
                visit(target)
            if target in stack:
                low[node] = min(low[node], low[target])
        if low[node] == index[node]:
            component = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(component) > 1:
                found.append(sorted(component))

    for node in sorted(arrows):
        if node not in index:
            visit(node)
    return found


def upward(arrows: Graph, floors: Sequence[Sequence[str]]) -> list[str]:
    """Arrows from a lower floor to a higher one; ``floors`` lists the parts of a package, lowest first.

    A part is a folder or module below the package; the package's own __init__ stands above all.  Raises
    ValueError for a part on no floor.
    """
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
