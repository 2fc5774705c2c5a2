"""Kinematic analysis against the closed forms, and the correction of perturbed starts."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref.equations.degrees_of_freedom import undriven_freedoms
from mbref.equations.initial_state import solve_positions
from mbref.equations.model import Model, displaced
from mbref.integrators.predictor import LARGEST_TURN
from mbref.method import MethodError
from mbref.scene import Driver, SceneError
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate

# ends (s) before the first singular position, where a kinematic analysis stops
ENDS = {"four_bar": 0.012, "four_bar_quarter": 0.006, "five_bar": 0.012, "spatial_slider_crank_driven": 0.1}
DRIVEN = list(ENDS)


@pytest.mark.parametrize("name", DRIVEN)
def test_kinematic_analysis_and_truth(name):
    scene, times = SCENES[name](), np.linspace(0, ENDS[name], 7)
    trajectory = simulate(scene, "kinematic", times)
    assert trajectory.outcome.name == "COMPLETED", trajectory.message
    truth = truth_for(scene)
    measured = measure(scene, trajectory, truth)
    assert measured["error"] < 1e-13, measured
    true = truth.poses(times)
    scales = {"velocity": 124.8, "acceleration": 124.8**2}  # of the crank: rad/s, rad/s² in 0.5 m
    for key in ("velocity", "angular_velocity", "acceleration", "angular_acceleration"):
        scale = scales[key.removeprefix("angular_")]
        error = np.max(np.abs(getattr(trajectory, key) - getattr(true, key))) / scale
        assert error < 1e-9, f"{name}, {key}: relative error {error:.2e}"


@pytest.mark.parametrize("samples", (2, 31, 101))
@pytest.mark.parametrize("name", DRIVEN)
def test_kinematic_analysis_with_any_samples(name, samples):
    scene, times = SCENES[name](), np.linspace(0, ENDS[name], samples)
    trajectory = simulate(scene, "kinematic", times)
    assert trajectory.outcome.name == "COMPLETED", trajectory.message
    assert trajectory.cost.steps < max(100, 2 * samples), f"{trajectory.cost.steps} steps"
    assert measure(scene, trajectory, truth_for(scene))["error"] < 1e-12


def test_a_body_turns_by_little_in_a_step_of_a_kinematic_analysis():
    """Inside longer steps pivots would be looked at; a limit of the user's goes before the method's."""
    scene = SCENES["spatial_slider_crank_driven"]()
    steps = [
        simulate(scene, "kinematic", [0.2], Limits(largest_turn=turn)).cost.steps
        for turn in (0.0, LARGEST_TURN, 2.5)
    ]
    assert steps[0] == steps[1] > steps[2]


def test_kinematic_analysis_of_a_modelled_ground_without_masses():
    scene = SCENES["four_bar"]()
    bodies = tuple(body.model_copy(update={"mass": None, "inertia": None}) for body in scene.body)
    bare = scene.with_(body=bodies, ground="body", load=())
    start, later = simulate(bare, "kinematic", [0.0]), simulate(bare, "kinematic", [0.01])
    with_masses = simulate(scene, "kinematic", [0.01])
    assert np.abs(start.position[0] - [body.position for body in scene.body]).max() < 1e-15
    assert np.abs(later.position - with_masses.position).max() < 1e-12


@pytest.mark.parametrize("stabilisation", ("none", "baumgarte", "partitioning"))
def test_what_only_extrapolates_needs_projection(stabilisation):
    with pytest.raises(MethodError, match="predictor only extrapolates"):
        simulate(SCENES["four_bar"](), f"alf-dual+{stabilisation}/predictor", [0.1])


@pytest.mark.parametrize("rate", [-249.6, -124.8 * 1.01])
def test_drivers_that_contradict_each_other_are_named(rate):
    scene = SCENES["four_bar"]()
    drivers = (*scene.driver, Driver(joint="D", polynomial=(0.0, rate)))
    with pytest.raises(SceneError, match=r"driver\[A\]: the drivers of A, D contradict .* joint '[BC]'"):
        simulate(scene.with_(driver=drivers), "kinematic", [0.01])


@pytest.mark.parametrize("method", ["kinematic", "alf-dual+projection", "taylor"])
def test_drivers_that_agree_drive_together(method):
    scene = SCENES["four_bar"]()
    both = scene.with_(driver=(*scene.driver, Driver(joint="D", polynomial=scene.driver[0].polynomial)))
    alone, together = (simulate(s, method, [0.01]) for s in (scene, both))
    assert together.outcome.name == "COMPLETED", together.message
    assert np.abs(alone.position - together.position).max() < 1e-13


def test_freedom_without_driver_is_refused():
    with pytest.raises(SceneError, match="1 degrees of freedom"):
        simulate(SCENES["planar_slider_crank"](), "kinematic", [0.1])


def test_a_singular_start_of_a_driven_mechanism_leaves_no_freedom():
    scene = SCENES["four_bar_straight"]()
    assert scene.counts().degrees_of_freedom == 1
    assert undriven_freedoms(scene) == 0


# at the bifurcation itself the violation is quadratic in one direction, which no Newton step corrects
@pytest.mark.parametrize("name", [n for n in SCENES if n != "four_bar_straight"])
def test_perturbed_positions_are_corrected(name):
    model = Model(SCENES[name]())
    rng = np.random.default_rng(5)
    perturbed = displaced(model.start(), 1e-3 * rng.normal(size=model.n))
    before = np.max(np.abs(model.terms(0.0, perturbed, np.zeros(model.n)).phi))
    q, violations = solve_positions(model, 0.0, perturbed)
    after = np.max(np.abs(violations))
    moved = np.max(np.abs(q - perturbed))
    assert before > 1e-5, f"{name}: the perturbation violates nothing ({before:.1e})"
    assert after < 1e-10, f"{name}: a violation of {after:.1e} is left"
    assert moved < 0.1, f"{name}: corrected by {moved:.1e}, which is not near"
