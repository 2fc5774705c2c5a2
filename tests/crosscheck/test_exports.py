"""Names that crosscheck exports, the cost of its import, and the module that a third party's engine needs."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import crosscheck
from crosscheck import engine

TINY = Path(__file__).parents[2] / "examples" / "tiny_engine" / "tiny_engine.py"


@pytest.mark.parametrize("name", crosscheck.__all__)
def test_every_exported_name_exists_and_is_listed(name: str) -> None:
    """Names of ``crosscheck.__all__`` are imported at their first use; ``dir`` lists them before."""
    assert getattr(crosscheck, name) is not None and name in dir(crosscheck)


def test_crosscheck_exports_functions_beside_its_modules_engine_and_study() -> None:
    """`find_engine` and `run_study` are exported under other names than their modules."""
    assert crosscheck.find_engine("mbref").name == "mbref"
    assert crosscheck.run_study is crosscheck.study.study


def test_importing_crosscheck_imports_neither_numpy_nor_numba_nor_mbref() -> None:
    """A new process prints the packages that ``import crosscheck`` has loaded."""
    code = "import sys, crosscheck; print(sorted({m.partition('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'numpy'" not in loaded and "'numba'" not in loaded and "'mbref'" not in loaded, loaded


def test_an_engine_in_the_working_directory_is_found(tmp_path, monkeypatch) -> None:
    """The path of modules has no entry "" for the working directory, as in an installed program."""
    (tmp_path / "beside_me.py").write_text("from crosscheck.engines.mbref import ENGINE\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    assert engine.engine("beside_me:ENGINE").name == "mbref"


def test_the_example_engine_imports_from_crosscheck_engine_alone() -> None:
    """Statements ``from … import`` name this module only; other imports are numpy and the standard
    library."""
    found = {n.module for n in ast.walk(ast.parse(TINY.read_text())) if isinstance(n, ast.ImportFrom)}
    assert found == {"crosscheck.engine"}, found
