"""Sums and products of instructions, with texts in place of vectors."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from llvmlite import ir

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


def test_arrays_of_a_function_do_not_overlap():
    """Two arrays of doubles and one of integers; a number has no such attribute."""
    module = ir.Module()
    write = Instructions(module, "f", 2, 1, 1)
    write.end()
    assert len(write.pointers) == 3 and len(write.counts) == 1
    [signature] = [line for line in str(module).splitlines() if line.startswith("define")]
    arguments = signature.partition("(")[2].split(", ")
    assert [("noalias" in argument, argument.split()[0]) for argument in arguments] == [
        (True, "double*"),
        (True, "double*"),
        (True, "i64*"),
        (False, "i64"),
    ]
