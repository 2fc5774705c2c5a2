"""C functions on MuJoCo's data, as plain Python on stand-ins for its memory / values worked out by hand.

The context has arrays instead of addresses, and functions of a mechanism whose closures are known instead of
MuJoCo's functions.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numba import types
from numba.extending import register_jitable

from crosscheck.engines.compiled import calls, newton, run
from crosscheck.engines.mujoco import closures, context, rates
from crosscheck.engines.sampling import Counts
from mbref.trajectory import Outcome

SCALE = 2.0  # of the entries of rows; smaller ones than 1e-12 are rounding


@register_jitable
def twice(x: float) -> float:
    return 2.0 * x


def twice_and_one(x: float) -> float:
    return twice(x) + 1.0


def test_functions_for_c_code_are_compiled_without_jit_too(monkeypatch, tmp_path):
    """The cache is empty, so that the function is compiled."""
    monkeypatch.setattr(calls.config, "DISABLE_JIT", 1)
    monkeypatch.setattr(calls.config, "CACHE_DIR", str(tmp_path))
    found = calls.c_function(types.float64(types.float64))(twice_and_one)
    assert found.address and found.ctypes(1.5) == 4.0
    assert calls.config.DISABLE_JIT == 1 and list(tmp_path.rglob("*.nbi"))


# --- linear algebra ---------------------------------------------------------------------------------------
def test_the_root_of_a_mass_matrix_and_its_inverse():
    mass = np.array([[4.0, 2.0, -1.0], [2.0, 5.0, 0.5], [-1.0, 0.5, 3.0]])
    root = mass.copy()
    closures.root_of(root, 3)
    lower = np.linalg.cholesky(mass)
    assert np.tril(root) == pytest.approx(lower) and root[0, 2] == -1.0, "the upper part is unused"
    row, change = np.array([1.0, -2.0, 3.0]), np.array([1.0, -2.0, 3.0])
    closures.spread(root, row, 3)
    closures.gather(root, change, 3)
    assert row == pytest.approx(np.linalg.solve(lower, [1.0, -2.0, 3.0]))
    assert change == pytest.approx(np.linalg.solve(lower.T, [1.0, -2.0, 3.0]))


def test_the_largest_of_the_rows_that_are_left():
    rows = np.array([[9.0, 0.0, 5.0], [1.0, -2.0, 5.0], [3.0, 1.0, 5.0], [-1.0, 3.0, 5.0], [7.0, 7.0, 5.0]])
    assert closures.largest(rows, 1, 4, 2) == (2, 10.0), "the first of two, of two entries each"
    assert closures.largest(rows, 0, 4, 2) == (0, 81.0) and closures.largest(rows, 3, 4, 2) == (3, 10.0)
    assert closures.largest(np.zeros((2, 2)), 0, 2, 2) == (-1, 0.0)


def change_of(rows: Any, wanted: Any) -> np.ndarray:
    change = np.full(len(rows[0]) + 1, 9.0)
    closures.least(np.array(rows), np.array(wanted), change, len(rows), len(rows[0]))
    assert change[-1] == 9.0
    return change[:-1]


def test_changes_of_least_norm():
    rows, wanted = [[1.0, 2.0, 0.5], [0.0, 3.0, -1.0]], [4.0, -2.0]
    assert change_of(rows, wanted) == pytest.approx(np.linalg.lstsq(rows, wanted)[0])
    twice = [rows[0], rows[1], np.add(*rows).tolist()]
    assert change_of(twice, [4.0, -2.0, 2.0]) == pytest.approx(np.linalg.lstsq(rows, wanted)[0])
    square = [[2.0, 1.0], [0.5, -3.0], [2.5, -2.0]]
    assert change_of(square, [1.0, 2.0, 3.0]) == pytest.approx(np.linalg.solve(square[:2], [1.0, 2.0]))
    assert change_of([[0.0, 0.0]], [5.0]).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("off", "is_used"), [(4.1e-7, True), (3.9e-7, False)])
def test_rows_that_nearly_depend_on_others_are_left_out(off, is_used):
    """The second row is 4 along the first and a bit more or less than 4e-7 across it."""
    change = change_of([[4.0, 0.0], [4.0, off]], [8.0, 8.0 + 3 * off])
    assert change == pytest.approx([2.0, 3.0 if is_used else 0.0], abs=1e-6)


def test_components_of_a_row_are_subtracted_from_later_rows():
    """The second row, of length 5, is normalised; the third has 11/5 along it. The first stays."""
    rows, wanted = np.array([[7.0, 7.0], [3.0, 4.0], [1.0, 2.0]]), np.array([1.0, 10.0, 3.0])
    closures.subtract(rows, wanted, 1, 3, 2, 1 / 5)
    assert rows == pytest.approx(np.array([[7.0, 7.0], [0.6, 0.8], [1 - 2.2 * 0.6, 2 - 2.2 * 0.8]]))
    assert wanted == pytest.approx([1.0, 2.0, 3.0 - 2.2 * 2.0])


def test_rows_that_no_coordinate_moves():
    assert closures.moves(np.array([1e-13, -3e-12]), 2e-12) and not closures.moves(np.array([2e-12]), 2e-12)
    assert not closures.moves(np.zeros(2), 0.0)


# --- closures ---------------------------------------------------------------------------------------------
MASS = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]])
ROWS = np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 2.0]])


class Plane:
    """Two linear closures ROWS · q = (3, -2) of three coordinates, and a context of arrays."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, is_weighted: bool = True, drives: int = 0) -> None:
        self.q, self.v, self.calls = np.zeros(3), np.zeros(3), []
        self.gaps, self.rows, self.acting = np.zeros(2), ROWS.copy(), np.zeros(3)
        most = 4
        self.work = np.zeros(most * 4 + 3 * 5 + 1)
        self.work[-1] = 1e-12 * SCALE
        self.table = np.zeros((drives, context.POLYNOMIAL + 2))
        parts: dict[int, Any] = {
            context.NQ: 3, context.NV: 3, context.MOST_ROWS: most, context.WEIGHTED: int(is_weighted),
            context.WORK: self.work, context.QPOS: self.q, context.QVEL: self.v, context.FORCE: self.acting,
            context.COUNT: [2], context.JACOBIAN: [self.rows], context.RESIDUALS: [self.gaps],
            context.DRIVE: self.table, context.DRIVES: drives, context.DRIVE_WIDTH: self.table.shape[1],
            context.MODEL: "model", context.DATA: "data", context.FULL_MASS: self.weigh,
            context.KINEMATICS: self.note("kinematics"), context.CENTRES: self.note("centres"),
            context.CLOSURES: self.place, context.POSITION_STAGE: self.place, context.INTEGRATE: self.move,
            context.SINGLES: 1, context.SINGLE: np.array([[2, 0]]), context.TURNS: 0, context.TURN: [],
        }  # fmt: skip
        self.context = [parts.get(k, 0) for k in range(context.WIDTH)]
        for module in (closures, rates):
            monkeypatch.setattr(module, "carray", memory)
            for name in ("reals", "integers", "small_integers", "call_with_two", "call_with_three"):
                if hasattr(module, name):
                    same = name in ("reals", "integers", "small_integers")
                    monkeypatch.setattr(module, name, (lambda pointer: pointer) if same else called)
        monkeypatch.setattr(closures, "call_with_three_and_real", called)

    def note(self, name: str) -> Callable[..., None]:
        return lambda *given: self.calls.append((name, given))

    def place(self, *given: Any) -> None:
        self.calls.append(("closures", given))
        self.gaps[:] = ROWS @ self.q - [3.0, -2.0]

    def weigh(self, model: str, data: str, address: int) -> None:
        self.calls.append(("mass", (model, data)))
        np.ctypeslib.as_array((ctypes.c_double * 9).from_address(address)).reshape(3, 3)[:] = MASS

    def move(self, model: str, q: np.ndarray, change: Any, span: float) -> None:
        if not isinstance(change, np.ndarray):
            change = np.ctypeslib.as_array((ctypes.c_double * 3).from_address(change))
        self.calls.append(("move", (model, span)))
        q += change * span


def memory(pointer: Any, shape: tuple[int, ...]) -> Any:
    """The array or the list in place of a pointer."""
    if isinstance(pointer, list):
        return pointer
    count = math.prod(shape)
    return np.asarray(pointer).reshape(-1)[:count].reshape(shape)


def called(function: Callable[..., None], *given: Any) -> None:
    function(*given)


def nearest(q: np.ndarray, weight: np.ndarray, rows: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """The coordinates with rows · change = -gap of least change, weighed by a mass matrix."""
    spread = np.linalg.solve(weight, rows.T)
    return q - spread @ np.linalg.solve(rows @ spread, gap)


def test_memory_of_a_projection(monkeypatch):
    """Rows (4, 3), their values, the root of the mass matrix and a change do not overlap; then one number."""
    plane = Plane(monkeypatch)
    found = closures.parts(plane.context)
    assert [part.shape for part in found] == [(4, 3), (4,), (3, 3), (3,)]
    for k, part in enumerate(found):
        part[:] = k + 1
    assert plane.work[:-1].tolist() == [1.0] * 12 + [2.0] * 4 + [3.0] * 9 + [4.0] * 3 + [0.0] * 3
    assert closures.smallest(plane.context) == 2e-12
    assert closures.residuals(plane.context) is not None


def test_rows_of_closures_with_and_without_the_mass(monkeypatch):
    """An entry of 1e-12 is rounding; without weights the column of a driven coordinate is zero."""
    plane = Plane(monkeypatch)
    rows, _, root, _ = closures.parts(plane.context)
    closures.weigh(plane.context, root)
    lower = np.linalg.cholesky(MASS)
    assert np.tril(root) == pytest.approx(lower)
    assert closures.fetch(plane.context, rows, root) == 2
    assert rows[:2] == pytest.approx(np.linalg.solve(lower, ROWS.T).T)
    plane.rows[0] = 1e-12, -2e-12, 0.0
    closures.fetch(plane.context, rows, root)
    assert not rows[0].any() and rows[1].any()
    driven = Plane(monkeypatch, is_weighted=False, drives=1)
    driven.table[0, context.VELOCITY] = 1
    rows, _, root, _ = closures.parts(driven.context)
    closures.weigh(driven.context, root)
    assert not root.any(), "no mass is asked for"
    closures.fetch(driven.context, rows, root)
    assert rows[:2].tolist() == [[1.0, 0.0, -1.0], [0.5, 0.0, 2.0]]


@pytest.mark.parametrize("is_weighted", [True, False])
def test_positions_are_moved_onto_the_closures(monkeypatch, is_weighted):
    plane = Plane(monkeypatch, is_weighted)
    plane.q[:] = start = np.array([0.7, -0.4, 1.1])
    gap = ROWS @ start - [3.0, -2.0]
    assert closures.meet(plane.context, 1e-13) == 2
    assert plane.q == pytest.approx(nearest(start, MASS if is_weighted else np.eye(3), ROWS, gap))
    first = ["closures", "mass"] if is_weighted else ["kinematics", "centres", "closures"]
    assert [name for name, _ in plane.calls] == [*first, "move", "kinematics", "centres", "closures"]
    assert {given[:2] for name, given in plane.calls if name != "move"} == {("model", "data")}
    assert [given for name, given in plane.calls if name == "move"] == [("model", 1.0)]


@pytest.mark.parametrize(
    ("off", "count"), [(1e-13, 1), (1.1e-13, 10), (0.9e-8, 10), (1e-8, -10), (math.nan, 1)]
)
def test_closures_that_stay_open(monkeypatch, off, count):
    """Newton's method ends at the tolerance; after ten iterations less than 1e-8 is enough."""
    plane = Plane(monkeypatch)
    plane.place = plane.context[context.POSITION_STAGE] = plane.context[context.CLOSURES] = lambda *_: (
        plane.gaps.__setitem__(slice(None), [off / 2, -off])
    )
    assert closures.meet(plane.context, 1e-13) == count


def test_velocities_that_the_closures_allow(monkeypatch):
    plane = Plane(monkeypatch)
    _, _, root, _ = closures.parts(plane.context)
    closures.weigh(plane.context, root)
    plane.v[:] = start = np.array([0.3, 2.0, -1.5])
    closures.meet_rates(plane.context, plane.v)
    assert plane.v == pytest.approx(nearest(start, MASS, ROWS, ROWS @ start))
    assert ROWS @ plane.v == pytest.approx([0.0, 0.0], abs=1e-14)


def test_a_state_is_settled(monkeypatch):
    plane, y = Plane(monkeypatch), np.array([0.7, -0.4, 1.1, 0.3, 2.0, -1.5])
    before = y.copy()
    assert closures.settle.__wrapped__(plane.context, 0.5, y, None) == closures.MET == 0
    assert y[:3] == pytest.approx(nearest(before[:3], MASS, ROWS, ROWS @ before[:3] - [3.0, -2.0]))
    assert y[3:] == pytest.approx(nearest(before[3:], MASS, ROWS, ROWS @ before[3:]))
    plane.context[context.MOST_ROWS] = 0
    untouched = before.copy()
    assert closures.settle.__wrapped__(plane.context, 0.5, untouched, None) == 0
    assert untouched.tolist() == before.tolist() and plane.q.tolist() == before[:3].tolist()
    lost = Plane(monkeypatch)
    lost.context[context.POSITION_STAGE] = lost.context[context.CLOSURES] = lambda *_: lost.gaps.fill(1.0)
    y = before.copy()
    assert closures.settle.__wrapped__(lost.context, 0.5, y, None) == closures.NOT_MET == 1
    assert y.tolist() == before.tolist()


def test_a_state_follows_its_drivers(monkeypatch):
    """From 0.5 to 0.75 s by the velocities; the first coordinate is driven by 2 t. One evaluation more."""
    plane = Plane(monkeypatch, is_weighted=False, drives=1)
    plane.table[0, context.POLYNOMIAL + 1] = 2.0
    y = np.array([1.0, -0.4, 1.1, 2.0, 2.0, -1.5])
    numbers = np.array([1e-13, 7.0, 0.5])
    assert closures.follow.__wrapped__(plane.context, 0.75, y, numbers) == closures.MET
    assert numbers.tolist() == [1e-13, 9.0, 0.75]
    gone = np.array([1.5, -0.4 + 0.25 * 2.0, 1.1 - 0.25 * 1.5])
    free = ROWS[:, 1:]
    assert y[0] == 1.5 and y[3] == 2.0
    assert y[1:3] == pytest.approx(gone[1:] - np.linalg.solve(free, ROWS @ gone - [3.0, -2.0]))
    assert y[4:] == pytest.approx(np.linalg.solve(free, -2.0 * ROWS[:, 0]))
    assert plane.calls[0] == ("move", ("model", 0.25))
    lost = Plane(monkeypatch, is_weighted=False)
    lost.context[context.CLOSURES] = lambda *_: lost.gaps.fill(1.0)
    assert closures.follow.__wrapped__(lost.context, 0.75, y, numbers) == closures.NOT_MET
    assert numbers.tolist() == [1e-13, 19.0, 0.75], "ten evaluations, and the time stays"


# --- rates ------------------------------------------------------------------------------------------------
def test_a_prescribed_coordinate():
    """0.3 - 0.2 t + 0.5 t² + 0.7 t³ + 0.4 sin(3 t + 0.6) at 0.5 s, its rate and the force of its slope."""
    drive = np.zeros(context.POLYNOMIAL + 4)
    drive[[context.POSITION, context.VELOCITY, context.INERTIA]] = 2, 1, 5.0
    drive[[context.AMPLITUDE, context.FREQUENCY, context.PHASE]] = 0.4, 3.0, 0.6
    drive[context.POLYNOMIAL :] = 0.3, -0.2, 0.5, 0.7
    q, v, force = np.full(3, 9.0), np.full(2, 9.0), np.full(2, 9.0)
    rates.prescribe(drive, 0.5, q, v, force)
    assert q == pytest.approx([9.0, 9.0, 0.3 - 0.1 + 0.125 + 0.0875 + 0.4 * math.sin(2.1)])
    assert v == pytest.approx([9.0, -0.2 + 0.5 + 0.525 + 1.2 * math.cos(2.1)])
    assert force == pytest.approx([9.0, 5.0 * (1.0 + 2.1 - 3.6 * math.sin(2.1))])


def test_rates_of_a_quaternion():
    """q (0, ω) / 2 of a unit quaternion in the direction of q."""
    q, omega, out = np.array([1.5, -2.0, 3.0, 0.5]), np.array([0.7, -1.1, 0.4]), np.zeros(4)
    rates.turn_rates(q, omega, out)
    w, v = q[0], q[1:]
    product = np.array([-v @ omega, *(w * omega + np.cross(v, omega))])
    assert out == pytest.approx(product / np.linalg.norm(q) / 2)


def test_rates_of_a_state(monkeypatch):
    """A slide at qpos 4 with velocity 3, and a ball at 0 to 3 with velocities 0 to 2."""
    plane = Plane(monkeypatch)
    q, v, a, seen = np.zeros(5), np.zeros(4), np.zeros(4), []

    def forward(*given: Any) -> None:
        seen.append((*given, q.tolist(), v.tolist()))
        a[:] = 10.0, 20.0, 30.0, 40.0

    c = plane.context
    c[context.NQ], c[context.NV], c[context.QPOS], c[context.QVEL], c[context.QACC] = 5, 4, q, v, a
    c[context.SINGLE], c[context.SINGLES] = np.array([[4, 3]]), 1
    c[context.TURN], c[context.TURNS], c[context.FORWARD] = np.array([[0, 0]]), 1, forward
    y, out = np.array([0.6, 0.0, 0.8, 0.0, 2.5, 1.0, 2.0, 3.0, 4.0]), np.zeros(9)
    assert rates.rates.__wrapped__(c, 0.25, y, out) == 0
    assert seen == [("model", "data", y[:5].tolist(), y[5:].tolist())]
    turned = np.zeros(4)
    rates.turn_rates(y[:4], y[5:8], turned)
    assert out == pytest.approx([*turned, 4.0, 10.0, 20.0, 30.0, 40.0])


# --- steps ------------------------------------------------------------------------------------------------
def following(statuses: list[int], spoil: int = -1) -> tuple[Any, Any, list[tuple]]:
    """A system of steps of at most 0.1 s whose function adds its time to the state."""
    asked: list[tuple] = []
    memory_ = SimpleNamespace(y=np.array([1.0, 2.0]), clock=np.array([0.5]), counts=np.zeros(3, dtype=int))

    def follow(function: int, place: int, t: float, y: int, numbers: int) -> int:
        asked.append((function, place, t))
        memory_.y[0] = math.nan if len(asked) == spoil else t
        np.ctypeslib.as_array((ctypes.c_double * 3).from_address(numbers))[1] += 2
        return statuses[len(asked) - 1] if len(asked) <= len(statuses) else 0

    return newton.System(11, 22, 1e-9, 0.1), memory_, (asked, follow)


def test_equal_steps_to_a_sample(monkeypatch):
    """0.25 s in three steps; a span that exceeds steps by a billionth has none more."""
    system, memory_, (asked, follow) = following([])
    monkeypatch.setattr(newton, "rates_of", follow)
    assert newton.advance(system, 0.75, memory_, np.zeros(3)) == newton.REACHED
    assert asked == [(11, 22, pytest.approx(0.5 + 0.25 * k / 3)) for k in (1, 2, 3)] and asked[-1][2] == 0.75
    assert memory_.clock[0] == 0.75 and memory_.counts[newton.STEPS] == 3
    assert newton.advance(system, 0.95 + 1e-11, memory_, np.zeros(3)) == newton.REACHED and len(asked) == 5
    assert newton.advance(system, 0.95 + 1e-11, memory_, np.zeros(3)) == newton.REACHED and len(asked) == 6
    assert newton.advance(system, 1.15 + 1e-8, memory_, np.zeros(3)) == newton.REACHED and len(asked) == 9


def test_steps_that_fail(monkeypatch):
    system, memory_, (_, follow) = following([0, 1])
    monkeypatch.setattr(newton, "rates_of", follow)
    assert newton.advance(system, 0.75, memory_, np.zeros(3)) == newton.NOT_MET == 10
    assert memory_.counts[newton.STEPS] == 1 and memory_.clock[0] == pytest.approx(0.5 + 0.25 / 3)
    system, memory_, (_, follow) = following([], spoil=2)
    monkeypatch.setattr(newton, "rates_of", follow)
    assert newton.advance(system, 0.75, memory_, np.zeros(3)) == newton.NOT_FINITE
    assert memory_.counts[newton.STEPS] == 1


def test_samples_of_a_followed_motion(monkeypatch):
    integrate = getattr(newton.integrate, "py_func", newton.integrate)
    system, memory_, (_, follow) = following([])
    monkeypatch.setattr(newton, "rates_of", follow)
    times, samples = np.array([0.5, 0.6, 0.65]), np.zeros((3, 2))
    assert integrate(system, times, samples, memory_) == (newton.REACHED, 3)
    assert samples.tolist() == [[0.5, 2.0], [0.6, 2.0], [0.65, 2.0]]
    assert memory_.counts[newton.EVALUATIONS] == 6 and memory_.counts[newton.STEPS] == 3
    system, memory_, (_, follow) = following([0, 1])
    monkeypatch.setattr(newton, "rates_of", follow)
    samples = np.zeros((3, 2))
    assert integrate(system, times, samples, memory_) == (newton.NOT_MET, 1)
    assert samples[0].tolist() == [0.5, 2.0] and not samples[1:].any()
    assert memory_.counts[newton.EVALUATIONS] == 4


@pytest.mark.parametrize(
    ("status", "outcome", "says"),
    [
        (run.dop853.NOT_FINITE, Outcome.NOT_FINITE, "the motion is not finite after 0.25 s"),
        (run.dop853.TOO_SMALL, Outcome.STEP_FAILED, "no step after 0.25 s is short enough for the tolerance"),
        (run.dop853.TOO_MANY, Outcome.STEP_FAILED, "7 steps have only reached 0.25 s"),
        (run.dop853.REFUSED, Outcome.STEP_FAILED, "the engine gives no accelerations after 0.25 s"),
        (newton.NOT_MET, Outcome.NOT_CONVERGED, "the closures could not be met after 0.25 s"),
    ],
)
def test_ends_of_compiled_runs(status, outcome, says):
    failed = run._failure(status, 0.25, Counts(7, 2, 3))
    assert (failed.outcome, failed.t, str(failed)) == (outcome, 0.25, says)


def test_a_c_function_called_by_its_address():
    """The function returns its second number and writes twice its state."""

    @calls.RATES
    def doubles(place: int, t: float, y: int, out: int) -> int:
        state, found = (np.ctypeslib.as_array((ctypes.c_double * 2).from_address(p)) for p in (y, out))
        found[:] = 2 * state + place
        return int(4 * t)

    y, out = np.array([1.5, -2.0]), np.zeros(2)
    address = ctypes.cast(doubles, ctypes.c_void_p).value
    assert calls._plain_rates_of(address, 3, 0.75, y.ctypes.data, out.ctypes.data) == 3
    assert out.tolist() == [6.0, -1.0]
