"""Metrics against trajectories whose faults were put in by hand."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.energy import energy_drift, energy_series
from crosscheck.judge.metrics import cost_at_error, measure, order_of_convergence
from crosscheck.judge.truth import NoSolution, truth_for
from mbref.motions.trajectory import Trajectory
from mbref.scene import Moment
from mbref.scenes import SCENES
from tests.helpers.changed_scenes import bumped
from tests.helpers.measured import MARGIN
from tests.helpers.truth_scenes import SPRUNG, free, pendulum

SCENE = SCENES["planar_slider_crank_gravity"]()
TRUTH = truth_for(SCENE)
EXACT = TRUTH.poses(np.linspace(0, 0.2, 21))


def test_work_of_a_moment_across_the_turning_axis_is_its_power_integrated():
    """Energy minus work is constant. The judge integrates the moment's power by a cubic spline through the
    samples: of the true motion this error alone remains. It falls with the fourth power of the distance of
    samples (orders within 0.3 of 4); 3.7e-10 of the energy were measured at 160 intervals."""
    scene = pendulum(gravity=(0.0, -9.81, 0.0), load=(Moment(body="bar", moment=(1.0, 0.0, 2.5)),))
    truth = truth_for(scene)
    drifts = [energy_series(scene, truth.poses(np.linspace(0, 1, n + 1))).max() for n in (40, 80, 160)]
    orders = [math.log2(a / b) for a, b in itertools.pairwise(drifts)]
    assert drifts[-1] < MARGIN * 3.7e-10, f"drifts {drifts}"
    assert orders == pytest.approx([4.0, 4.0], abs=0.3), f"orders {orders}"


def test_work_of_a_moment_on_a_free_body_is_its_power_integrated():
    """Energy minus work is constant up to the quadrature of the true motion's power, 1.6e-12 measured."""
    scene = free(load=(Moment(body="body", moment=(1.0, -2.0, 0.5)),))
    drift = energy_series(scene, truth_for(scene).poses(np.linspace(0, 1, 401))).max()
    assert drift < MARGIN * 1.6e-12, f"energy drifts by {drift}"


def test_energy_error_is_none_if_bodies_turn_several_times_between_samples():
    """The crank reaches 974 rad/s. Samples 50 ms apart, in which it makes up to four turns, leave the work of
    its moment unknown. At samples 1 ms apart the truth's energy error is rounding, 5.2e-16 measured."""
    scene = SCENES["planar_slider_crank"]()
    sparse, dense = (truth_for(scene).poses(np.linspace(0, 0.4, count)) for count in (9, 401))
    assert measure(scene, sparse)["energy_error"] is None
    assert measure(scene, dense)["energy_error"] < MARGIN * 5.2e-16


@pytest.mark.parametrize(
    ("name", "without"), [("four_bar", 0.0), ("spatial_slider_crank_driven", 1.0)], ids=["rhombus", "crank"]
)
def test_energy_error_is_none_for_a_driven_scene(name, without):
    """The work of the driver is unknown. By the scene without driver the motion of the rhombus keeps its
    energy: its speed is constant, and given to the bodies. No velocity is given to the bodies of the crank:
    without driver they start at rest, and the motion has gained all of its energy, 1."""
    scene = SCENES[name]()
    motion = truth_for(scene).poses(np.linspace(0, 0.1, 41))
    assert measure(scene, motion)["energy_error"] is None
    assert measure(scene.with_(driver=()), motion)["energy_error"] == pytest.approx(without, abs=1e-13)


def test_energy_error_is_none_for_a_damped_scene():
    """The work of the damper is unknown. By the scene without damper the energy of the motion drifts by this
    work, ∫ c l'² dt with c = 1 N s/m; l is the distance of the spring's end on the block from the origin."""
    scene = SPRUNG["block_spring"]
    damped = scene.with_(load=(scene.load[0].model_copy(update={"damping": 1.0}),))
    motion = truth_for(damped).poses(np.linspace(0, 1, 101))
    assert measure(damped, motion)["energy_error"] is None
    end = motion.position[:, 0] + [0.5, 0.0, 0.0]
    rate = (end * motion.velocity[:, 0]).sum(axis=1) / np.linalg.norm(end, axis=1)
    work = CubicSpline(motion.times, rate**2).antiderivative()(motion.times)
    assert energy_drift(scene, motion) == pytest.approx(work, abs=1e-6 * work[-1])  # the spline's error


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_states_that_are_not_finite_have_infinite_errors(value):
    """One position of the last sample is NaN or infinite; no metric is NaN."""
    lost = replace(EXACT, position=bumped(EXACT.position, 20, 1, value), acceleration=None)
    found = measure(SCENE, lost, TRUTH)
    assert found["error"] == found["violation_position"] == found["energy_error"] == math.inf, found
    assert found["violation_acceleration"] is None and found["scd"] is None, found
    assert not any(v is not None and math.isnan(v) for v in found.values()), found


def test_only_metrics_of_the_error_and_of_impacts_are_none_without_a_truth():
    """Violations and energy error follow from the run and the scene alone, which has no intervals."""
    found = measure(SCENE, EXACT)
    missing = {name for name, value in found.items() if value is None}
    errors = {f"{quantity}_error" for quantity in ("position", "rotation", "velocity", "reaction")}
    impacts = {"event_time_error", "impact_error", "impulse_error", "impact_energy_error"}
    assert missing == {"error", "error_bound", "error_until", "scd", *errors, *impacts}, missing


def test_metrics_do_not_depend_on_the_order_of_bodies():
    """The run's bodies are listed in another order than the scene's; sums differ by rounding."""
    order = [2, 0, 1]
    keys = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
    arrays = {key: getattr(EXACT, key)[:, order] for key in keys}
    shuffled = replace(EXACT, bodies=tuple(EXACT.bodies[i] for i in order), **arrays)
    assert measure(SCENE, shuffled, TRUTH) == pytest.approx(measure(SCENE, EXACT, TRUTH), abs=1e-14)


def test_run_of_a_body_that_the_scene_lacks_is_refused():
    """The run has a body "other" in place of the slider; the error names it."""
    with pytest.raises(ValueError, match="'other'"):
        measure(SCENE, replace(EXACT, bodies=("crank", "rod", "other")), TRUTH)


@pytest.mark.parametrize("order", [0.75, 1, 2, 4, 8])
def test_order_of_convergence_is_the_power_put_in_above_a_floor(order):
    """Errors are 3 h^p, with 10 % scatter that moves the order by less than 0.1, and a floor of 1e-13."""
    steps = 0.5 / 2.0 ** np.arange(12)
    scatter = 1 + 0.1 * np.sin(7 * np.arange(12))
    errors = np.maximum(3 * steps**order * scatter, 1e-13)
    errors[0] = 0.9  # not yet asymptotic
    got = order_of_convergence(steps[::-1], errors[::-1])
    assert got == pytest.approx(order, abs=0.1), f"put in {order}, measured {got}"


@pytest.mark.parametrize(
    "errors",
    [[1e-2, 1e-3], [1e-13, 2e-13, 1e-13, 1.5e-13], [1e-2, 1e-7, 1e-3, 1e-9], [math.inf, math.nan, 0.0]],
    ids=["two runs", "rounding", "scatter", "no finite error"],
)
def test_errors_that_follow_no_power_have_no_order_of_convergence(errors):
    """None stands for no order. Errors that fall by 10 with each halved step have one, log₂ 10."""
    assert order_of_convergence([0.1, 0.05, 0.025], [1e-2, 1e-3, 1e-4]) == pytest.approx(math.log2(10))
    assert order_of_convergence([0.1, 0.05, 0.025, 0.0125][: len(errors)], errors) is None


COSTS, ERRORS = [1.0, 10.0, 100.0, 50.0], [1e-2, 1e-4, 1e-6, 1e-3]  # error = 1e-2 / cost², but the last


@pytest.mark.parametrize(
    ("costs", "errors", "level", "cost"),
    [
        *((COSTS, ERRORS, level, cost) for level, cost in ((1e-5, 10**1.5), (0.5, 1.0), (1e-7, None))),
        ([1.0, 2.0], [0.5, math.inf], 1.0, 1.0),
        ([1.0, 2.0], [math.nan, math.inf], 1.0, None),
    ],
    ids=["between two runs", "above all errors", "below all errors", "one finite error", "no finite error"],
)
def test_cost_at_an_error_is_read_on_the_lower_envelope_of_the_runs(costs, errors, level, cost):
    """On the envelope of COSTS the error is 1e-2 / cost²; None where no run has so small an error."""
    assert cost_at_error(costs, errors, level) == pytest.approx(cost)


def test_energy_error_is_none_for_a_mechanism_at_rest():
    """A bar that hangs at rest has only rounding, of 1e-16 m and m/s, as energy and as change of energy; one
    that moves at 1 m/s has gained all of its energy."""
    scene = pendulum(gravity=(0.0, -9.81, 0.0))
    times = np.linspace(0.0, 1.0, 5)
    noise = 1e-16 * np.random.default_rng(0).standard_normal((5, 1, 3))
    places, turns = scene.body[0].position + noise, np.tile([1.0, 0.0, 0.0, 0.0], (5, 1, 1))
    rest = Trajectory("rest", "e", "1", "m", {}, times, ("bar",), places, turns, noise, noise)
    assert energy_series(scene, rest) is None
    assert energy_series(scene, replace(rest, velocity=noise + 1.0)) == pytest.approx(np.ones(5))


def test_error_of_a_run_that_outlasts_the_truth_is_measured_to_the_end_of_the_truth():
    """Positions are off by a vector of 13 mm: at sample 15, behind the truth's end at 0.1 s (sample 10), it
    is no error, and at sample 7 it is. Violations need no truth: they are measured over the whole run."""

    class Ending:
        """TRUTH, known up to 0.1 s."""

        name, accuracy = "ending", TRUTH.accuracy

        def poses(self, times):
            if times.max() > 0.1:
                raise NoSolution("it ends", 0.1)
            return TRUTH.poses(times)

    shift = np.array([0.003, -0.004, 0.012])
    late = measure(SCENE, replace(EXACT, position=bumped(EXACT.position, 15, 0, shift)), Ending())
    early = measure(SCENE, replace(EXACT, position=bumped(EXACT.position, 7, 0, shift)), Ending())
    assert late["error"] < 1e-15 and late["velocity_error"] == 0 and late["error_until"] == EXACT.times[10]
    assert early["error"] == pytest.approx(0.013 / scene_length(SCENE), rel=1e-12)
    assert late["violation_position"] > 1e-3
