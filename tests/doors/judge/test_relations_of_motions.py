"""Relations of the conformance suite hold for whole motions by the judge of the changed mechanisms."""

import functools

import numpy as np
import pytest

from crosscheck import truth_for
from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.changes.relations import RELATIONS
from crosscheck.judge.reaction_balance import balance, with_exact_reactions
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from tests.helpers.errors import turned_between
from tests.helpers.short_motions import MOTIONS

LIMIT = 60.0  # CPU s of a reference; each takes about 0.2
SCENES = (
    *("arm with universal", "arm with planar", "loop with cylindrical", "pendulum with spring with damping"),
    *("pendulum with torsion spring", "pendulum with slide spring", "pendulum with force over time"),
    *("pendulum with torque by a table", "pendulum with force of a joint that begins", "driven slide"),
    *("driven angle by a sine", "driven angle by a table", "four hinges", "small masses on distances"),
    *("rack and pinion", "screw with armature", "planet with armatures"),
)
TURNING, OVER_TIME = "pendulum with torsion spring", "pendulum with force over time"
SLIDING, BY_TABLE = "pendulum with slide spring", "pendulum with torque by a table"
QUICK = {  # relation of the conformance suite: scenes of its quick cases; all others are slow
    "rotated": (TURNING,),
    "mirrored": ("arm with universal", SLIDING, "screw with armature"),
    "scaled": ("pendulum with spring with damping",),
    "swapped": (TURNING, "driven slide"),
    **dict.fromkeys(("split", "replayed"), ("arm with planar",)),
    "enlarged": ("driven slide", OVER_TIME),
    "in millimetres": (TURNING, BY_TABLE),
    "restarted": (TURNING, SLIDING, OVER_TIME, "driven slide", BY_TABLE),
    "reversed": ("arm with universal",),
    **dict.fromkeys(("turned", "translated", "reordered", "stretched"), ("driven slide",)),
    "relabelled": ("rack and pinion",),
    "duplicated": ("planet with armatures",),
    **dict.fromkeys(("satisfied", "negated"), ("driven slide",)),
}
EACH = [(relation, scene) for relation in RELATIONS for scene in SCENES]
CASES = [pytest.param(r, s, marks=[pytest.mark.slow] * (s not in QUICK.get(r, ()))) for r, s in EACH]


def exact(scene: Scene, times: np.ndarray) -> Trajectory:
    """Return the judge's motion with reactions."""
    truth = truth_for(scene, reference_time=LIMIT)
    assert truth is not None
    return with_exact_reactions(scene, truth.poses(times))


@functools.cache
def first_motion(name: str) -> tuple[Scene, Trajectory]:
    scene = MOTIONS[name]()
    return scene, exact(scene, np.linspace(0.0, scene.duration, 5))


@functools.cache
def changed_motion(relation: str, name: str) -> tuple[Scene, Trajectory, Trajectory]:
    """Return a changed mechanism, its motion as the relation expects it, and its motion by the judge."""
    scene, motion = first_motion(name)
    changed = RELATIONS[relation].change(scene, motion)
    if isinstance(changed, Outside):
        pytest.skip(changed.reason)
    expected = RELATIONS[relation].expect(scene, motion)
    return changed, expected, exact(changed, expected.times)


@pytest.mark.parametrize(("relation", "name"), CASES)
def test_judge_moves_a_changed_mechanism_as_its_relation_expects(relation, name):
    """A relation says how the motion of a changed mechanism follows from the first motion: turned with the
    frame, mirrored, in millimetres. The judge, accurate to 1e-13, computes both motions. Differences are
    relative to the largest distance, rate and acceleration; each derivative loses a digit."""
    scene, expected, found = changed_motion(relation, name)
    order = [found.bodies.index(body) for body in expected.bodies]
    length, spin = np.abs(expected.position).max(), np.abs(expected.angular_velocity).max()
    rate = max(spin, np.abs(expected.velocity).max() / length, 1 / scene.duration)
    assert np.abs(found.position[:, order] - expected.position).max() <= 1e-12 * length
    assert turned_between(found.orientation[:, order], expected.orientation).max() <= 1e-12
    assert np.abs(found.velocity[:, order] - expected.velocity).max() <= 1e-11 * rate * length
    assert np.abs(found.angular_velocity[:, order] - expected.angular_velocity).max() <= 1e-11 * rate
    if expected.acceleration is not None:  # some relations are of poses and rates alone
        push = np.abs(expected.acceleration).max() + length * rate**2
        assert np.abs(found.acceleration[:, order] - expected.acceleration).max() <= 1e-10 * push


KEEPING = ("rotated", "mirrored", "scaled", "enlarged", "in millimetres")  # bodies and joints


@pytest.mark.parametrize(
    ("relation", "name"),
    [pytest.param(r, s, marks=[pytest.mark.slow] * (s != QUICK[r][0])) for r in KEEPING for s in SCENES],
)
def test_reactions_that_a_relation_expects_balance_the_changed_mechanism(relation, name):
    """Expected reactions satisfy Newton's and Euler's equations of every body with the judge's accelerations,
    which are exact to 1e-10; ten times this, relative to the largest force, is allowed."""
    scene, expected, found = changed_motion(relation, name)
    assert set(expected.reactions) == {joint.name for joint in scene.joint}
    assert balance(scene, expected, found) <= 1e-9


def test_reactions_on_exchanged_bodies_of_joints_are_opposite():
    """The relation expects minus the first reactions; the judge computes them of the changed scene."""
    _, expected, found = changed_motion("swapped", "pendulum with torsion spring")
    assert expected.reactions
    for joint, wrench in expected.reactions.items():
        assert np.abs(found.reactions[joint] - wrench).max() <= 1e-9 * np.abs(wrench).max(), joint
