"""MuJoCo's runs against truths; callbacks and files that an adapter must not leave behind."""

from pathlib import Path

import numpy as np
import psutil
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.engines.mujoco.adapter import ENGINE
from crosscheck.engines.mujoco.context import LIBRARIES, library
from crosscheck.engines.mujoco.families import HARD
from crosscheck.engines.mujoco.model import compiled
from crosscheck.judge.metrics import order_of_convergence
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Body, Scene
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, ROUNDING, completed_error
from tests.helpers.statics import hinge, pendulum
from tests.helpers.tree_scenes import every_joint

mujoco = pytest.importorskip("mujoco")


def simulate(scene: Scene, duration: float, family: str, **options) -> Trajectory:
    return engine("mujoco").run(scene, np.linspace(0, duration, 11), Setting(family, options))


@pytest.mark.parametrize(("family", "order"), [("stock", 2), ("euler", 1), ("implicit", 1), ("discrete", 1)])
def test_mujoco_s_integrators_converge_with_their_order(family: str, order: int) -> None:
    """Order of the sweep's errors by the truth. The softness of stock closures falls with the square of the
    step, so that RK4 is of second order here; the orders measured are within 0.15 of whole numbers."""
    scene = SCENES["spatial_slider_crank"]()
    steps = [s.options["step"] for s in engine("mujoco").settings(scene) if s.family == family]
    errors = [completed_error(simulate(scene, 0.02, family, step=step), scene) for step in steps]
    found = order_of_convergence(steps, errors)
    assert abs(found - order) < 0.15, f"{family}: order {found:.2f}, errors {errors}"


@pytest.mark.parametrize(("size", "is_refused"), [(0.9e-3, True), (1.1e-3, False)])
def test_inertia_below_mujocos_least_one_is_refused_by_the_bodys_name(size: float, is_refused: bool) -> None:
    """A rod of 3 µg that hangs by a pin at its end has m l²/3; MuJoCo computes with at least 1e-15 kg m²."""
    moment = 3e-9 * size**2 / 12
    body = Body(name="rod", mass=3e-9, inertia=(moment,) * 3, position=(size / 2, 0.0, 0.0))
    refused = ENGINE.cannot(pendulum().with_(body=(body,)))
    words = "a coordinate of body 'rod' moves an inertia below 1e-15"
    assert words in refused.reason if is_refused else refused is None


@pytest.mark.parametrize(("family", "evaluations"), [("stock", 4), ("euler", 1)])
def test_mujoco_s_steps_divide_intervals_evenly_and_are_counted(family: str, evaluations: int) -> None:
    """Steps of at most 15 ms: 4 to 50 ms and 2 more to 75 ms; RK4 evaluates 4 times a step, Euler once."""
    setting = Setting(family, {"step": 0.015})
    cost = engine("mujoco").run(SCENES["heavy_top"](), np.array([0.0, 0.05, 0.075]), setting).cost
    assert (cost.steps, cost.rhs) == (6, 6 * evaluations)


def test_implicitfast_is_offered_only_for_scenes_with_damping() -> None:
    """Without damping it takes the steps of Euler's method. The scene of every joint has a damper."""
    assert "implicitfast" not in {s.family for s in ENGINE.settings(SCENES["spatial_slider_crank"]())}
    assert "implicitfast" in {s.family for s in ENGINE.settings(every_joint())}


def test_hardened_closures_are_closer_to_the_truth_than_stock_and_defaults() -> None:
    """On the spatial slider-crank at a step of 1e-5 s. By default closures return within 20 ms, in "stock"
    within two steps, and in "tuned" they hardly open. Errors from the judge's truth fall by a factor of over
    1000 from "defaults" to "stock", and of over 10 from there to "tuned"."""
    scene = SCENES["spatial_slider_crank"]()
    options = {"defaults": {}, "stock": {}, "tuned": {"beta": 8000.0, "hard": HARD}}
    errors = {f: completed_error(simulate(scene, 0.02, f, step=1e-5, **o), scene) for f, o in options.items()}
    assert errors["stock"] < 1e-3 * errors["defaults"], f"errors {errors}"
    assert errors["tuned"] < 1e-1 * errors["stock"], f"errors {errors}"


@pytest.mark.parametrize(
    ("family", "options"),
    [("tuned", {"step": 4e-3, "beta": 2000.0, "hard": HARD}), ("defaults", {"step": 0.1})],
)
def test_run_that_blows_up_ends_not_finite_with_its_finite_samples_and_leaves_no_file(
    family: str, options: dict, tmp_path, monkeypatch, capfd
) -> None:
    """The steps are too long. By its defaults MuJoCo resets the state and goes on; it prints a warning and
    appends it to MUJOCO_LOG.TXT in the current folder."""
    monkeypatch.chdir(tmp_path)
    scene = SCENES["planar_slider_crank"]()
    run = simulate(scene, 100 * options["step"], family, **options)
    assert run.outcome is Outcome.NOT_FINITE, f"{run.outcome.label} {run.message}"
    assert 0 < len(run.times) < 11, f"{len(run.times)} of 11 samples kept"
    assert np.isfinite(run.position).all(), "samples that are not finite were kept"
    assert "finite" in run.message, f"message {run.message!r}"
    assert list(tmp_path.iterdir()) == [] and tuple(capfd.readouterr()) == ("", "")


def test_driver_s_callback_is_removed_after_a_run() -> None:
    """MuJoCo's control callback is global: it would drive every later model of the process."""
    run = simulate(SCENES["four_bar"](), 0.01, "tuned", step=1e-3, beta=600.0, hard=HARD)
    assert run.outcome is Outcome.COMPLETED and mujoco.get_mjcb_control() is None, run.message


def test_thin_disc_whose_rounded_inertia_violates_the_triangle_inequality_moves_exactly() -> None:
    """A disc has I_z = I_x + I_y; here rounding makes I_z larger, and MuJoCo refuses such a body. The error
    from the free body's closed form is at most ten times the measured 1.7e-13 m or rad."""
    inertia = (0.1, 0.1, 0.2 * (1 + 1e-12))
    disc = Body(name="disc", mass=1, inertia=inertia, position=(0, 0, 0), angular_velocity=(0, 0.1, 5))
    scene = Scene(name="disc", body=(disc,))
    run = simulate(scene, 0.5, "tuned", step=1e-3, beta=100.0, hard=HARD)
    assert completed_error(run, scene) < MARGIN * 1.7e-13


def test_driver_acts_although_mujoco_renumbers_its_rows():
    """A ball joint repeats a point of the driven hinge's axis, so that only rounding moves its three rows.
    MuJoCo leaves them out at angles at which they are exactly zero: the driver's row is 3 or 0. The truth is
    the driver's angle, 2 t, to 1e-13 rad."""
    place = (0.1, 0.2, 0.0)
    ball = {"name": "B", "type": "spherical", "bodies": ["ground", "rod"], "anchor": place}
    turning = {"joint": "A", "polynomial": (0.0, 2.0)}
    scene = pendulum(joint=[hinge("A", ("ground", "rod"), place), ball], driver=[turning])
    model, rows = compiled(scene).model, set()
    data, driver = mujoco.MjData(model), model.equality("driver A").id
    for angle in np.linspace(0.0, 1.0, 101):
        data.qpos[:] = angle
        mujoco.mj_forward(model, data)
        rows |= set(np.flatnonzero(data.efc_id == driver))
    assert rows == {0, 3}
    run = simulate(scene, 0.5, "tuned", step=1e-3, beta=100.0, hard=HARD)
    assert completed_error(run, scene) < MARGIN * ROUNDING


def test_mujoco_s_library_is_found_in_its_package_or_among_loaded_ones(tmp_path, monkeypatch) -> None:
    """Compiled families link MuJoCo's C library. A folder without it leads to the library that this process
    has loaded; if there is none either, an error names the folder and the families."""
    own = Path(mujoco.__file__).parent
    beside = library(own)
    assert beside.parent == own and any(map(beside.match, LIBRARIES))
    if hasattr(psutil.Process, "memory_maps"):
        assert library(tmp_path).name == beside.name
        monkeypatch.setattr(psutil.Process, "memory_maps", lambda self: [])
    with pytest.raises(FileNotFoundError, match=f"{tmp_path}; the families named 'compiled'"):
        library(tmp_path)
