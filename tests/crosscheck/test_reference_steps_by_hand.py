"""Steps of the reference / series, panels, limits and decisions worked out by hand on stand-ins."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED
from crosscheck.judge.reference import bound, crossing, stiff_panels, taylor, tree
from crosscheck.judge.reference.expansion import Series, value
from crosscheck.judge.reference.held_rows import Drives, cos_sin_series, function_series, independent
from crosscheck.judge.reference.panels import Panel, Panels, _cosines, _summed
from crosscheck.judge.reference.saddle_point import SaddlePoint
from crosscheck.judge.reference.taylor import Ended, Stepper
from crosscheck.judge.reference.tree import _Run
from mbref.scene import Body, Driver, Factor, Scene, Sine


# --- series -----------------------------------------------------------------------------------------------
def geometric(count: int, *without: int) -> np.ndarray:
    """Terms 2 · 4^-k of a coordinate, which converge within 4 s; some of them are zero."""
    return np.array([[[0.0 if k in without else 2.0 * 4.0**-k]] for k in range(count)])


def test_a_series_reaches_as_far_as_its_last_terms_are_small():
    """The ninth of terms 0 to 10 and the one after it are 1e-9 of the first at 4 · 1e-9^(1/9) = 0.4 s."""
    assert Series(geometric(11)).reach(1e-9) == pytest.approx(0.4, rel=1e-12)
    even = Series(geometric(11, 1, 3, 5, 7, 9))
    assert even.reach(1e-10) == pytest.approx(0.4, rel=1e-12), "a term counts as the larger of two"
    assert Series(geometric(11, 5, 6)).reach(1e-9) == pytest.approx(0.4), "six terms at least"
    assert Series(geometric(11, 6, 7)).reach(1e-9) == math.inf


def test_terms_of_a_step_and_the_first_one_left_out():
    """At 2 s a term is half of the term before; the eighth and ninth are missing."""
    whole, part = Series(geometric(11)), Series(geometric(11, 8, 9))
    assert (whole.terms(2.0), part.terms(2.0)) == (10, 9)
    assert whole.left_out(2.0) == pytest.approx(2.0**-9) and part.left_out(2.0) == 0.0
    growing = Series(geometric(11))
    assert growing.terms(8.0) == 7 and growing.left_out(8.0) == pytest.approx(2.0**7)


def test_values_and_derivatives_of_a_series():
    """1 + 2 t + 3 t² + 5 t³ at 0.5 s, and twice it."""
    series = np.array([[1.0, 2.0], [2.0, 4.0], [3.0, 6.0], [5.0, 10.0]])
    assert value(series, 0.5).tolist() == [3.375, 6.75]
    assert value(series, 0.5, 1).tolist() == [8.75, 17.5]
    assert value(series, 0.5, 2).tolist() == [21.0, 42.0]


def test_series_of_a_function_about_a_time():
    """0.3 - 0.2 t + 0.5 t² + 0.7 t³ + 0.4 sin(3 t + 0.6) about 0.5 s: derivatives over factorials."""
    sine = Sine(amplitude=0.4, frequency=3.0, phase=0.6)
    factor = Factor(polynomial=(0.3, -0.2, 0.5, 0.7), sine=sine, start=0.25, stop=0.75)
    found = function_series(factor, 0.5, 6, DOUBLE)
    sine, cosine = 0.4 * math.sin(2.1), 0.4 * math.cos(2.1)
    cubic = [0.3 - 0.1 + 0.125 + 0.0875, -0.2 + 0.5 + 0.525, 0.5 + 1.05, 0.7, 0.0, 0.0]
    wave = [sine, 3 * cosine, -9 / 2 * sine, -27 / 6 * cosine, 81 / 24 * sine, 243 / 120 * cosine]
    assert found == pytest.approx(np.add(cubic, wave))
    assert function_series(factor, 0.5, 3, DOUBLE) == pytest.approx(np.add(cubic, wave)[:3])
    assert not function_series(factor, 0.0, 4, DOUBLE).any(), "before it starts"
    assert not function_series(factor, 0.75, 4, DOUBLE).any(), "from its stop on"


def test_series_of_a_table_about_a_time():
    """Between rows of a table of t² - 2 t³ the spline is that cubic."""
    rows = tuple((t, t**2 - 2 * t**3) for t in (0.0, 0.5, 1.5, 2.0, 3.0))
    found = function_series(Driver(joint="A", table=rows), 0.75, 5, DOUBLE)
    t = 0.75
    assert found == pytest.approx([t**2 - 2 * t**3, 2 * t - 6 * t**2, 1 - 6 * t, -2.0, 0.0], abs=1e-12)


def test_series_of_cosine_and_sine():
    """The exponential of i (0.3 + 0.5 t - 0.2 t² + 0.7 t³), order by order."""
    b, c, d = 0.5j, -0.2j, 0.7j
    orders = np.exp(0.3j) * np.array([1.0, b, c + b**2 / 2, d + b * c + b**3 / 6])
    cosine, sine = cos_sin_series(np.array([0.3, 0.5, -0.2, 0.7]))
    assert cosine == pytest.approx(orders.real) and sine == pytest.approx(orders.imag)


@pytest.mark.parametrize("shape", [(), (2,), (3, 2)])
def test_rows_that_a_driven_angle_turns(shape):
    """Row 1 is cos ψ · product 1 + sin ψ · product 2, by series; of row 0 its product stays."""
    rng = np.random.default_rng(2)
    cosine, sine = np.array([2.0, 3.0, 5.0]), np.array([7.0, -1.0, 4.0])
    drives = Drives(np.zeros((3, 2)), [(1, 2, cosine, sine)])
    products, multipliers = rng.normal(size=(3, 3, *shape)), rng.normal(size=(3, 2))
    for k in range(3):
        first = sum(cosine[i] * products[k - i, 1] for i in range(k + 1))
        second = sum(sine[i] * products[k - i, 2] for i in range(k + 1))
        found = drives.combined(products, k)
        assert found[0] == pytest.approx(products[k, 0]) and found[1] == pytest.approx(first + second)
        turned = [sum(s[i] * multipliers[k - i, 1] for i in range(k + 1)) for s in (cosine, sine)]
        assert drives.spread(multipliers, k) == pytest.approx([multipliers[k, 0], *turned])


def test_independent_rows_by_their_weights():
    """The first two rows are equal; the third has 0.8 across them."""
    rows = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.6, 0.8, 0.0]])
    for weights, chosen in (((1.1, 1.0, 1.0), [0, 2]), ((1.0, 1.1, 1.0), [1, 2])):
        found, pivots = independent(rows, np.array(weights))
        assert found.tolist() == chosen and pivots[:2] == pytest.approx([1.0, 0.8 / 1.1])
        assert len(pivots) == 3 and pivots[2] < 1e-12
    found, pivots = independent(np.zeros((0, 3)), np.zeros(0))
    assert found.shape == pivots.shape == (0,)


@pytest.mark.parametrize("numbers", [DOUBLE, EXTENDED], ids=["double", "extended"])
def test_a_saddle_point_with_compliant_rows(numbers):
    mass = np.array([[4.0, 0.5], [0.5, 3.0]])
    rows = np.arange(12.0).reshape(2, 3, 2) - np.array([2.0, 7.0])[:, None, None]
    compliance, force, rate = np.array([0.25, 2.0]), np.arange(6.0).reshape(3, 2) + 1, np.array([3.0, -1.5])
    system = SaddlePoint(*map(numbers.array, (mass, rows, compliance)), numbers)
    x, y = system.solve(numbers.array(force), numbers.array(rate))
    pull = np.einsum("m,min->in", y.astype(float), rows)
    assert x.astype(float) @ mass + pull == pytest.approx(force, abs=1e-13)
    assert np.einsum("min,in->m", rows, x.astype(float)) - compliance * y.astype(float) == pytest.approx(
        rate, abs=1e-13
    )


# --- panels -----------------------------------------------------------------------------------------------
NODES = 16
PANELS = Panels(DOUBLE, NODES)


def test_chebyshev_points_and_their_matrices():
    """The coefficients of T₃ are the fourth unit vector; the integral of t³ from -1 is (t⁴ - 1) / 4."""
    places = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    assert PANELS.nodes == pytest.approx(places, abs=1e-15)
    third = 4 * places**3 - 3 * places
    assert PANELS.times(PANELS.series, third[:, None])[:, 0] == pytest.approx(np.eye(NODES)[3], abs=1e-14)
    last = np.cos((NODES - 1) * np.arccos(places))
    ends = PANELS.times(PANELS.series, np.stack([last, np.ones(NODES)], axis=1))
    assert ends == pytest.approx(np.stack([np.eye(NODES)[-1], np.eye(NODES)[0]], axis=1), abs=1e-13)
    powers = np.stack([places**k for k in range(4)], axis=1)
    wanted = np.stack([(places ** (k + 1) - (-1) ** (k + 1)) / (k + 1) for k in range(4)], axis=1)
    assert PANELS.times(PANELS.integral, powers) == pytest.approx(wanted, abs=1e-14)
    assert _cosines(DOUBLE, 6) == pytest.approx(np.cos(np.pi * np.arange(12) / 6), abs=4e-15)
    c, x = np.array([[1.0, -2.0], [0.5, 3.0], [-0.25, 0.75], [2.0, 1.0]]), np.array([[-0.3], [0.8]])
    assert _summed(c, x) == pytest.approx(np.polynomial.chebyshev.chebval(x[:, 0], c).T, abs=1e-14)
    assert PANELS.tolerance == 2000 * np.finfo(float).eps


def falling(before: float, last: float) -> np.ndarray:
    return np.array([1.0] * 12 + [before] * 2 + [last] * 2)


def test_the_noise_of_an_iteration():
    """The last two of 16 coefficients are a fifth of the two before: noise of four times their size."""
    assert PANELS._noise(falling(5e-10, 1e-10)) == pytest.approx(4e-10)
    assert PANELS._noise(falling(2e-9, 1e-10)) == 0.0, "the series decreases"
    assert PANELS._noise(falling(1e-12, 4e-13)) == 0.0, "to the tolerance"
    assert PANELS._noise(falling(1e-7, 5e-8)) == 0.0, "too rough for noise"
    assert PANELS._noise(falling(1e-9, 1e-10)) == 0.0 == PANELS._noise(falling(1e-9, 0.99e-10))


def test_the_length_that_a_series_resolves():
    """13 of 16 coefficients may be used. Five are needed down to 1e-12; down to 1e-6 they are half of those
    that the solution needs."""
    five = np.array([1.0, 0.1, 1e-2, 1e-3, 1e-5, *[0.0] * 11])
    assert PANELS._fits(five, 0.0, 1e-12) == pytest.approx(13 / 5)
    assert PANELS._fits(five, 1e-6, 1e-12) == pytest.approx(13 / (5 * 2))
    assert PANELS._fits(five, 1e-4, 1e-12) == pytest.approx(13 / (4 * 3))
    whole = np.array([1e-4] * 13 + [1e-7, 1e-8, 1e-9])
    assert PANELS._fits(whole, 0.0, 1e-12) == pytest.approx(13 / (16 * 12 / 7))
    assert PANELS._fits(np.ones(16), 0.0, 1e-12) == pytest.approx(13 / (16 * 4)), "at most 1e-3"
    assert PANELS._fits(np.zeros(16), 0.0, 1e-12) == 13.0


def test_scales_of_columns_by_groups():
    """A column counts as a thousandth of the largest of its group at least."""
    y = np.array([[2.0, -1e-4, 1e-9], [-1.0, 2e-4, -5e-9]])
    moved = np.array([[0.0, 0.0, 3e-9], [0.0, 0.0, 7e-9]])
    assert PANELS._size(y, moved, 2) == pytest.approx([2.0, 2e-3, 7e-9])
    assert PANELS._size(y, moved, 1) == pytest.approx([2.0, 2e-4, 2e-7])
    assert PANELS._size(np.zeros((2, 2)), np.zeros((2, 2)), 1) == pytest.approx([0.0, 0.0], abs=1e-300)


def progress(rates: np.ndarray, change: float, sweeps: int, where: float | None = None) -> Panel | None:
    panel = Panel(0.0, 1.0, rates, rates, False, 0.6, where, sweeps=sweeps)
    return PANELS._progress(panel, np.ones(rates.shape[1]), change, np.full(NODES, 2.0))


def test_factors_on_the_next_panel():
    """T₉ needs ten of 13 coefficients: 0.9 · 1.3; T₂ needs three, and a panel grows by 1.6 at most."""
    x = PANELS.nodes
    third, ninth = (np.cos(k * np.arccos(np.clip(x, -1, 1)))[:, None] for k in (2, 9))
    found = progress(ninth, 1e-14, 34)
    assert found.settled and found.factor == pytest.approx(0.9 * 1.3) and found.foreseen is None
    assert progress(third, 1e-14, 34).factor == 1.6 and progress(third, 1e-14, 35).factor == 1.0
    assert progress(third, 1e-4, 3) is None, "not settled, and long enough"
    assert progress(third, 2e-3, 3) is None, "not yet reported"
    rough = np.sign(x)[:, None]
    short = progress(rough, 1e-4, 3)
    assert not short.settled and short.factor == 0.5 and (short.crossing, short.sweeps) == (None, 0)
    across = progress(ninth, 1e-9, 3, where=0.25)
    assert across.settled and across.crossing == 0.25, "the tolerance is 4.4e-9 across a singular position"
    assert progress(ninth, 1e-8, 3, where=0.25) is None
    lost = progress(rough, 1e-9, 3, where=0.25)
    assert (lost.settled, lost.crossing, lost.foreseen) == (False, None, 0.25)


def test_slopes_of_linear_equations():
    a = np.array([[0.0, 2.0, -3.0], [5.0, -7.0, 0.5], [1.5, 0.25, 4.0]])

    class Linear:
        light = 1

        def light_rates(self, y: np.ndarray) -> np.ndarray:
            return y @ a[:1].T

        def other_rates(self, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return t[:, None] * (y @ a[1:].T), np.ones(len(y))

    first, second = stiff_panels._slopes(Linear(), np.array([1.0, 2.0]), np.array([[1.0, -20.0, 3.0]] * 2))
    assert first == pytest.approx(a, abs=1e-8)
    assert second == pytest.approx(a * [[1], [2], [2]], abs=1e-8)


# --- bounds and singular positions ------------------------------------------------------------------------
def moved(positions: list[list[float]], turns: list[float]) -> SimpleNamespace:
    """One body at each place, turned about the skew axis (2, 3, 6) / 7 by an angle (rad)."""
    axis = np.array([2.0, 3.0, 6.0]) / 7
    orientation = [[[math.cos(t / 2), *(math.sin(t / 2) * axis)]] for t in turns]
    return SimpleNamespace(
        times=np.arange(len(turns)), position=np.array(positions)[:, None], orientation=np.array(orientation)
    )


def test_the_difference_of_two_motions(monkeypatch):
    """5 mm over a length of 2 m against 1 mrad; the angle of quaternions of either sign."""
    monkeypatch.setattr(bound, "scene_length", lambda scene: 2.0)
    one = moved([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [0.0, 0.0, 1.0]], [0.5, 0.7, 2.0])
    two = moved([[3e-3, 0.0, 4e-3], [1.0, 2.0, 3.0]], [0.501, 0.703])
    two.orientation[1] *= -1
    found = bound.differences(SimpleNamespace(), one, two)
    assert found == pytest.approx([2.5e-3, 3e-3], rel=1e-9)
    assert bound.differences(SimpleNamespace(), two, one) == pytest.approx(found)
    assert bound._angles(one.orientation[:1], two.orientation[1:]) == pytest.approx(np.array([[0.203]]))
    far = SimpleNamespace(position=np.array([[[3.0, 0.0, 4.0], [1.0, 0.0, 0.0]]]))
    assert bound.rounding(SimpleNamespace(), far) == pytest.approx([2.5 * np.finfo(float).eps])


def test_bounds_grow_from_sample_to_sample():
    found = bound.bounds(np.array([1e-16, 3e-15, 1e-15, 2e-3]))
    assert found == pytest.approx([1e-14, 3e-14, 3e-14, 2e-2], rel=1e-12)


def test_singular_positions_after_a_panel():
    """A distance that falls from 1 at the end by 1 / (a - 1) vanishes at a; up to a panel further counts."""
    nodes = -np.cos(np.pi * np.arange(40) / 39)
    for place in (1.25, 2.0, 2.98):
        assert crossing.singular_ahead(nodes, place - nodes) == pytest.approx(place)
    assert crossing.singular_ahead(nodes, 3.02 - nodes) is None
    late = np.where(nodes > 0.5, 1.5 - nodes, 9.0)
    assert crossing.singular_ahead(nodes, late) == pytest.approx(1.5), "the last points"


def test_points_near_a_singular_position():
    """Nearer than 0.15 times the median; a quarter of the points at most, inside of the panel."""
    distance = np.full(12, 2.0)
    distance[[3, 4, 5]] = 0.29, 0.1, 0.31
    assert np.flatnonzero(crossing.near_singular(distance)).tolist() == [3, 4]
    near = crossing.near_singular(distance)
    assert crossing._inside(near) and not crossing._inside(np.zeros(12, dtype=bool))
    for places, is_inside in (((3, 4, 5), True), ((3, 4, 5, 6), False), ((0, 1), False), ((10, 11), False)):
        near = np.zeros(12, dtype=bool)
        near[list(places)] = True
        assert crossing._inside(near) is is_inside, places


# --- decisions of formulation A ---------------------------------------------------------------------------
def stepper(**parts: Any) -> Any:
    """A stepper without a scene; parts replace what it asks of one."""
    made = object.__new__(Stepper)
    made.of = SimpleNamespace(arithmetic=DOUBLE)
    made.t, made._x, made._lost, made._tolerance, made._conditioning = 0.0, None, np.inf, 1e-16, [1.0]
    made.__dict__.update(parts)
    return made


def test_losses_of_a_step_across_a_singular_position():
    """1e-14 is enough, 1e-8 too much; a loss between is accepted where the second attempt is no better."""
    assert stepper()._may_step_across(1e-14) and not stepper()._may_step_across(1.1e-8)
    made = stepper()
    assert not made._may_step_across(1e-9) and made._lost == 1e-9
    assert not made._may_step_across(0.5e-9), "shorter steps lose less"
    assert made._may_step_across(0.5e-9) and made._lost == np.inf
    ill = stepper(_conditioning=[1.0, 1e-4])
    assert ill._may_step_across(2.2e-8 / 3), "1e4² roundings of the data"
    exact = stepper(_conditioning=[1.0, 1e-4], of=SimpleNamespace(arithmetic=SimpleNamespace(digits=40)))
    assert not exact._may_step_across(2.2e-8 / 3)
    old = stepper(_conditioning=[9.0, *[1.0] * 50])
    assert not old._may_step_across(3e-14), "only the last fifty steps count"


@pytest.mark.parametrize(
    ("conditioning", "least"),
    [([1.0, 0.25], 0.5), ([1.0, 0.26], None), ([2.0, 1e-4], 0.1), ([2.0, 0.4, 0.3], 1.0), ([0.2, 0.1], None)],
)
def test_rows_are_selected_again_where_they_are_ill_conditioned(conditioning, least):
    asked: list[float] = []
    made = stepper(_conditioning=conditioning, _hold_others=lambda x, t, value: asked.append(value))
    made._choose_again()
    assert asked == ([] if least is None else [pytest.approx(least)])


@pytest.mark.parametrize(
    ("here", "there", "least", "count", "is_held"),
    [
        (0.3, 0.5, 0.4, 5, True),
        (0.3, 0.4, 0.4, 5, False),
        (0.2, 0.5, 0.4, 5, False),
        (0.3, 0.5, 0.4, 4, False),
    ],
)
def test_other_rows_are_held_if_they_are_better(here, there, least, count, is_held):
    """The present rows' smallest singular value is 0.2; five rows are held."""
    before, other = SimpleNamespace(count=5), SimpleNamespace(count=count)
    made = stepper(
        _held=before,
        _conditioning=[1.0, 0.2],
        _x="here",
        _choice=lambda x, t: (other, 3),
        _sharp=lambda x, t: here if x == "here" else there,
    )
    assert made._hold_others("there", 0.5, least) is is_held
    assert made._held is (other if is_held else before)
    assert made._conditioning == ([here] if is_held else [1.0, 0.2])


def test_steps_do_not_end_near_a_singular_position():
    """The conditioning at the end is 1 - h: 0.4 of 1 is allowed, after steps of 0.7 and 0.56 s."""
    made = stepper(_sharp=lambda x, t: 1.0, _ahead=lambda x, series, h: 1.0 - h)
    assert made._shortened(None, None, 0.7, 0.4) == 0.7
    assert made._shortened(None, None, 0.7, 0.3) == pytest.approx(0.56)
    made._sharp = lambda x, t: 0.5
    assert made._shortened(None, None, 0.7, 0.3) == 0.7, "the conditioning after the correction"
    lost = stepper(_sharp=lambda x, t: 1.0, _ahead=lambda x, series, h: 0.1)
    with pytest.raises(Ended, match="its steps end"):
        lost._shortened(None, None, 1e-3, 0.1)


def test_where_rows_become_dependent():
    """A conditioning of |h - 0.3| vanishes at 0.3 s; one that stays above 0.02 is no singular position."""
    series = SimpleNamespace(reach=lambda tolerance: 1e7 * tolerance)
    made = stepper(_ahead=lambda x, s, h: abs(h - 0.3) + 1e-6)
    assert made._crossing(None, series, 0.5) == pytest.approx(0.3, rel=1e-4)
    assert made._crossing(
        None, SimpleNamespace(reach=lambda tolerance: 1e8 * tolerance), 0.2
    ) == pytest.approx(0.3, rel=1e-4), "as far as the series reaches with 1e-8"
    assert made._crossing(None, series, 0.2) == 0.0, "it reaches to 0.2 s only"
    made._ahead = lambda x, s, h: abs(h - 0.3) + 0.021
    assert made._crossing(None, series, 0.5) == 0.0
    made._conditioning = [1.1]
    assert made._crossing(None, series, 0.5) == pytest.approx(0.3, rel=1e-2)


def test_rows_that_serve_ahead_are_held():
    seen, projected = [], []
    series = np.array([[[1.0]], [[2.0]]])
    for is_held in (True, False):
        made = stepper(
            t=1.0,
            _conditioning=[0.7],
            _hold_others=lambda *asked, is_held=is_held: seen.append(asked) or is_held,
            _project=lambda: projected.append(1),
        )
        assert made._others_serve(series, 0.25) is is_held
    assert seen == [(np.array([[1.5]]), 1.25, 0.7)] * 2 and projected == [1]


class Terms(int):
    """An order that can be cut like a series."""

    def __getitem__(self, item: slice) -> slice:
        return item


def stepping(ahead: float, **parts: Any) -> Any:
    """A stepper at 2 s whose conditioning was 1, is 0.3 now and is ``ahead`` at the end of a step."""
    made = stepper(_conditioning=[1.0, 0.3], crossings=[], _order=7, t=2.0)
    made._expansion = lambda order: SimpleNamespace(x=Terms(order))
    made._ahead = lambda x, series, h: ahead
    made._shortened = lambda x, series, h, end: ("short", h)
    made._crossing = lambda x, series, h: 0.125
    made._others_serve = lambda series, middle: False
    made._may_step_across = lambda lost: True
    made.__dict__.update(parts)
    return made


class Reaching:
    """A stand-in for the series of an expansion."""

    length = 0.5

    def __init__(self, x: int) -> None:
        self.x = x

    def reach(self, tolerance: float) -> float:
        return self.length

    def terms(self, h: float) -> int:
        return 3

    def left_out(self, h: float) -> float:
        return h


def test_steps_over_and_before_singular_positions(monkeypatch):
    """Steps are as long as the series allows, the end, or the piece; one of twice the distance crosses."""
    monkeypatch.setattr(taylor, "Series", Reaching)

    def step(most: float = 9.0, left: float = 9.0, ahead: float = 0.2, **parts: Any) -> tuple[Any, Any, list]:
        made = stepping(ahead, **parts)
        found, h = made._step(most, left)
        return int(found.x), h, made.crossings

    assert step() == (14, 0.25, [2.125]), "twice the order, over the position"
    assert step(ahead=0.3) == (7, ("short", 0.5), []), "no nearer at the end"
    assert step(_conditioning=[1.0, 0.4], ahead=0.2) == (7, ("short", 0.5), []), "0.4 is not near"
    assert step(_conditioning=[9.0, *[0.3] * 50]) == (7, ("short", 0.5), []), "usual are fifty steps"
    assert step(_crossing=lambda *_: 0.0) == (7, ("short", 0.5), [])
    assert step(_may_step_across=lambda lost: lost != 0.25) == (7, ("short", 0.5), [])
    assert step(left=0.25)[1:] == (0.25, [2.125]) and step(left=0.24)[1:] == (("short", 0.24), [])
    assert step(most=0.125, ahead=0.3)[1] == ("short", 0.125)
    assert step(most=0.0, ahead=0.3)[1] == ("short", 1e-6)
    with monkeypatch.context() as patch:
        patch.setattr(Reaching, "length", 2e-9)
        with pytest.raises(Ended, match="its steps end"):
            step()
        patch.setattr(Reaching, "length", 2.1e-9)
        assert step(ahead=0.3)[1] == ("short", 2.1e-9)
    served = iter([True, False])
    assert step(_others_serve=lambda series, middle: next(served))[2] == [2.125], "a step by other rows"


def test_a_degree_of_freedom_without_inertia():
    """Formulation A refuses bodies without mass that no driver moves."""
    free = Scene(name="s", body=(Body(name="b", position=(1.0, 2.0, 3.0)),))
    made = Stepper(free, DOUBLE, 8, 1e-12, (0, 0.0))
    with pytest.raises(Ended, match="bodies without mass have to be driven in every freedom"):
        list(made.samples([0.1], lambda t: None))


# --- decisions of formulation B ---------------------------------------------------------------------------
def run(**parts: Any) -> Any:
    made = object.__new__(_Run)
    made.arithmetic, made.panels, made.t, made.state = DOUBLE, PANELS, 1.0, np.array([3.0, 5.0])
    made.times, made.taken, made.samples, made.crossings = np.array([0.5, 1.25, 1.5, 2.0]), 1, [], []
    made.foreseen, made.unsettled, made.lost, made.steps, made.is_stiff = 0.0, 0, np.inf, 4, False
    made.equations = SimpleNamespace(scene=Scene(name="s", body=(Body(name="b", position=(0, 0, 0)),)))
    made.__dict__.update(parts)
    return made


def panel(start: float, length: float, is_settled: bool = True, **parts: Any) -> Panel:
    """A panel whose state is (t, 2 t) and whose rate is 3 t."""
    t = start + length / 2 * (PANELS.nodes + 1)
    return Panel(start, length, np.stack([t, 2 * t], axis=1), 3 * t[:, None], is_settled, 1.0, **parts)


@pytest.mark.parametrize(("gap", "length"), [(1.39, 2.0), (1.5, 0.5), (3.3, 2.3), (3.41, 2.0), (-0.5, 2.0)])
def test_no_panel_ends_near_a_singular_position(gap, length):
    """A panel of 2 s, and a position between 0.7 and 1.7 lengths ahead: it ends one second before."""
    assert run(foreseen=1.0 + gap)._before_singular(2.0) == pytest.approx(length)


def test_the_first_iterate_of_a_panel():
    """The state, or the states of a longer panel that failed, on its first part."""
    assert run()._guess(None, 0.5).tolist() == [[3.0, 5.0]] * NODES
    assert run()._guess(panel(1.0, 2.0), 0.5).tolist() == [[3.0, 5.0]] * NODES
    guess = run()._guess(panel(1.0, 2.0, False), 0.5)
    t = 1.0 + 0.25 * (PANELS.nodes + 1)
    assert guess[0].tolist() == [3.0, 5.0] and guess[1:] == pytest.approx(np.stack([t, 2 * t], axis=1)[1:])


def test_samples_inside_a_panel():
    """The samples up to the end of a panel are taken, each once."""
    made = run()
    made._sample(panel(1.0, 0.5))
    assert made.taken == 3 and len(made.samples) == 1
    states, rates = made.samples[0]
    assert states == pytest.approx(np.array([[1.25, 2.5], [1.5, 3.0]])) and rates == pytest.approx(
        np.array([[3.75], [4.5]])
    )
    made._sample(panel(1.5, 0.25))
    assert made.taken == 3 and len(made.samples) == 1, "no sample inside"
    driver = Driver(joint="A", table=((0.0, 0.0), (1.5, 1.0), (2.0, 0.0), (3.0, 1.0)))
    scene = SimpleNamespace(driver=(driver,), load=())
    made = run(equations=SimpleNamespace(scene=scene))
    made._sample(panel(1.0, 0.5))
    assert made.taken == 2, "the sample at the end of a piece belongs to the next one"
    assert made._before_end(0.25) == 0.25 and made._before_end(0.75) == 0.5
    last = run(equations=SimpleNamespace(scene=scene), times=np.array([0.5, 1.25, 1.5]))
    last._sample(panel(1.0, 0.5))
    assert last.taken == 3, "no piece follows the last sample"


def test_a_panel_is_accepted_if_its_loops_close(monkeypatch):
    taken: list[Any] = []
    for gap, is_accepted in ((tree.OPEN, True), (1.01 * tree.OPEN, False)):
        equations = SimpleNamespace(
            scene=run().equations.scene, closed=lambda t, y: (t, y), gap=lambda t, y, gap=gap: gap
        )
        made = run(equations=equations, _sample=taken.append)
        assert made._accepts(found := panel(1.0, 0.5, crossing=0.5)) is is_accepted
        assert (made.t, made.steps, made.crossings) == ((1.5, 5, [1.375]) if is_accepted else (1.0, 4, []))
        if is_accepted:
            assert taken == [found] and made.state[0] == 1.5 and made.state[1].tolist() == [1.5, 3.0]
    made = run(unsettled=2, lost=1e-9)
    made._advance(panel(1.0, 0.5), 1.5, made.state)
    assert (made.unsettled, made.lost, made.crossings) == (2, 1e-9, [])
    made._advance(panel(1.5, 0.5, crossing=0.0), 2.0, made.state)
    assert (made.unsettled, made.lost, made.crossings) == (0, np.inf, [1.75])


def test_slow_panels_may_be_stiff():
    """Twenty iterations are slow; Newton's method serves while the panel is stiff."""
    asked: list[Any] = []

    def solver(name: str, sweeps: int) -> Any:
        def is_for(equations: Any, t: float, length: float, state: np.ndarray) -> bool:
            asked.append((t, length, state.tolist()))
            return True

        return SimpleNamespace(panel=lambda *_: panel(1.0, 0.5, sweeps=sweeps), name=name, is_for=is_for)

    guess = np.array([[7.0, 8.0], [9.0, 9.0]])
    for sweeps, is_stiff in ((19, False), (20, True)):
        made = run(panels=solver("picard", sweeps), stiff=solver("newton", 3))
        assert made._panel(0.5, guess).sweeps == sweeps and made.is_stiff is is_stiff
        assert made._panel(0.25, guess).sweeps == (3 if is_stiff else 19)
    assert asked == [(1.0, 0.5, [7.0, 8.0]), (1.0, 0.25, [7.0, 8.0])]


def across(loss: float, is_settled: bool = True, **parts: Any) -> Any:
    """A run whose panels can be continued over a singular position at 2.175 s with a loss."""
    lengths: list[float] = []

    def solved(length: float, guess: np.ndarray) -> Panel:
        lengths.append(length)
        return panel(1.0, length, is_settled)

    def continued(short: Panel, times: float, singular: float) -> tuple[Any, float]:
        return ("across", times, singular), loss

    made = run(unsettled=2, _panel=solved, lengths=lengths, **parts)
    made.panels = SimpleNamespace(continued=continued, count=NODES, nodes=PANELS.nodes)
    return made


def test_a_step_across_a_singular_position():
    """From 1 s a panel of 1 s ends 0.175 s before it and is extended by 0.35 s."""
    made = across(1e-11)
    assert made._step_across(2.175) == ("across", 1.35, 2.175) and made.lengths == [pytest.approx(1.0)]
    assert made.unsettled == 3 and made.lost == 1e-11
    assert made._step_across(1.0) is None, "behind the state"
    assert made._step_across(None) is None and made.unsettled == 3
    early = across(1e-11)
    early.unsettled = 1
    assert early._step_across(2.175) is None and early.unsettled == 2 and early.lengths == []
    assert across(1e-11, is_settled=False)._step_across(2.175) is None
    assert across(1.1e-7)._step_across(2.175) is None
    second = across(1e-8)
    assert second._step_across(2.175) is None, "a loss above 2.2e-10 has a second attempt"
    assert second._step_across(2.175) is not None, "which loses as much"
    better = across(1e-8, lost=2e-8)
    assert better._step_across(2.175) is None, "the next one may lose less"
    assert across(2.2e-10)._step_across(2.175) is not None
    driver = Driver(joint="A", table=((0.0, 0.0), (2.3, 1.0), (3.0, 0.0), (4.0, 1.0)))
    ended = across(1e-11, equations=SimpleNamespace(scene=SimpleNamespace(driver=(driver,), load=())))
    assert ended._step_across(2.175) is None, "a piece ends before 2.35 s"


def test_failed_panels_are_replaced_by_a_step_across():
    good, failed = panel(1.0, 0.5), panel(1.0, 0.5, False, foreseen=0.5)
    seen: list[Any] = []
    made = run(_guess=lambda last, length: None, _step_across=seen.append)
    made._panel = lambda length, guess: good
    assert made._tried(None, 0.5) is good and not seen
    made._panel = lambda length, guess: failed
    assert made._tried(None, 0.5) is failed and seen == [1.375]
    made._step_across = lambda t: "across"
    assert made._tried(None, 0.5) == "across"


def through(found: list[Panel], **parts: Any) -> tuple[str, Any, list[float]]:
    """A run from 0 to 2 s whose panels are given: its reason, and the lengths that it asks for."""
    lengths: list[float] = []
    equations = SimpleNamespace(start=lambda: np.array([1.0, 2.0]), undetermined=lambda: "", since=None)
    made = run(equations=equations, t=0.0, taken=0, **parts)
    made._before_end = made._before_singular = lambda length: length
    pending = iter(found)

    def tried(last: Panel | None, length: float) -> Panel:
        lengths.append(length)
        return next(pending)

    def accepts(panel: Panel) -> bool:
        made.t, made.taken = panel.start + panel.length, int((made.times <= panel.start + panel.length).sum())
        return True

    made._tried, made._accepts = tried, parts.get("_accepts", accepts)
    seen: list[float] = []
    return made.through(seen.append), made, lengths


def test_lengths_of_successive_panels():
    """The first is a tenth of the duration; then each is its predecessor times its factor."""
    first = Panel(0.0, 0.2, PANELS.nodes, PANELS.nodes, True, 1.5, foreseen=9.0)
    failed = Panel(0.2, 0.3, PANELS.nodes, PANELS.nodes, False, 0.5, foreseen=3.0)
    short = Panel(0.2, 0.1, PANELS.nodes, PANELS.nodes, True, 1.2)
    last = Panel(0.3, 1.7, PANELS.nodes, PANELS.nodes, True, 1.0)
    reason, made, lengths = through([first, failed, short, last])
    assert reason == "" and lengths == pytest.approx([0.2, 0.3, 0.15, 0.15])
    assert made.foreseen == pytest.approx(0.2 + 0.3 * 2), "of the failed panel; the first one's is behind"
    tiny = Panel(0.0, 1e-9, PANELS.nodes, PANELS.nodes, False, 0.1)
    assert through([tiny])[0] == "no panel of time is short enough"
    assert through([first], _accepts=lambda panel: False)[0].startswith("rows that were redundant")
    _, _, lengths = through([Panel(0.0, 1.0, PANELS.nodes, PANELS.nodes, True, 1.0)], times=np.array([0.0]))
    assert lengths == [1.0], "without a duration, one second"
