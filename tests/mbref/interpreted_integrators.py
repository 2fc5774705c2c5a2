"""Steps of ``mbref.integrators.adams`` and of DOP853 / polynomials through past rates, and numbers by hand.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.input_error import InputError
from mbref.integrators import ADAMS, INTEGRATORS, adams, dop853, rk4
from mbref.kernels.layout import OK, SINGULAR
from mbref.linear_algebra.vectors import larger

SIZE = adams.HIGHEST + 3
NUMBERS = ("past_psi", "psi", "beta", "g", "sigma", "integrals")


def past(n: int = 2, **progress: Any) -> Any:
    """Memory of Adams' method of a vector of n entries, filled with old numbers."""
    made = {name: np.full(SIZE, 7.0) for name in NUMBERS}
    made |= {name: np.full(n + 1, 7.0) for name in ("implied", "change")}
    numbers = {**adams.OrderControl()._asdict(), **progress}
    return SimpleNamespace(
        **made, differences=np.full((SIZE, n + 1), 7.0), progress=SimpleNamespace(**numbers)
    )


def rate_at(t: float) -> np.ndarray:
    return np.array([math.cos(3 * t), 1 / (1 + t)])


def through(times: list[float], component: int) -> Any:
    """The polynomial through the rates at these times."""
    rates = [rate_at(t)[component] for t in times]
    return np.polynomial.Polynomial.fit(times, rates, len(times) - 1)


STEPS = [0.1, 0.15, 0.05, 0.2, 0.1, 0.1, 0.3]


@pytest.mark.parametrize("most", [1, 2, 3, 4, 6])
def test_steps_of_any_length_integrate_polynomials_through_past_rates(most):
    """Order k predicts with the last k rates, and corrects with these and the rate at the end."""
    made, memory = past(), SimpleNamespace(control=SimpleNamespace(atol=1.0, rtol=0.0))
    memory.integrator = made
    adams.forget(made, 3)
    assert not made.differences.any() and not made.past_psi.any() and made.progress.restart == 3
    made.differences[1, :2] = rate_at(0.0)
    times, y = [0.0], np.array([0.25, -1.0])

    def rates(t: float, y: np.ndarray, rate: np.ndarray, memory: Any) -> int:
        asked.append((t, y.copy()))
        rate[:] = rate_at(t)
        return OK

    for j, h in enumerate(STEPS):
        k, t, asked, new = min(j + 1, most), times[-1], [], np.zeros(2)
        made.progress.order = k
        adams.step.function(rates, t, h, y, rate_at(t), new, memory)
        last, end = times[-k:], t + h
        for i in range(2):
            before, after = through(last, i), through([*last, end], i)
            predicted = y[i] + before.integ()(end) - before.integ()(t)
            corrected = y[i] + after.integ()(end) - after.integ()(t)
            assert made.implied[i] == pytest.approx(before(end), rel=1e-10), (j, i)
            assert asked[0][1][i] == pytest.approx(predicted, rel=1e-10), (j, i)
            assert new[i] == pytest.approx(corrected, rel=1e-10), (j, i)
        assert len(asked) == 1 and asked[0][0] == end
        adams.remember(h, k, rate_at(end), made)
        times.append(end)
        y = new
        since = [end - t for t in times[-2::-1]]
        assert (
            made.past_psi[1 : len(since) + 1] == pytest.approx(since) and made.past_psi[len(since) + 1] == 0.0
        )


def test_errors_of_equal_steps():
    """At order 4 after steps of 0.1: h γ* |∇ f| of orders 4 and 3, and the ratio by g₄ - g₅."""
    made, h = past(), 0.1
    memory = SimpleNamespace(control=SimpleNamespace(atol=0.5, rtol=0.0), integrator=made)
    adams.forget(made, 0)
    made.differences[1, :2] = rate_at(0.0)

    def rates(t: float, y: np.ndarray, rate: np.ndarray, memory: Any) -> int:
        rate[:] = rate_at(t)
        return OK

    for j in range(6):
        made.progress.order = min(j + 1, 4)
        ratio = adams.step.function(rates, j * h, h, np.zeros(2), rate_at(j * h), np.zeros(2), memory)
        if j < 5:
            adams.remember(h, made.progress.order, rate_at((j + 1) * h), made)
    rows = np.array([rate_at(t) for t in 0.1 * np.arange(7)])
    of_order = {k: h * np.linalg.norm(np.diff(rows, k, axis=0)[-1]) / 0.5 for k in (2, 3, 4)}
    assert made.progress.error == pytest.approx(of_order[4] * 19 / 720)
    assert made.progress.error_below == pytest.approx(of_order[3] / 24)
    assert ratio == pytest.approx(of_order[4] * (3 / 8 - 251 / 720))
    assert made.progress.next_order == 4


@pytest.mark.parametrize(
    ("k", "change", "added", "below", "order"),
    [
        (1, 4.0, (), None, 1),
        (2, 4.0, (-2.0,), 2.0, 1),
        (2, 4.0, (-1.9,), 2.1, 2),
        (3, 4.0, (0.0, 0.0), 4.0, 2),
        (3, 4.0, (0.1, -3.0), 4.1, 3),
        (3, 4.0, (-3.0, 3.1), 1.0, 3),
        (5, 4.0, (-1.0, 0.5), 3.0, 4),
        (5, 4.0, (1.0, -3.0), 5.0, 5),
    ],
)
def test_the_order_that_errors_suggest(monkeypatch, k, change, added, below, order):
    """Errors at order k, k - 1 and k - 2 are the change, and the change with one or two differences."""
    made = past(1, order=k, error_below=None)
    made.sigma[:], made.beta[:] = 1.0, 2.0
    made.g[k], made.g[k + 1] = 0.75, 0.25
    made.change[0] = change
    for j, value in enumerate(added):
        made.differences[k - j, 0] = value / 2
    monkeypatch.setattr(adams, "GAMMA_STAR", np.ones(SIZE))
    monkeypatch.setattr(adams, "norm", lambda vector, y, control: vector[0] / 10)
    assert adams.estimate(10.0, k, np.zeros(1), made, None) == pytest.approx(change * 0.5)
    assert made.progress.error == pytest.approx(change) and made.progress.next_order == order
    assert made.progress.error_below == (None if below is None else pytest.approx(below))


def test_errors_are_weighed_by_the_order():
    """σ = 2, 3, 5 and |γ*| of orders 3, 2 and 1 at k = 3."""
    made = past(1, order=3)
    made.sigma[4], made.sigma[3], made.beta[:] = 5.0, 3.0, 1.0
    made.change[0], made.differences[3, 0], made.differences[2, 0] = 2.0, 6.0, 0.0
    adams.estimate(0.5, 3, np.zeros(1), made, SimpleNamespace(atol=0.25, rtol=0.0))
    assert made.progress.error == pytest.approx(0.5 * 8.0 * 5.0 / 24)
    assert made.progress.error_below == pytest.approx(0.5 * 32.0 * 3.0 / 12)


@pytest.mark.parametrize(("difference", "order"), [(-0.4, 2), (-0.3, 3)])
def test_errors_below_use_the_factors_of_their_own_orders(difference, order):
    """In tolerances of 0.25 the errors are 5/6, 1/4, and 0.5 · 4 (0.5 + 0.25 d) · 2 · 0.5 at order 1."""
    made = past(1, order=3)
    made.sigma[2:5], made.beta[1:5] = (2.0, 3.0, 5.0), (9.0, 0.25, 0.5, 8.0)
    made.change[0], made.differences[3, 0], made.differences[2, 0] = 2.0, -3.0, difference
    adams.estimate(0.5, 3, np.zeros(1), made, SimpleNamespace(atol=0.25, rtol=0.0))
    assert made.progress.error == pytest.approx(5 / 6) and made.progress.error_below == pytest.approx(0.25)
    assert made.progress.next_order == order


@pytest.mark.parametrize("k", [1, 2, 5, 12])
def test_coefficients_of_equal_steps(k):
    """ψ_i = i h, β = σ = 1, g as for constant steps: 1, 1/2, 5/12, 3/8; other places stay as they are."""
    made = past(1)
    made.past_psi[1:] = 0.5 * np.arange(1, SIZE)
    adams.find_coefficients(0.5, k, made)
    assert made.psi[1:14].tolist() == (0.5 * np.arange(1, 14)).tolist()
    assert made.beta[1:14].tolist() == [1.0] * 13 and made.sigma[1 : k + 2].tolist() == [1.0] * (k + 1)
    known = [1, 1 / 2, 5 / 12, 3 / 8, 251 / 720, 95 / 288]
    assert made.g[1 : k + 2][:6] == pytest.approx(known[: k + 1])
    assert made.psi[14] == made.beta[14] == 7.0
    for values in (made.g, made.sigma, made.integrals):
        assert values[0] == 7.0 and (values[k + 2 :] == 7.0).all()


@pytest.mark.parametrize(("steps", "known"), [(0, 1), (1, 2), (3, 4), (12, 13)])
def test_coefficients_after_few_steps(steps, known):
    """Places of steps that the run has not taken are zero."""
    made = past(1)
    made.past_psi[1:] = [0.5 * i if i <= steps else 0.0 for i in range(1, SIZE)]
    adams.find_coefficients(0.25, 1, made)
    expected = [0.25 + 0.5 * i if i < known else 0.0 for i in range(13)]
    assert made.psi[1:14].tolist() == expected
    assert made.beta[1] == 1.0 and (made.beta[2 : known + 1] > 0.0).all()
    assert not made.beta[known + 1 : 14].any()


def test_a_step_of_adams_whose_rates_fail():
    made = past(1, order=1, next_order=9)
    adams.forget(made, 0)
    made.differences[1, 0] = 2.0
    memory, new = SimpleNamespace(integrator=made), np.zeros(1)
    assert adams.step.function(lambda *_: SINGULAR, 0.0, 0.5, np.array([3.0]), None, new, memory) == -SINGULAR
    assert new[0] == 4.0 and made.progress.next_order == 1


@pytest.mark.parametrize(
    ("last_step", "equal", "last_order", "found"),
    [(0.5, 3.0, 9, 4.0), (0.25, 3.0, 9, 1.0), (0.5, 3.0, 2, 3.0), (0.5, 0.0, 0, 1.0)],
)
def test_equal_steps_are_counted(last_step, equal, last_order, found):
    """At most one more than the order of the step before."""
    made = past(1, last_step=last_step, equal_steps=equal, last_order=last_order, failed=5)
    adams.remember(0.5, 4, np.array([1.0]), made)
    progress = made.progress
    assert progress.equal_steps == found
    assert (progress.last_order, progress.last_step, progress.failed) == (4, 0.5, 0)


def test_differences_after_a_step_of_order_two():
    """y' is 3 more than predicted; β = 1, 0.5 and 0.25 of orders 1 to 3."""
    made = past(1)
    made.beta[1:4], made.differences[1:6, 0], made.implied[0] = (
        (1.0, 0.5, 0.25),
        (10.0, 4.0, 8.0, 9.0, 7.0),
        1.0,
    )
    made.psi[:] = np.arange(15.0)
    adams.remember(0.5, 2, np.array([4.0]), made)
    assert made.differences[1:6, 0].tolist() == [15.0, 5.0, 3.0, 1.0, 7.0]
    assert made.past_psi.tolist() == [7.0, *range(1, 14), 7.0]


def test_a_new_piece_begins_at_the_first_order():
    made = past(1, **{name: 9 for name in adams.OrderControl._fields})
    adams.forget(made, 4)
    progress = made.progress
    assert (progress.restart, progress.order, progress.last_order, progress.last_step) == (4, 1, 0, 0.0)
    assert (progress.equal_steps, progress.settled, progress.failed) == (0.0, 0, 0)


@pytest.mark.parametrize(
    ("size", "rate", "largest", "step"),
    [(0.0, 4.0, 1.0, 0.0625), (9.0, 4.0, 1.0, 0.1875), (0.0, 0.0, 3.0, 3e-6), (0.0, 1e9, 3.0, 3e-6)],
)
def test_the_first_step_of_order_one(size, rate, largest, step):
    """0.25 √max(1, |y|) / |y'| in tolerances of 1, at least 1e-6 of the longest step."""
    control = SimpleNamespace(atol=1.0, rtol=0.0, largest_step=largest)
    assert adams.first_step(np.array([size]), np.array([rate]), control) == pytest.approx(step)


# --- DOP853 -----------------------------------------------------------------------------------------------
def test_weighted_sums_leave_out_zero_weights():
    k = np.array([[2.0, 3.0], [math.nan, math.nan], [5.0, 7.0]])
    assert dop853.sum_with((10.0, 0.0, 1.0))(k, 0) == 25.0 and dop853.sum_with((10.0, 0.0, 1.0))(k, 1) == 37.0


def test_stages_end_at_the_first_that_fails():
    """Rates of the stages 1, 2 and 3, of which the second fails."""
    asked: list[float] = []

    def rates(t: float, y: np.ndarray, rate: np.ndarray, memory: Any) -> int:
        asked.append(t)
        return SINGULAR if len(asked) == 2 else OK

    k = np.ones((12, 1))
    assert dop853.stages_to(3)(rates, 1.0, 0.5, np.ones(1), np.zeros(1), k, None) == SINGULAR
    assert asked == pytest.approx([1.0 + 0.5 * dop853.C[1], 1.0 + 0.5 * dop853.C[2]])
    assert dop853.no_stage(None, 0.0, 0.0, None, None, None, None) == OK


@pytest.mark.parametrize(
    ("errors3", "errors5", "found"),
    [((0.0, 0.0), (3.0, -4.0), 2.0), ((-60.0, 30.0), (8.0, 2.0), 3.2), ((1.0, 1.0), (0.0, 0.0), 0.0)],
)
def test_the_error_of_a_step_is_the_largest(monkeypatch, errors3, errors5, found):
    """|h| e₅² / √(e₅² + e₃² / 100) at h = -1/2, with tolerances 0.25 (1 + 2 · 1/2)."""
    stages = SimpleNamespace(slopes=np.zeros((12, 2)), errors3=np.zeros(2), errors5=np.zeros(2))
    memory = SimpleNamespace(
        control=SimpleNamespace(atol=1.0, rtol=2.0),
        integrator=stages,
        loop=SimpleNamespace(clock=SimpleNamespace(share=0.25)),
    )
    monkeypatch.setattr(dop853, "all_stages", lambda *_: OK)
    monkeypatch.setattr(dop853, "eighth_order", lambda slopes, i: 0.0)
    monkeypatch.setattr(dop853, "third_order", lambda slopes, i: errors3[i] * 0.5)
    monkeypatch.setattr(dop853, "fifth_order", lambda slopes, i: errors5[i] * 0.5)
    y, new = np.array([0.5, -0.5]), np.zeros(2)
    assert dop853.step.function(None, 0.0, -0.5, y, np.ones(2), new, memory) == pytest.approx(found)
    assert stages.errors3.tolist() == list(errors3) and stages.errors5.tolist() == list(errors5)
    assert new.tolist() == y.tolist() and stages.slopes[0].tolist() == [1.0, 1.0]
    assert larger(0.0, -4.0) == 4.0


# --- RK4 and the orders of methods ------------------------------------------------------------------------
@pytest.mark.parametrize("fails", [1, 2, 3])
def test_a_stage_of_rk4_that_fails(fails):
    stages = SimpleNamespace(slope=np.zeros(1), total=np.zeros(1))
    asked: list[float] = []

    def rates(t: float, y: np.ndarray, k: np.ndarray, memory: Any) -> int:
        asked.append(t)
        k[0] = 1.0
        return SINGULAR if len(asked) == fails else OK

    memory = SimpleNamespace(integrator=stages)
    y = np.ones(1)
    assert rk4.step.function(rates, 2.0, 0.5, y, np.ones(1), np.zeros(1), memory) == -SINGULAR
    assert asked == [2.25, 2.25, 2.5][:fails]


@pytest.mark.parametrize(("wanted", "good"), [(1, True), (12.0, True), (0, False), (13, False), (2.5, False)])
def test_orders_of_adams(wanted, good):
    if good:
        assert ADAMS.highest_order({"max_order": wanted}) == wanted
    else:
        with pytest.raises(InputError, match=rf"adams: max_order must be 1 to 12, got {wanted:g}"):
            ADAMS.highest_order({"max_order": wanted})


def test_facts_of_integrators():
    facts = {name: (each.order, each.adaptive, dict(each.options)) for name, each in INTEGRATORS.items()}
    assert facts == {
        "dop853": (8, True, {}),
        "rk4": (4, False, {"step": 1e-4}),
        "adams": (12, True, {"max_order": 12}),
        "taylor": (30, True, {"order": 0.0}),
    }
    assert {name for name, each in INTEGRATORS.items() if each.crosses == "by series"} == {"taylor"}
    assert all(each.highest_order({}) == each.order for each in INTEGRATORS.values())
    assert adams.OrderControl() == (-1, 0, 0, 0.0, 0.0, 0, 0.0, 0.0, 0, 0), "no past, before the start phase"
