"""Modules of a run that only some methods need."""

import os
import subprocess
import sys

import pytest

RUN = """
import sys
import mbref
mbref.simulate("spatial_slider_crank_gravity", sys.argv[1], times=[0.0, 0.002])
print(*(name for name in sys.modules if name.startswith("mbref.taylor")))
"""


@pytest.mark.parametrize(("method", "is_used"), [("lm1+projection/rk4", False), ("taylor", True)])
def test_modules_of_taylor_are_loaded_only_by_runs_that_use_them(method, is_used):
    """A new process runs one method and prints the loaded modules of mbref.taylor."""
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    ended = subprocess.run(
        [sys.executable, "-c", RUN, method], env=plain, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert bool(ended.stdout.split()) == is_used
