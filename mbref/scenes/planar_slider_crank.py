"""The paper's planar slider-crank (Figure 10): crank a, rod b in the xy-plane, slider on the x axis.

Revolutes about z at A and B, a spherical joint at C, a translational joint along x at D.  With ``ground =
"body"``: 24 coordinates, 24 rows, rank 23, one redundant row, one degree of freedom. With a = b the mechanism
is singular at θ = ±π/2, where the slider passes the crank's centre; with a ≠ b it is never singular. Driven
by 100 N m on the crank, from rest at θ = 0; the paper gives neither inertias nor the start; they are chosen
here.
"""

from __future__ import annotations

import math

from mbref.scene import Moment, Revolute, Scene, Spherical, Translational
from mbref.scenes.links import DENSITY, about_z, link, rod_inertia, slider

X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
TORQUE = (0.0, 0.0, 100.0)  # N m
FLYWHEEL = 104.125  # kg m², puts the first singular position at 1.81 s, as in the paper


def planar_slider_crank(a: float = 0.304, b: float = 0.4048, name: str = "planar_slider_crank") -> Scene:
    """Return the mechanism under 100 N m on the crank, from rest at θ = 0; crank a, rod b (m)."""
    return slider_crank(a, b, 0.0, name).with_(load=(Moment(body="crank", moment=TORQUE),), duration=0.4)


def planar_slider_crank_equal(name: str = "planar_slider_crank_equal") -> Scene:
    """Return the mechanism with crank and rod of 0.308 m, which passes singular positions at θ = ±π/2."""
    return planar_slider_crank(0.308, 0.308, name).with_(duration=0.2)


def planar_slider_crank_heavy(name: str = "planar_slider_crank_heavy") -> Scene:
    """Return the mechanism with a = b = 0.308 m and a flywheel on the crank: 61 singular positions in 20
    s."""
    length = 0.308
    base = planar_slider_crank(length, length, name)
    along, across, _ = rod_inertia(DENSITY * length, length)
    inertia = (along + FLYWHEEL / 2, across + FLYWHEEL / 2, across + FLYWHEEL)
    crank = base.body[0].model_copy(update={"inertia": inertia})
    return base.with_(body=(crank, *base.body[1:]), duration=20.0)


def planar_slider_crank_gravity(name: str = "planar_slider_crank_gravity") -> Scene:
    """Return the mechanism under gravity along -y, from θ = 0.3 at 30 rad/s."""
    return slider_crank(0.304, 0.4048, 0.3, name, rate=30.0).with_(gravity=(0.0, -9.81, 0.0), duration=1.0)


def slider_crank(
    a: float, b: float, theta0: float, name: str, rate: float | None = None, suffix: str = "", z: float = 0.0
) -> Scene:
    """Return the mechanism without load: crank a and rod b (m) from θ = theta0 (rad) at ``rate`` (rad/s), in
    the plane at z."""
    phi = -math.asin(a * math.sin(theta0) / b)
    pin = (a * math.cos(theta0), a * math.sin(theta0), z)
    end = (pin[0] + b * math.cos(phi), 0.0, z)
    origin = (0.0, 0.0, z)
    moving = {} if rate is None else {"angular_velocity": (0.0, 0.0, rate)}
    crank, rod, piston = (part + suffix for part in ("crank", "rod", "slider"))
    return Scene(
        name=name,
        body=(
            link(crank, origin, pin, about_z(theta0), a, **moving),
            link(rod, pin, end, about_z(phi), b),
            slider(end, piston),
        ),
        joint=(
            Revolute(name=f"A{suffix}", bodies=("ground", crank), anchor=origin, axis=Z),
            Revolute(name=f"B{suffix}", bodies=(crank, rod), anchor=pin, axis=Z),
            Spherical(name=f"C{suffix}", bodies=(rod, piston), anchor=end),
            Translational(name=f"D{suffix}", bodies=("ground", piston), anchor=end, axis=X),
        ),
    )
