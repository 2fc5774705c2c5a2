"""IFToMM A04, Bricard's mechanism: five rods of 1 m and 1 kg along the edges of a cube, six hinges.

Kutzbach's count gives no degree of freedom; the mechanism has one. No single row can be named as the
redundant row (González et al., Multibody System Dynamics 16, 2006).  Released from rest, gravity along -y.
Sources differ in the rods' inertia: a cuboid of 1 m x 0.1 m x 0.1 m, or thin, m/12 across and 0 about the
rod.
"""

from __future__ import annotations

import itertools

from mbref.scene import Body, Revolute, Scene
from mbref.scenes.links import midpoint, triple

POINTS = (
    (0.0, 0.0, 0.0),
    (1.0, 0.0, 0.0),
    (1.0, -1.0, 0.0),
    (1.0, -1.0, 1.0),
    (0.0, -1.0, 1.0),
    (0.0, 0.0, 1.0),
)
AXES = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))  # axes of the hinges in their order
SIDE = 0.1  # m, of the square section


def bricard(thin: bool = False, name: str = "bricard") -> Scene:
    """Return the mechanism with rods of square section, or with thin ones."""
    across, about = (1 / 12, 0.0) if thin else ((1 + SIDE**2) / 12, SIDE**2 / 6)
    bodies = []
    for n, (start, end) in enumerate(itertools.pairwise(POINTS), start=1):
        inertia = triple(about if p != q else across for p, q in zip(start, end, strict=True))
        bodies.append(Body(name=f"rod{n}", mass=1.0, inertia=inertia, position=midpoint(start, end)))
    chain = ["ground", *(body.name for body in bodies), "ground"]
    joints = [
        Revolute(name=f"P{n}", bodies=(chain[n], chain[n + 1]), anchor=point, axis=AXES[n % 3])
        for n, point in enumerate(POINTS)
    ]
    return Scene(name=name, gravity=(0.0, -9.81, 0.0), duration=10.0, body=tuple(bodies), joint=tuple(joints))
