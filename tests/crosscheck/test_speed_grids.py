"""The settings and the words of the speed comparison; no time is measured."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from crosscheck.engine import Setting, engine, engine_names
from crosscheck.engines.mujoco.families import COMPILED
from mbref.scenes import SCENES

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def grids(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import grids

    return grids


def test_tolerances_are_half_decades_to_a_millionth_of_a_millionth(grids):
    found = grids.half_decades()
    assert (found[0], found[1], found[-1], len(found)) == (1e-3, 3.2e-4, 1e-12, 19)


def test_closures_get_the_rate_of_least_cost_and_no_shortest_step(grids):
    scene = SCENES["four_bar_gravity"]()
    given = [
        Setting("stock", {"step": 1e-3}),
        Setting("forward", {"rtol": 1e-3, "min_step": 0.01, "beta": 4000.0}),
        Setting("forward", {"rtol": 1e-6, "min_step": 0.01, "beta": 4000.0}),
    ]
    found = list(grids.refined(given, scene, False, lambda s: abs(s.options["beta"] - 25.0)))
    assert found[0] == given[0] and len(found) == 20
    assert {s.options["beta"] for s in found[1:]} == {30.0}
    assert {s.options["min_step"] for s in found[1:]} == {1e-9 * scene.duration}
    kept = list(grids.refined(given, scene, True, lambda s: -s.options["beta"]))
    assert {(s.options["beta"], s.options["min_step"]) for s in kept[1:]} == {(4000.0, 0.01)}


def test_only_scenes_with_singular_positions_keep_the_shortest_step(grids):
    assert grids.passes_singular_position(SCENES["planar_slider_crank_heavy"]())
    assert not grids.passes_singular_position(SCENES["planar_slider_crank_gravity"]())


def test_a_family_that_just_misses_a_level_is_named(grids):
    rows = [
        {"engine": "p", "family": "tuned", "cost": [0.1, math.inf], "least": (1.3e-9, 0.5)},
        {"engine": "p", "family": "rk4", "cost": [0.3, 2.0], "least": (1e-10, 3.0)},
        {"engine": "m", "family": "forward", "cost": [0.1, 0.2], "least": (1e-12, 0.5)},
    ]
    (sentence,) = grids.misses(rows, (1e-6, 1e-9))
    assert "tuned" in sentence and "1.3e-09 at 500 ms/s" in sentence and "by little" in sentence


def test_a_failed_run_is_no_candidate(grids):
    assert grids.cost_at_one_error(0.1, math.inf) == math.inf
    assert grids.cost_at_one_error(0.1, 1e-8) < grids.cost_at_one_error(0.1, 1e-4)


def test_families_integrated_by_crosscheck_are_families():
    named = {name: set(engine(name).integrated_here) for name in engine_names()}
    assert named["mujoco"] == {"forward", "projected", *COMPILED}
    for name, families in named.items():
        assert families <= set(engine(name).families), name
