"""The comparison of models, ``gate`` for short runs and ``along`` for accelerations of whole runs: a run
passes if its model is the scene's, and does not with one fault in it."""

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.engine import engine
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.model_identity import along, differences, gate, gate_times
from crosscheck.judge.tolerances import LEAST_CHANGE, SAME_CHANGE, SINGLE_CHANGE
from crosscheck.judge.truth import truth_for
from crosscheck.processes.serve import run_once
from mbref.scene import Body, Revolute, Scene, Spring, TorsionSpring
from mbref.scenes import SCENES
from tests.helpers.truth_scenes import ALL, CLOSED

FOUR_BAR = ALL["four_bar_gravity"]


def short_run(scene, times=None):
    """Return the exact motion at the times of the comparison of models."""
    return truth_for(scene).poses(gate_times(scene) if times is None else times)


@pytest.mark.parametrize("name", CLOSED)
def test_exact_motions_of_a_scene_pass_the_comparison_with_and_without_accelerations(name):
    """``gate`` returns the first difference of short runs, or None. The runs are closed forms."""
    run = short_run(SCENES[name]())
    found = gate(SCENES[name](), [run, replace(run, acceleration=None, angular_acceleration=None), run])
    assert found is None, f"{name}: {found}"


def test_a_run_with_missing_samples_is_reported():
    """The comparison needs two samples; the second run has one of them, then none."""
    scene, run = FOUR_BAR, short_run(FOUR_BAR)
    found = gate(scene, [run, short_run(scene, np.zeros(1))])
    assert found is not None and found.field == "samples reached", found
    assert gate(scene, [run, short_run(scene, np.zeros(0))]).field == "samples reached"


def test_a_rotated_body_is_reported_with_its_angle():
    """The unturned coupler gets the quaternion (cos 1e-6, 0, 0, sin 1e-6), a turn by 2e-6 rad."""
    scene, run = FOUR_BAR, short_run(FOUR_BAR)
    orientation = run.orientation.copy()
    orientation[0, 1] = [np.cos(1e-6), 0, 0, np.sin(1e-6)]
    found = gate(scene, [run, replace(run, orientation=orientation)])
    assert found.field == "initial orientation" and found.by == pytest.approx(2e-6, rel=1e-6), found


ARM = Body(name="arm", mass=2.0, inertia=(1e-3, 0.1, 0.1), position=(0.5, 0.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
ENDS = ((1.0, 1.0, 0.0), (1.0, 0.0, 0.0))  # m, of a spring that pulls the arm's end by 9.81 N/m · 1 m
HOLDING = Spring(bodies=("ground", "arm"), points=ENDS, stiffness=9.81, damping=0.0, natural_length=0.0)


def arm(**parts):
    given = {"body": (ARM,), "joint": (HINGE,), "gravity": (0.0, -9.81, 0.0), "duration": 1.0, **parts}
    return Scene(name="arm", **given)


BALANCED = {
    "a boom held by a spring": arm(load=(HOLDING,)),
    "a rod that hangs": arm(gravity=(9.81, 0.0, 0.0)),
    "a body in free fall": arm(joint=()),
    "a body at rest without gravity": arm(joint=(), gravity=(0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("balanced", BALANCED)
def test_engines_pass_the_comparison_where_forces_balance_to_rounding(balanced, name):
    """``gate`` finds no difference, None, between an engine's short run and Gauss's principle. Where forces
    balance, differences of velocity are relative to a free fall."""
    scene = BALANCED[balanced]
    setting = engine(name).best_settings(scene)[-1]
    run = run_once(name, scene, gate_times(scene), setting)
    exact = gauss_motion(scene, tuple(gate_times(scene)))
    assert gate(scene, [exact, run]) is None, gate(scene, [exact, run])


@pytest.mark.parametrize(("part", "passes"), [(0.9, True), (1.1, False)])
def test_differences_of_a_body_in_balance_are_relative_to_free_fall(part, passes):
    """Changes of velocity may be off by SAME_CHANGE · LEAST_CHANGE (the judge's tolerances) times g t. An
    error of 0.9 times this passes, and one of 1.1 times does not."""
    scene = BALANCED["a boom held by a spring"]
    exact = gauss_motion(scene, tuple(gate_times(scene)))
    shift = np.zeros_like(exact.velocity)
    shift[1, 0, 1] = part * SAME_CHANGE * LEAST_CHANGE * 9.81 * gate_times(scene)[1]
    found = gate(scene, [exact, replace(exact, velocity=exact.velocity + shift)])
    assert (found is None) is passes, found


LATER = TorsionSpring(joint="A", stiffness=30.0, damping=0.0, natural_angle=0.0)  # no moment at the start


def test_a_missing_spring_that_is_slack_at_the_start_is_found_along_the_run():
    """A run without the spring passes ``gate``, which compares short runs. Later its accelerations do not
    solve the judge's equations at its own states, which ``along`` finds."""
    scene, without = arm(load=(LATER,)), arm()
    times = tuple(np.linspace(0.0, 0.3, 7))
    lost = replace(gauss_motion(without, times), engine="other")
    short = [gauss_motion(s, tuple(gate_times(scene))) for s in (scene, without)]
    assert gate(scene, short) is None
    assert along(scene, gauss_motion(scene, times)) is None
    found = along(scene, lost)
    assert found is not None and found.engines == ("the judge", "other"), found
    assert found.field.startswith("acceleration at t = 0."), found


@pytest.mark.parametrize(("part", "passes"), [(0.009, True), (0.011, False)])
def test_accelerations_along_a_run_may_be_off_by_one_percent(part, passes):
    """A pendulum's accelerations 0.9 % too large pass, 1.1 % do not; a run without accelerations passes."""
    scene = arm()
    run = gauss_motion(scene, (0.0, 0.1))
    names = ("acceleration", "angular_acceleration")
    off = replace(run, **{name: (1 + part) * getattr(run, name) for name in names})
    assert (along(scene, off) is None) is passes, along(scene, off)
    assert along(scene, replace(off, acceleration=None)) is None


def test_accelerations_at_a_singular_position_are_not_compared_along_the_run():
    """A four-bar is flat at its start, which is singular, and regular after 4 ms. An error of 100 times its
    largest acceleration is found in the second sample, and not in the first."""
    straight = SCENES["four_bar_straight"]()
    exact = truth_for(straight).poses(np.array([0.0, 0.004]))
    error = 100 * np.abs(exact.acceleration).max() * np.array([1.0, 0.0])[:, None, None]
    assert along(straight, replace(exact, acceleration=exact.acceleration + error)) is None
    found = along(straight, replace(exact, acceleration=exact.acceleration + error[::-1]))
    assert found is not None and found.field == "acceleration at t = 0.004 s", found


def fault_in_single_precision(scene, run, rounding=2.0**-23):
    """Return the field in which a run, rounded to 24 bits, differs from the exact motion, or ""."""
    names = ("position", "orientation", "velocity", "angular_velocity")
    rounded = {name: getattr(run, name).astype(np.float32).astype(float) for name in names}
    one = replace(run, engine="one", acceleration=None, angular_acceleration=None, **rounded)
    found = differences(scene, [short_run(scene), one], {"one": rounding})
    return found["one"].field if found else ""


def test_states_in_single_precision_pass_only_if_the_engine_declares_its_rounding():
    """States of 24 bits pass at a declared rounding of 2⁻²³, not of 2⁻⁵²; missing gravity is found."""
    scene = FOUR_BAR
    exact, weightless = short_run(scene), scene.with_(gravity=(0.0, 0.0, 0.0))
    assert fault_in_single_precision(scene, exact) == ""
    assert fault_in_single_precision(scene, exact, 2.0**-52) == "initial position"
    lost = short_run(weightless, gate_times(scene))
    assert fault_in_single_precision(scene, lost).startswith("change of")


@pytest.mark.parametrize(("part", "field"), [(0.9, ""), (1.1, "change of velocity")])
def test_changes_of_velocity_in_single_precision_may_be_off_by_a_fraction_of_the_largest(part, field):
    """One velocity is off by 0.9 or 1.1 times the tolerance, which is SINGLE_CHANGE of the largest change of
    a velocity or of an angular velocity times the length. "" stands for no difference."""
    scene = FOUR_BAR
    exact = short_run(scene)
    changes = np.diff(exact.velocity, axis=0), scene_length(scene) * np.diff(exact.angular_velocity, axis=0)
    change = np.linalg.norm(changes, axis=-1).max()
    moved = exact.velocity.copy()
    moved[1, 0, 0] += part * SINGLE_CHANGE * change
    assert fault_in_single_precision(scene, replace(exact, velocity=moved)) == field
