"""Symbolic equations of motion of adapters, and their forces on bodies, against textbook equations."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.shared.constraint_equations import frames as body_frames
from crosscheck.engines.shared.generalised_forces import Forces
from crosscheck.engines.shared.symbolic.equations import TreeEquations
from crosscheck.engines.shared.symbolic.symbols import NUMBERS
from mbref import rotations
from mbref.scene import Body, Driver, Force, Moment, Revolute, Scene, Spherical, TorsionSpring, Translational

G = 9.0
PLACE, ANGLE, SPEED, RATE = 0.7, 0.3, 1.1, 1.2  # m, rad, m/s, rad/s of the crane: x, φ and their rates
CART = Body(name="cart", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
ROD = Body(name="rod", mass=3.0, inertia=(0.25, 0.75, 0.5), position=(1.0, 0.0, 0.0))
RAIL = Translational(name="S", bodies=("ground", "cart"), anchor=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
PUSH = Force(body="rod", point=(0.0, 0.0, 0.0), force=(1.0, 0.0, 0.0))
PIVOT = Revolute(name="H", bodies=("cart", "rod"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))


def crane(**parts: Any) -> Scene:
    """Return a rod on a hinge of a cart that slides along x."""
    given = {"body": (CART, ROD), "joint": (RAIL, PIVOT), "gravity": (0.0, -G, 0.0)}
    return Scene(name="crane", **{**given, **parts})


def expected(angle: float, rate: float, moment: float = 0.0) -> np.ndarray:
    """Return x'' and φ'' by Lagrange's equations: 5 x'' - 3 sin φ φ'' = 3 cos φ φ'² and
    -3 sin φ x'' + 3.5 φ'' = -3 g cos φ + M, for a cart of 2 kg, and 3 kg and 0.5 kg m² at 1 m."""
    s, c = math.sin(angle), math.cos(angle)
    mass = np.array([[5.0, -3.0 * s], [-3.0 * s, 3.5]])
    return np.linalg.solve(mass, [3.0 * c * rate**2, -3.0 * G * c + moment])


@pytest.mark.parametrize("moment", [0.0, 7.0])
def test_symbolic_equations_of_a_crane_give_its_accelerations(moment: float) -> None:
    """By Lagrange's equations of `expected`. The moment of 7 N m about z acts on φ, its parts about x and y
    do not."""
    load = (Moment(body="rod", moment=(5.0, 6.0, moment)),) if moment else ()
    equations = TreeEquations(crane(load=load))
    found = equations.accelerations([PLACE, ANGLE], [SPEED, RATE], NUMBERS, 0.5)
    assert found.astype(float) == pytest.approx(expected(ANGLE, RATE, moment))


def test_closing_no_loops_leaves_the_coordinates_of_a_mechanism_unchanged() -> None:
    """``settled`` closes loops; the crane has no rows of loops, and keeps its two coordinates and rates."""
    equations = TreeEquations(crane())
    assert equations.n == 2 and equations.rows == []
    q, v = equations.settled([PLACE, ANGLE], [SPEED, RATE], NUMBERS)
    assert q.tolist() == [PLACE, ANGLE] and v.tolist() == [SPEED, RATE]


def test_motion_of_a_cranes_bodies_follows_from_its_coordinates() -> None:
    """The rod's centre is at (x + cos φ, sin φ), 1 m from the hinge: velocities and accelerations are the
    derivatives of this place, with x'' and φ'' of `expected`."""
    equations = TreeEquations(crane())
    motion, closing = equations.link_motion(np.array([PLACE, ANGLE, SPEED, RATE]))
    of_cart, of_angle = expected(ANGLE, RATE)
    s, c = math.sin(ANGLE), math.cos(ANGLE)
    assert closing == [] and motion.position == pytest.approx(np.array([[PLACE, 0, 0], [PLACE + c, s, 0]]))
    assert motion.velocity == pytest.approx(np.array([[SPEED, 0, 0], [SPEED - RATE * s, RATE * c, 0]]))
    assert motion.angular_velocity == pytest.approx(np.array([[0, 0, 0], [0, 0, RATE]]))
    of_rod = [of_cart - of_angle * s - RATE**2 * c, of_angle * c - RATE**2 * s, 0.0]
    assert motion.acceleration == pytest.approx(np.array([[of_cart, 0, 0], of_rod]))
    assert motion.angular_acceleration == pytest.approx(np.array([[0, 0, 0], [0, 0, of_angle]]))
    assert motion.rotation[1] == pytest.approx(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def test_symbolic_equations_of_a_bead_on_a_turning_rod_have_the_coriolis_force() -> None:
    """A bead of 2 kg and 0.5 kg m² slides on a rod of 4 kg m² that turns about z at the rate w. Its distance
    r from the axis is 1 m plus the rail's coordinate 0.5 m: r'' = r w², and (4.5 + 2 r²) w' = -4 r r' w,
    where r' is 0.7 m/s and w 1.2 rad/s."""
    rod = ROD.model_copy(update={"position": (0.0, 0.0, 0.0), "inertia": (1.0, 1.0, 4.0)})
    bead = CART.model_copy(update={"name": "bead", "position": (1.0, 0.0, 0.0), "inertia": (0.1, 0.2, 0.5)})
    pivot = PIVOT.model_copy(update={"bodies": ("ground", "rod")})
    rail = RAIL.model_copy(update={"bodies": ("rod", "bead"), "anchor": (1.0, 0.0, 0.0)})
    given = crane(body=(rod, bead), joint=(pivot, rail), gravity=(0.0, 0.0, -G))
    equations = TreeEquations(given)
    found = equations.accelerations([0.4, 0.5], [1.2, 0.7], NUMBERS, 0.0).astype(float)
    r = 1.0 + 0.5
    assert found == pytest.approx([-4.0 * r * 0.7 * 1.2 / (4.5 + 2.0 * r**2), r * 1.2**2])


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({"joint": (RAIL,)}, "its tree has free or ball joints"),
        ({"driver": (Driver(joint="S"),)}, "it has drivers, or loads other than moments"),
        ({"load": (PUSH,)}, "it has drivers, or loads other than moments"),
    ],
)
def test_no_symbolic_equations_are_derived_for_free_bodies_drivers_and_forces(parts, says):
    """Without its hinge the rod is a free body. Adapters take such scenes by their other equations."""
    with pytest.raises(ValueError, match=says):
        TreeEquations(crane(**parts))


HALF = math.sqrt(0.5)
TURNED = Body(name="b", mass=2, inertia=(1, 2, 3), position=(1, 0, 0), orientation=(HALF, 0, 0, HALF))
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))


def forces(load, omega=(0.0, 0.0, 0.0), v=(0.0, 0.0, 0.0), angle=0.0):
    """Return force (world) and moment (body axes) of a load on a body that stands a quarter turn about z from
    the world's axes, as at the start, and turns by ``omega`` (body axes). ``angle`` is an estimate (rad)."""
    scene = Scene(name="s", body=(TURNED,), joint=(HINGE,), load=(load,), gravity=(0, 0, 0), duration=1)
    found = Forces(scene)
    at = body_frames(
        np.array([[1.0, 0.0, 0.0]]), np.array([TURNED.orientation]), np.array([v]), np.array([omega], float)
    )
    return found(at, np.array([omega], float), np.full(len(found.twists), angle))


@pytest.mark.parametrize(("turns", "angle"), [(0.0, 0.0), (6.0, 2 * math.pi), (-13.0, -4 * math.pi)])
def test_torsion_spring_of_an_adapter_counts_the_full_turns_of_an_estimated_angle(turns, angle):
    """The pose gives an angle of 0 up to full turns, and the estimate (``turns``, rad) their number: 6 rad is
    nearest to one turn, -13 rad to -2. The spring's moment is -k (φ - 0.25) - c φ' about z; from the result
    the gyroscopic moment -ω × J ω is taken away."""
    spring = TorsionSpring(joint="H", stiffness=4.0, damping=0.5, natural_angle=0.25)
    found = forces(spring, omega=(7.0, 8.0, 3.0), angle=turns)
    gyroscopic = -np.cross([7.0, 8.0, 3.0], [7.0, 16.0, 9.0])
    wanted = [0.0, 0.0, -(4.0 * (angle - 0.25) + 0.5 * 3.0)]
    assert found[3:] - gyroscopic == pytest.approx(wanted, rel=1e-9)  # rounding of moments of 100 N m
    assert not found[:3].any()


def test_a_torsion_spring_between_two_bodies_has_opposite_moments_on_them() -> None:
    """4 N m/rad · (0.5 - 0.25) rad = 1 N m about z, and nothing else. The joint's angle of 0.5 rad and its
    rate of 3 - 1 rad/s follow from the poses and angular velocities of both bodies."""
    other = TURNED.model_copy(update={"name": "c", "orientation": (1.0, 0.0, 0.0, 0.0)})
    joint = Revolute(name="J", bodies=("b", "c"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    ball = Spherical(name="B", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0))
    spring = TorsionSpring(joint="J", stiffness=4.0, natural_angle=0.25)
    scene = Scene(
        name="s", body=(TURNED, other), joint=(ball, joint), load=(spring,), gravity=(0, 0, 0), duration=1.0
    )
    found = Forces(scene)
    poses = np.array([TURNED.orientation, rotations.from_vector(np.array([0.0, 0.0, 0.5]))])
    omega = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 3.0]])
    at = body_frames(np.zeros((2, 3)), poses, np.zeros((2, 3)), omega)
    assert found.angle(at, 0) == pytest.approx(0.5) and found.turning(at) == pytest.approx([2.0])
    total = found(at, omega, np.array([0.4])).reshape(2, 6)
    assert total[:, 5] == pytest.approx([1.0, -1.0]) and np.count_nonzero(np.abs(total) > 1e-12) == 2
