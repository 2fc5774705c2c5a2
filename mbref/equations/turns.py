"""Directions of a body that the three turns of a driven orientation turn, with both rates.

A driver of a ball joint prescribes R(t) = R₁ R₂ R₃ with turns Rₖ by the angle qₖ(t) about axes aₖ, in the
frame of body i. The orientation of body j follows from three dot-1 constraints (A_i R e)·(A_j f) = 0 for
perpendicular directions e and f, which are equal in both bodies at t = 0.  For a vector v of an inner turn,

    u = R v,  u' = R v' + q' a × u,  u'' = R v'' + 2 q' a × (R v') + q'' a × u + q'² a × (a × u)
"""

from __future__ import annotations

from numpy import cos, sin

from mbref.equations.functions import function_value
from mbref.kernels.compilation import kernel
from mbref.kernels.scene_layout import TURN_1
from mbref.linear_algebra.vectors import add, cross, dot, scale, vector

NO_RATE = (0.0, 0.0, 0.0)


@kernel
def rotated(axis, c, s, v):
    """Return v, rotated about a unit axis by the angle of cosine c and sine s."""
    return add(add(scale(c, v), scale(s, cross(axis, v))), scale((1.0 - c) * dot(axis, v), axis))


@kernel
def oriented_direction(p, t, equations):
    """Return the direction of primitive p on the first body, turned by all turns of its driver, with both
    rates."""
    primitives = equations.scene.primitives
    first = p - (primitives.kind[p] - TURN_1)
    u, u_rate, u_second = vector(primitives.direction_first, p), NO_RATE, NO_RATE
    for turn in range(first + 2, first - 1, -1):
        axis = vector(primitives.turning_first, turn)
        value, rate, second = function_value(primitives.driver[turn], t, equations)
        c, s = cos(value), sin(value)
        u, moved, bent = rotated(axis, c, s, u), rotated(axis, c, s, u_rate), rotated(axis, c, s, u_second)
        across = cross(axis, u)
        u_second = add(bent, scale(2.0 * rate, cross(axis, moved)))
        u_second = add(u_second, add(scale(second, across), scale(rate * rate, cross(axis, across))))
        u_rate = add(moved, scale(rate, across))
    return u, u_rate, u_second
