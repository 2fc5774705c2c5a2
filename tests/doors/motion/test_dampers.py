"""Rotational dampers, as of ball joints, and dampers of points: decay, derivatives, modes, all equations."""

import numpy as np
import pytest

import mbref
from crosscheck.conformance.initial_accelerations import PRINCIPLE, compare
from crosscheck.conformance.mechanisms.random_scenes import mechanism
from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.judge.small_motions.equilibria import steady_poses
from crosscheck.small_motions.compare import error
from mbref.scene import PointDamper, RotationalDamper, Scene
from tests.helpers.parts import joint

TIMES, C = np.linspace(0.0, 2.0, 5), 0.2  # s; N m s/rad or N s/m
TURNING = {"type": "rotational_damper", "bodies": ["a", "b"], "damping": C}
MOVING = TURNING | {"type": "point_damper", "point": [1.0, 0.0, 0.0]}
A = {"name": "a", "mass": 2.0, "inertia": [0.4] * 3, "position": [0.0, 0.0, 0.0]}
B = {"name": "b", "mass": 3.0, "inertia": [0.3] * 3, "position": [1.0, 0.0, 0.0]}
TURN = [A | {"angular_velocity": [0.3, -0.5, 1.0]}, B | {"angular_velocity": [-1.0, 0.4, 2.0]}]
MOVE = [A | {"velocity": [0.7, 0.0, 0.0]}, B | {"velocity": [-0.2, 0.0, 0.0]}]
BALLS = Scene(name="turning", body=TURN, load=[TURNING]), Scene(name="moving", body=MOVE, load=[MOVING])


@pytest.mark.parametrize("method", ["taylor", "alf-dual+projection/dop853"])
@pytest.mark.parametrize(("scene", "m", "n"), [(BALLS[0], 0.4, 0.3), (BALLS[1], 2.0, 3.0)])
def test_relative_motion_of_two_balls_decays_exponentially(scene, m, n, method):
    """Velocities u₁, u₂ along the line of the centres have a constant mean (m u₁ + n u₂) / (m + n), and
    u₂ - u₁ falls as exp(-c (1/m + 1/n) t), so that du₂/dc = -t (u₂ - u₁) / n. So do angular velocities of
    balls, whose moments are m and n. The power is -c (u₂ - u₁)²."""
    motion = mbref.simulate(scene, times=TIMES, method=method, rtol=1e-13)
    first, second = (np.hstack([motion[b].velocity, motion[b].angular_velocity]) for b in "ab")
    apart = np.exp(-C * (1 / m + 1 / n) * TIMES)[:, None] * (second - first)[0]
    assert np.allclose(second - first, apart, rtol=0, atol=1e-11)
    assert np.allclose(m * first + n * second, m * first[0] + n * second[0], rtol=0, atol=1e-11)
    assert np.allclose(motion.load_at(0).power, -C * (apart**2).sum(axis=1), rtol=0, atol=1e-11)
    found = mbref.sensitivities(scene, ["b.velocity", "b.angular_velocity"], ["load[0].damping"], TIMES)
    assert np.allclose(found.values[:, :, 0], -TIMES[:, None] * apart / n, rtol=0, atol=1e-11)


def test_a_damped_pendulum_on_a_ball_joint_has_the_eigenvalues_of_its_closed_form():
    """It swings both ways by I s² + c s + m g l = 0 and spins by I₃ s² + c s = 0, for mbref and the judge."""
    body = {"name": "b", "mass": 2.0, "inertia": [0.1, 0.1, 0.05], "position": [0.0, 0.0, -0.5]}
    ball, damper = joint("S", "spherical", "ground", "b"), TURNING | {"bodies": ["b", "ground"]}
    scene = Scene(name="pendulum", gravity=(0.0, 0.0, -9.81), body=[body], joint=[ball], load=[damper])
    swing = np.roots([0.1 + 2.0 * 0.5**2, C, 2.0 * 9.81 * 0.5])
    [mine], [theirs] = mbref.equilibria(scene, starts=1), steady_poses(scene, starts=1)
    for found in (mine, theirs):
        assert error(found.eigenvalues, np.array([*swing, *swing, -C / 0.05, 0.0])) < 1e-11


def test_random_mechanisms_with_dampers_between_moving_bodies_move_alike_by_all_equations():
    """mbref, Gauss's principle and both formulations of the judge differ by rounding."""
    for seed in (0, 2, 9):
        scene, rng = mechanism(seed), np.random.default_rng(seed)
        pairs = [rng.permutation([body.name for body in scene.body])[:2].tolist() for _ in range(2)]
        loads = [RotationalDamper(bodies=ends, damping=0.3) for ends in pairs]
        loads += [PointDamper(bodies=ends, point=(0.3, -0.2, 0.5), damping=2.0) for ends in pairs]
        scene, times = scene.with_(load=[*scene.load, *loads]), np.array([0.0, scene.duration])
        assert compare(scene, ()).errors[PRINCIPLE] < 1e-10
        one, other = natural_motion(scene, times, DOUBLE), tree_motion(scene, times, DOUBLE, seconds=60.0)
        for motion in (other, mbref.simulate(scene, times=times)):
            assert np.abs(one.position - motion.position).max() < 1e-12
