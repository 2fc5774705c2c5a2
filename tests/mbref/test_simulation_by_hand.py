"""Ends of runs / limits, comparisons, messages and remedies of runs on paper."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.equations.initial_state import Start
from mbref.kernels.layout import NOT_CONVERGED, NOT_FINITE, SINGULAR, SINGULAR_AHEAD
from mbref.method import Method
from mbref.scene import Body, Driver, Revolute, Scene
from mbref.simulation import comparison, dead_position, outcome, remedies, trial
from mbref.simulation.trial import Trial
from mbref.stepping import control as control_module
from mbref.stepping.limits import Limits
from mbref.stepping.loop import (
    CREEPING,
    DONE,
    LEFT_MOTION,
    PAUSED,
    STEP_TOO_SMALL,
    TOO_MANY_STEPS,
    UNDECIDED,
    VIOLATED,
)
from mbref.stepping.pace import Pace
from mbref.stepping.ranks import Ranks
from mbref.trajectory import Outcome

TIMES = np.array([0.0, 1.0, 2.0])
SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0)),),
    joint=(Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),),
)
DRIVEN = SCENE.with_(driver=(Driver(joint="A", polynomial=(0.0, 1.0)),))
TAYLOR, FREE, HELD, FIXED = map(
    Method.parse, ("taylor", "mpi-svd+none", "mpi-svd+projection", "mpi-svd+none/rk4")
)


def run(method: Method = FREE, scene: Scene = SCENE, time: float = 0.5, **parts: Any) -> Any:
    """A run of two moving loops at a time, with 3 samples."""
    model = SimpleNamespace(closed_loops=2, nb=1, m=5, length=2.0, row_joint=("A",) * 5, mass=np.ones(6))
    clock = SimpleNamespace(time=time, sample=3, violated_row=4)
    system = SimpleNamespace(
        counts=SimpleNamespace(crossings=0, steps=0), settings=SimpleNamespace(nearly_dependent=0)
    )
    memory = SimpleNamespace(
        loop=SimpleNamespace(clock=clock, samples=SimpleNamespace(coordinates=np.zeros((3, 7)))),
        equations=SimpleNamespace(system=system, rows=SimpleNamespace(phi=np.array([0, 0, 0, 0, -0.25]))),
        control=SimpleNamespace(rtol=1e-9, violation=0.003, smallest_step=1e-12),
        watch=SimpleNamespace(nearest=1.0),
        state=SimpleNamespace(coordinates=np.zeros(7)),
    )
    made = {
        "method": method,
        "scene": scene,
        "model": model,
        "memory": memory,
        "limits": Limits(),
        "times": TIMES,
    }
    return SimpleNamespace(**{**made, "ranks": Ranks(5, 1.0, 0.0), "making": 0.0, **parts})


# --- limits -----------------------------------------------------------------------------------------------
def test_limits_of_a_run():
    def found(name: str, times: Any = TIMES, has_angles: bool = False, **given: Any) -> Any:
        model = SimpleNamespace(has_angles=has_angles, length=2.5, closed_loops=3)
        return control_module.control_of(model, Method.parse(name), np.array(times), Limits(**given))

    usual = found("mpi-svd+none")
    assert (usual.order, usual.fixed_step, usual.smallest_step, usual.largest_step) == (8, 0.0, 2e-12, 2.0)
    assert (usual.rtol, usual.atol, usual.most_steps, usual.closed_loops) == (1e-9, 1e-9, 5_000_000, 3)
    assert usual.violation == pytest.approx(3e-3 * 2.5) and usual.steps_per_call == 500
    assert found("mpi-svd+none", has_angles=True).largest_turn == 1.0
    given = found("mpi-svd+none", atol=1e-3, smallest_step=0.1, largest_step=0.5, largest_turn=0.2, rtol=1e-5)
    assert (given.atol, given.smallest_step, given.largest_step, given.largest_turn) == (1e-3, 0.1, 0.5, 0.2)
    assert found("mpi-svd+none", first_step=0.25, forced_step=0.125, most_steps=9)[-1] == 3
    step = found("mpi-svd+none/rk4")
    assert (step.order, step.fixed_step) == (4, 1e-4)
    assert found("mpi-svd+none/rk4", largest_step=1e-5).fixed_step == 1e-5
    assert found("mpi-svd+none", times=[0.0]).largest_step == 1.0, "a run of one sample"
    assert control_module.largest_violation(Limits(violation=0.1), np.array([0.5, 3.0])) == pytest.approx(
        [0.1, 0.3]
    )


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("rtol", (1e-16, 0.99), (0.9e-16, 0.995, 0.0, "1", True, math.nan)),
        ("rank_tolerance", (0.0, 1e-40, 0.99), (-1e-9, 0.995)),
        ("violation", (1e-40, 1e40), (0.0, 2e40)),
        ("most_steps", (1, 2**62), (0, 2**62 + 1, 1.5, True)),
        ("branches", ({1: 2}, [(3, 1)], ()), ({1: 0}, {0: 2}, {-3: 1}, [(1,)], 5, {1: 1.5})),
        ("compared", (True, False), (1, None)),
        ("code", ("auto", "generic", "generated"), ("fast",)),
        ("atol", (None, 1e-3), (0.0,)),
    ],
)
def test_options_of_a_run(name, good, bad):
    for value in good:
        Limits(**{name: value})
    for value in bad:
        with pytest.raises(ValueError, match=f"{name}: must be"):
            Limits(**{name: value})
    assert Limits(branches={2: 3, 4: 1}).branches == ((2, 3), (4, 1))


# --- pace -------------------------------------------------------------------------------------------------
def test_a_run_whose_steps_are_too_short():
    """20 000 steps to 0.01 s of 2 s need 3.98e6 in all: more than 100 times 39 000 are out of reach."""
    made = run()
    clock, counts = made.memory.loop.clock, made.memory.equations.system.counts
    for most, status in ((39_799, CREEPING), (39_801, PAUSED)):
        made.limits = Limits(most_steps=most)
        clock.time, counts.steps = 0.01, 20_000
        assert Pace(made).judge(PAUSED) == status
    pace = Pace(made)
    counts.steps = 19_999
    assert pace.judge(PAUSED) == PAUSED and pace.judge(DONE) == DONE
    counts.steps = 20_000
    assert pace.judge(PAUSED) == PAUSED
    clock.time, counts.steps = 0.0101, 40_000
    assert pace.judge(PAUSED) == CREEPING, "the pace is of the steps since the last check"


# --- comparison with the default method -------------------------------------------------------------------
@pytest.mark.parametrize(
    ("method", "parts", "may"),
    [
        (FREE, {}, True),
        (HELD, {}, False),
        (HELD, {"limits": Limits(rank_tolerance=1.1e-10)}, True),
        (HELD, {"nearest": 0.09}, True),
        (TAYLOR, {"nearest": 0.09}, False),
        (FREE, {"closed_loops": 0}, False),
    ],
)
def test_runs_that_may_leave_their_motion(method, parts, may):
    made = run(method, limits=parts.get("limits", Limits()))
    made.memory.watch.nearest = parts.get("nearest", 1.0)
    made.model.closed_loops = parts.get("closed_loops", 2)
    assert comparison.may_leave(made) is may


def compared(
    monkeypatch: pytest.MonkeyPatch, off: Any, status: int = DONE, ended: int = DONE, **parts: Any
) -> Any:
    """The status and the clock of a run whose samples are so far from the default method's."""
    made, asked = run(**{"method": FREE, **parts}), []
    clock = SimpleNamespace(sample=len(off), time=1.25)
    other = SimpleNamespace(
        stepper=SimpleNamespace(advance=lambda progress: (status, None)),
        memory=SimpleNamespace(loop=SimpleNamespace(clock=clock)),
        release=lambda: asked.append("released"),
    )
    monkeypatch.setattr(comparison, "start_run", lambda *given: asked.append(given) or other)
    monkeypatch.setattr(comparison, "_distances", lambda one, two, count: np.array(off[:count], dtype=float))
    return comparison.compare_with_default(made, ended), made.memory.loop.clock, asked


def test_a_run_that_left_its_motion_ends_at_its_last_right_sample(monkeypatch):
    """Distances of 1e3 rtol, at least 1e-6, are allowed."""
    status, clock, asked = compared(monkeypatch, [0.0, 2e-6, 0.5])
    assert (status, clock.sample, clock.time) == (LEFT_MOTION, 1, 1.0) and asked[-1] == "released"
    scene, method, times, limits = asked[0]
    assert scene is SCENE and method == TAYLOR and times is TIMES
    assert (limits.rtol, limits.most_steps, limits.code) == (1e-10, 100_000, "generic")
    assert compared(monkeypatch, [0.0, 0.9e-6, 0.0])[0] == DONE
    assert compared(monkeypatch, [0.0, 0.09, 0.09], method=FIXED)[0] == DONE, "fixed steps: 0.1"
    assert compared(monkeypatch, [0.0, 0.11, 0.0], method=FIXED)[0] == LEFT_MOTION
    assert compared(monkeypatch, [0.0, 0.5, 0.5], limits=Limits(compared=False))[0] == DONE
    assert compared(monkeypatch, [0.0, 0.5, 0.5], method=HELD)[0] == DONE


@pytest.mark.parametrize("end", [UNDECIDED, SINGULAR_AHEAD])
def test_a_run_beyond_the_end_of_the_default_method_is_undecided(monkeypatch, end):
    status, clock, _ = compared(monkeypatch, [0.0, 0.0], end)
    assert (status, clock.time) == (UNDECIDED, 1.25)
    status, clock, _ = compared(monkeypatch, [0.0, 0.0], end, STEP_TOO_SMALL)
    assert (status, clock.time) == (STEP_TOO_SMALL, 0.5)
    assert compared(monkeypatch, [0.0, 0.0], NOT_FINITE)[0] == DONE


def test_the_allowed_distance_follows_the_tolerance():
    made = run()
    made.memory.control.rtol = 1e-7
    assert comparison._allowed(made) == pytest.approx(1e-4)


# --- dead positions and trials ----------------------------------------------------------------------------
def dead(monkeypatch: pytest.MonkeyPatch, slope: float, found: Trial | None = None, **parts: Any) -> bool:
    """A driver at 1 rad/s whose row has a slope: the body turns at 1 / slope, in a mechanism of 0.5 m."""
    made = run(scene=parts.get("scene", DRIVEN), time=1.0)
    jacobian = np.zeros((1, 6))
    jacobian[0, 5] = slope
    terms = SimpleNamespace(jacobian=jacobian, nu=np.array([1.0]))
    made.model = SimpleNamespace(m=parts.get("m", 1), length=0.5, nb=1, terms=lambda t, q: terms)
    made.memory.state.coordinates = np.full(7, parts.get("q", 0.0))
    monkeypatch.setattr(dead_position, "trial_of", lambda given: found)
    return dead_position.is_at_dead_position(made)


def test_velocities_at_a_dead_position(monkeypatch):
    """More than 100 times the rate of the driver, which is 2 in units of 0.5 m."""
    assert dead(monkeypatch, 1 / 201) and not dead(monkeypatch, 1 / 199)
    assert not dead(monkeypatch, 1 / 201, scene=SCENE) and not dead(monkeypatch, 1 / 201, q=math.nan)
    assert dead(monkeypatch, 1 / 201, m=400) and not dead(monkeypatch, 1 / 201, m=401)
    assert not dead(monkeypatch, 1 / 201, Trial(True, 2.0)), "taylor completes the motion"
    assert dead(monkeypatch, 1 / 201, Trial(False, 1.009)) and not dead(
        monkeypatch, 1 / 201, Trial(False, 1.011)
    )


def test_which_runs_have_a_trial(monkeypatch):
    ended = SimpleNamespace(
        stepper=SimpleNamespace(advance=lambda progress: (DONE, None)),
        memory=SimpleNamespace(loop=SimpleNamespace(clock=SimpleNamespace(time=1.75))),
        release=lambda: None,
    )
    asked: list[Any] = []
    monkeypatch.setattr(trial, "start_run", lambda *given: asked.append(given) or ended)
    kernels = [SimpleNamespace(is_kept=True), SimpleNamespace(is_kept=True)]
    monkeypatch.setattr(trial, "KERNELS_OF_SERIES", kernels)
    assert trial._made(run()) == Trial(True, 1.75)
    [(scene, method, times, limits)] = asked
    assert scene is SCENE and method == TAYLOR and times is TIMES
    assert (limits.code, limits.most_steps) == ("generic", 2000)
    assert trial._made(run(TAYLOR)) is None
    for bodies, has_trial in ((100, True), (101, False)):
        large = SimpleNamespace(body=[None] * bodies)
        assert (trial._made(run(scene=large)) is not None) is has_trial
    kernels[1].is_kept = False
    assert trial._made(run()) is None, "a kernel of taylor is not compiled"


# --- messages ---------------------------------------------------------------------------------------------
def test_causes_of_an_early_end():
    for status, words in (
        (VIOLATED, "joint 'A' is violated by 0.25, more than 0.003, at t = 0.5 s"),
        (TOO_MANY_STEPS, "5000000 steps were taken without reaching the end, at t = 0.5 s"),
        (CREEPING, "steps at t = 0.5 s are too short to reach the end"),
        (STEP_TOO_SMALL, "the error estimate requires a step below 1e-12 s at t = 0.5 s"),
        (
            LEFT_MOTION,
            "the run continued along another motion than the exact one, as a run by another method shows, "
            "by t = 0.5 s",
        ),
        (SINGULAR, "the leading matrix is singular at t = 0.5 s (mpi-svd)"),
        (NOT_FINITE, "the state is not finite at t = 0.5 s (mpi-svd)"),
    ):
        assert outcome._cause(run(), status) == words
    assert outcome._cause(run(TAYLOR), SINGULAR).endswith("(taylor)")


@pytest.fixture
def quiet(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Answers of the parts that a message asks."""
    answers = {"dead": False, "rest": False, "no branch": False, "advice": "", "remedy": "", "leaving": None}
    monkeypatch.setattr(outcome, "is_at_dead_position", lambda made: answers["dead"])
    monkeypatch.setattr(outcome, "begins_at_rest", lambda made: answers["rest"])
    monkeypatch.setattr(outcome, "fits_no_branch", lambda made: answers["no branch"])
    monkeypatch.setattr(outcome, "advice", lambda made: answers["advice"])
    monkeypatch.setattr(outcome, "remedy", lambda made, status: answers["remedy"])
    monkeypatch.setattr(outcome, "leaving_acceleration", lambda made: answers["leaving"])
    monkeypatch.setattr(outcome, "tangents", lambda model, q: [0, 1, 2])
    return answers


def test_the_message_of_a_failed_run(quiet):
    early = "steps at t = 0.5 s are too short to reach the end"
    assert outcome._message(run(), CREEPING) == early
    quiet["remedy"] = "use x"
    assert outcome._message(run(), CREEPING) == f"{early}; use x"
    quiet["advice"] = "12 digits"
    assert outcome._message(run(), CREEPING) == f"{early}; 12 digits", "rounded numbers come first"
    assert outcome._message(run(), TOO_MANY_STEPS).endswith("; use x"), "they do not cause too many steps"
    rounded = run(ranks=Ranks(5, 1.0, 2e-13))
    assert outcome._message(rounded, TOO_MANY_STEPS).split("; ")[1:] == [
        "rows with a singular value of 2.0e-13 at the start count as redundant",
        "use x",
    ]
    quiet["dead"] = True
    assert outcome._message(run(), CREEPING).startswith("the drivers come to a dead position at t = 0.5 s")


def test_the_message_of_a_run_that_cannot_begin(quiet):
    quiet["rest"] = True
    assert outcome._message(run(time=0.0), UNDECIDED) == outcome.REST_POSITION
    assert outcome._message(run(time=0.1), UNDECIDED) != outcome.REST_POSITION
    quiet["rest"], quiet["no branch"] = False, True
    assert outcome._message(run(time=0.0), UNDECIDED) == outcome.NO_BRANCH
    assert outcome._message(run(time=0.1), UNDECIDED) != outcome.NO_BRANCH
    assert outcome._message(run(time=0.0), CREEPING) != outcome.NO_BRANCH


def test_the_remedy_for_nearly_dependent_rows(quiet):
    quiet["remedy"] = "use x"
    made = run(time=0.0, ranks=Ranks(5, 3e-7, 0.0))
    made.memory.equations.system.settings.nearly_dependent = 1
    assert "(singular value 3.0e-07 of unit rows)" in outcome._remedy(made, CREEPING)
    assert "begin at that position" in outcome._remedy(made, CREEPING)
    made.scene = DRIVEN
    assert "begin at that position" not in outcome._remedy(made, CREEPING)
    made.memory.loop.clock.time = 0.1
    assert outcome._remedy(made, CREEPING) == "use x"


def started(**parts: Any) -> Start:
    made = {name: None for name in Start.__dataclass_fields__}
    return Start(
        **{**made, "position_violation": 0.0, "velocity_violation": 0.0, "follows_branch": False, **parts}
    )


def test_the_message_of_a_complete_run(quiet):
    good = Ranks(5, 1.0, 0.0)
    assert outcome.report_of(started(), good, 0) == ""
    assert outcome.report_of(started(), good, 2) == "singular positions passed: 2"
    both = started(position_violation=2e-5, velocity_violation=1.1e-9)
    words = "initial positions were off the constraints by 2.00e-05 and velocities by 1.10e-09; corrected"
    assert outcome.report_of(both, good, 0) == words
    assert outcome.report_of(started(position_violation=0.9e-9), good, 0) == ""
    assert outcome.report_of(started(), Ranks(5, 1.0, 1.1e-13), 0).startswith(
        "rows with a singular value of 1.1e-13"
    )
    assert outcome.report_of(started(), Ranks(5, 1.0, 0.9e-13), 0) == ""
    nearly = outcome.report_of(started(), Ranks(5, 0.9 * outcome.NEARLY, 0.0), 0)
    assert nearly.startswith("constraint rows are nearly dependent at the start")
    made = run(start=started(q=None))
    assert outcome._message(made, DONE) == ""
    quiet["rest"], quiet["leaving"] = True, np.ones(6)
    assert outcome._message(made, DONE) == outcome.LEAVES_REST.format(3)
    quiet["leaving"] = None
    assert outcome._message(made, DONE) == ""


@pytest.mark.parametrize(
    ("joints", "found", "words"),
    [
        (
            (),
            None,
            "the motion reaches a singular position at t = 0.75 s; projection does not cross it, taylor does",
        ),
        (
            ("A", "B"),
            Trial(False, 0.7),
            "the motion reaches a singular position at t = 0.75 s "
            "(the constraint rows of 'A', 'B' lose rank); projection does not cross it",
        ),
        (
            (),
            Trial(False, 0.8),
            "the motion reaches a singular position at t = 0.75 s; projection does not cross it, taylor does",
        ),
    ],
)
def test_the_message_at_a_singular_position(monkeypatch, joints, found, words):
    monkeypatch.setattr(outcome, "trial_of", lambda made: found)
    assert outcome._met(run(HELD), SimpleNamespace(time=0.75, joints=joints)) == words


def test_costs_and_outcomes():
    cost = outcome.cost_of(0.5, 0.25, (1, 2, 3, 4, 5, 6))
    assert (cost.seconds, cost.build_seconds, cost.steps, cost.rejected, cost.rhs) == (0.5, 0.25, 1, 2, 3)
    assert (cost.factorisations, cost.newton) == (4, 5)
    assert outcome.OUTCOMES[SINGULAR_AHEAD] is Outcome.SINGULAR_POSITION
    assert outcome.OUTCOMES[CREEPING] is outcome.OUTCOMES[TOO_MANY_STEPS] is Outcome.STEP_FAILED


# --- remedies ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("method", "status", "found", "words"),
    [
        (FREE, VIOLATED, None, "+projection corrects violations after every step"),
        (FREE, LEFT_MOTION, None, "taylor crosses singular positions"),
        (FREE, LEFT_MOTION, Trial(True, 2.0), "taylor completes this motion"),
        (FREE, LEFT_MOTION, Trial(False, 1.0), ""),
        (
            TAYLOR,
            STEP_TOO_SMALL,
            None,
            "mbref diagnose prints the distance of the motion from singular positions",
        ),
        (FREE, CREEPING, Trial(True, 2.0), "taylor completes this motion"),
        (FREE, NOT_CONVERGED, Trial(True, 2.0), "taylor completes this motion"),
        (Method.parse("alf+none"), NOT_CONVERGED, None, "mpi-svd and mpi-qr solve without iteration"),
        (Method.parse("alf+none"), NOT_CONVERGED, Trial(True, 2.0), "taylor completes this motion"),
        (FREE, NOT_FINITE, Trial(True, 2.0), ""),
    ],
)
def test_remedies_by_status(monkeypatch, method, status, found, words):
    monkeypatch.setattr(remedies, "trial_of", lambda made: found)
    assert remedies.remedy(run(method), status) == words


@pytest.mark.parametrize(
    ("rtol", "time", "passing", "words"),
    [
        (1e-9, 0.5, {"rtol", "branches"}, "the motion goes on with rtol 1e-13 or --branch 3=2"),
        (1e-9, 0.5, {"branches"}, "the motion goes on with --branch 3=2"),
        (1e-13, 0.5, {"rtol"}, "--branch 3=2 does not let the motion go on: end it before this time"),
        (
            1e-9,
            0.5,
            set(),
            "neither rtol 1e-13 nor --branch 3=2 lets the motion go on: end it before this time",
        ),
        (1e-9, 0.0, set(), "neither rtol 1e-13 nor --branch 3=2 lets the motion go on"),
        (1e-9, 0.5, None, "a smaller rtol or another branch may let the motion go on"),
    ],
)
def test_the_remedy_of_an_undecided_motion_is_tried(monkeypatch, rtol, time, passing, words):
    tried = []

    def passes(made: Any, **changes: Any) -> bool | None:
        tried.append(changes)
        return None if passing is None else bool(passing & set(changes))

    monkeypatch.setattr(remedies, "passes_with", passes)
    made = run(time=time, crossings=[1, 2], limits=Limits(rtol=rtol, branches={1: 2}))
    assert remedies.remedy(made, UNDECIDED) == words
    assert {"branches": {1: 2, 3: 2}} in tried
    assert ({"rtol": 1e-13, "atol": None} in tried) == (rtol > 1e-13)


def test_steps_of_an_open_chain_are_diagnosed(monkeypatch):
    monkeypatch.setattr(remedies, "trial_of", lambda made: Trial(True, 2.0))
    made = run()
    made.model.closed_loops = 0
    assert remedies.remedy(made, TOO_MANY_STEPS).startswith("mbref diagnose prints the distance")
