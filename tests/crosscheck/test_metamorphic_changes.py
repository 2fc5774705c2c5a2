"""Relations of the suite / starts of changed scenes by Gauss's principle.

The judge computes the start of the changed scene anew: poses, velocities, accelerations and reactions are
those that the relation expects from the start of the scene itself.
"""

from __future__ import annotations

import numpy as np
import pytest

import mbref
from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.changes.relations import RELATIONS
from crosscheck.judge.constraints import initial_poses, initial_twists, scene_length
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.joint_reactions import resultants
from crosscheck.judge.reaction_balance import with_exact_reactions
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from tests.crosscheck.driven_arm import TURN, driven_arm
from tests.crosscheck.test_first_samples_of_engines import loaded
from tests.crosscheck.tree_scenes import driven, every_joint, ring

# relations that change the joints, or the way in which they share their load
OTHER_REACTIONS = ("duplicated", "satisfied", "split", "replayed", "relabelled")
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
def test_relation_predicts_the_start_of_the_changed_scene(relation: str, name: str) -> None:
    """Gauss's principle gives the starts of both scenes. Redundant rows leave reactions of single joints
    undetermined: there the resultants on the bodies are compared."""
    scene = SCENES[name]
    made = start(scene)
    changed = RELATIONS[relation].change(scene, made)
    if isinstance(changed, Outside):
        pytest.skip(str(changed))
    expected, found = RELATIONS[relation].expect(scene, made), start(changed)
    order = [found.bodies.index(body) for body in expected.bodies]
    for field in FIELDS if expected.acceleration is not None else FIELDS[:3]:
        wanted, got = getattr(expected, field), getattr(found, field)[:, order]
        assert got == pytest.approx(wanted, abs=1e-8 * max(1.0, abs(wanted).max())), field
    turned = rotations.angle_between(found.orientation[:, order], expected.orientation)
    assert turned.max() < 1e-7
    if relation in OTHER_REACTIONS:
        return
    if not mbref.counts(scene).redundant:
        for joint, wrench in expected.reactions.items():
            size = max(abs(w[:, :3]).max() for w in expected.reactions.values())
            turning = max(abs(w[:, 3:]).max() for w in expected.reactions.values())
            assert found.reactions[joint][:, :3] == pytest.approx(wrench[:, :3], abs=1e-7 * size), joint
            assert found.reactions[joint][:, 3:] == pytest.approx(wrench[:, 3:], abs=1e-7 * turning), joint
    elif relation in ("rotated", "enlarged"):
        assert resultants(changed, found, np.array([0])) == pytest.approx(
            resultants(changed, expected, np.array([0])), rel=1e-6, abs=1e-6
        )
