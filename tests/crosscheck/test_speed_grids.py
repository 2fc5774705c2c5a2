"""Settings, groups and sentences of the speed comparison in ``benchmarks``; no time is measured."""

import math
from pathlib import Path

import pytest

from mbref.scenes import SCENES

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def grids(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import grids

    return grids


def test_speed_grid_recognises_scenes_with_singular_positions(grids):
    """Crank and rod of the heavy slider-crank are equally long, so that it has singular positions; the other
    slider-crank's are not."""
    assert grids.passes_singular_position(SCENES["planar_slider_crank_heavy"]())
    assert not grids.passes_singular_position(SCENES["planar_slider_crank_gravity"]())


def test_family_that_misses_a_level_by_little_is_named(grids):
    """The levels are 1e-6 and 1e-9. "tuned" reaches 1.3e-9 at best; "rk4" and "forward" reach both."""
    rows = [
        {"engine": "p", "family": "tuned", "cost": [0.1, math.inf], "least": (1.3e-9, 0.5)},
        {"engine": "p", "family": "rk4", "cost": [0.3, 2.0], "least": (1e-10, 3.0)},
        {"engine": "m", "family": "forward", "cost": [0.1, 0.2], "least": (1e-12, 0.5)},
    ]
    (sentence,) = grids.misses(rows, (1e-6, 1e-9))
    assert "tuned" in sentence and "1.3e-09 at 500 ms/s" in sentence and "by little" in sentence
