"""Parts of the treatment of singular positions on small memories with known results, run interpreted by
``test_thresholds.py``."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mbref.equations.branches import Branches, Passed
from mbref.kernels.compilation import PLAIN
from mbref.kernels.layout import OK
from mbref.stepping.loop import DONE, PAUSED, SINGULAR_AHEAD, TOO_MANY_STEPS, UNDECIDED
from mbref.stepping.singular_start import Leaving
from mbref.taylor.crossing import (
    acceptance,
    departure,
    detection,
    determinants,
    location,
    long_crossing,
    rounding_pole,
    short_crossing,
    start,
    uniqueness,
)
from mbref.taylor.crossing.thresholds import CROSSING_NOISE, DEPARTURE, PIVOT_CLEAR
from mbref.taylor.mode import HIGH_ACCURACY, REGULAR
from tests.mbref.threshold_checks import KERNELS, memory

pytestmark = pytest.mark.skipif(not PLAIN, reason="kernels are interpreted by test_thresholds.py")


# --- determinants and location --------------------------------------------------------------------------
@pytest.mark.parametrize(("before", "after"), [(0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5)])
def test_rates_oppose_where_the_motion_reverses_relative_to_the_null_vector(before, after):
    state = memory()
    state.series.past[1, 0], state.series.terms[1, 0] = before, after
    assert determinants.rates_oppose(state) == (before * after < 0.0)


@pytest.mark.parametrize(("chosen", "expected"), [(1, (1, 2.0)), (2, (0, 3.0))])
def test_pivots_of_the_start_give_its_determinant_unless_rows_have_changed(monkeypatch, chosen, expected):
    state = memory(variables=1)
    state.partition.partition_id = chosen
    monkeypatch.setattr(determinants, "product_of_pivots", lambda *_: (1, 2.0))
    monkeypatch.setattr(determinants, "square_determinant", lambda _: (0, 3.0))
    state.kernels = SimpleNamespace(gradient=lambda *_: OK)
    determinants.save_start_determinant(state)
    assert (state.step.start_negative, state.step.start_logarithm) == expected


@pytest.mark.parametrize(
    ("rows", "chosen", "expected"), [(1, 1, True), (1, 2, True), (3, 1, True), (3, 2, False)]
)
def test_one_null_vector_needs_equal_rows_at_both_ends(rows, chosen, expected):
    """Two states may keep different ones of their redundant rows; two degrees of freedom have two vectors."""
    state = memory()
    state.solver.pivot_rows, state.partition.partition_id = np.arange(rows), chosen
    assert determinants.has_one_null_vector(state) == expected
    assert not determinants.has_one_null_vector(memory(variables=3))


@pytest.mark.parametrize("along", [0.3, -0.3])
@pytest.mark.parametrize("parity", [0, 1])
@pytest.mark.parametrize("pivot", [0.5, -0.5])
def test_minors_oppose_by_the_signs_of_motion_partition_and_pivots(along, parity, pivot):
    state = memory(pivot=pivot)
    state.partition.parity = parity
    assert determinants.minors_oppose(along, state) == (along * pivot * (1 - 2 * parity) < 0.0)


@pytest.mark.parametrize(
    ("vector", "negative", "size"),
    [
        ((0.5, 0.0), False, math.log(0.5)),
        ((-0.25, 2.0), True, math.log(0.25)),
        ((0.0, 1.0), False, -math.inf),
    ],
)
def test_the_determinant_by_pivots_and_null_vectors(vector, negative, size):
    """Pivots of 3 at the start and of 2 at the end; null vectors across each other make it zero."""
    state = memory(pivot=2.0)
    state.solver.past, state.solver.null_space = np.array([3.0]), np.array([vector, (9.0, 9.0)])
    found = determinants.determinant_by_null_vectors(state)
    assert found == (negative, pytest.approx(math.log(6.0) + size))


def as_determinant(monkeypatch, value, end):
    """Replace the determinant by a function of time in a step that ends at ``end``; return the times of
    evaluations."""
    times = []
    monkeypatch.setattr(location, "evaluate_series", lambda h, _: times.append(h))

    def found(number):
        return number < 0.0, math.log(max(abs(number), 1e-300))

    at_state = lambda y, made: found(value(times[-1])) if y is made.state else None  # noqa: E731
    monkeypatch.setattr(KERNELS, "determinant", at_state)
    monkeypatch.setattr(location, "save_start_determinant", lambda _: None)
    monkeypatch.setattr(location, "gradient_determinant_at_end", lambda _: found(value(end)))
    monkeypatch.setattr(location, "log_determinant_at_start", lambda _: math.log(abs(value(0.0))))
    return times


@pytest.mark.parametrize("end", [0.01, 1.0, 30.0])
def test_a_sign_change_is_located_in_steps_of_any_length(monkeypatch, end):
    times = as_determinant(monkeypatch, lambda h: math.cos(1.2 * math.pi * h / end), end)
    root = end / 2.4
    assert location.sign_change(end, memory()) == pytest.approx(root, rel=1e-12)
    assert len(times) < 12, "interpolation ends when it has converged"
    assert location.bisect(0.0, end, 0.0, memory()) == pytest.approx(root, rel=1e-12)
    assert location.find_crossings(end, memory()) == (pytest.approx(root, rel=1e-12), -1.0)


@pytest.mark.parametrize("end", [0.01, 1.0, 30.0])
def test_two_sign_changes_are_located_in_steps_of_any_length(monkeypatch, end):
    as_determinant(monkeypatch, lambda h: (h / end - 0.4) * (h / end - 0.7), end)
    state = memory()
    assert location.count_crossings(end, state) == 2
    assert state.step.first_crossing == pytest.approx(0.4 * end, rel=1e-10)
    assert state.step.second_crossing == pytest.approx(0.7 * end, rel=1e-10)


@pytest.mark.parametrize("end", [0.01, 30.0])
def test_two_sign_changes_are_told_apart_from_a_fraction_of_the_step_on(monkeypatch, end):
    for apart, second in ((0.9e-5, False), (1.1e-5, True)):
        as_determinant(monkeypatch, lambda h, apart=apart: 1e3 * ((h / end - 0.5) ** 2 - apart**2), end)
        monkeypatch.setattr(location, "time_of_minimum", lambda *_: 0.5 * end)
        assert (location.find_pair(end, memory())[1] >= 0.0) == second, apart


def test_interpolation_is_exact_for_the_inverse_of_a_parabola():
    """x = (y² + 2 y + 3) / 10 has the value 0.3 at y = 0."""
    place = lambda y: (y * y + 2.0 * y + 3.0) / 10.0  # noqa: E731
    found = location.interpolated(place(-0.5), -0.5, place(1.0), 1.0, place(2.0), 2.0)
    assert found == pytest.approx(0.3, rel=1e-14)
    assert location.interpolated(0.0, -1.0, 1.0, 3.0, 1.0, 3.0) == pytest.approx(0.25)


# --- rounding pole --------------------------------------------------------------------------------------
def with_pole(distance=0.1, size=1e-17):
    """A series near a singular position whose variable 0 has a pole at a distance (s)."""
    state = memory(start_pivot=1e-3)
    for k in range(31):
        state.series.past[k, 0] = size / distance**k
        state.series.past[k, 1] = 0.3**k
    return state


def test_a_pole_is_found_where_the_last_coefficients_are_its_own():
    assert rounding_pole.time_of_pole(with_pole()) == pytest.approx(0.1)
    assert rounding_pole.time_of_pole(with_pole(distance=-0.1)) == pytest.approx(-0.1)
    for order in (22, 21):
        state = with_pole()
        state.series.past[order] = 0.0
        assert rounding_pole.time_of_pole(state) == 0.0, order
    assert rounding_pole.time_of_pole(with_pole(size=1e-3)) == 0.0, "no rounding explains such a gap"


def test_a_series_without_its_pole_is_the_series_of_the_motion():
    state = with_pole()
    rounding_pole.remove_pole(0.1, state)
    assert np.abs(state.series.past[:20, 0]).max() < 1e-15
    assert state.series.past[:20, 1] == pytest.approx(0.3 ** np.arange(20), abs=1e-11)
    assert state.step.time_to_pole == 0.1 and state.step.used_order == state.step.last_order <= 19


# --- uniqueness -----------------------------------------------------------------------------------------
def test_kinetic_energy_is_a_quadratic_form_of_the_rates():
    state = memory()
    state.polynomials.inertia.mass = np.array([[2.0, 0.5], [0.5, 3.0]])
    rates = np.zeros((2, 8))
    rates[1, :2] = 1.0, -2.0
    assert uniqueness.kinetic_energy(rates, state) == pytest.approx(2.0 - 2.0 + 12.0)


def test_a_motion_keeps_moving_down_to_a_fiftieth_of_its_energy(monkeypatch):
    turned = [False]
    monkeypatch.setattr(uniqueness, "turns_back", lambda y, made: turned[0] and y is made.series.terms)
    assert uniqueness.keeps_moving(0.02, 1.0, memory())
    assert not uniqueness.keeps_moving(0.0199, 1.0, memory())
    assert not uniqueness.keeps_moving(0.0, 0.0, memory())
    turned[0] = True
    assert not uniqueness.keeps_moving(1.0, 1.0, memory())
    resting = memory()
    resting.series.past[1] = 0.0
    assert uniqueness.keeps_moving(1.0, 1.0, resting), "a motion from rest has no direction to reverse"


def test_pivots_are_compared_with_the_largest_pivot():
    state = memory(largest_pivot=2.0, start_pivot=1.0)
    assert detection.is_near_singular(0.5, state) and not detection.is_near_singular(0.7, state)


# --- crossings ------------------------------------------------------------------------------------------
def ended(monkeypatch, status, agrees=True, rank=1):
    """Status after a crossing, whether a perturbed run was made, and the memory."""
    state, made, saved = memory(rank=rank), [], []
    state.crossing_result = "result"
    state.run.loop.times = np.array([0.0, 1.0, 2.5])
    counts = state.run.equations.system.counts
    counts.steps, counts.rejected, counts.factorisations = 5, 6, 7

    def perturbed(*given):
        made.append(1)
        assert given == (1e-9, state)
        counts.steps, counts.rejected, counts.factorisations = 50, 60, 70
        return agrees

    for name in ("save_state", "restore_state", "set_regular"):
        monkeypatch.setattr(long_crossing, name, lambda *given, name=name: saved.append((name, *given)))
    monkeypatch.setattr(long_crossing, "perturbed_run_agrees", perturbed)
    state.run.control.rtol = 1e-9
    found = long_crossing.end_crossing.function(status, state)
    pair = [("save_state", state.run, "result"), ("restore_state", "result", state.run)]
    assert saved == [*(pair if status in (PAUSED, DONE) else []), ("set_regular", state)]
    assert (counts.steps, counts.rejected, counts.factorisations) == (5, 6, 7)
    return found, bool(made), state


def test_a_long_crossing_is_confirmed_by_a_perturbed_run(monkeypatch):
    for status in (PAUSED, DONE):
        assert ended(monkeypatch, status)[:2] == (status, True)
        assert ended(monkeypatch, status, agrees=False)[:2] == (UNDECIDED, True)
        assert ended(monkeypatch, status, agrees=False, rank=2)[:2] == (status, False), "drivers determine it"
        assert ended(monkeypatch, status)[2].progress.end == 2.5
    assert ended(monkeypatch, TOO_MANY_STEPS)[:2] == (TOO_MANY_STEPS, False)
    assert ended(monkeypatch, OK + 1)[:2] == (UNDECIDED, False)


@pytest.mark.parametrize(
    ("kind", "approaching", "distance", "is_of_crossing"),
    [
        (HIGH_ACCURACY, 1, 1e-2, 1),
        (REGULAR, 1, 1e-2, 0),
        (HIGH_ACCURACY, 0, 1e-2, 0),
        (HIGH_ACCURACY, 1, 0.9, 0),
    ],
)
def test_steps_that_approach_a_position_get_the_tolerance_of_crossings(
    kind, approaching, distance, is_of_crossing
):
    state = memory(kind=kind, approaching=approaching, start_pivot=distance)
    found, of_steps = acceptance.crossing_tolerance(state), acceptance.step_tolerance(state)
    assert found == (max(state.mode.tolerance, CROSSING_NOISE / distance) if is_of_crossing else of_steps)
    assert state.mode.tolerance != of_steps


@pytest.mark.parametrize(
    ("kind", "crossed", "pivot", "expected"),
    [
        (REGULAR, 1, 0.9, SINGULAR_AHEAD),
        (REGULAR, 0, 0.2, SINGULAR_AHEAD),
        (REGULAR, 0, 0.9, OK),
        (HIGH_ACCURACY, 0, 0.9, OK),
        (HIGH_ACCURACY, 0, 0.2, ("approach", 0.5, 0.2, "turned", 1)),
        (HIGH_ACCURACY, 1, 0.9, ("crossing", 0.9, "turned", 1)),
    ],
)
def test_steps_across_or_near_singular_positions_are_judged(monkeypatch, kind, crossed, pivot, expected):
    state = memory(kind=kind, pivot=pivot)
    state.kernels = SimpleNamespace(detect=lambda h, least, _: crossed * (h == 0.5) * (least == pivot))
    monkeypatch.setattr(acceptance, "ends_near_singular", lambda least, _: least < 0.3)
    monkeypatch.setattr(
        acceptance, "turns_back", lambda y, made: "turned" if y is made.series.terms else None
    )
    for name in ("crossing", "approach"):
        monkeypatch.setattr(acceptance, f"judge_{name}", lambda *given, name=name: (name, *given[:-1]))
    assert acceptance.judge_branch(0.5, 1, state) == expected
    assert state.step.crossed == crossed


@pytest.mark.parametrize("most", [1, 3])
def test_a_crossing_takes_no_more_steps_than_a_run_may(monkeypatch, most):
    state = memory(time=0.0)
    counts = state.run.equations.system.counts
    counts.steps = counts.crossings = 0
    state.run.control.most_steps, state.progress.end, state.progress.is_clear = most, 1.0, 0

    def step(_):
        counts.steps += 1
        return OK

    state.kernels = SimpleNamespace(step=step)
    for name in ("put_terms", "judge_clearance"):
        monkeypatch.setattr(long_crossing, name, lambda *_: None)
    assert (long_crossing.step_until_clear(state), counts.steps) == (TOO_MANY_STEPS, most)


def test_a_crossing_ends_with_the_step_that_crosses(monkeypatch):
    state, recorded = memory(time=0.0), []
    counts = state.run.equations.system.counts
    counts.steps = counts.crossings = 0
    state.run.control.most_steps, state.progress.end, state.progress.is_clear = 9, 1.0, 0

    def step(_):
        counts.steps += 1
        counts.crossings += counts.steps == 2
        return OK

    state.kernels = SimpleNamespace(step=step, record=lambda _: recorded.append(counts.steps))
    for name in ("put_terms", "judge_clearance"):
        monkeypatch.setattr(long_crossing, name, lambda *_: None)
    assert long_crossing.step_until_clear(state) == PAUSED
    assert recorded == [2]


def test_regular_steps_follow_when_the_distance_grows_beyond_a_limit():
    for before, pivot, clear in ((0.0, 0.2, 1), (0.0, 0.05, 0), (3.0, 0.2, 0), (2.0, 0.2, 1)):
        state = memory(pivot=pivot)
        state.progress.clearance = before
        long_crossing.judge_clearance(state)
        assert state.progress.is_clear == clear, (before, pivot)
    state = memory(pivot=0.2, largest_pivot=4.0)
    long_crossing.judge_clearance(state)
    assert state.progress.clearance == pytest.approx(0.2 / (PIVOT_CLEAR * 4.0))
    state.progress.clearance = 1e-3
    state.run.loop.clock.attempt_end = state.run.loop.clock.time
    state.solver.last[:] = 4.0 * PIVOT_CLEAR
    long_crossing.judge_clearance(state)
    assert state.progress.clearance == 1.0 and state.progress.is_clear, "the limit and the time belong to it"
    state = memory(pivot=0.2)
    state.run.loop.clock.attempt_end = 0.1
    long_crossing.judge_clearance(state)
    assert not state.progress.is_clear, "the attempt that met the position ended later"


def test_a_crossing_is_recorded_with_its_time_and_state(monkeypatch):
    state = memory(first_crossing=0.25, second_crossing=0.5, time=3.0)
    state.progress.recorded = 0
    state.run.state.coordinates = np.zeros(7)
    state.crossings = SimpleNamespace(
        time=np.zeros(2), coordinates=np.zeros((2, 7)), velocities=np.zeros((2, 1))
    )

    def put(h, memory_of_run):
        memory_of_run.run.state.coordinates[:], memory_of_run.run.state.velocities[:] = h, 10.0 * h

    monkeypatch.setattr(short_crossing, "put_state_at", put)
    short_crossing.record_crossings.function(state)
    assert state.progress.recorded == 2
    assert state.crossings.time == pytest.approx([2.25, 2.5])
    assert state.crossings.coordinates[:, 0] == pytest.approx([0.25, 0.5])
    assert state.crossings.velocities[:, 0] == pytest.approx([2.5, 5.0])


@pytest.mark.parametrize("crosses", [True, False])
def test_a_short_crossing_that_fails_is_undone(monkeypatch, crosses):
    state, restored = memory(time=1.0), []
    state.progress.recorded, state.crossings = 0, SimpleNamespace(time=np.zeros(16))
    state.angles, state.step_start = np.zeros(0), None
    state.kernels = SimpleNamespace(expand=lambda *_: OK, return_to_start=lambda _: OK)
    for name in ("put_angles", "save_variables", "set_high_accuracy", "set_regular"):
        monkeypatch.setattr(short_crossing, name, lambda *_: None)
    monkeypatch.setattr(short_crossing, "restore_step_start", lambda _: restored.append(1))

    def steps(memory_of_run):
        memory_of_run.run.loop.clock.time = 2.0
        memory_of_run.run.equations.system.counts.steps += 3
        return crosses

    monkeypatch.setattr(short_crossing, "take_crossing_steps", steps)
    state.run.loop.clock.sample = 0
    assert short_crossing.cross_briefly(state) == crosses
    clock, counts = state.run.loop.clock, state.run.equations.system.counts
    assert (clock.time, counts.steps, bool(restored)) == ((2.0, 4, False) if crosses else (1.0, 1, True))


# --- start and departure --------------------------------------------------------------------------------
def test_a_motion_from_rest_is_no_longer_near_once_its_pivot_has_grown():
    state = memory(pivot=1e-3, correction=1.0)
    assert not start.is_turned(state) and not state.progress.rests_near
    state = memory(pivot=1e-6, correction=1.0)
    assert start.is_turned(state) and state.progress.rests_near


def leaving(monkeypatch, times):
    """A departure, its clock, and what it continues from."""
    clock, taken = SimpleNamespace(sample=0, time=0.0), []
    run = SimpleNamespace(
        times=np.array(times),
        model=SimpleNamespace(data=SimpleNamespace(lengths=np.ones(1))),
        memory=SimpleNamespace(loop=SimpleNamespace(clock=clock)),
    )
    taylor = SimpleNamespace(progress=SimpleNamespace(completed=9))
    found = departure.Departure(run, taylor, None, None)
    found._come_from = lambda *given: taken.append(given) or PAUSED
    found._misses, found._put_samples_before = lambda *_: False, lambda *_: None
    monkeypatch.setattr(departure, "displaced", lambda q, x: q[:6] + x)
    return found, clock, taken


def test_a_branch_is_entered_behind_the_crossing_and_before_the_next_sample(monkeypatch):
    velocities = np.array([[1.0, 0, 0, 0, 0, 0], [0.0, 2.0, 0, 0, 0, 0]])
    passed = Passed(1.0, np.zeros(7), velocities[0], 2)
    monkeypatch.setattr(departure, "branches_passed", lambda *_: Branches(velocities, "2 branches"))
    found, clock, taken = leaving(monkeypatch, [0.0, 1.0, 5.0])
    assert found.along_branch(passed) == PAUSED
    _, direction, ahead, (q, v) = taken[0]
    assert clock.sample == 2 == found._taylor.progress.completed
    assert direction is v and list(v) == list(velocities[1])
    assert ahead == pytest.approx(DEPARTURE / 2.0) and q == pytest.approx(ahead * velocities[1])
    found, _, taken = leaving(monkeypatch, [0.0, 1.0, 1.0 + 1e-4])
    found.along_branch(passed)
    assert taken[0][2] == pytest.approx(0.5e-4)
    found, _, taken = leaving(monkeypatch, [0.0, 1.0])
    found.along_branch(passed)
    assert taken[0][2] == pytest.approx(DEPARTURE / 2.0), "no sample follows"


def test_a_start_at_rest_is_left_along_its_acceleration(monkeypatch):
    acceleration = np.array([0.0, 4.0, 0, 0, 0, 0])
    found, _, taken = leaving(monkeypatch, [0.0, 1.0])
    assert found.from_start(Leaving(np.zeros(7), np.zeros(6), acceleration)) == PAUSED
    passed, _, ahead, (q, v) = taken[0]
    assert passed.time == 0.0 and passed.taken == 1
    assert ahead == pytest.approx(math.sqrt(DEPARTURE / 2.0))
    assert q == pytest.approx(0.5 * ahead**2 * acceleration) and v == pytest.approx(ahead * acceleration)
    assert q[1] == pytest.approx(DEPARTURE)


def test_a_slow_start_is_left_by_its_acceleration(monkeypatch):
    """r t + s t² / 2 = DEPARTURE has the root t = 1e-3 for r = 1 and s = 2 (DEPARTURE - 1e-3) / 1e-6."""
    speed = np.array([0.0, 1.0, 0, 0, 0, 0])
    way = Leaving(np.zeros(7), speed, 2.0 * (DEPARTURE - 1e-3) / 1e-6 * speed)
    found, _, taken = leaving(monkeypatch, [0.0, 1.0])
    assert found.from_start(way) == PAUSED
    assert taken[0][2] == pytest.approx(1e-3) and taken[0][3][0][1] == pytest.approx(DEPARTURE)


def test_a_start_in_motion_that_its_series_misses_is_undecided(monkeypatch):
    moving = Leaving(np.zeros(7), np.array([2.0, 0, 0, 0, 0, 0]), np.zeros(6))
    found, clock, taken = leaving(monkeypatch, [0.0, 1e-4])
    assert found.from_start(moving) == PAUSED
    assert taken[0][2] == pytest.approx(0.5e-4), "at most half of the run"
    asked = []
    found._misses = lambda *given: asked.append(given) or True
    clock.time = 0.5e-4
    assert found.from_start(moving) == UNDECIDED and clock.time == 0.0
    (q, v, ahead), expected = asked[0], moving.coordinates
    assert q is expected and v is moving.velocities and ahead == taken[0][2]


@pytest.mark.parametrize(("moved", "changed", "far"), [(0.5, 0.0, 0), (0.51, 0.0, 1), (0.0, 0.1, 1)])
def test_a_series_misses_a_start_from_which_it_is_further_than_a_distance(monkeypatch, moved, changed, far):
    taylor, asked = SimpleNamespace(options=SimpleNamespace(start_distance=0.5)), []
    found, v = departure.Departure(None, taylor, None, None), np.array([2.0, 0.0])
    monkeypatch.setattr(departure, "displacement", lambda q, there: there - q)
    found._state_at = lambda h: asked.append(h) or (np.array([0.0, 1.0 - moved]), v + changed)
    assert found._misses(np.array([0.0, 1.0]), v, 0.25) == bool(far)
    assert asked == [-0.25, 0.0], "the state at the series' beginning is put back"
    found._state_at = lambda h: (np.array([0.0, 1.0 - moved]), v + changed if h else 1e7 * v)
    assert found._misses(np.array([0.0, 1.0]), v, 0.25) == (moved > 0.5), "relative to the larger speed"


@pytest.mark.parametrize(("velocity", "expected"), [([0.0, 2.0], 7.0), ([0.0, 0.0], 5.0)])
def test_the_sample_at_a_start_has_its_acceleration_only_at_rest(velocity, expected):
    """In motion the series has it."""
    system = SimpleNamespace(acceleration=np.full(2, 7.0))
    clock, put = SimpleNamespace(sample=0), []
    run = SimpleNamespace(
        times=np.array([0.0, 0.1, 0.5]),
        memory=SimpleNamespace(loop=SimpleNamespace(clock=clock), equations=SimpleNamespace(system=system)),
    )
    found = departure.Departure(run, SimpleNamespace(progress=SimpleNamespace(completed=0)), None, None)
    found._state_at = lambda h: (np.full(2, h), np.full(2, 3.0))
    found._put_sample = lambda k, q, v, acceleration: put.append((k, q[0], list(v), acceleration[0]))
    found._put_samples_before(0.3, Leaving(np.ones(2), np.array(velocity), np.full(2, 5.0)))
    assert put == [(0, 1.0, velocity, expected), (1, pytest.approx(-0.2), [3.0, 3.0], 7.0)]
    assert clock.sample == 2


def test_a_state_behind_a_crossing_is_corrected_by_its_series_there(monkeypatch):
    """A series that misses the crossing by 0.1 in x and by 0.2 in the velocity of z, at each evaluation."""
    state = SimpleNamespace(coordinates=np.zeros(7), velocities=np.zeros(6))
    found = departure.Departure(SimpleNamespace(memory=SimpleNamespace(state=state)), None, lambda: OK, None)
    crossing, velocities = np.array([1.0, 2, 3, 1, 0, 0, 0]), np.array([0.0, 0, 4, 0, 0, 0])
    place, rate = np.array([0.1, 0, 0, 0, 0, 0, 0]), np.array([0.0, 0, 0.2, 0, 0, 0])

    def state_at(ahead):
        off = ahead < 0.0
        return state.coordinates + off * (place - 0.5), state.velocities + off * (rate - 4.0)

    found._state_at = state_at
    monkeypatch.setattr(departure, "displacement", lambda there, wanted: wanted - there)
    monkeypatch.setattr(departure, "displaced", lambda q, change: q + change)
    moved = crossing + 0.5, velocities + 4.0
    assert found._corrected(Passed(0.0, crossing, velocities, 1), velocities, 0.5, moved) == OK
    assert state.coordinates == pytest.approx(crossing + 0.5 - place)
    assert state.velocities == pytest.approx(velocities + 4.0 - rate)
