"""simulate: outcomes, start correction, kinematics, loads, the same result without the JIT."""

import numpy as np
import pytest

from mbref.method import Method, MethodError
from mbref.scene import (
    Body,
    Cylindrical,
    Distance,
    Driver,
    Revolute,
    Scene,
    SceneError,
    Sine,
    TorsionSpring,
    Translational,
    Universal,
)
from mbref.scenes import SCENES
from mbref.scenes.planar_slider_crank import slider_crank
from mbref.simulation.simulate import Limits, simulate

FINE = Limits(rtol=1e-11)
ROD = {"mass": 2.0, "inertia": (0.1, 0.7, 0.7)}


def completed(scene, method="mpi-svd+projection", times=(0.0, 1.0), limits=FINE):
    trajectory = simulate(scene, method, times, limits)
    assert trajectory.outcome.name == "COMPLETED", trajectory.message
    return trajectory


def one_body(joint, load=(), driver=(), **body):
    return Scene(
        name="one",
        body=(Body(name="b", position=(1.0, 0.0, 0.0), **{**ROD, **body}),),
        joint=joint,
        load=load,
        driver=driver,
    )


def near(measured, expected, tolerance, what):
    error = np.max(np.abs(np.asarray(measured) - expected))
    assert error < tolerance, f"{what}: {measured} is {error:.2e} from {expected}"


def test_torsion_spring_over_many_turns_and_closed_form():
    hinge = Revolute(name="H", bodies=("ground", "b"), anchor=(1, 0, 0), axis=(1, 0, 0))
    spring = TorsionSpring(joint="H", stiffness=0.4, natural_angle=20.0)  # axial inertia 0.1: ω = 2
    times = np.linspace(0, 1.5, 16)
    trajectory = completed(one_body((hinge,), (spring,)), times=times)
    angle = 20 * (1 - np.cos(2 * times))  # passes six turns
    expected = np.stack([np.cos(angle / 2), np.sin(angle / 2)], axis=1)
    measured = trajectory.orientation[:, 0, :2]
    sign = np.sign(np.sum(measured * expected, axis=1))[:, None]
    near(sign * measured, expected, 1e-9, "torsion spring")


@pytest.mark.parametrize(
    ("stabilisation", "wound", "asked", "turn"),
    [
        ("projection", False, 0.0, 0.75),
        ("projection", True, 0.0, 1.0),
        ("none", False, 0.0, 1.0),
        ("projection", True, 2.0, 2.0),
        ("projection", False, 0.5, 0.5),
    ],
)
def test_a_step_turns_no_body_farther_than_is_safe_or_asked(stabilisation, wound, asked, turn):
    hinge = Revolute(name="H", bodies=("ground", "b"), anchor=(1, 0, 0), axis=(1, 0, 0))
    spring = (TorsionSpring(joint="H", stiffness=1e-9),) if wound else ()
    scene = one_body((hinge,), spring)
    spun = scene.with_(body=(scene.body[0].model_copy(update={"angular_velocity": (10.0, 0.0, 0.0)}),))
    limits = Limits(rtol=0.9, largest_turn=asked, first_step=1e-3)
    steps = completed(spun, f"lm1+{stabilisation}", [10.0], limits).cost.steps
    assert 100 / turn <= steps < 100 / turn + 12, f"{steps} steps over 100 rad"


def test_full_inertia_and_principal_inertia_of_the_same_body():
    hinge = Universal(name="U", bodies=("ground", "b"), anchor=(0, 0, 0), axes=((0, 0, 1), (0, 1, 0)))
    spin = {"angular_velocity": (0.0, 1.0, 2.0)}
    turn = np.array([np.cos(0.4), *(np.sin(0.4) * np.array([2, 1, 2]) / 3)])
    from mbref import rotations

    axes = rotations.to_matrix(turn)
    full = tuple(map(tuple, (axes.T @ np.diag((0.1, 0.5, 0.55)) @ axes).tolist()))
    plain = completed(one_body((hinge,), inertia=(0.1, 0.5, 0.55), **spin))
    turned = completed(one_body((hinge,), inertia=full, orientation=tuple(turn.tolist()), **spin))
    near(turned.position, plain.position, 1e-9, "positions")
    relative = rotations.multiply(plain.orientation, np.broadcast_to(turn, plain.orientation.shape))
    near(rotations.angle_between(relative, turned.orientation), 0.0, 1e-8, "orientations")


@pytest.mark.parametrize("method", ["mpi-svd+projection", "lm1+partitioning", "lm1+none"])
def test_drivers_without_masses_follow_their_function(method):
    sine = Sine(amplitude=0.5, frequency=3.0)
    hinge = Revolute(name="H", bodies=("ground", "arm"), anchor=(0, 0, 0), axis=(0, 0, 1))
    slide = Translational(name="S", bodies=("arm", "block"), anchor=(1, 0, 0), axis=(1, 0, 0))
    scene = Scene(
        name="arm",
        body=(Body(name="arm", position=(0.5, 0, 0)), Body(name="block", position=(1, 0, 0))),
        joint=(hinge, slide),
        driver=(
            Driver(joint="H", polynomial=(0.0, 1.0, 0.5), sine=sine),
            Driver(joint="S", polynomial=(0, 2.0)),
        ),
    )
    t = np.linspace(0, 1, 5)
    angle, reach = t + 0.5 * t**2 + 0.5 * np.sin(3 * t), 1 + 2 * t
    trajectory = completed(scene, method, t)
    expected = np.stack([reach * np.cos(angle), reach * np.sin(angle), 0 * t], axis=1)
    near(trajectory.position[:, 1], expected, 1e-9, f"block by {method}")


def test_distance_and_cylindrical_joints_keep_theirs():
    scene = Scene(
        name="rod",
        gravity=(0, 0, -9.81),
        body=(
            Body(name="b", position=(1.0, 0, 0), angular_velocity=(1.0, 0, 0), **ROD),
            Body(name="c", position=(2.0, 0, 0.5), **ROD),
        ),
        joint=(
            Cylindrical(name="C", bodies=("ground", "b"), anchor=(1, 0, 0), axis=(0, 0, 1)),
            Distance(name="D", bodies=("b", "c"), anchors=((1.5, 0, 0), (2.0, 0, 0.5))),
        ),
    )
    with pytest.raises(SceneError, match=r"joint\[C\]: velocities given to bodies violate it by"):
        simulate(scene, "lm1+projection", [0.1])  # turning about x is what the cylindrical joint forbids
    body = scene.body[0].model_copy(update={"angular_velocity": (0.0, 0.0, 3.0)})
    trajectory = completed(scene.with_(body=(body, scene.body[1])), "lm1+projection", [0.5])
    near(trajectory.position[-1, 0, :2], (1.0, 0.0), 1e-12, "on the axis")


def test_kinematic_scene_with_a_freedom_left_names_the_bodies():
    scene = SCENES["planar_slider_crank"]()
    body = tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body)
    with pytest.raises(SceneError) as caught:
        simulate(scene.with_(body=body, load=()), "lm1+none", [0.1])
    assert [fault.split(":")[0] for fault in caught.value.faults] == [f"body[{k}].mass" for k in range(3)]


def test_slightly_wrong_velocities_are_corrected_and_reported():
    scene = SCENES["planar_slider_crank_gravity"]()
    start = simulate(scene, "mpi-svd+none", [0.0])
    given = [
        b.model_copy(update={"velocity": tuple((v * 1.001).tolist()), "angular_velocity": tuple(w.tolist())})
        for b, v, w in zip(scene.body, start.velocity[0], start.angular_velocity[0], strict=True)
    ]
    corrected = simulate(scene.with_(body=given), "mpi-svd+none", [0.0])
    assert "velocities" in corrected.message
    near(corrected.velocity[0], start.velocity[0], 0.02, "corrected velocities")


def test_violation_names_the_joint():
    limits = Limits(rtol=1e-3, violation=1e-6)
    trajectory = simulate(SCENES["spatial_slider_crank_driven"](), "lm1+none", [1.0], limits)
    assert trajectory.outcome.letter == "c"
    assert "joint '" in trajectory.message, trajectory.message


def test_step_limit_is_an_outcome():
    trajectory = simulate(SCENES["planar_slider_crank"](), "mpi-svd+projection", [0.4], Limits(most_steps=10))
    assert (trajectory.outcome.name, trajectory.cost.steps) == ("STEP_FAILED", 10)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("lm9+none", "unknown formulation 'lm9'; known: lm1"),
        ("lm1+glue", "unknown stabilisation 'glue'"),
        ("lm1+none/euler", "unknown integrator 'euler'"),
        ("lm1+baumgarte[gamma=5]", "has no option 'gamma'; it has: alpha, beta"),
        ("lm1+baumgarte[alpha=x]", "must be a number"),
    ],
)
def test_unknown_method_says_what_is_known(name, complaint):
    with pytest.raises(MethodError) as caught:
        Method.parse(name)
    assert complaint in str(caught.value)


@pytest.mark.parametrize("name", ["lm1+none/dop853", "mpi-svd+baumgarte[alpha=10,beta=3]/rk4[step=0.001]"])
def test_method_name_round_trips(name):
    assert str(Method.parse(name)) == name
    assert str(Method.parse("lm1+baumgarte[10,3]")) == "lm1+baumgarte[alpha=10,beta=3]/dop853"


@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_first_step_and_the_steps_up_to_a_sample(integrator):
    scene, method = SCENES["planar_slider_crank"](), f"mpi-svd+none/{integrator}"
    steps = [
        simulate(scene, method, [1e-4], Limits(rtol=1e-3, first_step=first)).cost.steps
        for first in (1e-4, 1e-5)
    ]
    assert steps[0] == 1 < steps[1], f"{integrator}: {steps} steps with the first of 1e-4 and 1e-5 s"


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1e6])
def test_the_unit_of_length_does_not_change_a_motion(unit):
    """Froude's scaling: lengths times s, times times √s.  Start velocities are found from the crank's."""
    times = np.linspace(0.0, 0.3, 7)
    turned = [
        simulate(slider_crank_of(size), "alf-dual+projection", times * size**0.5).orientation
        for size in (1.0, unit)
    ]
    assert np.abs(turned[0] - turned[1]).max() < 1e-8


def slider_crank_of(unit):
    """The slider-crank that turns under gravity with lengths in another unit (m); masses stay."""
    base = slider_crank(0.304, 0.4048, 0.3, "crank")
    scene = slider_crank(0.304 * unit, 0.4048 * unit, 0.3, "crank", rate=30.0 / unit**0.5)
    masses = [(body.mass, tuple((np.array(body.inertia) * unit**2).tolist())) for body in base.body]
    body = tuple(
        b.model_copy(update={"mass": mass, "inertia": inertia})
        for b, (mass, inertia) in zip(scene.body, masses, strict=True)
    )
    return scene.with_(body=body, gravity=(0.0, -9.81, 0.0))
