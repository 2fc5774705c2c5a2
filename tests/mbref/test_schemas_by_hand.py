"""Fields, allocation and tables of schemas of named memory / rows and addresses worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from llvmlite import ir
from numba import types

from mbref.kernels import dimensions, named_memory
from mbref.kernels.compilation import FLOAT, PLAIN
from mbref.kernels.named_memory import (
    Address,
    IndexTable,
    Indices,
    Kernel,
    Matrix,
    Named,
    Packed,
    Unsigned,
    Vector,
    allocate,
    fields_of,
    opener,
    packed,
    table_rows,
)
from mbref.kernels.records import Numbers, record, record_type_of

TWICE = FLOAT(FLOAT)


class Counts(NamedTuple):
    steps: int = 3
    time: float = 0.5


class Rows(NamedTuple):
    phi: Annotated[Vector, "m"]
    blocks: Annotated[Matrix, "m", "2*n"]
    table: Annotated[IndexTable, "m", 2]


class Whole(NamedTuple):
    x: Annotated[Unsigned, "n"]
    rows: Rows
    counts: Counts
    order: Annotated[Indices, "m"]
    twice: Annotated[Kernel, TWICE]
    other: Address


SIZES = {"m": 4, "n": 3}
ROWS = {"x": 0, "rows": 1, "counts": 4, "order": 5, "twice": 6, "other": 7}


def whole(**given: Any) -> Any:
    return allocate(Whole, SIZES, **{"twice": None, "other": None, **given})


def test_fields_and_their_rows_in_a_table():
    fields = fields_of(Whole)
    assert {name: field.row for name, field in fields.items()} == ROWS
    assert table_rows(Whole) == 8 and table_rows(Rows) == 3
    assert [field.title for field in fields.values()] == [f"Whole.{name}" for name in ROWS]
    assert [field.name for field in fields.values()] == [*ROWS]
    shapes = {name: field.shape for name, field in fields.items()}
    assert shapes == {"x": ("n",), "rows": (), "counts": (), "order": ("m",), "twice": (), "other": ()}
    assert [field.schema for field in fields.values()] == [None, Rows, None, None, None, None]
    kinds = [np.dtype("u4"), None, record_type_of(Counts), np.dtype("i8"), None, None]
    assert [field.dtype for field in fields.values()] == kinds
    assert fields["other"].kind == types.intp and fields["twice"].kind == types.FunctionType(TWICE)
    assert fields["rows"].kind == Named(Rows) and isinstance(fields["counts"].kind, types.Record)
    assert fields_of(Rows)["blocks"].shape == ("m", "2*n") and fields_of(Rows)["table"].shape == ("m", "2")
    assert Named(Rows).name == f"Named({__name__}.Rows)"


def test_memory_of_declared_shapes():
    memory = whole()
    assert [array.shape for array in memory.rows] == [(4,), (4, 6), (4, 2)]
    assert [array.dtype for array in memory.rows] == [np.float64, np.float64, np.int64]
    assert (memory.x.shape, memory.x.dtype, memory.order.shape, memory.order.dtype) == (
        (3,),
        "u4",
        (4,),
        "i8",
    )
    assert not any(array.any() for array in (*memory.rows, memory.x, memory.order))
    assert isinstance(memory.counts, Numbers) and (memory.counts.steps, memory.counts.time) == (3, 0.5)
    own = allocate(Rows, SIZES, phi=np.ones(4))
    again = whole(rows=own)
    assert again.rows is own and own.phi.tolist() == [1.0] * 4
    assert again.counts is not memory.counts and again.order is not memory.order
    assert (memory.twice, memory.other) == (None, None)


def test_the_table_of_addresses_rows_and_columns():
    memory, other = whole(), packed(allocate(Rows, SIZES))
    memory = memory._replace(other=other)
    made = packed(memory)
    table = made.table.reshape(-1, 3).tolist()
    arrays = [memory.x, *memory.rows, None, memory.order]
    for row, array in enumerate(arrays):
        if array is not None:
            assert table[row] == [array.ctypes.data, array.shape[0], array.shape[-1]], row
    assert table[4] == [memory.counts.__array_interface__["data"][0], 0, 0]
    assert table[6:] == [[0, 0, 0], [other.address, 0, 0]]
    assert made.address == made.table.ctypes.data and made.values is memory
    assert made.argument is (memory if PLAIN else made)
    titles = ["Whole.x", "Rows.phi", "Rows.blocks", "Rows.table", "Whole.order"]
    assert [title for title, _, _ in made.shapes] == titles
    assert made.shapes[2] == ("Rows.blocks", ("m", "2*n"), (4, 6))


def test_a_record_is_its_own_table():
    counts: Any = record(Counts())
    made = packed(counts)
    assert made.address == counts.__array_interface__["data"][0] and made.argument is (
        counts if PLAIN else made
    )
    assert not hasattr(made, "table")


def test_a_packed_part_is_not_packed_again(monkeypatch):
    memory = whole()
    part = packed(memory.rows)
    part.table[0] = 77
    made = packed(memory, part)
    assert made.table[3] == 77 and made.shapes[1:4] == part.shapes
    assert packed(whole(), part).table[3] != 77, "other memory has another part"


def test_addresses_of_arrays_of_every_kind():
    array, fixed = np.arange(3.0), np.arange(3.0)
    fixed.flags.writeable = False
    for each in (array, fixed, np.zeros(0), np.zeros((2, 0))):
        assert named_memory._address(each) == each.ctypes.data


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"x": np.zeros(3)}, r"Whole.x: needs a contiguous .*, got float64 \(3,\)"),
        ({"x": np.zeros((3, 1), np.uint32)}, r"Whole.x: needs a contiguous .*, got uint32 \(3, 1\)"),
        ({"x": np.zeros(6, np.uint32)[::2]}, r"Whole.x: needs a contiguous .*, got uint32 \(3,\)"),
        ({"x": SimpleNamespace(dtype=np.dtype("u4"))}, "Whole.x: needs a contiguous .*, got SimpleNamespace"),
        ({"rows": None}, "Whole.rows: needs Rows, got NoneType"),
        ({"counts": Counts()}, "Whole.counts: needs the record that its schema declares, got Counts"),
        ({"order": np.zeros(3, np.int64)}, r"Whole.order: \(m\) is \(4,\) here, got \(3,\)"),
    ],
)
def test_memory_that_does_not_fit(changes, fault):
    with pytest.raises(TypeError, match=fault):
        packed(whole()._replace(**changes))


def test_an_opener_is_a_function_of_an_address():
    made = packed(whole())
    if PLAIN:
        assert opener(Whole)(made) is made.values and opener(Whole)(made.values) is made.values
    else:
        assert callable(opener(Whole)) and opener(Whole) is not named_memory._as_it_is
    assert named_memory._as_it_is(made) is made.values and named_memory._as_it_is(made.values) is made.values


@pytest.mark.parametrize(
    ("plain", "kind", "value", "address"),
    [
        (True, TWICE, len, 0),
        (False, TWICE, SimpleNamespace(address=5), 5),
        (True, None, SimpleNamespace(address=7), 7),
        (False, TWICE, None, 0),
        (True, None, None, 0),
    ],
)
def test_addresses_of_kernels_and_of_other_memory(monkeypatch, plain, kind, value, address):
    monkeypatch.setattr(named_memory, "PLAIN", plain)
    field = fields_of(Whole)["twice" if kind else "other"]
    assert named_memory._address_of_other(field, value) == address


def test_packed_memory_has_its_type_for_numba():
    made: Any = packed(whole())
    assert made._numba_type_ == Named(Whole) and isinstance(made, Packed)
    assert named_memory._kind(Whole) is named_memory._kind(Whole)


def test_words_are_loaded_once_in_a_loop():
    """LLVM may take a word of the table as constant."""
    module = ir.Module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [ir.IntType(64).as_pointer()]), "f")
    builder = ir.IRBuilder(function.append_basic_block())
    named_memory._load(builder, function.args[0])
    builder.ret_void()
    assert 'load i64, i64* %".1", !invariant.load' in str(module).replace("  ", " ")


def test_dimensions_without_names():
    assert dimensions._names("max(m, 2*nb_1) + 3") == {"m", "nb_1"} and dimensions._names("12") == set()
    assert dimensions.size_of("max(m, n)", {"m": 2, "n": 5}) == 5
    assert dimensions._compiled("m + 1").co_filename == "<dimension>"
