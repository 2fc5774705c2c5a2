"""MJX: the parts of MuJoCo's compiled model that ``put_model`` keeps, and its own dynamics in JAX."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.constrained import held
from crosscheck.engines.loaders.loader import MJCF, Loaded, Loader
from crosscheck.engines.loaders.machine import Rows, Statics, Vector, matrix, vector
from crosscheck.engines.loaders.mujoco import Compiled
from crosscheck.engines.loaders.posed import Pose

FIELDS = (  # of the compiled model, read from MJX's model
    *("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "body_quat", "jnt_axis", "jnt_pos"),
    *("jnt_range", "jnt_limited", "jnt_stiffness", "jnt_stiffnesspoly", "dof_damping", "dof_dampingpoly"),
    *("dof_armature", "dof_frictionloss", "qpos0", "qpos_spring", "eq_data", "eq_active0"),
)


NONE = (0.0, 0.0, 0.0)  # m/s²; rows do not depend on gravity


class Mjx(Loader):
    """MuJoCo's compiler and MJX's ``put_model``, in double precision."""

    name = "mjx"
    package = "mujoco-mjx"
    version = "3.17.0"
    formats = (MJCF,)
    convention = "MuJoCo's compiler reads the file"

    def load(self, path: Path, form: str) -> Loaded:
        """Compile the file and put it on the device; raises NotImplementedError of MJX for some features."""
        import jax

        jax.config.update("jax_enable_x64", True)
        import mujoco
        from mujoco import mjx

        return Put(mujoco, mjx, jax, mujoco.MjModel.from_xml_path(str(path)))


class Put(Compiled):
    """A model of MJX, shown by a compiled model with its numbers."""

    def __init__(self, mujoco: Any, mjx: Any, jax: Any, model: Any):
        self.mjx, self.jax, self.forward_at = mjx, jax, dict[Vector, Callable[..., Any]]()
        kept = mjx.put_model(model)
        for name in FIELDS:
            if hasattr(kept, name):
                getattr(model, name)[:] = np.asarray(getattr(kept, name))
        super().__init__(mujoco, model)

    def _forward(self, gravity: Vector) -> Callable[..., Any]:
        """Return the compiled function of (q, v) that gives accelerations without constraints, mass matrix,
        bias, centres and rows of equalities."""
        if gravity not in self.forward_at:
            own, bits = copy.copy(self.model), self.mujoco.mjtDisableBit
            own.opt.gravity[:] = gravity
            own.opt.disableflags = int(bits.mjDSBL_CONSTRAINT | bits.mjDSBL_ACTUATION)
            kept = self.mjx.put_model(own)
            own.opt.disableflags = self.equalities_alone()
            holding = self.mjx.put_model(own)
            start, held_start = self.mjx.make_data(kept), self.mjx.make_data(holding)

            def forward(q: Any, v: Any) -> Any:
                data = self.mjx.forward(kept, start.replace(qpos=q, qvel=v))
                held_at = self.mjx.fwd_position(holding, held_start.replace(qpos=q, qvel=v))
                rows = held_at._impl.efc_J if self.model.neq else q[:0]
                return data.qacc, self.mjx.full_m(kept, data), data.qfrc_bias, data.xipos, rows

            self.forward_at[gravity] = self.jax.jit(forward)
        return self.forward_at[gravity]

    def _at(self, pose: Pose, rates: Pose, gravity: Vector) -> list[np.ndarray]:
        """Return the results at a pose and rates."""
        v = np.zeros(self.model.nv)
        for name, dof in self.dofs().items():
            v[dof] = rates.get(name, 0.0)
        return list(map(np.asarray, self._forward(gravity)(self.coordinates(pose), v)))

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        _, mass, bias, centres, _ = self._at(pose, {}, gravity)
        places = list(self.dofs().values())
        named = {self.body(b): vector(centres[b]) for b in range(1, self.model.nbody)}
        return Statics(tuple(self.dofs()), matrix(mass[np.ix_(places, places)]), vector(bias[places]), named)

    def rows(self, pose: Pose) -> Rows:
        """Return MJX's Jacobian of equalities."""
        every = self._at(pose, {}, NONE)[4].reshape(-1, self.model.nv)
        return Rows(tuple(self.dofs()), matrix(every[:, list(self.dofs().values())]))

    def accelerations(self, pose: Pose, rates: Pose, gravity: Vector) -> dict[str, float]:
        free, mass, *_ = self._at(pose, rates, gravity)
        dofs = list(self.dofs().values())
        if not self.model.neq:
            return dict(zip(self.dofs(), free[dofs].tolist(), strict=True))
        own = mass[np.ix_(dofs, dofs)]
        return held(tuple(self.dofs()), own, own @ free[dofs], self.rows, pose, rates)

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        raise NotImplementedError("a step of MJX compiles for longer than a file may take")
