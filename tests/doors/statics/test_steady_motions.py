"""Steady motions of mechanisms that turn with a driver, against closed forms."""

import json
from functools import cache

import numpy as np
import pytest

from crosscheck.judge.small_motions.equilibria import steady_poses
from mbref import Scene, SceneError, equilibria
from mbref.cli.commands import main
from tests.helpers.parts import X, Y, joint, slide
from tests.helpers.statics import ORIGIN, hinge, rod

G, MASS, LENGTH, OWN = 9.81, 1.5, 0.5, 0.02  # m/s², kg, m, kg m²
ACCURACY = 1e-9  # N, m, m/s, rad; Newton's method ends at forces of about 1e-12 N


def turning_pendulum(rate: float, axis=(0.0, 0.0, 1.0), **changes) -> Scene:
    """Return a ball on an arm of 0.5 m that hangs from a turning spindle by a hinge about the y axis."""
    bodies = [rod("spindle", ORIGIN, 1.0, 0.1), rod("ball", (0.3, 0.0, -0.4), MASS, OWN)]
    joints = [hinge("A", ("ground", "spindle"), axis=axis), hinge("B", ("spindle", "ball"), axis=Y)]
    driver = [{"joint": "A", "polynomial": [0.0, rate], "sine": {"frequency": 5.0}}]  # of no amplitude
    given = {"gravity": (0.0, 0.0, -G), "body": bodies, "joint": joints, "driver": driver}
    return Scene(name="turning_pendulum", **given | changes)


def angle(each) -> float:
    """Return the angle (rad) of the arm from the vertical below."""
    x, _, z = each.scene.body[1].position
    return float(np.arctan2(x, -z))


@cache
def steady(rate):
    """Return the steady motions of the pendulum at a rate (rad/s) of its spindle."""
    return equilibria(turning_pendulum(rate))


@pytest.mark.parametrize("rate", [3.0, 4.0, 4.8, 6.0, -6.0, 12.0])
def test_a_pendulum_on_a_spindle_leaves_the_axis_above_the_critical_rate(rate):
    """Steady angles are 0, π and, from Ω² = g / l on, acos(g / (l Ω²)) on both sides, to ACCURACY. Their
    eigenvalues are I s² = -(m g l cos α - m l² Ω² cos 2α), I = OWN + m l²; s² < 0 is stable. Eigenvalues are
    exact to rounding of sums of 1e3, 1e-11."""
    found = steady(rate)
    cosine = G / (LENGTH * rate**2)
    expected = [0.0, np.pi] + ([np.arccos(cosine), -np.arccos(cosine)] if cosine < 1 else [])
    assert np.allclose(sorted(angle(each) for each in found), sorted(expected), rtol=0, atol=ACCURACY)
    for each in found:
        a = angle(each)
        bend = MASS * G * LENGTH * np.cos(a) - MASS * LENGTH**2 * rate**2 * np.cos(2 * a)
        exact = -bend / (OWN + MASS * LENGTH**2)
        assert np.allclose(each.eigenvalues**2, exact, rtol=1e-11, atol=0), (rate, a)
        assert each.stability == ("stable" if exact < 0 else "unstable") and each.rate == abs(rate)


def test_steady_motion_has_velocities_and_its_hinge_carries_weight_and_centripetal_force():
    """At Ω = 6 rad/s and the radius r the hinge carries m Ω² r towards the axis, and m g. Both bodies turn at
    Ω about z; the ball moves at Ω r. All to ACCURACY."""
    [each] = [e for e in steady(6.0) if e.stability == "stable" and angle(e) > 0]
    radius = each.scene.body[1].position[0]
    assert np.allclose(each.reactions["B"][:3], [-MASS * 36.0 * radius, 0.0, MASS * G], rtol=0, atol=ACCURACY)
    assert np.allclose(each.scene.body[1].velocity, [0.0, 6.0 * radius, 0.0], rtol=0, atol=ACCURACY)
    assert np.allclose([b.angular_velocity for b in each.scene.body], [0.0, 0.0, 6.0], rtol=0, atol=ACCURACY)


def test_coriolis_forces_couple_two_slides_of_a_turning_table():
    """A ball on two crossed springs on a turning table: the eigenvalues are roots of (s² + k₁/m - Ω²)(s² +
    k₂/m - Ω²) + 4 Ω² s², here to 1e-7, as the cross between the slides has a mass of 1e-9 kg. The motion is
    unstable if Ω², here 9 s⁻², lies between both values of k/m."""
    rate = 3.0
    sizes = {"table": (1.0, 0.1), "cross": (1e-9, 1e-9), "ball": (1.0, 0.02)}  # kg, kg m²
    bodies = [rod(name, ORIGIN, *size) for name, size in sizes.items()]
    slides = slide("X", "table", "cross", ORIGIN, X), slide("Y", "cross", "ball", ORIGIN, Y)
    joints = [hinge("A", ("ground", "table")), *slides]
    for stiffness, is_stable in (((20.0, 25.0), True), ((4.0, 25.0), False)):
        spring, pairs = {"type": "slide_spring", "damping": 0.0}, zip("XY", stiffness, strict=True)
        loads = [{"joint": name, "stiffness": k, **spring} for name, k in pairs]
        scene = turning_pendulum(rate, body=bodies, joint=joints, load=loads)
        [each] = equilibria(scene, starts=1)
        a, b = (k - rate**2 for k in stiffness)
        exact = np.sqrt(np.roots([1.0, a + b + 4 * rate**2, a * b]).astype(complex))
        exact = np.concatenate([exact, -exact])
        gaps = np.abs(each.eigenvalues[:, None] - exact)
        assert gaps.min(axis=1).max() < 1e-7 and gaps.min(axis=0).max() < 1e-7
        assert (each.stability == "stable") is is_stable


def test_a_body_on_a_ball_joint_has_the_roots_of_eulers_equations():
    """The body turns without torque about a principal axis: seen from the spindle, s = ± i Ω and s² = -Ω² (C
    - A) (C - B) / (A B), by the judge to rounding. The angle about the axis is free: a double eigenvalue of
    zero, which rounding splits by its square root, up to 1e-4 rad/s."""
    rate, (a, b, c) = 5.0, (0.02, 0.03, 0.045)
    turned = {"name": "body", "mass": 1.0, "inertia": [a, b, c], "position": ORIGIN}
    bodies = [rod("spindle", (0.0, 0.0, 1.0), 1.0, 0.1), turned]
    joints = [turning_pendulum(rate).joint[0], joint("B", "spherical", "spindle", "body")]
    scene = turning_pendulum(rate, body=bodies, joint=joints, gravity=(0.0, 0.0, 0.0))
    [each] = equilibria(scene, starts=1)
    slow = rate * np.sqrt((c - a) * (c - b) / (a * b))
    exact = np.array([1j * rate, -1j * rate, 1j * slow, -1j * slow])
    [judged] = steady_poses(scene, starts=1)
    for found, close in ((each, ACCURACY), (judged, 1e-12 * rate)):
        assert np.abs(found.eigenvalues[:, None] - exact).min(axis=0).max() < close
    assert each.stability == "indifferent"
    assert np.sort(np.abs(each.eigenvalues))[:2].max() < 1e-4


PUSH = {"type": "force", "body": "ball", "point": [0.3, 0.0, -0.4], "force": [1.0, 0.0, 0.0]}
TIE = joint("C", "distance", "ground", "ball", anchors=[[1.0, 1.0, 0.0], [0.3, 0.0, -0.4]])
JOINTS = [*turning_pendulum(1.0).joint, TIE]
BODIES = [*turning_pendulum(1.0).body, rod("free", (0.0, 0.0, 5.0), 1.0, 0.1)]


@pytest.mark.parametrize(
    ("change", "says"),
    [({"load": [PUSH]}, "loads"), ({"joint": JOINTS, "body": BODIES}, "joint 'C' does not turn with it")],
)
def test_motions_that_are_not_steady_are_refused_with_the_cause(change, says):
    """PUSH on the ball has a direction fixed in space; in JOINTS a rod ties the ball to the ground."""
    with pytest.raises(SceneError, match=rf"driver\[A\]: .*{says}.*, so the motion is not steady"):
        equilibria(turning_pendulum(6.0, **change), starts=2)


def test_commands_print_stability_and_rate_of_a_steady_motion(tmp_path, capsys):
    """A pendulum on a spindle above its critical rate, 6 rad/s, has stable motions beside the axis."""
    path = str(tmp_path / "my.toml")
    turning_pendulum(6.0).save(path)
    assert main(["equilibrium", path, "--starts", "8"]) == 0
    assert "stable, turns at 6 rad/s" in capsys.readouterr().out
    assert main(["modes", path, "--starts", "8", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["rate"] == 6.0 and shown["stability"] == "stable"
