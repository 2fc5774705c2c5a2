"""Relations of the suite / starts of changed scenes by Gauss's principle, and numbers worked out by hand.

The judge computes the start of the changed scene anew: poses, velocities, accelerations and reactions are
those that the relation expects from the start of the scene itself.
"""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.conformance.relations import FLIP, RELATIONS, Isometry, in_other_units
from crosscheck.conformance.trial import Outside
from crosscheck.judge.constraints import initial_poses, initial_twists, scene_length
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.joint_reactions import resultants
from crosscheck.judge.reaction_balance import with_exact_reactions
from mbref import rotations
from mbref.scene import (
    Driver,
    Factor,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Scene,
    Sine,
    SlideSpring,
    Spring,
    TorsionSpring,
)
from mbref.trajectory import Trajectory
from tests.crosscheck.driven_arm import TURN, driven_arm
from tests.crosscheck.test_first_samples_of_engines import loaded
from tests.crosscheck.tree_scenes import driven, every_joint, ring

AT_START = [name for name in RELATIONS if name not in ("restarted", "reversed")]
ONE_DRIVER = driven_arm(driver=(TURN.driver("hinge"),))
SCENES = {scene.name: scene for scene in (every_joint(), driven(), loaded(), ring("spherical"), ONE_DRIVER)}
FIELDS = ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")


def start(scene: Scene) -> Trajectory:
    """The start of a scene with its accelerations and reactions."""
    (position, orientation), (velocity, spin) = initial_poses(scene), initial_twists(scene)
    both, count = gauss(scene), len(scene.body)
    states = position, orientation, velocity, spin, both[:count], both[count:] / scene_length(scene)
    position, orientation, velocity, spin, linear, angular = (np.array(state)[None] for state in states)
    names = tuple(body.name for body in scene.body)
    made = Trajectory(
        scene.name,
        "judge",
        "",
        "",
        {},
        np.zeros(1),
        names,
        position,
        orientation,
        velocity,
        spin,
        acceleration=linear,
        angular_acceleration=angular,
    )
    return with_exact_reactions(scene, made)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("relation", AT_START)
def test_the_start_of_a_changed_scene(relation: str, name: str) -> None:
    scene = SCENES[name]
    made = start(scene)
    changed = RELATIONS[relation].change(scene, made)
    if isinstance(changed, Outside):
        pytest.skip(str(changed))
    expected, found = RELATIONS[relation].expect(scene, made), start(changed)
    if relation == "split":  # the whole bodies' motion is expected, computed from the halves
        expected, found = made, RELATIONS[relation].expect(scene, found)
    order = [found.bodies.index(body) for body in expected.bodies]
    for field in FIELDS:
        wanted, got = getattr(expected, field), getattr(found, field)[:, order]
        assert got == pytest.approx(wanted, abs=1e-8 * max(1.0, abs(wanted).max())), field
    turned = rotations.angle_between(found.orientation[:, order], expected.orientation)
    assert turned.max() < 1e-7
    if relation in ("duplicated", "satisfied", "split", "replayed", "relabelled"):
        return
    if relation in ("swapped", "reordered") or not scene.counts().redundant:
        for joint, wrench in expected.reactions.items():
            if scene.counts().redundant:
                continue
            size = max(abs(w[:, :3]).max() for w in expected.reactions.values())
            turning = max(abs(w[:, 3:]).max() for w in expected.reactions.values())
            assert found.reactions[joint][:, :3] == pytest.approx(wrench[:, :3], abs=1e-7 * size), joint
            assert found.reactions[joint][:, 3:] == pytest.approx(wrench[:, 3:], abs=1e-7 * turning), joint
    elif relation in ("rotated", "enlarged"):
        assert resultants(changed, found, np.array([0])) == pytest.approx(
            resultants(changed, expected, np.array([0])), rel=1e-6, abs=1e-6
        )


# --- numbers ----------------------------------------------------------------------------------------------
def test_a_mirror_and_a_shift_by_hand():
    """The mirror x → -x and then a shift by (1, 2, 3): axial vectors keep their x component."""
    mirror = Isometry(np.diag([-1.0, 1.0, 1.0]), np.array([1.0, 2.0, 3.0]))
    assert mirror.place([2.0, 3.0, 4.0]).tolist() == [-1.0, 5.0, 7.0]
    assert mirror.polar([2.0, 3.0, 4.0]).tolist() == [-2.0, 3.0, 4.0]
    assert mirror.axial([2.0, 3.0, 4.0]) == pytest.approx([2.0, -3.0, -4.0])
    inertia = np.array([[1.0, 0.2, 0.3], [0.2, 2.0, 0.4], [0.3, 0.4, 3.0]])
    assert mirror.inertia(inertia).tolist() == [[1.0, -0.2, 0.3], [-0.2, 2.0, -0.4], [0.3, -0.4, 3.0]]
    assert mirror.inertia((1.0, 2.0, 3.0)).tolist() == [1.0, 2.0, 3.0]
    quaternion = rotations.from_vector(np.array([0.4, -0.7, 0.2]))
    turned = rotations.to_matrix(mirror.turn(quaternion))
    assert turned == pytest.approx(np.diag([-1.0, 1.0, 1.0]) @ rotations.to_matrix(quaternion) @ FLIP)
    turn = Isometry(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
    assert turn.axial([2.0, 3.0, 4.0]) == pytest.approx([-3.0, 2.0, 4.0])
    assert turn.inertia(inertia) is inertia or turn.inertia(inertia).tolist() == inertia.tolist()


LENGTH, TIME = 3.0, 2.0


@pytest.fixture(scope="module")
def large() -> Scene:
    """`loaded` three times as large and twice as slow, with further loads and drivers."""
    scene = loaded()
    wave = Sine(amplitude=0.2, frequency=5.0, phase=0.0)
    table = ((0.0, 0.0), (0.5, 1.0), (1.0, 0.5), (1.5, 2.0))
    factor = Factor(
        polynomial=(1.0, 2.0, 3.0), sine=Sine(amplitude=0.5, frequency=4.0), start=0.25, stop=0.75
    )
    more = (
        Force(body="arm", point=(0.5, 0.1, 0.3), force=(1.0, 2.0, 4.0), factor=factor),
        Moment(body="puck", moment=(1.0, -2.0, 3.0), factor=Factor(table=table)),
    )
    drivers = (
        Driver(joint="A", polynomial=(0.0, 1.0, 6.0), sine=wave),
        Driver(joint="C", polynomial=(0.0, 1.0, 6.0), sine=wave),
    )
    return in_other_units(scene.with_(load=(*scene.load, *more), driver=drivers), LENGTH, TIME)


def test_loads_in_other_units(large):
    """Forces times 3/4, moments times 9/4; stiffnesses in N/m over 4, in N m times 9/4; dampings alike."""
    twist, torque, slide, push, spring, force, moment = large.load
    assert isinstance(twist, TorsionSpring) and twist.natural_angle == 0.4
    assert (twist.stiffness, twist.damping) == pytest.approx((4.0 * 9 / 4, 0.3 * 9 / 2))
    assert isinstance(torque, JointTorque) and torque.torque == pytest.approx(0.7 * 9 / 4)
    assert isinstance(slide, SlideSpring) and slide.natural_displacement == pytest.approx(-0.3)
    assert (slide.stiffness, slide.damping) == pytest.approx((10.0, 0.4))
    assert isinstance(push, JointForce) and push.force == pytest.approx(-3.75)
    assert isinstance(spring, Spring) and spring.natural_length == 3.0
    assert (spring.stiffness, spring.damping) == pytest.approx((7.5, 0.25))
    assert np.array(spring.points) == pytest.approx(3 * np.array(((0.3, 1.4, 0.1), (-0.7, 0.3, 0.2))))
    assert force.force == pytest.approx((0.75, 1.5, 3.0)) and force.point == pytest.approx((1.5, 0.3, 0.9))
    assert moment.moment == pytest.approx((9 / 4, -18 / 4, 27 / 4))


def test_functions_of_time_in_other_units(large):
    """Factors keep their values at twice the time; a displacement is three times as large."""
    factor, table = large.load[5].factor, large.load[6].factor
    assert factor.polynomial == pytest.approx((1.0, 1.0, 0.75)) and (factor.start, factor.stop) == (0.5, 1.5)
    assert (factor.sine.amplitude, factor.sine.frequency) == (0.5, 2.0)
    assert np.array(table.table) == pytest.approx(np.array([(0, 0), (1, 1), (2, 0.5), (3, 2)]))
    turning, sliding = large.driver
    assert turning.polynomial == pytest.approx((0.0, 0.5, 1.5)) and turning.sine.amplitude == 0.2
    assert sliding.polynomial == pytest.approx((0.0, 1.5, 4.5))
    assert (sliding.sine.amplitude, sliding.sine.frequency) == pytest.approx((0.6, 2.5))
