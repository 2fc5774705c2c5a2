"""Axes of a universal joint that are perpendicular to rounding, or less / one reading in all engines."""

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.judge.constraints import closure, initial_poses
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.model_identity import gate, gate_times
from crosscheck.processes.serve import run_once
from mbref.scene import Body, Scene, Universal

FIRST = np.array([1.0, 0.2, -0.3])
ACROSS = np.array([0.2, -1.0, 0.0])  # perpendicular to FIRST
ROUNDED = 1e-14  # some roundings of numbers up to 2
SETTINGS = {
    "mbref": Setting("taylor", {"rtol": 1e-9}),
    "mujoco": Setting("tuned", {"step": 1e-5, "beta": 100.0, "hard": 1e-7}),
    "pinocchio": Setting("baumgarte", {"step": 1e-5}),
    "exudyn": Setting("trapezoidal", {"step": 1e-5}),
}


def pendulum(cosine: float) -> Scene:
    """A body on a universal joint whose second axis leans by a cosine towards the first."""
    first, across = FIRST / np.linalg.norm(FIRST), ACROSS / np.linalg.norm(ACROSS)
    second = 2.0 * (across + cosine * first)
    joint = Universal(name="U", bodies=("ground", "b"), anchor=(0, 0, 0), axes=(tuple(FIRST), tuple(second)))
    body = Body(name="b", mass=1.0, inertia=(0.01, 0.02, 0.03), position=(0.3, 0.1, 0.0))
    return Scene(name="u", body=(body,), joint=(joint,), gravity=(0.0, 0.0, -9.81), duration=0.2)


@pytest.mark.parametrize("cosine", [1e-14, 1e-6, 0.04, -0.04])
def test_second_axis_of_a_universal_joint_is_made_perpendicular(cosine):
    """The second axis leans by a cosine towards the first. It loses this part and keeps its length 2; the
    first stays, and the judge finds the pose closed."""
    first, second = map(np.array, pendulum(cosine).joint[0].axes)
    assert tuple(first) == tuple(FIRST)
    assert abs(first @ second) <= ROUNDED * np.linalg.norm(first) * np.linalg.norm(second)
    assert second == pytest.approx(2.0 * ACROSS / np.linalg.norm(ACROSS), abs=ROUNDED)
    gap = closure(pendulum(cosine), np.zeros(1), *(a[None] for a in initial_poses(pendulum(cosine))))["U"]
    assert np.abs(gap).max() <= ROUNDED


@pytest.mark.parametrize("cosine", [1e-16, 0.04])
def test_second_reading_leaves_the_axes_unchanged(cosine):
    """A joint that is made from the axes of another one has them to the last bit."""
    joint = pendulum(cosine).joint[0]
    assert Universal(**dict(joint)).axes == joint.axes


@pytest.mark.parametrize("name", SETTINGS)
def test_engine_corrects_skew_axes_as_the_judge(name):
    """The axes of the universal joint lean by a cosine of 0.04. ``gate`` compares the engine's short motion
    with the judge's by Gauss's principle and finds no difference."""
    scene = pendulum(0.04)
    exact = gauss_motion(scene, tuple(gate_times(scene)))
    assert gate(scene, [exact, run_once(name, scene, gate_times(scene), SETTINGS[name])]) is None
