"""Reactions of engines against the judge's; shares of redundant hinges against statics by hand."""

import numpy as np
import pytest

from crosscheck.engine import engine
from crosscheck.judge.constraints import initial_poses
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.joint_reactions import compare, shared_wrenches, side_by_side
from crosscheck.judge.reaction_balance import with_exact_reactions
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Revolute, Scene, Spherical
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN
from tests.helpers.parts import Z, block, hinge

TIMES = np.array([0.0, 0.01, 0.02, 0.03])
SCENES_COMPARED = ("spatial_slider_crank_gravity", "planar_slider_crank_gravity", "door")
MEASURED = {  # error / the largest reaction, at the finest settings: (unique parts, resultants)
    "mbref": dict.fromkeys(SCENES_COMPARED, (1.2e-11, 6e-12)),
    "mujoco": {
        "spatial_slider_crank_gravity": (1.2e-9, 7.6e-11),  # rounding over the softness of the closures
        "planar_slider_crank_gravity": (2e-8, 1.9e-11),
        "door": (1.2e-5, 1.8e-12),
    },
    "pinocchio": dict.fromkeys(SCENES_COMPARED, (1.2e-11, 6e-12)),
    "exudyn": dict.fromkeys(SCENES_COMPARED, (1.5e-8, 1.1e-8)),
}


def run(name: str, scene: Scene) -> Trajectory:
    simulator = engine(name)
    return simulator.run(scene, TIMES, simulator.best_settings(scene)[-1])


def door(kind: type) -> Scene:
    """A door hung in two joints of one kind on a vertical axis, 1 m apart."""
    axis = {"axis": Z} if kind is Revolute else {}
    leaf = Body(name="leaf", mass=10.0, inertia=(1.2, 0.9, 0.4), position=(0.4, 0.0, 1.0))
    heights, bodies = {"low": 0.5, "high": 1.5}, ("ground", "leaf")
    hinges = [kind(name=n, bodies=bodies, anchor=(0.0, 0.0, h), **axis) for n, h in heights.items()]
    return Scene(name="door", gravity=(0.0, 0.0, -9.81), duration=0.1, body=(leaf,), joint=tuple(hinges))


def test_two_ball_hinges_share_only_the_force_along_their_line():
    """Statics leaves one component of each ball open: equal and opposite forces along the line of both, z.
    The basis has length one and this direction, to rounding."""
    shared = shared_wrenches(door(Spherical), 0.0, *initial_poses(door(Spherical)))
    for name, basis in shared.items():
        assert basis.shape == (6, 1), f"{name}: {basis.shape[1]} shared wrenches, by hand 1"
        assert abs(basis[2, 0]) == pytest.approx(1.0, abs=1e-12)


def test_two_revolute_hinges_share_all_five_components():
    """Each hinge alone holds the door: all five components are open; no moment about the axis, to 1e-12."""
    shared = shared_wrenches(door(Revolute), 0.0, *initial_poses(door(Revolute)))
    assert {name: basis.shape[1] for name, basis in shared.items()} == {"low": 5, "high": 5}
    assert max(np.abs(basis[5]).max() for basis in shared.values()) < 1e-12


@pytest.mark.parametrize("name", SCENES_COMPARED)
def test_engines_have_the_exact_unique_reactions_and_resultants(name):
    """Exact reactions follow from the judge's accelerations by Newton's and Euler's equations. Parts that
    statics leaves open are not compared. Limits are ten times the measured errors of MEASURED, 1e-12 to 1e-5
    of the largest reaction."""
    scene = door(Spherical) if name == "door" else SCENES[name]()
    exact = with_exact_reactions(scene, gauss_motion(scene, tuple(TIMES.tolist())))
    for label, measured in MEASURED.items():
        found = compare(scene, exact, run(label, scene))
        worst = max(found.joints, key=lambda joint: found.joints[joint].unique)
        unique = found.joints[worst].unique
        parts, resultants = (MARGIN * error for error in measured[name])
        assert unique < parts, f"{label}: unique reaction of {worst} is off by {unique:.2e}"
        assert found.resultant < resultants, f"{label}: resultants are off by {found.resultant:.2e}"


# two leaves: the first on hinges A and B of the ground, the second on hinge C of the first; all axes along z
HUNG = hinge("A", "ground", "a", (0.0, 0.0, 0.0)), hinge("B", "ground", "a", (0.0, 0.0, 2.0))
LEAVES = Scene(
    name="door",
    body=(block("a", (1.0, 0.0, 0.0)), block("b", (3.0, 0.0, 0.0))),
    joint=(*HUNG, hinge("C", "a", "b", (2.0, 0.0, 0.0))),
    gravity=(0.0, 0.0, 0.0),
)
POSE = initial_poses(LEAVES)


def at_rest(**forces: tuple[float, ...]) -> Trajectory:
    """Both bodies at rest at three times; joints with the given wrenches."""
    place, turn = np.stack([POSE[0]] * 3), np.stack([POSE[1]] * 3)
    still, times = np.zeros((3, 2, 3)), np.array([0.0, 0.5, 1.0])
    reactions = {name: np.tile(wrench, (3, 1)).astype(float) for name, wrench in forces.items()} or None
    made = Trajectory("door", "e", "1", "m", {}, times, ("a", "b"), place, turn, still, still)
    return made if reactions is None else Trajectory(**{**vars(made), "reactions": reactions})


ONE = at_rest(A=(0, 0, 3, 0, 0, 0), B=(0, 0, 1, 0, 0, 0), C=(7, 0, 0, 0, 0, 0))
OTHER = at_rest(A=(0, 0, 1, 0, 0, 0), B=(0, 0, 3, 0, 0, 0), C=(7, 0, 0, 0, 0, 0))


def test_reactions_that_hinges_share_are_listed_by_joint_and_run():
    """Hinges A and B share the force along their axis: A has 3 N or 1 N of 4 N. C's reaction is unique and
    not listed; nor is a run without reactions."""
    found = side_by_side(LEAVES, {"one": ONE, "none": at_rest(), "other": OTHER}, 1)
    assert set(found) == {"A", "B"}
    assert found["A"] == pytest.approx({"one": 3.0, "other": 1.0})


def test_runs_that_divide_a_shared_force_differently_have_equal_unique_reactions():
    """Hinges A and B share 4 N: A has 3 N in one run and 1 N in the other, a difference of 2 N of the largest
    force, 7 N. C's reaction and the resultants are equal."""
    compared = compare(LEAVES, ONE, OTHER)
    assert compared.joints["C"].shared == 0 and compared.joints["C"].unique == 0.0
    assert compared.joints["A"].chosen == pytest.approx(2 / 7) and compared.resultant == pytest.approx(0.0)
