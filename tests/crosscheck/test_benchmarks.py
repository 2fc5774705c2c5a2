"""Benchmarks: equations derived by hand, and general integrators / truth."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from crosscheck.processes.pool import run_isolated
from mbref.scenes import SCENES

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
ERROR = 1e-8  # at the finest tolerances, 1e-11: rounding grows by the sensitivity of the fast scenes
QUICK = {  # closed forms, and one of the equations, which take seconds to compile
    "four_bar",
    "spatial_slider_crank_driven",
    "planar_slider_crank_gravity",
}
BY_HAND = (
    "four_bar", "five_bar", "spatial_slider_crank_driven", "four_bar_gravity", "five_bar_gravity",
    "planar_slider_crank", "planar_slider_crank_equal", "planar_slider_crank_heavy",
    "planar_slider_crank_gravity", "spatial_slider_crank", "spatial_slider_crank_gravity",
)  # fmt: skip


@pytest.fixture(autouse=True)
def _benchmarks_importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def error_of(simulator, name: str, setting: Setting) -> float:
    scene = SCENES[name]()
    run = simulator.run(scene, np.linspace(0, scene.duration, 5), setting)
    assert run.outcome.name == "COMPLETED", run.message
    return measure(scene, run, truth_for(scene))["error"]


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in BY_HAND]
)
def test_equation_derived_by_hand_and_truth_agree(name: str):
    from limit import LIMIT

    scene = SCENES[name]()
    assert LIMIT.cannot(scene) is None
    error = error_of(LIMIT, name, LIMIT.settings(scene)[-1])
    assert error < ERROR, f"{name}: off by {error:.1e}, allowed {ERROR:.0e}"


@pytest.mark.slow
@pytest.mark.parametrize("family", ["DOP853", "Radau"])
def test_general_integrators_and_truth_agree(family: str):
    from general_integrators import SCIPY

    coarse, fine = (
        error_of(SCIPY, "spatial_slider_crank_driven", Setting(family, {"rtol": r})) for r in (1e-5, 1e-9)
    )
    assert fine < 1e-7 < coarse, f"errors {coarse:.1e} and {fine:.1e} at tolerances of 1e-5 and 1e-9"


@pytest.mark.parametrize("name", ["planar_slider_crank_equal", "spatial_slider_crank", "four_bar_gravity"])
def test_joint_coordinates_and_truth_agree(name: str):
    from scipy.integrate import solve_ivp
    from tree_equations import NUMBERS, TreeEquations

    scene = SCENES[name]()
    equations, end = TreeEquations(scene), 0.1 * scene.duration

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        q, v = np.split(y, 2)
        return np.concatenate((v, equations.accelerations(q, v, NUMBERS, 0.0).astype(float)))

    found = solve_ivp(rates, (0, end), equations.start, "DOP853", rtol=1e-9, atol=1e-9).y[:, -1]
    motion, exact = equations.motion(found[None]), truth_for(scene).poses(np.array([end]))
    off = np.abs(motion["position"] - exact.position).max()
    assert off < 1e-7, f"{name}: off by {off:.1e}"


def test_one_step_onto_the_closures_leaves_the_square_of_their_errors():
    from tree_equations import NUMBERS, TreeEquations

    equations = TreeEquations(SCENES["spatial_slider_crank"]())
    left = []
    for size in (1e-3, 1e-4):
        q, v = np.split(equations.start, 2)
        settled, rates = equations.settled(q + size, v, NUMBERS)
        violation, _, _ = equations._closures(equations.frames(settled, rates, NUMBERS))
        left.append(np.abs(violation.astype(float)).max())
    assert left[0] < 1e-5 and left[1] < 0.02 * left[0], left


def test_equations_of_other_mechanisms_are_refused():
    from tree_equations import TreeEquations

    for name, reason in {"four_bar": "drivers", "flyball_governor": "loads", "heavy_top": "ball"}.items():
        with pytest.raises(ValueError, match=reason):
            TreeEquations(SCENES[name]())


@pytest.mark.parametrize("name", ["casadi", "heyoka"])
def test_generated_code_and_truth_agree(name: str):
    """In a child process: CasADi and OpenSim do not share one."""
    if find_spec(name) is None:
        pytest.skip(f"{name} is not installed (extra generators)")
    scene, generator = SCENES["planar_slider_crank_gravity"](), f"code_generators:{name.upper()}"
    setting = engine(generator).settings(scene)[-1]
    options = {**setting.options, "rtol": 1e-10} if "rtol" in setting.options else setting.options
    times = np.linspace(0, scene.duration, 5)
    run = run_isolated(generator, scene, times, Setting(setting.family, options), 60.0)
    assert run.outcome.name == "COMPLETED", run.message
    error = measure(scene, run, truth_for(scene))["error"]
    assert error < ERROR, f"off by {error:.1e}, allowed {ERROR:.0e}"
