"""Massless links: bodies of mass 0 between the slides of a gantry and between the hinges of a hip."""

import numpy as np
import pytest

from mbref import simulate
from mbref.motions.trajectory import Outcome
from mbref.scene import Body, JointTorque, Revolute, Scene, SceneError, SlideSpring, Translational, Universal

TIMES = np.linspace(0.0, 0.5, 6)
LOAD = Body(name="load", mass=2.0, inertia=(0.1, 0.2, 0.3), position=(0.3, 0.1, -1.0))
LINK = Body(name="link", mass=0.0, inertia=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0))
CENTRE, X, Y, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
METHODS = ("taylor", "lm1+projection", "alf+projection")
RTOL = 1e-11
ACCURACY = 10 * RTOL  # m, of one run in closed form; two runs with more turns differ by ten times as much


def hip(*more: Body | Revolute) -> Scene:
    """Return a body on two crossing hinges."""
    hinges = (
        Revolute(name="a", bodies=("ground", "link"), anchor=CENTRE, axis=X),
        Revolute(name="b", bodies=("link", "load"), anchor=CENTRE, axis=Y),
    )
    bodies = (LINK, LOAD, *(part for part in more if isinstance(part, Body)))
    joints = (*hinges, *(part for part in more if isinstance(part, Revolute)))
    return Scene(name="hip", gravity=(0.0, 0.0, -9.81), body=bodies, joint=joints)


@pytest.mark.parametrize("method", METHODS)
def test_load_on_the_massless_link_of_a_gantry_swings_along_x_and_falls_along_z(method):
    """The link slides along x, and on it the load of 2 kg along z. x swings about the spring's rest at -0.2 m
    with ω = √(50 N/m / 2 kg) = 5 rad/s; z falls by g t² / 2; to ten rtol. METHODS solve for it."""
    slides = (
        Translational(name="x", bodies=("ground", "link"), anchor=CENTRE, axis=X),
        Translational(name="z", bodies=("link", "load"), anchor=CENTRE, axis=Z),
    )
    spring = SlideSpring(joint="x", stiffness=50.0, natural_displacement=-0.2)
    scene = Scene(name="g", gravity=(0.0, 0.0, -9.81), body=(LINK, LOAD), joint=slides, load=(spring,))
    motion = simulate(scene, method, times=TIMES, rtol=RTOL)
    assert np.allclose(motion["load"].position[:, 0], 0.1 + 0.2 * np.cos(5.0 * TIMES), rtol=0, atol=ACCURACY)
    assert np.allclose(motion["load"].position[:, 2], -1.0 - 9.81 / 2 * TIMES**2, rtol=0, atol=ACCURACY)
    assert np.allclose(motion["link"].position[:, 0], -0.2 + 0.2 * np.cos(5.0 * TIMES), rtol=0, atol=ACCURACY)


@pytest.mark.parametrize("method", METHODS)
def test_two_hinges_at_a_massless_link_move_as_a_universal_joint(method):
    """Hinges whose axes cross allow what a universal joint allows. METHODS agree with it to 100 rtol (m)."""
    joint = Universal(name="u", bodies=("ground", "load"), anchor=CENTRE, axes=(X, Y))
    scene = Scene(name="u", gravity=(0.0, 0.0, -9.81), body=(LOAD,), joint=(joint,))
    other = simulate(scene, times=TIMES, rtol=RTOL)
    motion = simulate(hip(), method, times=TIMES, rtol=RTOL)
    assert motion.outcome == other.outcome == Outcome.COMPLETED
    assert np.allclose(motion["load"].position, other["load"].position, rtol=0, atol=10 * ACCURACY)


def test_free_link_of_mass_zero_is_named_as_undetermined():
    """The link hangs by a hinge at the load, and nothing else acts on it."""
    tip = LINK.model_copy(update={"name": "tip", "position": (0.3, 0.1, -1.2)})
    hinge = Revolute(name="c", bodies=("load", "tip"), anchor=(0.3, 0.1, -1.1), axis=Y)
    for method in ("taylor", "lm1+projection"):
        motion = simulate(hip(tip, hinge), method, times=TIMES)
        assert "nothing determines the motion of body 'tip', which has mass 0" in motion.message


def test_armature_determines_the_motion_of_a_free_link_of_mass_zero():
    """The rotor, of a = 0.1 kg m², alone takes the torque M = 0.5 N m of its hinge, as the tip has no mass.
    The hinge turns by M t² / (2 a), however the load swings."""
    tip = LINK.model_copy(update={"name": "tip", "position": (0.3, 0.1, -1.2)})
    hinge = Revolute(name="c", bodies=("load", "tip"), anchor=(0.3, 0.1, -1.1), axis=Y, armature=0.1)
    scene = hip(tip, hinge).with_(load=(JointTorque(joint="c", torque=0.5),))
    motion = simulate(scene, times=TIMES, rtol=RTOL)
    assert np.allclose(motion.joint("c").angle, 0.5 * TIMES**2 / (2 * 0.1), rtol=0, atol=ACCURACY)  # rad


def test_mass_of_zero_with_an_inertia_is_refused():
    """A body without mass cannot have a moment of inertia, here 1 kg m² about z."""
    heavy = LINK.model_copy(update={"inertia": (0.0, 0.0, 1.0)})
    with pytest.raises(SceneError, match=r"body\[link\].mass: is 0, but the inertia is not"):
        Scene(name="s", body=(heavy,), joint=())


def test_body_whose_centre_is_off_its_anchor_by_rounding_slides_at_its_speed():
    """The body slides at 1 m/s. Errors of a step are relative to the mechanism's length, which must not be
    the 1e-16 m between centre and anchor, where no step would succeed."""
    slide = Translational(name="x", bodies=("ground", "load"), anchor=(0.45, -0.05, -0.275), axis=X)
    load = LOAD.model_copy(update={"position": (0.45000000000000007, -0.05, -0.275), "velocity": X})
    motion = simulate(Scene(name="s", body=(load,), joint=(slide,)), times=TIMES)
    assert motion.outcome == Outcome.COMPLETED
    assert np.allclose(motion["load"].position[:, 0], 0.45 + TIMES, rtol=0, atol=1e-12)  # m
