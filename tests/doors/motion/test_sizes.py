"""Outcome and message of a run do not depend on the size of the mechanism."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.conformance.relations import in_other_units
from mbref import find_scene, simulate


def ends(scene):
    run = simulate(scene, times=[scene.duration])
    return (run.outcome, run.message, len(run.crossings)), run.position


@pytest.mark.parametrize(("length", "time"), [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e3)])
@pytest.mark.parametrize("name", ["four_bar_quarter", "flyball_governor", "bennett"])
def test_built_in_scenes_end_alike_at_every_size(name, length, time):
    scene = find_scene(name)
    scene = scene.with_(duration=min(scene.duration, 0.2))
    (expected, place), (found, other) = ends(scene), ends(in_other_units(scene, length, time))
    assert found == expected
    assert np.allclose(other / length, place, rtol=0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200))
def test_random_mechanisms_end_alike_at_every_size(seed):
    scene = random_mechanism(seed)
    assert ends(in_other_units(scene, (1e-6, 1e-3, 1e3, 1e6)[seed % 4], 1.0))[0] == ends(scene)[0]
