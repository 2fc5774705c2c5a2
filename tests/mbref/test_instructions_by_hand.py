"""Sums and products of instructions, with texts in place of vectors."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.taylor.generated.instructions import WIDTH, Instructions


def instructions() -> Any:
    found: Any = Instructions.__new__(Instructions)
    found._builder = SimpleNamespace(
        fadd=lambda one, other, flags: f"({one}+{other})", fmul=lambda one, other, flags: f"{one}*{other}"
    )
    return found


@pytest.mark.parametrize(
    ("vectors", "total"),
    [
        ("ab", "(a+b)"),
        ("abc", "((a+b)+c)"),
        ("abcd", "((a+b)+(c+d))"),
        ("abcdef", "(((a+e)+(b+f))+(c+d))"),
        ("a", "a"),
    ],
)
def test_a_sum_is_added_up_in_four_chains(vectors, total):
    assert instructions().total(list(vectors)) == total


def test_a_sum_of_nothing_is_zero():
    zero = instructions().total([])
    assert [number.constant for number in zero.constant] == [0.0] * WIDTH


def test_no_product_with_ones():
    assert instructions().times(np.ones(WIDTH), "a") == "a"
    assert instructions().times(np.arange(WIDTH), "a").endswith("*a")
