"""Random mutants differ from their source and compile, and tests of a tiny package kill them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants.drawing import drawn
from tests.mutants.operators import KINDS, mutants

ROOT = Path(__file__).parents[2]
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


def test_every_mutant_differs_from_its_source_and_compiles():
    """Each of more than 20 mutants of one file; KINDS are the kinds of changes."""
    path = "mbref/motions/energy.py"
    source = (ROOT / path).read_text()
    made = mutants(path, source)
    assert {m.kind for m in made} <= set(KINDS) and len(made) > 20
    for mutant in made:
        assert mutant.planted(source) != source, mutant
        compile(mutant.planted(source), path, "exec")


def test_random_mutants_depend_on_the_seed_alone():
    """Two draws of 20 by seed 1 are equal, by seed 2 they differ; all are from the folder asked for."""
    first, again, other = (drawn(ROOT, seed, 20, ["mbref/motions/drawing"]) for seed in (1, 1, 2))
    assert first == again and len(set(first)) == 20 and set(first) != set(other)
    assert all(mutant.file.startswith("mbref/motions/drawing/") for mutant in first)


@pytest.mark.slow
def test_mutant_of_a_small_package_is_killed_by_the_test_that_runs_its_line(tmp_path):
    """total(2, 3) is tested. The test of the product, 3 · 1, passes with the quotient, too: this mutant
    survives. One that loops for ever is killed; a test that fails without mutants is left out."""
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
    command = [sys.executable, "-m", "tests.mutants", "--count", "20", "--budget", "30"]
    own = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # crosscheck's plugin imports the real mbref
    done = subprocess.run(command, cwd=tmp_path, env=own, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert "left out, since it fails or takes 10 CPU s: tests/doors/test_broken.py::test_total" in lines
    assert any("killed mbref/sums.py:2 tests/doors/test_total.py::test_total" in line for line in lines)
    assert any("killed mbref/sums.py:11 an endless loop" in line for line in lines)
    assert "mbref/sums.py:6 factor, survived" in lines and "-    return a * b" in lines
    assert (tmp_path / "mbref" / "sums.py").read_text() == SUMS
