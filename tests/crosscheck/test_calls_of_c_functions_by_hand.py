"""Code that numba emits for calls of C functions / instructions of LLVM and memory of runs, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from llvmlite import ir
from numba import types

from crosscheck.engines.compiled import calls, dop853, newton

WORD, REAL = ir.IntType(64), ir.DoubleType()


def emitted(kinds: list[Any], code: Any, *before: Any) -> tuple[list[str], Any, list[str]]:
    """The instructions that code adds for arguments of some kinds, its result, and the arguments' names."""
    function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), kinds), "f")
    builder = ir.IRBuilder(function.append_basic_block())
    result = code(builder, list(function.args))
    return [str(line).strip() for line in builder.block.instructions], result, [a.name for a in function.args]


def of_intrinsic(name: str, count: int) -> tuple[Any, Any]:
    """The signature of an intrinsic function, and its code."""
    found = getattr(calls, name)._defn(None, *[None] * count)
    return found[0], found[1]


@pytest.mark.parametrize(
    ("name", "numbers", "result"),
    [
        ("_rates_of", "wwdww", "i32"),
        ("call_with_two", "www", "void"),
        ("call_with_three", "wwww", "void"),
        ("call_with_three_and_real", "wwwwd", "void"),
    ],
)
def test_a_call_passes_all_arguments_behind_the_address(name: str, numbers: str, result: str) -> None:
    """Addresses (w) are integers, times (d) doubles; the first argument is the function's address."""
    signature, code = of_intrinsic(name, len(numbers))
    assert list(signature.args) == [{"w": types.intp, "d": types.float64}[n] for n in numbers]
    assert signature.return_type == (types.int32 if result == "i32" else types.none)
    target = SimpleNamespace(get_dummy_value=lambda: "nothing")
    kinds = [{"w": WORD, "d": REAL}[n] for n in numbers]
    lines, found, names = emitted(kinds, lambda builder, given: code(target, builder, signature, given))
    passed = ["i64" if n == "w" else "double" for n in numbers[1:]]
    pointer = f"{result} ({', '.join(passed)})*"
    assert len(lines) == 2 and lines[0].endswith(f'inttoptr i64 %"{names[0]}" to {pointer}')
    given = ", ".join(f'{kind} %"{n}"' for kind, n in zip(passed, names[1:], strict=True))
    assert f"call {result} " in lines[1] and lines[1].endswith(f"({given})")
    if result == "void":
        assert found == "nothing"
    else:
        assert str(found.type) == "i32"


@pytest.mark.parametrize(
    ("name", "kind"), [("small_integers", types.int32), ("reals", types.float64), ("integers", types.intp)]
)
def test_numbers_at_an_address(name: str, kind: Any) -> None:
    signature, code = of_intrinsic(name, 1)
    assert signature.return_type == types.CPointer(kind) and list(signature.args) == [types.intp]
    asked: list[Any] = []
    target = SimpleNamespace(get_value_type=lambda kind: asked.append(kind) or ir.IntType(8).as_pointer())
    lines, _, names = emitted([WORD], lambda builder, given: code(target, builder, signature, given))
    [line] = lines
    assert line.endswith(f'inttoptr i64 %"{names[0]}" to i8*') and asked == [signature.return_type]


# --- memory of runs ---------------------------------------------------------------------------------------
def test_memory_of_a_run_by_dop853() -> None:
    """It has a copy of the state, a row of slopes for each stage, and two rows of errors."""
    start = np.array([1.0, 2.0, 3.0])
    found = dop853.memory(start)
    assert found.y.tolist() == [1.0, 2.0, 3.0] and found.y is not start
    shapes = {name: getattr(found, name).shape for name in found._fields}
    assert list(shapes.values()) == [(3,), (dop853.STAGES, 3), (3,), (2, 3), (4,), (3,)]
    assert found.counts.dtype == np.int64 and not found.slopes.any() and not found.counts.any()


@pytest.mark.parametrize(("fails", "reached"), [(None, 3), (0, 0), (2, 2)])
def test_a_followed_motion_has_its_tolerance_and_counts(
    fails: int | None, reached: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tolerance is the first number, and the count of evaluations the second one."""
    asked: list[Any] = []

    def advance(system: Any, t: float, memory: Any, numbers: np.ndarray) -> int:
        asked.append((system.tolerance, t, numbers[0], len(numbers)))
        memory.y[:] = t
        numbers[1] += 2
        return int(newton.NOT_MET) if len(asked) - 1 == fails else int(newton.REACHED)

    integrate = getattr(newton.integrate, "py_func", newton.integrate)
    monkeypatch.setattr(newton, "advance", advance)
    memory, samples = dop853.memory(np.zeros(2)), np.zeros((3, 2))
    system = SimpleNamespace(tolerance=1e-9)
    status, count = integrate(system, np.array([0.5, 1.0, 1.5]), samples, memory)
    assert count == reached and status == (newton.REACHED if fails is None else newton.NOT_MET)
    assert asked == [(1e-9, t, 1e-9, 3) for t in (0.5, 1.0, 1.5)][: len(asked)]
    assert memory.counts[dop853.EVALUATIONS] == 2 * len(asked)
    assert samples[:, 0].tolist() == [0.5 * (k + 1) if k < reached else 0.0 for k in range(3)]
