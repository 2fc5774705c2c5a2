"""The house rules as tests: import arrows, file sizes, docstrings, tables told in the README."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

from mbref.formulations import FORMULATIONS
from mbref.integrators import INTEGRATORS
from mbref.scenes import SCENES
from mbref.stabilisation import STABILISATIONS

ROOT = Path(__file__).parents[2]
PACKAGES = ("mbref", "crosscheck", "reports")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
MAY_IMPORT = {"mbref": {"mbref"}, "crosscheck": {"crosscheck", "mbref"}, "reports": set(PACKAGES)}
ENGINE_PACKAGES = {"mujoco", "pinocchio", "exudyn", "opensim", "pyondsel", "sksundae", "casadi"}
LONGEST = 330  # lines of a file


def imports(path, inside_functions=True):
    """Top-level names that a file imports; without those inside functions if asked."""
    tree = ast.parse(path.read_text())
    nodes = ast.walk(tree) if inside_functions else tree.body
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield (node.module or "").partition(".")[0]


def name(path):
    return str(path.relative_to(ROOT))


def test_there_are_files_to_judge():
    assert len(FILES) > 50


@pytest.mark.parametrize("path", FILES, ids=name)
def test_import_direction(path):
    package = path.relative_to(ROOT).parts[0]
    upward = (set(imports(path)) & {*PACKAGES, "tests"}) - MAY_IMPORT[package]
    assert not upward, f"{name(path)} imports {upward}, against reports → crosscheck → mbref"


@pytest.mark.parametrize("path", FILES, ids=name)
def test_engines_only_in_their_adapters_and_inside_functions(path):
    found = set(imports(path)) & ENGINE_PACKAGES
    allowed = path.is_relative_to(ROOT / "crosscheck" / "engines")
    assert allowed or not found, f"{name(path)} imports {found}"
    at_import = set(imports(path, inside_functions=False)) & ENGINE_PACKAGES
    assert not at_import, f"{name(path)} loads {at_import} when it is imported"


@pytest.mark.parametrize("path", [f for f in FILES if "reports" not in f.parts], ids=name)
def test_plotting_only_in_reports_and_in_the_plot_of_a_motion(path):
    allowed = path == ROOT / "mbref" / "drawing" / "plot.py"
    assert allowed or "matplotlib" not in set(imports(path)), name(path)
    assert "matplotlib" not in set(imports(path, inside_functions=False)), name(path)


@pytest.mark.parametrize("path", FILES, ids=name)
def test_length_and_first_line(path):
    text = path.read_text()
    assert len(text.splitlines()) <= LONGEST, f"{name(path)} has {len(text.splitlines())} lines"
    first = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
    assert len(first) > 10, f"{name(path)} does not begin by saying what it is"


@pytest.mark.parametrize("path", FILES, ids=name)
def test_public_functions_say_what_they_do(path):
    kernels = {"accelerate", "enter", "rates", "accept", "step", "propose"}  # contract on the base class
    silent = [
        node.name
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and not node.name.startswith("_")
        and node.name not in kernels
        and not ast.get_docstring(node)
    ]
    assert not silent, f"{name(path)}: no docstring on {silent}"


@pytest.mark.parametrize("table", [FORMULATIONS, STABILISATIONS], ids=["formulations", "stabilisations"])
def test_documentation_tells_every_method(table):
    told = set(re.findall(r"^\| `([\w-]+)`", (ROOT / "docs" / "methods.md").read_text(), flags=re.M))
    assert set(table) <= told, f"docs/methods.md does not tell {set(table) - told}"


def test_readme_is_short_and_its_links_lead_somewhere():
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 160, len(text.splitlines())
    for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        links = re.findall(r"\]\(([^)#:]+)\)", path.read_text())
        there = [link for link in links if "figures/" not in link]  # made by docs/hooks.py
        missing = [link for link in there if not (path.parent / link).exists()]
        assert not missing, f"{path.name} links to {missing}"


def test_every_integrator_and_scene_has_its_own_name():
    assert all(key == integrator.name for key, integrator in INTEGRATORS.items())
    assert all(key == make().name for key, make in SCENES.items())


def test_readme_commands_are_what_the_gate_runs():
    gate = (ROOT / ".ci" / "run").read_text()
    assert "README.md" in gate
    commands = re.findall(r"^python3 -m venv .*$", (ROOT / "README.md").read_text(), flags=re.M)
    assert len(commands) == 2, commands
    assert "'.[dev]'" in commands[1], f"{commands[1]} does not install the linters that the gate runs"
    for check in ("ruff format --check", "ruff check", "mypy"):
        assert f".venv/bin/{check}" in gate, f"the gate does not run {check}"


def test_slow_tests_are_left_out_unless_asked_for():
    options = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
    assert "not slow" in options["addopts"], options["addopts"]
    assert '-m "slow or not slow"' in (ROOT / "Makefile").read_text(), "make deep leaves slow tests out"


def test_versions_are_pinned_without_addresses():
    lines = [
        line for line in (ROOT / "constraints.txt").read_text().splitlines() if line[:1] not in ("#", "")
    ]
    wrong = [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.]+( ;.*)?", line)]
    assert not wrong, wrong
