"""Mechanisms in which some coordinates of bodies are constant, or rows depend on others."""

import numpy as np
import pytest

from crosscheck.judge.truth import truth_for
from mbref import Limits, simulate
from mbref.scene import Body, Driver, Fixed, Scene, Translational
from mbref.scenes import SCENES
from tests.helpers.parts import X, hinge, joint, spring

METHOD = "alf-dual+projection"
ORIGIN = (0.0, 0.0, 0.0)
GRAVITY = {"gravity": (0.0, -9.81, -3.0), "duration": 0.5}


def block(name, x):
    return Body(name=name, mass=1.0, inertia=(0.01, 0.02, 0.03), position=(x, 0.0, 0.0))


def guide(name, bodies, x):
    return Translational(name=name, bodies=bodies, anchor=(x, 0.0, 0.0), axis=X)


def pushed(name, bodies, joints, body):
    """A scene with a spring from above and beside that also turns one of its bodies."""
    oblique = spring("ground", (0.3, 0.5, 0.2), body, (0.02, 0.01, 0.03), 20.0, 0.3)
    return Scene(name=name, body=bodies, joint=joints, load=(oblique,), **GRAVITY)


RAIL = pushed("rail", [block("slide", 0.0)], [guide("guide", ("ground", "slide"), 0.0)], "slide")
TWO_GUIDES = RAIL.with_(name="two_guides", joint=(*RAIL.joint, guide("other", ("ground", "slide"), 0.4)))
PINNED = [hinge("pin", "ground", "arm", ORIGIN), guide("guide", ("arm", "sleeve"), 0.3)]
SLEEVE = pushed("sleeve", [block("arm", 0.1), block("sleeve", 0.3)], PINNED, "sleeve")
WELDS = [joint("root", "fixed", "ground", "a"), joint("tip", "fixed", "a", "b", (0.5, 0.0, 0.0))]
WELD = pushed("weld", [block("a", 0.0), block("b", 1.0)], WELDS, "b")
MECHANISMS = (SCENES["spatial_slider_crank_gravity"](), RAIL, SLEEVE, WELD, TWO_GUIDES)


@pytest.mark.parametrize("scene", MECHANISMS, ids=lambda scene: scene.name)
def test_alf_dual_moves_as_the_reference_and_shares_redundant_forces_by_the_least_norm(scene):
    """MECHANISMS have coordinates that stay constant. Positions are the judge's, to 100 rtol (m). Reactions
    are those of the dense pseudo-inverse (MPI-SVD), which leaves out no coordinate and has the least norm for
    redundant rows, to 1e-5 of the largest."""
    times, rtol = np.linspace(0.0, 0.1, 5), 1e-11
    one, other = (simulate(scene, m, times, Limits(rtol=rtol)) for m in (METHOD, "mpi-svd+none"))
    assert one.outcome.name == other.outcome.name == "COMPLETED", one.message
    np.testing.assert_allclose(one.position, truth_for(scene).poses(times).position, rtol=0, atol=100 * rtol)
    for name, reaction in one.reactions.items():
        size = np.abs(other.reactions[name]).max()
        np.testing.assert_allclose(reaction, other.reactions[name], rtol=0, atol=1e-5 * size, err_msg=name)


def test_driver_of_a_welded_joint_ends_the_run_before_it_turns_anything():
    """The driver's angle 5 t² and rate are zero at the start, which is therefore consistent. The run ends
    before 1e-3 s, when the angle would be 5e-6 rad."""
    joints = [hinge("p", "ground", "a", ORIGIN), WELDS[0], hinge("r", "a", "b", (0.5, 0.0, 0.0))]
    driver = Driver(joint="p", polynomial=(0.0, 0.0, 5.0))
    scene = Scene(name="against", body=WELD.body, joint=joints, driver=(driver,), **GRAVITY)
    run = simulate(scene, METHOD, [0.0, 0.2])
    assert run.outcome.label == "NOT_CONVERGED" and run.t_end < 1e-3, run.message


@pytest.mark.parametrize("method", (METHOD, "lm2+projection/adams", "taylor"))
def test_welded_body_stays_and_its_weld_carries_the_weight(method):
    """A body of 2 kg weighs 2 · 9.81 N along y; three methods find this reaction."""
    body = Body(name="b", position=(1, 0, 0), mass=2, inertia=(1, 2, 3))
    weld = Fixed(name="W", bodies=("ground", "b"), anchor=(0, 0, 0))
    scene = Scene(name="welded", gravity=(0, -9.81, 0), joint=(weld,), body=(body,))
    rest = simulate(scene, method, (0.0, 1.0))
    assert rest.outcome.name == "COMPLETED", rest.message
    assert np.abs(rest.position[-1] - [[1, 0, 0]]).max() < 1e-12  # m
    assert np.abs(rest.reactions["W"][-1, 1]) == pytest.approx(2 * 9.81, rel=1e-12)  # rounding


END = 0.7  # s; later Bennett's linkage is flat
RTOL = 1e-6
MOST_STEPS = 20  # rejected ones included; 7 are taken if rounding in redundant rows shortens none


@pytest.mark.parametrize(
    "method", ("alf-dual+projection", "mpi-svd+projection", "mpi-qr+projection", "mpi-gs+projection")
)
@pytest.mark.parametrize("name", ["bennett", "bricard"])
def test_linkage_with_redundant_rows_moves_as_the_judge_s_reference_in_under_20_steps(name, method):
    """Bennett's linkage has three redundant rows, Bricard's one. Positions (m) are the reference's to ten
    rtol, accelerations to 100 rtol of the largest. Rounding in redundant rows must not shorten steps."""
    scene, times = SCENES[name](), np.linspace(0.0, END, 6)
    run, true = simulate(scene, method, times, Limits(rtol=RTOL)), truth_for(scene).poses(times)
    assert run.outcome.label == "COMPLETED", run.message
    assert run.cost.steps + run.cost.rejected < MOST_STEPS
    assert np.abs(run.position - true.position).max() < 10 * RTOL
    largest = np.abs(true.acceleration).max()  # m/s²
    assert np.abs(run.acceleration - true.acceleration).max() < 100 * RTOL * largest
