"""The paper's spatial slider-crank (Figure 9): crank about +y, slider on a line parallel to y.

Crank r = 0.1 m at the origin, x along the crank; rod l = 0.4 m, x from B to C and z perpendicular to
world y; slider on x = d = 0.15 m.  Revolute at A, universal at B (world y on the crank, z on the rod),
spherical at C, translational at D.  With ``ground = "body"``: 24 coordinates, 23 rows, no redundancy,
one degree of freedom, never singular.  y_C = sqrt(l² - (r cos θ - d)² - (r sin θ)²).
"""

from __future__ import annotations

import math

import numpy as np

from mbref import rotations
from mbref.scene import Driver, Moment, Revolute, Scene, Spherical, Translational, Universal
from mbref.scenes.links import CRANK_RATE, link, slider

RADIUS, ROD, OFFSET = 0.1, 0.4, 0.15
Y = (0.0, 1.0, 0.0)


def spatial_slider_crank(name: str = "spatial_slider_crank") -> Scene:
    """Return the mechanism under 100 N m about +y on the crank, from rest at θ = 0."""
    return _mechanism(0.0, name).with_(load=(Moment(body="crank", moment=(0.0, 100.0, 0.0)),), duration=0.05)


def spatial_slider_crank_driven(name: str = "spatial_slider_crank_driven") -> Scene:
    """Return the mechanism with its crank driven at 124.8 rad/s from θ = 0."""
    return _mechanism(0.0, name).with_(
        driver=(Driver(joint="A", polynomial=(0.0, CRANK_RATE)),), duration=0.2
    )


def spatial_slider_crank_gravity(name: str = "spatial_slider_crank_gravity") -> Scene:
    """Return the mechanism under gravity along -y, from θ = 0.3 at 30 rad/s."""
    return _mechanism(0.3, name, rate=30.0).with_(gravity=(0.0, -9.81, 0.0), duration=0.5)


def _mechanism(theta0: float, name: str, rate: float | None = None) -> Scene:
    pin = (RADIUS * math.cos(theta0), 0.0, -RADIUS * math.sin(theta0))
    height = math.sqrt(ROD**2 - (pin[0] - OFFSET) ** 2 - pin[2] ** 2)
    end = (OFFSET, height, 0.0)
    x = (np.array(end) - pin) / ROD
    z = np.cross(x, Y) / np.linalg.norm(np.cross(x, Y))
    rod = tuple(rotations.from_matrix(np.column_stack([x, np.cross(z, x), z])).tolist())
    crank = (math.cos(theta0 / 2), 0.0, math.sin(theta0 / 2), 0.0)
    origin = (0.0, 0.0, 0.0)
    moving = {} if rate is None else {"angular_velocity": (0.0, rate, 0.0)}
    return Scene(
        name=name,
        body=(
            link("crank", origin, pin, crank, RADIUS, **moving),
            link("rod", pin, end, rod, ROD),
            slider(end),
        ),
        joint=(
            Revolute(name="A", bodies=("ground", "crank"), anchor=origin, axis=Y),
            Universal(name="B", bodies=("crank", "rod"), anchor=pin, axes=(Y, tuple(z.tolist()))),
            Spherical(name="C", bodies=("rod", "slider"), anchor=end),
            Translational(name="D", bodies=("ground", "slider"), anchor=end, axis=Y),
        ),
    )
