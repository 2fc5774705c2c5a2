"""Gauss's principle: initial accelerations / the truths' second derivatives, and a free body's by hand."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.conformance.closed_forms import free_fall, oscillator, torsion
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_principle import gauss, singular_values, stacked
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.truth import truth_for
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.crosscheck.measured import MARGIN

MEASURED = 3.2e-14  # of the largest acceleration

CASES = {
    **{make.__name__: make()[0] for make in (free_fall, oscillator, torsion)},
    **{name: SCENES[name]() for name in ("spatial_slider_crank_gravity", "planar_slider_crank_gravity")},
    "driven": SCENES["spatial_slider_crank_driven"](),
    "four_bar_gravity": SCENES["four_bar_gravity"](),
}


@pytest.mark.parametrize("name", CASES)
def test_gauss_and_truth(name):
    scene: Scene = CASES[name]
    truth = truth_for(scene)
    assert truth is not None
    exact = stacked(scene, truth.poses(np.array([0.0, 1e-3])), 0)
    off = np.abs(gauss(scene) - exact).max() / np.abs(exact).max()
    assert off < MARGIN * MEASURED, f"{name}: relative difference {off:.2e} from {truth.name}"


@pytest.mark.parametrize("name", ["point_pendulum", "bricard_thin"])
def test_bodies_without_moment_of_inertia(name):
    """The report of these published problems ended with an error of the Cholesky factorisation."""
    scene = SCENES[name]()
    motion = natural_motion(scene, [0.0], EXTENDED, seconds=100.0)
    angular = scene_length(scene) * motion.angular_acceleration[0]
    exact = doubles(np.concatenate([motion.acceleration[0], angular]))
    assert np.abs(gauss(scene) - exact).max() < 1e-12 * np.abs(exact).max()


def test_torsion_spring_between_two_moving_bodies_and_the_ground():
    """The moment on the second body is the spring's, the first gets its opposite."""
    scene, _ = torsion()
    flipped = scene.joint[0].model_copy(update={"bodies": ("body", "ground")})
    turned = scene.load[0].model_copy(update={"natural_angle": -scene.load[0].natural_angle})
    same = scene.with_(joint=(flipped,), load=(turned,))
    off = np.abs(gauss(same) - gauss(scene)).max()
    assert off < 1e-12, f"the spring seen from its other body differs by {off:.2e} m/s²"


def test_distance_from_singular_and_rank_of_the_rhombus():
    """The straight rhombus lacks one more rank than the quarter-turned one, whose least value is far off."""
    straight, quarter = (singular_values(SCENES[n]()) for n in ("four_bar_straight", "four_bar_quarter"))
    zeros = [int(np.sum(values < 1e-12)) for values in (straight, quarter)]
    assert zeros[0] == zeros[1] + 1, f"{zeros[0]} and {zeros[1]} zero singular values: {straight}, {quarter}"
    assert quarter[-1 - zeros[1]] > 1e-2, f"least above rank {quarter[-1 - zeros[1]]:.1e}"
