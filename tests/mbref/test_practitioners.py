"""Dropped rows, speeds along the continued tangent, index-3 augmented Lagrangian with projections."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure, order_of_convergence
from crosscheck.judge.truth import truth_for
from mbref.method import Method, MethodError
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from mbref.simulation.start_run import start_run
from mbref.simulation.stepping import DONE

DROPPED = ("lm2-first-rows", "lm2-step-rows")
SWING = SCENES["four_bar_gravity"]()


def measured(scene, method, times, **limits):
    motion = simulate(scene, method, times, Limits(**limits))
    assert motion.outcome.name == "COMPLETED", f"{method}: {motion.message}"
    return motion, measure(scene, motion, truth_for(scene))


@pytest.mark.parametrize("formulation", DROPPED)
@pytest.mark.parametrize("scene", ["four_bar_gravity", "spatial_slider_crank", "planar_slider_crank"])
def test_dropped_rows_change_no_motion(scene, formulation):
    _, found = measured(SCENES[scene](), f"{formulation}+projection", [0.02, 0.05, 0.1], rtol=1e-10)
    assert found["error"] < 1e-8
    assert found["reaction_error"] is None or found["reaction_error"] < 1e-6


def finished(scene, method, times, rtol=1e-9):
    """A completed run, whose samples have multipliers and the model's own coordinates."""
    method = Method.parse(method)
    run = start_run(SCENES[scene](), method, np.array(times), Limits(rtol=rtol))
    status, _ = run.stepper.advance(None)
    assert status == DONE
    return run


def dropped(scene, formulation, times):
    """Rows (k, m) whose multiplier is exactly zero."""
    return finished(scene, f"{formulation}+projection", times).memory.loop.samples.multipliers == 0.0


@pytest.mark.parametrize("formulation", DROPPED)
@pytest.mark.parametrize(("scene", "redundant"), [("bennett", 3), ("bricard", 1)])
def test_as_many_rows_are_dropped_as_are_redundant(scene, redundant, formulation):
    rows = dropped(scene, formulation, [0.05, 0.1, 0.15])
    assert np.array_equal(rows.sum(axis=1), np.full(3, redundant))
    assert formulation == "lm2-step-rows" or (rows == rows[0]).all(), "rows chosen first stay"


@pytest.mark.parametrize("formulation", DROPPED)
def test_rows_that_become_dependent_end_the_run(formulation):
    motion = simulate(SCENES["four_bar"](), f"{formulation}+baumgarte", [0.02, 0.5], Limits(rtol=1e-6))
    assert motion.outcome.name in ("SINGULAR_MATRIX", "VIOLATION", "STEP_FAILED", "LEFT_MOTION")


def largest_violation_of_velocities(scene, method, rtol):
    """|Φ_q v| of the model's own rows at the samples; no driver has a part in it."""
    run = finished(scene, method, [0.02, 0.05, 0.1], rtol)
    q, v = run.memory.loop.samples.coordinates, run.memory.loop.samples.velocities
    return max(np.abs(run.model.terms(0.0, q[k], v[k]).jacobian @ v[k]).max() for k in range(3))


@pytest.mark.parametrize(
    "scene", ["four_bar_gravity", "bricard", "planar_slider_crank", "spatial_slider_crank"]
)
def test_null_space_keeps_velocities_on_the_constraints(scene):
    assert largest_violation_of_velocities(scene, "mpi-qr+null-space", 1e-9) < 1e-11
    _, error = measured(SCENES[scene](), "mpi-qr+null-space", [0.02, 0.05, 0.1], rtol=1e-9)
    assert error["error"] < 1e-5


def test_velocities_without_null_space_leave_the_constraints():
    found = [
        largest_violation_of_velocities("planar_slider_crank", f"mpi-qr+{m}", 1e-7)
        for m in ("null-space", "none")
    ]
    assert found[0] < 1e-11 and found[1] > 1e-8


def test_null_space_of_a_mechanism_that_drivers_prescribe():
    scene = SCENES["spatial_slider_crank_driven"]()
    _, found = measured(scene, "alf-dual+null-space", [0.005, 0.01], rtol=1e-10)
    assert found["error"] < 1e-8 and found["violation_velocity"] < 1e-9


@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_null_space_renews_its_tangents_all_along_a_turn(integrator):
    """The crank turns three times; the basis of its start would fail at a quarter of a turn."""
    scene = SCENES["planar_slider_crank"]()
    _, found = measured(scene, f"mpi-qr+null-space/{integrator}", [0.1, 0.2], rtol=1e-8)
    assert found["error"] < 1e-5


def test_ali3_is_of_order_two_and_holds_positions_and_velocities():
    steps = [4e-3, 2e-3, 1e-3, 5e-4]
    found = [measured(SWING, f"mpi-qr+none/ali3[step={h}]", [0.2, 0.4])[1] for h in steps]
    assert order_of_convergence(steps, [f["error"] for f in found]) == pytest.approx(2.0, abs=0.1)
    assert max(f["violation_position"] for f in found) < 1e-11
    assert max(f["violation_velocity"] for f in found) < 1e-10


def test_ali3_bears_redundant_rows_in_space():
    _, found = measured(SCENES["bricard"](), "ali3-p", [0.1, 0.2])
    assert found["error"] < 1e-6


def test_ali3_steps_over_singular_positions():
    _, found = measured(SCENES["four_bar"](), "mpi-qr+none/ali3[step=1e-4]", [0.1, 0.25])
    assert found["error"] < 1e-9, "the driven rhombus passes ten singular positions"


def test_ali3_says_that_its_iteration_does_not_converge():
    motion = simulate(SCENES["spatial_slider_crank"](), "mpi-qr+none/ali3[step=5e-3]", [0.2])
    assert motion.outcome.name in ("NOT_CONVERGED", "SINGULAR_MATRIX", "VIOLATION", "LEFT_MOTION")


@pytest.mark.parametrize("stabilisation", ["baumgarte", "projection", "null-space", "partitioning"])
def test_ali3_goes_without_stabilisation(stabilisation):
    with pytest.raises(MethodError, match="ali3 enforces constraints itself"):
        Method.parse(f"mpi-qr+{stabilisation}/ali3")
