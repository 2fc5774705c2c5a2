"""Closed forms of the judge against formulas, and scenes that have no closed form."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.constraints import closure
from crosscheck.judge.truth import closed_form
from crosscheck.judge.truth.one_dof import one_dof
from crosscheck.judge.truth.parallelogram import parallelogram
from crosscheck.judge.truth.spatial_slider_crank import spatial_slider_crank
from mbref import rotations
from mbref.scene import Body, Cylindrical, Driver, JointForce, JointTorque, Moment, Revolute, Scene
from tests.helpers.parts import X, Z, joint

O = (0.0, 0.0, 0.0)


def body(name: str, *place: float, **parts: Any) -> Body:
    given = {"mass": 2.0, "inertia": (0.3, 0.4, 0.5), "position": place or X}
    return Body(name=name, **{**given, **parts})


def pin(name: str, first: str, second: str, *anchor: float, axis: tuple[float, ...] = Z) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=anchor, axis=axis)


def scene(bodies: Any, joints: Any, **parts: Any) -> Scene:
    return Scene(name="s", body=tuple(bodies), joint=tuple(joints), **{"gravity": O, **parts})


PENDULUM = scene([body("bar", 0.0, -2.0, 0.5)], [pin("A", "ground", "bar", 0.0, 0.0, 0.5)])
# cranks of 1 m at (0, 0, 0) and (3, 0, 0) that point upwards, and a coupler between their ends
BOX = scene(
    [body("left", 0.0, 0.5, 0.0), body("top", 1.5, 1.2, 0.0), body("right", 3.0, 0.5, 0.0)],
    [
        pin("A", "ground", "left", 0.0, 0.0, 0.0),
        pin("B", "left", "top", 0.0, 1.0, 0.0),
        pin("C", "top", "right", 3.0, 1.0, 0.0),
        pin("D", "right", "ground", 3.0, 0.0, 0.0, axis=(0.0, 0.0, -2.0)),
    ],
)


@pytest.mark.parametrize(
    "parts",
    [
        {"load": (Moment(body="bar", moment=Z, factor={"start": 0.5}),)},
        {"load": (JointTorque(joint="A", torque=1.0),)},
        {"load": (Moment(body="bar", moment=Z), JointForce(joint="B", force=1.0))},
        {"driver": (Driver(joint="A", table=((0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 1.0))),)},
        {"joint": (PENDULUM.joint[0].model_copy(update={"armature": 0.5}),)},
        {"coupling": ({"name": "G", "joints": ("B", "B"), "ratio": 1.0},)},
    ],
    ids=["switched moment", "joint torque", "joint force", "table", "armature", "coupling"],
)
def test_a_pendulum_with_a_part_outside_its_closed_form_has_none(parts):
    """A sleeve, the cylindrical joint B on the hinge's axis, constrains nothing: a pendulum with it has its
    closed form. A joint force and a coupling act on the sleeve."""
    sleeve = Cylindrical(name="B", bodies=("ground", "bar"), anchor=(0.0, 0.0, 0.5), axis=Z)
    given = PENDULUM.with_(joint=(*PENDULUM.joint, sleeve))
    assert closed_form(given).name == "pendulum"
    changes = {**parts, "joint": (*parts.get("joint", PENDULUM.joint), sleeve)}
    assert closed_form(given.with_(**changes)) is None


def test_a_parallelogram_without_masses_has_a_closed_form_only_if_it_is_driven():
    """A driver prescribes the motion of a parallelogram. Without driver it depends on masses."""
    driver = Driver(joint="A", polynomial=(0.0, 1.0))
    plain = tuple(Body(name=b.name, position=b.position) for b in BOX.body)
    assert closed_form(BOX.with_(body=plain)) is None
    assert closed_form(BOX.with_(body=plain, driver=(driver,))).name == "parallelogram"


def spatial(line: tuple[float, ...], order: str = "crs", reverse: bool = False, way: float = 1.0) -> Scene:
    """A crank of 0.4 m along x about y, and a rod of 1.2, 0.3 and 0.5 m that ends on ``line``, with bodies in
    ``order``. ``reverse`` exchanges the bodies of the universal joint, ``way`` turns its second axis."""
    parts = {
        "c": body("crank", 0.1, 0.05, 0.0, orientation=(0.8, 0.6, 0.0, 0.0)),
        "r": body("rod", 0.9, 0.2, 0.3, orientation=(0.8, 0.0, 0.6, 0.0)),
        "s": body("block", 1.5, 0.3, 0.7, orientation=(0.6, 0.0, 0.0, 0.8)),
    }
    bodies = ("rod", "crank") if reverse else ("crank", "rod")
    axes = ((0.0, 1.2, 1.6), (0.3, -0.8 * way, 0.6 * way))
    joints = (
        pin("A", "ground", "crank", 0.0, 0.0, 0.0, axis=(0.0, 3.0, 0.0)),
        joint("B", "universal", *bodies, (0.4, 0.0, 0.0), axes=axes[::-1] if reverse else axes),
        joint("C", "spherical", "rod", "block", (1.6, 0.3, 0.5)),
        joint("D", "translational", "ground", "block", (1.6, 0.3, 0.5), axis=line),
    )
    return scene([parts[name] for name in order], joints)


CRANK_ANGLES = np.array([-0.7, 0.0, 0.4])  # rad
CLOSED = 1e-13  # m or rad; hundred times the measured rounding
of_cranks = pytest.mark.parametrize(
    ("line", "order", "reverse", "way"),
    [
        pytest.param((2.0, 0.0, 0.0), "crs", False, 1.0, id="along x"),
        pytest.param((-2.0, 0.0, 0.0), "src", True, 1.0, id="against x"),
        pytest.param((0.0, 0.0, 1.0), "rcs", False, -1.0, id="along z"),
        pytest.param((0.6, 0.0, 0.8), "scr", True, -1.0, id="oblique"),
    ],
)


@of_cranks
def test_path_of_a_spatial_slider_crank_closes_its_joints(line, order, reverse, way):
    """At three angles of the crank the residuals of the judge's joint equations are below 1e-13 m or rad,
    hundred times the measured rounding."""
    given = spatial(line, order, reverse, way)
    pose = spatial_slider_crank(given).poses(CRANK_ANGLES.astype(np.longdouble))
    turns = rotations.from_matrix(pose.rotation.astype(float))
    residuals = closure(given, np.zeros(3), pose.position.astype(float), turns)
    assert max(np.abs(rows).max() for rows in residuals.values()) < CLOSED


@of_cranks
def test_path_of_a_spatial_slider_crank_begins_at_the_pose_of_the_scene(line, order, reverse, way):
    """At the crank's angle 0, positions (m) and rotation matrices are the scene's, to 1e-13."""
    given = spatial(line, order, reverse, way)
    pose = spatial_slider_crank(given).poses(np.zeros(1, np.longdouble))
    assert np.abs(pose.position[0] - [b.position for b in given.body]).max() < CLOSED
    start = rotations.to_matrix(np.array([b.orientation for b in given.body]))
    assert np.abs(pose.rotation[0] - start).max() < CLOSED


@of_cranks
def test_only_a_driver_of_the_crank_prescribes_the_path_of_a_spatial_slider_crank(line, order, reverse, way):
    """`driven_sign` is the sign with which a driver changes the path's angle. The angle is that of the
    crank's hinge A: sign 1. A driver of the slide D does not prescribe it: None."""
    path = spatial_slider_crank(spatial(line, order, reverse, way))
    assert [path.driven_sign(Driver(joint=name, polynomial=(0.0, 1.0))) for name in "AD"] == [1.0, None]


@pytest.mark.parametrize("q", CRANK_ANGLES)
@of_cranks
def test_derivatives_of_a_spatial_slider_cranks_path_equal_finite_differences(line, order, reverse, way, q):
    """Differences of fourth order over h = 1e-4 rad in long doubles are exact to about h⁴ = 1e-16 times the
    fifth derivative; 1e-8 also allows for the steepest path: 8e-10 is measured."""
    path, h = spatial_slider_crank(spatial(line, order, reverse, way)), 1e-4
    pose = path.poses((q + h * np.arange(-2, 3)).astype(np.longdouble))
    weights = np.array([1, -8, 0, 8, -1]) / (12 * h)
    slopes = [np.tensordot(weights, getattr(pose, name), 1) for name in ("position", "rotation", "spin")]
    assert slopes[0].astype(float) == pytest.approx(pose.dposition[2].astype(float), rel=1e-8, abs=1e-8)
    rate = slopes[1] @ np.swapaxes(pose.rotation[2], 1, 2)
    spin = np.stack([rate[:, 2, 1], rate[:, 0, 2], rate[:, 1, 0]], axis=1)
    assert spin.astype(float) == pytest.approx(pose.spin[2].astype(float), rel=1e-8, abs=1e-8)
    assert slopes[2].astype(float) == pytest.approx(pose.dspin[2].astype(float), rel=1e-8, abs=1e-8)
    second = np.tensordot(weights, pose.dposition, 1)
    assert second.astype(float) == pytest.approx(pose.ddposition[2].astype(float), rel=1e-8, abs=1e-8)


def test_a_weightless_pendulum_turns_at_constant_speed():
    """No gravity acts on it. The bar's centre is 2 m below the hinge and turns at -3 rad/s: 6 m/s, and 18
    m/s² towards the hinge, also after a quarter turn at π/6 s. Limits are some thousand roundings."""
    moving = PENDULUM.with_(body=(body("bar", 0.0, -2.0, 0.5, angular_velocity=(0.0, 0.0, -3.0)),))
    truth = one_dof(moving, parallelogram(moving))
    found = truth.poses(np.array([0.0, math.pi / 6]))
    assert found.position[:, 0] == pytest.approx(np.array([[0, -2, 0.5], [-2, 0, 0.5]]), abs=1e-12)
    assert found.velocity[:, 0] == pytest.approx(np.array([[-6, 0, 0], [0, 6, 0.0]]), abs=1e-11)
    assert found.acceleration[:, 0] == pytest.approx(np.array([[0, 18, 0], [18, 0, 0.0]]), abs=1e-11)
    assert found.angular_velocity[:, 0] == pytest.approx(np.tile([0.0, 0.0, -3.0], (2, 1)), abs=1e-12)
    assert found.angular_acceleration[:, 0] == pytest.approx(np.zeros((2, 3)), abs=1e-11)


@pytest.mark.parametrize("rate", [-3.0, 3.0])
def test_angle_of_a_weightless_pendulum_counts_full_turns(rate):
    """Without gravity the rate (rad/s) is constant and the angle rate · t, asked for at times in no order."""
    moving = PENDULUM.with_(body=(body("bar", 0.0, -2.0, 0.5, angular_velocity=(0.0, 0.0, rate)),))
    times = np.array([100.0, 0.0, 0.25, 40.0])
    found = one_dof(moving, parallelogram(moving)).coordinate(times)
    assert found == pytest.approx(np.stack([rate * times, np.full(4, rate)], axis=1))
