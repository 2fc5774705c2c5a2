"""IFToMM A03, Andrews' squeezing mechanism: seven links in a plane, three loops, one degree of freedom.

Data of the Bari/CWI test set of initial value problems (W. Schiehlen, ed., Multibody Systems Handbook, 1990;
Hairer and Wanner, Solving Ordinary Differential Equations II, VI.9).  A motor turns K1 with a constant
moment; no gravity.  Link K1 turns about O, K3 about B, K5 and K7 about A; K2, K3, K4 and K6 meet at E. The
centres of mass of K3, K5 and K7 are known by their distances from the pivots; the side of a centre of mass
does not affect the motion.  All joints are revolute, so that three loops have nine redundant rows.
"""

from __future__ import annotations

import math

from mbref.scene import Body, Moment, Revolute, Scene, Spring
from mbref.scenes.links import about_z

A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)  # m
MASS = (0.04325, 0.00365, 0.02373, 0.00706, 0.0705, 0.00706, 0.05498)  # kg
MOMENT = (2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)  # kg m² about z
RR, RA, D, DA, E, EA = 0.007, 0.00092, 0.028, 0.0115, 0.02, 0.01421
SS, SA, SB, SC, SD = 0.035, 0.01874, 0.01043, 0.018, 0.02
ZT, TA, TB, U, UA, UB, ZF, FA = 0.04, 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.01421
STIFFNESS, NATURAL_LENGTH, MOTOR = 4530.0, 0.07785, 0.033  # N/m, m, N m
BETA, THETA, GAMMA = -0.0617138900142764496358948458001, 0.0, 0.455279819163070380255912382449
PHI, DELTA = 0.222668390165885884674473185609, 0.487364979543842550225598953530
OMEGA, EPSILON = -0.222668390165885884674473185609, 1.23054744454982119249735015568
ANGLES = (BETA, BETA + THETA, GAMMA, PHI + DELTA, DELTA, OMEGA + EPSILON, EPSILON)  # rad, at t = 0
Z = (0.0, 0.0, 1.0)


def andrews_squeezer() -> Scene:
    """Return the mechanism at rest in the published position, for 0.03 s; the links' frames are rotated by
    their angles."""
    k1, k2, k3, k4, k5, k6, k7 = ANGLES
    f = _on((0.0, 0.0), k1, RR)
    e = _on(f, k2, -D)
    g, h = _on(A, k5, ZT), _on(A, k7, 0.0, -U)
    centres = (
        _on((0.0, 0.0), k1, RA),
        _on(f, k2, -DA),
        _on(B, k3, SB, -SA),
        _on(g, k4, 0.0, EA - E),
        _on(A, k5, TA, TB),
        _on(h, k6, ZF - FA),
        _on(A, k7, UB, -UA),
    )
    bodies = [
        Body(name=f"K{n}", mass=m, inertia=(i / 2, i / 2, i), position=(*centre, 0.0), orientation=about_z(k))
        for n, m, i, centre, k in zip(range(1, 8), MASS, MOMENT, centres, ANGLES, strict=True)
    ]
    hinges = (
        ("O", "ground", "K1", (0.0, 0.0)),
        ("F", "K1", "K2", f),
        ("B", "ground", "K3", B),
        ("A5", "ground", "K5", A),
        ("A7", "ground", "K7", A),
        ("G", "K5", "K4", g),
        ("H", "K7", "K6", h),
        ("E3", "K2", "K3", e),
        ("E4", "K2", "K4", e),
        ("E6", "K2", "K6", e),
    )
    joints = [
        Revolute(name=name, bodies=(first, second), anchor=(*place, 0.0), axis=Z)
        for name, first, second, place in hinges
    ]
    end = _on(B, k3, SD, -SC)
    spring = Spring(
        bodies=("K3", "ground"),
        points=((*end, 0.0), (*C, 0.0)),
        stiffness=STIFFNESS,
        natural_length=NATURAL_LENGTH,
    )
    motor = Moment(body="K1", moment=(0.0, 0.0, MOTOR))
    return Scene(
        name="andrews_squeezer", duration=0.03, body=tuple(bodies), joint=tuple(joints), load=(motor, spring)
    )


def _on(start: tuple[float, float], angle: float, along: float, across: float = 0.0) -> tuple[float, float]:
    """Return a point of a link that is rotated by an angle, relative to the link's first end."""
    c, s = math.cos(angle), math.sin(angle)
    return start[0] + along * c - across * s, start[1] + along * s + across * c
