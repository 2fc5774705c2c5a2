"""Mutants that change nothing / sources worked out by hand."""

from __future__ import annotations

from tests.mutants.equivalent import ZERO_TIMES, reason
from tests.mutants.operators import mutants


def test_zero_times_a_vector_is_zero_wherever_the_vector_is():
    source = "x = 0.0 * load(a.b, 0) + load(a.b, 0) + 1.0 * load(a, 0)\n"
    found = [m for m in mutants("mbref/a.py", source) if (m.old, m.new) == ("0", "1")]
    assert [reason(m, source) == ZERO_TIMES for m in found] == [True, False, False]
