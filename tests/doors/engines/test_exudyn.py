"""Exudyn's runs against truths and closed forms, and its failures at singular positions."""

import math

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn.adapter import ENGINE
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Cylindrical, Driver, Revolute, Scene, TorsionSpring
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN
from tests.helpers.tree_scenes import INERTIA, body

SIDEWAYS = (0.6, 0.0, 0.8)  # an axis along no coordinate axis
TURNED = (0.3, -0.5, 0.8)  # rotation vector, rad


def run(scene: Scene, times: np.ndarray, family: str, step: float) -> Trajectory:
    trajectory = ENGINE.run(scene, times, Setting(family, {"step": step}))
    assert trajectory.outcome is Outcome.COMPLETED, trajectory.message
    assert np.array_equal(trajectory.times, times), (trajectory.times, times)
    return trajectory


def one_body(**changes: object) -> Scene:
    """Return a body with a full inertia matrix, 0.2 m from the origin at a right angle to SIDEWAYS."""
    held = body("b", (0.0, 0.2, 0.0), TURNED, mass=2.0)
    return Scene(name="one", body=(held,), duration=1.0, **changes)


def hinge(kind: type, bodies: tuple[str, str]) -> dict[str, object]:
    """Return the field ``joint`` of a scene: a joint at the origin along SIDEWAYS."""
    return {"joint": (kind(name="J", bodies=bodies, anchor=(0.0, 0.0, 0.0), axis=SIDEWAYS),)}


def angle(scene: Scene, trajectory: Trajectory) -> np.ndarray:
    """Return the angle (k,) about SIDEWAYS since the start, modulo a turn."""
    start = scene.body[0].orientation
    relative = rotations.multiply(trajectory.orientation[:, 0], rotations.conjugate(start))
    return 2 * np.arctan2(relative[:, 1:] @ np.array(SIDEWAYS), relative[:, 0])


@pytest.mark.parametrize(
    ("name", "duration", "family", "step", "errors"),  # measured, of poses and of velocities
    [
        ("planar_slider_crank", 0.05, "trapezoidal", 1e-4, (6.4e-6, 7.1e-6)),
        ("spatial_slider_crank", 0.01, "defaults", 2e-5, (1.5e-5, 1.5e-5)),
        ("planar_slider_crank_gravity", 0.1, "alpha", 1e-4, (1.3e-5, 1.3e-5)),
        ("spatial_slider_crank_driven", 0.02, "tuned", 1e-4, (2e-13, 1.8e-13)),
        ("four_bar", 0.02, "static", 5e-4, (4e-14, 2.3e-14)),  # through the singular position at 12.6 ms
        ("spatial_slider_crank_driven", 0.2, "static", 1e-3, (7.6e-11, 3.6e-11)),
        ("planar_slider_crank_equal", 0.1, "alpha", 1e-4, (2.5e-4, 3.1e-4)),  # through a singular position
        ("planar_slider_crank_equal", 0.13, "tuned", 1e-4, (7.1e-12, 1.1e-11)),  # through two
        ("four_bar_gravity", 0.45, "tuned", 1.5e-3, (5.6e-12, 3.4e-12)),  # through one
    ],
)
def test_exudyns_families_move_mechanisms_within_their_measured_errors(name, duration, family, step, errors):
    """Errors of poses and velocities from the judge's truth are at most ten times the measured ones."""
    scene = SCENES[name]()
    trajectory = run(scene, np.linspace(0, duration, 11), family, step)
    measured = measure(scene, trajectory, truth_for(scene))
    for metric, error in zip(("error", "velocity_error"), errors, strict=True):
        assert measured[metric] < MARGIN * error, f"{metric} {measured[metric]:.2e}, measured {error:.1e}"


def test_exudyns_trapezoidal_rule_has_order_two_and_extrapolation_more_than_five():
    """Orders are binary logarithms of ratios of errors at 2 and 1 ms: the rule's is 2 within 0.1. Its error
    has even powers of the step; extrapolation removes two, which leaves order six (5.7 is measured)."""
    scene = SCENES["spatial_slider_crank_gravity"]()
    times, truth = np.linspace(0, 0.1, 6), truth_for(scene)
    errors = {
        (family, step): measure(scene, run(scene, times, family, step), truth)["error"]
        for family in ("trapezoidal", "tuned")
        for step in (2e-3, 1e-3)
    }
    order = math.log2(errors["trapezoidal", 2e-3] / errors["trapezoidal", 1e-3])
    assert 1.9 < order < 2.1, f"trapezoidal {order:.3f} from {errors}"
    order = math.log2(errors["tuned", 2e-3] / errors["tuned", 1e-3])
    assert order > 5, f"extrapolated {order:.3f} from {errors}"


@pytest.mark.parametrize("kind", [Revolute, Cylindrical])
@pytest.mark.parametrize("bodies", [("ground", "b"), ("b", "ground")])
def test_exudyn_swings_a_body_on_a_torsion_spring_beyond_a_turn(kind: type, bodies: tuple[str, str]):
    """From rest, φ = 8 rad (1 - e^(-δt) (cos ωt + δ/ω sin ωt)), a damped oscillation about the natural angle,
    with δ = c / (2 J) and ω² = k / J - δ². The error is at most ten times the measured 8.2e-10 rad."""
    natural = 8.0 if bodies[0] == "ground" else -8.0  # the coordinate of the second body about the first
    spring = TorsionSpring(joint="J", stiffness=2.0, damping=0.05, natural_angle=natural)
    scene = one_body(**hinge(kind, bodies), load=(spring,))
    times = np.linspace(0, 1, 6)
    axis = rotations.to_matrix(np.array(scene.body[0].orientation)).T @ np.array(SIDEWAYS)
    inertia = float(axis @ np.array(INERTIA) @ axis) + scene.body[0].mass * 0.2**2  # by Steiner, kg m²
    decay = 0.05 / (2 * inertia)
    damped = math.sqrt(2.0 / inertia - decay**2)
    swing = np.exp(-decay * times) * (np.cos(damped * times) + decay / damped * np.sin(damped * times))
    off = angle(scene, run(scene, times, "tuned", 5e-3)) - 8.0 * (1 - swing)
    assert np.abs(np.angle(np.exp(1j * off))).max() < MARGIN * 8.2e-10, "modulo a turn"


def test_exudyns_defaults_end_at_redundant_constraints_with_the_cause():
    """A planar mechanism in space has redundant constraints: Exudyn's matrix is singular, and Exudyn finds
    zero initial accelerations, as the message says. The start is the only sample."""
    scene = SCENES["planar_slider_crank"]()
    trajectory = ENGINE.run(scene, np.linspace(0, 0.1, 11), Setting("defaults", {"step": 1e-3}))
    assert trajectory.outcome is Outcome.SINGULAR_MATRIX, (trajectory.outcome, trajectory.message)
    assert "zero initial accelerations" in trajectory.message, trajectory.message
    assert len(trajectory.times) == 1, trajectory.times


def test_exudyns_trapezoidal_rule_ends_at_a_singular_position_with_right_samples_before_it():
    """The slider-crank with equal links is singular at 0.0612 s; samples are 10 ms apart. The run ends within
    ten steps of 0.1 ms of this, and the samples up to 0.06 s are off by at most ten times the measured 7.2e-6
    (of the length, or rad)."""
    scene = SCENES["planar_slider_crank_equal"]()
    trajectory = ENGINE.run(scene, np.linspace(0, 0.1, 11), Setting("trapezoidal", {"step": 1e-4}))
    assert trajectory.outcome is Outcome.NOT_CONVERGED, (trajectory.outcome, trajectory.message)
    singular = 0.0612  # s, where the crank has turned to π/2
    assert abs(trajectory.t_end - singular) < 10 * 1e-4, trajectory.t_end
    assert trajectory.times[-1] == pytest.approx(0.06), trajectory.times
    measured = measure(scene, trajectory, truth_for(scene))
    assert measured["error"] < MARGIN * 7.2e-6, measured


def test_exudyns_static_analysis_ends_before_a_singular_pose():
    """A driver turns the upright crank of a parallelogram by 90° in 1 s. There all links are in one line and
    two branches meet. The run ends within two of its steps of 0.05 s before this pose."""
    scene = SCENES["four_bar"]()
    scene = scene.with_(driver=(Driver(joint="A", polynomial=(0.0, -math.pi / 2)),))
    trajectory = ENGINE.run(scene, np.linspace(0, 1, 5), Setting("static", {"step": 0.05}))
    assert trajectory.outcome is Outcome.SINGULAR_MATRIX, trajectory.outcome
    assert "loses rank at t = 1 s" in trajectory.message and 0.9 < trajectory.t_end < 1, trajectory.message


def test_exudyn_moves_a_driven_scene_without_masses_and_refuses_a_free_one():
    """Without masses only the static analysis serves; its positions equal those with masses to the bit."""
    scene = SCENES["four_bar"]()
    bare = scene.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body))
    assert ENGINE.cannot(bare) is None
    assert {s.family for s in ENGINE.settings(bare)} == {"static"}
    assert "driven" in str(ENGINE.cannot(bare.with_(driver=())))
    times = np.linspace(0, 0.02, 5)
    with_mass, without = run(scene, times, "static", 1e-3), run(bare, times, "static", 1e-3)
    assert np.array_equal(with_mass.position, without.position)
