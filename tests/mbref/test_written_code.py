"""Machine code written for a scene against the kernels as plain Python, both on the same memory.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled
but the scenes' own code, without optimisation.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.kernels.layout import OK
from mbref.method import Method
from mbref.scene import Moment
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits
from mbref.simulation.start_run import start_run
from mbref.taylor.correction import subtract_violation, violation_in_loops, violation_rate_in_loops
from mbref.taylor.generated import build
from mbref.taylor.generated.instructions import levels
from mbref.taylor.layout import TaylorMemory
from mbref.taylor.series import expand_with_multipliers
from mbref.taylor.solver import add_functions, respond_in_loops

ORDER = 9
POINTERS = {"expand": 7, "expand_by_power": 5, "factorise": 8, "violation": 2, "close": 4, "close_rate": 4}
MECHANISMS = {  # functions besides the corrections
    "planar_slider_crank": ("expand", "factorise"),
    "four_bar_gravity": ("expand", "expand_by_power", "factorise"),
    "sarrus": ("expand", "expand_by_power", "factorise"),
    "heavy_top": ("expand", "factorise"),
    "spatial_slider_crank_driven": ("expand", "factorise"),
}


MOMENTS = {
    "four_bar_gravity": (3.0, 5.0, 2.0)
}  # N m, on the first body: forces that are linear in the variables
STARTS: dict[str, np.ndarray] = {}  # values of the variables at the start, by name


def target_machine() -> llvm.TargetMachine:
    """Return this machine, for code without optimisation."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=0, jit=True
    )


@functools.cache
def written(name: str) -> tuple[TaylorMemory, Callable[..., None], tuple[str, ...]]:
    """Return the memory of a scene's series, a call of functions of its code, and their names."""
    method = Method.parse(f"taylor[order={ORDER}]")
    scene = SCENES[name]()
    if name in MOMENTS:
        scene = scene.with_(load=(Moment(body=scene.body[0].name, moment=MOMENTS[name]),))
    run = start_run(scene, method, np.array([0.1]), Limits(code="generic"))
    assert run.stepper.expand() == OK
    taylor = run.stepper.taylor
    names = build.names_of_functions(taylor)
    machine = target_machine()
    module = llvm.parse_assembly(build.write_code(taylor, names))
    module.verify()
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()

    def call(function: str, *arguments: Any) -> None:
        assert engine  # keeps the code
        counts = [value for value in arguments if isinstance(value, int)]
        kinds = [ctypes.c_void_p] * POINTERS[function] + [ctypes.c_int64] * len(counts)
        pointers = [array.ctypes.data for array in arguments[: POINTERS[function]]]
        ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address(function))(*pointers, *counts)

    STARTS[name] = taylor.series.terms[0].copy()
    return taylor, call, names


def numbers(shape: tuple[int, ...]) -> np.ndarray:
    """Return numbers between 0.2 and 1, none of which repeats."""
    return 0.2 + 0.8 * (np.arange(np.prod(shape)) * 0.6180339887 % 1.0).reshape(shape)


def moved(taylor: TaylorMemory) -> None:
    """Put values and rates into memory that obey no row: the code computes as the kernels do there, too."""
    nz, nr = taylor.solver.pivot_columns.size, taylor.solver.pivot_rows.size
    terms, functions = taylor.series.terms, taylor.polynomials.given.driver.size
    terms[:] = 0.0
    terms[:2, :nz] = numbers((2, nz))
    terms[:, nz + nr : nz + nr + functions] = 0.3 + numbers((len(terms), functions))


def results(taylor: TaylorMemory, run: Callable[[], object], *arrays: np.ndarray) -> list[np.ndarray]:
    """Return copies of arrays after a run from one state of memory."""
    before = taylor.series.terms.copy()
    run()
    found = [array.copy() for array in arrays]
    taylor.series.terms[:] = before
    return found


@pytest.mark.parametrize("name", MECHANISMS)
def test_violations_and_corrections(name):
    taylor, call, names = written(name)
    assert set(names) == {*MECHANISMS[name], "violation", "close", "close_rate"}
    series, solver = taylor.series, taylor.solver
    nz, nr = solver.pivot_columns.size, solver.pivot_rows.size
    rows = slice(nz, nz + nr)
    moved(taylor)
    [expected] = results(taylor, lambda: violation_in_loops(taylor), solver.phi[rows])
    solver.phi[:] = 0.0
    [found] = results(taylor, lambda: call("violation", series.terms, solver.phi), solver.phi[rows])
    assert found == pytest.approx(expected, rel=1e-13) and abs(expected).min() > 0.01, name
    solver.response[:] = 0.0
    solver.response[rows, :nz] = numbers((nr, nz))

    def close_rate() -> None:
        violation_rate_in_loops(taylor)
        subtract_violation(1, taylor)

    arrays = series.terms[:2], solver.change[:nz]
    for function, by_loops in (("close", lambda: subtract_violation(0, taylor)), ("close_rate", close_rate)):
        violation_in_loops(taylor)
        expected = results(taylor, by_loops, *arrays)
        violation_in_loops(taylor)
        code = lambda: call(function, series.terms, solver.phi, solver.response, solver.change)  # noqa: B023, E731
        for one, other in zip(results(taylor, code, *arrays), expected, strict=True):
            assert one == pytest.approx(other, rel=1e-12)


@pytest.mark.parametrize("name", MECHANISMS)
def test_response(name):
    """By power there is a response to rows alone."""
    taylor, call, names = written(name)
    solver, series, rank = taylor.solver, taylor.series, taylor.partition.rank
    nz, nr = solver.pivot_columns.size, solver.pivot_rows.size
    moved(taylor)
    kept = slice(nz, nz + nr) if "expand_by_power" in names else slice(nz + nr)
    lanes = slice(nz) if "expand_by_power" in names else slice(nz + nr)
    arrays = (
        solver.response[kept, lanes],
        solver.last,
        solver.particular[:, nz:],
        solver.null_space[: nz - rank, :nz],
    )
    expected = results(taylor, lambda: respond_in_loops.function(taylor), *arrays)
    for array in (solver.response, solver.last, solver.particular, solver.null_space):
        array[:] = 0.0
    code = lambda: call(  # noqa: E731
        "factorise",
        series.terms,
        solver.tableau,
        solver.particular,
        solver.null_space,
        solver.response,
        solver.last,
        solver.pivot_rows,
        solver.pivot_columns,
    )
    for one, other in zip(results(taylor, code, *arrays), expected, strict=True):
        assert np.abs(one - other).max(initial=0.0) <= 1e-11 * np.abs(other).max(initial=1.0)


@pytest.mark.parametrize("name", MECHANISMS)
@pytest.mark.parametrize("last", (0, 1, 4, 7))
def test_orders_with_multipliers(name, last):
    taylor, call, _ = written(name)
    solver, series = taylor.solver, taylor.series
    moved(taylor)
    taylor.mode.order = last + 2
    ng = taylor.polynomials.given.driver.size
    respond_in_loops.function(taylor)
    if ng:
        add_functions(ng, taylor)
    [expected] = results(taylor, lambda: expand_with_multipliers.function(taylor), series.terms[: last + 3])
    code = lambda: call(  # noqa: E731
        "expand",
        series.terms,
        solver.response,
        series.left,
        series.right,
        series.scale,
        series.growth,
        solver.rhs,
        last,
    )
    [found] = results(taylor, code, series.terms[: last + 3])
    sizes = np.abs(expected).max(axis=1)
    columns = slice(solver.pivot_columns.size) if not taylor.options.start_freedoms else slice(None)
    assert (np.abs(found - expected)[:, columns].max(axis=1) <= 1e-10 * sizes).all() and sizes.min() > 0.0


@pytest.mark.parametrize("name", [name for name in MECHANISMS if "expand_by_power" in MECHANISMS[name]])
@pytest.mark.parametrize("last", (0, 1, 4, 7))
def test_orders_by_power(name, last):
    """Where values and rates obey the rows, as multipliers give them; the code also returns v·Q / (v·Mv)."""
    taylor, call, _ = written(name)
    solver, series = taylor.solver, taylor.series
    nz = solver.pivot_columns.size
    moved(taylor)
    taylor.mode.order = last + 2
    series.terms[0] = STARTS[name]
    respond_in_loops.function(taylor)
    velocity = 0.7 * solver.null_space[0, :nz]
    series.terms[1, :nz] = velocity
    [expected] = results(taylor, lambda: expand_with_multipliers.function(taylor), series.terms[: last + 3])
    code = lambda: call(  # noqa: E731
        "expand_by_power", series.terms, solver.response, series.left, series.right, solver.rhs, last
    )
    found, rhs = results(taylor, code, series.terms[: last + 3], solver.rhs)
    sizes = np.abs(expected[:, :nz]).max(axis=1)
    assert (np.abs(found - expected)[:, :nz].max(axis=1) <= 1e-8 * sizes).all() and sizes.min() > 0.0
    inertia = taylor.polynomials.inertia
    force = inertia.force[:nz].copy()
    for block in range(inertia.start.size - 1):
        for c in range(inertia.start[block], inertia.start[block + 1]):
            lane = 8 * block + (c - inertia.start[block]) % 8
            if lane < nz:
                force[lane] += inertia.weight[c] * series.terms[0, inertia.source[c]]
    energy = velocity @ inertia.mass[:nz, :nz] @ velocity
    assert rhs[0] == pytest.approx(velocity @ force / energy, rel=1e-12)


def test_terms_of_each_number_one_at_a_time():
    first, second = levels([[(2.0, 5), (3.0, 6)], [], [(4.0, 7)]])
    assert first[0].tolist() == [2.0, 0.0, 4.0] + [0.0] * 5 and first[1] == [5, -1, 7] + [-1] * 5
    assert second[0].tolist() == [3.0] + [0.0] * 7 and second[1] == [6] + [-1] * 7
