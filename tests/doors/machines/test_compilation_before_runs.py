"""Kernels are compiled before the clock of a run counts."""

from mbref.kernels.compilation import Entry
from mbref.taylor.driven import follow_drivers
from mbref.taylor.preparation import kernels_of_series
from mbref.taylor.series import expand_with_loads, expand_without_loads
from mbref.taylor.series_memory import CALLED


def test_every_kernel_that_a_series_calls_is_compiled_before_a_run():
    """A missing kernel would compile while the clock of a run counts. A series calls the entries that the
    modules stepper and branches import, and, by their addresses, CALLED and one kernel of orders. The kernels
    of series are all of these but ``follow_drivers``, which the stepper prepares for driven motions."""
    from mbref.taylor import stepper
    from mbref.taylor.crossing import branches

    names, orders = vars(stepper) | vars(branches), {expand_with_loads, expand_without_loads}
    called = {kernel for kernel in names.values() if isinstance(kernel, Entry)}
    assert {*CALLED, *called, *orders} == {*kernels_of_series(), follow_drivers} and called
