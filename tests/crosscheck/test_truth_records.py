"""Records of truths / references and closed forms that end early, or at their start, worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge.truth import NoSolution
from crosscheck.study import truths
from mbref.scene import Body, Scene
from mbref.trajectory import Trajectory

SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),),
    duration=2.0,
)


class Family:
    """A closed form of a body that turns about z at 6.99 rad/s, known up to a time."""

    name, accuracy = "turning", 1e-12

    def __init__(self, until: float):
        self.until = until

    def poses(self, times: np.ndarray) -> Trajectory:
        if times.max(initial=0.0) > self.until:
            raise NoSolution("it locks", self.until)
        k = len(times)
        spin = np.zeros((k, 1, 3))
        spin[..., 2] = 6.99
        still = np.zeros((k, 1, 3))
        turned = np.array([[[math.cos(3.495 * t), 0.0, 0.0, math.sin(3.495 * t)]] for t in times]).reshape(
            k, 1, 4
        )
        return Trajectory("s", "truth", "", "", {}, times, ("b",), still, turned, still, spin)


def test_frames_end_after_ninety_steps_of_a_body_s_turn():
    """Frames are at most 0.35 rad of a body apart: 90 steps are 31.5 rad, at 6.99 rad/s until 4.5 s. At a
    tenth of this rate they cover all of the 9 s. A motion of four samples has four frames."""
    times = np.linspace(0.0, 9.0, 901)
    fast = Family(9.0).poses(times)
    chosen = truths.shown(fast)
    assert (chosen[0], times[chosen[-1]], len(chosen)) == (0, pytest.approx(4.5), 91)
    slow = replace(fast, angular_velocity=fast.angular_velocity / 10)
    assert truths.shown(slow)[-1] == 900 and len(truths.shown(slow)) == 91
    few = Family(9.0).poses(times[:4])
    assert truths.shown(few).tolist() == [0, 1, 2, 3]
