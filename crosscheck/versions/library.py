"""Facts of an engine's library as it is installed: default values, and names that the adapter misses.

``python -m crosscheck.versions.library ENGINE`` prints them as JSON.
"""

from __future__ import annotations

import ast
import enum
import functools
import inspect
import json
import math
import pkgutil
import sys
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import Engine, engine

DEPTH = 4  # levels of options within options
MOST = 20  # entries of a list that is shown
# imports of adapters that are no engine's
OTHERS = {"crosscheck", "mbref", "numpy", "scipy", "numba", "llvmlite", "psutil", *sys.stdlib_module_names}
HIDDEN = object()  # result for a value that is no default of an option


def facts(name: str) -> dict[str, Any]:
    """Return version, default values and missing names of an engine's library."""
    found = engine(name)
    defaults = {key: value for path in found.defaults_of for key, value in defaults_of(path)}
    return {"version": found.version(), "defaults": defaults, "missing": missing(found)}


def defaults_of(path: str) -> Iterator[tuple[str, Any]]:
    """Yield (name, value) of each default: ``module.Class().part`` are public values of an object, of its
    part, or of the result of a method (``part()``), and ``module.function`` the defaults of a signature."""
    called, makes, part = path.partition("()")
    try:
        target = pkgutil.resolve_name(called)
        made = target() if makes else None  # kept: its parts may not outlive it
        value = functools.reduce(_part, filter(None, part.split(".")), made)
    except (ImportError, AttributeError):
        yield path, "missing"
        return
    yield from _values(path, value, DEPTH) if makes else _signature(path, target)


def _part(made: Any, name: str) -> Any:
    """Return an attribute of an object, or the result of its method for a name with ``()``."""
    found = getattr(made, name.removesuffix("()"))
    return found() if name.endswith("()") else found


def _signature(path: str, function: Any) -> Iterator[tuple[str, Any]]:
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # a compiled function without signature
        return
    for parameter in parameters:
        if parameter.default is not parameter.empty and (value := _plain(parameter.default)) is not HIDDEN:
            yield f"{path}({parameter.name})", value


def _values(path: str, made: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield a plain value, or the public values of an object and of the library's objects within it."""
    if (own := _plain(made)) is not HIDDEN:
        yield path, own
        return
    library = type(made).__module__.partition(".")[0]
    for name in dir(made):
        if name.startswith("_"):
            continue
        try:
            with warnings.catch_warnings(action="error"):  # a deprecated name has a successor
                value = getattr(made, name)
        except Exception:  # a property of a library may raise anything while it has no value
            continue
        of_library = type(value).__module__.partition(".")[0] == library and not callable(value)
        if _plain(value) is not HIDDEN or (of_library and depth > 1):
            yield from _values(f"{path}.{name}", value, depth - 1)


def _plain(value: Any) -> Any:
    """Return a value as JSON has it, or HIDDEN."""
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else str(value)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, np.ndarray):
        value = value.tolist() if value.size <= MOST else HIDDEN
    if isinstance(value, list | tuple) and len(value) <= MOST:
        parts = [_plain(part) for part in value]
        return HIDDEN if any(part is HIDDEN for part in parts) else parts
    named = getattr(value, "name", None)  # enumerations of compiled libraries
    return named if isinstance(named, str) and hasattr(value, "value") else HIDDEN


def missing(found: Engine) -> list[str]:
    """Return the names of the library that the adapter's files use and the installed version lacks."""
    used = dict.fromkeys(name for path in _sources(found) for name in used_names(path.read_text()))
    return sorted({gap for name in used if (gap := _gap(name))})


def _sources(found: Engine) -> Sequence[Path]:
    """Return the files of an adapter: a package's files, or its one file."""
    file = Path(inspect.getfile(type(found)))
    is_package = type(found).__module__.startswith("crosscheck.engines.") and file.name == "adapter.py"
    return sorted(file.parent.rglob("*.py")) if is_package else [file]


def used_names(source: str) -> Iterator[str]:
    """Yield the dotted names of libraries in a Python file, such as ``mujoco.mjtSolver.mjSOL_CG``."""
    tree, known = ast.parse(source), dict[str, str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            known |= {
                alias.asname or alias.name.partition(".")[0]: alias.name
                if alias.asname
                else alias.name.partition(".")[0]
                for alias in node.names
            }
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            known |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    libraries = {name: path for name, path in known.items() if path.partition(".")[0] not in OTHERS}
    yield from libraries.values()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            name, _, rest = ast.unparse(node).partition(".")
            if name in libraries and rest.replace(".", "").isidentifier():
                yield f"{libraries[name]}.{rest}"


def _gap(name: str) -> str | None:
    """Return the shortest beginning of a dotted name that does not exist, or None."""
    parts = name.split(".")
    for k in range(1, len(parts) + 1):
        part = ".".join(parts[:k])
        try:
            pkgutil.resolve_name(part)
        except (ImportError, AttributeError):
            return part
    return None


if __name__ == "__main__":
    print(json.dumps(facts(sys.argv[1])))
