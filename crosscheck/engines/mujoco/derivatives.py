"""Derivatives of accelerations by MuJoCo's own finite differences of one time step (mjd_transitionFD).

A port of MuJoCo differentiates its own step in the same coordinates (``Stepped``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from crosscheck.differentiating import Differentiating, OwnDerivatives
from crosscheck.engines.mujoco.drift import drift
from crosscheck.engines.mujoco.linearised import HARDEST, INCREMENT, STEP, STIFFEST
from crosscheck.engines.mujoco.model import compiled
from crosscheck.engines.mujoco.warnings_off import without_warnings
from crosscheck.engines.shared.rates import names_of_rates, spins_of_rods
from mbref.scene import Scene

DEFAULTS, HARD = "defaults", "hard"


class Differentiated(Differentiating):
    """Derivatives of a step over its length, by the library's defaults, and of closures as stiff as MuJoCo
    allows. The function that is differentiated is the mean acceleration of the step."""

    differentiates_by: Mapping[str, str] = {
        DEFAULTS: "mjd_transitionFD of the default step, over the step",
        HARD: f"mjd_transitionFD of a step of {STEP:g} s, closures as stiff as MuJoCo allows, over the step",
    }

    def stepped(self, scene: Scene, function: str) -> Stepped:
        """Return the model whose step is differentiated."""
        return Stepped(scene, function)

    def own_derivatives(self, scene: Scene, function: str, away: np.ndarray | None = None) -> OwnDerivatives:
        """Return the derivatives at the start, displaced by ``away`` along unit velocities."""
        model = self.stepped(scene, function)
        at = np.zeros(model.nv) if away is None else away
        v, none = model.made.rates, np.zeros(model.nv)
        by_position, by_velocity, by_force = model.transition(at, v)
        return OwnDerivatives(
            coordinates=names_of_rates(scene, model.made.tree),
            velocity=v,
            acceleration=model.accelerations(at, none, v, none),
            by_position=by_position,
            by_velocity=by_velocity,
            by_force=by_force,
            bodies=lambda step, rate, change: model.bodies(at + step, rate, change),
            opening=lambda step, rate: model.opening(at + step, rate),
            own=lambda step, rate, force: model.accelerations(at, step, rate, force),
            spins=lambda step, rate: model.spins(at + step, rate),
        )


class Stepped:
    """A scene in MuJoCo by one of the ways, with the mean acceleration of a step and its derivatives."""

    def __init__(self, scene: Scene, function: str):
        import mujoco

        self.mujoco, self.made = mujoco, compiled(scene)
        self.model, self.nv = self.made.model, self.made.model.nv
        self.model.opt.tolerance = 0.0
        if function == HARD:
            self.model.opt.timestep = STEP
            self.model.eq_solref[:, 0], self.model.eq_solimp[:, :2] = STIFFEST, HARDEST

    def at(self, places: list[np.ndarray], v: np.ndarray) -> Any:
        """Return data at the start, displaced in turn along unit velocities, with velocities (nv,)."""
        data = self.mujoco.MjData(self.model)
        for step in places:
            self.mujoco.mj_integratePos(self.model, data.qpos, step, 1.0)
        data.qvel[:] = v
        return data

    def transition(self, at: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return the derivatives (nv, nv) of the mean acceleration of a step, by positions, velocities and
        generalised forces; None if there are none by forces."""
        size, h, nv = 2 * self.nv + self.model.na, self.model.opt.timestep, self.nv
        found, data = np.zeros((size, size)), self.at([at], v)
        with without_warnings(self.mujoco):
            self.mujoco.mj_forward(self.model, data)
            self.mujoco.mjd_transitionFD(self.model, data, INCREMENT, True, found, None, None, None)
        lower = found[nv : 2 * nv]
        return lower[:, :nv] / h, (lower[:, nv : 2 * nv] - np.eye(nv)) / h, None

    def accelerations(self, at: np.ndarray, step: np.ndarray, v: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the mean acceleration (nv,) of one time step."""
        data = self.at([at, step], v)
        data.qfrc_applied[:] = force
        with without_warnings(self.mujoco):
            self.mujoco.mj_step(self.model, data)
        return np.asarray((data.qvel - v) / self.model.opt.timestep)

    def opening(self, step: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the rates (m,) at which the closures open."""
        data = self.at([step], v)
        self.mujoco.mj_fwdPosition(self.model, data)
        found = np.zeros(data.nefc)
        self.mujoco.mj_mulJacVec(self.model, data, found, v)
        return found

    def bodies(self, step: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return twists and accelerations (6 nb,) of the bodies."""
        mujoco, model, data = self.mujoco, self.model, self.at([step], v)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        rates, changes = [], []
        for body in self.made.links[list(self.made.tree.own)]:
            jacobian = np.zeros((6, self.nv))
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], data.xpos[body], body)
            rates.append(jacobian @ v)
            changes.append(jacobian @ a + drift(model, data, int(body), data.xpos[body]))
        return np.concatenate(rates), np.concatenate(changes)

    def spins(self, step: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the rates at which rods spin about their own axes."""
        now, first = (self._turning(place, v) for place in (step, 0 * step))
        return spins_of_rods(self.made.tree, now, first)

    def _turning(self, step: np.ndarray, v: np.ndarray) -> Any:
        """Return the function of a link that gives its rotation and angular velocity."""
        data = self.at([step], v)
        self.mujoco.mj_fwdPosition(self.model, data)

        def turning(link: int) -> tuple[np.ndarray, np.ndarray]:
            body, (linear, angular) = self.made.links[link], np.zeros((2, 3, self.nv))
            self.mujoco.mj_jac(self.model, data, linear, angular, data.xpos[body], body)
            return data.xmat[body].reshape(3, 3), angular @ v

        return turning
