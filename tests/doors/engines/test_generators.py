"""Engines with generated code, CasADi and heyoka: true motions, refusals, and files in the cache. Runs are in
child processes: CasADi and OpenSim do not share one."""

from importlib.util import find_spec

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from crosscheck.engine import GENERATORS, Owner, Setting, engine
from crosscheck.engines.casadi import library
from crosscheck.engines.shared import file_cache
from crosscheck.engines.shared.symbolic.equations import TreeEquations
from crosscheck.engines.shared.symbolic.symbols import NUMBERS
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from crosscheck.processes.pool import run_isolated
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scenes import SCENES

ERROR = 1e-8  # of the scene's length, rad, or the largest reaction, at tolerances of 1e-10 and less
SETTINGS = {
    "casadi": [
        Setting("projected, compiled", {"rtol": 1e-10, "min_step": 1e-9}),
        Setting("dop853, compiled", {"rtol": 1e-10, "min_step": 1e-9, "beta": 0.1}),
    ],
    "heyoka": [Setting("taylor", {"rtol": 1e-12})],
}
RUNS = [(name, setting) for name, settings in SETTINGS.items() for setting in settings]


def needs(name: str) -> None:
    """Skip the test if the engine's package, or CasADi's compiler, is missing."""
    if find_spec(name) is None:
        pytest.skip(f"{name} is not installed (extra generators)")
    if name == "casadi" and (reason := library.why_not()):
        pytest.skip(reason)


def run_of(name: str, scene_name: str, times: np.ndarray, setting: Setting) -> Trajectory:
    needs(name)
    return run_isolated(name, SCENES[scene_name](), times, setting, 60.0)


@pytest.mark.parametrize("name", ["planar_slider_crank_equal", "spatial_slider_crank", "four_bar_gravity"])
def test_symbolic_equations_of_a_tree_give_the_true_motion(name: str):
    """SciPy integrates the equations at a tolerance of 1e-9 over a tenth of the motion. Positions at its end
    differ from the judge's truth by less than a hundred tolerances, 1e-7 m."""
    scene = SCENES[name]()
    equations, end = TreeEquations(scene), 0.1 * scene.duration

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        q, v = np.split(y, 2)
        return np.concatenate((v, equations.accelerations(q, v, NUMBERS, 0.0).astype(float)))

    found = solve_ivp(rates, (0, end), equations.start, "DOP853", rtol=1e-9, atol=1e-9).y[:, -1]
    motion, exact = equations.link_motion(found)[0], truth_for(scene).poses(np.array([end]))
    assert np.abs(motion.position[list(equations.tree.own)] - exact.position[0]).max() < 1e-7


@pytest.mark.parametrize(("name", "setting"), RUNS, ids=str)
def test_generated_code_gives_the_true_motion_and_reactions(name: str, setting: Setting) -> None:
    """A slider-crank in space. Errors of poses, velocities and reactions from the judge's truth, relative to
    its length and largest values, are below 1e-8, at least a hundred tolerances."""
    scene = SCENES["spatial_slider_crank_gravity"]()
    run = run_of(name, scene.name, np.linspace(0, scene.duration, 5), setting)
    assert run.outcome is Outcome.COMPLETED, run.message
    found = measure(scene, run, truth_for(scene))
    for metric in ("error", "velocity_error", "reaction_error"):
        assert found[metric] < ERROR, f"{metric}: off by {found[metric]:.1e}, allowed {ERROR:.0e}"


@pytest.mark.parametrize("name", GENERATORS)
def test_motion_of_generated_code_does_not_depend_on_the_samples(name: str) -> None:
    """Runs have samples at 0.1 and 0.25 s, at 0, 0.1 and 0.25 s, and at 0 s alone. Positions of two runs at
    0.1 and 0.25 s differ by less than 1e-8 m, at least a hundred tolerances; at 0 s they are equal."""
    times, setting = np.array([0.1, 0.25]), SETTINGS[name][0]
    run = run_of(name, "planar_slider_crank_gravity", times, setting)
    whole = run_of(name, "planar_slider_crank_gravity", np.array([0.0, *times]), setting)
    assert run.outcome is Outcome.COMPLETED and np.array_equal(run.times, times), run.message
    assert np.abs(run.position - whole.position[1:]).max() < ERROR
    start = run_of(name, "planar_slider_crank_gravity", np.array([0.0]), setting)
    assert np.array_equal(start.position[0], whole.position[0])


@pytest.mark.parametrize("name", GENERATORS)
@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        ("four_bar", "driver"),
        ("flyball_governor", "'spring'"),
        ("heavy_top", "ball joints"),
        ("five_bar_gravity", "depend on each other"),
    ],
)
def test_scenes_without_symbolic_equations_are_refused_with_the_reason(name, scene, reason):
    """No symbolic equations are derived for a driver (four_bar), a spring (flyball_governor), a ball joint on
    the ground (heavy_top) and redundant closures (five_bar_gravity)."""
    found = engine(name).cannot(SCENES[scene]())
    assert found is not None and found.owner is Owner.ADAPTER and reason in found.reason, found


def test_casadi_refuses_scenes_if_no_c_compiler_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment variable CC names a program that does not exist."""
    monkeypatch.setenv("CC", "no-such-compiler")
    found = engine("casadi").cannot(SCENES["planar_slider_crank_gravity"]())
    assert found is not None and found.reason == "no C compiler is installed (no-such-compiler)", found


def test_a_file_in_the_cache_is_found_by_its_origin_unless_it_is_damaged(tmp_path, monkeypatch):
    """The origin is the text from which the file was made; damage changes the file's checksum."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert file_cache.stored("folder", "origin", ".txt") is None
    path = file_cache.store("folder", "origin", ".txt", lambda target: target.write_text("whole"))
    assert file_cache.stored("folder", "origin", ".txt") == path
    assert file_cache.stored("folder", "other", ".txt") is None
    path.write_text("damaged")
    assert file_cache.stored("folder", "origin", ".txt") is None
