"""MuJoCo's reader of MJCF and URDF, and the machine in its compiled model."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.constrained import held
from crosscheck.engines.loaders.loader import MJCF, URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
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
from crosscheck.engines.loaders.posed import Pose
from crosscheck.engines.mujoco.importing.actuators import moved_to_joints
from crosscheck.engines.mujoco.importing.couplings import of_equalities
from crosscheck.engines.mujoco.importing.posing import JointRow
from crosscheck.engines.mujoco.warnings_off import without_warnings

TYPES = {0: "free", 1: "spherical", 2: TRANSLATIONAL, 3: REVOLUTE}  # by mjtJoint


class Mujoco(Loader):
    """MuJoCo's compiler with its default options."""

    name = "mujoco"
    package = "mujoco"
    version = "4.0.0"
    formats = (MJCF, URDF)

    def load(self, path: Path, form: str) -> Loaded:
        """Compile the file."""
        import mujoco

        return Compiled(mujoco, mujoco.MjModel.from_xml_path(str(path)))


def compiled(path: Path) -> Machine:
    """Return the machine of an MJCF file, without MuJoCo's warnings."""
    import mujoco

    with without_warnings(mujoco):
        return Mujoco().load(path, MJCF).machine()


class Compiled(Loaded):
    """A compiled model at its reference pose ``qpos0``."""

    def __init__(self, mujoco: Any, model: Any):
        self.mujoco, self.model = mujoco, model
        list(moved_to_joints(mujoco, model))  # in place; parts of tendons are not compared
        without_others(model)
        obey(mujoco, model)
        self.data, self.flags = mujoco.MjData(model), int(model.opt.disableflags)
        self.place()

    def place(self) -> None:
        """Compute the bodies' places at the present pose."""
        for step in (self.mujoco.mj_kinematics, self.mujoco.mj_comPos, self.mujoco.mj_crb):
            step(self.model, self.data)

    def body(self, number: int) -> str:
        """Return the name of a body."""
        return str(self.model.body(number).name) or f"body {number}" if number else WORLD

    def joint(self, number: int) -> str:
        """Return the name of a joint."""
        return str(self.model.joint(number).name) or f"joint {number}"

    def machine(self) -> Machine:
        m, flags = self.model, self.mujoco.mjtDisableBit
        off = bool(m.opt.disableflags & flags.mjDSBL_GRAVITY)
        equal = not m.opt.disableflags & (flags.mjDSBL_EQUALITY | flags.mjDSBL_CONSTRAINT)
        return Machine(
            bodies=tuple(map(self._body, range(1, m.nbody))),
            joints=tuple(self._joints()),
            loops=tuple(self._loops()) if equal else (),
            couplings=tuple(self._couplings()) if equal else (),
            gravity=(0.0, 0.0, 0.0) if off else vector(m.opt.gravity),
        )

    def _body(self, b: int) -> Body:
        turn = self.data.ximat[b].reshape(3, 3)
        inertia = turn @ np.diag(self.model.body_inertia[b]) @ turn.T
        centre = vector(self.data.xipos[b])
        return Body(self.body(b), float(self.model.body_mass[b]), centre, matrix(inertia))

    def _joints(self) -> Iterator[Joint]:
        m = self.model
        for b in range(1, m.nbody):
            pair = self.body(int(m.body_parentid[b])), self.body(b)
            if not m.body_jntnum[b]:
                yield Joint(f"{pair[1]} fixed", FIXED, pair)
            first = int(m.body_jntadr[b])
            yield from (self._joint(j, pair) for j in range(first, first + int(m.body_jntnum[b])))

    def _joint(self, j: int, pair: tuple[str, str]) -> Joint:
        m, kind, dof = self.model, int(self.model.jnt_type[j]), int(self.model.jnt_dofadr[j])
        name, anchor = self.joint(j), vector(self.data.xanchor[j])
        bits = self.mujoco.mjtDisableBit
        acting = m.jnt_limited[j] and not m.opt.disableflags & (bits.mjDSBL_LIMIT | bits.mjDSBL_CONSTRAINT)
        common: dict[str, Any] = {
            "damping": coefficients(m.dof_damping[dof], *m.dof_dampingpoly[dof]),
            "stiffness": coefficients(m.jnt_stiffness[j], *m.jnt_stiffnesspoly[j]),
            "armature": float(m.dof_armature[dof]),
            "friction": float(m.dof_frictionloss[dof]),
        }
        if TYPES[kind] not in (REVOLUTE, TRANSLATIONAL):
            return Joint(name, TYPES[kind], pair, anchor, **common)
        q, ends = int(m.jnt_qposadr[j]), m.jnt_range[j] if acting else (-math.inf, math.inf)
        return Joint(
            name,
            TYPES[kind],
            pair,
            anchor,
            vector(self.data.xaxis[j]),
            reference=float(m.qpos0[q]),
            rest=float(m.qpos_spring[q]) if m.jnt_stiffness[j] or any(m.jnt_stiffnesspoly[j]) else None,
            **limits(*ends),
            **common,
        )

    def _loops(self) -> Iterator[Loop]:
        m, kinds = self.model, self.mujoco.mjtEq
        names = {int(kinds.mjEQ_CONNECT): "spherical", int(kinds.mjEQ_WELD): FIXED}
        for e in np.flatnonzero(m.eq_active0):
            kind, first, second = (int(v[e]) for v in (m.eq_type, m.eq_obj1id, m.eq_obj2id))
            if kind not in names:
                continue
            if m.eq_objtype[e] == self.mujoco.mjtObj.mjOBJ_SITE:
                bodies = self.body(int(m.site_bodyid[first])), self.body(int(m.site_bodyid[second]))
                ends = vector(self.data.site_xpos[first]), vector(self.data.site_xpos[second])
            else:
                at = m.eq_data[e]
                points = (at[0:3], at[3:6]) if kind == kinds.mjEQ_CONNECT else (at[3:6], at[0:3])
                bodies = self.body(first), self.body(second)
                ends = self._point(first, points[0]), self._point(second, points[1])
            torque_scale = m.eq_data[e, 10]  # of a weld; at 0 the bodies turn freely
            what = "spherical" if kind == kinds.mjEQ_WELD and not torque_scale else names[kind]
            yield Loop(str(m.equality(e).name) or f"equality {e}", what, bodies, ends)

    def _point(self, body: int, local: np.ndarray) -> Vector:
        return vector(self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ local)

    def _couplings(self) -> Iterator[Coupling]:
        m, kinds = self.model, self.mujoco.mjtEq
        rows = {r.name: r for r in of_equalities(self.mujoco, copy.copy(m)) if isinstance(r, JointRow)}
        for e in np.flatnonzero(m.eq_active0):
            kind, first, second = (int(v[e]) for v in (m.eq_type, m.eq_obj1id, m.eq_obj2id))
            if kind not in (kinds.mjEQ_JOINT, kinds.mjEQ_TENDON):
                continue
            name, law = str(m.equality(e).name) or f"equality {e}", coefficients(*m.eq_data[e, :5])
            row = rows.get(name)
            if kind == kinds.mjEQ_TENDON and row is None:  # of tendons that are no sum of coordinates
                yield Coupling(name, f"tendon {m.tendon(first).name}", "", law)
                continue
            if kind == kinds.mjEQ_TENDON and row is not None:
                joints, factors = list(map(self.joint, row.joints)), [-factor for factor in row.factors]
                law, others = (
                    coefficients(row.offset, *factors[1:2]),
                    zip(joints[2:], factors[2:], strict=True),
                )
                yield Coupling(name, joints[0], "".join(joints[1:2]), law, tuple(others))
                continue
            yield Coupling(name, self.joint(first), self.joint(second) if second >= 0 else "", law)

    def dofs(self) -> dict[str, int]:
        """Return the index of the velocity of each hinge and slide."""
        m = self.model
        single = [j for j in range(m.njnt) if TYPES[int(m.jnt_type[j])] in (REVOLUTE, TRANSLATIONAL)]
        return {self.joint(j): int(m.jnt_dofadr[j]) for j in single}

    def coordinates(self, pose: Pose) -> np.ndarray:
        """Return the coordinates at displacements of hinges and slides from the reference pose."""
        m, q = self.model, np.array(self.model.qpos0)
        for name, dof in self.dofs().items():
            q[m.jnt_qposadr[m.dof_jntid[dof]]] += pose.get(name, 0.0)
        return q

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        m, data, dofs = self.model, self.data, self.dofs()
        m.opt.gravity[:], m.opt.disableflags = gravity, 0
        data.qpos[:], data.qvel[:] = self.coordinates(pose), 0.0
        self.place()
        self.mujoco.mj_comVel(m, data)
        torque = np.zeros(m.nv)
        self.mujoco.mj_rne(m, data, 0, torque)
        places = list(dofs.values())
        centres = {self.body(b): vector(data.xipos[b]) for b in range(1, m.nbody)}
        mass = self._mass()[np.ix_(places, places)]
        return Statics(tuple(dofs), matrix(mass), vector(torque[places]), centres)

    def rows(self, pose: Pose) -> Rows:
        """Return MuJoCo's Jacobian of the equalities that are on."""
        m, data, dofs = self.model, self.data, self.dofs()
        m.opt.disableflags = self.equalities_alone()
        m.opt.jacobian = self.mujoco.mjtJacobian.mjJAC_DENSE
        data.qpos[:], data.qvel[:] = self.coordinates(pose), 0.0
        self.mujoco.mj_fwdPosition(m, data)
        every = np.array(data.efc_J).reshape(-1, m.nv)[: data.ne]
        return Rows(tuple(dofs), matrix(every[:, list(dofs.values())]))

    def equalities_alone(self) -> int:
        """Return the flags that disable all forces of constraints except the file's equalities."""
        bits = self.mujoco.mjtDisableBit
        others = bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT | bits.mjDSBL_FRICTIONLOSS | bits.mjDSBL_ACTUATION
        return int(others) | self.flags & int(bits.mjDSBL_EQUALITY | bits.mjDSBL_CONSTRAINT)

    def accelerations(self, pose: Pose, rates: Pose, gravity: Vector) -> dict[str, float]:
        """Return accelerations from MuJoCo's mass matrix, forces and rows; the rows hold exactly, which
        MuJoCo's soft equalities do not."""
        m, data, bits, dofs = self.model, self.data, self.mujoco.mjtDisableBit, self.dofs()
        m.opt.gravity[:] = gravity
        m.opt.disableflags = int(bits.mjDSBL_CONSTRAINT | bits.mjDSBL_ACTUATION)
        self._put(pose, rates)
        self.mujoco.mj_forward(m, data)
        places = list(dofs.values())
        mass, force = self._mass()[np.ix_(places, places)], (data.qfrc_passive - data.qfrc_bias)[places]
        if not m.neq:
            return {name: float(data.qacc[dof]) for name, dof in dofs.items()}
        return held(tuple(dofs), mass, force, self.rows, pose, rates)

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Simulate by the file's integrator; equalities are as stiff as the step allows."""
        m, data, dofs = self.model, self.data, self.dofs()
        m.opt.gravity[:], m.opt.timestep = gravity, step
        m.opt.disableflags = self.equalities_alone()
        m.eq_solref[:] = (2 * step, 1.0)
        self._put(pose, rates)
        self.mujoco.mj_step(m, data, round(duration / step))
        start = {name: m.jnt_qposadr[m.dof_jntid[dof]] for name, dof in dofs.items()}
        return {name: float(data.qpos[q] - m.qpos0[q]) for name, q in start.items()}

    def _put(self, pose: Pose, rates: Pose) -> None:
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self.coordinates(pose), 0.0
        for name, dof in self.dofs().items():
            self.data.qvel[dof] = rates.get(name, 0.0)

    def _mass(self) -> np.ndarray:
        """Return the mass matrix (nv, nv)."""
        whole = np.zeros((self.model.nv, self.model.nv))
        self.mujoco.mj_fullM(self.model, self.data, whole)
        return whole


def obey(mujoco: Any, model: Any) -> None:
    """Set the springs, dampers and dry friction of joints to zero that the file's flags disable, and springs
    that yield, which are not compared."""
    plastic = np.flatnonzero(getattr(model, "jnt_springyield", ()))  # older versions have none
    model.jnt_stiffness[plastic] = model.jnt_stiffnesspoly[plastic] = 0.0
    off, bits = model.opt.disableflags, mujoco.mjtDisableBit
    for flag, numbers in (
        (bits.mjDSBL_SPRING, (model.jnt_stiffness, model.jnt_stiffnesspoly)),
        (bits.mjDSBL_DAMPER, (model.dof_damping, model.dof_dampingpoly)),
        (bits.mjDSBL_FRICTIONLOSS | bits.mjDSBL_CONSTRAINT, (model.dof_frictionloss,)),
    ):
        for each in numbers if off & flag else ():
            each[...] = 0.0


def without_others(model: Any) -> None:
    """Set forces and inertias to zero that are not compared: of fluids, tendons and compensated weights."""
    model.opt.density = model.opt.viscosity = 0.0
    for strength in (
        model.tendon_stiffness,
        model.tendon_damping,
        model.tendon_armature,
        model.body_gravcomp,
    ):
        strength[:] = 0.0
