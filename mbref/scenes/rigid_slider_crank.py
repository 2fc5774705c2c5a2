"""The spatial rigid slider-crank of the IFToMM library: four kinds of joint, no redundancy.

Haug, Computer-Aided Kinematics and Dynamics of Mechanical Systems, 1989, section 12.2.  Crank of
0.08 m about x at (0, 0.1, 0.12), at first along z; rod of 0.3 m; slider on the x axis.  The data leave open
where the crank's centre of mass is: at the pivot in one reading, in the middle of the crank in the other.
"""

from __future__ import annotations

import math

import numpy as np

from mbref import rotations
from mbref.scene import Body, Revolute, Scene, Spherical, Translational, Universal

PIVOT, CRANK, ROD, SPIN = (0.0, 0.1, 0.12), 0.08, 0.3, 6.0  # m, m, m, rad/s
X = (1.0, 0.0, 0.0)


def rigid_slider_crank(middle: bool = False, name: str = "rigid_slider_crank") -> Scene:
    """Return the mechanism with the crank upright at 6 rad/s; the crank's centre of mass is at the pivot or
    in its middle."""
    pin = (0.0, PIVOT[1], PIVOT[2] + CRANK)
    end = (math.sqrt(ROD**2 - pin[1] ** 2 - pin[2] ** 2), 0.0, 0.0)
    centre = (0.0, PIVOT[1], PIVOT[2] + CRANK / 2) if middle else PIVOT
    crank = Body(
        name="crank",
        mass=0.12,
        inertia=(1e-4, 1e-4, 1e-5),
        position=centre,
        angular_velocity=(SPIN, 0.0, 0.0),
    )
    along = (np.array(end) - pin) / ROD
    across = np.cross(along, X) / np.linalg.norm(np.cross(along, X))
    frame = np.column_stack([along, across, np.cross(along, across)])
    rod = Body(
        name="rod",
        mass=0.5,
        inertia=(4e-4, 4e-3, 4e-3),
        position=tuple((np.array(end) + pin) / 2),
        orientation=tuple(rotations.from_matrix(frame).tolist()),
    )
    slider = Body(name="slider", mass=2.0, inertia=(1e-4, 1e-4, 1e-4), position=end)
    joints = (
        Revolute(name="A", bodies=("ground", "crank"), anchor=PIVOT, axis=X),
        Spherical(name="B", bodies=("crank", "rod"), anchor=pin),
        Universal(name="C", bodies=("slider", "rod"), anchor=end, axes=(X, tuple(across.tolist()))),
        Translational(name="D", bodies=("ground", "slider"), anchor=end, axis=X),
    )
    return Scene(name=name, gravity=(0.0, 0.0, -9.81), duration=5.0, body=(crank, rod, slider), joint=joints)
