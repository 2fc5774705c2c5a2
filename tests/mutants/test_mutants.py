"""Drawn mutants / what each operator makes, and what tests of a tiny package see."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants.__main__ import table
from tests.mutants.drawing import drawn
from tests.mutants.operators import KINDS, mutants, statement

ROOT = Path(__file__).parents[2]
BY_KIND = {
    "sign": ("x = a - b", {"x = ((a) + (b))"}),
    "sign of one": ("x = -a", {"x = (+a)"}),
    "factor": ("x = a * b", {"x = ((a) / (b))"}),
    "comparison": ("x = a < b", {"x = (a <= b)"}),
    "constant": ("x = 3", {"x = 4"}),
    "real constant": ("x = 0.5", {"x = 1.0"}),
    "zero": ("x = 0.0", {"x = 1.0"}),
    "truth": ("x = True", {"x = False"}),
    "index": ("x = a[1]", {"x = a[2]"}),
    "extreme": ("x = np.min(a)", {"x = np.max(a)"}),
    "argument order": ("x = f(a, b)", {"x = f(b, a)"}),
    "statement": ("f(a)", {"pass"}),
    "condition": ("x = a and b", {"x = (a)", "x = (b)"}),
    "condition of a loop": ("x = [a for a in b if a]", {"x = [a for a in b if True]"}),
    "bodies": ("x = a if b else c", {"x = (c if b else a)"}),
    "a product is not a text": ("x = 'a' + b", set()),
    "annotations": ("x: f[1] = a", set()),
    "documentation": ('def f():\n    """Return 3."""', set()),
    "a formatted text": ("x = f'{3} {a - b}'", set()),
    "imports for types": ("if TYPE_CHECKING:\n    import a", set()),
    "equal arguments": ("x = f(a, a)", set()),
    "arguments in any order": ("x = np.hypot(a, b)", set()),
    "umlauts before the place": ("x = 'ä', a - b", {"x = 'ä', ((a) + (b))"}),
}
SUMS = """def total(a, b):
    return a + b


def idle(a, b):
    return a * b


def wait(n):
    while n > 0:
        n -= 1
"""
TESTS = """import os
from mbref.sums import {0}

def test_{0}():
    assert os.environ["NUMBA_DISABLE_JIT"] == "1"
    {1}
"""


@pytest.mark.parametrize("name", BY_KIND)
def test_operator_makes_the_stated_changes_of_a_source(name):
    source, expected = BY_KIND[name]
    assert {m.planted(source) for m in mutants("a.py", source)} == expected


def test_every_mutant_differs_from_its_source_and_compiles():
    path = "mbref/energy.py"
    source = (ROOT / path).read_text()
    made = mutants(path, source)
    assert {m.kind for m in made} <= set(KINDS) and len(made) > 20
    for mutant in made:
        assert mutant.planted(source) != source, mutant
        compile(mutant.planted(source), path, "exec")


def test_random_mutants_depend_on_the_seed_alone():
    first, again, other = (drawn(ROOT, seed, 20, ["mbref/drawing"]) for seed in (1, 1, 2))
    assert first == again and len(set(first)) == 20 and set(first) != set(other)
    assert all(mutant.file.startswith("mbref/drawing/") for mutant in first)


def test_lines_of_a_statement_end_before_the_statements_inside_it():
    source = "x = f(\n    1,\n)\nif (\n    x\n):\n    y = 2\n"
    assert [*statement(source, 2)] == [1, 2, 3]
    assert [*statement(source, 5)] == [4, 5, 6] and [*statement(source, 7)] == [7]


def test_killed_mutants_are_counted_by_folder():
    results = [("mbref/taylor/crossing/a.py", True), ("mbref/taylor/b.py", False), ("mbref/c.py", True)]
    assert [*table(results)] == [
        "mbref: 1 of 1 killed (100%)",
        "mbref/taylor: 1 of 2 killed (50%)",
        "all: 2 of 3 killed (67%)",
    ]


@pytest.mark.slow
def test_mutant_of_a_small_package_is_killed_by_the_test_that_runs_its_line(tmp_path):
    """A sum is tested, a product is not (3 · 1 = 3 / 1), and a mutant that loops for ever counts as
    killed."""
    for name in ("mutants", "__init__.py"):
        (tmp_path / "tests").mkdir(exist_ok=True)
        (tmp_path / "tests" / name).symlink_to(ROOT / "tests" / name)
    for name, text in {
        "mbref/__init__.py": "",
        "mbref/sums.py": SUMS,
        "tests/doors/test_total.py": TESTS.format("total", "assert total(2, 3) == 5"),
        "tests/doors/test_idle.py": TESTS.format("idle", "assert idle(3, 1) == 3"),
        "tests/doors/test_wait.py": TESTS.format("wait", "wait(3)"),
        "tests/doors/test_broken.py": TESTS.format("total", "assert not total(2, 3)"),
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    command = [sys.executable, "-m", "tests.mutants", "--count", "20", "--budget", "4"]
    own = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # crosscheck's plugin imports the real mbref
    done = subprocess.run(command, cwd=tmp_path, env=own, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert "left out, since it fails without a mutant: tests/doors/test_broken.py::test_total" in lines
    assert any("killed mbref/sums.py:2 tests/doors/test_total.py::test_total" in line for line in lines)
    assert any("killed mbref/sums.py:11 an endless loop" in line for line in lines)
    assert "mbref/sums.py:6 factor, survived" in lines and "-    return a * b" in lines
    assert (tmp_path / "mbref" / "sums.py").read_text() == SUMS
