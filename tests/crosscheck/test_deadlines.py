"""Limits of CPU time: hard and random scenes with 1 s / the CPU time that was spent, never wall time."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.judge.arithmetic import EXTENDED
from crosscheck.judge.deadline import TimeIsUp, ask, within
from crosscheck.judge.reference.certify import NotCertified, certified
from crosscheck.judge.reference.motion import OVER
from crosscheck.judge.reference.reference import runs
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.paper import settings
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.scenes.four_bar_chain import four_bar_chain

LIMIT = 1.0  # s
FACTOR, ALLOWED = 2.0, 2.0  # CPU time: so many times the limit, and s of set-up that no limit covers


def uneven_five_bar() -> Scene:
    """The paper's five-bar with errors of 1e-8 m in its anchors: correcting the coordinates near its first
    singular position makes the rows four times blunter, and no step was short enough."""
    return settings.imprecise(settings.kinematic(SCENES["five_bar"]()), 1e-8, 0)


HARD: dict[str, tuple[Callable[[], Scene], float]] = {
    "uneven five-bar": (uneven_five_bar, 20.0),
    "chain of 12 loops": (lambda: four_bar_chain(12), 20.0),
    "squeezer": (SCENES["andrews_squeezer"], 1.0),
    "stiff governor": (SCENES["flyball_governor"], 10.0),
    "equal slider-crank": (SCENES["planar_slider_crank_heavy"], 20.0),
    **{f"random {k}": (lambda k=k: random_mechanism(k), 10.0) for k in (1, 5)},
}


def cpu_seconds(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


@pytest.mark.parametrize("name", HARD)
def test_reference_and_its_limit(name):
    make, end = HARD[name]
    scene, times = make(), np.linspace(0.0, end, 101)
    spent = cpu_seconds(lambda: runs(scene, times, LIMIT))
    assert spent < FACTOR * LIMIT + ALLOWED, f"{name}: {spent:.1f} s of CPU time, the limit was {LIMIT} s"


def test_sharpness_and_the_coordinates_that_a_step_begins_with():
    """Correcting the coordinates makes them four times blunter: judged by the sharpness before, no step from
    there is short enough, and the motion ends at 0.01259 s."""
    motion = natural_motion(uneven_five_bar(), [0.0126], EXTENDED, seconds=20.0)
    assert not motion.reason and len(motion.times), f"{motion.reason} at {motion.reached:.6f} s"


def test_digits_and_their_limit():
    pytest.importorskip("flint")
    scene = SCENES["andrews_squeezer"]()

    def table() -> None:
        with pytest.raises(NotCertified, match=OVER):
            certified(scene, np.linspace(0.0, 0.05, 3), 20, seconds=LIMIT)

    spent = cpu_seconds(table)
    assert spent < FACTOR * LIMIT + ALLOWED, f"{spent:.1f} s of CPU time, the limit was {LIMIT} s"


def test_limit_within_a_limit_and_the_sooner_one():
    with within(100.0):
        with within(-1.0), pytest.raises(TimeIsUp):
            ask()
        ask()
        with within(-1.0), within(100.0), pytest.raises(TimeIsUp):
            ask()
    ask()
