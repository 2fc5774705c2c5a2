"""Parts of the adapter of Exudyn / stretches, extrapolation and crossings worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.exudyn import dynamic, extrapolation, singular_crossing
from crosscheck.engines.exudyn.dynamic import Ending, Motion, State
from mbref import rotations
from mbref.scene import Body, Driver, Revolute, Scene
from mbref.trajectory import Cost, Outcome

Z, O = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=2.0, inertia=(0.3, 0.4, 0.5), position=(1.0, 0.0, 0.0)),),
    joint=(Revolute(name="A", bodies=("ground", "b"), anchor=O, axis=Z),),
)


def samples(*times: float, value: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Node coordinates value + t, rates 1, second rates 0, and a force equal to t."""
    t = np.array(times, dtype=float)
    values = np.zeros((3, len(t), 1, 7))
    values[0] += (value + t)[:, None, None]
    values[1] += 1.0
    return t, values, t[:, None].copy()


# --- runs from sample to sample ---------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("times", "begin", "wanted"),
    [
        ((0.1, 0.2, 0.3), 0.0, [(0.0, 0.3, 3)]),
        ((0.0, 0.1, 0.2), 0.0, [(0.0, 0.2, 2)]),
        ((0.1, 0.2, 0.5, 0.8), 0.0, [(0.0, 0.2, 2), (0.2, 0.8, 2)]),
        ((0.1, 0.3, 0.4), 0.1, [(0.1, 0.3, 1), (0.3, 0.4, 1)]),
        ((1.0,), 0.5, [(0.5, 1.0, 1)]),
        ((1.0,), 1.0, []),
        ((0.25, 0.5 + 4e-13, 0.75), 0.0, [(0.0, 0.75, 3)]),
        ((0.25, 0.5 + 2e-12, 0.75), 0.0, [(0.0, 0.25, 1), (0.25, 0.5, 1), (0.5, 0.75, 1)]),
    ],
)
def test_stretches_of_equally_spaced_samples(times, begin, wanted):
    """Times nearer than 1e-12 of the end time count as equal."""
    found = list(dynamic.stretches(np.array(times), begin))
    assert [(count, pytest.approx(end)) for _, end, count in found] == [(c, e) for _, e, c in wanted]
    assert [start for start, *_ in found] == pytest.approx([start for start, *_ in wanted])


@pytest.mark.parametrize(
    ("interval", "step", "count"), [(1.0, 0.25, 4), (1.0, 0.3, 4), (0.1, 1.0, 1), (0.3, 0.1, 3)]
)
def test_steps_that_fill_an_interval(interval, step, count):
    assert dynamic.step_count(interval, step) == count
    assert extrapolation._even_steps(step, 1, interval) == 2 * math.ceil(interval / (2 * step) - 1e-9)
    assert extrapolation._even_steps(step, 4, interval) == 4 * extrapolation._even_steps(step, 1, interval)


def test_a_stretch_of_the_solver():
    nothing = SimpleNamespace
    settings = nothing(timeIntegration=nothing(), solution=nothing(sensors=nothing(), file=nothing()))
    dynamic._cover(settings, 0.5, 1.5, 4, 3)
    time = settings.timeIntegration
    assert (time.startTime, time.endTime, time.numberOfSteps) == (0.5, 1.5, 12)
    assert settings.solution.sensors.writePeriod == 0.25 and settings.solution.file.write is False


def system(**parts: Any) -> Any:
    made = {
        "it": SimpleNamespace(
            currentTime=0.75,
            currentStepSize=0.25,
            currentStepIndex=6,
            newtonJacobiCount=3,
            newtonStepsCount=9,
        ),
        "output": SimpleNamespace(finishedSuccessfully=True),
        "conv": SimpleNamespace(
            linearSolverFailed=False, massMatrixNotInvertible=False, newtonConverged=True, residual=0.5
        ),
        "GetErrorString": lambda: "it failed",
        **parts,
    }
    return SimpleNamespace(mbs=SimpleNamespace(sys={"dynamicSolver": SimpleNamespace(**made)}))


def test_how_a_run_of_the_solver_ended():
    assert dynamic._accepted(system()) == 0.75
    assert dynamic._accepted(system(output=SimpleNamespace(finishedSuccessfully=False))) == 0.5
    assert dynamic._counts(system()).tolist() == [5, 3, 9]
    text = "[Python file a.py, line 3]\n  matrix\n  not factorized"
    assert dynamic.said(ValueError(text)) == "matrix not factorized"
    conv = system().mbs.sys["dynamicSolver"].conv.__dict__
    for failure, changed, outcome, message in (
        (text, {}, Outcome.SINGULAR_MATRIX, "singular system matrix at t = 0.75 s: matrix not factorized"),
        (
            "x",
            {"linearSolverFailed": True},
            Outcome.SINGULAR_MATRIX,
            "singular system matrix at t = 0.75 s: x",
        ),
        (
            "x",
            {"massMatrixNotInvertible": True},
            Outcome.SINGULAR_MATRIX,
            "singular system matrix at t = 0.75 s: x",
        ),
        (
            "x",
            {"newtonConverged": False},
            Outcome.NOT_CONVERGED,
            "Newton's method stopped at t = 0.75 s with residual 0.5",
        ),
        ("x", {}, Outcome.STEP_FAILED, "it failed at t = 0.75 s"),
    ):
        found = dynamic._failure(system(conv=SimpleNamespace(**{**conv, **changed})), ValueError(failure))
        assert found == Ending(0.75, outcome, message)


def test_a_motion_up_to_its_first_infinite_sample():
    times, values, forces = samples(0.0, 0.5, 1.0)
    whole = Motion(times, values, forces, Cost(), 1.0)
    assert dynamic.finite(whole) is whole
    values[1, 1, 0, 3] = np.inf
    cut = dynamic.finite(whole)
    assert (
        cut.times.tolist() == [0.0] and cut.coordinates.shape == (3, 1, 1, 7) and cut.forces.shape == (1, 1)
    )
    assert (cut.outcome, cut.t_end) == (Outcome.NOT_FINITE, 0.0)
    assert cut.message == "the state at t = 0.5 s is not finite"
    values[0, 0, 0, 0] = np.nan
    assert dynamic.finite(Motion(times, values, None, Cost(), 1.0)).t_end == 0.0


def test_samples_of_several_stretches_are_joined():
    """Each stretch repeats its start; a record beside the wanted time is moved with its rate."""
    first, second = samples(0.0, 0.5, 1.0), samples(1.0, 1.5)
    times, values, forces = dynamic._join(np.array([0.0, 0.5, 1.0, 1.5]), [first, second], True)
    assert times.tolist() == [0.0, 0.5, 1.0, 1.5] and values[0, :, 0, 0].tolist() == [0.0, 0.5, 1.0, 1.5]
    assert forces[:, 0].tolist() == [0.0, 0.5, 1.0, 1.5]
    later, values, _ = dynamic._join(np.array([0.5, 1.0]), [first], True)
    assert later.tolist() == [0.5, 1.0] and values[0, :, 0, 0].tolist() == [0.5, 1.0], (
        "the start is not asked"
    )
    moved = dynamic._join(np.array([0.0, 0.6, 1.0]), [first], True)[1]
    assert moved[0, :, 0, 0] == pytest.approx([0.0, 0.6, 1.0])
    assert len(dynamic._join(np.array([0.0, 0.5, 1.0, 1.5]), [first], False)[0]) == 3, "the run ended early"
    for wanted, complete in (((0.0, 0.5, 1.0, 1.5), True), ((0.0, 0.8, 1.0), True)):
        with pytest.raises(RuntimeError, match="Exudyn recorded samples at"):
            dynamic._join(np.array(wanted), [first], complete)


def test_samples_move_with_rates_and_second_rates():
    values = np.array([1.0, 2.0, 4.0])[:, None, None, None] * np.ones((3, 2, 1, 7))
    found = dynamic._moved(values, np.array([0.0, 0.5]))
    assert found[:, 0, 0, 0].tolist() == [1.0, 2.0, 4.0] and found[:, 1, 0, 0].tolist() == [2.5, 4.0, 4.0]


# --- extrapolation to h = 0 -------------------------------------------------------------------------------
def test_the_limit_of_three_runs():
    """3 + 5 h² - 7 h⁴ with steps h/4, h/2 and h tends to 3."""
    results = [3 + 5 * h**2 - 7 * h**4 for h in (0.1, 0.2, 0.4)]
    assert extrapolation._limit([np.array([r]) for r in results])[0] == pytest.approx(3.0, abs=1e-14)
    assert list(extrapolation.RICHARDSON) == [4, 2, 1] and sum(
        extrapolation.RICHARDSON.values()
    ) == pytest.approx(1)


def test_nodes_next_to_samples_are_moved_to_them():
    """Nearer than 0.05 of the spacing of 1 s."""
    times = np.array([0.0, 1.049, 2.051, 3.0])
    found = extrapolation._onto(times, np.array([1.0, 2.0, 2.5]), 1.0)
    assert found.tolist() == [1.049, 2.0, 2.5]


def test_samples_at_some_times():
    times, values, forces = extrapolation._at(samples(0.0, 0.5, 1.0), np.array([0.5, 0.75, 1.0]))
    assert (
        times.tolist() == [0.5, 1.0] and values.shape == (3, 2, 1, 7) and forces[:, 0].tolist() == [0.5, 1.0]
    )


class FakeSolver:
    """A solver whose motion is exact, up to an error h² of its steps, and that stops at times."""

    def __init__(self, divisor: int, stops: Any) -> None:
        self.divisor, self.stops, self.states, self.now = divisor, stops, [], 0.0

    def put(self, state: State) -> None:
        self.states.append(state)
        assert len(self.states) < 9, "these runs never end"
        self.now = state.t

    def state(self) -> State:
        return State(self.now, np.zeros(7), np.ones(7), np.array([5.0]))

    def run(self, to: np.ndarray, steps: Any, configure: Any) -> Any:
        late = [t for t in self.stops if self.now < t <= to[-1]]
        h = 1.0 / self.divisor
        if late:
            reached = to[to < late[0]]
            return samples(*reached), Ending(late[0], Outcome.STEP_FAILED, "stuck")
        return samples(*to, value=h**2), None

    def cost(self) -> Cost:
        return Cost(1.0, 0.5, steps=2 * self.divisor)


def runs(*stops: float, step: float = 0.01) -> Any:
    made = extrapolation._ExtrapolatedRuns.__new__(extrapolation._ExtrapolatedRuns)
    made.scene, made.step, made.configure, made.pieces = SCENE, step, None, []
    made.solvers = [FakeSolver(divisor, stops if divisor == 4 else ()) for divisor in (4, 2, 1)]
    made.state = State(0.0, np.zeros(7), np.zeros(7), np.zeros(0))
    return made


def test_runs_that_reach_all_samples():
    made = runs()
    found = made.through(np.array([0.5, 1.0]))
    assert found.outcome is Outcome.COMPLETED and found.times.tolist() == [0.5, 1.0] and found.t_end == 1.0
    assert found.coordinates[0, :, 0, 0] == pytest.approx([0.5, 1.0], abs=1e-14), "the errors h² are removed"
    assert found.cost == Cost(3.0, 1.5, steps=14) and found.forces[:, 0] == pytest.approx([0.5, 1.0])
    assert made.state.t == 1.0 and made.state.coordinates == pytest.approx(np.ones(7))
    assert made.state.rates == pytest.approx(np.ones(7)) and made.state.data.tolist() == [5.0]


def test_a_window_around_a_failure_is_crossed(monkeypatch):
    """The finest run stops at 0.9 s: nodes at distances of 0.06 s end 0.02 s before it, and the runs go on
    0.04 s later."""
    made, asked = runs(0.9), []

    def extrapolated(scene: Scene, nodes: Any, times: np.ndarray) -> Any:
        asked.append((nodes[0], times))
        made.solvers[0].stops = ()
        return samples(*times)

    monkeypatch.setattr(extrapolation, "extrapolated_states", extrapolated)
    found = made.through(np.array([0.2, 0.88 + 0.01, 1.0]))
    [(nodes, times)] = asked
    assert (
        len(nodes) == 12
        and nodes[-1] == pytest.approx(0.88)
        and np.diff(nodes) == pytest.approx(np.full(11, 0.06))
    )
    assert times == pytest.approx([0.89, 0.92]), "samples in the window, and its end"
    assert found.times == pytest.approx([0.2, 0.89, 1.0]) and found.outcome is Outcome.COMPLETED
    assert [state.t for state in made.solvers[0].states] == pytest.approx([0.0, 0.0, 0.92])


def test_an_early_failure_is_no_singular_position():
    """Twelve nodes need at least a step between each: 0.02 + 12 · 0.01 s."""
    found = runs(0.139).through(np.array([0.1, 1.0]))
    assert (found.outcome, found.message, found.t_end) == (Outcome.STEP_FAILED, "stuck", 0.0)
    assert runs(0.15).approach(np.array([1.0]), Ending(0.139, Outcome.STEP_FAILED, "")) is None
    nodes = runs().approach(np.array([1.0]), Ending(0.141, Outcome.STEP_FAILED, ""))
    assert nodes[0][-1] == pytest.approx(0.121) and np.diff(nodes[0]) == pytest.approx(
        np.full(11, 0.121 / 12)
    )


def test_a_failure_on_the_way_to_a_window_is_the_first_one():
    made = runs(0.7)
    nodes = made.approach(np.array([1.0]), Ending(0.9, Outcome.STEP_FAILED, ""))
    assert nodes[0][-1] == pytest.approx(0.68)


# --- crossing ---------------------------------------------------------------------------------------------
def test_barycentric_weights():
    """1 / ((0 - 1)(0 - 3)), 1 / ((1 - 0)(1 - 3)), 1 / ((3 - 0)(3 - 1))."""
    assert singular_crossing._weights(np.array([0.0, 1.0, 3.0])) == pytest.approx([1 / 3, -1 / 2, 1 / 6])


def coordinates(angle: float, shift: Any = O) -> tuple[np.ndarray, np.ndarray]:
    """Node coordinates (1, 7) of the body turned about the hinge, and their rates at 2 rad/s."""
    q = rotations.from_vector(np.array([0.0, 0.0, angle]))
    place = np.array([math.cos(angle) - 1.0, math.sin(angle), 0.0]) + shift
    spin = rotations.multiply(np.array([0.0, 0.0, 0.0, 2.0]), q) / 2
    rate = np.array([-2 * math.sin(angle), 2 * math.cos(angle), 0.0])
    return np.append(place, q - singular_crossing.UPRIGHT)[None], np.append(rate, spin)[None]


def test_a_state_on_the_joints_stays():
    q, v = coordinates(0.7)
    found = singular_crossing.projected(SCENE, 0.0, q, v)
    assert found[0] == pytest.approx(q, abs=1e-15) and found[1] == pytest.approx(v, abs=1e-14)


def test_a_state_is_projected_onto_the_joints():
    """A body that is 1e-3 m off along the axis, and moves along it, returns to the plane."""
    q, v = coordinates(0.7, (0.0, 0.0, 1e-3))
    v[0, 2] = 0.5
    position, rates = singular_crossing.projected(SCENE, 0.0, q, v)
    exact = coordinates(0.7)
    assert position == pytest.approx(exact[0], abs=1e-14) and rates == pytest.approx(exact[1], abs=1e-14)


def test_a_projection_has_the_least_kinetic_energy():
    """A row asks for 0.1 = v - ω: 2 kg and 0.5 kg m² share it by 1/2 and 1/0.5."""
    rows = np.array([[0.0, 1.0, 0.0, 0.0, 0.0, -1.0]])
    found = singular_crossing._least(SCENE, np.array([[1.0, 0.0, 0.0, 0.0]]), rows, np.array([0.1]))
    assert found[0] == pytest.approx([0.0, 0.1 * 0.5 / 2.5, 0.0, 0.0, 0.0, -0.1 * 2.0 / 2.5])


def test_a_driver_moves_the_projected_state():
    driven = SCENE.with_(driver=(Driver(joint="A", polynomial=(0.0, 2.0)),))
    q, v = coordinates(0.7)
    position, rates = singular_crossing.projected(driven, 0.4, q, v)
    exact = coordinates(0.8)
    assert position == pytest.approx(exact[0], abs=1e-14) and rates == pytest.approx(exact[1], abs=1e-13)


def test_states_behind_the_nodes_are_on_their_polynomial():
    """The body turns at 2 rad/s; forces are a polynomial of second order."""
    t = np.linspace(0.0, 0.22, 12)
    pairs = [coordinates(2 * x) for x in t]
    values = np.stack(
        [np.stack([p[0] for p in pairs]), np.stack([p[1] for p in pairs]), np.zeros((12, 1, 7))]
    )
    forces = (1 + t + t**2)[:, None]
    times, found, pushed = singular_crossing.extrapolated_states(
        SCENE, (t, values, forces), np.array([0.24, 0.26])
    )
    assert times.tolist() == [0.24, 0.26] and pushed[:, 0] == pytest.approx(1 + times + times**2, rel=1e-9)
    for k, x in enumerate(times):
        exact = coordinates(2 * x)
        assert found[0, k] == pytest.approx(exact[0], abs=1e-9)
        assert found[1, k] == pytest.approx(exact[1], abs=1e-7)
