"""MuJoCo Warp: MuJoCo's model stepped by Warp's kernels in single precision, here on the processor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting
from crosscheck.engines.fixed_steps import FixedSteps, simulated
from crosscheck.engines.mujoco.ports import FAMILIES, OPTIONS, SUPPORTS, PortedModel, refusal, sweep
from crosscheck.engines.spanning_tree import spanning_tree
from crosscheck.engines.tree_reactions import LinkMotion
from crosscheck.engines.warp_graphs import recorded
from mbref.scene import Scene
from mbref.trajectory import Trajectory


class Warp(Engine):
    """MuJoCo Warp (PyPI ``mujoco-warp``)."""

    name = "warp"
    package = "mujoco-warp"
    supports = SUPPORTS
    families, options = FAMILIES, OPTIONS
    rounding = 2.0**-23

    def prepare(self, families: Sequence[str]) -> None:
        _warp()

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse drivers, and scenes that MuJoCo's adapter refuses."""
        return refusal(scene, "MuJoCo Warp")

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings with steps chosen by the angle that a body turns in one step.

        Without loops the finest step of a family is left out: there, rounding in single precision exceeds the
        error of RK4 at longer steps already. Closures become stiffer with finer steps.
        """
        found = sweep(scene)
        if spanning_tree(scene).closures:
            return found
        return [
            s
            for s, finer in zip(found, [*found[1:], None], strict=True)
            if finer and finer.family == s.family
        ]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        return simulated(self, scene, times, setting, lambda: _simulation(scene, setting))


def _warp() -> Any:
    """Return the module mujoco_warp, set such that Warp prints nothing while it compiles kernels."""
    import warp

    warp.config.log_level = warp.LOG_ERROR
    import mujoco_warp

    return mujoco_warp


def _simulation(scene: Scene, setting: Setting) -> FixedSteps:
    world = _World(PortedModel(scene, setting))
    return FixedSteps(scene, world.ported.built.tree, world, setting.options["step"])


class _World:
    """A model and its data in Warp."""

    def __init__(self, ported: PortedModel):
        warp, self.ported = _warp(), ported
        self.model, self.data = warp.put_model(ported.model), warp.put_data(ported.model, ported.data)
        self.once = recorded(lambda: warp.step(self.model, self.data))

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s)."""
        self.model.opt.timestep.fill_(h)
        for _ in range(count):
            self.once()

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        return self.ported.motion(self.data.qpos.numpy()[0], self.data.qvel.numpy()[0])


ENGINE = Warp()
