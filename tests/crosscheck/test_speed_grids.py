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


def test_compiled_families_get_two_shortest_steps_and_a_rate_for_each_scan(grids):
    scene = SCENES["planar_slider_crank_heavy"]()
    given = [Setting("forward, compiled", {"rtol": 1e-3, "min_step": 0.01, "beta": 4.0, "hard": 1e-9})]
    rate = {1e-6: 10.0, 1e-10: 300.0}

    def score(setting: Setting) -> float:
        return abs(setting.options["beta"] - rate[setting.options["rtol"]])

    found = list(grids.refined(given, scene, True, score))
    swept = {(s.options["min_step"], s.options["beta"]) for s in found}
    assert swept == {(h, beta) for h in (0.01, 0.0025) for beta in (10.0, 300.0)} and len(found) == 4 * 19
    tolerances = [s.options["rtol"] for s in found[:19]]
    assert tolerances == sorted(tolerances, reverse=True)


def test_every_family_says_whose_integrator_it_has(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from speed import COMPILED_HERE, OPPONENTS, OURSELVES, OWN, _integrator

    assert _integrator("mujoco", "tuned") == _integrator("mbref", "taylor") == OWN
    assert (
        _integrator("pinocchio", "tuned, compiled")
        == _integrator("mujoco", "newton, compiled")
        == COMPILED_HERE
    )
    assert _integrator("pinocchio", "tuned") not in (OWN, COMPILED_HERE)
    assert OPPONENTS["own integrators"][1] == (OWN,) and OPPONENTS["engines"][1] == ()
    ours = {
        family: [w for w, belongs in OURSELVES.items() if belongs(family)]
        for family in ("taylor", "taylor, generated", "lm2+projection")
    }
    assert ours == {
        "taylor": ["series"],
        "taylor, generated": ["series"],
        "lm2+projection": ["other methods"],
    }


def test_a_whole_process_pays_after_the_construction_is_earned(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from whole_process import candidates, even

    ours, theirs = (0.1, 0.005, 0.6), (1.0, 0.001, 0.2)
    assert even(ours, 0.002, theirs, 0.004, 1) == "2"
    assert even(ours, 0.002, theirs, 0.004, 2) == "202"
    assert even(theirs, 0.002, ours, 0.004, 2) == "0"
    assert even(ours, 0.004, theirs, 0.002, 1) == "never"
    assert even(theirs, 0.004, ours, 0.002, 1) == "until 2"

    def run(family: str, error: float | None, seconds: float) -> dict:
        return {
            "engine": "mujoco",
            "family": family,
            "options": {"rtol": seconds},
            "outcome": "COMPLETED",
            "error": error,
            "seconds": [seconds],
            "cost": {"seconds": seconds},
        }

    curves = [
        {"engine": "mujoco", "family": f, "cost": [1.0, c, None]}
        for f, c in (("tuned", 3.0), ("stock", 2.0), ("forward, compiled", 1.0), ("defaults", None))
    ]
    made = (
        ("tuned", 1e-7, 3.0),
        ("stock", 1e-7, 2.5),
        ("stock", 1e-8, 2.0),
        ("stock", None, 0.1),
        ("forward, compiled", 1e-7, 1.0),
    )
    runs = [run(*numbers) for numbers in made]
    found = candidates({"levels": [1e-3, 1e-6, 1e-9], "curves": curves, "runs": runs})
    assert [(c.family, c.options["rtol"]) for c in found] == [("stock", 2.0), ("forward, compiled", 1.0)]


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
