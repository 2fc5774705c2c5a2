"""A run of IDA on a stand-in for its solver / matrix, scales, choice of rows, steps and reactions by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from crosscheck.engines.sampling import Failed
from crosscheck.engines.sundials import ida
from crosscheck.engines.sundials.equations import Equations, pure
from crosscheck.engines.sundials.ida import Run
from mbref import rotations
from mbref.scene import (
    Body,
    Driver,
    Force,
    Moment,
    Revolute,
    Scene,
    Sine,
    Spherical,
    Spring,
    TorsionSpring,
)
from mbref.trajectory import Outcome

Z, O = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def body(name: str, *place: float, **parts: Any) -> Body:
    return Body(name=name, **{"mass": 2.0, "inertia": (0.3, 0.4, 0.5), "position": place, **parts})


PINS = (
    Revolute(name="A", bodies=("ground", "a"), anchor=(0.1, 0.0, 0.05), axis=(0.0, 0.6, 0.8)),
    Revolute(name="B", bodies=("b", "a"), anchor=(0.9, -0.1, 0.3), axis=(1.0, 0.0, 0.0)),
)
LOADS = (
    Force(body="b", point=(1.5, -0.2, 0.1), force=(4.0, -5.0, 6.0)),
    Moment(body="a", moment=(0.7, 0.8, -0.9)),
    Spring(
        bodies=("a", "b"),
        points=((0.2, 0.3, 0.1), (1.3, 0.4, -0.6)),
        stiffness=20.0,
        damping=3.0,
        natural_length=0.4,
    ),
    TorsionSpring(joint="B", stiffness=5.0, damping=2.0, natural_angle=0.25),
)
ROBOT = Scene(
    name="robot",
    body=(body("a", 0.5, 0.1, -0.2, mass=3.0), body("b", 1.4, -0.3, 0.2)),
    joint=PINS,
    load=LOADS,
    driver=(Driver(joint="A", polynomial=(0.0, 0.7), sine=Sine(amplitude=0.2, frequency=3.0)),),
    gravity=(0.3, -9.0, 1.0),
    duration=0.5,
)


class Solver:
    """A stand-in for IDA that records its arguments; its steps return ``results``."""

    made: ClassVar[list[Solver]] = []
    results: ClassVar[list[Any]] = []

    def __init__(self, residual: Any, **options: Any) -> None:
        self.residual, self.options, self.asked = residual, options, []
        Solver.made.append(self)

    def init_step(self, t: float, y: np.ndarray, yp: np.ndarray) -> None:
        self.start = t, y.copy(), yp.copy()

    def step(self, t: float, method: str = "normal") -> Any:
        self.asked.append((t, method))
        return Solver.results.pop(0)


@pytest.fixture(autouse=True)
def fresh() -> None:
    Solver.made, Solver.results = [], []


def result(t: float, y: np.ndarray, nfev: int = 0, status: int = 0) -> Any:
    return SimpleNamespace(success=status >= 0, status=status, t=t, y=y, nfev=nfev, message="it says so")


def disturbed(run: Run, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return run.y + 0.1 * rng.normal(size=run.y.size), rng.normal(size=run.y.size)


# --- equations --------------------------------------------------------------------------------------------
def test_the_iteration_matrix_is_the_derivative_of_the_residual():
    """∂F/∂y + 7 ∂F/∂y' by differences of the residual in each component."""
    run = Run(Solver, ROBOT, 1e-6)
    (y, yp), t, h = disturbed(run), 0.1, 1e-6
    wanted = np.zeros((y.size, y.size))
    for k in range(y.size):
        move = h * np.eye(y.size)[k]
        by_y = run.equations.residual(t, y + move, yp) - run.equations.residual(t, y - move, yp)
        by_rate = run.equations.residual(t, y, yp + move) - run.equations.residual(t, y, yp - move)
        wanted[:, k] = (by_y + 7.0 * by_rate) / (2 * h)
    found = run.equations.matrix(t, y, yp, 7.0, np.full(run.equations.motion, 1e-7))
    assert found == pytest.approx(wanted, abs=2e-5 * np.abs(wanted).max())


def test_a_run_starts_with_consistent_rates():
    """The residual of the start and its rates is zero; multipliers' integrals are zero at the start."""
    run = Run(Solver, ROBOT, 1e-6)
    t, y, yp = Solver.made[0].start
    assert t == 0.0 and np.abs(run.equations.residual(0.0, y, yp)).max() < 1e-12
    assert not y[run.equations.motion :].any() and not yp[run.equations.at_mu].any()
    assert run.rank == 11 and run.equations.size == len(y) == 26 + 1 + 22
    out = np.zeros(len(y))
    run._residual(0.2, *disturbed(run), out)
    assert out == pytest.approx(run.equations.residual(0.2, *disturbed(run)))


def test_accelerations_obey_rows_and_forces():
    equations = Run(Solver, ROBOT, 1e-6).equations
    s = equations.state(equations.projected(0.0, Solver.made[0].start[1]))
    found, multipliers = equations.accelerations(0.0, s)
    f = s.frames()
    j = equations.constraints.jacobian(0.0, f)[equations.rows]
    acting = equations.forces(f, s.omega, s.angles)
    assert equations.forces.mass @ found - j.T @ multipliers == pytest.approx(acting)
    bias = equations.constraints.levels(0.0, f)[2, equations.rows]
    assert j @ found + bias == pytest.approx(np.zeros(len(j)), abs=1e-12)
    assert pure(np.array([[1.0, 2.0, 3.0]])).tolist() == [[0.0, 1.0, 2.0, 3.0]]


def test_options_of_the_solver():
    run = Run(Solver, ROBOT, 1e-6)
    options = Solver.made[0].options
    assert (options["rtol"], options["max_num_steps"]) == (1e-6, 10**6)
    assert (options["max_step"], options["min_step"]) == (0.5, 0.5e-12)
    scale = options["atol"] / 1e-6
    length, rate = run.length, ida.stated_rate(ROBOT)
    assert rate == 2.0 / 0.4, "damping of the torsion spring over the least middle moment"
    assert scale[:6] == pytest.approx([length] * 6) and scale[6:14] == pytest.approx([1.0] * 8)
    assert scale[14:26] == pytest.approx([*[length * rate] * 3, *[rate] * 3] * 2)
    assert scale[26] == 1.0 and scale[38:] == pytest.approx([100 * length] * 11)
    multipliers = Solver.made[0].start[2][run.equations.at_lambda]
    least = 3.0 * rate**2 * length
    assert scale[27:38] == pytest.approx([max(np.abs(multipliers).max(), least) / rate] * 11)
    assert run._scale(np.array([-1e6, 3.0]))[27] == pytest.approx(1e6 / rate)
    assert run._scale(np.zeros(0))[27] == pytest.approx(least / rate)
    assert run.steps == pytest.approx(1e-7 * scale[:27])


def test_increments_of_the_iteration_matrix(monkeypatch):
    """A ten-millionth of the scale, or of the component if that is larger."""
    run, seen = Run(Solver, ROBOT, 1e-6), []
    monkeypatch.setattr(
        Equations, "matrix", lambda self, t, y, yp, cj, steps: seen.append((cj, steps)) or 5.0
    )
    y = np.zeros(run.y.size)
    y[0], out = -1e3, np.zeros((2, 2))
    run._matrix(0.1, y, y, y, 4.0, out)
    assert seen[0][0] == 4.0 and seen[0][1] == pytest.approx([1e-4, *run.steps[1:]]) and (out == 5.0).all()


# --- choice of rows ---------------------------------------------------------------------------------------
DOOR = Scene(
    name="door",
    body=(body("a", 0.5, 0.0, 0.0),),
    joint=tuple(
        Revolute(name=name, bodies=("ground", "a"), anchor=(0.0, 0.0, z), axis=Z)
        for name, z in (("A", 0.0), ("B", 1.0))
    ),
)


def test_redundant_rows_are_left_out_and_the_number_stays():
    run = Run(Solver, DOOR, 1e-6)
    assert run.rank == len(run.equations.rows) == 5 and len(run.equations.constraints.joint) == 10
    assert sorted(run.equations.rows) == run.equations.rows.tolist()
    assert not run._choose(0.0), "the choice is the best one"
    run.rank = 4
    assert run._choose(0.0) and len(run.equations.rows) == 4, "of the number at the start"
    free = Run(Solver, DOOR.with_(joint=()), 1e-6)
    assert not free._choose(0.0) and free.rank == 0


@pytest.mark.parametrize(("least", "is_kept"), [(0.0101, True), (0.0099, False)])
def test_rows_are_replaced_if_their_least_pivot_is_a_hundredth_of_the_best(monkeypatch, least, is_kept):
    run = Run(Solver, DOOR, 1e-6)
    before = run.equations.rows.tolist()
    order = np.array([9, 3, 1, 0, 2, 4, 5, 6, 7, 8])

    def pivots(j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        last = 1.0 if len(j) == 10 else least
        return np.array([5.0, 4.0, 3.0, 2.0, last, 0.0][: min(6, len(j))]), order[: len(j)]

    monkeypatch.setattr(ida, "_pivots", pivots)
    assert run._choose(0.0) is not is_kept
    assert run.equations.rows.tolist() == (before if is_kept else [0, 1, 2, 3, 9])


def test_pivots_of_rows():
    """Rows of lengths 1, 3 and 2; the last one has 1.2 across the second."""
    sizes, order = ida._pivots(np.array([[0.0, 0.0, 1.0], [0.0, 3.0, 0.0], [1.2, 1.6, 0.0]]))
    assert sizes == pytest.approx([3.0, 1.2, 1.0]) and order.tolist() == [1, 2, 0]


# --- steps ------------------------------------------------------------------------------------------------
def test_steps_to_a_sample_and_back_to_it():
    """Two steps of one each pass 0.1 s; the state there is interpolated. Evaluations are counted once."""
    run = Run(Solver, ROBOT.with_(driver=()), 1e-6)
    solver, y = Solver.made[0], run.y
    Solver.results = [result(0.06, y, 10), result(0.12, y, 17), result(0.1, y + 1e-9, 18)]
    run.advance(0.0, 0.1)
    assert solver.asked == [(0.1, "onestep"), (0.1, "onestep"), (0.1, "normal")]
    assert (run.counts.steps, run.counts.rhs) == (2, 18) and run.y == pytest.approx(y + 1e-9, abs=1e-15)
    Solver.results = [result(0.2, y, 25)]
    run.advance(0.1, 0.2)
    assert solver.asked[3:] == [(0.2, "onestep")] and (run.counts.steps, run.counts.rhs) == (3, 25)
    assert len(Solver.made) == 1, "no restart"
    run._choose = lambda t: t == 0.3
    Solver.results = [result(0.3, y, 26)]
    run.advance(0.2, 0.3)
    assert len(Solver.made) == 2 and Solver.made[1].start[0] == 0.3 and run.evaluated == 0


@pytest.mark.parametrize(
    ("status", "outcome"),
    [
        (-1, Outcome.STEP_FAILED),
        (-3, Outcome.STEP_FAILED),
        (-4, Outcome.NOT_CONVERGED),
        (-5, Outcome.SINGULAR_MATRIX),
        (-6, Outcome.SINGULAR_MATRIX),
        (-7, Outcome.SINGULAR_MATRIX),
        (-99, Outcome.STEP_FAILED),
    ],
)
def test_ends_of_the_solver(status, outcome):
    run = Run(Solver, ROBOT, 1e-6)
    Solver.results = [result(0.06, run.y, 1, status)]
    with pytest.raises(Failed, match=r"^IDA at 0\.06 s: it says so$") as failed:
        run.advance(0.0, 0.1)
    assert failed.value.outcome is outcome and failed.value.t == 0.06 and run.counts.steps == 0


@pytest.mark.parametrize(("gap", "is_lost"), [(0.0099, False), (0.0101, True)])
def test_joints_that_open(gap, is_lost):
    """A hundredth of a metre is allowed where the scene is shorter than a metre; the joint is named."""
    near = DOOR.joint[1].model_copy(update={"anchor": (0.0, 0.0, 0.25)})
    run = Run(Solver, DOOR.with_(body=(body("a", 0.25, 0.0, 0.0),), joint=(DOOR.joint[0], near)), 1e-6)
    assert run.length <= 1.0
    run.y[2] += gap
    if not is_lost:
        run._nothing_lost(0.25)
        return
    with pytest.raises(Failed, match=r"^joint '[AB]' is off by 0\.0101 at 0\.25 s$") as failed:
        run._nothing_lost(0.25)
    assert failed.value.outcome is Outcome.VIOLATION and failed.value.t == 0.25
    long = DOOR.with_(body=(body("a", 4.0, 0.0, 0.0),))
    large = Run(Solver, long, 1e-6)
    assert large.length > 2.0
    large.y[2] += gap
    large._nothing_lost(0.25)


# --- samples ----------------------------------------------------------------------------------------------
def test_reactions_of_a_sample_balance_the_bodies():
    """Newton's and Euler's equations of b without its reaction at B, and of both bodies without that at A."""
    run = Run(Solver, ROBOT.with_(load=LOADS[:2]), 1e-6)
    found = run.sample(0.0)
    turn = rotations.to_matrix(found.orientation)

    def needed(k: int) -> tuple[np.ndarray, np.ndarray]:
        given = ROBOT.body[k]
        inertia = turn[k] @ np.diag(given.inertia) @ turn[k].T
        spin = found.angular_velocity[k]
        rate = inertia @ found.angular_acceleration[k] + np.cross(spin, inertia @ spin)
        return given.mass * (found.acceleration[k] - np.array(ROBOT.gravity)), rate

    centre, pin, foot = found.position, np.array(PINS[1].anchor), np.array(PINS[0].anchor)
    force, rate = needed(1)
    push = np.array(LOADS[0].force)
    on_b = force - push
    turn_b = rate - np.cross(np.array(LOADS[0].point) - centre[1], push) - np.cross(pin - centre[1], on_b)
    assert found.reactions["B"] == pytest.approx(-np.concatenate([on_b, turn_b]), abs=1e-10), "it is on a"
    force, rate = needed(0)
    on_a = force + on_b
    turn_a = rate - np.array(LOADS[1].moment) + turn_b + np.cross(pin - centre[0], on_b)
    turn_a -= np.cross(foot - centre[0], on_a)
    assert found.reactions["A"] == pytest.approx(np.concatenate([on_a, turn_a]), abs=1e-10)


def test_a_sample_in_world_axes():
    """A body that is turned about a skew axis and spins; quaternions have length one."""
    start = rotations.from_vector(np.array([0.4, -0.7, 0.2]))
    spin = (0.3, 1.1, -0.6)
    thrown = body(
        "a", 1.0, 2.0, 3.0, orientation=tuple(start.tolist()), velocity=(4.0, 5.0, 6.0), angular_velocity=spin
    )
    scene = Scene(name="s", body=(thrown,), gravity=(0.0, -2.0, 0.5))
    run = Run(Solver, scene, 1e-6)
    run.y[3:7] *= 1.5
    found = run.sample(0.0)
    assert found.orientation[0] == pytest.approx(start) and found.reactions == {}
    assert found.position.tolist() == [[1.0, 2.0, 3.0]] and found.velocity.tolist() == [[4.0, 5.0, 6.0]]
    assert found.angular_velocity[0] == pytest.approx(spin)
    axes = rotations.to_matrix(start)
    inertia = axes @ np.diag([0.3, 0.4, 0.5]) @ axes.T
    change = -np.linalg.solve(inertia, np.cross(spin, inertia @ np.array(spin)))
    assert found.angular_acceleration[0] == pytest.approx(change)
    assert found.acceleration[0] == pytest.approx([0.0, -2.0, 0.5])


def test_a_joint_whose_second_body_is_the_ground():
    """The reaction on the ground carries the weight of 2 kg at rest, and its moment about the anchor."""
    hung = Scene(
        name="s",
        body=(body("a", 0.0, -1.0, 0.0),),
        joint=(Spherical(name="A", bodies=("a", "ground"), anchor=O),),
        gravity=(0.0, -9.0, 0.0),
    )
    assert Run(Solver, hung, 1e-6).sample(0.0).reactions["A"] == pytest.approx([0, -18.0, 0, 0, 0, 0])
