"""Closed forms of scenes against formulas and other descriptions of a scene; scenes that have none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crosscheck.judge.truth import closed_form, truth_for
from mbref import rotations
from mbref.scene import Body, Driver, Revolute, Scene, Spherical, Universal
from mbref.scenes import SCENES
from mbref.scenes.planar_slider_crank import planar_slider_crank, slider_crank
from tests.helpers.parts import Z
from tests.helpers.truth_scenes import ALL, CLOSED, door, free, pendulum

ROUNDED = 1e-13  # m or rad; roundings of 1, and their growth along the motion
FAMILY = {  # beginning of a scene's name: the judge's closed form
    "planar_slider_crank": "planar_slider_crank",
    "spatial_slider_crank": "spatial_slider_crank",
    "four_bar": "parallelogram",
    "five_bar": "parallelogram",
    "slider_crank_chain": "crankshaft",
    "point_pendulum": "pendulum",
}


@pytest.mark.parametrize("name", CLOSED)
def test_built_in_scene_has_the_closed_form_of_its_family(name):
    """The judge's truth is not the reference, but the closed form of the linkage that the scene's name begins
    with (FAMILY): scenes of four-bars and five-bars are parallelograms."""
    family = next(FAMILY[prefix] for prefix in FAMILY if name.startswith(prefix))
    assert truth_for(SCENES[name]()).name == family


@given(a=st.floats(0.1, 1.0), ratio=st.floats(1.05, 4.0))
def test_slider_crank_of_any_lengths_has_its_closed_form(a, ratio):
    """x = a cos θ + √(b² - a² sin² θ), to 1e-12 of b, with a cos θ, a sin θ of the crank's position."""
    scene = planar_slider_crank(a, a * ratio)
    motion = truth_for(scene).poses(np.linspace(0, 0.05, 9))
    crank = 2 * motion.position[:, 0]
    x = crank[:, 0] + np.sqrt((a * ratio) ** 2 - crank[:, 1] ** 2)
    assert np.abs(motion.position[:, 2, 0] - x).max() < 10 * ROUNDED * a * ratio


def with_joints(scene, change, **changes):
    return scene.with_(joint=tuple(map(change, scene.joint)), **changes)


def apart(scene, other):
    """Return the largest difference of positions (m) or angles (rad) of the truths of two scenes."""
    times = np.linspace(0, scene.duration / 2, 9)
    wanted, got = truth_for(scene).poses(times), truth_for(other).poses(times)
    off = np.abs(got.position - wanted.position).max()
    angle = rotations.angle_between(got.orientation, wanted.orientation).max()
    return max(off, angle)


@pytest.mark.parametrize("kind", ["planar_slider_crank", "spatial_slider_crank", "four_bar"])
def test_truth_does_not_depend_on_the_sign_of_an_axis(kind):
    """Axes of hinges and slides of the undriven scene are reversed; poses are equal to 1e-13 m or rad."""

    def flipped(joint):
        axis = getattr(joint, "axis", None)
        return joint if axis is None else joint.model_copy(update={"axis": tuple(-x for x in axis)})

    scene = ALL[f"{kind}_gravity"]
    assert apart(scene, with_joints(scene, flipped)) < ROUNDED


@pytest.mark.parametrize(
    "name", ["four_bar", "spatial_slider_crank_driven", "pendulum_driven", "block_driven"]
)
def test_exchanged_bodies_of_joints_and_an_opposite_driver_give_an_equal_motion(name):
    """Angles count from the first body: the driver's sign is reversed. Poses agree to 1e-13 m or rad."""

    def swapped(joint):
        axes = {"axes": joint.axes[::-1]} if isinstance(joint, Universal) else {}
        return joint.model_copy(update={"bodies": joint.bodies[::-1], **axes})

    scene = ALL[name]
    (driver,) = scene.driver
    sine = driver.sine and driver.sine.model_copy(update={"amplitude": -driver.sine.amplitude})
    backwards = Driver(joint=driver.joint, polynomial=tuple(-c for c in driver.polynomial), sine=sine)
    assert apart(scene, with_joints(scene, swapped, driver=(backwards,))) < ROUNDED


@pytest.mark.parametrize(("joint", "rate"), [("A", -124.8), ("D", -124.8), ("E", 124.8), ("F", -124.8)])
def test_five_bar_driven_at_any_joint_moves_alike(joint, rate):
    """Cranks turn at -124.8 rad/s against the ground, and the bar turns the other way against a crank (E).
    The judge's truths, by different drivers of one parallelogram, are equal to 1e-13 m or rad."""
    scene = ALL["five_bar"]
    assert apart(scene, scene.with_(driver=(Driver(joint=joint, polynomial=(0.0, rate)),))) < ROUNDED


def test_rod_of_a_folded_slider_crank_turns_about_the_resting_slider():
    """Crank and rod of 0.3 m lie on each other; the slider rests at the crank's pivot, and the rod's centre
    moves on a circle of 0.15 m from 0.4 rad at 5 rad/s, all to 1e-13 m."""
    straight = planar_slider_crank(0.3, 0.3)
    crank, rod, slider = straight.body
    theta0 = 0.4
    pin = (0.3 * np.cos(theta0), 0.3 * np.sin(theta0), 0.0)
    middle = tuple(x / 2 for x in pin)
    half = theta0 / 2
    bodies = (
        crank.model_copy(update={"position": middle, "orientation": (np.cos(half), 0.0, 0.0, np.sin(half))}),
        rod.model_copy(update={"position": middle, "orientation": (-np.sin(half), 0.0, 0.0, np.cos(half))}),
        slider.model_copy(update={"position": (0.0, 0.0, 0.0)}),
    )
    anchors = {"A": (0.0, 0.0, 0.0), "B": pin, "C": (0.0, 0.0, 0.0), "D": (0.0, 0.0, 0.0)}
    joints = tuple(j.model_copy(update={"anchor": anchors[j.name]}) for j in straight.joint)
    driver = Driver(joint="A", polynomial=(0.0, 5.0))
    folded = straight.with_(body=bodies, joint=joints, driver=(driver,), load=())
    t = np.linspace(0, 1, 20)
    motion = truth_for(folded).poses(t)
    circle = 0.15 * np.stack([np.cos(theta0 + 5 * t), np.sin(theta0 + 5 * t), 0 * t], axis=1)
    off = np.abs(motion.position[:, 1] - circle).max(), np.abs(motion.position[:, 2]).max()
    assert max(off) < ROUNDED, f"rod and slider off by {off}"


PIVOT = Revolute(name="pivot", bodies=("ground", "bar"), anchor=(0, 0, 0), axis=Z)
STRANGERS = {
    "pivot of the rocker moved": SCENES["four_bar"]().with_("joint[D].anchor", (0.51, 0.0, 0.0)),
    "crank longer than the rod": planar_slider_crank(0.5, 0.4),
    "slider's line not in the crank's plane": SCENES["planar_slider_crank"]().with_(
        "joint[D].axis", (1.0, 0.0, 0.1)
    ),
    "two freedoms": pendulum().with_(
        body=(pendulum().body[0], pendulum().body[0].model_copy(update={"name": "other"})),
        joint=(pendulum().joint[0], Revolute(name="p", bodies=("ground", "other"), anchor=(0, 0, 0), axis=Z)),
    ),
    "spherical pendulum": pendulum(joint=(Spherical(name="b", bodies=("ground", "bar"), anchor=(0, 0, 0)),)),
    "no mass, no driver": Scene(name="s", body=(Body(name="bar", position=(1, 0, 0)),), joint=(PIVOT,)),
    "slender free rod": free(body=(free().body[0].model_copy(update={"inertia": (0.0, 0.3, 0.3)}),)),
    "two drivers": SCENES["four_bar"]().with_(
        driver=(*SCENES["four_bar"]().driver, Driver(joint="D", polynomial=(0.0, -124.8)))
    ),
}


@pytest.mark.parametrize("why", STRANGERS)
def test_scene_of_no_family_has_no_closed_form(why):
    """STRANGERS has scenes that differ from a family by the property in their name."""
    assert closed_form(STRANGERS[why]) is None


def test_slider_crank_with_a_gap_of_3e_13_folds_as_with_1e_9():
    """The rod is longer than the crank by 3e-13 m or 1e-9 m, and folds onto the crank at the dead position;
    the slider rests. Both differ by about √(0.6 m · 1e-9 m) = 2e-5 m; 1e-4 m is allowed. Without a gap the
    slider goes straight on through the crank's pivot, and is over 2 cm away."""
    times = np.array([0.0, 0.095])
    narrow, wide, straight = (
        closed_form(slider_crank(0.308, 0.308 + gap, 0.3, "gap", rate=30.0)).poses(times).position
        for gap in (3e-13, 1e-9, 0.0)
    )
    assert np.abs(narrow - wide).max() < 1e-4 and np.abs(narrow - straight).max() > 0.02


def test_door_on_tilted_hinges_stays_and_on_aligned_ones_swings():
    """Hinges tilted by 1e-3 rad lock the door; aligned ones leave a pendulum. At 1e-8 rad, where rounding
    could decide, there is no closed form."""
    times = np.array([0.0, 0.1, 0.3])
    rest = closed_form(door(1e-3))
    assert rest.name == "locked"
    assert np.array_equal(rest.poses(times).position, np.tile([0.5, 0.0, 0.5], (3, 1, 1)))
    assert not rest.poses(times).velocity.any()
    assert closed_form(door(0.0)).name == "pendulum"
    assert closed_form(door(1e-8)) is None
