"""Kernels as plain Python (``NUMBA_DISABLE_JIT=1``, for debugging) give the states of compiled kernels. Plain
Python also refuses an index beyond an array, which compiled code does not notice."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import mbref
from tests.helpers.short_motions import MOTIONS

ROOT = Path(__file__).parents[3]
ROUNDING = 2.2e-16
METHODS = ("taylor", "alf-dual+projection", "mpi-qr+partitioning/adams")
NAMES = (
    *("arm with universal", "arm with distance", "loop with inline", "four hinges"),
    *("pendulum with spring with damping", "pendulum with moment that is switched"),
    *("driven angle by a sine", "driven slide", "planet with armatures", "screw with armature"),
    *("free bodies and a spring", "planar_slider_crank_equal"),
)
FIELDS = ("position", "orientation", "velocity", "angular_velocity", "acceleration")
PROGRAM = (
    "import json, sys\n"
    "from tests.doors.motion.test_kernels_in_plain_python import states\n"
    "print(json.dumps(states(sys.argv[1:])))"
)


def states(names: Sequence[str]) -> dict[str, dict[str, list]]:
    """Return the states of the motions by all methods after a tenth of their duration, and the outcomes."""
    found = {}
    for name in names:
        scene = MOTIONS[name]()
        for method in METHODS:
            run = mbref.simulate(scene, method, times=[0.1 * scene.duration], rtol=1e-5)
            arrays = {field: np.asarray(getattr(run, field)).tolist() for field in FIELDS}
            found[f"{name} by {method}"] = {"outcome": run.outcome.name, "steps": run.cost.steps, **arrays}
    return found


@pytest.mark.parametrize("names", [NAMES[::4], pytest.param(NAMES, marks=pytest.mark.slow)], ids=["few", ""])
def test_plain_and_compiled_kernels_agree_to_rounding(names):
    """Outcomes and numbers of steps are equal, and states to 100 roundings in each step and 20 more steps:
    compiled code rounds otherwise, by fused multiply-adds."""
    command, uncompiled = [sys.executable, "-c", PROGRAM, *names], {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, cwd=ROOT, env=uncompiled, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    plain, compiled = json.loads(done.stdout), states(names)
    for run, expected in compiled.items():
        found = plain[run]
        assert (found["outcome"], found["steps"]) == ("COMPLETED", expected["steps"]), run
        for field in FIELDS:
            one, other = np.array(found[field]), np.array(expected[field])
            limit = 100 * ROUNDING * (20 + expected["steps"]) * max(1.0, np.abs(other).max())
            assert np.abs(one - other).max() <= limit, f"{run}: {field}"
