"""Machine code of small systems against the kernels as plain Python, both on the same memory.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled
but the systems' own code, without optimisation. Ten variables need two vectors, and rows two or three.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.taylor import correction, series, solver
from mbref.taylor.generated import build
from tests.mbref.interpreted_series import CIRCLE, LAST, PLANE, SADDLE, WIDE, respond, system, wide

POINTERS = {"expand": 7, "expand_by_power": 5, "factorise": 8, "violation": 2, "close": 4, "close_rate": 4}
SYSTEMS: dict[str, Callable[[], Any]] = {
    "two freedoms": lambda: system([CIRCLE]),
    "one freedom": lambda: system([SADDLE, CIRCLE]),
    "no freedom": lambda: system([CIRCLE, SADDLE, {**PLANE, (1, 3): 0.25}], (3,), driven=True),
    "seven freedoms": lambda: wide(3)[1],
    "one freedom of ten": lambda: wide(9)[1],
    "none of ten": lambda: wide(10, (10, 11))[1],
}


def machine() -> llvm.TargetMachine:
    """Return this machine, for code without optimisation."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=0, jit=True
    )


@functools.cache
def compiled(name: str, by_power: bool) -> llvm.ExecutionEngine:
    """Return the functions of a system, of which one computes the orders, with or without multipliers."""
    memory = begun(name)
    memory.options = SimpleNamespace(start_freedoms=memory.solver.pivot_columns.size - memory.partition.rank)
    functions = "expand_by_power" if by_power else "expand", "factorise"
    module = llvm.parse_assembly(build.write_code(memory, functions))
    module.verify()
    engine = llvm.create_mcjit_compiler(module, machine())
    engine.finalize_object()
    return engine


def begun(name: str) -> Any:
    """Return memory of a system whose response is known."""
    memory = SYSTEMS[name]()
    slots = 4 * memory.series.left.shape[1] + 64  # small systems need more slots by power
    memory.series.left, memory.series.right = np.zeros((2, LAST + 3, slots))
    orders, first = np.arange(LAST + 3), memory.solver.pivot_columns.size + memory.solver.pivot_rows.size
    for g in range(memory.polynomials.given.driver.size):
        memory.series.terms[:, first + g] = 0.3 + np.cos(g + orders)
    respond(memory)
    return memory


def written(name: str, by_power: bool = False) -> tuple[Any, Callable[..., None]]:
    """Return memory of a system whose response is known, and a call of its functions."""
    engine = compiled(name, by_power)

    def call(function: str, *arguments: Any) -> None:
        counts = [value for value in arguments if isinstance(value, int)]
        kinds = [ctypes.c_void_p] * POINTERS[function] + [ctypes.c_int64] * len(counts)
        pointers = [array.ctypes.data for array in arguments[: POINTERS[function]]]
        ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address(function))(*pointers, *counts)

    return begun(name), call


def both(memory: Any, loops: Callable[[], object], code: Callable[[], None], *arrays: np.ndarray) -> None:
    """Check that loops and code leave equal numbers in arrays, from the same numbers before."""
    terms, begun = memory.series.terms.copy(), [array.copy() for array in arrays]
    loops()
    expected = [array.copy() for array in arrays]
    memory.series.terms[:] = terms
    for array, numbers in zip(arrays, begun, strict=True):
        array[:] = numbers
    code()
    for found, wanted in zip(arrays, expected, strict=True):
        size = np.abs(wanted).max(initial=1e-3)
        assert np.abs(found - wanted).max(initial=0.0) <= 1e-9 * size


@pytest.mark.parametrize("name", SYSTEMS)
def test_corrections_of_a_system(name):
    """Violations stand in lanes of rows, changes in lanes of variables."""
    memory, call = written(name)
    s, terms = memory.solver, memory.series.terms
    nz, nr = s.pivot_columns.size, s.pivot_rows.size
    rows, variables = slice(nz, nz + nr), slice(nz)
    terms[:2, :nz] += 0.1 * np.cos(np.arange(2.0 * nz)).reshape(2, nz)
    s.phi[:] = 5.0
    both(
        *(memory, lambda: correction.violation_in_loops(memory), lambda: call("violation", terms, s.phi)),
        s.phi[rows],
    )
    s.response[nz + nr :] = 0.0
    loops = lambda: correction.subtract_violation(0, memory)  # noqa: E731
    s.phi[:nz], s.phi[nz + nr :] = 0.0, 0.0
    s.response[:nz] = 0.0
    arguments = terms, s.phi, s.response, s.change
    both(memory, loops, lambda: call("close", *arguments), terms[0], terms[1], s.change[variables])

    def rates() -> None:
        correction.violation_rate_in_loops(memory)
        correction.subtract_violation(1, memory)

    changed = terms[0], terms[1], s.change[variables], s.phi[rows]
    both(memory, rates, lambda: call("close_rate", *arguments), *changed)
    assert np.abs(s.change[variables]).max() > 1e-4


@pytest.mark.parametrize(
    ("name", "by_power"),
    [*((name, False) for name in SYSTEMS), ("one freedom", True), ("one freedom of ten", True)],
)
def test_the_response_of_a_system(name, by_power):
    """Code by power needs the response to rows alone; N stands in lanes of rows."""
    memory, call = written(name, by_power)
    s, rank = memory.solver, memory.partition.rank
    nz, nr = s.pivot_columns.size, s.pivot_rows.size
    kept = slice(nz, nz + nr) if by_power else slice(nz + nr)
    arrays = s.response[kept, : nz + (0 if by_power else nr)], s.last, s.null_space[: nz - rank, :nz]
    for array in (s.response, s.last, s.particular, s.null_space[:, :nz], s.tableau):
        array[:] = 7.0
    code = lambda: call(  # noqa: E731
        *("factorise", memory.series.terms, s.tableau, s.particular, s.null_space, s.response, s.last),
        *(s.pivot_rows, s.pivot_columns),
    )
    both(
        memory, lambda: solver.respond_in_loops.function(memory), code, *arrays, s.particular[:, nz : nz + nr]
    )


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("last", [0, 1, 4, LAST])
def test_orders_of_a_system(name, last):
    """Orders with multipliers from values and rates that need not obey the rows."""
    memory, call = written(name)
    s, of = memory.solver, memory.series
    nz, ng = s.pivot_columns.size, memory.polynomials.given.driver.size
    respond(memory)
    if ng:
        solver.add_functions(ng, memory)

    def loops() -> None:
        series.start_sums(memory)
        series.expand_without_loads(last, memory)

    code = lambda: call(  # noqa: E731
        "expand", of.terms, s.response, of.left, of.right, of.scale, of.growth, s.rhs, last
    )
    lanes = slice(nz) if memory.partition.rank == nz else slice(None)
    both(memory, loops, code, *(of.terms[k, lanes] for k in range(last + 3)))


@pytest.mark.parametrize("name", ["one freedom", "one freedom of ten"])
@pytest.mark.parametrize("last", [0, 1, 4, LAST])
def test_orders_of_a_system_by_power(name, last):
    """Rates along the motion that the rows allow; the code also returns v · Q over v · M v."""
    memory, call = written(name, by_power=True)
    s, of = memory.solver, memory.series
    nz = s.pivot_columns.size
    for _ in range(4):
        correction.correct_state.function(memory)
    of.terms[1, :nz] = velocity = 0.7 * s.null_space[0, :nz]
    respond(memory)

    def loops() -> None:
        series.start_sums(memory)
        series.expand_without_loads(last, memory)

    code = lambda: call("expand_by_power", of.terms, s.response, of.left, of.right, s.rhs, last)  # noqa: E731
    both(memory, loops, code, *(of.terms[k, :nz] for k in range(last + 3)))
    inertia = memory.polynomials.inertia
    force = inertia.force[:nz].copy()
    for block in range(inertia.start.size - 1):
        for c in range(inertia.start[block], inertia.start[block + 1]):
            lane = 8 * block + (c - inertia.start[block]) % 8
            if lane < nz:
                force[lane] += inertia.weight[c] * of.terms[0, inertia.source[c]]
    assert s.rhs[0] == pytest.approx(
        velocity @ force / (velocity @ inertia.mass[:, :nz] @ velocity), rel=1e-9
    )


def test_sizes_of_the_systems():
    """Vectors of variables and of rows: shared, and several."""
    lanes = {name: make().series.terms.shape[1] for name, make in SYSTEMS.items()}
    assert list(lanes.values()) == [8, 8, 8, 16, 24, 24] and WIDE == 10
