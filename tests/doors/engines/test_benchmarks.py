"""Engines of benchmarks/, by equations derived by hand or SciPy's integrators, give true motions."""

from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting
from mbref.scenes import SCENES
from tests.helpers.measured import relative_error

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
# scenes in closed form, and one whose equation is integrated; others take seconds to compile
QUICK = ("four_bar", "spatial_slider_crank_driven", "planar_slider_crank_gravity")
PLANAR = [f"planar_slider_crank{variant}" for variant in ("", "_equal", "_heavy", "_gravity")]
SPATIAL = [f"spatial_slider_crank{variant}" for variant in ("", "_driven", "_gravity")]
BY_HAND = ("four_bar", "five_bar", "four_bar_gravity", "five_bar_gravity", *PLANAR, *SPATIAL)


@pytest.fixture(autouse=True)
def _benchmarks_importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def error_of(simulator, name: str, setting: Setting) -> float:
    scene = SCENES[name]()
    run = simulator.run(scene, np.linspace(0, scene.duration, 5), setting)
    return relative_error(run, scene)


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in BY_HAND]
)
def test_equation_derived_by_hand_gives_the_true_motion(name: str):
    """LIMIT of benchmarks/limit.py integrates the equation at its finest setting. The error from the judge's
    truth, a closed form or a solution of an equation of the judge, is below 1e-8 of the length or rad."""
    from limit import LIMIT

    scene = SCENES[name]()
    assert LIMIT.cannot(scene) is None
    assert error_of(LIMIT, name, LIMIT.settings(scene)[-1]) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("family", ["DOP853", "Radau"])
def test_scipys_integrators_reach_the_true_motion_at_a_fine_tolerance(family: str):
    """Errors, of the length or rad, exceed 1e-4 at a tolerance of 1e-5, and are below 1e-7 at 1e-9."""
    from general_integrators import SCIPY

    settings = (Setting(family, {"rtol": rtol}) for rtol in (1e-5, 1e-9))
    coarse, fine = (error_of(SCIPY, "spatial_slider_crank_driven", setting) for setting in settings)
    assert fine < 1e-7 and coarse > 1e-4, (coarse, fine)
