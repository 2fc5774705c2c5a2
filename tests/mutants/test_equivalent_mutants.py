"""Mutants that change nothing / sources worked out by hand."""

from __future__ import annotations

from tests.mutants.equivalent import FOR_TYPES, ZERO_TIMES, reason
from tests.mutants.operators import mutants


def test_zero_times_a_vector_is_zero_wherever_the_vector_is():
    source = "x = 0.0 * load(a.b, 0) + load(a.b, 0) + 1.0 * load(a, 0)\n"
    found = [m for m in mutants("mbref/a.py", source) if (m.old, m.new) == ("0", "1")]
    assert [reason(m, source) == ZERO_TIMES for m in found] == [True, False, False]


def test_a_type_variable_is_for_type_checkers():
    source = 'Part = TypeVar("Part", A, B)\nx = f("Part", A)\n'
    found = [m for m in mutants("mbref/a.py", source) if m.kind == "argument order"]
    assert {m.line: reason(m, source) == FOR_TYPES for m in found} == {1: True, 2: False}
