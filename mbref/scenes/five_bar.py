"""The paper's five-bar linkage: the four-bar with a bar parallel to the coupler.

The bar joins mid-crank (E) and mid-rocker (F) by revolutes about z.  With ``ground = "body"``: 30
coordinates, 35 rows with the driver, rank 30, five redundant rows; singular at θ₂ = nπ.
"""

from __future__ import annotations

import math

from mbref.scene import Revolute, Scene
from mbref.scenes.four_bar import LENGTH, Z, driven, parallelogram
from mbref.scenes.links import about_z, link


def five_bar(theta0: float = math.pi / 2, name: str = "five_bar") -> Scene:
    """Return the linkage driven at -124.8 rad/s from θ₂ = theta0 (rad)."""
    return driven(_with_bar(theta0, name))


def five_bar_gravity(theta0: float = 0.3, name: str = "five_bar_gravity") -> Scene:
    """Return the linkage released from rest at θ₂ = theta0 under gravity along -y."""
    return _with_bar(theta0, name).with_(gravity=(0.0, -9.81, 0.0), duration=1.0)


def _with_bar(theta0: float, name: str) -> Scene:
    base = parallelogram(theta0, name)
    e = (LENGTH / 2 * math.cos(theta0), LENGTH / 2 * math.sin(theta0), 0.0)
    f = (LENGTH + e[0], e[1], 0.0)
    return base.with_(
        body=(*base.body, link("bar", e, f, about_z(0.0), LENGTH)),
        joint=(
            *base.joint,
            Revolute(name="E", bodies=("crank", "bar"), anchor=e, axis=Z),
            Revolute(name="F", bodies=("bar", "rocker"), anchor=f, axis=Z),
        ),
    )
