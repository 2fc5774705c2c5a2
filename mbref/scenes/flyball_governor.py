"""IFToMM A05, the stiff flyball governor: a shaft, two arms with balls, a slider on stiff damped springs.

Shaft and rods 1 m x 0.01 m x 0.01 m, slider a cube of 0.1 m, all of 3000 kg/m³; balls are points of 5 kg at
the rods' ends.  The shaft turns at 2π rad/s about z, gravity along -z (González et al., Multibody System
Dynamics 16, 2006).
"""

from __future__ import annotations

import math

from mbref.scene import Body, Joint, Revolute, Scene, Spring, Translational

Triple = tuple[float, float, float]
DENSITY, LENGTH, SIDE, CUBE, BALL = 3000.0, 1.0, 0.01, 0.1, 5.0  # kg/m³, m, m, m, kg
OFFSET, TOP, HEIGHT, SLOPE = 0.05, 1.0, 0.5, math.radians(30)  # m, m, m, rad below the horizontal
STIFFNESS, DAMPING, NATURAL_LENGTH = 8.0e5, 4.0e4, 0.5  # N/m, N s/m, m
SPIN = 2 * math.pi  # rad/s
Z = (0.0, 0.0, 1.0)


def flyball_governor() -> Scene:
    """Return the governor in the published position; all parts turn with the shaft."""
    mass = DENSITY * LENGTH * SIDE**2
    across, about = mass * (LENGTH**2 + SIDE**2) / 12, mass * SIDE**2 / 6
    shaft = _part("shaft", mass, (across, across, about), (0.0, 0.0, LENGTH / 2))
    cube = DENSITY * CUBE**3
    slider = _part("slider", cube, (cube * CUBE**2 / 6,) * 3, (0.0, 0.0, HEIGHT))
    arms = [_arm(side, mass, across, about) for side in (1.0, -1.0)]
    joints: list[Joint] = [
        Revolute(name="bearing", bodies=("ground", "shaft"), anchor=(0.0, 0.0, 0.0), axis=Z),
        Translational(name="slide", bodies=("shaft", "slider"), anchor=(0.0, 0.0, HEIGHT), axis=Z),
        *(_hinge(side) for side in (1.0, -1.0)),
    ]
    return Scene(
        name="flyball_governor",
        gravity=(0.0, 0.0, -9.81),
        duration=10.0,
        body=(shaft, slider, *arms),
        joint=tuple(joints),
        load=(_spring(1.0), _spring(-1.0)),
    )


def _part(
    name: str,
    mass: float,
    inertia: Triple,
    position: Triple,
    orientation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
) -> Body:
    """Return a body that turns with the shaft."""
    velocity = (-SPIN * position[1], SPIN * position[0], 0.0)
    return Body(
        name=name,
        mass=mass,
        inertia=inertia,
        position=position,
        orientation=orientation,
        velocity=velocity,
        angular_velocity=(0.0, 0.0, SPIN),
    )


def _arm(side: float, rod: float, across: float, about: float) -> Body:
    """Return a rod with its ball, x outwards along it; the centre of mass is near the ball."""
    mass = rod + BALL
    reach = (rod * LENGTH / 2 + BALL * LENGTH) / mass
    across = across + rod * (reach - LENGTH / 2) ** 2 + BALL * (LENGTH - reach) ** 2
    tilt = SLOPE if side > 0 else math.pi - SLOPE
    turn = (math.cos(tilt / 2), 0.0, math.sin(tilt / 2), 0.0)
    return _part(_name(side), mass, (about, across, across), _along(side, reach), turn)


def _along(side: float, reach: float) -> Triple:
    return side * (OFFSET + reach * math.cos(SLOPE)), 0.0, TOP - reach * math.sin(SLOPE)


def _hinge(side: float) -> Revolute:
    pair = ("shaft", _name(side))
    return Revolute(name=f"hinge_{_name(side)}", bodies=pair, anchor=_along(side, 0.0), axis=(0.0, 1.0, 0.0))


def _spring(side: float) -> Spring:
    ends = (_along(side, LENGTH / 2), (side * OFFSET, 0.0, HEIGHT))
    return Spring(
        bodies=(_name(side), "slider"),
        points=ends,
        stiffness=STIFFNESS,
        damping=DAMPING,
        natural_length=NATURAL_LENGTH,
    )


def _name(side: float) -> str:
    return "right" if side > 0 else "left"
