"""Relations of the suite / starts of changed scenes by Gauss's principle. The judge computes the start of the
changed scene anew: poses, velocities, accelerations and reactions are those that the relation expects from
the start of the scene itself."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import mbref
from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.changes.relations import RELATIONS
from crosscheck.judge.joint_reactions import resultants
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from tests.crosscheck.driven_arm import TURN, driven_arm
from tests.crosscheck.test_first_samples_of_engines import loaded
from tests.crosscheck.tree_scenes import driven, every_joint, ring
from tests.helpers.exact_motions import exact_start

# relations that change the joints, or the shares of joints in the load on a body
OTHER_REACTIONS = ("duplicated", "satisfied", "split", "replayed", "relabelled")
AT_START = [name for name in RELATIONS if name not in ("restarted", "reversed")]
ONE_DRIVER = driven_arm(driver=(TURN.driver("hinge"),))
SCENES = {scene.name: scene for scene in (every_joint(), driven(), loaded(), ring("spherical"), ONE_DRIVER)}
SOLVED = 1e-11  # of the largest value, or rad: 10 times the measured differences
FIELDS = ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")


@functools.cache
def starts(relation: str, name: str) -> tuple[Scene, Trajectory, Trajectory]:
    """The changed scene, its start as the relation expects it, and its start by Gauss's principle, with the
    bodies in the order of the expected start; the test is skipped if the relation cannot change the scene."""
    made = exact_start(SCENES[name])
    changed = RELATIONS[relation].change(SCENES[name], made)
    if isinstance(changed, Outside):
        pytest.skip(str(changed))
    expected, found = RELATIONS[relation].expect(SCENES[name], made), exact_start(changed)
    order = [found.bodies.index(body) for body in expected.bodies]
    fields = {field: getattr(found, field)[:, order] for field in (*FIELDS, "orientation")}
    return changed, expected, replace(found, bodies=expected.bodies, **fields)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("relation", AT_START)
def test_relation_predicts_poses_velocities_and_accelerations_at_the_start(relation: str, name: str) -> None:
    """Each field that the relation expects is the changed scene's own by Gauss's principle."""
    _, expected, found = starts(relation, name)
    for field in FIELDS:
        wanted, got = getattr(expected, field), getattr(found, field)
        assert got == pytest.approx(wanted, rel=0, abs=SOLVED * max(1.0, abs(wanted).max())), field
    assert rotations.angle_between(found.orientation, expected.orientation).max() < SOLVED


@pytest.mark.parametrize("name", [n for n, scene in SCENES.items() if not mbref.counts(scene).redundant])
@pytest.mark.parametrize("relation", [name for name in AT_START if name not in OTHER_REACTIONS])
def test_relation_predicts_the_reactions_of_joints_without_redundant_rows(relation: str, name: str) -> None:
    """Newton's and Euler's equations determine every joint's force and moment; limits are relative to the
    largest of the scene."""
    _, expected, found = starts(relation, name)
    for part in (slice(0, 3), slice(3, 6)):
        largest = max(abs(wrench[:, part]).max() for wrench in expected.reactions.values())
        for joint, wrench in expected.reactions.items():
            wanted = pytest.approx(wrench[:, part], rel=0, abs=SOLVED * largest)
            assert found.reactions[joint][:, part] == wanted, joint


@pytest.mark.parametrize("relation", ["rotated", "enlarged"])
def test_relation_predicts_the_resultants_of_joints_with_redundant_rows(relation: str) -> None:
    """Their reactions are undetermined, but not the sum of the reactions on each body."""
    changed, expected, found = starts(relation, "ring_spherical")
    wanted = resultants(changed, expected, np.array([0]))
    assert resultants(changed, found, [0]) == pytest.approx(wanted, rel=0, abs=SOLVED * abs(wanted).max())
