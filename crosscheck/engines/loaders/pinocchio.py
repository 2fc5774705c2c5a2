"""Pinocchio's readers of URDF and MJCF, with mimics and constraints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.constrained import held
from crosscheck.engines.loaders.loader import MJCF, URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    SCALAR,
    TRANSLATIONAL,
    WORLD,
    Body,
    Coupling,
    Joint,
    Loop,
    Machine,
    Rows,
    Statics,
    Vector,
    coefficients,
    limits,
    matrix,
    vector,
)
from crosscheck.engines.loaders.placing import Place
from crosscheck.engines.loaders.posed import Pose

COMPOSITE = "composite"  # several joints of one body
TYPES = {  # beginnings of names of joint models, the first one that fits
    "Planar": "planar",
    "FreeFlyer": "free",
    "Spherical": "spherical",
    "H": "screw",
    "Universal": "universal",
    "Composite": COMPOSITE,
    "Translation": "translation",
    "R": REVOLUTE,
    "P": TRANSLATIONAL,
}


def type_of(model: Any) -> str:
    """Return the type of a joint model."""
    short = str(model.shortname().removeprefix("JointModel"))
    return next((kind for begin, kind in TYPES.items() if short.startswith(begin)), short.lower())


class Pinocchio(Loader):
    """Pinocchio's builders of models; mimics and constraints are asked for."""

    name = "pinocchio"
    package = "pin"
    version = "4.1.0"
    formats = (MJCF, URDF)  # packages of Pinocchio have no reader of SDF
    convention = "read with mimic=True: without it followers are free"

    def load(self, path: Path, form: str) -> Loaded:
        """Build the model and its constraints."""
        import pinocchio

        if form == URDF:
            free = pinocchio.buildModelFromUrdf(str(path), False)
            try:
                return Built(pinocchio, free, [], pinocchio.buildModelFromUrdf(str(path), True))
            except ValueError as refusal:  # such as a follower without limits: built with free followers
                said = f"mimic=True: {str(refusal).strip().splitlines()[-1]}"
                return Built(pinocchio, free, [], free, said)
        model, *found = pinocchio.buildModelAndConstraintsFromMJCF(str(path))
        return Built(pinocchio, model, [c for group in found for c in group], model)


class Built(Loaded):
    """A model at its neutral configuration, or at ``qpos0`` of an MJCF file.

    Followers of other joints are free in ``model``, and have no coordinates in ``coupled``.
    """

    def __init__(self, pinocchio: Any, model: Any, constraints: list[Any], coupled: Any, said: str = ""):
        self.messages = (said,) if said else ()
        self.pin, self.model, self.constraints, self.coupled = pinocchio, model, constraints, coupled
        self.data = model.createData()
        self.start = self.reference(model)
        self.place(self.start)
        self.carried: dict[int, list[str]] = {}
        for frame in model.frames:
            if frame.type == pinocchio.FrameType.BODY:
                self.carried.setdefault(frame.parentJoint, []).append(frame.name)

    def reference(self, model: Any) -> np.ndarray:
        """Return the configuration at the reference pose."""
        known = {item.key(): item.data() for item in model.referenceConfigurations}
        return np.array(known.get("qpos0", self.pin.neutral(model)))

    def place(self, q: np.ndarray) -> None:
        """Compute the joints' places."""
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)

    def at(self, i: int) -> Place:
        """Return the place of the frame of a joint, which is fixed to its child."""
        found = self.data.oMi[i]
        return Place(np.array(found.translation), np.array(found.rotation))

    def body(self, i: int) -> str:
        """Return the name of the body that a joint carries."""
        return self.carried.get(i, [f"carried by {self.model.names[i]}"])[0] if i else WORLD

    def machine(self) -> Machine:
        m = self.model
        return Machine(
            bodies=tuple(self._bodies()),
            joints=(*self._fixed(), *(joint for i in range(1, m.njoints) for joint in self._joints(i))),
            loops=tuple(map(self._loop, self.constraints)),
            couplings=tuple(self._couplings()),
            gravity=vector(m.gravity.linear),
            messages=self.messages,
        )

    def _bodies(self) -> Iterator[Body]:
        zero = np.zeros((3, 3))
        for i in range(self.model.njoints):
            inertia, names = self.model.inertias[i], self.carried.get(i, [])
            if i:
                yield self.at(i).body(self.body(i), inertia.mass, inertia.lever, inertia.inertia)
            for name in names[1:] if i else names:
                yield self.at(i).body(name, 0.0, np.zeros(3), zero)

    def _fixed(self) -> Iterator[Joint]:
        for i, names in self.carried.items():
            for name in names[1:] if i else names:
                yield Joint(f"{name} fixed", FIXED, (self.body(i), name))

    def _joints(self, i: int) -> Iterator[Joint]:
        """Yield a joint, or one joint for each coordinate of several hinges and slides of one body."""
        model, at, name = self.model.joints[i], self.at(i), str(self.model.names[i])
        pair, kind = (self.body(int(self.model.parents[i])), self.body(i)), type_of(model)
        anchor = vector(at.position)
        if kind not in (*SCALAR, COMPOSITE):
            axis = at.direction([0.0, 0.0, 1.0]) if kind == "planar" else None
            yield Joint(name, kind, pair, anchor, axis, **self._forces(model.idx_v))
            return
        columns = np.array(self.data.joints[i].S).reshape(6, -1).T
        for k, column in enumerate(columns):
            linear, angular = column[:3], column[3:]
            turns = bool(np.any(angular))
            if kind == COMPOSITE and turns:  # the column is of the joint's own frame
                anchor = at.point(np.cross(angular, linear) / (angular @ angular))
            yield Joint(
                name if kind != COMPOSITE else f"{name}:{k}",
                REVOLUTE if turns else TRANSLATIONAL,
                pair,
                anchor,
                at.direction(angular if turns else linear),
                **self._forces(model.idx_v + k),
                **self._coordinate(model, k),
            )

    def _forces(self, v: int) -> dict[str, Any]:
        m = self.model
        return {
            "damping": coefficients(m.damping[v]),
            "stiffness": (),
            "armature": float(m.armature[v]),
            "friction": float(m.upperDryFrictionLimit[v]),
        }

    def _coordinate(self, model: Any, k: int) -> dict[str, Any]:
        """Return limits and reference; an angle without limits is a point of the circle (nq = 2)."""
        if model.nq != model.nv:
            return limits(-math.inf, math.inf)
        m, q = self.model, model.idx_q + k
        ends = limits(m.lowerPositionLimit[q], m.upperPositionLimit[q], none_above=1e300)
        return {**ends, "reference": float(self.start[q])}

    def _loop(self, constraint: Any) -> Loop:
        c = constraint
        ends = ((c.joint1_id, c.joint1_placement), (c.joint2_id, c.joint2_placement))
        anchors = [self.at(int(i)).point(place.translation) for i, place in ends]
        kind = "spherical" if "Point" in constraint.classname() else FIXED
        pair = self.body(int(ends[0][0])), self.body(int(ends[1][0]))
        return Loop(str(constraint.name), kind, pair, (anchors[0], anchors[1]))

    def _couplings(self) -> Iterator[Coupling]:
        m = self.coupled
        for follower, leader in zip(m.mimicking_joints, m.mimicked_joints, strict=True):
            name, law = str(m.names[follower]), m.joints[follower].extract()
            yield Coupling(name, name, str(m.names[leader]), coefficients(law.offset, law.scaling))

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        self.model = m = self.coupled
        self.data, single = m.createData(), self._single()
        q = self._at(pose, single)
        m.gravity.linear = np.array(gravity)
        upper = np.triu(self.pin.crba(m, self.data, q))
        mass, torque = upper + np.triu(upper, 1).T, self.pin.computeGeneralizedGravity(m, self.data, q)
        self.place(q)
        centres = {self.body(i): self.at(i).point(m.inertias[i].lever) for i in range(1, m.njoints)}
        dofs = list(single.values())
        return Statics(tuple(single), matrix(mass[np.ix_(dofs, dofs)]), vector(torque[dofs]), centres)

    def rows(self, pose: Pose) -> Rows:
        """Return Pinocchio's Jacobian of its constraints; followers of a mimic have no coordinates."""
        self.model = m = self.coupled
        self.data, single = m.createData(), self._single()
        self.place(self._at(pose, single))
        found = []
        for constraint in self.constraints:
            data = constraint.createData()
            constraint.calc(m, self.data, data)
            found.append(np.array(self.pin.getConstraintJacobian(m, self.data, constraint, data)))
        every = np.vstack([np.zeros((0, m.nv)), *found])
        return Rows(tuple(single), matrix(every[:, list(single.values())]))

    def accelerations(self, pose: Pose, rates: Pose, gravity: Vector) -> dict[str, float]:
        """Return accelerations by ``aba``; with mimics or constraints from mass matrix, forces and
        rows, which hold exactly."""
        self.model = m = self.coupled
        single = self._single()
        m.gravity.linear = np.array(gravity)
        v = np.zeros(m.nv)
        for name, k in single.items():
            v[k] = rates.get(name, 0.0)
        q = self._at(pose, single)
        if not self.constraints and not len(m.mimicking_joints):
            found = self.pin.aba(m, m.createData(), q, v, np.zeros(m.nv))
            return {name: float(found[k]) for name, k in single.items()}
        dofs = list(single.values())
        force = -np.array(self.pin.rnea(m, m.createData(), q, v, np.zeros(m.nv)))[dofs]
        upper = np.triu(self.pin.crba(m, m.createData(), q))
        mass = (upper + np.triu(upper, 1).T)[np.ix_(dofs, dofs)]
        return held(tuple(single), mass, force, self.rows, pose, rates)

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Simulate by RK4 of crosscheck in steps ten times as long; Pinocchio has no integrator."""
        names = tuple(self._single())
        if len(names) < self.coupled.nv:
            raise NotImplementedError(
                "Pinocchio has no integrator, and crosscheck has one for hinges and slides"
            )

        def change(y: np.ndarray) -> np.ndarray:
            at, v = (dict(zip(names, half.tolist(), strict=True)) for half in np.split(y, 2))
            found = self.accelerations({**pose, **at}, v, gravity)
            return np.concatenate([y[len(names) :], [found[name] for name in names]])

        y, h = np.array([part.get(name, 0.0) for part in (pose, rates) for name in names]), 10 * step
        for _ in range(round(duration / h)):
            first = change(y)
            second = change(y + h / 2 * first)
            third = change(y + h / 2 * second)
            y = y + h / 6 * (first + 2 * second + 2 * third + change(y + h * third))
        return dict(zip(names, y[: len(names)].tolist(), strict=True))

    def _single(self) -> dict[str, int]:
        """Return the index of the velocity of each coordinate of hinges and slides."""
        m, single = self.model, dict[str, int]()
        for i in range(1, m.njoints):
            name, kind = str(m.names[i]), type_of(m.joints[i])
            if kind in (*SCALAR, COMPOSITE):
                names = [name] if kind != COMPOSITE else [f"{name}:{k}" for k in range(m.joints[i].nv)]
                single |= {own: m.joints[i].idx_v + k for k, own in enumerate(names) if m.joints[i].nv}
        return single

    def _at(self, pose: Pose, single: Mapping[str, int]) -> np.ndarray:
        """Return the configuration at displacements from the reference."""
        moved = np.zeros(self.model.nv)
        for name, v in single.items():
            moved[v] = pose.get(name, 0.0)
        return np.array(self.pin.integrate(self.model, self.reference(self.model), moved))
