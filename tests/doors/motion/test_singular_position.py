"""Methods that watch the rank end at singular positions; those that claim to cross are right."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

from crosscheck.conformance.changes.units import scaled
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import closed_form
from mbref import Limits, simulate
from mbref.method import Method
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.scenes.five_bar import five_bar_gravity
from mbref.scenes.four_bar import four_bar_gravity
from mbref.scenes.planar_slider_crank import slider_crank
from tests.helpers.measured import relative_error
from tests.helpers.parts import hinge, rod

WATCHING = ("alf-dual+projection", "mpi-svd+projection", "mpi-gs+projection/adams")
WATCHING += ("alf+projection/rk4[step=1e-3]",)
REGULARISED = ("alf-dual+none", "alf-dual+baumgarte", "alf+none")
LOOPS = {
    "four": (four_bar_gravity(0.3, "four"), 1.0),
    "five": (five_bar_gravity(0.3, "five"), 1.0),
    "equal": (slider_crank(0.308, 0.308, 0.3, "equal", rate=30.0), 0.1),
}


def first_crossing(scene: Scene, end: float) -> float:
    """Return when the closed form's crank first is level, or upright in a slider-crank: singular (s)."""
    component = 0 if scene.name == "equal" else 1

    def place(times):
        return closed_form(scene).poses(np.atleast_1d(times)).position[:, 0, component]

    times = np.linspace(0.0, end, 101)
    k = np.flatnonzero(np.diff(np.sign(place(times))))[0]
    return float(brentq(lambda t: place(t)[0], times[k], times[k + 1]))


HEAVY = {"heavy": (scaled(four_bar_gravity(0.3, "heavy"), 1e9), 1.0)}  # masses times 1e9


@pytest.mark.parametrize(("loop", "method"), [*product(LOOPS, WATCHING), ("heavy", WATCHING[0])])
def test_run_that_watches_the_rank_ends_at_the_first_singular_position(loop, method):
    """WATCHING are methods that claim no crossing. LOOPS, two parallelograms and a slider-crank, and HEAVY,
    where large masses must not hide the loss of rank, end uncrossed, within 0.2 % of their duration at the
    closed form's first singular time. The message names a method that crosses."""
    scene, end = (LOOPS | HEAVY)[loop]
    time = first_crossing(scene, end)
    run = simulate(scene, method, np.linspace(0.0, end, 41))
    assert Method.parse(method).crosses == "no"
    assert run.outcome.name == "SINGULAR_POSITION", run.message
    assert run.t_end == pytest.approx(time, abs=0.2 / 100 * end)
    assert np.all(run.times <= run.t_end), "samples end there"
    [position] = run.crossings
    assert position.time == run.t_end and position.taken == 0
    assert "lose rank" in run.message and "taylor does" in run.message


FLAT = LOOPS["four"][0], LOOPS["five"][0], find_scene("four_bar_chain[3]")


@pytest.mark.parametrize("scene", FLAT, ids=lambda scene: scene.name)
def test_message_names_the_joints_that_lose_rank_and_no_joint_beside_them(scene):
    """All joints of a loop take part where its links are in line: in a four-bar, a five-bar, and three loops
    of a chain that are flat at once. The hinge of a pendulum beside them does not."""
    beside = (rod("bob", (9.0, 0.0, 0.0), (9.5, 0.0, 0.0)), hinge("beside", "ground", "bob", (9.0, 0.0, 0.0)))
    parts = {"body": [*scene.body, beside[0]], "joint": [*scene.joint, beside[1]]}
    both = Scene.model_validate({**scene.model_dump(), **parts})
    message = simulate(both, "alf-dual+projection", [2.0]).message
    assert [j.name for j in both.joint if repr(j.name) not in message] == ["beside"], message


FAILURES = ("LEFT_MOTION", "NOT_CONVERGED", "STEP_FAILED")  # rounding decides which one


@pytest.mark.parametrize("method", REGULARISED)
@pytest.mark.parametrize("loop", LOOPS)
def test_regularised_method_meets_the_closed_form_after_the_singular_position_or_fails(loop, method):
    """REGULARISED claim to cross by regularisation; LOOPS are two parallelograms and a slider-crank. A run
    completes within 1000 times rtol, 1e-8, or reports that it failed or left its motion."""
    scene, end = LOOPS[loop]
    assert Method.parse(method).crosses == "by regularisation"
    run = simulate(scene, method, np.linspace(0.0, end, 21), Limits(rtol=1e-8))
    error = measure(scene, run, closed_form(scene))["error"]
    if run.outcome.name == "COMPLETED":
        assert error < 1000 * 1e-8
    else:
        assert run.outcome.name in FAILURES, run.message


@pytest.mark.parametrize("method", ["alf-dual+none", "alf+baumgarte"])
def test_regularised_method_crosses_the_flat_position_of_a_rhombus_as_its_closed_form(method):
    """The coupler does not turn, the cranks have one angle, by the energy; errors are below 1000 rtol."""
    scene, end, rtol = four_bar_gravity(), 0.5, 1e-7
    run = simulate(scene, method, np.linspace(0.0, end, 5), Limits(rtol=rtol))
    assert first_crossing(scene, end) < end
    assert relative_error(run, scene) < 1000 * rtol


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
@pytest.mark.parametrize("loops", [2, 3, 5, 12])
def test_run_ends_where_all_loops_of_a_chain_are_flat(loops, rtol):
    """With an even number of loops the determinant keeps its sign there, so that its sign does not show the
    position. The time is the closed form's, to 5e-4 s."""
    scene = find_scene(f"four_bar_chain[{loops}]")
    run = simulate(scene, "alf-dual+projection", [2.0], Limits(rtol=rtol))
    assert run.outcome.name == "SINGULAR_POSITION", run.message
    assert run.t_end == pytest.approx(first_crossing(scene, 1.0), abs=5e-4)


@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
@pytest.mark.parametrize("loops", [2, 6, 10])
def test_chain_of_slider_cranks_completes_though_single_pivots_vanish(loops, rtol):
    """Single pivots vanish twice a turn, but the rank stays. Errors are below 100 rtol."""
    scene, times = find_scene(f"slider_crank_chain[{loops}]"), np.linspace(0.0, 0.4, 5)
    run = simulate(scene, "alf-dual+projection", times, Limits(rtol=rtol))
    assert relative_error(run, scene) < 100 * rtol


@pytest.mark.parametrize("distance", [3e-2, 1e-1])
def test_swing_that_turns_back_before_the_flat_position_is_completed_by_projection(distance):
    """Released ``distance`` (rad) from flat, a rhombus crosses nothing and is right to 1000 rtol."""
    scene, rtol = four_bar_gravity(-distance), 1e-9
    run = simulate(scene, "alf-dual+projection", np.linspace(0.0, 1.5, 9), Limits(rtol=rtol))
    assert relative_error(run, scene) < 1000 * rtol and run.crossings == ()


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-5, 1e-7])
def test_run_near_a_missed_singular_position_is_right_or_does_not_complete(gap):
    """The rod is longer than the crank by the gap (m). A run that completes is within 1000 rtol, at least
    1e-6, of the closed form: with a larger difference from a projected run its outcome is another one."""
    scene = slider_crank(0.308, 0.308 + gap, 0.3, "gap", rate=30.0)
    for rtol in (1e-5, 1e-9):
        run = simulate(scene, "alf-dual+projection", np.linspace(0.0, 0.25, 21), Limits(rtol=rtol))
        error = measure(scene, run, closed_form(scene))["error"]
        assert run.outcome.name != "COMPLETED" or error < max(1000 * rtol, 1e-6), (rtol, error)


def test_run_from_a_singular_position_ends_at_its_start_if_the_method_does_not_cross():
    """The rhombus is released at angle 0, where it is flat."""
    run = simulate(four_bar_gravity(0.0), "alf-dual+projection", [0.0, 0.5])
    assert run.outcome.name == "SINGULAR_POSITION" and run.t_end == 0.0, run.message


def test_bar_pulls_a_swinging_point_by_three_times_its_weight_component():
    """1 kg on a bar of 1 m is released level: at φ below level the bar pulls 3 m g sin φ, to ten rtol (N)."""
    rtol = 1e-9
    run = simulate("point_pendulum", times=np.linspace(0.0, 2.0, 21), rtol=rtol)
    along = -np.einsum("ki,ki->k", run.reactions["pivot"][:, :3], run.position[:, 0])
    below = -run.position[:, 0, 1]
    assert along == pytest.approx(3.0 * 9.81 * below, abs=10 * rtol)
