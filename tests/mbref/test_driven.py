"""Motions that drivers prescribe, by Taylor series: against closed forms, over many singular positions and
beside some."""

import math

import numpy as np
import pytest

from mbref.scene import Cylindrical, Driver, Revolute, Scene, Spherical, Universal
from mbref.scenes import SCENES
from mbref.scenes.links import CRANK_RATE, about_z, link, midpoint
from mbref.scenes.planar_slider_crank import slider_crank
from mbref.simulation.simulate import Limits, simulate
from tests.crosscheck.measured import relative_error

LINKAGES = ("four_bar", "five_bar")
ROUNDING = 1e-12  # of positions over the scene's length, after up to 40 singular positions
Z = (0.0, 0.0, 1.0)


def flat_times(end):
    """Return the times (s) at which a parallelogram driven from π/2 is flat: every half turn of its crank."""
    return [(k + 0.5) * math.pi / CRANK_RATE for k in range(int(end * CRANK_RATE / math.pi + 0.5))]


@pytest.mark.parametrize(
    "limits", [{"code": "generic"}, {"code": "generated"}, {"rtol": 1e-4}, {"rtol": 1e-10}], ids=str
)
@pytest.mark.parametrize("name", LINKAGES)
def test_every_flat_position_of_a_driven_parallelogram_is_recorded_at_its_time(name, limits):
    """Poses meet the parallelogram's closed form. The crank passes 40 half turns in 1 s; at each recorded
    time it is within 1e-9 rad of one."""
    scene = SCENES[name]()
    run = simulate(scene, "taylor", np.linspace(0.0, 1.0, 9), Limits(**limits))
    assert relative_error(run, scene) < ROUNDING
    times = [crossing.time for crossing in run.crossings]
    assert len(times) == len(flat_times(1.0)) == 40
    turn = CRANK_RATE * (np.array(times) - flat_times(1.0))  # rad, of the crank
    assert np.abs(turn).max() < 1e-9


@pytest.mark.parametrize("code", ["generic", "generated"])
def test_accelerations_of_a_driven_crank_and_rod_of_equal_length_are_the_closed_form(code):
    """With a crank rate ω every centre swings by cos ωt and sin ωt about a fixed point r₀: acceleration
    -ω² (r - r₀). Masses off the axes and parallel hinges make a redundant row look independent, so that all
    poses seem to be near a singular one."""
    base, rate, shift = slider_crank(0.308, 0.308, 0.3, "off_axes"), -5.8, (0.09, -0.12, 0.3)
    a, b, c, d = base.joint
    joints = (
        a,
        b,
        Revolute(name="C", bodies=c.bodies, anchor=c.anchor, axis=Z),
        Cylindrical(name="D", bodies=d.bodies, anchor=d.anchor, axis=d.axis),
    )
    bodies = [
        body.model_copy(update={"position": tuple(np.add(body.position, shift).tolist())})
        for body in base.body
    ]
    scene = base.with_(body=tuple(bodies), joint=joints, driver=(Driver(joint="A", polynomial=(0.0, rate)),))
    run = simulate(scene, "taylor", np.linspace(0.0, 2.5, 41), Limits(rtol=1e-12, code=code))
    assert run.outcome.name == "COMPLETED", run.message
    swinging = run.position - [(0.0, 0.0, 0.3), (0.0, 0.0, 0.3), shift]
    largest = np.abs(run.acceleration).max()  # m/s²
    assert np.abs(run.acceleration + rate**2 * swinging).max() < 1e-9 * largest  # 1000 times rtol


def test_prescribed_motion_does_not_depend_on_the_tolerance():
    """Runs with rtol 1e-3 and 1e-11 agree to the bit, and have the judge's closed form."""
    scene, times = SCENES["spatial_slider_crank_driven"](), np.linspace(0.0, 0.2, 5)
    rough, fine = (simulate(scene, "taylor", times, Limits(rtol=rtol)) for rtol in (1e-3, 1e-11))
    assert np.array_equal(rough.position, fine.position) and rough.cost.steps == fine.cost.steps
    assert relative_error(rough, scene) < ROUNDING


def elbow(crank, sign):
    """Return where coupler and rocker, both 0.5 m, meet: from the crank's end (k, 2) and a ground link of
    0.5 m, on one side."""
    apart = np.array([0.5, 0.0]) - crank
    half = np.linalg.norm(apart, axis=-1, keepdims=True) / 2.0
    across = np.stack([-apart[..., 1], apart[..., 0]], axis=-1) / (2.0 * half)
    return crank + apart / 2.0 + sign * np.sqrt(0.25 - half**2) * across


def crank_rocker(gap):
    """Return a rhombus whose crank is shorter by a gap (m): it turns, and its branches do not meet."""
    length, theta = 0.5 - gap, math.pi / 2
    crank = np.array([length * math.cos(theta), length * math.sin(theta)])
    b, c = (*crank, 0.0), (*elbow(crank, 1.0), 0.0)
    d, a = (0.5, 0.0, 0.0), (0.0, 0.0, 0.0)
    turned = [math.atan2(*(np.subtract(end, begin)[[1, 0]])) for begin, end in ((a, b), (b, c), (d, c))]
    across = (-math.sin(turned[1]), math.cos(turned[1]), 0.0)
    return Scene(
        name="crank_rocker",
        body=(
            link("crank", a, b, about_z(turned[0]), length),
            link("coupler", b, c, about_z(turned[1]), 0.5),
            link("rocker", d, c, about_z(turned[2]), 0.5),
        ),
        joint=(
            Revolute(name="A", bodies=("ground", "crank"), anchor=a, axis=Z),
            Universal(name="B", bodies=("crank", "coupler"), anchor=b, axes=(Z, across)),
            Spherical(name="C", bodies=("coupler", "rocker"), anchor=c),
            Revolute(name="D", bodies=("ground", "rocker"), anchor=d, axis=Z),
        ),
        driver=(Driver(joint="A", polynomial=(0.0, -CRANK_RATE)),),
    )


@pytest.mark.parametrize("gap", [0.1, 1e-2, 1e-3, 1e-5, 1e-7])
def test_driven_crank_rocker_stays_on_its_branch_and_crosses_nothing(gap):
    """The hinge of coupler and rocker stays on one side of the line between the ends of crank and frame
    (closed form, ``elbow``). Branches are apart by about √gap near the flat pose, so that rounding is
    magnified by 1/√gap."""
    scene, times = crank_rocker(gap), np.linspace(0.0, 0.1, 23)
    run = simulate(scene, "taylor", times)
    assert run.outcome.name == "COMPLETED", run.message
    angle = math.pi / 2 - CRANK_RATE * times
    crank = (0.5 - gap) * np.column_stack([np.cos(angle), np.sin(angle)])
    end = elbow(crank, 1.0)
    rocker = [midpoint((0.5, 0.0, 0.0), (*place, 0.0))[:2] for place in end]
    off = np.linalg.norm(run.position[:, 2, :2] - rocker, axis=-1).max()
    assert off < ROUNDING / math.sqrt(gap), off
    assert not run.crossings
