"""Named memory: kernels read and write fields by name, and a packing mistake is an error at construction."""

from typing import Annotated, NamedTuple

import numpy as np
import pytest

from mbref.kernels.compilation import FLOAT, VECTOR, entry, exchangeable
from mbref.kernels.named_memory import (
    Address,
    Indices,
    Kernel,
    Matrix,
    Named,
    Vector,
    allocate,
    opener,
    packed,
)

TWICE = FLOAT(FLOAT)


class Counts(NamedTuple):
    steps: int = 0
    time: float = 0.0


class Rows(NamedTuple):
    phi: Annotated[Vector, "m"]
    blocks: Annotated[Matrix, "m", "2*n"]


class Other(NamedTuple):
    x: Annotated[Vector, 3]


class Whole(NamedTuple):
    rows: Rows
    counts: Counts
    order: Annotated[Indices, "m"]
    x: Annotated[Vector, "n"]
    twice: Annotated[Kernel, TWICE]
    other: Address


other_of = opener(Other)
SIZES = {"m": 4, "n": 3}


@exchangeable(TWICE)
def twice(x):
    return 2.0 * x


@entry(FLOAT(VECTOR, Named(Whole)))
def use(x, memory):
    """Read and write every kind of field."""
    memory.counts.steps += 1
    memory.counts.time = x[0]
    for i in range(memory.rows.phi.shape[0]):
        memory.rows.phi[i] = memory.rows.blocks[i, 5] + x[0]
    other_of(memory.other).x[1] = 7.0
    return memory.twice(memory.rows.phi[memory.order[0]])


def whole(**given):
    rows = allocate(Rows, SIZES)
    rows.blocks[:, 5] = [1.0, 2.0, 3.0, 4.0]
    fields = {"rows": rows, "twice": twice.pointer, "other": packed(allocate(Other, {})), **given}
    return allocate(Whole, SIZES, **fields)


def test_kernel_reads_and_writes_every_kind_of_field_by_name():
    """``use`` returns twice phi[order[0]] = 2 (3 + 10) and writes steps, time, phi and x[1] of another
    memory."""
    memory = whole()
    memory.order[0] = 2
    assert use(np.array([10.0]), packed(memory).argument) == 26.0
    assert (memory.counts.steps, memory.counts.time) == (1, 10.0)
    assert memory.rows.phi.tolist() == [11.0, 12.0, 13.0, 14.0]
    assert memory.other.values.x.tolist() == [0.0, 7.0, 0.0]


@pytest.mark.parametrize(
    ("field", "value", "fault"),
    [
        ("order", np.zeros(4), "Whole.order: needs a contiguous"),
        ("order", np.zeros(8, dtype=np.int64)[::2], "Whole.order: needs a contiguous"),
        ("order", [0, 1, 2, 3], "Whole.order: needs a contiguous"),
        ("order", np.zeros(5, dtype=np.int64), r"Whole.order: \(m\) is \(4,\) here, got \(5,\)"),
        ("rows", Other(np.zeros(3)), "Whole.rows: needs Rows, got Other"),
        ("rows", Rows(np.zeros(4), np.zeros((4, 5))), r"Rows.blocks: \(m, 2\*n\) is \(4, 6\) here"),
        ("counts", Counts(), "Whole.counts: needs the record"),
    ],
)
def test_value_of_another_type_or_shape_is_refused_by_its_field(field, value, fault):
    with pytest.raises(TypeError, match=fault):
        packed(whole(**{field: value}))
