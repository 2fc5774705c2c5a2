"""MuJoCo Warp: MuJoCo's model stepped by Warp's kernels in single precision, here on the processor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from crosscheck.engine import Alternatives, Setting
from crosscheck.engines.mujoco.ports import WAYS, Port, PortedModel
from crosscheck.engines.shared.own_steps import Steps
from crosscheck.engines.shared.spanning_tree import spanning_tree
from crosscheck.engines.shared.tree_reactions import LinkMotion
from crosscheck.engines.shared.warp_graphs import recorded
from mbref.scene import Scene


class Warp(Port):
    """MuJoCo Warp (PyPI ``mujoco-warp``)."""

    name = "warp"
    port = "MuJoCo Warp"
    package = "mujoco-warp"
    rounding = 2.0**-23
    alternatives = (Alternatives(WAYS, 1e-2),)

    def prepare(self, families: Sequence[str]) -> None:
        _warp()

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings with steps chosen by the angle that a body turns in one step.

        Without loops and couplings the finest step of a family is left out: there, rounding in single
        precision exceeds the error of RK4 at longer steps already. Closures and couplings become stiffer with
        finer steps.
        """
        found = super().settings(scene)
        if scene.coupling or spanning_tree(scene).closures:
            return found
        return [
            s
            for s, finer in zip(found, [*found[1:], None], strict=True)
            if finer and finer.family == s.family
        ]

    def in_port(self, ported: PortedModel, family: str) -> Steps:
        """Return a model of MuJoCo in Warp."""
        return _World(ported)


def _warp() -> Any:
    """Return the module mujoco_warp, set such that Warp prints nothing while it compiles kernels."""
    import warp

    warp.config.log_level = warp.LOG_ERROR
    import mujoco_warp

    return mujoco_warp


class _World:
    """A model and its data in Warp."""

    def __init__(self, ported: PortedModel):
        warp, self.ported, self.tree = _warp(), ported, ported.built.tree
        self.model, self.data = warp.put_model(ported.model), warp.put_data(ported.model, ported.data)
        self.once = recorded(lambda: warp.step(self.model, self.data))

    def begin(self, h: float) -> None:
        """Set the length of steps to h (s)."""
        self.model.opt.timestep.fill_(h)

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s)."""
        self.begin(h)
        for _ in range(count):
            self.once()

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        return self.ported.motion(self.data.qpos.numpy()[0], self.data.qvel.numpy()[0])


ENGINE = Warp()
