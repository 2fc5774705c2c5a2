"""The chain of four-bars as an expert would write it for MuJoCo: hinges in the plane, and one closure for
each loop.

The generic mapping of a scene has three dimensions and universal joints; this is the least that MuJoCo needs.
The compliance of closures is scaled down, so that Newton's method satisfies the closures in one or two
iterations. Closure errors decay by feedback at a rate of 1/s. Unused parts of MuJoCo are switched off.  Other
numbers of iterations and of line-search steps, other scales, rates of feedback and solvers were found to be
more expensive.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.mujoco.compiled_run import leave_out_unused
from crosscheck.engines.mujoco.context import context
from crosscheck.engines.mujoco.rates import rates
from crosscheck.engines.shared.compiled import dop853

STIFFEST = "0.9999 0.9999 0.001"
UNUSED = " ".join(f'{name}="disable"' for name in ("island", "spring", "damper", "autoreset", "refsafe"))
FEEDBACK = "-1 -2"  # stiffness and damping of a closure's error (1/s², 1/s)
MOST_STEPS = 10**6


class Solver(NamedTuple):
    """Settings by which MuJoCo satisfies closures: factor ``scale`` on their compliance, iterations, steps of
    the line search."""

    scale: float
    iterations: int
    line_search: int


FASTEST, EXACT = Solver(1e-4, 1, 1), Solver(1e-8, 2, 4)


def xml(loops: int, step: float) -> str:
    """Return the model: every upright carries the bar to its right, whose end is connected to the next
    upright."""
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
        f'<mujoco><option gravity="0 -9.81 0" integrator="RK4" timestep="{step!r}" tolerance="0">'
        f'<flag {UNUSED}/></option><size memory="200M"/><default><equality solref="{FEEDBACK}" '
        f'solimp="{STIFFEST}"/></default><worldbody>{"".join(bodies)}</worldbody>'
        f"<equality>{''.join(closures)}</equality></mujoco>"
    )


def model_of(loops: int, step: float, solver: Solver) -> Any:
    """The compiled model."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(xml(loops, step))
    leave_out_unused(mujoco, model)
    model.body_invweight0[:] *= solver.scale
    model.dof_invweight0[:] *= solver.scale
    model.opt.iterations, model.opt.ls_iterations = solver.iterations, solver.line_search
    return model


class Chain:
    """A compiled chain, run again and again from the upright position at -1 rad/s."""

    def __init__(self, loops: int, step: float, solver: Solver = FASTEST):
        import mujoco

        self.mujoco, self.model = mujoco, model_of(loops, step, solver)

    def start(self) -> Any:
        """Data at the start."""
        data = self.mujoco.MjData(self.model)
        data.qvel[:] = np.where(np.arange(self.model.nv) % 2 == 0, -1.0, 1.0)
        return data

    def centres(self, data: Any) -> np.ndarray:
        """The centres (nb, 3) of uprights and bars at the data's coordinates."""
        self.mujoco.mj_kinematics(self.model, data)
        return np.concatenate([data.xipos[1::2], data.xipos[2::2]])

    def run(self, steps: int) -> tuple[float, np.ndarray]:
        """Return the process CPU seconds of a number of steps by MuJoCo's own RK4, and the centres (nb, 3)
        after these steps."""
        data = self.start()
        began = time.process_time()
        self.mujoco.mj_step(self.model, data, nstep=steps)
        return time.process_time() - began, self.centres(data)

    def run_dop853(self, duration: float, rtol: float) -> tuple[float, int, np.ndarray]:
        """As ``run``, with the number of steps, by ``mj_forward`` in crosscheck's compiled DOP853."""
        data = self.start()
        numbers, start = context(self.model, data, []), np.concatenate([data.qpos, data.qvel])
        system = dop853.System(
            int(rates.address or 0),
            numbers.address,
            numbers.quaternions,
            rtol,
            rtol,
            0.0,
            duration,
            MOST_STEPS,
            0,
        )
        memory, samples = dop853.memory(start), np.zeros((1, len(start)))
        began = time.process_time()
        status, _ = dop853.integrate(system, np.array([duration]), samples, memory)
        seconds = time.process_time() - began
        if status != dop853.REACHED:
            raise RuntimeError(f"MuJoCo in DOP853 at a tolerance of {rtol:g} ends with status {status}")
        data.qpos[:] = samples[0, : self.model.nq]
        return seconds, int(memory.counts[dop853.STEPS]), self.centres(data)
