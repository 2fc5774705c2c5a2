"""Parts that the paper's mechanisms have in common: thin rods, sliders and poses in a plane."""

from __future__ import annotations

import math
from collections.abc import Iterable

from mbref.scene import Body

Point = tuple[float, float, float]

ROD_RADIUS = 0.01  # m
DENSITY = 1.0  # kg per metre of link
CRANK_RATE = 124.8  # rad/s, of every driven crank in the paper


def triple(values: Iterable[float]) -> Point:
    """Return three numbers of an array as a tuple."""
    x, y, z = map(float, values)
    return x, y, z


def midpoint(start: Point, end: Point) -> Point:
    """Return the point half way between two points."""
    return triple((p + q) / 2 for p, q in zip(start, end, strict=True))


def about_z(angle: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a rotation about world z."""
    return (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))


def rod_inertia(mass: float, length: float) -> tuple[float, float, float]:
    """Return the principal moments of a round rod, axis along x: m r²/2 and m (3 r² + L²)/12."""
    across = mass * (3 * ROD_RADIUS**2 + length**2) / 12
    return (mass * ROD_RADIUS**2 / 2, across, across)


def link(
    name: str,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    orientation: tuple[float, float, float, float],
    length: float,
    **velocities: tuple[float, float, float],
) -> Body:
    """Return a rod of 1 kg per metre between two points; its x axis runs from start to end."""
    (a, b, c), (x, y, z) = start, end
    mass = DENSITY * length
    return Body(
        name=name,
        mass=mass,
        inertia=rod_inertia(mass, length),
        position=((a + x) / 2, (b + y) / 2, (c + z) / 2),
        orientation=orientation,
        **velocities,
    )


def slider(position: tuple[float, float, float], name: str = "slider") -> Body:
    """Return the slider of both slider-cranks: 1 kg, 0.001 kg m² about every axis."""
    return Body(name=name, mass=1.0, inertia=(1e-3, 1e-3, 1e-3), position=position)
