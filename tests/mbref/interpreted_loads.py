"""Series of loads, with interpreted kernels / coefficients by Cauchy's integral of the loads themselves.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.taylor import loads

ORDERS, NZ = 5, 2
# two variables as polynomials of time, by order
X = np.array([[0.3, -0.2], [0.5, 0.7], [-0.4, 0.25], [0.2, -0.6], [0.15, 0.35], [-0.1, 0.05], [0.3, 0.2]])
FACTOR = np.array([0.8, -0.3, 0.6, 0.2, -0.5, 0.4, 0.1])


def at(z: np.ndarray) -> np.ndarray:
    """Return the variables (k, 2) at complex times (k,)."""
    return np.stack([np.polyval(X[::-1, i], z) for i in range(NZ)], axis=-1)


def coefficients(function: Callable[[np.ndarray], np.ndarray], orders: int = ORDERS) -> np.ndarray:
    """Return the first Taylor coefficients of a function of time, from its values on a circle."""
    radius, count = 0.1, 64
    z = radius * np.exp(2j * np.pi * np.arange(count) / count)
    found = np.fft.fft(function(z)) / count
    return (found[:orders] / radius ** np.arange(orders)).real


def numbers(*shape: int, seed: float = 1.0) -> np.ndarray:
    """Return numbers between -1 and 1, none of which repeats."""
    return np.cos(seed + 2.4 * np.arange(np.prod(shape))).reshape(shape)


def series(**polynomials: Any) -> Any:
    """Memory of two variables in eight lanes, and the loads given."""
    terms = np.zeros((ORDERS + 2, 8))
    terms[:, :NZ] = X
    terms[:, NZ:] = 99.0
    return SimpleNamespace(
        polynomials=SimpleNamespace(**polynomials),
        series=SimpleNamespace(
            terms=terms,
            past=terms.copy(),
            sums=np.zeros((ORDERS, 8)),
            factors=np.stack([numbers(7), FACTOR]),
            springs=np.zeros((2 * loads.SPRING_SERIES, ORDERS + 2)),
            torsions=np.zeros((2 * loads.TORSION_SERIES, ORDERS + 2)),
            slides=np.zeros((2 * loads.SLIDE_SERIES, ORDERS + 2)),
        ),
        solver=SimpleNamespace(pivot_columns=np.zeros(NZ)),
        angles=np.array([0.0, 2 * math.pi]),
    )


def forms(constant: np.ndarray, form: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return affine forms (k, c) of the variables at times (k,)."""
    return constant + at(z) @ form.T


def grown(memory: Any, grow: Callable[[int, Any], None], add: Callable[[int, Any], None]) -> np.ndarray:
    """Return the sums of the variables after all orders."""
    for k in range(ORDERS + 2):
        grow(k, memory)
    for k in range(ORDERS):
        add(k, memory)
    assert not memory.series.sums[:, NZ:].any()
    return memory.series.sums[:, :NZ]


def test_products_of_series_and_constant_loads():
    a, b = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    assert [loads.product_order(a, b, k) for k in range(3)] == [4.0, 13.0, 28.0]
    factors = np.array([[7.0, 8.0], [9.0, 0.5]])
    assert loads.applied_order(3.0, 1, 1, factors) == 1.5 and loads.applied_order(3.0, 0, 0, factors) == 21.0
    assert loads.applied_order(3.0, -1, 0, factors) == 3.0 and loads.applied_order(3.0, -1, 1, factors) == 0.0


def springs() -> Any:
    return SimpleNamespace(
        constant=np.array([[1.5, 0.4, -0.7], [-0.6, 2.0, 0.3]]),
        form=numbers(6, NZ),
        stiffness=np.array([3.0, 5.0]),
        natural=np.array([0.9, 0.0]),
        damping=np.array([0.25, 0.0]),
    )


def test_forces_of_springs():
    """A damped spring with a natural length, and one that is linear in the variables."""
    of = springs()
    memory = series(springs=of)
    expected = np.zeros((ORDERS, NZ))
    for s in range(2):
        form = of.form[3 * s : 3 * s + 3]

        def vector(z: np.ndarray) -> np.ndarray:
            return forms(of.constant[s], form, z)  # noqa: B023

        def pull(z: np.ndarray) -> np.ndarray:
            d = vector(z)
            length = np.sqrt((d * d).sum(axis=-1))
            step = 1e-6
            rate = (
                np.sqrt((vector(z + step) ** 2).sum(axis=-1)) - np.sqrt((vector(z - step) ** 2).sum(axis=-1))
            ) / (2 * step)
            return of.stiffness[s] * (1 - of.natural[s] / length) + of.damping[s] * rate / length  # noqa: B023

        for i in range(NZ):
            expected[:, i] += coefficients(lambda z: pull(z) * (vector(z) @ form[:, i]))  # noqa: B023
    assert grown(memory, loads.grow_springs, loads.add_springs) == pytest.approx(expected, rel=1e-6, abs=1e-7)
    length = memory.series.springs[loads.SPRING_LENGTH]
    d0 = of.constant[0] + of.form[:3] @ X[0]
    assert length[0] == pytest.approx(np.linalg.norm(d0))
    assert memory.series.springs[loads.SPRING_SERIES + loads.SPRING_INVERSE, 0] == 0.0


def test_times_and_parts_of_springs_without_length():
    of = springs()
    memory = series(springs=of)
    for k in range(2):
        loads.grow_springs(k, memory)
    speed = np.linalg.norm(of.form[:3] @ X[1])
    d0 = of.constant[0] + of.form[:3] @ X[0]
    assert loads.time_to_no_length(memory) == pytest.approx(np.linalg.norm(d0) / speed)
    of.damping[1] = 0.5
    loads.grow_springs(0, memory)
    other = np.linalg.norm(of.constant[1] + of.form[3:] @ X[0]) / np.linalg.norm(of.form[3:] @ X[1])
    assert loads.time_to_no_length(memory) == pytest.approx(min(other, np.linalg.norm(d0) / speed))
    of.natural[:], of.damping[:] = 0.0, 0.0
    assert loads.time_to_no_length(memory) == math.inf
    of.natural[:] = 1.0
    of.form[:] = 0.0
    of.form[[0, 3], [0, 1]] = 1.0
    of.constant[:] = 0.0
    memory.series.past[0, :NZ], memory.series.terms[0, :NZ] = (3.0, 2.0), (-1.0, -6.0)
    assert loads.part_behind_no_length(memory) == pytest.approx(0.75), "6 of 8 m behind; 1 of 4 m"
    memory.series.terms[0, 1] = 6.0
    assert loads.part_behind_no_length(memory) == pytest.approx(0.25)
    of.natural[0] = 0.0
    assert loads.part_behind_no_length(memory) == 0.0


def polynomial(constant: np.ndarray, form: np.ndarray) -> list[np.polynomial.Polynomial]:
    """Return affine forms of the variables as polynomials of time."""
    whole = X @ form.T
    whole[0] += constant
    return [np.polynomial.Polynomial(whole[:, c]) for c in range(whole.shape[1])]


def dot(one: list[Any], other: list[Any]) -> Any:
    return sum((a * b for a, b in zip(one, other, strict=True)), np.polynomial.Polynomial([0.0]))


def first(polynomials: Any) -> np.ndarray:
    return np.append(polynomials.coef, np.zeros(ORDERS))[:ORDERS]


AMOUNT, FUNCTIONS = np.array([0.7, -1.3]), np.array([1, -1])


def applied(s: int) -> Any:
    return AMOUNT[s] * np.polynomial.Polynomial(FACTOR if FUNCTIONS[s] >= 0 else [1.0])


def actions() -> dict[str, Any]:
    return {
        "stiffness": np.array([2.0, 3.0]),
        "damping": np.array([0.5, 0.25]),
        "natural": np.array([0.2, -0.4]),
        "amount": AMOUNT,
        "function": FUNCTIONS,
    }


def test_forces_of_loads_about_axes():
    """The angle is the integral of C S' - S C'; the second one has made a turn."""
    of = SimpleNamespace(
        constant=numbers(2, 9, seed=0.3), form=numbers(18, NZ), row=np.array([-1, -1]), **actions()
    )
    memory = series(torsions=of)
    expected = np.zeros((ORDERS, NZ))
    for s in range(2):
        form = of.form[9 * s : 9 * s + 9]
        parts = polynomial(of.constant[s], form)
        e1, e2, f = parts[:3], parts[3:6], parts[6:]
        c, si = dot(e1, f), dot(e2, f)
        begin = math.atan2(si(0.0), c(0.0)) + 2 * math.pi * s
        angle = (c * si.deriv() - si * c.deriv()).integ() + begin
        wanted = memory.angles[s]
        assert abs(begin - wanted) < math.pi + 1e-9
        torque = of.stiffness[s] * (angle - of.natural[s]) + of.damping[s] * angle.deriv() - applied(s)
        for i in range(NZ):
            d1, d2, df = form[:3, i], form[3:6, i], form[6:, i]
            ds = dot(list(d2), f) + dot(e2, list(df))
            dc = dot(list(d1), f) + dot(e1, list(df))
            expected[:, i] += first(torque * (c * ds - si * dc))
    found = grown(memory, loads.grow_torsions, loads.add_torsions)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-11)


def test_rows_of_coupled_angles():
    """Order k + 2 of an angle without that order of the variables; multipliers act two orders later.

    Stiffness, damping and amount of a load count for nothing here.
    """
    of = SimpleNamespace(
        constant=numbers(2, 9, seed=0.3),
        form=numbers(18, NZ),
        row=np.array([1, 0]),
        factor=np.array([0.5, -2.0]),
        **actions(),
    )
    memory = series(torsions=of)
    memory.series.terms[:, NZ : NZ + 2] = multipliers = numbers(ORDERS + 2, 2, seed=0.9)
    expected, of_rows = np.zeros((ORDERS, NZ)), np.zeros((ORDERS, 2))
    for s, row in enumerate(of.row.tolist()):
        form = of.form[9 * s : 9 * s + 9]
        parts = polynomial(of.constant[s], form)
        e1, e2, f = parts[:3], parts[3:6], parts[6:]
        c, si = dot(e1, f), dot(e2, f)
        for k in range(ORDERS):
            moment = np.polynomial.Polynomial([*of.factor[s] * multipliers[2 : k + 2, row], 0.0])
            for i in range(NZ):
                d1, d2, df = form[:3, i], form[3:6, i], form[6:, i]
                change = c * (dot(list(d2), f) + dot(e2, list(df))) - si * (
                    dot(list(d1), f) + dot(e1, list(df))
                )
                expected[k, i] += first(moment * change)[k]
            known = [np.polynomial.Polynomial(each.coef[: k + 2]) for each in parts]
            cosine, sine = dot(known[:3], known[6:]), dot(known[3:6], known[6:])
            angle = (cosine * sine.deriv() - sine * cosine.deriv()).integ()
            of_rows[k, row] += of.factor[s] * angle.coef[k + 2]
    for k in range(ORDERS + 2):
        loads.grow_torsions(k, memory)
    for k in range(ORDERS):
        loads.add_torsions(k, memory)
    assert memory.series.sums[:, :NZ] == pytest.approx(expected, rel=1e-10, abs=1e-12)
    assert memory.series.sums[:, NZ : NZ + 2] == pytest.approx(of_rows, rel=1e-10, abs=1e-12)
    assert not memory.series.sums[:, NZ + 2 :].any()


def test_forces_of_loads_along_axes():
    of = SimpleNamespace(constant=numbers(2, 6, seed=0.3), form=numbers(12, NZ), **actions())
    memory = series(slides=of)
    expected = np.zeros((ORDERS, NZ))
    for s in range(2):
        form = of.form[6 * s : 6 * s + 6]
        parts = polynomial(of.constant[s], form)
        axis, between = parts[:3], parts[3:]
        moved = dot(axis, between)
        push = of.stiffness[s] * (moved - of.natural[s]) + of.damping[s] * moved.deriv() - applied(s)
        for i in range(NZ):
            change = dot(axis, list(form[3:, i])) + dot(between, list(form[:3, i]))
            expected[:, i] += first(push * change)
    found = grown(memory, loads.grow_slides, loads.add_slides)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-11)


def test_forces_that_functions_of_time_multiply():
    timed = SimpleNamespace(
        function=np.array([1, 0]), constant=numbers(2, NZ), linear=numbers(2 * NZ, NZ, seed=0.7)
    )
    timed.linear[1, 0], timed.linear[2, 1] = 0.0, 1.0
    memory = series(timed=timed)
    expected = np.zeros((ORDERS, NZ))
    x = [np.polynomial.Polynomial(X[:, j]) for j in range(NZ)]
    for s in range(2):
        factor = np.polynomial.Polynomial(memory.series.factors[timed.function[s]])
        for i in range(NZ):
            expected[:, i] -= first(factor * (timed.constant[s, i] + dot(x, list(timed.linear[NZ * s + i]))))
    found = grown(memory, lambda k, memory: None, loads.add_timed_forces)
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(
    ("natural", "damping", "directed"),
    [(0.0, 0.0, False), (0.5, 0.0, True), (0.0, 0.5, True), (0.5, 0.5, True)],
)
def test_springs_whose_force_depends_on_their_direction(natural, damping, directed):
    of = SimpleNamespace(natural=np.array([9.0, natural]), damping=np.array([9.0, damping]))
    assert bool(loads.has_direction(1, of)) is directed


@pytest.mark.parametrize("kind", ["springs", "torsions", "slides", "timed", ""])
def test_loads_that_vary(kind):
    """One load of a kind suffices; constant forces are no entry of these tables."""
    parts = {
        name: SimpleNamespace(damping=np.zeros(int(name == kind)))
        for name in ("springs", "torsions", "slides")
    }
    polynomials = SimpleNamespace(**parts, timed=SimpleNamespace(function=np.zeros(int(kind == "timed"))))
    assert loads.varies(polynomials) is loads.has_varying_loads(polynomials) is bool(kind)


def test_a_driver_that_stands_still():
    functions = np.full((7, 2), 99.0)
    loads.expand_angle(np.zeros(7), functions, 0)
    assert functions.tolist() == [[1.0, 0.0], *[[0.0, 0.0]] * 6]


@pytest.mark.parametrize("last", [6, 2, 1])
def test_cosine_and_sine_of_a_series(last):
    driven = np.where(np.arange(7) <= last, FACTOR, 0.0)
    functions = np.full((7, 5), 99.0)
    loads.expand_angle(driven, functions, 2)
    angle = lambda z: np.polyval(driven[::-1], z)  # noqa: E731
    assert functions[:, 2] == pytest.approx(coefficients(lambda z: np.cos(angle(z)), 7), rel=1e-9, abs=1e-9)
    assert functions[:, 3] == pytest.approx(coefficients(lambda z: np.sin(angle(z)), 7), rel=1e-9, abs=1e-9)
    assert (functions[:, [0, 1, 4]] == 99.0).all()


def test_functions_that_drivers_prescribe(monkeypatch):
    """A displacement in units of 0.5 m, and an angle; loads of functions 3 and 1."""
    asked: list[Any] = []

    def expand(t: float, function: int, equations: Any, target: np.ndarray) -> None:
        asked.append((t, int(function)))
        target[:] = FACTOR * (1 + function)

    monkeypatch.setattr(loads, "expand_function", expand)
    given = SimpleNamespace(
        driver=np.array([0, 2, 2]),
        function=np.array([loads.VALUE, loads.COSINE, loads.SINE]),
        unit=np.array([0.5, 1.0, 1.0]),
    )
    of_loads = SimpleNamespace(function=np.array([-1, 3, 1]))
    memory = SimpleNamespace(
        run=SimpleNamespace(equations=SimpleNamespace(scene=SimpleNamespace(loads=of_loads))),
        series=SimpleNamespace(factors=np.zeros((4, 7)), terms=np.zeros((7, 16)), driven=np.zeros(7)),
        polynomials=SimpleNamespace(given=given),
        solver=SimpleNamespace(pivot_columns=np.zeros(2), pivot_rows=np.zeros(3)),
    )
    loads.expand_functions(0.25, memory)
    assert asked == [(0.25, 3), (0.25, 1), (0.25, 0), (0.25, 2), (0.25, 2)]
    assert memory.series.factors.tolist() == [
        [0.0] * 7,
        (2 * FACTOR).tolist(),
        [0.0] * 7,
        (4 * FACTOR).tolist(),
    ]
    terms = memory.series.terms
    assert terms[:, 5].tolist() == (2 * FACTOR).tolist()
    cosine = np.zeros((7, 2))
    loads.expand_angle(3 * FACTOR, cosine, 0)
    assert terms[:, 6:8].tolist() == cosine.tolist() and not terms[:, [*range(5), *range(8, 16)]].any()
