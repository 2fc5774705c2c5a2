"""The judge's functions of time, residuals, turns and terms against formulas, SciPy and sums by hand."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from crosscheck.judge import joint_coordinates, time_functions
from crosscheck.judge.equations_of_motion import accelerations as of_terms
from crosscheck.judge.equations_of_motion import terms_at
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.joint_residuals import joint_frames, position_rows, with_ground
from mbref.scene import Body, Driver, Force, Revolute, Scene, TorsionSpring
from tests.helpers.parts import X, Y, Z, joint


def body(name: str = "b", **parts: object) -> Body:
    given = {"mass": 2.0, "inertia": (0.3, 0.4, 0.5), "position": (0.0, 0.0, 0.0), **parts}
    return Body(name=name, **given)


TABLE = ((0.0, 0.0), (0.3, 0.2), (0.5, -0.1), (0.9, 0.4), (1.4, 0.0))


@pytest.mark.parametrize("derivative", range(4))
@pytest.mark.parametrize("rows", [TABLE, TABLE[:4]])
def test_a_table_of_a_driver_is_joined_by_scipys_cubic_spline(derivative, rows):
    """SciPy's spline is not-a-knot, as the judge's: the third derivative is continuous at the second row from
    each end. Both differ by at most 1e-11 in all derivatives; rounding over the cube of the shortest
    interval, 1e-16 / 0.2³, is 1e-14. Pieces of the function end at inner rows."""
    law, spline = Driver(joint="J", table=rows), CubicSpline(*zip(*rows, strict=True))
    t = np.array([0.01, 0.15, 0.3, 0.45, 0.5, 0.7, rows[-1][0] - 0.01])
    assert time_functions.value(law, t, derivative) == pytest.approx(spline(t, derivative), abs=1e-11)
    assert time_functions.ends(law) == tuple(time for time, _ in rows[1:-1])


def residual(given: dict, place, q) -> list[float]:
    """Return residuals (m, rad) of a joint at the origin after its body has moved and turned."""
    scene = Scene(name="s", body=(body(),), joint=(given,))
    pose = with_ground(np.array([place], dtype=float), np.array([q], dtype=float))
    return position_rows(joint_frames(scene)[0], np.zeros(()), *pose).tolist()


def about(axis, angle: float) -> np.ndarray:
    """Return the quaternion (4,) of a rotation by an angle (rad) about a unit axis."""
    return np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * np.array(axis)])


def at_origin(kind: str, **fields) -> dict:
    """Return a joint J between the ground and the body b, with its anchor at the origin."""
    return joint("J", kind, "ground", "b", **fields)


def test_residuals_of_joints_are_displacements_and_angles_that_they_prevent():
    """The body has moved by (0.1, 0.2, 0.3) m and turned about one axis. A joint along z has residuals along
    y, -x and z (m), and then about y, -x and z (rad), as far as it prevents them; a fixed or spherical joint
    has the axes of one along z. The quaternions q and -q are one rotation."""
    moved, other_sign = (0.1, 0.2, 0.3), -about(X, 0.4)
    fixed, hinge = at_origin("fixed"), at_origin("revolute", axis=Z)
    assert residual(fixed, moved, about(Y, 0.4)) == pytest.approx([0.2, -0.1, 0.3, 0.4, 0.0, 0.0])
    assert residual(fixed, moved, other_sign)[3:] == pytest.approx([0.0, -0.4, 0.0])
    assert residual(hinge, moved, about(Z, 2.0)) == pytest.approx([0.2, -0.1, 0.3, 0.0, 0.0])
    assert residual(hinge, (0, 0, 0), about(Y, 2.0))[3:] == pytest.approx([2.0, 0.0])
    assert residual(at_origin("spherical"), moved, about(X, 1.0)) == pytest.approx([0.2, -0.1, 0.3])
    rail = at_origin("translational", axis=Z)
    assert residual(rail, moved, about(Z, 0.3)) == pytest.approx([0.2, -0.1, 0.0, 0.0, 0.3])
    sleeve = at_origin("cylindrical", axis=Z)
    assert residual(sleeve, moved, about(X, 0.3)) == pytest.approx([0.2, -0.1, 0.0, -0.3])
    assert residual(at_origin("planar", axis=Z), moved, about(Y, -0.3)) == pytest.approx([0.3, -0.3, 0.0])


SAMPLED = 0.2 * np.arange(6)  # s


@pytest.mark.parametrize(("rate", "known"), [(15.6, 6), (15.8, 3)])
def test_turns_are_unknown_where_rates_near_a_step_differ_by_half_a_turn(rate, known):
    """Six samples 0.2 s apart have the angle 0 and rates 0, except the last rate: times 0.2 s it is 3.12 or
    3.16 rad, below or above half a turn π. Above it, turns are unknown in the last step and in the two
    before, whose rates are estimated from it."""
    found = joint_coordinates.counted(SAMPLED, 0 * SAMPLED, np.array([0.0, 0.0, 0.0, 0.0, 0.0, rate]))
    assert np.isnan(found).tolist() == [False] * known + [True] * (6 - known)


def pendulum() -> Scene:
    """Return a body of 2 kg, 0.5 kg m² about z, 1 m along x from its hinge, that turns at 2 rad/s; with a
    force of 1.5 N at its centre and a torsion spring with damper."""
    hinge = Revolute(name="J", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    spring = TorsionSpring(joint="J", stiffness=3.0, damping=0.5, natural_angle=0.1)
    pull = Force(body="b", point=(1.0, 0.0, 0.0), force=(0.0, 1.5, 0.0))
    swung = body(
        position=(1.0, 0.0, 0.0),
        inertia=((0.3, 0.1, 0.0), (0.1, 0.4, 0.0), (0.0, 0.0, 0.5)),
        angular_velocity=(0.0, 0.0, 2.0),
        velocity=(0.0, 2.0, 0.0),
    )
    parts = {"body": (swung,), "joint": (hinge,), "load": (pull, spring)}
    return Scene(name="s", gravity=(0.0, -9.0, 0.0), duration=0.1, **parts)


def test_terms_of_a_pendulum_are_its_forces_mass_and_constraint_rows():
    """Moments about the hinge: weight -18 N m, force 1.5 N m, spring 3 · 0.1 N m, damper -0.5 · 2 N m. Their
    sum over 0.5 + 2 · 1² kg m² is the acceleration about z; the centre has ω² r = 4 m/s²."""
    scene = pendulum()
    terms = terms_at(scene, gauss_motion(scene, (0.0,)), 0)
    assert list(terms.forces) == [
        "gravity",
        "the gyroscopic moments ω × Jω",
        "load[0] (force on 'b')",
        "load[1] (torsion_spring at 'J')",
        "the damping of load[1] (torsion_spring at 'J')",
    ]
    forces = [0, -18, 0, 0, 0, 0], [0] * 6, [0, 1.5, 0, 0, 0, 0]
    wanted = (*forces, [0, 0, 0, 0, 0, 0.3], [0, 0, 0, 0, 0, -1.0])
    for force, expected in zip(terms.forces.values(), wanted, strict=True):
        assert force == pytest.approx(np.array(expected, dtype=float), abs=1e-14)  # N, N m
    assert np.diag(terms.mass) == pytest.approx([2, 2, 2, 0.3, 0.4, 0.5]) and terms.mass[3, 4] == 0.1
    assert terms.joints == ("J",) * 5 and terms.rows.shape == (5, 6) and not terms.of_drivers.any()
    assert np.linalg.norm(terms.of_velocities) == pytest.approx(4.0)
    found = of_terms(scene, terms)
    assert found[5] == pytest.approx((-18 + 1.5 + 0.3 - 1.0) / 2.5)
    assert found[:3] == pytest.approx([-4.0, found[5], 0.0])
