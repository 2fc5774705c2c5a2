"""A frame on two hinges of one axis with a mass fixed off its centre: reactions that are not unique.

Two bodies, two revolutes, one fixed joint: minus four degrees of freedom by Kutzbach's count, one degree of
freedom in fact, five redundant rows.  A commercial program that drops one of the hinges' rows reports
one-sided reactions.  Sizes and inertias are chosen here.
"""

from __future__ import annotations

from mbref.scene import Body, Fixed, Revolute, Scene

WIDTH, ARM = 1.0, 0.4  # m between the hinges, m from their axis to the frame's centre


def h_frame() -> Scene:
    """Return the frame at rest in the level position, gravity along -z, the hinges along y."""
    frame = Body(name="frame", mass=2.0, inertia=(0.2, 0.05, 0.24), position=(ARM, 0.0, 0.0))
    block = Body(name="block", mass=5.0, inertia=(0.02, 0.02, 0.02), position=(2 * ARM, WIDTH / 4, 0.0))
    joints = (
        Revolute(name="left", bodies=("ground", "frame"), anchor=(0.0, WIDTH / 2, 0.0), axis=(0.0, 1.0, 0.0)),
        Revolute(
            name="right", bodies=("ground", "frame"), anchor=(0.0, -WIDTH / 2, 0.0), axis=(0.0, 1.0, 0.0)
        ),
        Fixed(name="bolt", bodies=("frame", "block"), anchor=(2 * ARM, WIDTH / 4, 0.0)),
    )
    return Scene(name="h_frame", gravity=(0.0, 0.0, -9.81), duration=1.0, body=(frame, block), joint=joints)
