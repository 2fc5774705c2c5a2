"""The heavy top: a disc on a ball joint, fast spin; the standard test of rotation parametrisations.

Brüls, Cardona and Arnold, Mechanism and Machine Theory 48, 2012, 121–137; Terze, Müller and Zlatar,
Multibody System Dynamics 38, 2016.  Centre of mass 1 m from the fixed point, spin 150 rad/s about that line.
"""

from __future__ import annotations

from mbref.scene import Body, Scene, Spherical


def heavy_top() -> Scene:
    """Return the top in the published position, for 2 s; the velocity of its centre of mass follows from the
    joint."""
    top = Body(
        name="top",
        mass=15.0,
        inertia=(0.234375, 0.46875, 0.234375),
        position=(0.0, 1.0, 0.0),
        angular_velocity=(0.0, 150.0, -4.61538),
    )
    joint = Spherical(name="tip", bodies=("ground", "top"), anchor=(0.0, 0.0, 0.0))
    return Scene(name="heavy_top", gravity=(0.0, 0.0, -9.81), duration=2.0, body=(top,), joint=(joint,))
