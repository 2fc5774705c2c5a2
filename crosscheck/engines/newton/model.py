"""A scene's tree as a model of Newton: a body for every link, the joints of the tree in articulations
and a joint outside them for every closure.

Every body frame has the link's origin and world-aligned axes at t = 0. Newton's velocities are of the centre
of mass, and angular, in the world; its numbers are in single precision.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engines.shared.initial_velocities import initial_rates, twist_maps
from crosscheck.engines.shared.spanning_tree import (
    BALL_JOINT,
    FREE,
    GROUND_LINK,
    SLIDE,
    TURN,
    Closure,
    Mobility,
    Tree,
    mobilities,
)
from crosscheck.engines.shared.tree_reactions import LinkMotion
from mbref import rotations
from mbref.rotations import cross, unit
from mbref.scene import Scene


def imported() -> tuple[Any, Any]:
    """Return the modules warp and newton; Warp prints nothing while it compiles kernels."""
    import warp

    warp.config.log_level = warp.LOG_ERROR
    import newton

    return warp, newton


class Mechanism:
    """A scene in Newton: the ``model`` of the ``builder``, and its ``state``, which begins at t = 0."""

    def __init__(self, scene: Scene, tree: Tree):
        self.warp, self.newton = imported()
        self.scene, self.tree = scene, tree
        self.offsets = np.array([link.offset for link in tree.links])
        self.builder = builder = self.newton.ModelBuilder(gravity=scene.gravity)
        for link in tree.links:
            builder.add_link(
                xform=self._frame(link.position),
                com=link.offset.tolist(),
                inertia=self.warp.mat33(*link.inertia.ravel().tolist()),
                mass=link.mass,
            )
        with warnings.catch_warnings():  # Kamino holds two joints between two bodies (test_pairs.py)
            warnings.filterwarnings("ignore", "Adding a .* joint between parent")
            self._add_articulations(builder)
            for closure in tree.closures:
                self._close(builder, closure)
        self.model = builder.finalize(device="cpu", skip_validation_joints=True, skip_validation_inertia=True)
        self.state = self.model.state()
        self._start()

    def _frame(self, place: np.ndarray) -> Any:
        return self.warp.transform(place.tolist(), self.warp.quat_identity())

    def _add_articulations(self, builder: Any) -> None:
        """Add the joint that carries each link; links that hang from one link on the ground are one
        articulation."""
        found: list[list[int]] = []
        for k, link in enumerate(self.tree.links):
            if link.parent == GROUND_LINK:
                found.append([])
            found[-1].append(self._add_joint(builder, (link.parent, k), link.anchor, link.mobilities))
        for joints in found:
            builder.add_articulation(joints)

    def _close(self, builder: Any, closure: Closure) -> None:
        links = closure.links
        chain: tuple[Mobility, ...] = ()
        if closure.kind == "point":
            chain = (Mobility(BALL_JOINT, np.zeros(3)),)
        elif closure.kind != "weld":
            joint = self.scene.joint[closure.joint]
            axes = np.array([unit(axis) for axis in joint.directions]).reshape(-1, 3)
            backward = links[1] == GROUND_LINK  # the child of a joint of Newton is a link
            chain = mobilities(joint.facts, -axes[::-1] if backward else axes)
        pair = links if links[1] != GROUND_LINK else links[::-1]
        self._add_joint(builder, pair, closure.anchor, chain)

    def _add_joint(
        self, builder: Any, links: Sequence[int], anchor: np.ndarray, chain: Sequence[Mobility]
    ) -> int:
        """Add a joint at a point (world), which leaves a chain of motions free, between a parent (-1 for the
        ground) and a child."""
        places = [self.tree.links[k].position if k != GROUND_LINK else np.zeros(3) for k in links]
        at = {
            f"{end}_xform": self._frame(anchor - place)
            for end, place in zip(("parent", "child"), places, strict=True)
        }
        kinds = [mobility.kind for mobility in chain]
        if kinds in ([SLIDE], [TURN]):
            add = builder.add_joint_prismatic if kinds == [SLIDE] else builder.add_joint_revolute
            return add(*links, axis=tuple(chain[0].axis), **at)
        if kinds in ([], [BALL_JOINT], [FREE]):
            add = {
                "": builder.add_joint_fixed,
                BALL_JOINT: builder.add_joint_ball,
                FREE: builder.add_joint_free,
            }
            return add["".join(kinds)](parent=links[0], child=links[1], **at)
        axes = {
            kind: [builder.JointDofConfig(axis=tuple(m.axis)) for m in chain if m.kind == kind]
            for kind in (SLIDE, TURN)
        }
        return builder.add_joint_d6(*links, linear_axes=axes[SLIDE], angular_axes=axes[TURN], **at)

    def _start(self) -> None:
        """Set the velocities at t = 0: of the joints in articulations, and of all bodies."""
        rates = initial_rates(self.scene, self.tree)
        of_joints = self.state.joint_qd.numpy()
        of_joints[: self.tree.nv] = rates
        for k, link in enumerate(self.tree.links):
            if link.mobilities and link.mobilities[0].kind == FREE:
                start = self.tree.starts[k]
                of_joints[start : start + 3] += cross(rates[start + 3 : start + 6], link.offset)
        self.state.joint_qd.assign(of_joints)
        twists = twist_maps(self.tree) @ rates
        twists[:, :3] += cross(twists[:, 3:], self.offsets)
        self.state.body_qd.assign(twists)

    def push(self, loads: Sequence[tuple[int, np.ndarray, np.ndarray]]) -> None:
        """Set the forces and moments on the links, from forces and moments about the origins of their
        frames."""
        wrenches, arms = np.zeros((len(self.tree.links), 6)), self._poses()[2]
        for link, force, moment in loads:
            wrenches[link, :3] += force
            wrenches[link, 3:] += moment - cross(arms[link], force)
        self.state.body_f.assign(wrenches)

    def motion(self) -> LinkMotion:
        """Return the motion of the links, without joint coordinates."""
        rotation, position, arms = self._poses()
        twists = self.state.body_qd.numpy().astype(float)
        linear, angular = twists[:, :3] - cross(twists[:, 3:], arms), twists[:, 3:]
        nothing = np.zeros(self.tree.nv)
        return LinkMotion(rotation, position, linear, angular, nothing, nothing)

    def _poses(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rotations (n, 3, 3) and origins (n, 3) of the links' frames, and the vectors (n, 3) from
        there to the centres of mass, in the world."""
        poses = self.state.body_q.numpy().astype(float)
        quaternions = np.roll(poses[:, 3:], 1, axis=1)
        rotation = rotations.to_matrix(quaternions / np.linalg.norm(quaternions, axis=1)[:, None])
        return rotation, poses[:, :3], np.einsum("nij,nj->ni", rotation, self.offsets)
