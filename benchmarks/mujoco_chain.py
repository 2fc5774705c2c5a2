"""The chain of four-bars as MuJoCo would have it written by hand: hinges in the plane and one loop each.

The generic mapping of a scene has three dimensions and universal joints; this is the least that MuJoCo needs.
"""

from __future__ import annotations

import time

import numpy as np

STIFFEST = "0.9999 0.9999 0.001"


def xml(loops: int, step: float) -> str:
    """The model: every upright carries the bar to its right, whose end is connected to the next upright."""
    inertial = (
        '<inertial pos="{}" mass="1" diaginertia="0.0833333333333333 0.0833333333333333 0.0833333333333333"/>'
    )
    hinge = '<joint type="hinge" axis="0 0 1"/>'
    bodies, closures = [], []
    for i in range(loops + 1):
        bar = (
            f'<body name="bar{i}" pos="0 1 0">{inertial.format("0.5 0 0")}{hinge}</body>' if i < loops else ""
        )
        bodies.append(
            f'<body name="upright{i}" pos="{i} 0 0">{inertial.format("0 0.5 0")}{hinge}{bar}</body>'
        )
        if i < loops:
            closures.append(f'<connect body1="bar{i}" body2="upright{i + 1}" anchor="1 0 0"/>')
    return (
        f'<mujoco><option gravity="0 -9.81 0" integrator="RK4" timestep="{step!r}" tolerance="1e-14" '
        f'iterations="20"/><size memory="200M"/><default><equality solref="{2 * step!r} 1" '
        f'solimp="{STIFFEST}"/></default><worldbody>{"".join(bodies)}</worldbody>'
        f"<equality>{''.join(closures)}</equality></mujoco>"
    )


class Chain:
    """A compiled chain, run again and again from the upright position at -1 rad/s."""

    def __init__(self, loops: int, step: float):
        import mujoco

        self._step, self._forward = mujoco.mj_step, mujoco.mj_forward
        self.model = mujoco.MjModel.from_xml_string(xml(loops, step))
        self._data = mujoco.MjData

    def run(self, steps: int) -> tuple[float, np.ndarray]:
        """Process CPU seconds of so many steps, and the centres (nb, 3) of uprights and bars after them."""
        data = self._data(self.model)
        data.qvel[:] = np.where(np.arange(self.model.nv) % 2 == 0, -1.0, 1.0)
        began = time.process_time()
        self._step(self.model, data, nstep=steps)
        seconds = time.process_time() - began
        self._forward(self.model, data)
        return seconds, np.concatenate([data.xipos[1::2], data.xipos[2::2]])
