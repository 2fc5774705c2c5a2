"""Types: mypy is strict for each file without a kernel, whose types numba finds."""

import ast
import tomllib
from pathlib import Path

from tests.meta.imports import ROOT, sources, statements

DECORATORS = {"kernel", "inlined", "allocating", "entry", "exchangeable", "intrinsic", "njit", "c_function"}


def has_kernels(path: Path) -> bool:
    """Whether a file defines a function that numba compiles."""
    functions = (node for node in statements(path) if isinstance(node, ast.FunctionDef))
    decorators = (d.func if isinstance(d, ast.Call) else d for f in functions for d in f.decorator_list)
    return any(isinstance(d, ast.Name) and d.id in DECORATORS for d in decorators)


def test_mypy_ignores_exactly_the_files_with_kernels():
    """pyproject.toml lists them; a kernel has one of the decorators in DECORATORS."""
    overrides = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]["overrides"]
    ignored = {name for o in overrides if o.get("ignore_errors") for name in o["module"]}
    modules = {**sources("mbref"), **sources("crosscheck"), **sources("reports")}
    assert ignored == {name for name, path in modules.items() if has_kernels(path)}
