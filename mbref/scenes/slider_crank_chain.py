"""N slider-cranks on one crankshaft, the in-line engine as a benchmark of scaling.

The planar slider-crank (crank 0.304 m, rod 0.4048 m) side by side along z, 0.1 m apart; each crank is fixed
to its neighbour a third of a turn ahead and has its own bearing.  Under gravity along -y, from θ = 0.3 at 30
rad/s.  18 N coordinates, 24 N - 6 rows, 6 N - 5 of them redundant, one degree of freedom, never singular.
Every further bearing has five redundant rows, every slider-crank has one.
"""

from __future__ import annotations

import math

from mbref.scene import Fixed, Scene
from mbref.scenes.planar_slider_crank import slider_crank

PITCH, PHASE = 0.1, 2 * math.pi / 3


def slider_crank_chain(loops: int = 2, name: str = "slider_crank_chain") -> Scene:
    """Return a chain of slider-cranks."""
    cylinders = [
        slider_crank(0.304, 0.4048, 0.3 + PHASE * i, name, 30.0, suffix=str(i), z=PITCH * i)
        for i in range(1, loops + 1)
    ]
    shaft = tuple(
        Fixed(name=f"E{i}", bodies=(f"crank{i}", f"crank{i + 1}"), anchor=(0.0, 0.0, PITCH * i))
        for i in range(1, loops)
    )
    return Scene(
        name=name,
        gravity=(0.0, -9.81, 0.0),
        duration=0.2,
        body=tuple(body for cylinder in cylinders for body in cylinder.body),
        joint=tuple(joint for cylinder in cylinders for joint in cylinder.joint) + shaft,
    )
