"""mbref against the truths: trajectories, first accelerations, singular positions, multipliers."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from tests.crosscheck.measured import MARGIN, ROUNDING, relative_error

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

RTOLS = (1e-5, 1e-7, 1e-9, 1e-11)
CROSSINGS = {  # scene: end time (s), beyond singular positions, and the measured error at every rtol
    "four_bar": (0.2, (ROUNDING,) * 4),
    "four_bar_straight": (0.1, (ROUNDING,) * 4),
    "five_bar": (0.1, (ROUNDING,) * 4),
    "four_bar_gravity": (1.0, (5.7e-7, 3.6e-8, 4.7e-11, 2.7e-13)),
    "planar_slider_crank_equal": (0.2, (9.1e-6, 2.3e-8, 7.1e-10, 1.1e-12)),
    "planar_slider_crank_heavy": (20.0, (3.3e-5, 1.5e-7, 2.8e-9, 1.9e-11)),  # 61 of them
}


ACROSS = [
    (name, end, "taylor", rtol, error)
    for name, (end, errors) in CROSSINGS.items()
    for rtol, error in zip(RTOLS, errors, strict=True)
]


def run_of(scene, end, method, rtol):
    return simulate(scene, method, np.linspace(0.0, end, 6), Limits(rtol=rtol))


@pytest.mark.parametrize(("name", "end", "method", "rtol", "measured"), [*RUNS, *ACROSS])
def test_method_stays_within_its_measured_error_of_the_truth(name, end, method, rtol, measured):
    """RUNS has measured errors (of the length, or rad), CROSSINGS the errors of `taylor` after singular
    positions. A run may have ten times its measured error."""
    error = relative_error(run_of(SCENES[name](), end, method, rtol), SCENES[name]())
    assert error < MARGIN * measured, f"{name}, {method}: error {error:.2e}, measured {measured:.1e}"


def test_partitioning_keeps_the_constraints_at_a_loose_tolerance():
    """At rtol 1e-5 the error is above 1e-9; the violation, which Newton's method removes in each step, is
    below 1e-12. Both over the scene's length."""
    scene = SCENES["spatial_slider_crank"]()
    run = run_of(scene, 0.02, "lm1+partitioning", 1e-5)
    assert relative_error(run, scene) > 1e-9 and measure(scene, run)["violation_position"] < 1e-12
