"""Gauss's principle, integrated, gives the motions of closed forms, of SciPy and of the judge's reference."""

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.moving import moving_probes
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.metrics import violation_series
from crosscheck.judge.reference.taylor import natural_motion
from mbref.scenes import SCENES

PROBES = moving_probes()
INTEGRATED = 1e-8  # relative to the scene's length, rad or rad/s; the accuracy of `gauss_motion`


@pytest.mark.parametrize("name", ["point_pendulum", "bricard_thin"])
def test_gausss_principle_accelerates_bodies_without_moments_of_inertia_as_the_reference(name):
    """The mass matrix of such bodies is singular and has no Cholesky factor. The judge's reference has other
    equations, solved in long doubles. Differences are rounding, 1e-12 of the largest acceleration."""
    scene = SCENES[name]()
    motion = natural_motion(scene, [0.0], EXTENDED, seconds=100.0)
    angular = scene_length(scene) * motion.angular_acceleration[0]
    exact = doubles(np.concatenate([motion.acceleration[0], angular]))
    assert np.abs(gauss(scene) - exact).max() < 1e-12 * np.abs(exact).max()


def test_moving_probes_of_the_suite_begin_with_closed_joints_and_a_rotating_body():
    """Violations of positions, velocities and accelerations are below 1e-9 in every scene, and a body turns
    at more than 0.3 rad/s, so that velocity terms matter."""
    for scene in PROBES.values():
        start = gauss_motion(scene, (0.0,))
        assert max(float(violation_series(scene, start, level).max()) for level in (0, 1, 2)) < 1e-9
        assert np.linalg.norm(start.angular_velocity, axis=-1).max() > 0.3
