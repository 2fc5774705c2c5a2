"""Pinocchio's runs against truths, and settings that give silently wrong answers."""

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import order_of_convergence
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, ROUNDING, completed_error
from tests.helpers.parts import joint
from tests.helpers.tree_scenes import driven

pinocchio = pytest.importorskip("pinocchio")


def simulate(scene: Scene, duration: float, family: str, **options) -> Trajectory:
    return engine("pinocchio").run(scene, np.linspace(0, duration, 11), Setting(family, options))


@pytest.mark.parametrize("name", ["planar_slider_crank", "four_bar", "five_bar"])
def test_default_solver_of_pinocchio_diverges_with_redundant_closures(name: str) -> None:
    """With redundant rows one iteration does not converge; the message names them as the cause."""
    run = simulate(SCENES[name](), 0.02, "defaults", step=1e-4)
    assert run.outcome is Outcome.NOT_FINITE, f"{name}: {run.outcome.label}"
    assert "redundant" in run.message, f"message {run.message!r}"


@pytest.mark.parametrize("family", ["defaults", "proximal"])
def test_solvers_of_pinocchio_converge_to_the_truth_with_the_order_of_rk4(family: str) -> None:
    """Errors from the judge's truth at three steps, each half of the one before; the closures have no
    redundant row. Measured are the order 4.06, to be 4 within 0.15, and the least error, 4.3e-8 m or rad."""
    scene, steps = SCENES["spatial_slider_crank"](), [8e-5, 4e-5, 2e-5]
    errors = [completed_error(simulate(scene, 0.02, family, step=step), scene) for step in steps]
    assert abs(order_of_convergence(steps, errors) - 4) < 0.15, f"errors {errors}"
    assert errors[-1] < 1e-7


def test_baumgarte_removes_most_of_the_drift_of_rk4() -> None:
    """Errors from the judge's truth over 0.2 s, at steps of 0.15 ms. With feedback ("baumgarte") less than
    0.3 of the error without it ("proximal") is left."""
    scene = SCENES["planar_slider_crank"]()
    runs = {family: simulate(scene, 0.2, family, step=1.5e-4) for family in ("proximal", "baumgarte")}
    errors = {family: completed_error(run, scene) for family, run in runs.items()}
    assert errors["baumgarte"] < 0.3 * errors["proximal"], f"errors {errors}"


def test_projection_keeps_the_branch_of_the_driven_four_bar() -> None:
    """The crank turns at 124.8 rad/s from θ = π/2, and the rhombus is flat at θ = 0 and -π. DOP853 with
    projection ("tuned") follows the closed form to 0.1 s, to 1e-13 m or rad. Without it, the run passes the
    second flat position and ends before 0.1 s, not finite."""
    scene, second = SCENES["four_bar"](), 1.5 * np.pi / 124.8  # s
    options = {"rtol": 1e-8, "min_step": 2e-4}
    plain, projected = (simulate(scene, 0.1, family, **options) for family in ("dop853", "tuned"))
    assert completed_error(projected, scene) < MARGIN * ROUNDING
    assert plain.outcome is Outcome.NOT_FINITE and plain.t_end > second, plain.message


def test_pinocchio_follows_a_driver_exactly_at_a_loose_tolerance() -> None:
    """The sled's way is 0.5 t + 0.05 sin 7 t (m), to 1e-14 m at a tolerance of 1e-3: drivers prescribe
    coordinates of the tree and are not integrated."""
    scene = driven()
    loose = Setting("tuned", {"rtol": 1e-3, "min_step": 1e-3})
    run = engine("pinocchio").run(scene, np.linspace(0, 0.4, 5), loose)
    sled = [body.name for body in scene.body].index("sled")
    axis = np.array([0.3, 1.0, 0.0]) / np.hypot(0.3, 1.0)
    moved = -(run.position[:, sled] - run.position[0, sled]) @ axis  # the ground is the second body
    expected = 0.5 * run.times + 0.05 * np.sin(7 * run.times)
    assert abs(moved - expected).max() < ROUNDING


@pytest.mark.parametrize("damping", [0.0, 20 * 2**0.5], ids=["undamped", "critically damped"])
def test_compliant_closures_are_springs_and_dampers(damping: float) -> None:
    """A force F = 3 N pushes a cart of 2 kg along a slide. A ball joint of the compliance C = 0.01 m/N holds
    it: x = C F (1 - cos ωt) with ω² = 1 / (2 C), and C F (1 - (1 + ωt) exp(-ωt)) if critically damped.
    A step of first order is off by 0.8 % at 0.1 ms. With rigid closures x = 0."""
    joints = [joint("slide", "translational", "ground", "cart", (0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))]
    joints += [joint("ball", "spherical", "ground", "cart", (0.0, 0.0, 0.0))]
    body = {"name": "cart", "mass": 2.0, "inertia": (1.0, 1.0, 1.0), "position": (0.0, 0.0, 0.0)}
    push = {"type": "force", "body": "cart", "point": (0.0, 0.0, 0.0), "force": (3.0, 0.0, 0.0)}
    scene = Scene(name="cart", gravity=(0.0, 0.0, 0.0), body=[body], joint=joints, load=[push])
    soft = simulate(scene, 1.0, "compliant", step=1e-4, compliance=0.01, damping=damping)
    wt = 50**0.5 * soft.times
    right = 0.03 * (1 - (1 + wt) * np.exp(-wt) if damping else 1 - np.cos(wt))
    assert soft.position[:, 0, 0] == pytest.approx(right, abs=2.5e-4)
    assert abs(simulate(scene, 1.0, "tuned", rtol=1e-6, min_step=1e-3).position).max() < ROUNDING


def test_compliance_makes_redundant_closures_solvable_by_impulses() -> None:
    """Bennett's linkage has three redundant rows, with which ADMM does not converge. Compliant anchors
    converge to the truth with the steps' first order, as the compliance vanishes with the step."""
    scene, steps = SCENES["bennett"](), [4e-3, 2e-3, 1e-3]
    runs = [simulate(scene, 0.5, "compliant", step=h, compliance=h**2) for h in steps]
    order = order_of_convergence(steps, [completed_error(run, scene) for run in runs])
    assert order == pytest.approx(1.0, abs=0.1)
    assert simulate(scene, 0.5, "impulses", step=1e-3).outcome is Outcome.NOT_CONVERGED
