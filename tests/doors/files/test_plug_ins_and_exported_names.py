"""The engine of examples/tiny_engine as an installed plug-in, and the names that crosscheck exports."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import crosscheck
from crosscheck import engine
from crosscheck.cli.commands import main
from crosscheck.engine import ENTRY_POINTS, engine_names
from crosscheck.study.fair_timing import identity_cases
from mbref.scenes import SCENES

ROOT = Path(__file__).parents[3]
TINY = ROOT / "examples" / "tiny_engine"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tiny engine as pip leaves it: its module, and metadata with the entry points of its project."""
    project = tomllib.loads((TINY / "pyproject.toml").read_text())["project"]
    info = tmp_path / f"tiny_engine-{project['version']}.dist-info"
    info.mkdir()
    header = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (info / "METADATA").write_text(header)
    points = [f"{name} = {target}" for name, target in project["entry-points"][ENTRY_POINTS].items()]
    (info / "entry_points.txt").write_text("\n".join([f"[{ENTRY_POINTS}]", *points, ""]))
    monkeypatch.syspath_prepend(str(TINY))
    monkeypatch.syspath_prepend(str(tmp_path))


def test_list_names_an_installed_plug_in_with_its_version(installed, capsys):
    """``crosscheck list engines`` prints engine, package and version of the example's pyproject.toml."""
    assert "tiny" in engine_names(), engine_names()
    assert main(["list", "engines"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"tiny\s*│\s*tiny-engine\s*│\s*0\.1", out), out


def test_short_runs_that_compare_models_compile_no_code():
    """Before a comparison each engine runs the scene briefly, by one family. Names of families that compile
    code end in "compiled" or "generated"; those that are chosen compile none."""
    found = identity_cases(SCENES["four_bar_gravity"](), ["mbref", "mujoco", "pinocchio"], 60.0)
    assert [case.setting.family for case in found] == ["taylor", "tuned", "tuned"]


@pytest.mark.parametrize("scene", ["free_fall", pytest.param("pendulum", marks=pytest.mark.slow)])
def test_verify_passes_the_tiny_plug_in_and_lists_the_spatial_scene_that_it_refuses(installed, capsys, scene):
    """Exit status 0: no check of the example engine, which is planar, fails."""
    assert main(["verify", "tiny", "--scene", scene, "--scene", "spatial_slider_crank"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"\b0 fail", out) and "cannot: spatial_slider_crank" in out, out


@pytest.mark.parametrize("name", crosscheck.__all__)
def test_every_exported_name_exists_and_is_listed(name: str) -> None:
    """Names of ``crosscheck.__all__`` are imported at their first use; ``dir`` lists them."""
    assert getattr(crosscheck, name) is not None and name in dir(crosscheck)


def test_crosscheck_exports_functions_beside_its_modules_engine_and_study() -> None:
    """The functions `engine` and `study` are exported under other names than their modules."""
    assert crosscheck.find_engine("mbref").name == "mbref"
    assert crosscheck.run_study is crosscheck.study.study


def test_importing_crosscheck_imports_neither_numpy_nor_numba_nor_mbref() -> None:
    """A new process prints the packages that ``import crosscheck`` has loaded."""
    code = "import sys, crosscheck; print(sorted({m.partition('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'numpy'" not in loaded and "'numba'" not in loaded and "'mbref'" not in loaded, loaded


def test_an_engine_in_the_working_directory_is_found(tmp_path, monkeypatch) -> None:
    """Python's path of modules has no entry "" for this directory, as in an installed program."""
    (tmp_path / "beside_me.py").write_text("from crosscheck.engines.mbref import ENGINE\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    assert engine.engine("beside_me:ENGINE").name == "mbref"


def test_the_example_engine_imports_from_crosscheck_engine_alone() -> None:
    """Statements ``from … import`` name this module only; others are numpy and the standard library."""
    nodes = ast.walk(ast.parse((TINY / "tiny_engine.py").read_text()))
    found = {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    assert found == {"crosscheck.engine"}, found
