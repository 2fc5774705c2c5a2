"""Motion and reactions of mechanisms in which some coordinates of bodies are constant."""

import numpy as np
import pytest

from mbref.scene import Body, Driver, Fixed, Revolute, Scene, Spring, Translational
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate

METHOD = "alf-dual+projection"
ORIGIN, X, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
GRAVITY = {"gravity": (0.0, -9.81, -3.0), "duration": 0.5}


def block(name, x):
    return Body(name=name, mass=1.0, inertia=(0.01, 0.02, 0.03), position=(x, 0.0, 0.0))


def guide(name, bodies, x):
    return Translational(name=name, bodies=bodies, anchor=(x, 0.0, 0.0), axis=X)


def oblique(body):
    """A spring from above and beside that also turns the body."""
    points = ((0.3, 0.5, 0.2), (0.02, 0.01, 0.03))
    return Spring(bodies=("ground", body), points=points, stiffness=20.0, natural_length=0.3)


RAIL = Scene(
    name="rail",
    body=(block("slide", 0.0),),
    joint=(guide("guide", ("ground", "slide"), 0.0),),
    load=(oblique("slide"),),
    **GRAVITY,
)
TWO_GUIDES = RAIL.with_(name="two_guides", joint=(*RAIL.joint, guide("other", ("ground", "slide"), 0.4)))
SLEEVE = Scene(
    name="sleeve",
    body=(block("arm", 0.1), block("sleeve", 0.3)),
    joint=(
        Revolute(name="pin", bodies=("ground", "arm"), anchor=ORIGIN, axis=Z),
        guide("guide", ("arm", "sleeve"), 0.3),
    ),
    load=(oblique("sleeve"),),
    **GRAVITY,
)
WELD = Scene(
    name="weld",
    body=(block("a", 0.0), block("b", 1.0)),
    joint=(
        Fixed(name="root", bodies=("ground", "a"), anchor=ORIGIN),
        Fixed(name="tip", bodies=("a", "b"), anchor=(0.5, 0.0, 0.0)),
    ),
    load=(oblique("b"),),
    **GRAVITY,
)


MECHANISMS = (SCENES["spatial_slider_crank_gravity"](), RAIL, SLEEVE, WELD, TWO_GUIDES)


@pytest.mark.parametrize("scene", MECHANISMS, ids=lambda scene: scene.name)
def test_motion_and_reactions_by_alf_dual_equal_those_by_the_dense_pseudo_inverse(scene):
    """MPI-SVD decides on the rank by singular values and leaves out no coordinate; redundant rows share
    forces by the least norm in both. Positions agree to 1000 rtol (m), reactions to 1e-5 of the largest."""
    times = np.linspace(0.0, 0.1, 5)
    one = simulate(scene, METHOD, times, Limits(rtol=1e-11))
    other = simulate(scene, "mpi-svd+none", times, Limits(rtol=1e-11))
    assert one.outcome.name == other.outcome.name == "COMPLETED", one.message
    np.testing.assert_allclose(one.position, other.position, atol=1e-8)
    for joint, reaction in one.reactions.items():
        size = np.abs(other.reactions[joint]).max()
        np.testing.assert_allclose(reaction, other.reactions[joint], atol=1e-5 * size, err_msg=joint)


def test_driver_of_a_welded_joint_ends_the_run_before_it_turns_anything():
    """The driver's angle 5 t² and rate are zero at the start, which is therefore consistent; after 1 ms the
    angle would be 5e-6 rad."""
    scene = Scene(
        name="against",
        body=(block("a", 0.0), block("b", 1.0)),
        joint=(
            Revolute(name="p", bodies=("ground", "a"), anchor=ORIGIN, axis=Z),
            Fixed(name="w", bodies=("ground", "a"), anchor=ORIGIN),
            Revolute(name="r", bodies=("a", "b"), anchor=(0.5, 0.0, 0.0), axis=Z),
        ),
        driver=(Driver(joint="p", polynomial=(0.0, 0.0, 5.0)),),
        **GRAVITY,
    )
    run = simulate(scene, METHOD, [0.0, 0.2])
    assert run.outcome.label == "NOT_CONVERGED" and run.t_end < 1e-3, run.message


@pytest.mark.parametrize("method", (METHOD, "lm2+projection/adams", "taylor"))
def test_welded_body_stays_and_its_weld_carries_the_weight(method):
    """A body of 2 kg: 2 · 9.81 N along y."""
    body = Body(name="b", position=(1, 0, 0), mass=2, inertia=(1, 2, 3))
    weld = Fixed(name="W", bodies=("ground", "b"), anchor=(0, 0, 0))
    scene = Scene(name="welded", gravity=(0, -9.81, 0), joint=(weld,), body=(body,))
    rest = simulate(scene, method, (0.0, 1.0))
    assert rest.outcome.name == "COMPLETED", rest.message
    assert np.abs(rest.position[-1] - [[1, 0, 0]]).max() < 1e-12  # m
    assert np.abs(rest.reactions["W"][-1, 1]) == pytest.approx(2 * 9.81, rel=1e-12)
