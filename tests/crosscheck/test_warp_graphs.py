"""Recorded steps of MuJoCo Warp and Newton / the steps of the library, called from Python."""

import numpy as np
import pytest

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.engine import Setting
from crosscheck.engines.warp import adapter as of_warp

pytestmark = pytest.mark.slow  # kernels are compiled for minutes first
STEP, COUNT = 1e-3, 20


@pytest.mark.parametrize("family", ["stock", "euler", "defaults"])
def test_recorded_graph_of_mujoco_warp_moves_as_its_single_steps(family: str) -> None:
    """20 steps of 1 ms by the adapter's graph and the library's own step function: equal to the last bit."""
    warp = pytest.importorskip("mujoco_warp")
    scene = DIFFICULTIES[0].make()
    recorded, plain = (of_warp.ENGINE.world(scene, Setting(family, {"step": STEP})) for _ in range(2))
    recorded.step(0.0, STEP, COUNT)
    plain.model.opt.timestep.fill_(STEP)
    for _ in range(COUNT):
        warp.step(plain.model, plain.data)
    assert np.array_equal(recorded.motion().position, plain.motion().position)
