"""Freedoms of one link between its joints, that move nothing else: rods that spin about themselves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mbref import rotations
from mbref.design.along_motion import general_pose
from mbref.design.start import diagnosed_start
from mbref.equations.counts import scaled_jacobian
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.linear_algebra.least_norm import null_space
from mbref.motions.constraints import without_armatures
from mbref.scene import Scene
from mbref.scene.rolling import RollingWheel
from mbref.scenes import find_scene

FREE = 1e-9  # singular value of a link's columns of unit rows / largest one, below which it moves alone
AXIAL = 1e-6  # pitch of a screw, or distance of a joint from its axis / length of the mechanism: rounding
FEWEST_JOINTS = 2  # a link with fewer joints moves alone as the last of a chain
MOST_LINKED_ROWS = 300  # constraint rows; for more, singular values take too long


def idle_freedoms(scene: Scene | str | Path) -> list[str]:
    """Return a sentence for each link that can move while all other bodies stand still.

    The link is a body, or bodies that fixed joints weld together, with at least two other joints.  Its motion
    satisfies all rows of joints, couplings and drivers at the start and at a general pose.

    Parameters
    ----------
    scene : Scene, str or path
        The mechanism, the name of a built-in one, or a .toml file.

    Returns
    -------
    list of str
        Such as ``"rod can spin about its own axis and moves nothing else"``.
    """
    scene = find_scene(scene)
    model = Model(without_armatures(assembled(scene)))
    if not 0 < model.m <= MOST_LINKED_ROWS:
        return []
    q, general = diagnosed_start(model).q, general_pose(model)
    found = [
        _sentence(model, q, link, joints)
        for link, joints in _links(scene)
        if len(joints) >= FEWEST_JOINTS and _free_twists(model, general, link).size
    ]
    return [sentence for sentence in found if sentence]


def _links(scene: Scene) -> Iterator[tuple[list[str], list[str]]]:
    """Yield the bodies of each link with the names of its joints; fixed joints weld bodies together."""
    links = [[body.name] for body in scene.body]
    for joint in scene.joint:
        if joint.type == "fixed":
            joined = [link for link in links if set(link) & set(joint.bodies)]
            links = [link for link in links if link not in joined]
            links.append([name for link in joined for name in link])
    for link in links:
        ends = [each for each in scene.joint if each.facts.rows and len(set(each.bodies) & set(link)) == 1]
        if not any(joint.type == "fixed" for joint in ends):
            yield link, [joint.name for joint in ends]


def _free_twists(model: Model, q: np.ndarray, link: list[str]) -> np.ndarray:
    """Return twists (6, k) of a link alone, about the first body's centre: velocity over the mechanism's
    length, and angular velocity, world axes."""
    poses, moved = q.reshape(model.nb, 7), np.zeros((model.n, 6))
    centre = poses[model.index(link[0]), :3]
    for name in link:
        b = model.index(name)
        place, turn = poses[b, :3] - centre, rotations.to_matrix(poses[b, 3:])
        moved[6 * b : 6 * b + 3, :3] = np.eye(3)
        moved[6 * b : 6 * b + 3, 3:] = np.cross(np.eye(3), place / model.length).T
        moved[6 * b + 3 : 6 * b + 6, 3:] = turn.T
    return null_space(scaled_jacobian(model, 0.0, q) @ moved, FREE)


def _sentence(model: Model, q: np.ndarray, link: list[str], joints: list[str]) -> str:
    """Return how a link moves alone at coordinates q (7 nb,)."""
    twists, names = _free_twists(model, q, link), " and ".join(link)
    verb = "moves" if len(link) == 1 else "move"
    if not twists.size:
        return ""
    if twists.shape[1] > 1:
        return f"{names} can move alone in {twists.shape[1]} ways between its joints and {verb} nothing else"
    velocity, spin = np.split(twists[:, 0], 2)
    rate = float(np.linalg.norm(spin))
    treads = [each for each in map(model.scene.joint_named, joints) if isinstance(each, RollingWheel)]
    if any(np.linalg.norm(np.cross(spin, rotations.unit(each.normal))) > AXIAL * rate for each in treads):
        return f"{names} can roll and {verb} nothing else"
    if treads:
        return f"{names} can turn about the normal of a contact and {verb} nothing else"
    if rate < AXIAL:
        return f"{names} can slide between its joints and {verb} nothing else"
    if abs(velocity @ spin) > AXIAL * rate**2:
        return f"{names} can screw between its joints and {verb} nothing else"
    point = (
        np.cross(spin, velocity) / rate**2 * model.length + q.reshape(model.nb, 7)[model.index(link[0]), :3]
    )
    anchors = model.anchors(q.reshape(1, model.nb, 7))[0]
    anchors = anchors[[joint.name in joints for joint in model.scene.joint]]
    distances = np.linalg.norm(np.cross(anchors - point, spin / rate), axis=1)
    own = bool((distances < AXIAL * model.length).all())
    whose = "its" if len(link) == 1 else "their"
    about = f"{whose} own axis" if own else "an axis"
    return f"{names} can spin about {about} and {verb} nothing else"
