"""Derivatives of MJX's steps by JAX (jax.jacfwd), in double precision."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from crosscheck.engines.mjx.library import imported
from crosscheck.engines.mujoco import derivatives
from crosscheck.engines.mujoco.derivatives import DEFAULTS, HARD
from crosscheck.engines.mujoco.linearised import STEP
from mbref.scene import Scene


class Differentiated(derivatives.Differentiated):
    """Derivatives of MJX's step over its length; the function that is differentiated is the mean
    acceleration of the step."""

    differentiates_by: Mapping[str, str] = {
        DEFAULTS: "jax.jacfwd of mjx.step, default step and options, over the step",
        HARD: f"jax.jacfwd of mjx.step of {STEP:g} s, closures as stiff as MuJoCo allows, over the step",
    }

    def stepped(self, scene: Scene, function: str) -> derivatives.Stepped:
        """Return the model whose step is differentiated."""
        return _Stepped(scene, function)


@functools.cache
def _slopes() -> Any:
    """Return the compiled function of (model, data, velocities, forces, tangent) that gives the mean
    acceleration (nv,) of a step and its derivatives (nv, nv) by positions, velocities and forces.

    ``tangent`` (nq, nv) are the rates of the coordinates at unit velocities.
    """
    jax, mjx = imported()

    def mean(step: Any, v: Any, force: Any, model: Any, data: Any, tangent: Any) -> Any:
        now = data.replace(qpos=data.qpos + tangent @ step, qvel=v, qfrc_applied=force)
        found = (mjx.step(model, now).qvel - v) / model.opt.timestep
        return found, found

    by_all = jax.jacfwd(mean, (0, 1, 2), has_aux=True)
    return jax.jit(lambda model, data, v, f, tangent: by_all(0 * v, v, f, model, data, tangent))


class _Stepped(derivatives.Stepped):
    """A scene in MJX by one of the ways; kinematics are MuJoCo's."""

    def __init__(self, scene: Scene, function: str):
        super().__init__(scene, function)
        _, self.mjx = imported()
        self.put = self.mjx.put_model(self.model)
        start = self.at([], self.made.rates)
        self.mujoco.mj_forward(self.model, start)
        self.data = self.mjx.put_data(self.model, start)

    def transition(self, at: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return the derivatives (nv, nv) of the mean acceleration of a step."""
        by_position, by_velocity, by_force = self._taken([at], v, 0 * v)[0]
        return by_position, by_velocity, by_force

    def accelerations(self, at: np.ndarray, step: np.ndarray, v: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the mean acceleration (nv,) of one time step."""
        return np.asarray(self._taken([at, step], v, force)[1])

    def _taken(self, places: list[np.ndarray], v: np.ndarray, force: np.ndarray) -> Any:
        now = np.asarray(self.at(places, v).qpos)
        found, mean = _slopes()(self.put, self.data.replace(qpos=now), v, force, self._tangent(now))
        return [np.asarray(each) for each in found], np.asarray(mean)

    def _tangent(self, qpos: np.ndarray) -> np.ndarray:
        """Return the rates (nq, nv) of the coordinates at unit velocities."""
        columns = []
        for e in np.eye(self.nv):
            # exact: a quaternion q turned by ω h is q cos(h/2) + q ω sin(h/2), of which ± h keep the second
            ahead, behind = qpos.copy(), qpos.copy()
            self.mujoco.mj_integratePos(self.model, ahead, e, 1.0)
            self.mujoco.mj_integratePos(self.model, behind, e, -1.0)
            columns.append((ahead - behind) / 2)
        found = np.array(columns).T
        found[self._quaternions()] /= 2 * np.sin(0.5)
        return found

    def _quaternions(self) -> np.ndarray:
        """Return the places of the numbers of quaternions among the coordinates."""
        kinds = self.mujoco.mjtJoint
        begins = {int(kinds.mjJNT_BALL): 0, int(kinds.mjJNT_FREE): 3}
        pairs = zip(self.model.jnt_type, self.model.jnt_qposadr, strict=True)
        found = [np.arange(4) + start + begins[int(kind)] for kind, start in pairs if int(kind) in begins]
        return np.concatenate([np.zeros(0, dtype=int), *found])
