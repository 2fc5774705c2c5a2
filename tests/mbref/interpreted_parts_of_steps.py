"""Parts of steps by series: samples, corrections, ends of attempts, sizes and angles / by hand, interpreted.

``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref.kernels.layout import NOT_CONVERGED, OK, SINGULAR
from mbref.taylor import angles, coefficients, correction, sample_completion, stepping
from mbref.taylor.crossing import acceptance, determinants, location, rounding_pole, uniqueness


def noted(patch: pytest.MonkeyPatch, module: Any, calls: list[Any], **answers: Any) -> None:
    """Replace functions of a module by ones that note name and arguments; lists answer in turn."""
    for name, answer in answers.items():
        patch.setattr(module, name, noting(calls, name, answer))


def noting(calls: list[Any], name: str, answer: Any = None) -> Callable[..., Any]:
    """Return a function that notes its name and arguments, ``...`` for a record."""

    def function(*given: Any) -> Any:
        calls.append((name, *[... if isinstance(each, SimpleNamespace) else each for each in given]))
        return answer.pop(0) if isinstance(answer, list) else answer

    return function


# --- samples ----------------------------------------------------------------------------------------------
def sampled(k: int, exact: int) -> Any:
    """Two of four samples taken, of 2 coordinates and 2 lanes, with angles of slots 2 and 0."""
    return SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(
                clock=SimpleNamespace(sample=k),
                times=np.array([0.0, 0.5, 0.75, 1.0]),
                samples=SimpleNamespace(coordinates=np.arange(8.0).reshape(4, 2)),
            ),
            previous=SimpleNamespace(coordinates=np.array([-1.0, -2.0])),
            state=SimpleNamespace(coordinates=np.full(2, 9.0)),
            equations=SimpleNamespace(angles=np.full(3, 9.0)),
        ),
        waiting=SimpleNamespace(
            state=np.arange(24.0).reshape(4, 6),
            angles=np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]),
            exact=np.array([1 - exact, exact, exact, 1 - exact]) if k in (1, 2) else np.full(4, exact),
        ),
        polynomials=SimpleNamespace(torsions=SimpleNamespace(slot=np.array([2, 0]))),
        state=np.zeros((3, 2)),
        angles=np.zeros(2),
        kernels=SimpleNamespace(),
    )


@pytest.mark.parametrize(
    ("k", "exact", "expanded", "balanced", "status", "names"),
    [
        (2, 0, OK, OK, OK, ["expand", "poses", "state", "balance", "take"]),
        (1, 1, None, OK, OK, ["poses", "state", "balance", "take"]),
        (0, 0, SINGULAR, None, SINGULAR, ["expand", "poses", "state"]),
        (3, 0, OK, SINGULAR, SINGULAR, ["expand", "poses", "state", "balance"]),
    ],
)
def test_one_sample_is_completed(monkeypatch, k, exact, expanded, balanced, status, names):
    """The quaternions of the sample before, or of the start, give the signs; a failed sample is not taken."""
    memory, calls = sampled(k, exact), []
    module = sample_completion
    monkeypatch.setattr(module, "expand_at_sample", noting(calls, "expand", expanded))
    monkeypatch.setattr(module, "find_poses", noting(calls, "poses"))
    monkeypatch.setattr(module, "put_state", noting(calls, "state"))
    monkeypatch.setattr(module, "take_sample", noting(calls, "take"))
    memory.kernels.balance = noting(calls, "balance", balanced)
    assert module.complete_sample.function(memory) == status
    assert [name for name, *_ in calls] == names
    before = [-1.0, -2.0] if k == 0 else [2.0 * k - 2, 2.0 * k - 1]
    assert memory.run.state.coordinates.tolist() == before
    assert memory.state.ravel().tolist() == list(range(6 * k, 6 * k + 6))
    first, second = 2.0 * k + 1, 2.0 * k + 2
    assert memory.angles.tolist() == [first, second]
    assert memory.run.equations.angles.tolist() == [second, 9.0, first]
    if "balance" in names:
        assert ("balance", [0.0, 0.5, 0.75, 1.0][k], ...) in calls


@pytest.mark.parametrize(
    ("drivers", "statuses"), [(0, [OK]), (1, [OK, OK]), (1, [OK, SINGULAR]), (0, [SINGULAR])]
)
def test_a_sample_is_expanded_at_its_time(drivers, statuses):
    """Variables stand in 9 of 16 lanes; the second derivative is twice the second order."""
    lanes, variable = np.arange(48.0).reshape(3, 16), (np.arange(16) < 9) * 1.0
    terms, seen, left = np.full((4, 16), 99.0), [], list(statuses)

    def expand(t: float, memory: Any) -> int:
        seen.append((t, terms[:2].copy()))
        terms[:3] = 100.0 + np.arange(48.0).reshape(3, 16)
        return left.pop(0)

    memory = SimpleNamespace(
        series=SimpleNamespace(terms=terms, variable=variable),
        state=lanes.copy(),
        run=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(time=0.75))),
        options=SimpleNamespace(follows_drivers=drivers),
        kernels=SimpleNamespace(expand=expand),
    )
    assert sample_completion.expand_at_sample(memory) == statuses[-1]
    assert len(seen) == len(statuses) and not left and seen[0][0] == 0.75
    assert seen[0][1].tolist() == (variable * lanes[:2]).tolist()
    found = 100.0 + np.arange(48.0).reshape(3, 16)
    found[2] *= 2.0
    assert memory.state.tolist() == (found if statuses[-1] == OK else lanes).tolist()


def test_the_series_is_restored_after_samples(monkeypatch):
    memory, calls = SimpleNamespace(series_start="start", angles="angles"), []
    memory.series = SimpleNamespace(terms="terms")
    memory.run = SimpleNamespace(
        loop=SimpleNamespace(clock=SimpleNamespace(time=0.25)), equations=SimpleNamespace()
    )
    memory.kernels = SimpleNamespace(partition=noting(calls, "partition"), terms=noting(calls, "terms"))
    noted(
        monkeypatch,
        sample_completion,
        calls,
        restore_variables=None,
        select_pieces=None,
        expand_functions=None,
    )
    sample_completion.return_to_series(memory)
    assert calls == [
        ("restore_variables", "start", "terms", "angles"),
        ("select_pieces", 0.25, ...),
        ("expand_functions", 0.25, ...),
        ("partition", ...),
        ("terms", ...),
    ]


def test_the_state_and_the_start_of_a_series_are_saved_before_samples(monkeypatch):
    calls: list[Any] = []
    memory = SimpleNamespace(
        run=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(sample=4))),
        progress=SimpleNamespace(completed=3),
        before_samples="before",
        series=SimpleNamespace(terms="terms"),
        angles="angles",
        series_start="start",
    )
    answers = dict.fromkeys(("save_state", "save_variables", "restore_state", "return_to_series"))
    noted(monkeypatch, sample_completion, calls, complete_until=OK, **answers)
    assert sample_completion.complete_samples.function(1, memory) == OK
    assert calls == [
        ("save_state", ..., "before"),
        ("save_variables", "terms", "angles", "start"),
        ("complete_until", 4, ...),
        ("restore_state", "before", ...),
        ("return_to_series", ...),
    ]


def test_all_samples_are_completed_up_to_the_end(monkeypatch):
    """Two of four samples: the later ones wait for their steps."""
    clock, pieces = SimpleNamespace(sample=9, time=0.0), []

    def sample(memory: Any) -> int:
        clock.sample += 1
        return OK

    memory = SimpleNamespace(
        run=SimpleNamespace(
            loop=SimpleNamespace(clock=clock, times=np.array([0.0, 0.5, 1.5, 2.0])), equations="e"
        ),
        progress=SimpleNamespace(completed=1),
        mode=SimpleNamespace(order=20, tolerance=1e-9),
        options=SimpleNamespace(accurate_tolerance=1e-13),
        kernels=SimpleNamespace(sample=sample),
    )
    monkeypatch.setattr(sample_completion, "select_pieces", lambda *given: pieces.append(given))
    assert sample_completion.complete_until(3, memory) == OK and memory.progress.completed == 3
    assert pieces == [(0.5, "e"), (1.5, "e")] and clock.time == 1.5


# --- corrections ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("left", "factors", "changes", "status", "calls"),
    [
        ([1e-6], [OK], False, OK, "fcr"),
        ([1.1e-6, 1e-9], [OK, OK], False, OK, "fcfcr"),
        ([1e-9], [OK, SINGULAR], True, SINGULAR, "fcfr"),
        ([1e-9], [OK, OK], True, OK, "fcfr"),
        ([1.0, 1e-9], [OK, SINGULAR], False, SINGULAR, "fcf"),
        ([1.0] * 7 + [1e-9], [OK] * 8, False, OK, "fc" * 8 + "r"),
        ([1.0] * 8, [OK] * 8, False, NOT_CONVERGED, "fc" * 8),
        ([float("nan")] * 8, [OK] * 8, False, NOT_CONVERGED, "fc" * 8),
    ],
)
def test_corrections_until_one_leaves_rounding(monkeypatch, left, factors, changes, status, calls):
    """Violations at the beginning of each correction; f factorises, c closes rows and r closes rates."""
    made: list[Any] = []
    answers = {"violation": [*left], "factorise_equations": [*factors], "close": None, "close_rate": None}
    noted(monkeypatch, correction, made, **answers, largest_change=0.5, changes_factor=changes)
    memory = SimpleNamespace(step=SimpleNamespace(violation=9.0, correction=9.0))
    assert correction.correct_state.function(memory) == status
    names = {"factorise_equations": "f", "close": "c", "close_rate": "r"}
    assert "".join(names.get(name, "") for name, *_ in made) == calls
    assert memory.step.violation == pytest.approx(left[0], nan_ok=True)
    is_judged = status == OK or changes
    assert memory.step.correction == (0.5 if is_judged else 9.0)
    assert [given for name, *given in made if name == "changes_factor"] == [[left[-1], ...]] * is_judged


# --- ends of attempts -------------------------------------------------------------------------------------
@pytest.mark.parametrize("last", [True, False])
def test_an_attempt_is_expanded_at_its_end(monkeypatch, last):
    """Values and rates of 9 variables in 16 lanes, and angles; the last expansion of a run has order 2."""
    variable, calls = (np.arange(16) < 9) * 1.0, []
    state, terms = np.arange(48.0).reshape(3, 16), np.full((4, 16), 99.0)

    def expand(t: float, memory: Any) -> int:
        calls.append(("expand", t, memory.mode.order, terms.copy()))
        return NOT_CONVERGED

    memory = SimpleNamespace(
        mode=SimpleNamespace(order=7),
        series=SimpleNamespace(terms=terms, variable=variable),
        state=state,
        run=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(time=2.0))),
        kernels=SimpleNamespace(expand=expand),
    )
    noted(monkeypatch, stepping, calls, evaluate_series=None, put_angles=None)
    assert stepping.expand_at(0.25, last, memory) == NOT_CONVERGED and memory.mode.order == 7
    evaluated, put, (name, t, order, found) = calls
    assert (evaluated, put) == (("evaluate_series", 0.25, ...), ("put_angles", 0.25, ...))
    assert (name, t, order) == ("expand", 2.25, 2 if last else 7)
    assert found[:2].tolist() == (variable * state[:2]).tolist() and (found[2:] == 99.0).all()


@pytest.mark.parametrize(
    ("pole", "lengths", "calls"),
    [
        (0.0, [], ["save"]),
        (0.5, [4.0, 2.1], ["save", "remove"]),
        (0.5, [4.0, 2.0], ["save", "remove", "save"]),
        (-0.5, [4.0, 1.9], ["save", "remove", "save"]),
        (0.5, [4.0, float("nan")], ["save", "remove", "save"]),
    ],
)
def test_a_pole_is_removed_unless_steps_become_short(monkeypatch, pole, lengths, calls):
    """A step without the pole must be longer than half of the step with it; the series is saved anew else."""
    made: list[Any] = []
    monkeypatch.setattr(stepping, "save_series", noting(made, "save"))
    monkeypatch.setattr(stepping, "remove_pole", noting(made, "remove"))
    noted(monkeypatch, stepping, made, time_of_pole=pole, step_tolerance=1e-9, longest_step=lengths)
    assert stepping.save_series_without_pole.function(SimpleNamespace()) == OK
    assert [name for name, *_ in made if name in ("save", "remove")] == calls and not lengths
    assert [given for name, *given in made if name == "remove"] == [[pole, ...]] * ("remove" in calls)
    assert [given for name, *given in made if name == "longest_step"] == [[1e-9, ...]] * (2 if pole else 0)


def test_pivots_are_saved_before_the_series(monkeypatch):
    calls: list[Any] = []
    noted(monkeypatch, stepping, calls, save_pivots=None)
    stepping.save_start(SimpleNamespace(kernels=SimpleNamespace(save_series=noting(calls, "series"))))
    assert calls == [("save_pivots", ...), ("series", ...)]


@pytest.mark.parametrize(
    ("accurate", "loose", "pole", "crossing", "left", "expected"),
    [
        (False, 1.0, 0.0, 0.0, 9.0, (3.0, 3.0)),
        (False, 1.0, 0.0, 0.0, 0.5, (0.5, 0.5)),
        (True, 1.0, 0.0, 0.0, 9.0, (2.0, 2.0)),
        (True, 1.0, 0.0, 0.0, 1.5, (1.5, 1.5)),
        (True, 4.0, 0.0, 0.0, 9.0, (2.0, 5.0)),
        (True, 4.0, 0.0, 0.0, 4.0, (2.0, 4.0)),
        (True, 4.0, 5.5, 0.0, 9.0, (2.0, 5.0)),
        (True, 1.0, 2.4, 7.0, 9.0, (2.4 - 0.6 * 2.0,) * 2),
        (True, 1.0, -2.4, 2.4, 9.0, (2.4 - 0.6 * 2.0,) * 2),
        (True, 1.0, 0.0, 2.4, 9.0, (2.4 - 0.6 * 2.0,) * 2),
        (True, 4.0, 0.0, 4.0, 9.0, (2.0, 5.0)),
    ],
)
def test_the_longest_regular_step_and_the_longest_that_crosses(
    monkeypatch, accurate, loose, pole, crossing, left, expected
):
    """Steps of 2 s by the tolerance 1, of 5 s by the tolerance 4, of 3 s by a third of the tolerance."""
    lengths, asked = {1.0: 2.0, 4.0: 5.0, 1 / 3: 3.0}, []
    memory = SimpleNamespace(
        step=SimpleNamespace(time_to_pole=pole, time_to_crossing=crossing),
        run=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(length=0.125))),
    )
    noted(monkeypatch, stepping, asked, is_accurate=accurate, share=1 / 3)
    noted(monkeypatch, stepping, [], step_tolerance=1.0, crossing_tolerance=loose)
    monkeypatch.setattr(stepping, "longest_step", lambda tolerance, memory: lengths[tolerance])
    assert stepping.first_lengths(left, memory) == pytest.approx(expected)
    assert memory.step.time_to_crossing == (0.0 if accurate else crossing)
    assert (("share", 0.125, ...) in asked) is not accurate


@pytest.mark.parametrize(("speeds", "speed"), [((0.25, -0.5), 0.5), ((-3.0, 2.0), 3.0)])
def test_the_rounding_of_the_time_moves_drivers(speeds, speed):
    """At 1e6 s by 3e-10 s times the speed; the third lane is no variable."""
    memory = SimpleNamespace(
        step=SimpleNamespace(crossed=0, start_pivot=0.25, start_violation=0.0),
        progress=SimpleNamespace(largest_pivot=0.5),
        series=SimpleNamespace(terms=np.array([[9.0] * 3, [*speeds, 9.0]])),
        polynomials=SimpleNamespace(given=SimpleNamespace(driver=np.zeros(1))),
        solver=SimpleNamespace(pivot_columns=np.zeros(2)),
        run=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(time=1e6))),
    )
    found = acceptance.violation_by_rounding
    assert found(memory) == pytest.approx(3e-10 * speed, rel=1e-12, abs=0.0)
    memory.step.crossed = 1
    assert found(memory) == pytest.approx(3e-10 * speed, rel=1e-12, abs=0.0)
    memory.polynomials.given.driver = np.zeros(0)
    assert found(memory) == 1e-13
    memory.step.crossed = 0
    assert found(memory) == pytest.approx(5e-15, rel=1e-12, abs=0.0)
    memory.step.start_violation = 1e-10
    assert found(memory) == 2e-10
    memory.step.start_pivot = memory.step.start_violation = 0.0
    assert found(memory) == 1e-15


# --- singular positions -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("accurate", "part", "found"),
    [
        (True, 2.0, 0.1),
        (True, 0.5, 0.1),
        (False, 0.999, 0.1),
        (False, 1.0, 0.0),
        (True, 0.0, 0.0),
        (False, 0.0, 0.0),
    ],
)
def test_poles_of_series_near_singular_positions(monkeypatch, accurate, part, found):
    """Pivots relative to CROSSING_START of the largest one, 2; high-accuracy steps may start anywhere."""
    past = np.zeros((23, 8))
    past[:, 1] = 1e-17 * 0.1 ** -np.arange(23.0)
    monkeypatch.setattr(rounding_pole, "is_accurate", lambda memory: accurate)
    memory = SimpleNamespace(
        series=SimpleNamespace(past=past),
        mode=SimpleNamespace(order=22),
        step=SimpleNamespace(start_pivot=part * rounding_pole.CROSSING_START * 2.0),
        progress=SimpleNamespace(largest_pivot=2.0),
        solver=SimpleNamespace(pivot_columns=np.zeros(3)),
    )
    assert rounding_pole.time_of_pole(memory) == pytest.approx(found)
    if accurate:
        memory.step.start_pivot = 1.0
        assert rounding_pole.time_of_pole(memory) == pytest.approx(0.1)


def test_the_energy_in_the_middle_of_a_step(monkeypatch):
    calls: list[Any] = []
    noted(monkeypatch, uniqueness, calls, evaluate_series=None, kinetic_energy=7.0)
    clock = SimpleNamespace(length=0.5)
    memory = SimpleNamespace(run=SimpleNamespace(loop=SimpleNamespace(clock=clock)), state="state")
    assert uniqueness.energy_in_middle(memory) == 7.0
    assert calls == [("evaluate_series", 0.25, ...), ("kinetic_energy", "state", ...)]


@pytest.mark.parametrize(("depth", "pair"), [(-0.25, False), (-0.2500001, True), (0.25, False)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_pair_of_crossings_has_a_depth(monkeypatch, depth, pair, side):
    """A hundredth of the step of 2 s beside the minimum at 1.5 s, on either side."""
    calls: list[Any] = []
    monkeypatch.setattr(location, "PAIR_DEPTH", 0.25)
    monkeypatch.setattr(location, "PAIR_OFFSET", 0.01)
    noted(monkeypatch, location, calls, log_determinant_at_start=0.5, time_of_minimum=1.5, bisect=[0.7, 1.9])
    asked: list[float] = []

    def value_at(t: float, unit: float, memory: Any) -> float:
        assert unit == 0.5
        asked.append(t)
        return depth if t == pytest.approx(1.5 + side * 0.02) else 1.0

    monkeypatch.setattr(location, "value_at", value_at)
    assert location.find_pair(2.0, SimpleNamespace()) == ((0.7, 1.9) if pair else (1.5, -1.0))
    at = 1.5 + side * 0.02
    ends = [("bisect", 0.0, pytest.approx(at), 0.5, ...), ("bisect", 2.0, pytest.approx(at), 0.5, ...)]
    assert [call for call in calls if call[0] == "bisect"] == (ends if pair else [])
    assert ("time_of_minimum", 2.0, location.SECTIONS, ...) in calls
    assert asked == pytest.approx([1.48, 1.52] if side > 0 or not pair else [1.48])


def test_the_determinant_at_the_start_by_pivots_and_the_null_vector():
    """det(G₀ G₀ᵀ) is the squared product of the pivots 3 and -2, times the square of the null vector."""
    memory = SimpleNamespace(
        solver=SimpleNamespace(
            past=np.array([3.0, -2.0, 9.0]), past_motion=np.array([1.0, -0.5, 2.0]), pivot_columns=np.zeros(3)
        ),
        partition=SimpleNamespace(rank=2),
    )
    assert determinants.log_start_by_null_vector(memory) == pytest.approx(np.log(36.0 * 5.25))


# --- sizes ------------------------------------------------------------------------------------------------
def test_the_largest_coefficient_of_the_variables():
    """Nine variables in 16 lanes; multipliers stand behind them, and other orders are larger."""
    past = np.zeros((3, 24))
    past[:, 9:] = 1e3
    past[0], past[2] = 1e4, 1e5
    variable = (np.arange(24) < 9) * 1.0
    memory = SimpleNamespace(
        series=SimpleNamespace(past=past, variable=variable),
        solver=SimpleNamespace(pivot_columns=np.zeros(9)),
    )
    for place in (0, 7, 8):
        past[1, :9] = 1.0
        past[1, place] = -3.0
        assert coefficients.largest_used(1, memory) == 3.0, place
    memory.solver.pivot_columns = np.zeros(8)
    variable[:] = np.arange(24) < 8
    past[1, :9] = (*[0.5] * 8, 7.0)
    assert coefficients.largest_used(1, memory) == 0.5


# --- angles of couplings ----------------------------------------------------------------------------------
FORM, CONSTANT = (
    np.cos(2.4 * np.arange(54.0)).reshape(27, 2),
    np.sin(1.0 + 1.7 * np.arange(27.0)).reshape(3, 9),
)
ROWS, FACTORS = (-1, 1, 0), (9.0, 0.5, -2.0)
PLACE, RATE = np.array([0.6, 0.8]), np.array([0.3, -0.7])


def coupled(place: np.ndarray = PLACE) -> Any:
    """Three angles of two variables behind three pivots: of a load, and of couplings in rows 1 and 0."""
    return SimpleNamespace(
        polynomials=SimpleNamespace(
            torsions=SimpleNamespace(
                row=np.array(ROWS), factor=np.array(FACTORS), form=FORM, constant=CONSTANT
            )
        ),
        series=SimpleNamespace(terms=np.array([place, RATE])),
        solver=SimpleNamespace(phi=np.full(6, 0.25), pivot_columns=np.zeros(3)),
        angles=np.array([0.0, 7.0, -6.0]),
    )


def phi(place: np.ndarray) -> np.ndarray:
    """The factors times the angles of rows 0 and 1, nearest to those before."""
    found = np.zeros(2)
    for s, near in ((1, 7.0), (2, -6.0)):
        e1, e2, f = (CONSTANT[s] + FORM[9 * s : 9 * s + 9] @ place).reshape(3, 3)
        angle = np.arctan2(e2 @ f, e1 @ f)
        found[ROWS[s]] = FACTORS[s] * (angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi)))
    return found


def slope(along: np.ndarray) -> np.ndarray:
    return (phi(PLACE + 1e-6 * along) - phi(PLACE - 1e-6 * along)) / 2e-6


def test_angles_of_several_couplings():
    memory = coupled()
    angles.add_angles(memory)
    assert memory.solver.phi - 0.25 == pytest.approx([0, 0, 0, *phi(PLACE), 0], abs=1e-12)


def test_rates_of_angles_of_several_couplings():
    memory = coupled()
    angles.add_angle_rates(memory)
    assert memory.solver.phi - 0.25 == pytest.approx([0, 0, 0, *slope(RATE), 0], abs=1e-7)


def test_gradients_of_angles_of_several_couplings():
    memory, matrix = coupled(), np.full((3, 5), 0.25)
    angles.add_angle_gradients(memory.series.terms, matrix, memory)
    expected = np.zeros((3, 5))
    expected[:2, :2] = np.array([slope(e) for e in np.eye(2)]).T
    assert matrix - 0.25 == pytest.approx(expected, abs=1e-7)
