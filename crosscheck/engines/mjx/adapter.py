"""MuJoCo MJX: MuJoCo's model stepped by code in JAX, here on the processor, in double precision except in the
family SINGLE.

JAX compiles code for each structure of a model before the timed run, for 5 to 70 s of CPU time, and stores it
in the user's cache folder for later processes.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

from crosscheck.engine import Alternatives, Setting
from crosscheck.engines.mjx.derivatives import Differentiated
from crosscheck.engines.mjx.library import imported
from crosscheck.engines.mujoco.ports import FAMILIES, OWN_STEPS, STOCK, WAY, WAYS, Port, PortedModel
from crosscheck.engines.shared import file_cache
from crosscheck.engines.shared.own_steps import Steps
from crosscheck.engines.shared.tree_reactions import LinkMotion

SINGLE = "stock, single"


class Mjx(Differentiated, Port):
    """MuJoCo MJX (PyPI ``mujoco-mjx``)."""

    name = "mjx"
    port = "MJX"
    package = "mujoco-mjx"
    families = FAMILIES | {SINGLE: "like stock, in single precision, which is JAX's default"}
    own_steps = OWN_STEPS | {SINGLE: {}}
    compile_seconds = 300.0
    alternatives = (
        Alternatives(WAYS, 1e-5),
        Alternatives({"port, double": Setting(STOCK, WAY), "port, single": Setting(SINGLE, WAY)}, 1e-2),
    )

    def prepare(self, families: Sequence[str]) -> None:
        imported()

    def in_port(self, ported: PortedModel, family: str) -> Steps:
        """Return a model of MuJoCo in JAX."""
        return _World(ported, family == SINGLE)


@functools.cache
def _stepped(is_single: bool) -> Any:
    """Return the function of (model, data, number of steps) that JAX compiles for each structure of a model.

    Models that differ only in numbers, such as masses and places, share the compiled code.
    """
    jax, mjx = imported(is_single)

    def once(model: Any, now: Any) -> Any:
        # MJX 3.17 makes 64-bit integers of some 32-bit indices of tendons, which a loop of JAX refuses
        return jax.tree.map(lambda old, new: new.astype(old.dtype), now, mjx.step(model, now))

    def stepped(model: Any, data: Any, count: Any) -> Any:
        return jax.lax.fori_loop(0, count, lambda _, now: once(model, now), data)

    return jax.jit(stepped)


class _World:
    """A model and its data in JAX, and compiled code that takes steps."""

    def __init__(self, ported: PortedModel, is_single: bool):
        _, mjx = imported(is_single)
        self.ported, self.tree = ported, ported.built.tree
        self.model = mjx.put_model(ported.model)
        self.data = mjx.put_data(ported.model, ported.data)

        self.stepped = _stepped(is_single)
        self.stepped(self.model, self.data, 0)  # compiles the code before the timed run
        file_cache.remove_oldest(file_cache.cache("mjx"))

    def begin(self, h: float) -> None:
        """Set the length of steps to h (s)."""
        self.model = self.model.tree_replace({"opt.timestep": self.model.opt.timestep * 0 + h})

    def step(self, t: float, h: float, count: int) -> None:
        """Take ``count`` steps of length h (s)."""
        self.begin(h)
        self.data = self.stepped(self.model, self.data, count)
        self.data.qpos.block_until_ready()

    def motion(self) -> LinkMotion:
        """Return the motion of the links."""
        return self.ported.motion(self.data.qpos, self.data.qvel)


ENGINE = Mjx()
