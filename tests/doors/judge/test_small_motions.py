"""The judge's equilibria, steady motions and eigenvalues against closed forms; engines at these poses."""

import json
from functools import cache

import numpy as np
import pytest

from crosscheck.cli.commands import main
from crosscheck.cli.running import print_json
from crosscheck.engine import engine
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.small_motions.equilibria import steady_poses
from crosscheck.judge.small_motions.turning import turning
from crosscheck.small_motions import records
from crosscheck.small_motions.compare import at_pose, by_accelerations, error
from crosscheck.small_motions.mechanisms import (
    MECHANISMS,
    damped_slides,
    governor,
    pendulum,
    spring_four_bar,
    turning_pendulum,
)
from mbref.scene import SceneError

KNOWN = {mechanism.name: mechanism for mechanism in MECHANISMS}


@cache
def poses(make, starts):
    """Return the judge's poses of a mechanism from some starts."""
    return steady_poses(make(), starts=starts)


@pytest.fixture(scope="module", params=list(KNOWN))
def judged(request):
    mechanism = KNOWN[request.param]
    return mechanism, poses(mechanism.make, 8)


def test_judge_finds_the_eigenvalues_of_closed_forms(judged):
    """For each closed form of the mechanism (`known`) a pose is found whose eigenvalues differ by less than
    1e-13 of the largest, and by at most fifty times the uncertainty that the judge states, which is below
    1e-11. A positive real part is called unstable."""
    mechanism, found = judged
    for exact in mechanism.known():
        errors = [error(each.eigenvalues, np.array(exact)) for each in found]
        best = int(np.argmin(errors))
        assert errors[best] < 1e-13, (mechanism.name, exact, errors[best])
        assert errors[best] <= 50 * found[best].uncertainty
        assert found[best].uncertainty < 1e-11
        unstable = max(s.real for s in exact) > 1e-9
        assert found[best].stability == ("unstable" if unstable else "stable")


def test_steady_poses_are_balanced_with_symmetric_positive_mass_matrix(judged):
    """Unbalanced forces are below 1e-13 N or N m; eigenvalues are conjugate pairs, to 1e-14."""
    _, found = judged
    for each in found:
        assert np.abs(each.balance.unbalanced(each.state).astype(float)).max() < 1e-13
        assert error(each.eigenvalues, each.eigenvalues.conj()) < 1e-14
        mass = each.small.mass
        assert np.allclose(mass, mass.T, rtol=0, atol=1e-14 * mass.max()) and np.linalg.eigvalsh(mass)[0] > 0


def test_four_bar_with_diagonal_spring_rests_at_the_published_angle():
    """The IFToMM benchmark prints the crank's angle, 2.23433101898 rad, up to 4e-11 rad."""
    cranks = [each.position[0] for each in steady_poses(spring_four_bar(), starts=8)]
    angles = np.array([np.arctan2(crank[2], crank[0]) for crank in cranks])
    assert np.abs(angles - 2.23433101898).min() < 5e-11


def test_steady_pose_of_the_governor_stays_steady_when_integrated():
    """Over 0.2 s of the judge's integration by Gauss's principle the distance of a ball, body 1, from the
    axis and the height of the sleeve, body 3, stay within 1e-8, the tolerance of the integration."""
    [each] = [e for e in steady_poses(governor(), starts=1) if e.stability == "stable"]
    scene = at_pose(each.balance, each.state)
    moved = gauss_motion(scene, (0.0, 0.2))
    radius = np.linalg.norm(moved.position[:, 1, :2], axis=1)
    assert radius[1] == pytest.approx(radius[0], rel=1e-8)
    assert moved.position[1, 3, 2] == pytest.approx(each.position[3, 2], abs=1e-8)


@pytest.mark.parametrize("name", ["mujoco", "pinocchio", "exudyn"])
def test_engine_s_accelerations_give_the_judge_s_eigenvalues(name):
    """Differences of its accelerations about the judge's poses of a resting and a turning pendulum and of
    damped slides give eigenvalues within 1e-9 of the judge's, of the largest."""
    pytest.importorskip(name)
    for make in (pendulum, turning_pendulum, damped_slides):
        each = poses(make, 1)[0]
        found = by_accelerations(engine(name), each)
        assert found.eigenvalues is not None, found.reason
        assert error(found.eigenvalues, each.eigenvalues) < 1e-9


def test_mujoco_s_own_linearisation_has_the_judge_s_eigenvalues():
    """MuJoCo linearises a step by finite differences, whose errors are within 1e-6 for a pendulum and 1e-4
    for damped slides; relative to the largest eigenvalue."""
    [below] = [each for each in poses(pendulum, 4) if each.stability == "stable"]
    [slides] = poses(damped_slides, 1)
    mujoco = engine("mujoco")
    assert error(mujoco.own_eigenvalues(at_pose(below.balance, below.state)), below.eigenvalues) < 1e-6
    assert error(mujoco.own_eigenvalues(damped_slides()), slides.eigenvalues) < 1e-4


def test_exudyn_s_own_linearisation_leaves_out_how_constraint_forces_turn():
    """Slides, whose constraint forces do not turn, have the judge's eigenvalues; a pendulum's, which follow
    from the turning of its hinge's force alone, are zero. Both to 1e-6, by finite differences."""
    pytest.importorskip("exudyn")
    [below] = [each for each in poses(pendulum, 4) if each.stability == "stable"]
    [slides] = poses(damped_slides, 1)
    exudyn = engine("exudyn")
    assert np.abs(exudyn.own_eigenvalues(at_pose(below.balance, below.state))).max() < 1e-6
    assert error(exudyn.own_eigenvalues(damped_slides()), slides.eigenvalues) < 1e-6


def test_scene_at_an_equilibrium_starts_without_acceleration():
    """The pendulum's torsion spring has a natural angle of 0.3 rad, which is counted from the new pose; the
    acceleration by Gauss's principle is below 1e-9 of g."""
    spring = {"type": "torsion_spring", "joint": "A", "stiffness": 30.0, "damping": 0.0, "natural_angle": 0.3}
    [each, *_] = steady_poses(pendulum().with_(load=[spring]), starts=2)
    assert np.abs(gauss(at_pose(each.balance, each.state))).max() < 1e-9 * 9.81


def test_steady_rotation_has_the_second_body_s_sense():
    """The rate of 6 rad/s is the second body's: with (spindle, ground) the spindle turns back."""
    scene = turning_pendulum()
    backwards = scene.joint[0].model_copy(update={"bodies": ("spindle", "ground")})
    assert turning(scene).spin.tolist() == [0.0, 0.0, 6.0]
    assert turning(scene.with_(joint=[backwards, scene.joint[1]])).spin.tolist() == [0.0, 0.0, -6.0]


def test_driven_axis_may_lean_from_gravity_by_1e_12_rad():
    """The driver turns about z at 6 rad/s; gravity leans by 0.9e-12 or, too much, by 1.1e-12 rad."""
    allowed, refused = (turning_pendulum().with_(gravity=(k * 9.81e-12, 0.0, -9.81)) for k in (0.9, 1.1))
    assert turning(allowed).rate == 6.0
    with pytest.raises(SceneError, match="its axis is not along gravity"):
        turning(refused)


def test_horizontal_force_fixed_in_space_allows_no_steady_rotation():
    """The spindle turns at 6 rad/s about the vertical; a force of 0.1 N along the x axis of space turns
    relative to it. Without the force there are steady poses."""
    push = {"type": "force", "body": "ball", "point": [0.3, 0.0, -0.4], "force": [0.1, 0.0, 0.0]}
    assert steady_poses(turning_pendulum(), starts=2)
    assert steady_poses(turning_pendulum().with_(load=[push]), starts=4) == []


def test_stored_records_have_every_mechanism_and_errors_of_rounding():
    """The judge is off closed forms by at most 1e-13, mbref by 1e-11. mbref's search from one pose misses
    three of the judge's poses, two of the rhombus and one of the governor."""
    stored = records.read()
    assert {record["scene"] for record in stored} == set(KNOWN)
    assert all(record["error"] < 1e-13 for record in stored)
    missed = [record["scene"] for record in stored if record["mbref_distance"] is None]
    assert missed == ["four_bar_gravity", "four_bar_gravity", "governor"]
    found = [record for record in stored if record["mbref_distance"] is not None]
    assert all(max(record["mbref_error"], record["mbref_distance"]) < 1e-11 for record in found)


def test_modes_command_without_a_scene_prints_the_stored_records(capsys):
    """One of them is the governor's steady motion at 10 rad/s."""
    assert main(["modes"]) == 0
    assert "governor: Steady motion at 10 rad/s, stable" in capsys.readouterr().out


@pytest.mark.parametrize(("given", "off"), [([np.nan, 1j], np.inf), ([1j], np.inf), ([1j, -1j, 5.0], 0.0)])
def test_eigenvalues_that_are_missing_or_no_numbers_have_an_infinite_error(given, off):
    assert error(np.array(given), np.array([1j, -1j])) == off


def test_json_document_has_null_for_numbers_that_are_not_finite(capsys):
    print_json([{"error": np.inf, "eigenvalues": [[np.nan, 1.0]]}])
    assert json.loads(capsys.readouterr().out) == {"error": None, "eigenvalues": [[None, 1.0]]}
