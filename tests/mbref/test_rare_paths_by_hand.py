"""Paths that few runs take / results worked out by hand: redundant rows, vibrations, second runs, the ends of
options."""

from __future__ import annotations

import argparse
import gc
import importlib
import math
import sys
import types
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

import mbref.cli
from mbref import rotations, scene_fields, scene_function_faults, second_run
from mbref.cli import pictures
from mbref.design.equilibrium import MODE_SAMPLES, Equilibrium, motion_of_mode
from mbref.error_estimate import ErrorEstimate
from mbref.input_error import InputError
from mbref.integrators.base import Integrator
from mbref.joint_motion import joint_motion
from mbref.kernels.machine_code import NoGeneratedCode
from mbref.kernels.named_memory import packed
from mbref.kernels.records import NoNumbers
from mbref.linear_algebra.minimum_norm import ALPHA, MinimumNorm, factorise_once
from mbref.linear_algebra.redundancy import Redundancy
from mbref.linear_algebra.symbolic_factorisation import sparse_factor, symbolic_factorisation
from mbref.method import Method, MethodError
from mbref.scene import Body, Revolute, Scene, Spherical
from mbref.simulation import outcome
from mbref.simulation import simulate as simulation
from mbref.stepping import ranks
from mbref.stepping.limits import AUTO, GENERATED, Limits
from mbref.stepping.loop import SINGULAR_AHEAD, TOO_MANY_STEPS
from mbref.taylor import stepper
from mbref.trajectory import Outcome

# --- redundant rows ---------------------------------------------------------------------------------------
ROWS = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0], [3.0, 4.0, 0.0, 0.0]])


def test_rank_and_shares_of_dependent_rows():
    """0.6 and 0.8 times the first unit rows give the third one; D Dᵀ has the eigenvalues 0, 1 and 2."""
    found = Redundancy(csr_array(ROWS))
    assert found.rank == 2
    assert found.shares == pytest.approx([0.18, 0.32, 0.5], abs=1e-6)
    assert found.singular_values() == pytest.approx((1.0, math.sqrt(2.0)), rel=1e-6)
    assert Redundancy(csr_array(ROWS[:2])).rank == 2 and Redundancy(csr_array(ROWS[[0, 0, 0]])).rank == 1


def test_solutions_of_least_weighted_norm():
    a, weight = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 3.0]]), np.array([2.0, 5.0, 7.0])
    b = np.array([4.0, -1.0])
    expected = a.T / weight[:, None] @ np.linalg.solve(a / weight @ a.T, b)
    assert MinimumNorm(csr_array(a), weight)(b) == pytest.approx(expected, rel=1e-10)
    redundant = np.vstack([a, a.sum(axis=0), np.zeros(3)])
    assert MinimumNorm(csr_array(redundant), weight)(np.array([4.0, -1.0, 3.0, 0.0])) == pytest.approx(
        expected, rel=1e-10
    )
    apart = MinimumNorm(csr_array([[2.0, 0.0], [1.0, 0.0]]), np.ones(2))
    assert apart(np.array([2.0, 2.0])) == pytest.approx([1.5, 0.0]), "least squares of unit rows"


def test_the_regularised_inverse_of_unit_rows():
    b, norm = np.array([0.3, -0.7, 1.1]), MinimumNorm(csr_array(ROWS), np.ones(4))
    unit = ROWS / np.array([[1.0], [2.0], [5.0]])
    expected = np.linalg.solve(unit @ unit.T + np.eye(3) / ALPHA, b)
    assert norm.d.toarray() == pytest.approx(unit)
    assert norm.regularised_solution(b) == pytest.approx(expected, rel=1e-6)
    short = MinimumNorm(csr_array([[0.3, 0.8], [0.0, 0.0]]), np.array([1.0, 4.0]))
    assert short.d.toarray() == pytest.approx(np.array([[0.6, 0.8], [0.0, 0.0]]))
    with_zero = MinimumNorm(csr_array(np.vstack([np.zeros(4), ROWS[0]])), np.ones(4))
    assert with_zero.regularised_solution(np.array([2.0, 3.0]))[0] == 2.0 * ALPHA


def factor_of(rows: np.ndarray) -> Any:
    row, column = np.nonzero(np.ones_like(rows))
    return sparse_factor(symbolic_factorisation(row, column, np.arange(rows.size), np.ones(3, dtype=bool)))


def test_rows_whose_pivots_are_clear():
    """Two unit rows at an angle: the last pivot is the sine of it. Numbers that are not finite have none."""
    model: Any = SimpleNamespace(data=SimpleNamespace(metric_root=np.ones(3)))
    for angle, clear in ((0.5, True), (1e-9, False)):
        rows = np.array([[1.0, 0.0, 0.0], [math.cos(angle), math.sin(angle), 0.0]])
        factor = factor_of(rows)
        assert factorise_once(rows.reshape(-1), np.ones(3), packed(factor).argument) == 1
        assert ranks.are_clear(model, rows, factor_of(rows)) is clear
    rows = np.full((2, 3), math.nan)
    assert factorise_once(rows.reshape(-1), np.ones(3), packed(factor_of(rows)).argument) == 0


# --- vibrations -------------------------------------------------------------------------------------------
def two_pendulums() -> Scene:
    """A body below the origin on a hinge about z, and one below (3, 0, 0) on a hinge about x."""
    turned = (math.cos(0.2), 0.0, math.sin(0.2), 0.0)
    first = Body(name="a", mass=2.0, inertia=(0.3, 0.2, 0.1), position=(0.0, -1.0, 0.0))
    other = Body(name="b", mass=1.0, inertia=(0.1,) * 3, position=(3.0, 0.0, -2.0), orientation=turned)
    hinges = (
        Revolute(name="A", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
        Revolute(name="B", bodies=("ground", "b"), anchor=(3.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0)),
    )
    return Scene(name="two", body=(first, other), joint=hinges)


def test_one_period_of_a_vibration():
    """The second body lags by a quarter of a period and turns half as far."""
    shapes = np.zeros((4, 2, 6), dtype=complex)
    shapes[2, 0], shapes[2, 1] = [1, 0, 0, 0, 0, 1], 0.5j * np.array([0, 2, 0, 1, 0, 0])
    found = Equilibrium(two_pendulums(), np.array([3j, -3j, 0.3 + 4j, 0.3 - 4j]), shapes, {})
    assert found.oscillating.tolist() == [0, 2] and found.frequencies[1] == pytest.approx(
        abs(0.3 + 4j) / (2 * math.pi)
    )
    motion = motion_of_mode(found, 2, 1e-3)
    phases = np.linspace(0.0, 2 * math.pi, MODE_SAMPLES)
    assert motion.times == pytest.approx(phases / abs(0.3 + 4j)) and motion.bodies == ("a", "b")
    angle, lag = 1e-3 * np.cos(phases), -0.5e-3 * np.sin(phases)
    places = np.column_stack([np.sin(angle), -np.cos(angle), 0 * angle])
    assert motion["a"].position == pytest.approx(places, abs=1e-9)
    others = np.column_stack([3 + 0 * lag, 2 * np.sin(lag), -2 * np.cos(lag)])
    assert motion["b"].position == pytest.approx(others, abs=1e-9)
    turns = rotations.to_vector(rotations.multiply(motion.orientation[:, 1], rotations.conjugate(
        np.array(two_pendulums().body[1].orientation))))  # fmt: skip
    assert turns == pytest.approx(np.column_stack([lag, 0 * lag, 0 * lag]), abs=1e-9)
    assert not motion.velocity.any() and not motion.acceleration.any()
    assert (motion.scene, motion.engine, motion.method) == ("two", "mbref", "mode")
    assert motion.mechanism is found.scene
    assert motion_of_mode(found, 2).position[0, 0, 0] == pytest.approx(math.sin(0.1), abs=1e-3)


@pytest.mark.parametrize("number", [0, 3])
def test_a_vibration_that_does_not_exist(number):
    found = Equilibrium(two_pendulums(), np.array([3j, -3j, 4j, -4j]), np.zeros((4, 2, 6)), {})
    with pytest.raises(InputError, match=f"mode: there are 2 vibrations, there is none with number {number}"):
        motion_of_mode(found, number)


# --- second runs ------------------------------------------------------------------------------------------
def motion_of(method: str = "lm1+none/dop853", engine: str = "mbref", **limits: Any) -> Any:
    return SimpleNamespace(
        engine=engine,
        method=method,
        settings={f: getattr(Limits(**limits), f) for f in Limits.__dataclass_fields__},
        times=np.array([0.0, 1.0, 2.0]),
        position=np.zeros((3, 1, 3)),
        orientation=np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1)),
        mechanism="scene",
        cost=SimpleNamespace(seconds=0.25),
    )


def made(off: float, count: int = 3, reason: str = "ended") -> second_run._Made:
    """A run that is ``off`` (m) from the origin at all samples, in a mechanism of 2 m."""
    moved = SimpleNamespace(
        times=np.arange(float(count)),
        position=np.full((count, 1, 3), [off, 0.0, 0.0]),
        orientation=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1, 1)),
    )
    return second_run._Made(moved, 2.0, reason)  # type: ignore[arg-type]


def test_a_motion_of_another_engine_has_no_second_run():
    with pytest.raises(InputError, match="a motion of mujoco; crosscheck judges other engines"):
        second_run.estimate_error(motion_of(engine="mujoco"))


def test_a_run_that_took_long_or_has_no_sample_has_no_second_run():
    assert second_run._none(motion_of(), 0.25) == ""
    reason = second_run._none(motion_of(), 0.2)
    assert reason.startswith("the run took 0.25 s, more than 0.2 s; --estimate yes")
    empty = motion_of()
    empty.times = np.zeros(0)
    assert second_run._none(empty, np.inf) == "the run has no sample"
    found = second_run.estimate_error(motion_of(rtol=1e-8), 0.1)
    assert isinstance(found, ErrorEstimate) and found.reason.startswith("the run took 0.25 s")
    assert found.rtol == 1e-8 and second_run.estimate_error(motion_of("lm1+none/rk4"), 0.1).rtol is None


@pytest.mark.parametrize(
    ("off", "rtol", "second", "tighter"),
    [
        (0.5, 1e-9, made(0.1), (1e-12, 0.2)),
        (0.5, 1e-9, made(0.1, count=2), None),
        (0.5, 1e-9, second_run._Made(None, 1.0, "failed"), None),
        (0.5, 1e-12, made(0.1), None),
        (1e-9, 1e-9, made(0.1), None),
    ],
)
def test_a_motion_with_a_warning_is_run_with_a_smaller_tolerance(monkeypatch, off, rtol, second, tighter):
    """The other run is 0.5 m away, 0.25 of the length of 2 m; the tighter one (0.5 - 0.1) m."""
    asked = []
    by = Method.parse("taylor[order=24]")
    monkeypatch.setattr(second_run, "_finer", lambda *_: (by, Limits(rtol=2e-13)))
    monkeypatch.setattr(second_run, "_second_run", lambda *_: made(off))
    monkeypatch.setattr(second_run, "_run", lambda scene, *given: asked.append((scene(), *given)) or second)
    motion = motion_of(rtol=rtol)
    found = second_run.estimate_error(motion)
    assert found.error == pytest.approx([off / 2] * 3) and found.rtol == rtol and found.reason == ""
    assert found.second_run == f"{by}, rtol 2e-13"
    assert found.tighter == (None if tighter is None else pytest.approx(tighter))
    if asked:
        [(scene, method, times, limits, _)] = asked
        assert scene == "scene" and method == Method.parse(motion.method) and times is motion.times
        assert (limits.rtol, limits.atol, limits.compared) == (1e-12, None, False)
    assert len(asked) == (off > 0.1 and rtol > 1e-12)


def test_a_second_run_that_ends_early_gives_way_to_a_longer_one(monkeypatch):
    motion, runs = motion_of(), []
    monkeypatch.setattr(second_run, "perturbed", lambda scene: f"perturbed {scene}")
    monkeypatch.setattr(second_run, "_run", lambda scene, *_: runs.append(scene()) or queue.pop(0))
    for queue, chosen, asked in (
        ([made(1.0), made(2.0)], 0, ["perturbed scene"]),
        ([made(1.0, 2), made(2.0, 2)], 0, ["perturbed scene", "scene"]),
        ([made(1.0, 1), made(2.0, 2)], 1, ["perturbed scene", "scene"]),
    ):
        runs.clear()
        both = list(queue)
        found = second_run._second_run(motion, None, None, None)  # type: ignore[arg-type]
        assert found is both[chosen] and runs == asked
    short = made(1.0, 2)
    assert short.count == 2 and short.is_short(motion) and not made(1.0).is_short(motion)
    assert short.distances(motion)[:2] == pytest.approx([0.5, 0.5]) and np.isnan(short.distances(motion)[2])
    assert second_run._Made(None, 1.0, "").count == 0


def test_method_and_tolerance_of_a_second_run(monkeypatch):
    monkeypatch.setattr(second_run, "MOST_BODIES", 2)
    scene: Any = SimpleNamespace(body=[1, 2])
    finer = lambda name, scene=scene, **of: second_run._finer(scene, Method.parse(name), Limits(**of))  # noqa: E731
    by, limits = finer("taylor", rtol=1e-9, atol=1e-3, forced_step=0.5, code=GENERATED)
    assert str(by) == str(Method.parse("taylor[order=24]"))
    assert (limits.rtol, limits.atol, limits.forced_step, limits.code) == (1e-13, None, 0.0, AUTO)
    assert finer("taylor", rtol=3e-13)[1].rtol == pytest.approx(3e-14)
    assert finer("taylor", rtol=5e-16)[1].rtol == second_run.FINEST
    assert finer("taylor", code="generic")[1].code == "generic"
    by, limits = finer("lm1+none/dop853", rtol=1e-5, forced_step=0.5)
    assert (by, limits.rtol, limits.forced_step) == (Method.parse("taylor[order=24]"), 1e-13, 0.0)
    large: Any = SimpleNamespace(body=[1, 2, 3])
    by, limits = finer("alf+projection/adams", large, rtol=1e-5)
    assert (str(by), limits.rtol) == (str(Method.parse("alf+projection/adams")), 1e-12)
    monkeypatch.setattr(second_run, "default_method", lambda scene: "alf-dual+projection/dop853")
    for name in ("alf+none/adams", "alf+projection/rk4"):
        assert str(finer(name, large)[0]) == str(Method.parse("alf-dual+projection/dop853"))


def test_a_second_run_that_takes_too_long(monkeypatch):
    reported: list[float] = []
    second_run._Check(1e3, reported.append)(0.5)
    assert reported == [0.5]
    second_run._Check(1e3, None)(0.5)
    with pytest.raises(second_run._TooLong, match="a second run takes longer than -1 s; --estimate yes"):
        second_run._Check(-1.0, reported.append)(0.75)
    assert reported == [0.5]
    ended, released = SimpleNamespace(t_end=1.2345, message="stopped"), []
    run = SimpleNamespace(model=SimpleNamespace(length=3.0), release=lambda: released.append(1))
    monkeypatch.setattr(second_run, "checked_run", lambda *given: asked.append(given) or run)
    monkeypatch.setattr(second_run, "finish_run", lambda run, check: ended)
    asked: list[Any] = []
    found = second_run._run(lambda: "scene", "method", "times", "limits", None)  # type: ignore[arg-type,return-value]
    assert found == second_run._Made(ended, 3.0, "the second run ended at t = 1.23 s: stopped")  # type: ignore[arg-type]
    assert asked == [("scene", "method", "times", "limits")] and released == [1]

    def late(run: Any, check: Any) -> None:
        raise second_run._TooLong("late")

    monkeypatch.setattr(second_run, "finish_run", late)
    assert second_run._run(lambda: "scene", *[None] * 4) == second_run._Made(None, 1.0, "late")  # type: ignore[arg-type,return-value]


def test_perturbed_numbers():
    """Every number but the duration differs by a few units in the last place; zeros stay zeros."""
    scene = two_pendulums().with_(gravity=(0.0, -9.81, 0.0), duration=0.7)
    changed = second_run.perturbed(scene)
    assert changed.duration == 0.7 and changed.gravity[0] == changed.gravity[2] == 0.0
    for one, other in (
        (changed.gravity[1], -9.81),
        *zip(changed.body[0].inertia, (0.3, 0.2, 0.1), strict=True),
    ):
        assert 0.0 <= abs(one / other - 1.0) <= 2.5 * 2.0**-52
    assert changed != scene and second_run.perturbed(scene) == changed


# --- runs that are refused --------------------------------------------------------------------------------
def test_runs_that_a_method_cannot_make(monkeypatch):
    scene: Any = SimpleNamespace(name="s")
    explicit, times = Method.parse("lm1+none/rk4"), np.array([1.0])
    with pytest.raises(MethodError, match=r"branches: lm1.* does not cross singular positions; use taylor"):
        simulation.checked_run(scene, explicit, times, Limits(branches={1: 2}))
    with pytest.raises(MethodError, match=r"code: lm1.* has no generated code; use taylor"):
        simulation.checked_run(scene, explicit, times, Limits(code=GENERATED))
    monkeypatch.setattr(simulation, "start_run", lambda *given: given)
    for method, limits in (
        (explicit, Limits()),
        (Method.parse("taylor"), Limits(code=GENERATED, branches={1: 2})),
    ):
        assert simulation.checked_run(scene, method, times, limits) == (scene, method, times, limits)

    def refuse(*_: Any) -> None:
        raise NoGeneratedCode("it is long")

    monkeypatch.setattr(simulation, "start_run", refuse)
    with pytest.raises(MethodError, match=r"code: no generated code for 's' by \S*taylor: it is long"):
        simulation.checked_run(scene, Method.parse("taylor"), times, Limits())
    monkeypatch.setattr(simulation, "prepare", lambda method: None)
    assert simulation.why_no_code(SimpleNamespace(duration=1.0), Method.parse("taylor")) == "it is long"  # type: ignore[arg-type]


def test_a_branch_at_a_crossing_that_the_motion_does_not_pass():
    run: Any = SimpleNamespace(limits=Limits(branches={1: 2, 3: 1}), crossings=[1, 2, 3], times=[0.0, 2.5])
    simulation._check_branches(run)
    run.crossings = [1, 2]
    with pytest.raises(InputError, match=r"passes 2 singular positions up to t = 2\.5 s, and no number 3"):
        simulation._check_branches(run)
    run.limits, run.crossings = Limits(), []
    simulation._check_branches(run)


@pytest.mark.parametrize(
    ("status", "near", "dead", "series", "found"),
    [
        (SINGULAR_AHEAD, False, False, False, True),
        (SINGULAR_AHEAD, False, True, False, False),
        (SINGULAR_AHEAD, False, False, True, False),
        (min(outcome.FAILED), True, False, False, False),
        (min(outcome.FAILED), False, False, False, None),
        (TOO_MANY_STEPS, True, False, False, None),
    ],
)
def test_runs_that_end_at_a_singular_position(monkeypatch, status, near, dead, series, found):
    """The result is whether the position lies inside of the last step; None where there is none."""
    assert TOO_MANY_STEPS not in outcome.FAILED
    monkeypatch.setattr(outcome, "is_near", lambda run: near)
    monkeypatch.setattr(outcome, "is_at_dead_position", lambda run: dead)
    monkeypatch.setattr(outcome, "met_by", lambda run, inside: inside)
    run: Any = SimpleNamespace(method=SimpleNamespace(is_series=series))
    expected = None if dead or series else found
    assert outcome._singular_position(run, status) is expected


@pytest.mark.parametrize(("wanted", "good"), [(1, True), (12, True), (0, False), (13, False), (2.5, False)])
def test_the_highest_order_of_an_integrator(wanted, good):
    made = Integrator("adams", 12, None, None, NoNumbers, adaptive=True)  # type: ignore[arg-type]
    assert made.highest_order({}) == 12
    if good:
        assert made.highest_order({"max_order": wanted}) == wanted
    else:
        with pytest.raises(InputError, match=f"adams: max_order must be 1 to 12, got {wanted:g}"):
            made.highest_order({"max_order": wanted})


def test_steps_ahead_decide_on_generated_code():
    """20 steps to 0.5 s of 2 s: 60 more are ahead, or as many as the run may take."""
    found, put = stepper.SeriesStepper.__new__(stepper.SeriesStepper), []
    counts, clock = SimpleNamespace(steps=20), SimpleNamespace(time=0.5)
    memory = SimpleNamespace(
        equations=SimpleNamespace(system=SimpleNamespace(counts=counts)), loop=SimpleNamespace(clock=clock)
    )
    found.run = SimpleNamespace(
        memory=memory, times=[0.0, 0.25, 2.0], limits=SimpleNamespace(most_steps=1000)
    )  # type: ignore[assignment]
    assert found._steps_ahead() == 60.0
    found.run.limits.most_steps = 50  # type: ignore[misc]
    assert found._steps_ahead() == 30.0

    def make() -> None:
        put.append(1)
        raise NoGeneratedCode("none")

    found._put_code = make  # type: ignore[method-assign]
    for steps, wants, calls in ((19999.0, True, 0), (20000.0, False, 0), (20000.0, True, 1)):
        found._steps_ahead, found._wants_code = lambda steps=steps: steps, wants  # type: ignore[method-assign]
        put.clear()
        found._generate_where_it_pays()
        assert len(put) == calls and found._wants_code is (wants and not calls)


# --- messages and options ---------------------------------------------------------------------------------
def test_a_direction_of_no_length():
    with pytest.raises(ValueError, match="must have a length, got the zero vector"):
        scene_fields.direction((0.0, 0.0, 0.0))
    assert scene_fields.direction((0.0, 3.0, -4.0)) == (0.0, 3.0, -4.0)


def test_times_that_are_no_numbers_count_as_zero():
    for value in ("x", None, 1e300, [1.0]):
        assert scene_function_faults._number(value) == 0.0
    assert scene_function_faults._number(2) == 2.0 and scene_function_faults._number("500 mm") == 0.5
    factor = {"table": [[0.5, 1.0], [2.0, 3.0]], "start": "x"}
    [(path, says)] = scene_function_faults.factor_faults("load[0].factor", factor, {"duration": 2.0})
    assert path == "load[0].factor.table" and says.endswith("first row is at 0.5 s, but it acts from 0 s on")


def test_a_joint_without_an_axis_has_neither_angle_nor_displacement():
    """Reactions are split into force and moment; a motion without them has none."""
    scene = Scene(
        name="s",
        body=(Body(name="b", mass=1.0, inertia=(1.0,) * 3, position=(1.0, 0.0, 0.0)),),
        joint=(Spherical(name="J", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0)),),
    )
    motion: Any = SimpleNamespace(
        times=np.zeros(1),
        bodies=("b",),
        position=np.array([[[1.0, 0.0, 0.0]]]),
        orientation=np.array([[[1.0, 0.0, 0.0, 0.0]]]),
        velocity=np.zeros((1, 1, 3)),
        angular_velocity=np.zeros((1, 1, 3)),
        reactions={"J": np.arange(1.0, 7.0)[None]},
        open_reactions={"J": np.array([2])},
    )
    found = joint_motion(scene, motion, "J")
    assert found.angle is None and found.displacement is None and found.rate is None
    assert found.force.tolist() == [[1, 2, 3]] and found.moment.tolist() == [[4, 5, 6]]
    assert found.open.tolist() == [2]
    motion.reactions = motion.open_reactions = None
    found = joint_motion(scene, motion, "J")
    assert found.force is None and found.moment is None and found.open is None


@pytest.mark.parametrize("collects", [True, False])
def test_no_garbage_is_collected_while_the_commands_are_imported(monkeypatch, collects):
    """Afterwards it is collected as before, except what has been imported."""
    seen: list[bool] = []

    class Commands(types.ModuleType):
        def __getattr__(self, name: str) -> Any:
            seen.append(gc.isenabled())
            return mbref.cli.main

    was = gc.isenabled()
    try:
        monkeypatch.setitem(sys.modules, "mbref.cli.commands", Commands("mbref.cli.commands"))
        (gc.enable if collects else gc.disable)()
        gc.unfreeze()
        importlib.reload(mbref.cli)
        assert gc.isenabled() is collects and gc.get_freeze_count() > 0
    finally:
        (gc.enable if was else gc.disable)()
    assert seen and not any(seen)


# --- pictures of branches ---------------------------------------------------------------------------------
def crossing(*branches: float) -> Any:
    return SimpleNamespace(
        time=0.25,
        velocity=list(branches),
        sentence=f"{len(branches)} branches",
        instants=lambda end, count: ("times", end, count),
    )


def test_motions_along_the_branches_of_a_crossing(monkeypatch):
    smooth: Any = SimpleNamespace(mechanism="scene", t_end=2.0, crossings=(crossing(1.0), crossing(1.0, 2.0)))
    asked: list[Any] = []

    def simulate(scene: Any, method: Any, times: Any, limits: Any) -> Any:
        asked.append((scene, method, times, dict(limits.branches), limits.rtol))
        first = len(asked) == 1
        return SimpleNamespace(outcome=Outcome.COMPLETED if first else Outcome.STEP_FAILED, t_end=0.123456)

    monkeypatch.setattr(simulation, "simulate", simulate)
    found = pictures.along_branches(smooth, "taylor", Limits(rtol=1e-7), 2)
    times = "times", 2.0, pictures.BRANCH_SAMPLES
    assert asked == [("scene", "taylor", times, {2: 1}, 1e-7), ("scene", "taylor", times, {2: 2}, 1e-7)]
    assert [*found] == ["branch 1, smooth", "branch 2, ended at 0.1235 s"]
    assert pictures.sentence(smooth, 2) == "singular position 2 at t = 0.25 s: 2 branches"


@pytest.mark.parametrize(
    ("branches", "number"), [(False, None), (True, None), (False, 2)], ids=["film", "first", "chosen"]
)
def test_animate_writes_one_film_or_a_film_of_the_branches(monkeypatch, tmp_path, capsys, branches, number):
    monkeypatch.chdir(tmp_path)
    scene: Any = SimpleNamespace(name="a scene")
    motion: Any = SimpleNamespace(crossings=(crossing(1.0), crossing(1.0, 2.0)), t_end=2.0)
    run = SimpleNamespace(scene=scene, motion=lambda: motion, method="taylor", limits="limits")
    asked: list[Any] = []
    both = {"one": 1, "two": 2}
    monkeypatch.setattr(pictures, "request_of", lambda options: run)
    monkeypatch.setattr(pictures, "exit_status", lambda *motions: len(motions))
    monkeypatch.setattr(pictures, "along_branches", lambda *given: asked.append(given) or both)
    monkeypatch.setattr(pictures, "side_by_side", lambda *given: asked.append(given) or "two films")
    monkeypatch.setattr(pictures, "write_film", lambda *given: asked.append(given))
    options = argparse.Namespace(scene="s", branches=branches, crossing=number, out=None, view="xz")
    status, printed = pictures._animate(options), capsys.readouterr().out.splitlines()
    view = pictures.View.parse("xz")
    if branches or number:
        title = "a scene: singular position 2 at t = 0.25 s: 2 branches"
        assert status == 2 and printed == ["s-branches.svg"]
        assert (tmp_path / "s-branches.svg").read_text() == "two films"
        assert asked == [(motion, "taylor", "limits", 2), (scene, both, title, view)]
    else:
        says = "singular position 2 at t = 0.25 s: 2 branches; --branches shows them side by side"
        assert status == 1 and printed == ["s-moving.svg", says]
        [(path, *rest)] = asked
        assert str(path) == "s-moving.svg" and rest == [scene, motion, view]
        motion.crossings = (crossing(1.0),)
        pictures._animate(argparse.Namespace(**{**vars(options), "view": None}))
        assert capsys.readouterr().out.splitlines() == ["s-moving.svg"] and asked[-1][-1] is None


def test_draw_writes_a_picture_as_text_or_as_an_image(monkeypatch, tmp_path, capsys):
    scene: Any = SimpleNamespace(name="a")
    warned: list[Any] = []
    monkeypatch.setattr(pictures, "find_scene", lambda name: scene)
    monkeypatch.setattr(pictures, "warn", warned.append)
    monkeypatch.setattr(pictures, "still", lambda scene, view: f"<{view}>")
    monkeypatch.setattr(pictures, "png", lambda text: text.encode() + b"!")
    for name, data in (("a.svg", b"<None>"), ("a.png", b"<None>!")):
        out = str(tmp_path / name)
        assert pictures._draw(argparse.Namespace(scene="a", out=out, view=None)) == 0
        assert (tmp_path / name).read_bytes() == data and capsys.readouterr().out == f"{out}\n"
    assert warned == [scene, scene]
