"""N four-bars in a row, a benchmark of scaling: N + 1 uprights on the ground, N bars across their tops.

Links of 1 m and 1 kg; uprights from (i, 0) to (i, 1), bars from (i, 1) to (i + 1, 1), gravity along -y. Every
upright starts vertical and turns at -1 rad/s; the bars stay level, so the motion is a pendulum's: θ'' = W sin
θ with θ from the vertical, W = (g/L) ((N + 1)/2 + N) / ((N + 1)/3 + N). Joints as in the four-bar: 12 N + 6
coordinates, 13 N + 5 rows, N of them redundant, one degree of freedom; singular at θ = ±π/2, with all links
on one line, where the rank drops by N. N = 2 is the double four-bar of the IFToMM library, N = 40 problem A02
of González et al., Multibody System Dynamics 16, 2006; the moment of inertia about a link's own axis is
chosen here; no link turns about this axis.
"""

from __future__ import annotations

import math

from mbref.scene import Body, Joint, Revolute, Scene, Universal
from mbref.scenes.links import about_z

Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
INERTIA = (1e-3, 1 / 12, 1 / 12)  # kg m² about the link and across it


def four_bar_chain(loops: int = 2, name: str = "four_bar_chain") -> Scene:
    """Return a chain of loops in the upright position, moving at -1 rad/s."""
    upright, level = about_z(math.pi / 2), about_z(0.0)
    bodies = [_upright(i, upright) for i in range(loops + 1)]
    bodies += [
        Body(name=f"bar{i}", mass=1.0, inertia=INERTIA, position=(i - 0.5, 1.0, 0.0), orientation=level)
        for i in range(1, loops + 1)
    ]
    joints: list[Joint] = [
        Revolute(name=f"A{i}", bodies=("ground", f"upright{i}"), anchor=(float(i), 0.0, 0.0), axis=Z)
        for i in range(loops + 1)
    ]
    for i in range(1, loops + 1):
        left, right = (i - 1.0, 1.0, 0.0), (float(i), 1.0, 0.0)
        joints += [
            Universal(name=f"B{i}", bodies=(f"upright{i - 1}", f"bar{i}"), anchor=left, axes=(Z, Y)),
            Universal(name=f"C{i}", bodies=(f"bar{i}", f"upright{i}"), anchor=right, axes=(Y, Z)),
        ]
    return Scene(name=name, gravity=(0.0, -9.81, 0.0), duration=0.5, body=tuple(bodies), joint=tuple(joints))


def _upright(i: int, orientation: tuple[float, float, float, float]) -> Body:
    return Body(
        name=f"upright{i}",
        mass=1.0,
        inertia=INERTIA,
        position=(float(i), 0.5, 0.0),
        orientation=orientation,
        angular_velocity=(0.0, 0.0, -1.0),
    )
