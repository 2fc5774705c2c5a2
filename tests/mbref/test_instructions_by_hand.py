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


@pytest.mark.parametrize(
    ("lanes", "numbers", "sources"),
    [
        ([0, 3, 7, 1], [0, 3, 7, 1], [(0, 0)]),
        ([9, -1, 15, 8], [11, None, 17, 10], [(1, 1)]),
        ([9, -1, 2, 0], [11, None, 2, 0], [(0, 1)]),
        ([17, 9, 2, -1, 23], [21, 11, 2, None, 27], [(0, 1), (None, 2)]),
        ([23, 16, -1, 9], [27, 20, None, 11], [(1, 2)]),
    ],
)
def test_numbers_are_gathered_from_no_more_vectors_than_needed(lanes, numbers, sources):
    """Vectors of 0 to 7, 10 to 17 and 20 to 27; lane -1 stands for a number that is not used."""
    row, asked = [[10 * v + k for k in range(WIDTH)] for v in range(3)], []
    found: Any = Instructions.__new__(Instructions)

    def shuffled(one: list[int], other: list[int], places: list[int]) -> list[int]:
        asked.append(tuple(row.index(each) if each in row else None for each in (one, other)))
        return [(one + other)[place] for place in places]

    found._shuffled = shuffled
    vector = found.gather(row, [*lanes, *[-1] * (WIDTH - len(lanes))])
    assert asked == sources
    assert [n for n, wanted in zip(vector, numbers, strict=False) if wanted is not None] == [
        wanted for wanted in numbers if wanted is not None
    ]


def test_integers_and_numbers_of_vectors():
    """Half of an integer and the remainder; sums of all numbers in three steps."""
    found, calls = Instructions.__new__(Instructions), []
    one = lambda name: lambda *given: calls.append((name, *map(str, given))) or name  # noqa: E731
    found._builder = SimpleNamespace(lshr=one("half"), and_=one("rest"), fneg=one("minus"), fdiv=one("over"))  # type: ignore[assignment]
    assert found.halved("k") == ("half", "rest") and found.minus("x") == "minus"  # type: ignore[arg-type]
    assert found.inverse("x") == "over"  # type: ignore[arg-type]
    assert calls == [
        ("half", "k", "i64 1"),
        ("rest", "k", "i64 1"),
        ("minus", "x"),
        ("over", "double 0x3ff0000000000000", "x"),
    ]
    found._shuffled = lambda one, other, places: [one[p] for p in places] if one is other else None  # type: ignore[method-assign,assignment,return-value]
    found._builder = SimpleNamespace(fadd=lambda one, other: [a + b for a, b in zip(one, other, strict=True)])  # type: ignore[assignment]
    assert found.summed([1, 2, 4, 8, 16, 32, 64, 128]) == [255] * 8  # type: ignore[arg-type]
