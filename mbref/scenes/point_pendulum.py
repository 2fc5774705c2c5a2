"""IFToMM A01, the simple pendulum: a point mass of 1 kg on a massless bar of 1 m.

Released from the horizontal at (-1, 0), gravity along -y, 10 s (Multibody System Dynamics 16, 2006, 121–142).
"""

from __future__ import annotations

from mbref.scene import Body, Revolute, Scene


def point_pendulum() -> Scene:
    """Return the pendulum as published; a point has no moment of inertia."""
    mass = Body(name="mass", mass=1.0, inertia=(0.0, 0.0, 0.0), position=(-1.0, 0.0, 0.0))
    pivot = Revolute(name="pivot", bodies=("ground", "mass"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    return Scene(
        name="point_pendulum", gravity=(0.0, -9.81, 0.0), duration=10.0, body=(mass,), joint=(pivot,)
    )
