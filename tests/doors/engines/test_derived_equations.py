"""Symbolic equations of motion of adapters against textbook equations."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.shared.symbolic.equations import TreeEquations
from crosscheck.engines.shared.symbolic.symbols import NUMBERS
from mbref.scene import Body, Driver, Force, Revolute, Scene, Translational

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


def expected(angle: float, rate: float) -> np.ndarray:
    """Return x'' and φ'' by Lagrange's equations: 5 x'' - 3 sin φ φ'' = 3 cos φ φ'² and
    -3 sin φ x'' + 3.5 φ'' = -3 g cos φ, for a cart of 2 kg, and 3 kg and 0.5 kg m² at 1 m."""
    s, c = math.sin(angle), math.cos(angle)
    mass = np.array([[5.0, -3.0 * s], [-3.0 * s, 3.5]])
    return np.linalg.solve(mass, [3.0 * c * rate**2, -3.0 * G * c])


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
