"""Vectors of eight numbers, machine code and orders of series / numbers worked out by hand."""

from __future__ import annotations

import ctypes
import operator
import sys
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
import pytest
from llvmlite import ir
from numba import types
from numba.core.imputils import builtin_registry
from numba.core.typing import templates

from mbref.input_error import InputError
from mbref.kernels import machine_code
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.method import Method
from mbref.stepping.limits import AUTO, GENERATED, GENERIC, Limits
from mbref.taylor import simd, stepper
from mbref.taylor.layout import SeriesOptions
from mbref.taylor.numbers import BatchNumber, ManyScenes

DOUBLES, WHOLE = ir.DoubleType().as_pointer(), ir.IntType(64)
ARRAY, INDICES = types.Array(types.float64, 1, "C"), types.Array(types.int64, 1, "C")
CONTEXT = SimpleNamespace(
    make_array=lambda kind: lambda context, builder, array: SimpleNamespace(data=array),
    get_dummy_value=lambda: None,
)


def machine() -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=0, jit=True
    )


def called(
    kinds: Sequence[ir.Type], write: Callable[[ir.IRBuilder, Sequence[Any]], None], *given: Any
) -> None:
    """Compile and call a function of these types of arguments, whose body is written by ``write``."""
    module = ir.Module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), "f")
    builder = ir.IRBuilder(function.append_basic_block())
    write(builder, function.args)
    builder.ret_void()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(str(module)), machine())
    engine.finalize_object()
    c_kinds = [ctypes.c_int64 if isinstance(value, int) else ctypes.c_void_p for value in given]
    values = [value if isinstance(value, int) else value.ctypes.data for value in given]
    ctypes.CFUNCTYPE(None, *c_kinds)(engine.get_function_address("f"))(*values)


def vector_at(builder: ir.IRBuilder, place: Any) -> Any:
    return builder.load(builder.bitcast(place, simd.SIMD_VECTOR.as_pointer()), align=8)


def put(builder: ir.IRBuilder, vector: Any, place: Any) -> None:
    builder.store(vector, builder.bitcast(place, simd.SIMD_VECTOR.as_pointer()), align=8)


NUMBERS = np.array([0.5, -1.5, 2.25, 3.0, -4.0, 5.5, 6.125, 7.0, 8.5, -9.0, 10.25, 11.0, 12.5, -13.0, 14.0])


@pytest.mark.parametrize("offset", [0, 3, 7])
def test_a_vector_is_loaded_from_an_offset_and_stored_at_another(offset):
    _, load = simd._load._defn(None, ARRAY, types.int64)
    signature, store = simd._store._defn(None, simd.SIMD, ARRAY, types.int64)
    assert signature.args == (simd.SIMD, ARRAY, types.int64) and signature.return_type == types.void
    of_load = SimpleNamespace(args=(ARRAY, types.int64))

    def write(builder: ir.IRBuilder, arguments: Sequence[Any]) -> None:
        source, target, place = arguments
        vector = load(CONTEXT, builder, of_load, (source, place))
        store(CONTEXT, builder, signature, (vector, target, builder.add(place, WHOLE(1))))

    target = np.full(20, 0.125)
    called([DOUBLES, DOUBLES, WHOLE], write, NUMBERS, target, offset)
    expected = np.full(20, 0.125)
    expected[offset + 1 : offset + 9] = NUMBERS[offset : offset + 8]
    assert target.tolist() == expected.tolist()


def test_numbers_are_gathered_from_lanes():
    """Lanes 2 to 9 of a table name the places after an offset of 3."""
    signature, gather = simd._gather._defn(None, ARRAY, types.int64, INDICES, types.int64)
    lanes = np.array([99, 99, 0, 4, 4, 1, 11, 7, 2, 5], dtype=np.int64)

    def write(builder: ir.IRBuilder, arguments: Sequence[Any]) -> None:
        source, table, target = arguments
        put(builder, gather(CONTEXT, builder, signature, (source, WHOLE(3), table, WHOLE(2))), target)

    target = np.zeros(8)
    called([DOUBLES, WHOLE.as_pointer(), DOUBLES], write, NUMBERS, lanes, target)
    assert target.tolist() == NUMBERS[3 + lanes[2:]].tolist()
    plain = simd._plain_gather(NUMBERS.reshape(3, 5), 3, lanes, 2)
    assert plain.tolist() == target.tolist()


def implementation(function: Any, first: types.Type) -> Any:
    """Return what numba lowers an operation of a type and a vector to."""
    [found] = [
        f for f, name, kinds in builtin_registry.functions if (name, *kinds) == (function, first, simd.SIMD)
    ]
    return found


@pytest.mark.parametrize("function", [operator.add, operator.sub, operator.mul])
def test_operations_of_vectors_and_numbers(function):
    one, other = NUMBERS[:8], NUMBERS[7:15]

    def write(builder: ir.IRBuilder, arguments: Sequence[Any]) -> None:
        first, second, target, mixed = arguments
        pair = vector_at(builder, first), vector_at(builder, second)
        put(builder, implementation(function, simd.SIMD)(CONTEXT, builder, None, pair), target)
        number = ir.Constant(ir.DoubleType(), 2.5), pair[1]
        put(builder, implementation(function, types.float64)(CONTEXT, builder, None, number), mixed)

    found, mixed = np.zeros(8), np.zeros(8)
    called([DOUBLES] * 4, write, one.copy(), other.copy(), found, mixed)
    assert found.tolist() == function(one, other).tolist() and mixed.tolist() == function(2.5, other).tolist()


@pytest.mark.parametrize("function", [operator.add, operator.sub, operator.mul])
def test_types_of_operations(function):
    """A number stands on the left; a vector and a number, or a vector and an array, have no operation."""
    made = [each for each, name in _templates(function)]
    assert len(made) == 1
    kind = made[0](None)
    for left, expected in (
        (simd.SIMD, simd.SIMD),
        (types.float64, types.float64),
        (types.float32, types.float64),
    ):
        found = kind.generic((left, simd.SIMD), {})
        assert found.args == (expected, simd.SIMD) and found.return_type is simd.SIMD
    for pair in ((simd.SIMD, types.float64), (types.int64, simd.SIMD), (types.float64, types.float64)):
        assert kind.generic(pair, {}) is None


def _templates(function: Any) -> list[tuple[Any, Any]]:
    """Return the templates of ``simd`` for a function."""
    functions = templates.builtin_registry.globals
    found = [(kind, name) for name, of in functions if name is function for kind in of.templates]
    return [
        (kind, name) for kind, name in found if "mbref.taylor.simd" in {k.__module__ for k in kind.__mro__}
    ]


def test_plain_vectors_and_padded_sizes():
    assert [simd.padded_size(size) for size in (0, 1, 7, 8, 9, 16, 17)] == [0, 8, 8, 8, 16, 16, 24]
    rows = NUMBERS[:14].reshape(2, 7).copy()
    vector = simd._plain_load(rows, 4)
    assert vector.tolist() == NUMBERS[4:12].tolist() and simd._plain_max_abs(-vector) == 11.0
    vector[0] = 99.0
    assert rows[0, 4] == -4.0, "a vector is a copy"
    simd._plain_store(vector, rows, 2)
    assert rows.reshape(-1).tolist() == [*NUMBERS[:2], *vector, *NUMBERS[10:14]]


# --- machine code -----------------------------------------------------------------------------------------
SOURCE = """
define double @twice(double %x) {{
  %y = fmul double %x, {factor}
  ret double %y
}}
define i64 @count() {{
  ret i64 7
}}
"""


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> dict[Any, Any]:
    loaded: dict[Any, Any] = {}
    monkeypatch.setattr(machine_code, "_loaded", loaded)
    return loaded


def twice(code: machine_code.Code, x: float) -> float:
    return float(ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(code.address("twice"))(x))


def test_code_is_compiled_once_stored_and_kept_in_the_process(tmp_path, fresh):
    written: list[float] = []

    def write(factor: float) -> Callable[[], str]:
        return lambda: written.append(factor) or SOURCE.format(factor=f"{factor:e}")

    path = tmp_path / "scenes" / "a.code"
    code = machine_code.code_at(path, write(2.0))
    assert twice(code, 3.5) == 7.0 and written == [2.0] and path.exists()
    assert ctypes.CFUNCTYPE(ctypes.c_int64)(code.address("count"))() == 7
    assert code.address("twice") == code.address("twice") != code.address("count")
    assert machine_code.code_at(path, write(3.0)) is code
    fresh.clear()
    again = machine_code.code_at(path, write(3.0))
    assert again is not code and twice(again, 3.5) == 7.0 and written == [2.0], "it is read from the disk"
    assert twice(machine_code.code_at(tmp_path / "b.code", write(5.0)), 2.0) == 10.0


def test_a_process_keeps_the_latest_code(tmp_path, fresh, monkeypatch):
    monkeypatch.setattr(machine_code, "MOST_LOADED", 2)
    paths = [tmp_path / name for name in "abc"]
    for path in paths:
        machine_code.code_at(path, lambda: SOURCE.format(factor="2.0e0"))
    assert list(fresh) == paths[1:]


def test_the_processor_is_named_with_its_features():
    name, features = machine_code.processor().split(" ", 1)
    assert name == llvm.get_host_cpu_name() and features == llvm.get_host_cpu_features().flatten()


# --- numbers of a batch -----------------------------------------------------------------------------------
def test_arithmetic_of_numbers_of_a_batch():
    one = BatchNumber(np.array([4.0, -9.0]), ManyScenes(2))
    other = BatchNumber(np.array([0.5, 2.0]), one.batch)
    for found, expected in (
        (one + other, [4.5, -7.0]),
        (one - other, [3.5, -11.0]),
        (one * other, [2.0, -18.0]),
        (one / other, [8.0, -4.5]),
        (3.0 + one, [7.0, -6.0]),
        (3.0 - one, [-1.0, 12.0]),
        (3.0 * one, [12.0, -27.0]),
        (3.0 / one, [0.75, -1 / 3]),
        (-one, [-4.0, 9.0]),
        (abs(one), [4.0, 9.0]),
        (round(BatchNumber(np.array([1.2345, -6.789]), one.batch), 2), [1.23, -6.79]),
        (abs(one).sqrt(), [2.0, 3.0]),
    ):
        assert found.values.tolist() == pytest.approx(expected) and found.batch is one.batch


@pytest.mark.parametrize(
    ("ask", "answer", "agree"),
    [
        (lambda n: n > 1.0, True, [True, False, True]),
        (lambda n: n < 1.0, False, [True, False, True]),
        (lambda n: n == 4.0, True, [True, False, False]),
        (bool, True, [True, True, True]),
        (lambda n: n < 4.0, False, [True, False, True]),
        (lambda n: n > 4.0, False, [True, True, False]),
    ],
)
def test_decisions_of_a_batch_are_those_of_its_first_scene(ask, answer, agree):
    batch = ManyScenes(3)
    assert ask(BatchNumber(np.array([4.0, -9.0, 5.0]), batch)) is answer
    assert batch.agree.tolist() == agree


# --- orders of series -------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("tolerance", "code", "order"),
    [
        (1e-10, GENERIC, 18),
        (1e-6, GENERIC, 14),  # 13.2
        (1.0, GENERIC, 6),
        (1e5, GENERIC, 4),  # 0
        (1e-30, GENERIC, 30),  # 42
        (1e-10, GENERATED, 24),  # 23, half way between even orders
        (1e-4, GENERATED, 14),  # 13.4
    ],
)
def test_the_cheapest_order_is_even(tolerance, code, order):
    assert stepper.order_of(tolerance, 0, code) == order


def test_a_requested_order():
    assert [stepper.order_of(1e-9, order, GENERIC) for order in (4, 17, 30)] == [4, 17, 30]
    for order in (3, 31, 4.5):
        with pytest.raises(InputError, match=f"taylor: order must be 4 to 30, got {order:g}"):
            stepper.order_of(1e-9, order, GENERIC)


def started(order: float = 0, driven: bool = False, code: str = GENERIC, **limits: Any) -> Any:
    """A stepper before its memory is made."""
    found = stepper.SeriesStepper.__new__(stepper.SeriesStepper)
    system = SimpleNamespace(settings=SimpleNamespace(nearly_dependent=1, rank_tolerance=1e-5))
    memory = SimpleNamespace(
        control=SimpleNamespace(rtol=3e-8, atol=1e-8), equations=SimpleNamespace(system=system)
    )
    found.is_driven = driven
    found.run = SimpleNamespace(  # type: ignore[assignment]
        method=Method.parse(f"taylor[order={order}]"),
        limits=Limits(code=code, **limits),
        memory=memory,
        ranks=(5, 4e-6, 1e-10),
    )
    return found


def test_tolerance_and_order_of_steps():
    """0.05 (rtol + atol) = 2e-9: 6 + 1.2 · 8.7 is 16.4, and 7 + 1.6 · 8.7 is 20.9."""
    assert started()._kind_of_steps() == (False, pytest.approx(2e-9), 16)
    assert started(code=GENERATED)._kind_of_steps() == (False, pytest.approx(2e-9), 20)
    assert started(order=11)._kind_of_steps() == (False, pytest.approx(2e-9), 11)
    assert started(driven=True)._kind_of_steps() == (True, 3e-7, 16)
    assert started(order=12, driven=True)._kind_of_steps() == (True, 3e-7, 12)
    assert not started(order=11, driven=True)._kind_of_steps()[0]
    assert not started(driven=True, branches={1: 2})._kind_of_steps()[0]


def test_the_tolerance_of_ranks_lies_between_the_singular_values():
    found = started()
    found._decide_rank()
    settings = found.run.memory.equations.system.settings
    assert settings.rank_tolerance == pytest.approx(2e-8)
    found.run.ranks = (5, 4e-6, 0.0)
    found._decide_rank()
    assert settings.rank_tolerance == pytest.approx((4e-6 * 2.0**-52) ** 0.5)
    settings.nearly_dependent, settings.rank_tolerance = 0, 1e-5
    found._decide_rank()
    assert settings.rank_tolerance == 1e-5


class Ranks(NamedTuple):
    """Rank of the rows, and singular values."""

    rank: int
    least: float = 4e-6
    rounding: float = 1e-10


@pytest.mark.parametrize(
    ("rank", "angles", "loops", "order", "code", "options"),
    [
        (3, False, True, 0, GENERIC, (2e-9, 16, 1e-14, 22, 1)),
        (3, False, True, 24, GENERIC, (2e-9, 24, 1e-14, 24, 1)),
        (3, False, False, 0, GENERIC, (2e-9, 16, 1e-14, 16, 1)),
        (4, False, True, 0, GENERIC, (3e-7, 16, 1e-13, 22, 0)),
        (4, False, False, 0, GENERIC, (3e-7, 16, 1e-13, 16, 0)),
        (4, True, True, 0, GENERIC, (2e-9, 16, 1e-14, 22, 0)),
        (2, False, True, 0, GENERATED, (2e-9, 20, 1e-14, 22, 2)),
    ],
)
@pytest.mark.parametrize(
    ("rtol", "length", "change", "distance"), [(3e-8, 0.5, 3e-8, 2e-7), (1e-10, 3.0, 1e-9, 6e-7)]
)
def test_a_new_stepper(
    monkeypatch, rank, angles, loops, order, code, options, rtol, length, change, distance
):
    """Four velocities; tolerance and order of regular and of high-accuracy steps, and the freedoms."""
    calls: dict[str, Any] = {}

    def noted(name: str, result: Any) -> Any:
        return lambda *given: calls.setdefault(name, given) and result

    of, run = stepper.SeriesStepper, started(order, code=code).run
    run.memory.control.rtol, run.memory.control.atol = rtol, 4e-8 - rtol
    run.memory.active = SimpleNamespace(velocities=np.array([0, 2, 3, 5]))
    run.ranks, run.times, run.start = Ranks(rank), np.array([0.0, 0.0, 2.0]), "start"
    run.model = SimpleNamespace(n=6, has_angles=angles, closed_loops=loops, length=length)
    pooled = SimpleNamespace(values="taylor", packed=SimpleNamespace(argument="argument"))
    geometry = SimpleNamespace(polynomials=lambda model: ("polynomials", model))
    for name, result in (
        *(("Pace", "pace"), ("geometry_of", geometry), ("acquire_memory", pooled)),
        *(("Departure", "departure"), ("leaving", None), ("fits_no_branch", True)),
    ):
        monkeypatch.setattr(stepper, name, noted(name, result))
    monkeypatch.setattr(of, "_put_options", noted("put", None))
    monkeypatch.setattr(of, "_put_code", noted("code", None))
    found = of(run)
    follows, moving = options[1] == 16 and options[0] == 3e-7, np.isin(range(6), (0, 2, 3, 5))
    assert found.follows_drivers is follows and found._options == SeriesOptions(
        *(pytest.approx(options[0]), options[1], pytest.approx(options[2]), options[3]),
        *(change, pytest.approx(distance), options[4], follows),
    )
    assert (found.run, found.taylor, found.argument, found._calls, found._sampling) == (
        *(run, "taylor", "argument", 0, 0.0),
    )
    model, start, given, driven = calls["geometry_of"]
    assert (model, start, driven) == (run.model, "start", follows) and given.tolist() == moving.tolist()
    assert calls["acquire_memory"] == (run, geometry, ("polynomials", run.model), options[3])
    assert calls["Departure"] == (run, "taylor", found.expand, found._state_at)
    assert (calls["Pace"], calls["leaving"], calls["fits_no_branch"]) == ((run,),) * 3
    assert found._way is None and found._fits_no_branch is True and found._wants_code is False
    assert ("code" in calls) is (code == GENERATED) and "put" in calls
    assert run.memory.equations.system.settings.rank_tolerance == pytest.approx(2e-8)


@pytest.mark.parametrize(("end", "way", "fits"), [(0.0, None, True), (2.0, "way", False)])
def test_a_new_stepper_at_a_singular_start(monkeypatch, end, way, fits):
    """A run of no time leaves no singular position; generated code is used where it pays."""
    run = started(code=AUTO).run
    run.memory.active, run.ranks = SimpleNamespace(velocities=np.arange(6)), Ranks(5)
    run.times, run.start = np.array([0.0, 0.0, end]), "start"
    run.model = SimpleNamespace(n=6, has_angles=False, closed_loops=True, length=1.0)
    pooled = SimpleNamespace(values="taylor", packed=SimpleNamespace(argument="argument"))
    geometry = SimpleNamespace(polynomials=lambda model: None)
    for name, result in (
        *(("Pace", "pace"), ("geometry_of", geometry), ("acquire_memory", pooled)),
        *(("Departure", "departure"), ("leaving", "way"), ("fits_no_branch", True)),
    ):
        monkeypatch.setattr(stepper, name, lambda *_, result=result: result)
    monkeypatch.setattr(stepper.SeriesStepper, "_put_options", lambda _: None)
    monkeypatch.setattr(stepper.SeriesStepper, "_put_code", lambda _: pytest.fail("no code yet"))
    found = stepper.SeriesStepper(run)
    assert (found._way, found._fits_no_branch, found._wants_code) == (way, fits, True)
    assert (found._pace, found._departure) == ("pace", "departure")


def test_generated_code_is_put_into_memory(monkeypatch):
    """The time that it takes is counted apart; without the subpackage there is none."""
    found = started()
    found.run.making, found.taylor = 0.5, "taylor"
    build = SimpleNamespace(put_code=lambda taylor: f"code of {taylor}")
    monkeypatch.setitem(sys.modules, "mbref.taylor.generated.build", build)
    monkeypatch.setattr(stepper.time, "process_time", iter([10.0, 13.0, 20.0]).__next__)
    found._put_code()
    assert found._code == "code of taylor" and found.run.making == 3.5
    monkeypatch.setitem(sys.modules, "mbref.taylor.generated.build", None)
    with pytest.raises(NoGeneratedCode, match="generated is not installed"):
        found._put_code()
    assert found.run.making == 3.5
