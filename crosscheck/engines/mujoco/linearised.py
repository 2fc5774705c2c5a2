"""Small motions by MuJoCo's own finite differences of one time step (mjd_transitionFD)."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.mujoco.model import compiled
from crosscheck.engines.mujoco.warnings_off import without_warnings
from crosscheck.linearising import Linearising
from mbref.scene import Scene

STEP = 1e-4  # s; step of the integrator Euler, whose error of eigenvalues is of first order
INCREMENT = 1e-5  # of the central differences; with the step above the errors of both are about 1e-6
STIFFEST = 2 * STEP  # s; shortest time constant of closures that MuJoCo allows for the step
HARDEST = 0.9999  # largest impedance of closures that MuJoCo allows; with its default, 0.9, errors are 1e-1


class Linearised(Linearising):
    """Eigenvalues by ``mjd_transitionFD``."""

    linearises_by = "mjd_transitionFD"

    def own_eigenvalues(self, scene: Scene) -> np.ndarray:
        """Return the exponents s (2 nv,), 1/s, with exp(s h) the eigenvalues of a step h.

        Closures are as stiff as MuJoCo allows. They stay soft, and each adds fast decays of its own.
        """
        import mujoco

        model = (made := compiled(scene)).model
        model.opt.timestep, model.opt.tolerance = STEP, 0.0
        model.eq_solref[:, 0], model.eq_solimp[:, :2] = STIFFEST, HARDEST
        size = 2 * model.nv + model.na
        transition, data = np.zeros((size, size)), mujoco.MjData(model)
        with without_warnings(mujoco):
            made.apply(data, 0.0)
            mujoco.mj_forward(model, data)
            mujoco.mjd_transitionFD(model, data, INCREMENT, True, transition, None, None, None)
        return np.asarray(np.log(np.linalg.eigvals(transition).astype(complex)) / STEP)
