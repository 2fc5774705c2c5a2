"""Memory of kernels / places of arrays, lengths of dimensions, numbers of records and pooled memory."""

from __future__ import annotations

import argparse
import os
from typing import Any, NamedTuple

import numpy as np
import pytest

from mbref.command_line import Parser, commands, output_file, output_folder
from mbref.equations.model import Model
from mbref.kernels import memory_pool
from mbref.kernels.aligned import aligned_zeros, block_of
from mbref.kernels.dimensions import check_sizes, size_of
from mbref.kernels.memory_pool import (
    SavedNumbers,
    acquire,
    arrays_in,
    copied,
    fill,
    release,
    shapes_of,
    write_record,
)
from mbref.kernels.records import dtype_of, is_record, record
from mbref.lazy import LazyMapping, LazySequence
from mbref.scene import Body, Revolute, Scene

FLOAT, WHOLE, SMALL = np.dtype("f8"), np.dtype("i8"), np.dtype("u1")


class Pair(NamedTuple):
    count: int
    step: float


class Both(NamedTuple):
    pair: Pair
    line: np.ndarray


class Arrays(NamedTuple):
    first: np.ndarray
    second: np.ndarray


# --- places -----------------------------------------------------------------------------------------------
def test_arrays_begin_at_lines_of_64_bytes():
    """3, 8 and 9 numbers of 8 bytes and 5 bytes need 1, 1, 2 and 1 lines."""
    made = aligned_zeros(
        [((3,), FLOAT), ((2, 4), WHOLE), ((9,), FLOAT), ((5,), SMALL), ((0,), FLOAT), ((), FLOAT)]
    )
    assert [array.shape for array in made] == [(3,), (2, 4), (9,), (5,), (0,), ()]
    assert [array.dtype for array in made] == [FLOAT, WHOLE, FLOAT, SMALL, FLOAT, FLOAT]
    begins = [array.ctypes.data for array in made if array.size]
    assert all(place % 64 == 0 for place in begins)
    assert np.diff(begins).tolist() == [64, 64, 128, 64]
    assert not any(array.any() for array in made) and all(array.flags.c_contiguous for array in made)
    block = block_of(made[0])
    assert block.dtype == np.uint8 and block.nbytes == 6 * 64 + 64
    assert all(block_of(array) is block for array in made)
    for array in made:
        array[...] = 1
    assert [float(array.sum()) for array in made] == [3.0, 8.0, 9.0, 5.0, 0.0, 1.0], "they do not overlap"


def test_an_array_of_its_own_is_its_block():
    own, text = np.zeros(3), np.zeros((2, 2), np.uint8)
    assert block_of(own) is own and block_of(own[1:]) is not own and block_of(text[0]) is text


# --- dimensions -------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("expression", "size"), [("n", 6), ("7", 7), ("6 * nb + 1", 13), ("max(n, m)", 9), ("m // 2", 4)]
)
def test_lengths_of_dimensions(expression, size):
    assert size_of(expression, {"n": 6, "m": 9, "nb": 2}) == size


def test_dimensions_of_one_name_have_one_length():
    check_sizes((("a", ("n", "m"), (2, 3)), ("b", ("m", "2 * n"), (3, 4))))
    check_sizes((("a", ("k + 1",), (5,)), ("b", ("k + 1",), (5,))))
    check_sizes((("b", ("2 * n",), (4,)), ("a", ("n",), (2,))))
    for arrays, fault in (
        ((("a", ("n",), (2,)), ("b", ("n",), (3,))), r"b: \(n\) is \(2,\) here, got \(3,\)"),
        (
            (("a", ("n",), (2,)), ("b", ("n", "2 * n"), (2, 5))),
            r"b: \(n, 2 \* n\) is \(2, 4\) here, got \(2, 5\)",
        ),
        ((("a", ("k + 1",), (5,)), ("b", ("k + 1",), (6,))), r"b: \(k \+ 1\) is \(5,\) here, got \(6,\)"),
    ):
        with pytest.raises(TypeError, match=fault):
            check_sizes(arrays)


# --- records ----------------------------------------------------------------------------------------------
def test_a_record_has_numbers_by_name():
    made = record(Pair(3, 0.5))
    assert (made.count, made.step) == (3, 0.5) and made["count"] == 3
    made.step = 2.5
    made.count = 4.0
    assert (made.step, made.count) == (2.5, 4) and isinstance(made, np.void)
    other = record(Pair(3, 0.5))
    assert other.step == 0.5 and type(other).__name__ == "Pair", "records do not share memory"
    assert dtype_of(Pair) == np.dtype([("count", "i8"), ("step", "f8")])
    assert is_record(Pair) and not is_record(Both)
    write_record(made, Pair(7, 1.5))
    assert (made.count, made.step) == (7, 1.5)


# --- the pool ---------------------------------------------------------------------------------------------
def memory() -> Any:
    return Both(record(Pair(1, 2.0)), np.array([3.0, 4.0]))


def test_arrays_of_a_schema_and_of_its_records():
    assert [array.size for array in arrays_in((memory(), np.zeros((2, 2))))] == [1, 2, 4]


def test_saved_numbers_are_restored():
    both = memory()
    saved = SavedNumbers(both)
    both.pair.step, both.line[:] = 9.0, 8.0
    saved.restore()
    assert (both.pair.step, both.line.tolist(), saved.size) == (2.0, [3.0, 4.0], 16 + 16)
    fixed = np.ones(2)
    fixed.flags.writeable = False
    assert SavedNumbers((fixed, np.zeros(0))).size == 0


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> dict[Any, Any]:
    found: dict[Any, Any] = {}
    monkeypatch.setattr(memory_pool, "_kept", found)
    monkeypatch.setattr(memory_pool, "packed", lambda values, part: (values, part))
    return found


def test_released_memory_is_acquired_again_with_its_first_numbers(kept):
    first = acquire("a", memory)
    first.values.line[:] = 7.0
    release(first)
    assert acquire("a", memory) is first and first.values.line.tolist() == [3.0, 4.0]
    other = acquire("a", memory)
    assert other is not first and other.number == first.number + 1
    assert acquire("b", memory) is not first and first.size == 32


def test_memory_with_a_part_keeps_the_numbers_of_the_part(kept):
    part = acquire("part", memory)

    class Outer(NamedTuple):
        own: np.ndarray
        inner: Both

    outer = acquire("a", lambda: Outer(np.array([5.0]), part.values), part)
    assert outer.size == 8 + 32 and outer.packed[1] == part.packed
    outer.values.own[:] = outer.values.inner.line[:] = 1.0
    release(outer)
    assert acquire("a", memory, part) is outer
    assert outer.values.own[0] == 5.0 and part.values.line.tolist() == [1.0, 1.0]
    assert list(kept) == [("a", part.number)]


def test_limits_of_the_pool(kept):
    """Four pieces of a key, 64 keys, and 2²⁰ bytes of a piece."""
    pieces = [acquire("a", memory) for _ in range(5)]
    for piece in pieces:
        release(piece)
    assert kept["a"] == pieces[:4]
    for k in range(64):
        release(acquire(k, memory))
    assert len(kept) == 64 and "a" not in kept, "the first key leaves"
    keys = list(kept)
    release(acquire(5, memory))
    assert list(kept) == keys, "a key that is there needs no place"
    for count, is_kept in ((131072, True), (131073, False)):
        release(acquire(("large", count), lambda count=count: (np.zeros(count),)))
        assert (("large", count) in kept) is is_kept


def test_copies_of_schemas():
    nested = (Arrays(np.array([1.0, 2.0]), np.array([[3]])), np.array([4.0]))

    class Outer(NamedTuple):
        inner: Arrays
        line: np.ndarray

    source = Outer(*nested)
    made = copied(source)
    assert type(made) is Outer and made.inner.second.tolist() == [[3]] and made.line.tolist() == [4.0]
    assert shapes_of(made) == ((2,), (1, 1), (1,)) and made.line is not source.line
    made.inner.first[:] = made.line[:] = 0.0
    assert source.inner.first.tolist() == [1.0, 2.0]
    fill(made, source)
    assert made.inner.first.tolist() == [1.0, 2.0] and made.line.tolist() == [4.0]


# --- values at first access -------------------------------------------------------------------------------
def test_values_are_found_at_first_access():
    asked: list[Any] = []

    def find(*given: Any) -> Any:
        asked.append(given)
        return {"a": 1, "b": 2} if given[0] else ["x", "y"]

    mapping, sequence = LazyMapping(("a", "b"), find, True, 7), LazySequence((0, 1), find, False)
    assert (list(mapping), len(mapping), len(sequence), asked) == (["a", "b"], 2, 2, [])
    assert (mapping["b"], sequence[1], repr(mapping)) == (2, "y", "{'a': 1, 'b': 2}")
    assert dict(mapping) == {"a": 1, "b": 2} and asked == [(True, 7), (False,)], "once each"


# --- command lines ----------------------------------------------------------------------------------------
@pytest.fixture
def parser() -> Parser:
    made = Parser(prog="p")
    made.add_argument("--all", action="store_true")
    run = commands(made, required=True, metavar="COMMAND").add_parser("run")
    run.add_argument("--steps", type=int)
    run.add_argument("--rtol", type=float)
    run.add_argument("--kind", choices=("fine", "coarse"))
    run.add_argument("--name", action="append")
    return made


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("run --step 3x", "p run: error: argument --steps: must be a whole number, got '3x'"),
        ("run --rtol x", "p run: error: argument --rtol: must be a number, got 'x'"),
        ("run --kind fin", "argument --kind: unknown 'fin'; known: fine, coarse; did you mean 'fine'?"),
        ("rum", "unknown 'rum'; known: run; did you mean 'run'?"),
        ("run --stepz 3", "p run: error: unknown option '--stepz'; did you mean '--steps'?"),
        ("run --zzzzzz", "p run: error: unknown option '--zzzzzz'\n"),
        ("run this", "p run: error: unknown argument 'this'\n"),
        ("run --steps 3 this", "p run: error: unknown argument 'this'\n"),
        (
            "run --name a b",
            "unknown argument 'b'; repeat the option for each value: --name a --name b\n",
        ),
        ("--alll run", "unknown option '--alll'"),
    ],
)
def test_messages_of_a_command_line(parser, line, says, capsys):
    with pytest.raises(SystemExit) as caught:
        parser.parse_args(line.split())
    assert caught.value.code == 2 and says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "name", "says"),
    [
        (output_file, "there/made.csv", ""),
        (output_file, "there/old.csv", ""),
        (output_file, "there", "DIR/there is a folder; name a file"),
        (output_file, "gone/new.csv", "there is no folder DIR/gone"),
        (output_folder, "there", ""),
        (output_folder, "gone/below", ""),
        (output_folder, "there/old.csv", "DIR/there/old.csv is a file; name a folder"),
        (output_folder, "there/old.csv/below", "DIR/there/old.csv is a file; name a folder"),
    ],
)
def test_a_place_that_cannot_be_written_is_refused_before_the_work(tmp_path, kind, name, says):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "old.csv").write_text("")
    wanted = f"{tmp_path}/{name}"
    if not says:
        assert kind(wanted) == wanted and not (tmp_path / "gone").exists(), "nothing is made yet"
        return
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        kind(wanted)
    assert str(caught.value) == says.replace("DIR", str(tmp_path))


@pytest.mark.parametrize(
    ("kind", "name"), [(output_file, "new.csv"), (output_file, "old.csv"), (output_folder, "new")]
)
def test_a_place_without_permission_is_refused(tmp_path, monkeypatch, kind, name):
    (tmp_path / "old.csv").write_text("")
    asked = []
    monkeypatch.setattr("os.access", lambda place, mode: asked.append((str(place), mode)))
    there = tmp_path / "old.csv" if name == "old.csv" else tmp_path
    with pytest.raises(argparse.ArgumentTypeError, match=f"/{name} cannot be written: .* for {there}$"):
        kind(f"{tmp_path}/{name}")
    assert asked == [(str(there), os.W_OK)]


def test_a_command_line_without_a_command_shows_the_help(parser, capsys):
    with pytest.raises(SystemExit) as caught:
        parser.parse_args([])
    printed = capsys.readouterr()
    assert caught.value.code == 2 and printed.err == parser.format_help() and printed.out == ""
    assert parser.parse_args(["run", "--steps", "3"]).steps == 3


def test_memory_that_is_used_again_has_the_numbers_of_the_new_scene():
    """Both scenes have one structure; a link of 3 kg follows one of 2 kg, at another place."""
    masses = []
    for mass, x in ((2.0, 1.0), (3.0, 4.0)):
        link = Body(name="link", mass=mass, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))
        hinge = Revolute(name="A", bodies=("ground", "link"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
        model = Model(Scene(name="s", duration=1.0, body=(link,), joint=(hinge,)))
        values = model.memory.values
        assert values.system.mass.tolist() == [mass] * 3 + [1.0] * 3
        assert values.system.inverse_root == pytest.approx([mass**-0.5] * 3 + [1.0] * 3)
        numbers = [np.array(array).tolist() for array in values.scene.numbers]
        assert numbers == [np.array(array).tolist() for array in model.data.numbers]
        masses.append(numbers)
        model.release()
    assert masses[0] != masses[1], "the anchors differ"
