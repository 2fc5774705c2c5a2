"""Modules of a run that only some methods need, and kernels that are compiled before its clock counts."""

import os
import subprocess
import sys

from mbref.kernels.compilation import Entry
from mbref.taylor.driven import follow_drivers
from mbref.taylor.preparation import kernels_of_series
from mbref.taylor.series import expand_with_loads, expand_without_loads
from mbref.taylor.series_memory import CALLED

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


def test_every_kernel_that_a_series_calls_is_compiled_before_a_run():
    """A missing kernel would compile while the clock of a run counts. A series calls the entries that the
    modules stepper and branches import, and, by their addresses, CALLED and one kernel of orders. The kernels
    of series are all of these but ``follow_drivers``, which the stepper prepares for driven motions."""
    from mbref.taylor import stepper
    from mbref.taylor.crossing import branches

    names, orders = vars(stepper) | vars(branches), {expand_with_loads, expand_without_loads}
    called = {kernel for kernel in names.values() if isinstance(kernel, Entry)}
    assert {*CALLED, *called, *orders} == {*kernels_of_series(), follow_drivers} and called
