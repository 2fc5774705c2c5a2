"""Runs by ``simulate``: outcomes, corrected starts, prescribed motions, limits and methods."""

import re

import numpy as np
import pytest

from mbref import diagnose
from mbref.input_error import InputError
from mbref.method import Method, MethodError
from mbref.scene import Body, Driver, Revolute, Scene, SceneError, Sine, TorsionSpring, Translational
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate

FINE = Limits(rtol=1e-11)
PENDULUM = SCENES["point_pendulum"]().with_(duration=0.2)
ROD = {"mass": 2.0, "inertia": (0.1, 0.7, 0.7)}
AXLE = Revolute(name="H", bodies=("ground", "b"), anchor=(1, 0, 0), axis=(1, 0, 0))


def completed(scene, method="mpi-svd+projection", times=(0.0, 1.0), limits=FINE):
    trajectory = simulate(scene, method, times, limits)
    assert trajectory.outcome.name == "COMPLETED", trajectory.message
    return trajectory


def one_body(joint, load=(), driver=(), **body):
    bodies = (Body(name="b", position=(1.0, 0.0, 0.0), **{**ROD, **body}),)
    return Scene(name="one", body=bodies, joint=joint, load=load, driver=driver)


def difference(measured, expected):
    """Return the largest difference of two arrays, in their unit."""
    return np.max(np.abs(np.asarray(measured) - expected))


def spinning(load=()):
    """Return a body that turns about its hinge at 10 rad/s."""
    return one_body((AXLE,), load, angular_velocity=(10.0, 0.0, 0.0))


@pytest.mark.parametrize("turn", [0.5, 2.0])
def test_largest_turn_bounds_the_angle_that_a_body_turns_in_a_step(turn):
    """A body turns by 100 rad in steps of at most ``turn`` (rad). The tolerance, rtol 0.9, would allow longer
    steps; at most 12 shorter steps lead from the first step of 1 ms to this length."""
    limits = Limits(rtol=0.9, largest_turn=turn, first_step=1e-3)
    steps = completed(spinning(), "lm1+projection", [10.0], limits).cost.steps
    assert 100 / turn <= steps < 100 / turn + 12


@pytest.mark.parametrize("method", ["lm1+none", "lm1+projection", "lm1+projection/adams"])
def test_fast_spin_at_a_loose_tolerance_is_followed_over_every_turn(method):
    """The body turns by 100 rad, to 0.01, before its sample; steps as long as rtol 0.9 allows would lose
    turns and torque of the spring, whose stiffness of 1e-9 N m/rad does not change the spin."""
    run = completed(spinning((TorsionSpring(joint="H", stiffness=1e-9),)), method, [0, 10], Limits(rtol=0.9))
    assert run.load_at(0).angle[-1] == pytest.approx(100.0, abs=0.01)
    assert difference(np.abs(run.orientation[-1, 0, :2]), np.abs([np.cos(50.0), np.sin(50.0)])) < 0.01


@pytest.mark.parametrize("method", ["lm1+none", "lm1+projection", "lm1+projection/adams", "lm1+partitioning"])
def test_orientation_of_every_sample_is_a_unit_quaternion(method):
    """Quaternions of any length satisfy the joint's equations, and rtol 1e-3 lets their lengths drift."""
    run = completed(spinning(), method, np.linspace(0.0, 10.0, 11), Limits(rtol=1e-3))
    assert difference(np.linalg.norm(run.orientation, axis=-1), 1.0) < 1e-12  # rounding


@pytest.mark.parametrize("method", ["mpi-svd+projection", "lm1+partitioning", "lm1+none"])
def test_bodies_without_masses_follow_their_drivers(method):
    """The tip is at (r cos φ, r sin φ); drivers set r = 1 + 2 t and φ = t + t² / 2 + sin(3 t) / 2."""
    sine = Sine(amplitude=0.5, frequency=3.0)
    hinge = Revolute(name="H", bodies=("ground", "arm"), anchor=(0, 0, 0), axis=(0, 0, 1))
    slide = Translational(name="S", bodies=("arm", "block"), anchor=(1, 0, 0), axis=(1, 0, 0))
    drivers = Driver(joint="H", polynomial=(0, 1, 0.5), sine=sine), Driver(joint="S", polynomial=(0, 2))
    bodies = Body(name="arm", position=(0.5, 0, 0)), Body(name="block", position=(1, 0, 0))
    scene = Scene(name="arm", body=bodies, joint=(hinge, slide), driver=drivers)
    t = np.linspace(0, 1, 5)
    angle, reach = t + 0.5 * t**2 + 0.5 * np.sin(3 * t), 1 + 2 * t
    trajectory = completed(scene, method, t)
    expected = np.stack([reach * np.cos(angle), reach * np.sin(angle), 0 * t], axis=1)
    assert difference(trajectory.position[:, 1], expected) < 100 * FINE.rtol


def test_run_without_masses_and_drivers_is_refused_with_a_fault_for_each_body():
    """Three bodies: the faults have the paths of their masses."""
    scene = SCENES["planar_slider_crank"]()
    body = tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body)
    with pytest.raises(SceneError) as caught:
        simulate(scene.with_(body=body, load=()), "lm1+none", [0.1])
    assert [fault.split(":")[0] for fault in caught.value.faults] == [f"body[{k}].mass" for k in range(3)]


def test_slightly_wrong_velocities_are_corrected_and_reported():
    """Velocities of centres are 0.1 % too large for the rates, ``excess``. The least correction is smaller
    than this error; corrected velocities satisfy the joints to rounding, and the message reports them."""
    scene = SCENES["planar_slider_crank_gravity"]()
    start, excess = simulate(scene, "mpi-svd+none", [0.0]), 1e-3
    given = [
        b.model_copy(
            update={"velocity": tuple((v * (1 + excess)).tolist()), "angular_velocity": tuple(w.tolist())}
        )
        for b, v, w in zip(scene.body, start.velocity[0], start.angular_velocity[0], strict=True)
    ]
    corrected = simulate(scene.with_(body=given), "mpi-svd+none", [0.0])
    assert re.fullmatch(r"initial velocities by \S+ of the largest; corrected", corrected.message)
    largest = np.abs(start.velocity).max()  # m/s
    assert 0 < difference(corrected.velocity[0], start.velocity[0]) < excess * largest
    assert corrected.violation.velocity.max() < 1e-9  # m/s; rounding of 20 m/s, over steps of 1e-7


def test_run_that_violates_a_joint_too_much_ends_and_names_the_joint():
    """Without stabilisation rtol 1e-3 lets joints drift by more than ``violation``, 1e-6 of the length."""
    limits = Limits(rtol=1e-3, violation=1e-6)
    trajectory = simulate(SCENES["spatial_slider_crank_driven"](), "lm1+none", [1.0], limits)
    assert trajectory.outcome.label == "VIOLATION" and "joint '" in trajectory.message, trajectory.message


def test_run_ends_as_failed_after_the_largest_number_of_steps():
    """Ten steps do not reach 0.4 s."""
    trajectory = simulate(SCENES["planar_slider_crank"](), "mpi-svd+projection", [0.4], Limits(most_steps=10))
    assert (trajectory.outcome.name, trajectory.cost.steps) == ("STEP_FAILED", 10)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("lm9+none", "unknown formulation 'lm9'; known: lm1"),
        ("lm1+glue", "unknown stabilisation 'glue'; known: none, baumgarte"),
        ("lm1+none/euler", "unknown integrator 'euler'; known: dop853"),
        ("lm1+baumgarte[5,alpha=7]", "stabilisation baumgarte: option alpha is given twice; give it once"),
        ("lm1+baumgarte[gamma=5]", "has no option 'gamma'; it has: alpha, beta"),
        ("lm1+baumgarte[alpha=x]", "must be a number"),
    ],
)
def test_unknown_part_of_a_method_is_refused_with_the_known_ones(name, complaint):
    """A name has a formulation, a stabilisation and an integrator, each with options in brackets."""
    with pytest.raises(MethodError) as caught:
        Method.parse(name)
    assert complaint in str(caught.value)


@pytest.mark.parametrize("name", ["lm1+none/dop853", "alf+baumgarte[alpha=10,beta=3]/rk4[step=0.0012345678]"])
def test_name_of_a_method_is_parsed_and_printed_in_full(name):
    """Numbers keep their digits; options without names are the stabilisation's; the integrator is added."""
    assert str(Method.parse(name)) == name
    assert str(Method.parse("lm1+baumgarte[10,3]")) == "lm1+baumgarte[alpha=10,beta=3]/dop853"


@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_first_step_of_the_length_of_the_run_is_its_only_step(integrator):
    """The run takes 1e-4 s at rtol 1e-3. With a first step of a tenth of it more steps are needed."""
    scene, method = SCENES["planar_slider_crank"](), f"mpi-svd+none/{integrator}"
    limits = (Limits(rtol=1e-3, first_step=first) for first in (1e-4, 1e-5))
    steps = [simulate(scene, method, [1e-4], each).cost.steps for each in limits]
    assert steps[0] == 1 < steps[1], f"{integrator}: {steps} steps with the first of 1e-4 and 1e-5 s"


def test_taylor_named_as_the_integrator_of_alf_dual_in_old_records_is_the_method_taylor():
    """Options are kept; the name of the method is printed without formulation and stabilisation."""
    assert str(Method.parse("taylor[order=14]")) == "taylor[order=14]"
    assert Method.parse("alf-dual+projection/taylor[order=14]") == Method.parse("taylor[order=14]")


def test_taylor_with_a_formulation_and_orders_above_30_are_refused():
    """The first refusal names the right method, the second the interval of orders."""
    with pytest.raises(MethodError, match=r"taylor has no formulation .* use taylor\[order=8\]"):
        Method.parse("lm1+none/taylor[order=8]")
    with pytest.raises(ValueError, match="order must be 4 to 30, got 31"):
        simulate(SCENES["point_pendulum"](), "taylor[order=31]", [0.1])


def test_diagnosis_takes_a_file_s_name_a_built_in_name_or_a_scene(tmp_path):
    """The file has the pendulum; a name of neither a file nor a built-in scene is refused."""
    PENDULUM.save(tmp_path / "pendulum.toml")
    assert diagnose(str(tmp_path / "pendulum.toml")) == diagnose(PENDULUM) == diagnose(PENDULUM.with_())
    assert diagnose("four_bar").counts == diagnose(SCENES["four_bar"]()).counts
    with pytest.raises(SceneError, match="unknown scene 'no_such_scene'"):
        diagnose("no_such_scene")


def test_duration_gives_a_run_101_samples_up_to_its_end():
    """The run equals one at 101 equidistant times."""
    run = simulate(PENDULUM, "lm1+none", duration=0.1)
    assert run.times[-1] == 0.1 and len(run.times) == 101, run.times
    given = simulate(PENDULUM, "lm1+none", np.linspace(0.0, 0.1, 101))
    assert np.array_equal(run.position, given.position)


def test_argument_rtol_of_simulate_equals_rtol_of_limits():
    """A tolerance of 1e-10 takes more steps than 1e-3; both ways of giving it lead to equal bits."""
    loose, fine = (simulate(PENDULUM, "lm1+none", [2.0], rtol=rtol) for rtol in (1e-3, 1e-10))
    assert fine.cost.steps > loose.cost.steps, "the tolerance was not taken"
    same = simulate(PENDULUM, "lm1+none", [2.0], Limits(rtol=1e-10))
    assert np.array_equal(same.position, fine.position)


def test_duration_together_with_sample_times_is_refused():
    """The duration would be 0.2 s, the only sample time is 0.1 s."""
    with pytest.raises(ValueError, match="give sample times or a duration, not both"):
        simulate(PENDULUM, "lm1+none", [0.1], duration=0.2)


@pytest.mark.parametrize(
    ("times", "says"),
    [
        ([], "needs at least one sample time"),
        ([[0.0, 0.1]], "needs at least one sample time"),
        ([0.1, 0.1], "must be finite, not negative and increasing"),
        ([0.2, 0.1], "must be finite, not negative and increasing"),
        ([-0.1, 0.1], "must be finite, not negative and increasing"),
        ([0.0, float("nan")], "must be finite, not negative and increasing"),
        (["soon"], "must be numbers"),
        ([10**400], "must be numbers"),
        ([[0.0], [1.0, 2.0]], "must be numbers"),
    ],
)
def test_times_of_simulate_that_are_no_samples_are_refused(times, says):
    """Refused are no time, lists of lists, equal, falling, negative and undefined times (NaN), texts, and a
    number that no float can hold."""
    with pytest.raises(InputError, match=f"^times: {says}$"):
        simulate("four_bar", times=times)
