"""Names that crosscheck exports / the objects behind them, and what a third party's engine imports."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import crosscheck
from crosscheck import engine

TINY = Path(__file__).parents[2] / "examples" / "tiny_engine" / "tiny_engine.py"


@pytest.mark.parametrize("name", crosscheck.__all__)
def test_every_exported_name_is_there(name: str) -> None:
    assert getattr(crosscheck, name) is not None and name in dir(crosscheck)


def test_names_of_functions_and_of_modules_do_not_collide() -> None:
    assert crosscheck.find_engine("mbref").name == "mbref"
    assert crosscheck.run_study is crosscheck.study.study
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        crosscheck.nothing  # noqa: B018


def test_importing_crosscheck_loads_nothing() -> None:
    code = "import sys, crosscheck; print(sorted({m.partition('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'numpy'" not in loaded and "'numba'" not in loaded and "'mbref'" not in loaded, loaded


def test_an_engine_in_the_working_directory_is_found(tmp_path, monkeypatch) -> None:
    (tmp_path / "beside_me.py").write_text("from crosscheck.engines.mbref import ENGINE\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    assert engine.engine("beside_me:ENGINE").name == "mbref"


def test_an_engine_needs_one_module() -> None:
    """The example imports from crosscheck.engine alone, beside numpy and the standard library."""
    found = {
        node.module for node in ast.walk(ast.parse(TINY.read_text())) if isinstance(node, ast.ImportFrom)
    }
    assert found == {"crosscheck.engine"}, found
    assert all(hasattr(engine, name) for name in engine.__all__)
