"""Power of loads on an arm of 2 m that turns by 2 t + 1.5 t² rad, and the energy that springs store."""

import numpy as np

from mbref import Motion, Scene, simulate
from tests.helpers.parts import Z, hinge, slide

TIMES = np.linspace(0.0, 1.0, 7)
RATE = 2.0 + 3.0 * TIMES
ANGLE = 2.0 * TIMES + 1.5 * TIMES**2
FACTOR = {"polynomial": [1.0, -0.5]}
VALUES = 1.0 - 0.5 * TIMES
CLOSE = 1e-11  # relative error by rounding of the run's steps


def swung(*load) -> Motion:
    """Return the motion of an arm of 2 m that a driver turns about z."""
    body = {"name": "arm", "mass": 1.0, "inertia": [0.1, 0.2, 0.3], "position": [0.8, 0.0, 0.0]}
    driver = [{"joint": "A", "polynomial": [0.0, 2.0, 1.5]}]
    joints = [hinge("A", "ground", "arm", (0.0, 0.0, 0.0), Z)]
    return simulate(Scene(name="arm", body=[body], joint=joints, driver=driver, load=load), times=TIMES)


def test_springs_store_half_their_stiffness_times_the_square_of_their_stretch():
    """By the law of cosines l = √(13 - 12 sin φ) m; the springs are relaxed at 1.5 m and -20 rad."""
    ends = {"bodies": ["ground", "arm"], "points": [[0.0, 3.0, 0.0], [2.0, 0.0, 0.0]]}
    motion = swung(
        {"type": "spring", **ends, "stiffness": 8.0, "damping": 0.3, "natural_length": 1.5},
        {"type": "torsion_spring", "joint": "A", "stiffness": 4.0, "damping": 0.2, "natural_angle": -20.0},
    )
    length = np.sqrt(13.0 - 12.0 * np.sin(ANGLE))
    stored = 4.0 * (length - 1.5) ** 2, 2.0 * (ANGLE + 20.0) ** 2
    assert np.allclose(motion.load_at(0).energy, stored[0], rtol=CLOSE, atol=0)
    assert np.allclose(motion.load_at(1).energy, stored[1], rtol=CLOSE, atol=0)
    assert np.allclose(motion.potential_energy, sum(stored), rtol=CLOSE, atol=0)


def test_spring_of_a_slide_stores_half_its_stiffness_times_the_square_of_its_stretch():
    """A driver moves x = 2 t + 1.5 t² m; the spring, relaxed at -0.5 m, has 8 N/m (x + 0.5 m)² / 2."""
    block = {"name": "block", "mass": 1.0, "inertia": [0.1] * 3, "position": [0.8, 0.0, 0.0]}
    spring = {"type": "slide_spring", "joint": "S", "stiffness": 8.0, "damping": 0.3}
    joint, load = slide("S", "ground", "block", (0.0, 0.0, 0.0)), {**spring, "natural_displacement": -0.5}
    driver = [{"joint": "S", "polynomial": [0.0, 2.0, 1.5]}]
    scene = Scene(name="slide", body=[block], joint=[joint], driver=driver, load=[load])
    motion = simulate(scene, times=TIMES)
    assert np.allclose(motion.load_at(0).energy, 4.0 * (ANGLE + 0.5) ** 2, rtol=CLOSE, atol=0)
    assert np.allclose(motion.potential_energy, motion.load_at(0).energy, rtol=CLOSE, atol=0)


def test_torque_of_a_joint_has_the_power_torque_times_rate_and_stores_no_energy():
    """The torque is 2 (1 - 0.5 t) N m, its power P = 2 (1 - 0.5 t) φ' W."""
    torque = swung({"type": "joint_torque", "joint": "A", "torque": 2.0, "factor": FACTOR}).load_at(0)
    assert np.allclose(torque.power, 2.0 * VALUES * RATE, rtol=CLOSE, atol=0) and torque.energy is None
