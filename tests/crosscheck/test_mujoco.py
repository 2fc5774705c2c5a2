"""MuJoCo / truths, and what an adapter must not leave behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import psutil
import pytest

from crosscheck.conformance.moving import moving_probes
from crosscheck.conformance.random_scenes import mechanism
from crosscheck.engine import Setting, engine
from crosscheck.engines.mujoco.adapter import ENGINE
from crosscheck.engines.mujoco.context import LIBRARIES, library
from crosscheck.engines.mujoco.families import ADAPTIVE, HARD
from crosscheck.engines.mujoco.model import compiled
from crosscheck.judge.metrics import error_series, order_of_convergence, violation_series
from mbref import rotations
from mbref.scene import Body, Driver, Scene
from mbref.scenes import SCENES
from mbref.trajectory import Outcome, Trajectory
from tests.crosscheck.measured import MARGIN, error
from tests.crosscheck.tree_scenes import every_joint

mujoco = pytest.importorskip("mujoco")

PAPER = {  # scene: duration (s), step (s), beta (1/s), measured error (m, rad)
    "planar_slider_crank": (0.2, 1.2e-5, 2000.0, 3.7e-9),
    "spatial_slider_crank": (0.02, 3e-6, 8000.0, 2.1e-10),
    "spatial_slider_crank_driven": (0.2, 2e-5, 1200.0, 1.8e-10),
    "four_bar": (0.02, 1e-4, 620.0, 1.5e-11),
    "five_bar": (0.02, 1e-4, 620.0, 1.6e-11),
    "four_bar_gravity": (0.5, 2e-3, 40.0, 1.5e-10),
}
FORWARD = {  # scene: measured error (m, rad) of accelerations integrated outside
    "planar_slider_crank": 6.1e-11,
    "spatial_slider_crank": 5.9e-13,
    "spatial_slider_crank_driven": 7.5e-14,
}
DRIVEN, SAMPLED, PASSED, PROJECTED = 6.9e-11, 2.9e-10, (3.3e-9, 4.4e-14), 3.9e-13  # rad; m, rad


def simulate(scene: Scene, duration: float, family: str, **options) -> Trajectory:
    return engine("mujoco").run(scene, np.linspace(0, duration, 11), Setting(family, options))


@pytest.mark.parametrize("name", PAPER)
def test_tuned_mujoco_and_truth(name: str) -> None:
    duration, step, beta, measured = PAPER[name]
    scene = SCENES[name]()
    run = simulate(scene, duration, "tuned", step=step, beta=beta, hard=HARD)
    assert run.outcome is Outcome.COMPLETED, f"{name}: {run.outcome.label} {run.message}"
    assert error(run, scene) < MARGIN * measured, f"{name}: {error(run, scene):.2e} m or rad from the truth"


@pytest.mark.parametrize(("family", "order"), [("stock", 2), ("euler", 1), ("implicit", 1)])
def test_order_of_the_integrators_and_truth(family: str, order: int) -> None:
    """Stock closures give less the shorter the step, so that RK4 is of second order with them."""
    scene = SCENES["spatial_slider_crank"]()
    steps = [s.options["step"] for s in engine("mujoco").settings(scene) if s.family == family]
    errors = [error(simulate(scene, 0.02, family, step=step), scene) for step in steps]
    found = order_of_convergence(steps, errors)
    assert abs(found - order) < 0.15, f"{family}: order {found:.2f}, errors {errors}"


def test_implicitfast_and_euler_move_alike_where_nothing_damps() -> None:
    scene = SCENES["spatial_slider_crank"]()
    assert "implicitfast" not in {s.family for s in engine("mujoco").settings(scene)}
    assert "implicitfast" in {s.family for s in engine("mujoco").settings(every_joint())}
    fast, euler = (simulate(scene, 0.02, family, step=1.4e-6) for family in ("implicitfast", "euler"))
    apart = max(abs(fast.position - euler.position).max(), abs(fast.orientation - euler.orientation).max())
    assert apart < MARGIN * 3e-14, f"apart by {apart:.1e}"


@pytest.mark.parametrize("name", FORWARD)
def test_accelerations_of_mujoco_integrated_outside_and_truth(name: str) -> None:
    duration, _, beta, _ = PAPER[name]
    scene = SCENES[name]()
    run = simulate(scene, duration, "forward", rtol=1e-10, min_step=2e-5, beta=beta, hard=1e-7)
    assert error(run, scene) < MARGIN * FORWARD[name], f"{name}: {error(run, scene):.2e} m or rad off"


def test_softness_of_each_family_on_the_spatial_slider_crank() -> None:
    """Defaults are a percent off at any step, stock converges, the scaled regulariser is far below both."""
    scene = SCENES["spatial_slider_crank"]()
    options = {"defaults": {}, "stock": {}, "tuned": {"beta": 8000.0, "hard": HARD}}
    errors = {f: error(simulate(scene, 0.02, f, step=1e-5, **o), scene) for f, o in options.items()}
    assert errors["tuned"] < 1e-1 * errors["stock"] < 1e-4 * errors["defaults"], f"errors {errors}"


def test_error_of_tuned_mujoco_falls_with_the_fourth_power_of_the_step() -> None:
    scene = SCENES["spatial_slider_crank_driven"]()
    steps = (2e-4, 1e-4)
    errors = [error(simulate(scene, 0.05, "tuned", step=h, beta=1200.0, hard=HARD), scene) for h in steps]
    order = np.log2(errors[0] / errors[1])
    assert 3.5 < order < 5, f"errors {errors} of steps {steps}: order {order:.2f}, expected 4"


def test_a_driver_with_any_motion_is_met_exactly() -> None:
    """Halved steps, same angle: the prescribed angle has no error of integration to speak of."""
    base = SCENES["spatial_slider_crank"]()
    driver = Driver(joint="A", polynomial=(0.0, 3.0, -20.0), sine={"amplitude": 0.4, "frequency": 30.0})
    scene = base.with_(driver=(driver,), load=(), duration=0.2)
    run = simulate(scene, 0.2, "tuned", step=1e-4, beta=400.0, hard=HARD)
    t = run.times
    angle = 3 * t - 20 * t**2 + 0.4 * np.sin(30 * t)
    turned = rotations.from_vector(angle[:, None] * np.array([0.0, 1.0, 0.0]))
    gap = rotations.angle_between(run.orientation[:, 0], turned).max()
    assert gap < MARGIN * DRIVEN, f"the crank is {gap:.2e} rad from where it is driven"


def test_samples_are_at_the_times_asked_for() -> None:
    scene = SCENES["spatial_slider_crank_driven"]()
    times = np.array([0.0, 0.0101, 0.013, 0.0333])
    setting = Setting("tuned", {"step": 5e-5, "beta": 1200.0, "hard": HARD})
    run = engine("mujoco").run(scene, times, setting)
    assert np.array_equal(run.times, times), f"asked for {times}, got {run.times}"
    assert error(run, scene) < MARGIN * SAMPLED, f"{error(run, scene):.2e} from the truth at those times"


def test_a_run_that_blows_up_is_not_finite_and_keeps_what_it_reached() -> None:
    scene = SCENES["planar_slider_crank"]()
    run = simulate(scene, 0.4, "tuned", step=4e-3, beta=2000.0, hard=HARD)
    assert run.outcome is Outcome.NOT_FINITE, f"{run.outcome.label} {run.message}"
    assert 0 < len(run.times) < 11, f"{len(run.times)} of 11 samples kept"
    assert np.isfinite(run.position).all(), "samples that are not finite were kept"
    assert "finite" in run.message, f"message {run.message!r}"


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    simulate(SCENES["planar_slider_crank"](), 0.4, "tuned", step=4e-3, beta=2000.0, hard=HARD)
    simulate(SCENES["four_bar"](), 0.01, "tuned", step=1e-3, beta=600.0, hard=HARD)
    written, printed = list(tmp_path.iterdir()), capfd.readouterr()
    assert mujoco.get_mjcb_control() is None, "the driver's callback is still installed"
    assert not written, f"files written: {written}"
    assert not printed.out and not printed.err, f"printed: {printed}"


def test_masses_written_after_compiling_are_those_of_the_links() -> None:
    built = compiled(every_joint())
    model, links = built.model, built.tree.links
    for link, body in zip(links, built.links, strict=True):
        moments = np.linalg.eigvalsh(link.inertia)
        gap = max(abs(model.body_mass[body] - link.mass), abs(model.body_inertia[body] - moments).max())
        assert gap < 1e-15, f"MuJoCo's body {body} is {gap:.1e} off its link"


def test_a_thin_disc_that_rounding_puts_beyond_the_triangle_is_accepted() -> None:
    inertia = (0.1, 0.1, 0.2 * (1 + 1e-12))
    disc = Body(
        name="disc", mass=1.0, inertia=inertia, position=(0.0, 0.0, 0.0), angular_velocity=(0.0, 0.1, 5.0)
    )
    scene = Scene(name="disc", body=(disc,))
    run = simulate(scene, 0.5, "tuned", step=1e-3, beta=100.0, hard=HARD)
    assert run.outcome is Outcome.COMPLETED, f"{run.outcome.label} {run.message}"
    assert error(run, scene) < MARGIN * 1.7e-13, f"{error(run, scene):.2e} rad from the free body's motion"


def test_stiff_closures_through_singular_positions_and_truth_agree() -> None:
    """Four passages of the swinging four-bar."""
    scene = SCENES["four_bar_gravity"]()
    run = simulate(scene, 1.0, "stiff", step=2e-4, beta=1000.0, hard=HARD)
    assert error(run, scene) < MARGIN * 4.5e-14, f"{error(run, scene):.2e}"


def test_projected_states_through_singular_positions_and_truth_agree() -> None:
    scene = SCENES["four_bar_gravity"]()
    run = simulate(scene, 1.0, "projected", rtol=1e-8, min_step=4e-3, beta=40.0, hard=ADAPTIVE["projected"])
    assert error(run, scene) < MARGIN * PASSED[0], f"{error(run, scene):.2e}"
    assert violation_series(scene, run).max() < MARGIN * PASSED[1], (
        f"{violation_series(scene, run).max():.1e}"
    )


def test_projected_driver_and_its_prescribed_motion_agree() -> None:
    scene = SCENES["spatial_slider_crank_driven"]()
    run = simulate(scene, 0.1, "projected", rtol=1e-8, min_step=1e-4, beta=600.0, hard=ADAPTIVE["projected"])
    assert error(run, scene) < MARGIN * PROJECTED, f"{error(run, scene):.2e}"


def test_a_duplicate_joint_changes_no_projected_motion() -> None:
    scene = moving_probes()["spherical joint"]
    twice = scene.with_(joint=(*scene.joint, scene.joint[-1].model_copy(update={"name": "again"})))
    tight = {"rtol": 1e-8, "min_step": 6e-3, "beta": 25.0, "hard": ADAPTIVE["projected"]}
    run, again = (simulate(s, 0.02, "projected", **tight) for s in (scene, twice))
    assert float(error_series(scene, run, again).max()) < 1e-9


def test_rows_that_come_and_go_and_their_drivers():
    """MuJoCo leaves out constraint rows while nothing moves them, which shifts the drivers' rows."""
    scene = mechanism(11)
    run = ENGINE.run(scene, np.linspace(0.0, scene.duration, 3), ENGINE.settings_of(scene, "tuned")[-1])
    assert scene.driver and violation_series(scene, run).max() < 1e-9


def test_the_library_is_found_beside_the_package_or_in_this_process(tmp_path, monkeypatch) -> None:
    own = Path(mujoco.__file__).parent
    beside = library(own)
    assert beside.parent == own and any(map(beside.match, LIBRARIES))
    if hasattr(psutil.Process, "memory_maps"):
        assert library(tmp_path).name == beside.name, "the library that the package has loaded"
        monkeypatch.setattr(psutil.Process, "memory_maps", lambda self: [])
    with pytest.raises(FileNotFoundError, match=f"{tmp_path}; the families named 'compiled'"):
        library(tmp_path)
