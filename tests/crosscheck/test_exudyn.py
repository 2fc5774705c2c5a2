"""Exudyn: its runs / truths, closed forms and the joints' own equations; its known traps."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn.adapter import ENGINE
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.scene import (
    Body,
    Cylindrical,
    Driver,
    Force,
    Moment,
    Revolute,
    Scene,
    Sine,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.scenes import SCENES
from mbref.trajectory import Outcome, Trajectory
from tests.crosscheck.measured import MARGIN, ROUNDING
from tests.crosscheck.tree_scenes import driven, every_joint

SIDEWAYS = (0.6, 0.0, 0.8)  # an axis along no coordinate axis
INERTIA = ((0.02, 0.002, -0.001), (0.002, 0.03, 0.003), (-0.001, 0.003, 0.025))
TURNED = tuple(rotations.from_vector([0.3, -0.5, 0.8]).tolist())
ACCELERATION = 2.7e-8  # measured errors: of the largest
TURNING, TUMBLING, BEFORE = 8.2e-10, 6.1e-10, 7.2e-6  # rad; of the scene's length or rad
DRIVEN, OPEN = (2.4e-11, 2.9e-10), (5.7e-14, 2.3e-12)  # m or rad, and their rates


def run(scene: Scene, times: np.ndarray, family: str, step: float) -> Trajectory:
    trajectory = ENGINE.run(scene, times, Setting(family, {"step": step}))
    assert trajectory.outcome is Outcome.COMPLETED, trajectory.message
    assert np.array_equal(trajectory.times, times), (trajectory.times, times)
    return trajectory


def one_body(**changes: object) -> Scene:
    """A body with a full inertia matrix, 0.2 m from a joint at the origin whose axis is SIDEWAYS."""
    body = Body(name="b", mass=2.0, inertia=INERTIA, position=(0.0, 0.2, 0.0), orientation=TURNED)
    return Scene(name="one", body=(body,), duration=1.0, **changes)


def hinge(kind: type = Revolute, bodies: tuple[str, str] = ("ground", "b")) -> dict[str, object]:
    return {"joint": (kind(name="J", bodies=bodies, anchor=(0.0, 0.0, 0.0), axis=SIDEWAYS),)}


def moment_of_inertia(scene: Scene) -> float:
    """About the axis SIDEWAYS through the origin, which is perpendicular to the body's arm."""
    turn = rotations.to_matrix(np.array(TURNED))
    axis = np.array(SIDEWAYS)
    return float(axis @ turn @ np.array(INERTIA) @ turn.T @ axis) + scene.body[0].mass * 0.2**2


def angle(scene: Scene, trajectory: Trajectory) -> np.ndarray:
    """Angle (k,) about SIDEWAYS since the start, modulo a turn."""
    relative = rotations.multiply(
        trajectory.orientation[:, 0], rotations.conjugate(scene.body[0].orientation)
    )
    return 2 * np.arctan2(relative[:, 1:] @ np.array(SIDEWAYS), relative[:, 0])


def assert_angle(scene: Scene, trajectory: Trajectory, expected: np.ndarray, tolerance: float) -> None:
    off = np.abs(np.angle(np.exp(1j * (angle(scene, trajectory) - expected)))).max()
    assert off < tolerance, f"angle off by {off:.2e} rad, tolerance {tolerance:g}"


@pytest.mark.parametrize(
    ("name", "duration", "family", "step", "errors"),  # measured, of poses and of velocities
    [
        ("planar_slider_crank", 0.2, "tuned", 6.25e-5, (2.8e-11, 1.1e-11)),  # 7 steps at rank 41 of 42
        ("planar_slider_crank", 0.05, "trapezoidal", 1e-4, (6.4e-6, 7.1e-6)),
        ("spatial_slider_crank", 0.02, "tuned", 3.125e-5, (7.5e-12, 2.1e-11)),
        ("spatial_slider_crank", 0.01, "defaults", 2e-5, (1.5e-5, 1.5e-5)),
        ("spatial_slider_crank_gravity", 0.1, "tuned", 1e-4, (1.6e-11, 7.3e-12)),
        ("planar_slider_crank_gravity", 0.1, "alpha", 1e-4, (1.3e-5, 1.3e-5)),
        ("four_bar_gravity", 0.2, "tuned", 1e-3, (2.1e-12, 5.2e-12)),
        ("five_bar_gravity", 0.2, "tuned", 1e-3, (2.3e-12, 4.6e-12)),
        ("four_bar", 0.012, "tuned", 1e-4, (1.2e-14, 1.4e-13)),
        ("five_bar", 0.012, "tuned", 1e-4, (ROUNDING, 8e-14)),
        ("spatial_slider_crank_driven", 0.02, "tuned", 1e-4, (2e-13, 1.8e-13)),
        ("four_bar", 0.02, "static", 5e-4, (4e-14, 2.3e-14)),  # through the singular position at 12.6 ms
        ("five_bar", 0.1, "static", 1e-3, (8.1e-12, 3.3e-12)),
        ("spatial_slider_crank_driven", 0.2, "static", 1e-3, (7.6e-11, 3.6e-11)),
        ("planar_slider_crank_equal", 0.1, "alpha", 1e-4, (2.5e-4, 3.1e-4)),  # through a singular position
    ],
)
def test_run_and_truth_agree(
    name: str, duration: float, family: str, step: float, errors: tuple[float, float]
):
    scene = SCENES[name]()
    trajectory = run(scene, np.linspace(0, duration, 11), family, step)
    measured = measure(scene, trajectory, truth_for(scene))
    for metric, error in zip(("error", "velocity_error"), errors, strict=True):
        assert measured[metric] < MARGIN * error, f"{metric} {measured[metric]:.2e}, measured {error:.1e}"


def test_order_of_the_trapezoidal_rule_is_two_and_extrapolation_beats_it():
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


def test_given_accelerations_and_truth_agree():
    scene = SCENES["planar_slider_crank_gravity"]()
    trajectory = run(scene, np.linspace(0, 0.1, 6), "tuned", 1e-4)
    exact = truth_for(scene).poses(trajectory.times)
    for key in ("acceleration", "angular_acceleration"):
        off = np.abs(getattr(trajectory, key) - getattr(exact, key)).max()
        scale = np.abs(getattr(exact, key)).max()
        assert off < MARGIN * ACCELERATION * scale, f"{key} off by {off:.2e} of {scale:.2e}"


@pytest.mark.parametrize("bodies", [("ground", "b"), ("b", "ground")])
def test_moment_about_a_hinge_and_constant_acceleration_agree(bodies: tuple[str, str]):
    moment = tuple(3.0 * np.array(SIDEWAYS))
    scene = one_body(**hinge(Revolute, bodies), load=(Moment(body="b", moment=moment),))
    times = np.linspace(0, 1, 6)
    expected = 3.0 / moment_of_inertia(scene) * times**2 / 2
    assert expected[-1] > 2 * math.pi, "the case is to turn more than once"
    assert_angle(scene, run(scene, times, "tuned", 5e-3), expected, MARGIN * TURNING)


@pytest.mark.parametrize("kind", [Revolute, Cylindrical])
@pytest.mark.parametrize("bodies", [("ground", "b"), ("b", "ground")])
def test_torsion_spring_beyond_a_turn_and_closed_form_agree(kind: type, bodies: tuple[str, str]):
    """Released at 0 with natural angle ±8 rad: swings about it, past ±16 rad."""
    natural = 8.0 if bodies[0] == "ground" else -8.0  # the coordinate of the second body about the first
    spring = TorsionSpring(joint="J", stiffness=2.0, damping=0.05, natural_angle=natural)
    scene = one_body(**hinge(kind, bodies), load=(spring,))
    times = np.linspace(0, 1, 6)
    j = moment_of_inertia(scene)
    decay, rate = 0.05 / (2 * j), math.sqrt(2.0 / j)
    damped = math.sqrt(rate**2 - decay**2)
    swing = np.exp(-decay * times) * (np.cos(damped * times) + decay / damped * np.sin(damped * times))
    assert_angle(scene, run(scene, times, "tuned", 5e-3), 8.0 * (1 - swing), MARGIN * TURNING)


def test_force_and_spring_on_a_slider_and_closed_form_agree():
    """A spring along the axis and a constant force, both through the centre of mass."""
    axis, start = np.array(SIDEWAYS), np.array([0.0, 0.2, 0.0])
    far = tuple((start - 0.5 * axis).tolist())
    at = tuple(start.tolist())
    loads = (
        Spring(bodies=("ground", "b"), points=(far, at), stiffness=80.0, damping=1.5, natural_length=0.45),
        Force(body="b", point=at, force=tuple((4.0 * axis).tolist())),
    )
    scene = one_body(**hinge(Translational), load=loads)
    times = np.linspace(0, 1, 6)
    rest = 4.0 / 80.0 - 0.05
    decay, rate = 1.5 / 4.0, math.sqrt(40.0)
    damped = math.sqrt(rate**2 - decay**2)
    swing = np.exp(-decay * times) * (np.cos(damped * times) + decay / damped * np.sin(damped * times))
    moved = (run(scene, times, "tuned", 5e-3).position[:, 0] - start) @ axis
    off = np.abs(moved - rest * (1 - swing)).max()
    assert off < MARGIN * ROUNDING, f"displacement off by {off:.2e} m"


@pytest.mark.parametrize("kind", [Revolute, Translational])
@pytest.mark.parametrize("family", ["static", "tuned"])
@pytest.mark.parametrize("bodies", [("ground", "b"), ("b", "ground")])
def test_driven_joint_and_its_prescribed_motion_agree(kind: type, family: str, bodies: tuple[str, str]):
    driver = Driver(joint="J", polynomial=(0.0, 2.0, 9.0), sine=Sine(amplitude=0.4, frequency=7.0))
    scene = one_body(**hinge(kind, bodies), driver=(driver,))
    times = np.array([0.0, 0.1, 0.25, 0.6, 1.0])
    trajectory = run(scene, times, family, 5e-3)
    value = 2.0 * times + 9.0 * times**2 + 0.4 * np.sin(7.0 * times)
    value *= 1 if bodies[0] == "ground" else -1
    if kind is Translational:
        off = np.abs((trajectory.position[:, 0] - (0.0, 0.2, 0.0)) @ SIDEWAYS - value).max()
        assert off < MARGIN * DRIVEN[0], f"displacement off by {off:.2e} m"
    else:
        assert value.max() > 2 * math.pi or value.min() < -2 * math.pi
        assert_angle(scene, trajectory, value, MARGIN * DRIVEN[0])
    rate = (2.0 + 18.0 * times + 2.8 * np.cos(7.0 * times)) * (1 if bodies[0] == "ground" else -1)
    seen = trajectory.velocity if kind is Translational else trajectory.angular_velocity
    off = np.abs(seen[:, 0] @ SIDEWAYS - rate).max()
    assert off < MARGIN * DRIVEN[1], f"rate off by {off:.2e}"
    assert trajectory.acceleration is None, "initial accelerations leave out the driver's"


def test_mechanism_of_every_joint_and_its_joint_equations_agree():
    for scene in (every_joint(), driven()):
        measured = measure(scene, run(scene, np.linspace(0, 0.2, 6), "tuned", 2.5e-3))
        assert measured["violation_position"] < MARGIN * OPEN[0], (scene.name, measured)
        assert measured["violation_velocity"] < MARGIN * OPEN[1], (scene.name, measured)


def test_torque_free_body_and_truth_agree():
    body = Body(
        name="top",
        mass=2.0,
        inertia=INERTIA,
        position=(1.0, 2.0, 3.0),
        orientation=TURNED,
        velocity=(1.0, 0.0, -0.5),
        angular_velocity=(3.0, 8.0, -2.0),
    )
    scene = Scene(name="top", body=(body,), gravity=(0.0, -9.81, 0.0), duration=1.0)
    measured = measure(scene, run(scene, np.linspace(0, 1, 6), "tuned", 2e-3), truth_for(scene))
    assert measured["error"] < MARGIN * TUMBLING, measured


def test_irregular_samples_and_even_samples_agree():
    scene = SCENES["planar_slider_crank_gravity"]()
    even = np.linspace(0, 0.1, 11)
    some = even[[3, 4, 8, 10]]  # two spacings, and not from t = 0
    for family, tolerance in (("tuned", MARGIN * 2.7e-14), ("alpha", MARGIN * 1.4e-9)):
        dense, sparse = run(scene, even, family, 1e-4), run(scene, some, family, 1e-4)
        off = np.abs(dense.position[[3, 4, 8, 10]] - sparse.position).max()
        assert off < tolerance, f"{family} off by {off:.2e} m"


def test_defaults_on_redundant_constraints_fail_and_say_so():
    scene = SCENES["planar_slider_crank"]()
    trajectory = ENGINE.run(scene, np.linspace(0, 0.1, 11), Setting("defaults", {"step": 1e-3}))
    assert trajectory.outcome is Outcome.SINGULAR_MATRIX, (trajectory.outcome, trajectory.message)
    assert "zero initial accelerations" in trajectory.message, trajectory.message
    assert len(trajectory.times) == 1, f"the start is known, got {trajectory.times}"


def test_stop_at_a_singular_position_keeps_the_states_before_it():
    scene = SCENES["planar_slider_crank_equal"]()
    trajectory = ENGINE.run(scene, np.linspace(0, 0.1, 11), Setting("trapezoidal", {"step": 1e-4}))
    assert trajectory.outcome is Outcome.NOT_CONVERGED, (trajectory.outcome, trajectory.message)
    singular = 0.0612  # s, where the crank has turned to π/2
    assert abs(trajectory.t_end - singular) < MARGIN * 1e-4, trajectory.t_end
    assert trajectory.times[-1] == pytest.approx(0.06), trajectory.times
    measured = measure(scene, trajectory, truth_for(scene))
    assert measured["error"] < MARGIN * BEFORE, measured


def test_static_analysis_refuses_a_singular_pose():
    """At θ = π, where a fully driven four-bar can take two branches."""
    quarter = math.pi / 2
    scene = SCENES["four_bar"]()
    scene = scene.with_(driver=(Driver(joint="A", polynomial=(0.0, -quarter)),))
    trajectory = ENGINE.run(scene, np.linspace(0, 1, 5), Setting("static", {"step": 0.05}))
    assert trajectory.outcome is not Outcome.COMPLETED, trajectory.t_end
    assert 0.9 < trajectory.t_end < 1, (trajectory.t_end, trajectory.message)


def test_scene_without_masses_is_driven_or_refused():
    scene = SCENES["four_bar"]()
    bare = scene.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body))
    assert ENGINE.cannot(bare) is None
    assert {s.family for s in ENGINE.settings(bare)} == {"static"}
    assert "driven" in str(ENGINE.cannot(bare.with_(driver=())))
    times = np.linspace(0, 0.02, 5)
    with_mass, without = run(scene, times, "static", 1e-3), run(bare, times, "static", 1e-3)
    assert np.array_equal(with_mass.position, without.position), "masses took part in kinematics"


def test_nothing_is_printed_or_written(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    for name, family in (("planar_slider_crank", "defaults"), ("four_bar", "static"), ("four_bar", "tuned")):
        ENGINE.run(SCENES[name](), np.linspace(0, 0.02, 3), Setting(family, {"step": 1e-3}))
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []
