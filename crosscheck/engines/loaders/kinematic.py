"""Readers of URDF without dynamics: yourdfpy and urchin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.loader import URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    SCALAR,
    TRANSLATIONAL,
    WORLD,
    Body,
    Coupling,
    Joint,
    Machine,
    Statics,
    Vector,
    coefficients,
    vector,
)
from crosscheck.engines.loaders.placing import of_matrix
from crosscheck.engines.loaders.posed import Pose

TYPES = {
    "revolute": REVOLUTE,
    "continuous": REVOLUTE,
    "prismatic": TRANSLATIONAL,
    "fixed": FIXED,
    "floating": "free",
    "planar": "planar",
}
NUDGE = 1e-4  # rad or m, displacement from which the motion per unit of a coordinate is measured
NONE = np.zeros((3, 3))


class Yourdfpy(Loader):
    """yourdfpy without meshes."""

    name = "yourdfpy"
    package = "yourdfpy"
    version = "0.0.60"
    formats = (URDF,)

    def load(self, path: Path, form: str) -> Loaded:
        """Read the file."""
        import yourdfpy

        found = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
        return OfYourdfpy(found.robot.links, found.robot.joints, found)


class Urchin(Loader):
    """urchin without meshes."""

    name = "urchin"
    package = "urchin"
    version = "0.0.30"
    formats = (URDF,)

    def load(self, path: Path, form: str) -> Loaded:
        """Read the file."""
        import urchin

        found = urchin.URDF.load(str(path), lazy_load_meshes=True)
        return OfUrchin(found.links, found.joints, found)


class Kinematic(Loaded):
    """Links and joints of a URDF, placed by the library's own forward kinematics."""

    def __init__(self, links: Any, joints: Any, robot: Any):
        self.links, self.joints, self.robot = list(links), list(joints), robot
        self.kinds = {j.name: str(getattr(j, "type", None) or j.joint_type) for j in self.joints}

    def places(self, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Return the matrix (4, 4) of each link at the coordinates of joints."""
        raise NotImplementedError

    def machine(self) -> Machine:
        self.followers = {j.name for j in self.joints if j.mimic is not None}
        roots = [link.name for link in self.links if link.name not in {j.child for j in self.joints}]
        self.start = self._composed(roots)
        return Machine(
            bodies=tuple(map(self._body, self.links)),
            joints=(*(Joint(f"{n} fixed", FIXED, (WORLD, n)) for n in roots), *map(self._joint, self.joints)),
            couplings=tuple(
                Coupling(j.name, j.name, j.mimic.joint, coefficients(j.mimic.offset or 0.0, _ratio(j.mimic)))
                for j in self.joints
                if j.mimic is not None
            ),
        )

    def _composed(self, roots: list[str]) -> dict[str, np.ndarray]:
        """Return the matrix of each link where all coordinates are 0, from the origins of joints; the
        library moves followers away from 0."""
        found, waiting = {name: np.eye(4) for name in roots}, list(self.joints)
        while ready := [joint for joint in waiting if joint.parent in found]:
            for joint in ready:
                found[joint.child] = found[joint.parent] @ np.array(joint.origin)
                waiting.remove(joint)
        return found

    def _body(self, link: Any) -> Body:
        at, inertial = of_matrix(self.start[link.name]), link.inertial
        if inertial is None or inertial.mass is None:
            return at.body(link.name, 0.0, np.zeros(3), NONE)
        own = at.then(of_matrix(inertial.origin if inertial.origin is not None else np.eye(4)))
        inertia = inertial.inertia if inertial.inertia is not None else NONE
        return own.body(link.name, inertial.mass, np.zeros(3), inertia)

    def _joint(self, joint: Any) -> Joint:
        kind, pair = TYPES[self.kinds[joint.name]], (joint.parent, joint.child)
        at = of_matrix(self.start[joint.child])
        if kind in (FIXED, "free"):
            return Joint(joint.name, kind, pair, vector(at.position))
        given = joint.axis if joint.axis is not None else [1.0, 0.0, 0.0]
        if kind == "planar":
            return Joint(joint.name, kind, pair, vector(at.position), at.direction(given))
        axis = at.direction(given) if joint.name in self.followers else self._motion(joint, kind)
        dynamics, limit = joint.dynamics, joint.limit
        ends: dict[str, Any] = {"lower": -math.inf, "upper": math.inf}
        if limit is not None and self.kinds[joint.name] != "continuous":
            ends = {"lower": float(limit.lower or 0.0), "upper": float(limit.upper or 0.0)}
        return Joint(
            joint.name,
            kind,
            pair,
            vector(at.position),
            axis,
            damping=coefficients((dynamics.damping if dynamics else None) or 0.0),
            friction=float((dynamics.friction if dynamics else None) or 0.0),
            **ends,
        )

    def _motion(self, joint: Any, kind: str) -> Vector:
        """Return the motion of the child per unit of the coordinate, from a small displacement."""
        before, after = (self.places({joint.name: value})[joint.child] for value in (0.0, NUDGE))
        if kind == TRANSLATIONAL:
            return vector((after[:3, 3] - before[:3, 3]) / NUDGE)
        turn = after[:3, :3] @ before[:3, :3].T
        skew = (turn - turn.T) / 2
        return vector(np.array([skew[2, 1], skew[0, 2], skew[1, 0]]) / math.sin(NUDGE))

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        places = self.places(pose)
        names = [n for n, kind in self.kinds.items() if TYPES[kind] in SCALAR and n not in self.followers]
        centres = {}
        for link in self.links:
            inertial = link.inertial
            local = np.zeros(3) if inertial is None or inertial.origin is None else inertial.origin[:3, 3]
            centres[link.name] = of_matrix(places[link.name]).point(local)
        return Statics(tuple(names), None, None, centres)


def _ratio(mimic: Any) -> float:
    return 1.0 if mimic.multiplier is None else float(mimic.multiplier)


class OfYourdfpy(Kinematic):
    """A robot of yourdfpy."""

    def places(self, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        names = list(self.robot.actuated_joint_names)
        self.robot.update_cfg({name: values.get(name, 0.0) for name in names})
        return {link.name: np.array(self.robot.get_transform(link.name)) for link in self.links}


class OfUrchin(Kinematic):
    """A robot of urchin."""

    def places(self, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        own = {j.name: values.get(j.name, 0.0) for j in self.robot.actuated_joints}
        found = self.robot.link_fk(cfg={n: v for n, v in own.items() if n not in self.followers})
        return {link.name: np.array(place) for link, place in found.items()}
