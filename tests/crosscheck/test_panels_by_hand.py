"""Panels of the reference / iterations whose changes are prescribed, series that are written down."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE, EXTENDED, doubles
from crosscheck.judge.reference import crossing, panels
from crosscheck.judge.reference.panels import Panel, Panels, _cosines
from crosscheck.judge.reference.stiff_panels import StiffPanels

NODES = 24
PANELS = Panels(DOUBLE, NODES)
TIMES = (PANELS.nodes + 1) / 2  # of a panel from 0 to 1 s


class Wave:
    """z' = w and w' = -z, scaled; z is cheap. The equations are singular at a time (s)."""

    light = 1

    def __init__(self, singular: float = 99.0, noise: float = 0.0):
        self.singular, self.noise = singular, noise
        self.asked = self.corrected = 0

    def light_rates(self, y: np.ndarray) -> np.ndarray:
        return y[:, 1:]

    def other_rates(self, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.asked += 1
        distance = np.abs(t - self.singular)
        near = distance < 0.15 * np.median(distance)
        return -y[:, :1] + self.noise * near[:, None], distance

    def nearer(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        self.corrected += 1
        return y


def solved(equations: Any, start: Any = (1.0, 0.0), length: float = 1.0) -> Panel:
    return PANELS.panel(equations, 0.0, length, np.repeat(np.array([start]), NODES, axis=0))


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_iterations_do_not_depend_on_the_unit(size):
    """The k-th iterate changes w by t^(2 k - 1) / (2 k - 1)!: 8e-13 for k = 8, less than 4e-13 for k = 9."""
    equations = Wave()
    panel = solved(equations, (size, 0.0))
    exact = np.stack([np.cos(TIMES), -np.sin(TIMES)], axis=1)
    assert panel.settled and panel.states / size == pytest.approx(exact, abs=1e-13)
    assert panel.rates[:, 0] / size == pytest.approx(-np.cos(TIMES), abs=1e-12)
    assert panel.sweeps == equations.asked == 9 and not equations.corrected
    assert (panel.start, panel.length, panel.crossing, panel.foreseen) == (0.0, 1.0, None, None)


def test_points_near_a_singular_position_do_not_count():
    """Rates near 0.6 s are off by 1e3; the place is 0.2 in [-1, 1]."""
    equations = Wave(0.6, noise=1e3)
    panel = solved(equations)
    exact = np.stack([np.cos(TIMES), -np.sin(TIMES)], axis=1)
    assert panel.settled and panel.states == pytest.approx(exact, abs=1e-9)
    assert panel.crossing == pytest.approx(0.2, abs=1e-9) and panel.time(panel.crossing) == pytest.approx(0.6)
    assert equations.corrected == equations.asked - 2, "after the place is known, from the second one"


def test_a_singular_position_in_the_middle_of_a_panel_is_bridged(monkeypatch):
    """Its place in [-1, 1] is exactly 0, which is a place like any other."""
    monkeypatch.setattr(panels, "singular_time", lambda places, distance: 0.0)
    equations = Wave(0.5, noise=1e3)
    panel = solved(equations)
    exact = np.stack([np.cos(TIMES), -np.sin(TIMES)], axis=1)
    assert panel.settled and panel.states == pytest.approx(exact, abs=1e-9)
    assert panel.crossing == 0.0 and equations.corrected == equations.asked - 2


def test_a_singular_position_after_a_panel_is_foreseen():
    panel = solved(Wave(1.5))
    assert panel.settled and panel.foreseen == pytest.approx(2.0) and panel.crossing is None


class Given:
    """Rates that are constant along a panel, one number for each sweep."""

    light = 0

    def __init__(self, *rates: float):
        self.rates, self.asked = rates, 0

    def light_rates(self, y: np.ndarray) -> np.ndarray:
        return y[:, :0]

    def other_rates(self, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rate = self.rates[self.asked % len(self.rates)]
        self.asked += 1
        return np.full((len(t), 1), rate), np.ones(len(t))


@pytest.mark.parametrize(
    ("rates", "count"),
    [
        ((1e-6, 1.1e-3), 2),
        ((1e-6, 0.9e-3, 2.1e-3), 3),
        ((1e-6, 0.9e-3, 0.9e-3), 3),
        ((1e-6, np.nan), 2),
        ((np.inf,), 1),
    ],
)
def test_an_iteration_diverges_by_a_thousand_times_the_least_change(rates, count):
    """The state is 1 and changes by the difference of rates, of which the first is a millionth."""
    equations = Given(*rates)
    panel = solved(equations, (1.0,))
    assert equations.asked == count
    if rates[-1] == rates[-2:][0] and count == 3:
        assert panel.settled and panel.sweeps == 3
    else:
        assert not panel.settled and panel.factor == 0.5 and (panel.states == 1.0).all()


def test_a_panel_has_fifty_nine_iterations_at_most():
    equations = Given(1e-5, 2e-5)
    panel = solved(equations, (1.0,))
    assert equations.asked == 59 and not panel.settled and panel.factor == 0.6
    assert (panel.states == 1.0).all() and panel.foreseen is None and panel.sweeps == 0


# --- series -----------------------------------------------------------------------------------------------
def of_series(coefficients: np.ndarray, start: float = 2.0, length: float = 0.5) -> Panel:
    """A panel whose state has these Chebyshev coefficients, and whose rate is twice the state."""
    state = np.polynomial.chebyshev.chebval(PANELS.nodes, coefficients)[:, None]
    return Panel(start, length, state, 2 * state, True, 1.0)


def test_samples_of_a_panel():
    """t³ from 2 s to 2.5 s."""
    t = 2.0 + 0.5 * TIMES
    panel = Panel(2.0, 0.5, t[:, None] ** 3, 3 * t[:, None] ** 2, True, 1.0)
    at = np.array([2.0, 2.1, 2.37, 2.5])
    states, rates = PANELS.sampled(panel, at)
    assert states[:, 0] == pytest.approx(at**3) and rates[:, 0] == pytest.approx(3 * at**2)


@pytest.mark.parametrize(("times", "cut"), [(1.35, NODES - 2), (1.8, 3)])
def test_a_series_is_cut_at_its_smallest_term_at_the_new_end(times, cut):
    """Coefficients 4^-k. At the new end x = 2 times - 1 the polynomial T_k is (z^k + z^-k) / 2 with z + 1/z =
    2 x: terms fall with z = 3.07, and grow with z = 5."""
    c = 4.0 ** -np.arange(NODES)
    panel = of_series(c)
    longer, lost = PANELS.continued(panel, times, 2.4)
    x = 2 * times - 1
    z = x + np.sqrt(x**2 - 1)
    terms = c * (z ** np.arange(NODES) + z ** -np.arange(NODES)) / 2 / c.sum()
    assert lost == pytest.approx(max(terms[cut : cut + 2]), rel=0.05)
    there = np.polynomial.chebyshev.chebval(times * (PANELS.nodes + 1) - 1, c[:cut])
    assert longer.states[:, 0] == pytest.approx(there, rel=1e-4)
    assert longer.rates[:, 0] == pytest.approx(2 * there, rel=1e-4)
    assert longer.settled and (longer.start, longer.length, longer.factor) == (2.0, 0.5 * times, 1.0)
    assert longer.time(longer.crossing) == pytest.approx(2.4)


def test_cosines_of_long_doubles():
    exact = np.cos(EXTENDED.array(np.arange(8)) / 4 * np.arctan2(EXTENDED.number(0.0), EXTENDED.number(-1.0)))
    assert doubles(np.abs(_cosines(EXTENDED, 4) - exact)).max() < 16 * EXTENDED.eps


# --- stiff panels -----------------------------------------------------------------------------------------
def corrected(*changes: float) -> tuple[Panel, int, int]:
    """A panel whose corrections are given, and the numbers of corrections and of factorisations."""
    stiff, made, steps = StiffPanels(PANELS), [], iter(changes)
    equations = SimpleNamespace(
        light=0,
        light_rates=lambda y: y[:, :0],
        other_rates=lambda t, y: (0 * y, np.ones(len(y))),
        in_doubles=lambda: None,
    )
    taken: list[float] = []

    def solve(factors: Any, residual: np.ndarray) -> np.ndarray:
        taken.append(next(steps))
        return np.full(residual.shape, -taken[-1])

    stiff._factorised = lambda equations, t, y, half: made.append((t[-1], half))
    stiff._solved = solve
    stiff._fits = lambda y, size: 1.25
    panel = stiff.panel(equations, 3.0, 0.5, np.ones((NODES, 1)))
    assert set(made) == {(3.5, 0.25)}
    return panel, len(taken), len(made)


def test_derivatives_are_computed_while_changes_are_large():
    panel, corrections, factorisations = corrected(0.1, 1.1e-4, 0.9e-4, 1e-6, 1e-13)
    assert panel.settled and (corrections, factorisations) == (5, 3)
    assert panel.states[0, 0] == 1.0 and panel.states[1:, 0] == pytest.approx(1 - 0.1 - 2e-4 - 1e-6)
    assert panel.factor == pytest.approx(0.9 * 1.25) and (panel.start, panel.length) == (3.0, 0.5)


@pytest.mark.parametrize(
    ("changes", "count"),
    [((0.1, 0.3, 0.59, 1e-13), 4), ((0.1, 0.3, 0.61), 3), ((0.1, np.nan), 2), ((0.01,) * 25, 25)],
)
def test_corrections_that_grow_or_do_not_end(changes, count):
    """After the second correction a change is at most twice the one before; there are 25 at most."""
    panel, corrections, _ = corrected(*changes)
    assert corrections == count and panel.settled is (changes[-1] == 1e-13)
    if not panel.settled:
        assert panel.factor == 0.6 and (panel.states == 1.0).all()


@pytest.mark.parametrize(("change", "count"), [(PANELS.tolerance, 1), (1.001 * PANELS.tolerance, 2)])
def test_a_change_of_the_tolerance_is_the_last(change, count):
    assert corrected(change, 0.0)[1] == count


# --- singular positions in a panel ------------------------------------------------------------------------
PLACES = np.arange(-32, 33) / 32  # a 32nd apart


def test_a_distance_that_is_not_finite_has_no_sign():
    distance = np.abs(PLACES - 0.2)
    assert crossing.singular_time(PLACES, distance) == pytest.approx(0.2)
    distance[-1] = np.inf
    assert crossing.singular_time(PLACES, distance) is None


@pytest.mark.parametrize(("least", "first", "last"), [(30, 18, 42), (5, 0, 17), (60, 48, 64)])
def test_the_points_to_which_distances_are_fitted(monkeypatch, least, first, last):
    """Twelve on either side of the least one; the distance is negative before it, or up to it."""
    seen: list[Any] = []
    monkeypatch.setattr(crossing, "_inside", lambda near: True)
    monkeypatch.setattr(crossing, "_fit", lambda x, d: seen.append((x, d)) or (1.0, None))
    distance = np.abs(PLACES - PLACES[least] - 0.01)
    assert crossing.singular_time(PLACES, distance) is None
    place, given = PLACES[first : last + 1], distance[first : last + 1]
    for (x, d), signs in zip(
        seen, ((place >= PLACES[least]), (place > PLACES[least]), place < 9), strict=True
    ):
        assert x.tolist() == place.tolist() and d.tolist() == np.where(signs, given, -given).tolist()


@pytest.mark.parametrize(
    ("roots", "found"),
    [
        ([0.0 + 1e-9j, 0.5], None),
        ([0.0 + 0.9e-9j, 0.5], 0.0),
        ([1 / 32, -0.01], -0.01),
        ([1 / 32], 1 / 32),
        ([-1 / 32, 1 / 16], -1 / 32),
        ([1 / 32 + 1e-9, -0.04], None),
        ([], None),
    ],
)
def test_roots_next_to_the_least_distance(monkeypatch, roots, found):
    """Real ones up to the largest distance of two points; of these the nearest one."""
    monkeypatch.setattr(crossing.chebyshev, "chebroots", lambda c: np.array(roots, dtype=complex))
    assert crossing.singular_time(PLACES, np.abs(PLACES)) == found


def test_the_largest_residual_of_a_fit():
    """Eight powers are met; of the tenth Chebyshev polynomial the whole is left at its own points."""
    own = np.cos(np.pi * (np.arange(10) + 0.5) / 10)
    x = np.concatenate([own, [1.0]])
    smooth = x**8 - 3 * x**5 + 2
    residual, coefficients = crossing._fit(x[:10], smooth[:10])
    assert residual < 1e-12 and np.polynomial.chebyshev.chebval(x, coefficients) == pytest.approx(smooth)
    bumpy = smooth + np.where(np.arange(11) == 10, 0.5, 0.0)
    residual, coefficients = crossing._fit(x, bumpy)
    left = np.polynomial.chebyshev.chebval(x, coefficients) - bumpy
    assert residual == pytest.approx(np.abs(left).max()) and residual > 2 * np.abs(left).min()
