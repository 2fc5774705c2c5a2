"""Runs of MuJoCo through the intervals of joints and couplings: equalities that ``eq_active`` switches.

MuJoCo has no equations of impacts: a soft equality that becomes active pulls velocities together over time.
So the adapter changes the joint velocities at once, v⁺ = v⁻ - M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁺ (J v⁻ - ν), with the mass
matrix M of MuJoCo and the rows J of its active equalities.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engine import Setting
from crosscheck.engines.mujoco.model import COUPLING, POWERS, SWITCHED
from crosscheck.engines.mujoco.simulation import Simulation
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.sampling import Sample
from crosscheck.engines.shared.switched import SwitchedRun, always
from mbref import rotations
from mbref.scene import Coupling, Joint, Scene

SERVED = ("defaults", "stock", "tuned", "stiff")  # families in fixed steps that serve scenes with intervals
RANK = 1e-9  # singular value / largest one below which a row of the equalities counts as redundant


class EqualityRun(SwitchedRun):
    """A run of MuJoCo whose equalities are switched."""

    def __init__(self, scene: Scene, setting: Setting):
        super().__init__(scene)
        self.run = Simulation(always(scene), setting, self.parts)

    def advance(self, t0: float, t1: float) -> None:
        self.run.advance(t0, t1)

    def sample(self, t: float) -> Sample:
        return self.run.sample(t)

    def switch(self, engaged: Sequence[Joint | Coupling], released: Sequence[Joint | Coupling]) -> None:
        run = self.run
        for part in engaged:
            self._meet(part)
        for part in (*engaged, *released):
            run.data.eq_active[self._equality(part)] = part in engaged
        run.mujoco.mj_forward(run.model, run.data)

    def _meet(self, part: Joint | Coupling) -> None:
        """Let an equality hold the pose of this moment."""
        model, data = self.run.model, self.run.data
        if isinstance(part, Coupling):
            equality = self._equality(part)
            second, first = (
                data.qpos[model.jnt_qposadr[j]] - model.qpos0[model.jnt_qposadr[j]]
                for j in (model.eq_obj1id[equality], model.eq_obj2id[equality])
            )
            model.eq_data[equality, 0] = 0.0
            model.eq_data[equality, 0] = second - np.polyval(model.eq_data[equality, POWERS::-1], first)
            return
        one, other = (model.site(f"{SWITCHED}{part.name}.{i}").id for i in (0, 1))
        body = model.site_bodyid[other]
        axes = data.xmat[body].reshape(3, 3)
        model.site_pos[other] = axes.T @ (data.site_xpos[one] - data.xpos[body])
        model.site_quat[other] = rotations.from_matrix(axes.T @ data.site_xmat[one].reshape(3, 3))
        model.site_sameframe[other] = 0  # otherwise MuJoCo takes the frame of the body

    def jump(self, t: float) -> None:
        run, data = self.run, self.run.data
        rows = data.efc_J.reshape(-1, run.model.nv)
        wanted = np.zeros(len(rows))
        for row, driver in run.driven():
            wanted[row] = motion(driver, t, t)[1]
        factor = np.linalg.cholesky(self._mass())
        scaled = np.linalg.solve(factor, rows.T)
        step = np.linalg.lstsq(scaled.T, wanted - rows @ data.qvel, rcond=RANK)[0]
        data.qvel[:] += np.linalg.solve(factor.T, step)

    def energy(self) -> float:
        rates = self.run.data.qvel
        return float(rates @ self._mass() @ rates) / 2

    def _mass(self) -> np.ndarray:
        mass = np.zeros((self.run.model.nv, self.run.model.nv))
        self.run.mujoco.mj_fullM(self.run.model, self.run.data, mass)
        return mass

    def _equality(self, part: Joint | Coupling) -> int:
        """Return the number of a part's equality."""
        prefix = COUPLING if isinstance(part, Coupling) else SWITCHED
        return int(self.run.model.equality(prefix + part.name).id)
