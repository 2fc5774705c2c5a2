"""Sarrus's linkage: two folding pairs of bars in perpendicular planes guide a platform along a line.

P. F. Sarrus, Comptes rendus 36, 1853.  Six hinges, five bodies, one degree of freedom, although Kutzbach's
count gives none. Sizes and inertias are chosen here: bars of 0.5 m and 0.5 kg, a platform of 1 kg, gravity
along -z.
"""

from __future__ import annotations

import math

from mbref.scene import Body, Revolute, Scene
from mbref.scenes.links import Point, midpoint, rod_inertia

HALF, LENGTH, MASS, SLOPE = 0.2, 0.5, 0.5, math.radians(60)  # m, m, kg, rad; SLOPE at t = 0
PLATFORM, MOMENT = 1.0, 0.01  # kg, kg m²


def sarrus() -> Scene:
    """Return the linkage at rest, with the bars at 60 degrees to the ground."""
    rise, reach = LENGTH * math.sin(SLOPE), LENGTH * math.cos(SLOPE)
    platform = Body(name="platform", mass=PLATFORM, inertia=(MOMENT,) * 3, position=(0.0, 0.0, 2 * rise))
    bodies, joints = [platform], []
    for side, turn in (("x", 0.0), ("y", math.pi / 2)):
        c, s = math.cos(turn), math.sin(turn)
        feet = [(HALF, 0.0), (HALF + reach, rise), (HALF, 2 * rise)]
        points = [(c * r, s * r, z) for r, z in feet]
        names = ("ground", f"lower_{side}", f"upper_{side}", "platform")
        for n, tilt in ((0, -SLOPE), (1, SLOPE - math.pi)):
            bodies.append(_bar(names[n + 1], midpoint(points[n], points[n + 1]), turn, tilt))
        joints += [
            Revolute(name=f"{side}{n}", bodies=(names[n], names[n + 1]), anchor=point, axis=(-s, c, 0.0))
            for n, point in enumerate(points)
        ]
    return Scene(
        name="sarrus", gravity=(0.0, 0.0, -9.81), duration=0.3, body=tuple(bodies), joint=tuple(joints)
    )


def _bar(name: str, middle: Point, turn: float, tilt: float) -> Body:
    """Return a bar along its x axis, turned about z and then tilted about its own y."""
    ct, st, c, s = math.cos(turn / 2), math.sin(turn / 2), math.cos(tilt / 2), math.sin(tilt / 2)
    orientation = (ct * c, -st * s, ct * s, st * c)
    return Body(
        name=name, mass=MASS, inertia=rod_inertia(MASS, LENGTH), position=middle, orientation=orientation
    )
