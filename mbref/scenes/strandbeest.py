"""N legs of Theo Jansen's strandbeest on one crank, a benchmark of scaling: a body with 2 N joints and more.

A leg has six links and eleven lengths, Jansen's "holy numbers", here in decimetres. Two rods start at the
crank pin; two links turn about the frame. Legs stand side by side along z, PITCH apart, and are distributed
evenly over a turn of the crank. Rods have 1 kg/m, a triangle the inertia of its three sides. Gravity acts
along -y, the crank starts at SPEED. 36 N + 6 coordinates, 45 N + 5 rows, 9 N of them redundant, one degree of
freedom.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from mbref.scene import Body, Revolute, Scene
from mbref.scenes.links import DENSITY, about_z, link

Z = (0.0, 0.0, 1.0)
Flat = tuple[float, float]
# m: lengths a to m of a leg. (A, L) is from the axis of the fixed links to the axis of the crank, M the crank
A, B, C, D, E, F, G = 0.38, 0.415, 0.393, 0.401, 0.558, 0.394, 0.367
H, I, J, K, L, M = 0.657, 0.49, 0.5, 0.619, 0.078, 0.15
AXLE, PIVOT = (0.0, 0.0), (-A, -L)
FIRST, SPEED, PITCH = 0.4, 4.0, 0.05  # rad and rad/s of the crank at the start, m between legs
CRANK, MOMENT = 2.0, (0.02, 0.02, 0.04)  # kg, kg m² of the crank, whose centre of mass is on its axis


class Leg(NamedTuple):
    """Points of a leg: crank pin, its two rods' other ends, ends of the upper triangle and of the coupler,
    foot."""

    pin: Flat
    upper: Flat
    lower: Flat
    knee: Flat
    ankle: Flat
    foot: Flat


def leg_at(angle: float) -> Leg:
    """Return the points of a leg for an angle of the crank (rad)."""
    pin = (M * math.cos(angle), M * math.sin(angle))
    upper, lower = _meeting(PIVOT, B, pin, J), _meeting(pin, K, PIVOT, C)
    knee = _meeting(PIVOT, D, upper, E)
    ankle = _meeting(lower, G, knee, F)
    return Leg(pin, upper, lower, knee, ankle, _meeting(lower, I, ankle, H))


def strandbeest(legs: int = 1, name: str = "strandbeest") -> Scene:
    """Return legs on a crank that turns at SPEED; legs are assembled without their velocities."""
    speed = (0.0, 0.0, SPEED)
    crank = Body(name="crank", mass=CRANK, inertia=MOMENT, position=(*AXLE, 0.0), angular_velocity=speed)
    bodies, joints = [crank], [Revolute(name="O", bodies=("ground", "crank"), anchor=(*AXLE, 0.0), axis=Z)]
    for k in range(legs):
        points, z = leg_at(FIRST + 2 * math.pi * k / legs), PITCH * k
        rods = {
            f"j{k}": (points.pin, points.upper),
            f"k{k}": (points.pin, points.lower),
            f"c{k}": (PIVOT, points.lower),
            f"f{k}": (points.knee, points.ankle),
        }
        bodies += [_rod(name, *ends, z) for name, ends in rods.items()]
        bodies += [
            _triangle(f"bde{k}", (PIVOT, points.upper, points.knee), z),
            _triangle(f"ghi{k}", (points.lower, points.ankle, points.foot), z),
        ]
        from_crank = (("P", "crank", "j", points.pin), ("R", "crank", "k", points.pin))
        from_ground = (("Q", "ground", "bde", PIVOT), ("S", "ground", "c", PIVOT))
        at_rods = (
            ("T", "j", "bde", points.upper),
            ("U", "k", "c", points.lower),
            ("V", "c", "ghi", points.lower),
        )
        at_foot = (("W", "bde", "f", points.knee), ("X", "f", "ghi", points.ankle))
        hinges = (*from_crank, *from_ground, *at_rods, *at_foot)
        for name_of, first, second, place in hinges:
            pair = first if first in ("crank", "ground") else f"{first}{k}", f"{second}{k}"
            joints.append(Revolute(name=f"{name_of}{k}", bodies=pair, anchor=(*place, z), axis=Z))
    return Scene(name=name, gravity=(0.0, -9.81, 0.0), duration=0.5, body=tuple(bodies), joint=tuple(joints))


def _meeting(first: Flat, radius: float, second: Flat, other: float) -> Flat:
    """Return the point at two distances from two points, on the right of the way from first to second."""
    x, y = second[0] - first[0], second[1] - first[1]
    apart = math.hypot(x, y)
    along = (apart**2 + radius**2 - other**2) / (2 * apart)
    across = math.sqrt(radius**2 - along**2)
    return first[0] + (along * x + across * y) / apart, first[1] + (along * y - across * x) / apart


def _rod(name: str, start: Flat, end: Flat, z: float) -> Body:
    x, y = end[0] - start[0], end[1] - start[1]
    return link(name, (*start, z), (*end, z), about_z(math.atan2(y, x)), math.hypot(x, y))


def _triangle(name: str, corners: tuple[Flat, Flat, Flat], z: float) -> Body:
    """Return the body of three thin rods between the corners, in world axes."""
    sides = [(corners[k], corners[k - 1], math.dist(corners[k], corners[k - 1])) for k in range(3)]
    mass = sum(length for *_, length in sides)
    centre = [sum(length * (p[n] + q[n]) / 2 for p, q, length in sides) / mass for n in range(2)]
    about = sum(
        length * (length**2 / 12 + math.dist(centre, [(p[n] + q[n]) / 2 for n in range(2)]) ** 2)
        for p, q, length in sides
    )
    inertia = (DENSITY * about / 2, DENSITY * about / 2, DENSITY * about)
    return Body(name=name, mass=DENSITY * mass, inertia=inertia, position=(centre[0], centre[1], z))
