"""Modules of a run that only some methods need."""

import os
import subprocess
import sys

RUN = """
import sys
import mbref
for method in ("lm1+projection/rk4", "taylor"):
    mbref.simulate("spatial_slider_crank_gravity", method, times=[0.0, 0.002])
    print(any(name.startswith("mbref.taylor") for name in sys.modules))
"""


def test_modules_of_taylor_are_loaded_only_by_runs_that_use_them():
    """A process runs another method, then taylor, and prints whether it has modules of mbref.taylor."""
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    words = [sys.executable, "-c", RUN]
    printed = subprocess.check_output(words, env=plain, text=True)
    assert printed.split() == ["False", "True"]
