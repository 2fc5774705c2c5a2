"""Drawn mechanisms / every check: decided as often as asked, resumed from records, a defect found."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.conformance import random_scenes
from crosscheck.conformance.relations import RELATIONS
from crosscheck.judge.constraints import closure, closure_rates, initial_poses, initial_twists
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import violation_series
from mbref import Limits, simulate
from mbref.scene import GROUND
from mbref.trajectory import Outcome


def test_drawn_mechanisms_and_what_is_promised_of_them():
    """Joints and drivers hold, velocities are the given ones; every kind of load and driver is drawn."""
    scenes = list(map(random_scenes.mechanism, range(24)))
    for scene in [*scenes, *map(random_scenes.floating, range(6))]:
        pose, rates = initial_poses(scene), initial_twists(scene)
        rows = [*closure(scene, 0.0, *pose).values(), *closure_rates(scene, 0.0, *pose, *rates).values()]
        kept = np.abs(rates[0] - [body.velocity for body in scene.body]).max()
        assert max(kept, *(np.abs(row).max() for row in rows)) < 1e-12, scene.name
    assert {load.type for scene in scenes for load in scene.load} >= {"torsion_spring", "spring"}
    assert {
        joint.facts.driven
        for scene in scenes
        for d in scene.driver
        for joint in scene.joint
        if joint.name == d.joint
    } == {"angle", "displacement"}
    assert not any(scene.driver for scene in scenes[::2]), "an even seed has a driver"
    assert not any(GROUND in joint.bodies for joint in random_scenes.floating(3).joint)


@pytest.mark.parametrize("seed", [1001, 1005])
def test_redundant_rows_stay_so_in_an_exact_motion(seed):
    """Rows that are redundant at the start do not hold the motion when a step drifts."""
    scene = random_scenes.random_mechanism(seed).with_(duration=0.1)
    motion = gauss_motion(scene, (0.0, 0.05, 0.1))
    assert violation_series(scene, motion).max() < 1e-9


@pytest.mark.parametrize(("seed", "change"), [(101, "rotated"), (211, ""), (319, "rotated")])
def test_drawn_mechanism_that_mbref_did_not_run(seed, change):
    """A driven displacement had a part in series where none should be, and a wrong unit of length."""
    scene = random_scenes.mechanism(seed)
    scene = RELATIONS[change].change(scene, None) if change else scene
    run = simulate(scene, "taylor", np.linspace(0.0, scene.duration, 3), Limits(rtol=1e-9))
    assert run.outcome is Outcome.COMPLETED, run.message
