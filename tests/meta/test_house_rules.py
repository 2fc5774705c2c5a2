"""The house rules as tests: imports, sizes of files, docstrings, names, links of pages, slow tests."""

import ast
import functools
import re
import tomllib
from pathlib import Path

import pytest

from mbref.integrators import INTEGRATORS
from mbref.scenes import SCENES
from tests.meta.imports import parsed, statements

ROOT = Path(__file__).parents[2]
PACKAGES = ("mbref", "crosscheck", "reports")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
MAY_IMPORT = {"mbref": {"mbref"}, "crosscheck": {"crosscheck", "mbref"}, "reports": set(PACKAGES)}
ENGINE_PACKAGES = {"mujoco", "pinocchio", "exudyn", "opensim", "pyondsel", "sksundae", "casadi", "heyoka"}
LONGEST = 330  # lines of a file
MOST_SKIPS = 60  # marks in the repository that keep a layout from the formatter


@functools.cache
def imports(path, inside_functions=True):
    """Return the top-level names that a file imports; without imports inside functions if requested."""
    names = set()
    for node in statements(path) if inside_functions else parsed(path).body:
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add((node.module or "").partition(".")[0])
    return names


def files(package):
    return [path for path in FILES if path.is_relative_to(ROOT / package)]


def name(path):
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("package", PACKAGES)
def test_package_imports_only_packages_below_it(package):
    """MAY_IMPORT has the rule reports → crosscheck → mbref; no package imports tests."""
    theirs = {*PACKAGES, "tests"} - MAY_IMPORT[package]
    upward = {name(path): found for path in files(package) if (found := imports(path) & theirs)}
    assert not upward, f"{upward}, against reports → crosscheck → mbref"


def test_engine_is_imported_only_in_adapters_and_inside_functions():
    """crosscheck works where an engine is not installed."""
    adapters = ROOT / "crosscheck" / "engines"
    elsewhere = [path for path in FILES if not path.is_relative_to(adapters)]
    outside = {name(path): found for path in elsewhere if (found := imports(path) & ENGINE_PACKAGES)}
    assert not outside, outside
    assert set().union(*map(imports, FILES)) >= ENGINE_PACKAGES, "imports that this rule does not see"
    at_import = {name(path): found for path in FILES if (found := imports(path, False) & ENGINE_PACKAGES)}
    assert not at_import, f"loaded when the file is imported: {at_import}"


def test_matplotlib_is_imported_only_by_reports_and_the_plot_of_a_motion():
    """The plot imports it inside a function, so that mbref runs without it."""
    others = [path for path in FILES if "reports" not in path.parts]
    plotting = [path for path in others if "matplotlib" in imports(path)]
    assert plotting == [ROOT / "mbref" / "motions" / "drawing" / "plot.py"], plotting
    assert not [name(path) for path in plotting if "matplotlib" in imports(path, False)]


def test_file_has_at_most_330_lines():
    """More than 50 files of the three packages are counted."""
    lengths = {name(path): len(path.read_text().splitlines()) for path in FILES}
    assert len(lengths) > 50 and not {path: length for path, length in lengths.items() if length > LONGEST}


def test_at_most_60_lines_are_kept_from_the_formatter():
    """The mark at the end of a statement keeps the layout of this statement."""
    folders = (*PACKAGES, "tests", "benchmarks", "examples", "docs")
    sources = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    marked = {name(path): count for path in sources if (count := path.read_text().count("# fmt: " + "skip"))}
    assert sum(marked.values()) <= MOST_SKIPS, f"{sum(marked.values())} marks, at most {MOST_SKIPS}: {marked}"


def test_file_has_a_docstring_of_more_than_ten_characters():
    """The first line counts: ten characters say nothing."""
    first = {name(path): (ast.get_docstring(parsed(path)) or "").partition("\n")[0] for path in FILES}
    assert not [path for path, line in first.items() if len(line) <= 10]


@pytest.mark.parametrize("package", PACKAGES)
def test_public_function_and_class_has_a_docstring(package):
    """Functions and classes of a module itself. Kernels of methods have theirs on the base class."""
    kernels = {"accelerate", "enter", "rates", "accept", "step", "propose"}  # contract on the base class
    silent = [
        f"{name(path)}: {node.name}"
        for path in files(package)
        for node in parsed(path).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and not node.name.startswith("_")
        and node.name not in kernels
        and not ast.get_docstring(node)
    ]
    assert not silent, silent


def test_a_name_of_a_function_has_one_meaning_in_mbref():
    """No two files define different functions of one name, except the interfaces of methods and integrators,
    and functions that serve several kinds of arrays or files."""
    interface = {"accelerate", "accept", "add", "enter", "first_step", "propose", "rates", "step"}
    alike = {"cross", "dot", "iterate", "largest", "norm", "prepare", "read", "unit", "write"}
    bodies: dict[str, set[str]] = {}
    for node in (node for path in files("mbref") for node in parsed(path).body):
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            bodies.setdefault(node.name, set()).add(ast.dump(node))
    double = {word for word, different in bodies.items() if len(different) > 1}
    assert double == interface | alike, double ^ (interface | alike)


def definitions(path):
    """Yield the names of public classes and constants of a file with their definitions."""
    for node in parsed(path).body:
        if isinstance(node, ast.ClassDef):
            yield node.name, ast.dump(node)
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value:
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                pairs = [(target, node.value)]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = list(zip(target.elts, node.value.elts, strict=False))
                yield from ((ast.unparse(each), ast.dump(value)) for each, value in pairs)


def test_a_name_of_a_class_or_constant_has_one_meaning_in_mbref():
    """No two files define different classes or constants of one name, except the names that each method and
    each kind of generated code must define. Scenes are left out."""
    interface = {"ABOUT", "Options", "Scratch", "Stages", "POINTERS"}
    meanings: dict[str, set[str]] = {}
    for path in files("mbref"):
        for word, meaning in definitions(path) if path.parent.name != "scenes" else ():
            if word.isidentifier() and not word.startswith("_"):
                meanings.setdefault(word, set()).add(meaning)
    double = {word for word, different in meanings.items() if len(different) > 1}
    assert double == interface, double ^ interface


def test_readme_has_at_most_120_lines():
    """120 lines are three screens."""
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120


def test_links_of_readme_and_docs_to_files_lead_to_files():
    """Links to figures are left out: docs/hooks.py draws them."""
    for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        links = re.findall(r"\]\(([^)#:]+)\)", path.read_text())
        there = [link for link in links if "figures/" not in link]
        missing = [link for link in there if not (path.parent / link).exists()]
        assert not missing, f"{path.name} links to {missing}"


def test_key_of_every_integrator_and_scene_is_its_name():
    """INTEGRATORS and SCENES are the tables that command lines look names up in."""
    assert all(key == integrator.name for key, integrator in INTEGRATORS.items())
    assert all(key == make().name for key, make in SCENES.items())


def test_gate_reads_its_commands_from_the_readme_and_runs_the_linters():
    """README's second command installs the linters, which .ci/run calls in that environment."""
    gate = (ROOT / ".ci" / "run").read_text()
    assert "README.md" in gate
    commands = re.findall(r"^python3 -m venv .*$", (ROOT / "README.md").read_text(), flags=re.M)
    assert len(commands) == 2, commands
    assert "'.[dev]'" in commands[1], f"{commands[1]} does not install the linters that the gate runs"
    for check in ("ruff format --check", "ruff check", "mypy"):
        assert f".venv/bin/{check}" in gate, f"the gate does not run {check}"


def test_slow_tests_are_left_out_by_default_and_run_by_make_deep():
    """The default options of pytest, and the options in the Makefile."""
    options = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
    assert "not slow" in options["addopts"], options["addopts"]
    assert '-m "slow or not slow"' in (ROOT / "Makefile").read_text(), "make deep leaves slow tests out"


def test_list_of_slow_cases_names_existing_tests():
    """More than 50 files are listed. conftest.py checks the cases when all tests are collected."""
    listed = tomllib.loads((ROOT / "tests" / "slow.toml").read_text())
    assert len(listed) > 50
    for file, tests in listed.items():
        path = ROOT / "tests" / file
        defined = set(re.findall(r"^def (test_\w+)", path.read_text(), re.M)) if path.exists() else set()
        assert set(tests) <= defined, f"tests/slow.toml lists {set(tests) - defined}, not in {file}"


def test_constraints_pin_exact_versions_without_addresses():
    """A line is NAME==VERSION, perhaps for a platform; comments and blank lines are left out."""
    lines = [
        line for line in (ROOT / "constraints.txt").read_text().splitlines() if line[:1] not in ("#", "")
    ]
    wrong = [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.]+( ;.*)?", line)]
    assert not wrong, wrong
