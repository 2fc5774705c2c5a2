"""MJX: the parts of MuJoCo's compiled model that ``put_model`` keeps, and its own dynamics in JAX."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.loader import MJCF, Loaded, Loader
from crosscheck.engines.loaders.machine import Statics, Vector, matrix, vector
from crosscheck.engines.loaders.mujoco import Compiled

FIELDS = (  # of the compiled model, read from MJX's model
    *("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "body_quat", "jnt_axis", "jnt_pos"),
    *("jnt_range", "jnt_limited", "jnt_stiffness", "jnt_stiffnesspoly", "dof_damping", "dof_dampingpoly"),
    *("dof_armature", "dof_frictionloss", "qpos0", "qpos_spring", "eq_data", "eq_active0"),
)


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
        """Return the compiled function of (q, v) that gives accelerations, mass matrix, bias and centres."""
        if gravity not in self.forward_at:
            own, bits = copy.copy(self.model), self.mujoco.mjtDisableBit
            own.opt.gravity[:] = gravity
            own.opt.disableflags = int(bits.mjDSBL_CONSTRAINT | bits.mjDSBL_ACTUATION)
            kept = self.mjx.put_model(own)
            start = self.mjx.make_data(kept)

            def forward(q: Any, v: Any) -> Any:
                data = self.mjx.forward(kept, start.replace(qpos=q, qvel=v))
                return data.qacc, self.mjx.full_m(kept, data), data.qfrc_bias, data.xipos

            self.forward_at[gravity] = self.jax.jit(forward)
        return self.forward_at[gravity]

    def statics(self, pose: Mapping[str, float], gravity: Vector) -> Statics:
        q, dofs = self.coordinates(pose), self.dofs()
        _, mass, bias, centres = map(np.asarray, self._forward(gravity)(q, np.zeros(self.model.nv)))
        places = list(dofs.values())
        named = {self.body(b): vector(centres[b]) for b in range(1, self.model.nbody)}
        return Statics(tuple(dofs), matrix(mass[np.ix_(places, places)]), vector(bias[places]), named)

    def accelerations(
        self, pose: Mapping[str, float], rates: Mapping[str, float], gravity: Vector
    ) -> dict[str, float]:
        v, dofs = np.zeros(self.model.nv), self.dofs()
        for name, dof in dofs.items():
            v[dof] = rates.get(name, 0.0)
        found = np.asarray(self._forward(gravity)(self.coordinates(pose), v)[0])
        return {name: float(found[dof]) for name, dof in dofs.items()}
