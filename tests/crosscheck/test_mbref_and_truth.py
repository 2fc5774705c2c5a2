"""mbref against the truths: trajectories, first accelerations, singular positions, multipliers."""

import numpy as np
import pytest

import mbref
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref.formulations import FORMULATIONS
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from tests.crosscheck.measured import MARGIN, ROUNDING
from tests.crosscheck.truth_scenes import CLOSED

RUNS = [  # scene, end time (s), method, rtol, measured error
    ("planar_slider_crank", 0.4, "mpi-svd+projection", 1e-11, 1.3e-10),
    ("planar_slider_crank_gravity", 0.5, "mpi-svd+projection", 1e-11, 8.1e-13),
    ("planar_slider_crank", 0.2, "mpi-svd+partitioning", 1e-11, 9.2e-11),
    ("planar_slider_crank", 0.1, "mpi-svd+none", 1e-11, 1.7e-13),
    ("spatial_slider_crank", 0.02, "mpi-svd+projection", 1e-11, 4.6e-13),
    ("spatial_slider_crank", 0.02, "lm1+projection", 1e-11, 6.8e-13),
    ("spatial_slider_crank", 0.02, "lm1+partitioning", 1e-11, 3.3e-12),
    ("spatial_slider_crank", 0.02, "lm1+baumgarte", 1e-11, 7.4e-13),
    ("spatial_slider_crank", 0.01, "lm1+projection/rk4[step=2e-6]", 1e-11, 2e-13),
    ("spatial_slider_crank_driven", 0.1, "mpi-svd+projection", 1e-11, ROUNDING),
    ("spatial_slider_crank_driven", 0.1, "lm1+partitioning", 1e-11, 4.2e-14),
    ("four_bar", 0.012, "mpi-svd+projection", 1e-11, ROUNDING),
    ("four_bar", 0.02, "mpi-svd+partitioning", 1e-11, ROUNDING),
    ("five_bar", 0.012, "mpi-svd+projection", 1e-11, ROUNDING),
    ("five_bar", 0.02, "mpi-svd+partitioning", 1e-11, ROUNDING),
    ("four_bar_chain", 0.5, "alf-dual+projection", 1e-11, 3e-13),
    ("slider_crank_chain", 0.1, "alf-dual+projection", 1e-11, 2.2e-13),
]
FIRST = 1.1e-14  # measured error of the first accelerations, of the largest

RTOLS = (1e-5, 1e-7, 1e-9, 1e-11)
CROSSINGS = {  # scene: end time (s), beyond singular positions, and the measured error at every rtol
    "four_bar": (0.2, (ROUNDING,) * 4),
    "four_bar_straight": (0.1, (ROUNDING,) * 4),
    "five_bar": (0.1, (ROUNDING,) * 4),
    "four_bar_gravity": (1.0, (5.7e-7, 3.6e-8, 4.7e-11, 2.7e-13)),
    "planar_slider_crank_equal": (0.2, (9.1e-6, 2.3e-8, 7.1e-10, 1.1e-12)),
    "planar_slider_crank_heavy": (20.0, (3.3e-5, 1.5e-7, 2.8e-9, 1.9e-11)),  # 61 of them
}


def has_singular_mass(scene):
    """Whether a body has no inertia about some axis."""
    return any(np.min(np.linalg.eigvalsh(_matrix(body.inertia))) <= 0 for body in scene.body if body.inertia)


def _matrix(inertia):
    array = np.array(inertia)
    return np.diag(array) if array.ndim == 1 else array


def judged(name, end, method, rtol):
    scene = SCENES[name]()
    trajectory = simulate(scene, method, np.linspace(0.0, end, 6), Limits(rtol=rtol))
    assert trajectory.outcome.name == "COMPLETED", f"{name}, {method}: {trajectory.message}"
    return measure(scene, trajectory, truth_for(scene))


@pytest.mark.parametrize(("name", "end", "method", "rtol", "measured"), RUNS)
def test_method_stays_within_its_measured_error_of_the_truth(name, end, method, rtol, measured):
    """RUNS has the measured errors (of the length, or rad); 10 times as much is allowed."""
    error = judged(name, end, method, rtol)["error"]
    assert error < MARGIN * measured, f"{name}, {method}: error {error:.2e}, measured {measured:.1e}"


@pytest.mark.parametrize("name", CROSSINGS)
@pytest.mark.parametrize("rtol", RTOLS)
def test_taylor_crosses_singular_positions_within_its_measured_error(name, rtol):
    """CROSSINGS has end times behind singular positions and measured errors; 10 times as much is allowed."""
    end, errors = CROSSINGS[name]
    measured = errors[RTOLS.index(rtol)]
    error = judged(name, end, "taylor", rtol)["error"]
    assert error < MARGIN * measured, f"{name}, rtol {rtol:g}: error {error:.2e}, measured {measured:.1e}"


STARTS = [n for n in CLOSED if n != "four_bar_straight"]


def is_served(formulation, scene):
    """Whether a formulation claims the scene's redundant rows and bodies without inertia about an axis."""
    claims = FORMULATIONS[formulation]
    is_redundant = formulation == "lm1" and mbref.counts(scene).redundant
    return not is_redundant and (claims.handles_singular_mass or not has_singular_mass(scene))


@pytest.mark.parametrize(
    ("name", "formulation"), [(n, f) for n in STARTS for f in ("lm1", "mpi-svd") if is_served(f, SCENES[n]())]
)
def test_first_acceleration_is_the_truth_s(name, formulation):
    """Measured at t = 0: 1.1e-14 of the largest acceleration; 10 times as much is allowed."""
    scene = SCENES[name]()
    found = simulate(scene, f"{formulation}+none", [0.0])
    true = truth_for(scene).poses(np.zeros(1))
    for key in ("acceleration", "angular_acceleration"):
        error = np.max(np.abs(getattr(found, key) - getattr(true, key)))
        scale = max(np.max(np.abs(true.acceleration)), np.max(np.abs(true.angular_acceleration)))
        assert error < MARGIN * FIRST * scale, f"{name}, {key}: differs by {error:.2e} of {scale:.2e}"


def test_mpi_reports_the_singular_mass_matrix_of_a_point_mass():
    found = simulate(SCENES["point_pendulum"](), "mpi-svd+none", [0.0])
    assert found.outcome.name == "SINGULAR_MATRIX", found.message


def test_partitioning_keeps_the_constraints_at_a_loose_tolerance():
    """At rtol 1e-5 the error is above 1e-9 and the violation below 1e-12, both over the scene's length."""
    measured = judged("spatial_slider_crank", 0.02, "lm1+partitioning", 1e-5)
    assert measured["violation_position"] < 1e-12 and measured["error"] > 1e-9, measured


def test_baumgarte_and_projection_keep_the_violation_below_an_unstabilised_run():
    """On the driven spatial slider-crank: no stabilisation > 3 · Baumgarte > 1000 · projection."""
    scene = SCENES["spatial_slider_crank_driven"]()
    violation = {}
    for stabilisation in ("none", "baumgarte[alpha=500,beta=500]", "projection"):
        trajectory = simulate(scene, f"lm1+{stabilisation}", np.linspace(0, 0.2, 5), Limits(rtol=1e-6))
        assert trajectory.outcome.name == "COMPLETED", trajectory.message
        violation[stabilisation] = measure(scene, trajectory, None)["violation_position"]
    values = list(violation.values())
    assert values[0] > 3 * values[1] > 1e3 * values[2], violation
