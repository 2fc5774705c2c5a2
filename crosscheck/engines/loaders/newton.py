"""Newton's readers of URDF and MJCF, as they fill its model builder."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.loader import MJCF, SINGLE, URDF, Loaded, Loader
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
    Statics,
    Vector,
    coefficients,
    limits,
    matrix,
    vector,
)
from crosscheck.engines.loaders.placing import ORIGIN, Place, of_xyzw
from crosscheck.engines.loaders.posed import Pose

TYPES = {
    "FIXED": FIXED,
    "REVOLUTE": REVOLUTE,
    "PRISMATIC": TRANSLATIONAL,
    "BALL": "spherical",
    "FREE": "free",
    "DISTANCE": "distance",
    "D6": "several axes",
}
UNLIMITED = 1e9  # rad or m; Newton writes 1e10 for a joint without limits


class Newton(Loader):
    """Newton's importers with their default options."""

    name = "newton"
    package = "newton"
    version = "1.8.0"
    beside = ("trimesh>=4.6.8",)  # meshes
    formats = (URDF, MJCF)
    tolerance = SINGLE
    convention = "its model builder; attributes for its solver on MuJoCo alone are not counted"

    def load(self, path: Path, form: str) -> Loaded:
        """Add the file to a builder."""
        with contextlib.suppress(AttributeError):
            import warp

            warp.config.log_level = warp.LOG_ERROR
        import newton

        builder = newton.ModelBuilder()
        (builder.add_urdf if form == URDF else builder.add_mjcf)(str(path))
        return Builder(newton, builder)


class Builder(Loaded):
    """A model builder at joint coordinates 0."""

    def __init__(self, newton: Any, builder: Any):
        self.newton, self.b = newton, builder
        self.at: dict[int, Place] = {-1: ORIGIN}
        self.frames: dict[int, Place] = {}
        for j in self._tree():
            parent, child = builder.joint_parent[j], builder.joint_child[j]
            frame = self.at[parent].then(_place(builder.joint_X_p[j]))
            self.frames[j] = frame
            self.at[child] = frame.then(self._start(j)).then(_place(builder.joint_X_c[j]).inverse())

    def _tree(self) -> list[int]:
        """Return the joints that carry bodies, each after the joints of its parent."""
        carried, found = {-1}, list[int]()
        waiting = list(range(self.b.joint_count))
        while ready := [
            j for j in waiting if self.b.joint_parent[j] in carried and self.b.joint_child[j] not in carried
        ]:
            found.append(ready[0])
            carried.add(self.b.joint_child[ready[0]])
            waiting.remove(ready[0])
        return found

    def _start(self, j: int) -> Place:
        q, kind = self.b.joint_q_start[j], self._type(j)
        if kind == "free":
            values = [float(v) for v in self.b.joint_q[q : q + 7]]
            return of_xyzw(values[:3], values[3:])
        if kind == "spherical":
            return of_xyzw(np.zeros(3), [float(v) for v in self.b.joint_q[q : q + 4]])
        return ORIGIN

    def _type(self, j: int) -> str:
        return TYPES.get(self.b.joint_type[j].name, self.b.joint_type[j].name.lower())

    def _name(self, body: int) -> str:
        return WORLD if body < 0 else str(self.b.body_label[body])

    def _pair(self, j: int) -> tuple[str, str]:
        return self._name(self.b.joint_parent[j]), self._name(self.b.joint_child[j])

    def machine(self) -> Machine:
        loops = [j for j in range(self.b.joint_count) if j not in self.frames and self.b.joint_enabled[j]]
        return Machine(
            bodies=tuple(map(self._body, range(self.b.body_count))),
            joints=tuple(joint for j in self.frames for joint in self._joints(j)),
            loops=tuple(self._loop(j) for j in loops),
            couplings=tuple(self._couplings()),
            gravity=vector(self.b.gravity),
        )

    def _body(self, k: int) -> Body:
        b, at = self.b, self.at.get(k) or _place(self.b.body_q[k])
        inertia = np.array(b.body_inertia[k], float).reshape(3, 3)
        return at.body(self._name(k), b.body_mass[k], vector(b.body_com[k]), inertia)

    def _joints(self, j: int) -> Iterator[Joint]:
        """Yield the joint, or one joint for each of several axes."""
        b, at, kind, name = self.b, self.frames[j], self._type(j), str(self.b.joint_label[j])
        start, (slides, turns) = int(b.joint_qd_start[j]), b.joint_dof_dim[j]
        anchor = vector(at.position)
        if kind not in (*SCALAR, "several axes"):
            yield Joint(name, kind, self._pair(j), anchor)
            return
        for k in range(slides + turns):
            v = start + k
            own = name if slides + turns == 1 else f"{name}:{k}"
            ends = b.joint_limit_lower[v], b.joint_limit_upper[v]
            yield Joint(
                own,
                TRANSLATIONAL if k < slides else REVOLUTE,
                self._pair(j),
                anchor,
                at.direction(vector(b.joint_axis[v])),
                damping=coefficients(b.joint_damping[v]),
                stiffness=coefficients(b.joint_stiffness[v]),
                rest=float(b.joint_rest_q[v]) if b.joint_stiffness[v] else None,
                armature=float(b.joint_armature[v]),
                friction=float(b.joint_friction[v]),
                reference=float(b.joint_q[int(b.joint_q_start[j]) + k]),
                **limits(*ends, none_above=UNLIMITED),
            )

    def _loop(self, j: int) -> Loop:
        b = self.b
        ends = [
            vector(self.at[body].then(_place(frame[j])).position)
            for body, frame in ((b.joint_parent[j], b.joint_X_p), (b.joint_child[j], b.joint_X_c))
        ]
        return Loop(str(b.joint_label[j]), self._type(j), self._pair(j), (ends[0], ends[1]))

    def _couplings(self) -> Iterator[Coupling]:
        b = self.b
        for j, leader in enumerate(b.joint_mimic_joint):
            if leader >= 0:
                names = str(b.joint_label[j]), str(b.joint_label[leader])
                yield Coupling(names[0], *names, coefficients(*b.joint_mimic_coeffs[j]))
        for k, follower in enumerate(b.constraint_mimic_joint0):
            if b.constraint_mimic_enabled[k]:
                leader = b.constraint_mimic_joint1[k]
                names = str(b.joint_label[follower]), str(b.joint_label[leader])
                law = b.constraint_mimic_coef0[k], b.constraint_mimic_coef1[k]
                yield Coupling(names[0], *names, coefficients(*law))

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Simulate by SolverFeatherstone, which holds mimics of a URDF and no equalities of an MJCF file."""
        if len(self.frames) < self.b.joint_count or any(self.b.constraint_mimic_enabled):
            raise NotImplementedError("SolverFeatherstone does not hold loops and equalities of MJCF")
        newton = self.newton
        model = self.b.finalize(device="cpu")
        model.set_gravity(tuple(gravity))
        for ends in (model.joint_limit_ke, model.joint_limit_kd, model.joint_friction):
            ends.zero_()
        start = np.array(model.joint_q.numpy())  # NumPy's arrays share the memory of Warp's
        q, qd = np.array(start), np.array(model.joint_qd.numpy())
        places = {}
        for j in self.frames:
            if self._type(j) in SCALAR:
                name = str(self.b.joint_label[j]).rsplit("/", maxsplit=1)[-1]
                places[name] = int(self.b.joint_q_start[j])
                q[places[name]] += pose.get(name, 0.0)
                qd[int(self.b.joint_qd_start[j])] = rates.get(name, 0.0)
        now, after = model.state(), model.state()
        now.joint_q.assign(q)
        now.joint_qd.assign(qd)
        newton.eval_fk(model, now.joint_q, now.joint_qd, now)
        solver = newton.solvers.SolverFeatherstone(model, angular_damping=0.0)
        control = model.control()
        for _ in range(round(duration / step)):
            now.clear_forces()
            solver.step(now, after, control, None, step)
            now, after = after, now
        end = now.joint_q.numpy()
        return {name: float(end[k] - start[k]) for name, k in places.items()}

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        """Return Newton's mass matrix in single precision; it gives gravity torques to its solvers alone."""
        model = self.b.finalize(device="cpu")
        q, names, dofs = model.joint_q.numpy(), list[str](), list[int]()
        for j in self.frames:
            if self._type(j) in SCALAR:
                name = str(self.b.joint_label[j])
                q[int(self.b.joint_q_start[j])] += pose.get(name.rsplit("/", maxsplit=1)[-1], 0.0)
                names.append(name)
                dofs.append(int(self.b.joint_qd_start[j]))
        model.joint_q.assign(q)
        state = model.state()
        self.newton.eval_fk(model, model.joint_q, model.joint_qd, state)
        mass = self.newton.eval_mass_matrix(model, state).numpy()[0]
        places = [_place(frame) for frame in state.body_q.numpy()]
        centres = {self._name(k): p.point(vector(self.b.body_com[k])) for k, p in enumerate(places)}
        return Statics(tuple(names), matrix(mass[np.ix_(dofs, dofs)]), None, centres)


def _place(transform: Any) -> Place:
    """Return the place of Newton's transform (x, y, z, qx, qy, qz, qw)."""
    values = [float(v) for v in transform]
    return of_xyzw(values[:3], values[3:])
