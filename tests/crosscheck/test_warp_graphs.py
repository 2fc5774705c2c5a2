"""Recorded steps of MuJoCo Warp and Newton / the steps of the library, called from Python."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.engine import Setting
from crosscheck.engines.newton import adapter as of_newton
from crosscheck.engines.newton import solvers
from crosscheck.engines.warp import adapter as of_warp
from mbref.scene import Force, Scene

pytestmark = pytest.mark.slow  # kernels are compiled for minutes first
STEP, COUNT = 1e-3, 20
APART = 1e-6  # m; distance after COUNT steps, by rounding to single precision


def pulled() -> Scene:
    """Return a four-bar whose coupler is pulled by a force that changes with time."""
    growing = {"polynomial": (0.5, 40.0)}
    pull = Force(body="b", point=(0.1, 0.2, 0.0), force=(30.0, -20.0, 0.0), factor=growing)
    return DIFFICULTIES[0].make().with_(load=(pull,))


def newton_world(setting: Setting) -> of_newton._World:
    return of_newton.ENGINE.simulation(pulled(), np.array([0.0, COUNT * STEP]), setting).stepper


@pytest.mark.parametrize("family", solvers.FAMILIES)
def test_recorded_steps_of_newton_are_its_steps(family: str) -> None:
    pytest.importorskip("newton")
    if family == solvers.MUJOCO:
        pytest.importorskip("mujoco_warp")
    options = {"step": STEP, "alpha": solvers.ALPHAS.get(family, 0.0)}
    recorded, plain = (newton_world(Setting(family, options)) for _ in range(2))
    recorded.step(0.0, STEP, COUNT)
    mechanism = plain.mechanism
    for n in range(COUNT):
        mechanism.push(plain.loads.at(n * STEP))
        plain.solver.step(mechanism.state, plain.after, plain.control, None, STEP)
        mechanism.state, plain.after = plain.after, mechanism.state
    apart = np.abs(recorded.motion().position - plain.motion().position).max()
    assert apart <= APART


@pytest.mark.parametrize("family", ["stock", "euler", "defaults"])
def test_recorded_steps_of_mujoco_warp_are_its_steps(family: str) -> None:
    warp = pytest.importorskip("mujoco_warp")
    scene = DIFFICULTIES[0].make()
    recorded, plain = (of_warp.ENGINE.world(scene, Setting(family, {"step": STEP})) for _ in range(2))
    recorded.step(0.0, STEP, COUNT)
    plain.model.opt.timestep.fill_(STEP)
    for _ in range(COUNT):
        warp.step(plain.model, plain.data)
    assert np.array_equal(recorded.motion().position, plain.motion().position)
