"""The Taylor method against truths, against the general kernels, and where there is no motion to follow."""

import numpy as np
import pytest

from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref.method import Method, MethodError
from mbref.scene import (
    Body,
    Cylindrical,
    Driver,
    Revolute,
    Scene,
    SceneError,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate

FIELDS = ("position", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
ROD = {"mass": 2.0, "inertia": (0.1, 0.7, 0.8)}
SCREW = Scene(
    name="two_rods",
    gravity=(0.3, -9.81, 1.0),
    duration=1.5,
    body=(
        Body(name="a", position=(0.5, 0.0, 0.0), angular_velocity=(0.0, 0.0, 9.0), **ROD),
        Body(name="b", position=(1.5, 0.0, 0.2), **ROD),
    ),
    joint=(
        Revolute(name="A", bodies=("ground", "a"), anchor=(0, 0, 0), axis=(0, 0, 1)),
        Cylindrical(name="B", bodies=("a", "b"), anchor=(1, 0, 0), axis=(0, 1, 2)),
    ),
    load=(
        Spring(
            bodies=("ground", "b"), points=((0, 2, 1), (2, 0, 0)), stiffness=40, damping=2, natural_length=1
        ),
        TorsionSpring(joint="A", stiffness=5.0, damping=0.1, natural_angle=7.0),
        TorsionSpring(joint="B", stiffness=3.0, natural_angle=-1.0),
    ),
)  # three degrees of freedom; the first joint turns more than once


def largest(arrays):
    return max((float(np.abs(array).max(initial=0.0)) for array in arrays), default=0.0)


def assert_alike(a, b, tolerance):
    """Equal motions and reactions, relative to the largest of each."""
    assert (a.outcome.name, b.outcome.name) == ("COMPLETED", "COMPLETED"), f"{a.message} {b.message}"
    for field in FIELDS:
        one, other = getattr(a, field), getattr(b, field)
        allowed = 10.0 * tolerance if "acceleration" in field else tolerance  # stiff springs multiply errors
        assert np.abs(one - other).max() <= allowed * max(1.0, np.abs(one).max()), field
    if a.reactions:
        size = largest(a.reactions.values())
        unique = [name for name in a.reactions if not np.any(a.open_reactions[name])]
        apart = largest(a.reactions[name] - b.reactions[name] for name in unique)
        assert apart <= max(tolerance, 1e-5) * size  # redundant rows share reactions in another way


@pytest.mark.parametrize("seed", [*range(8), 21, 23, 24, 29])
def test_a_random_mechanism_as_by_the_general_kernels(seed):
    scene, times = random_mechanism(seed), np.linspace(0.0, 0.1, 4)
    general = simulate(scene, "alf-dual+projection", times, Limits(rtol=1e-11))
    assert_alike(general, simulate(scene, "taylor", times, Limits(rtol=1e-11)), 1e-7)


@pytest.mark.parametrize("name", ["planar_slider_crank", "spatial_slider_crank_gravity"])
def test_errors_fall_with_the_tolerance(name):
    scene = SCENES[name]()
    times = np.linspace(0.0, 0.1, 5)
    tolerances = (1e-6, 1e-9, 1e-12)
    runs = [simulate(scene, "taylor", times, Limits(rtol=rtol)) for rtol in tolerances]
    errors = [measure(scene, run, truth_for(scene))["error"] for run in runs]
    assert errors[1] < 0.1 * errors[0] and errors[2] < 0.1 * errors[1]
    assert all(error < 1e3 * rtol for error, rtol in zip(errors, tolerances, strict=True))


def test_samples_end_no_step():
    scene = SCENES["planar_slider_crank"]()
    few, many = (simulate(scene, "taylor", np.linspace(0, 0.05, k), Limits(rtol=1e-9)) for k in (2, 41))
    assert few.cost.steps == many.cost.steps
    assert np.array_equal(few.position[-1], many.position[-1])


def test_a_driven_start_in_a_singular_position():
    scene = SCENES["four_bar_straight"]()
    run = simulate(scene, "taylor", [0.05], Limits(rtol=1e-9))
    assert run.outcome.name == "COMPLETED" and measure(scene, run, truth_for(scene))["error"] < 1e-12


def test_bodies_without_mass_move_as_drivers_prescribe():
    bar = Body(name="bar", position=(1.0, 0.0, 0.0))
    hinge = Revolute(name="H", bodies=("ground", "bar"), anchor=(0, 0, 0), axis=(0, 1, 0))
    scene = Scene(
        name="driven", body=(bar,), joint=(hinge,), driver=(Driver(joint="H", polynomial=(0, 2.0, 3.0)),)
    )
    times = np.linspace(0.0, 1.0, 5)
    run = simulate(scene, "taylor", times)
    angle = 2.0 * times + 3.0 * times**2
    assert np.abs(run.position[:, 0, 0] - np.cos(angle)).max() < 1e-12
    assert np.abs(run.angular_acceleration[:, 0, 1] - 6.0).max() < 1e-9
    with pytest.raises(SceneError, match="bar"):
        simulate(scene.with_(driver=()), "taylor", times)


def test_names_and_what_does_not_go_together():
    assert str(Method.parse("taylor[order=14]")) == "alf-dual+projection/taylor[order=14]"
    assert Method.parse(str(Method.parse("taylor"))) == Method.parse("taylor")
    with pytest.raises(MethodError, match="projects every step"):
        Method.parse("lm1+none/taylor")
    with pytest.raises(ValueError, match="order must be 4 to 30, got 31"):
        simulate(SCREW, "taylor[order=31]", [0.1])


def test_most_steps_end_a_run():
    run = simulate(SCENES["planar_slider_crank"](), "taylor", [0.1], Limits(most_steps=3))
    assert (run.outcome.name, run.cost.steps) == ("STEP_FAILED", 3)


@pytest.mark.parametrize("length", [0.05, 1.0, 30.0])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (1.0, 2.0, 3.0)])
def test_a_pendulum_on_a_driven_cart(axis, length):
    """The cart's place is the driver's, in the unit of length of the scene; the pendulum is free."""
    cart = Body(name="cart", mass=0.3, inertia=(1e-3, 1e-3, 1e-3), position=(0, 0, 0))
    place = (0.2 * length, 0.1 * length, -0.2 * length)
    bob = Body(name="bob", mass=2.5, inertia=tuple(np.array([0.02, 0.04, 0.04]) * length**2), position=place)
    scene = Scene(
        name="driven_cart",
        gravity=(0, 0, -9.81),
        body=(cart, bob),
        joint=(
            Translational(name="S", bodies=("ground", "cart"), anchor=(0, 0, 0), axis=axis),
            Revolute(name="R", bodies=("cart", "bob"), anchor=(0, 0, 0), axis=(0, 1, 0)),
        ),
        driver=(Driver(joint="S", polynomial=(0.0, 0.2 * length, 0.7 * length)),),
    )
    times = [0.05, 0.1]
    series = simulate(scene, "taylor", times, Limits(rtol=1e-10))
    general = simulate(scene, "alf-dual+projection", times, Limits(rtol=1e-11))
    assert series.outcome.label == "COMPLETED", series.message
    assert np.allclose(series.position, general.position, rtol=0, atol=1e-9 * length)


@pytest.mark.parametrize("name", ["planar_slider_crank_equal", "planar_slider_crank_heavy"])
def test_a_sample_at_a_singular_position(name):
    """The rows leave one more motion free there, whose acceleration is that of the positions beside it."""
    crossing = simulate(SCENES[name](), "taylor", [2.0 if "heavy" in name else 0.1]).crossings[0].time
    times = crossing * np.array([1.0, 1.0 + 3e-7, 1.2])
    run = simulate(SCENES[name](), "taylor", times)
    assert run.outcome.name == "COMPLETED", run.message
    assert np.abs(run.acceleration[0] - run.acceleration[1]).max() < 1e-5 * np.abs(run.acceleration[1]).max()
    assert all(marks[0] > marks[2] for marks in run.open_reactions.values()), "its reactions are open"
