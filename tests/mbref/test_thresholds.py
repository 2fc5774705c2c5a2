"""Thresholds at singular positions: one table, a check of each, and crossings without compiled kernels."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mbref.taylor.crossing import thresholds
from tests.mbref import interpreted_thresholds

NAMES = [name for name in vars(thresholds) if name.isupper()]
CHECKS = Path(interpreted_thresholds.__file__)


def interpreted(*arguments: str) -> subprocess.CompletedProcess:
    """A process of Python whose kernels are interpreted."""
    return subprocess.run(
        [sys.executable, *arguments],
        check=False,
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parents[2],
    )


def test_the_table_has_a_unit_and_a_reason_for_every_threshold():
    rows = [line for line in Path(thresholds.__file__).read_text().splitlines() if " = " in line]
    assert [row.split(" = ")[0] for row in rows] == NAMES
    assert all(re.fullmatch(r".+  # [^:]+: .+", row) for row in rows), rows


def test_each_decision_changes_at_its_threshold_and_each_check_fails_when_that_moves():
    done = interpreted("-m", "pytest", "-q", "-p", "no:cacheprovider", str(CHECKS))
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert f"{3 * len(NAMES)} passed" in done.stdout, done.stdout[-500:]


@pytest.mark.parametrize(
    "files",
    [
        (
            "interpreted_at_limits",
            "interpreted_code_of_systems",
            "interpreted_crossings",
            "interpreted_decisions",
            "interpreted_drivers",
            "interpreted_equations",
            "interpreted_formulations",
            "interpreted_integrators",
            "interpreted_linear_algebra",
            "interpreted_loads",
            "interpreted_parts_of_steps",
            "interpreted_pivots",
            "interpreted_projection",
            "interpreted_series",
            "interpreted_solutions",
            "interpreted_states",
            "test_kernels_by_hand",
            "test_written_code",
        ),
        pytest.param(("test_short_runs", "interpreted_commands"), marks=pytest.mark.slow),
    ],
    ids=["parts", "runs"],
)
def test_interpreted_kernels_do_what_they_say(files):
    paths = [str(CHECKS.with_name(f"{name}.py")) for name in files]
    done = interpreted("-m", "pytest", "-q", "-p", "no:cacheprovider", *paths)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert " passed" in done.stdout and "skipped" not in done.stdout, done.stdout[-500:]
