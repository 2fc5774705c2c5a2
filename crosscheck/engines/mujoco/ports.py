"""Functions shared by MuJoCo's ports to other machines (MJX, Warp): MuJoCo's model of a scene, settings and
samples.

A port steps MuJoCo's model with its own code. Poses and velocities at the samples are computed from its joint
coordinates by MuJoCo in C, which adds only rounding.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.engines.mujoco import dampers
from crosscheck.engines.mujoco.families import STIFFEST
from crosscheck.engines.mujoco.model import SUPPORTS as OF_MUJOCO
from crosscheck.engines.mujoco.model import compiled
from crosscheck.engines.shared.initial_velocities import lacks_mass
from crosscheck.engines.shared.own_steps import STEP, SteppingEngine, Steps
from crosscheck.engines.shared.tree_reactions import LinkMotion
from mbref.scene import Scene

SUPPORTS = replace(OF_MUJOCO, over_time=(), massless_links=False, powers=1)
MOST_DENSE = 60  # degrees of freedom, for more MuJoCo Warp has no dense Jacobian
STOCK, BY_C = "stock", "C"
FAMILIES = {
    STOCK: "closures as stiff as documented (time constant two steps, impedance 0.9999), RK4; dense "
    "Jacobian where the port has one",
    "euler": "like stock, first-order integrator Euler",
    "defaults": "the library's own options; the time step alone is given",
    BY_C: "like stock, stepped by MuJoCo's library in C, in double precision",
}
OWN_STEPS: dict[str, dict[str, float]] = {family: {} for family in FAMILIES if family != BY_C}
DEFAULT_STEPS = {"defaults": 2e-3}
OPTIONS = STEP | {"solver": "of MuJoCo: Newton, or CG of many iterations"}
WAY: dict[str, Any] = {"step": 5e-4}
MANY = 1000  # iterations of CG, which then ends at the tolerance
WAYS = {
    "C, Newton": Setting(BY_C, WAY),
    "port, Newton": Setting(STOCK, WAY),
    "port, CG": Setting(STOCK, WAY | {"solver": "CG"}),
}


class Port(SteppingEngine):
    """A port of MuJoCo, which steps MuJoCo's model with its own code.

    Attributes
    ----------
    port : str
        Name of the port in refusals.
    """

    port: str
    supports = SUPPORTS
    families, options, own_steps, default_steps = FAMILIES, OPTIONS, OWN_STEPS, DEFAULT_STEPS
    with_default = ("solver",)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse drivers, which need a callback in the step, and bodies without mass."""
        if scene.driver:
            driven = f"the driver of joint {scene.driver[0].joint!r}"
            return Cannot(Owner.ENGINE, f"{self.port} has no callback in which {driven} could act")
        return lacks_mass(scene) or dampers.refusal(scene)

    def world(self, scene: Scene, setting: Setting) -> Steps:
        """Return a model of MuJoCo in the port, or in MuJoCo's library."""
        ported = PortedModel(scene, setting)
        return LibrarySteps(ported) if setting.family == BY_C else self.in_port(ported, setting.family)

    @abstractmethod
    def in_port(self, ported: PortedModel, family: str) -> Steps:
        """Return a model of MuJoCo in the port."""


class PortedModel:
    """MuJoCo's model and data of a scene at a setting, and the motion of its links at a state."""

    def __init__(self, scene: Scene, setting: Setting):
        import mujoco

        self.mujoco, self.built = mujoco, compiled(scene)
        self.model = model = self.built.model
        model.opt.timestep = setting.options["step"]
        if setting.family != "defaults":
            if model.nv <= MOST_DENSE or setting.family == BY_C:
                model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
            kind = mujoco.mjtIntegrator
            model.opt.integrator = kind.mjINT_EULER if setting.family == "euler" else kind.mjINT_RK4
            if setting.options.get("solver") == "CG":
                model.opt.solver, model.opt.iterations = mujoco.mjtSolver.mjSOL_CG, MANY
            model.eq_solref[:], model.eq_solimp[:] = (2 * setting.options["step"], 1.0), STIFFEST
        self.data = mujoco.MjData(model)
        self.data.qvel[:] = self.built.rates
        self.built.apply(self.data, 0.0)
        mujoco.mj_forward(model, self.data)

    def motion(self, qpos: Any, qvel: Any) -> LinkMotion:
        """Return the motion of the links at joint coordinates (nq,) and velocities (nv,)."""
        mujoco, model, data, links = self.mujoco, self.model, self.data, self.built.links
        data.qpos[:], data.qvel[:] = np.asarray(qpos, dtype=float), np.asarray(qvel, dtype=float)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        twists = np.zeros((len(links), 6))
        for twist, body in zip(twists, links, strict=True):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 0)
        coordinates = np.zeros(model.nv)
        single = np.isin(model.jnt_type, [int(k) for k in self.built.single])
        coordinates[model.jnt_dofadr[single]] = data.qpos[model.jnt_qposadr[single]]
        return LinkMotion(
            data.xmat[links].reshape(-1, 3, 3),
            data.xpos[links],
            twists[:, 3:],
            twists[:, :3],
            coordinates,
            data.qvel.copy(),
        )


class LibrarySteps:
    """Steps of a ported model by MuJoCo's library."""

    def __init__(self, ported: PortedModel):
        self.ported, self.tree = ported, ported.built.tree

    def begin(self, h: float) -> None:
        """Set the length of steps to h (s)."""
        self.ported.model.opt.timestep = h

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s)."""
        self.begin(h)
        self.ported.mujoco.mj_step(self.ported.model, self.ported.data, count)

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        data = self.ported.data
        return self.ported.motion(data.qpos.copy(), data.qvel.copy())


__all__ = ["FAMILIES", "OWN_STEPS", "STOCK", "WAY", "WAYS", "Port", "PortedModel"]
