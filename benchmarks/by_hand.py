"""The paper's mechanisms as equations of one degree of freedom, I θ'' + ½ I' θ'² = Q, derived by hand.

Each is a function of the signature that mbref's integrators take, with y = (θ, θ'), θ the crank's angle and
I' = dI/dθ; ``memory.numbers`` holds its numbers.  Driven mechanisms need no equation of motion. The kernels
``…_poses`` write their poses in closed form: position and rotation matrix (12 numbers) of every body.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy import cos, sin, sqrt

from mbref.kernels.compilation import OPTIONS
from mbref.kernels.layout import OK
from mbref.scene import Scene

AS_MBREF = {**OPTIONS, "cache": False}  # how mbref's kernels are compiled


class ByHand(NamedTuple):
    """The numbers of a scene, with its equation of motion if the scene is free, or its poses if it is
    driven."""

    numbers: Callable[[Scene], list[float]]
    equation: Callable | None
    poses: Callable | None


@njit(**AS_MBREF)
def swing(t, y, y_rate, memory):
    """Parallelogram under gravity: I and the first moment of mass do not change."""
    p = memory.numbers
    inertia, moment = p[0], p[1]
    y_rate[0] = y[1]
    y_rate[1] = -moment * cos(y[0]) / inertia
    return OK


def swing_numbers(scene: Scene) -> list[float]:
    length, g = _crank_length(scene), -scene.gravity[1]
    arms = [length / 2, length, length / 2, length / 2][: len(scene.body)]  # crank, coupler, rocker, bar
    turning = [1, 0, 1, 0]
    bodies = list(zip(scene.body, arms, turning, strict=False))
    inertia = sum(body.mass * arm**2 + turns * body.inertia[2] for body, arm, turns in bodies)
    return [inertia, g * sum(body.mass * arm for body, arm, _ in bodies)]


@njit(**AS_MBREF)
def planar(t, y, y_rate, memory):
    """Slider-crank in a plane; phi is the rod's angle, s = dphi/dθ, and c is the derivative of s."""
    p = memory.numbers
    a, b, crank, rod, spin = p[0], p[1], p[2], p[3], p[4]
    slider, torque, first, weight = p[5], p[6], p[7], p[8]
    sine, cosine = sin(y[0]), cos(y[0])
    low = -a * sine / b
    across = sqrt(1.0 - low * low)
    s = -a * cosine / (b * across)
    c = (a * sine / b + low * s * s) / across
    x1, y1 = -a * sine - 0.5 * b * low * s, a * cosine + 0.5 * b * across * s
    x2 = -a * cosine - 0.5 * b * (across * s * s + low * c)
    y2 = -a * sine + 0.5 * b * (across * c - low * s * s)
    u1, u2 = -a * sine - b * low * s, -a * cosine - b * (across * s * s + low * c)
    inertia = crank + rod * (x1 * x1 + y1 * y1) + spin * s * s + slider * u1 * u1
    half_slope = rod * (x1 * x2 + y1 * y2) + spin * s * c + slider * u1 * u2
    y_rate[0] = y[1]
    y_rate[1] = (torque - first * cosine - weight * y1 - half_slope * y[1] * y[1]) / inertia
    return OK


@njit(**AS_MBREF)
def planar_equal(t, y, y_rate, memory):
    """Slider-crank, crank and rod of equal length: the rod's angle is -θ, the slider's place 2 a cos θ."""
    p = memory.numbers
    a, crank, rod, spin = p[0], p[2], p[3], p[4]
    slider, torque, first, weight = p[5], p[6], p[7], p[8]
    sine, cosine = sin(y[0]), cos(y[0])
    inertia = crank + spin + a * a * (rod * (0.25 + 2.0 * sine * sine) + 4.0 * slider * sine * sine)
    half_slope = a * a * (2.0 * rod + 4.0 * slider) * sine * cosine
    y_rate[0] = y[1]
    push = torque - first * cosine - 0.5 * weight * a * cosine
    y_rate[1] = (push - half_slope * y[1] * y[1]) / inertia
    return OK


def planar_numbers(scene: Scene) -> list[float]:
    crank, rod, slider = scene.body
    a, b, g = _crank_length(scene), _rod_length(scene), -scene.gravity[1]
    torque = sum(load.moment[2] for load in scene.load)
    about_pivot = crank.inertia[2] + crank.mass * a * a / 4
    first, weight = crank.mass * g * a / 2, rod.mass * g
    return [a, b, about_pivot, rod.mass, rod.inertia[2], slider.mass, torque, first, weight]


@njit(**AS_MBREF)
def spatial(t, y, y_rate, memory):
    """Slider-crank in space: h the slider's height, h1 and h2 its derivatives by θ; k the rod's spin
    about itself per crank angle, that keeps its universal joint's axes perpendicular."""
    p = memory.numbers
    r, l, d, crank, across = p[0], p[1], p[2], p[3], p[4]
    along, slider, torque, weight = p[5], p[6], p[7], p[8]
    sine, cosine = sin(y[0]), cos(y[0])
    gap = d * d + r * r - 2.0 * r * d * cosine
    h = sqrt(l * l - gap)
    h1 = -r * d * sine / h
    h2 = -(r * d * cosine + h1 * h1) / h
    n, n1, gap1 = r * r - r * d * cosine, r * d * sine, 2.0 * r * d * sine
    k = h * n / (l * gap)
    k1 = (h1 * n + h * n1) / (l * gap) - k * gap1 / gap
    inertia = crank + across * (r * r + h1 * h1) + slider * h1 * h1 + along * k * k
    half_slope = (across + slider) * h1 * h2 + along * k * k1
    y_rate[0] = y[1]
    y_rate[1] = (torque - weight * h1 - half_slope * y[1] * y[1]) / inertia
    return OK


def spatial_numbers(scene: Scene) -> list[float]:
    crank, rod, slider = scene.body
    r, l, g = _crank_length(scene), _rod_length(scene), -scene.gravity[1]
    torque = sum(load.moment[1] for load in scene.load)
    about_pivot = crank.inertia[1] + crank.mass * r * r / 4
    across = rod.mass / 4 + rod.inertia[1] / l**2  # times |pin' + end'|² or l² |x'|², which are equal
    weight = g * (rod.mass / 2 + slider.mass)
    return [r, l, slider.position[0], about_pivot, across, rod.inertia[0], slider.mass, torque, weight]


@njit(**AS_MBREF)
def parallelogram_poses(thetas, numbers, poses):
    """Crank, coupler, rocker, bar of a rhombus with sides of numbers[0] at angles θ."""
    length = numbers[0]
    poses[:] = 0.0
    for i in range(thetas.shape[0]):
        x, y = length * cos(thetas[i]), length * sin(thetas[i])
        for b in range(poses.shape[1] // 12):
            row = poses[i, 12 * b : 12 * b + 12]
            share = 1.0 if b == 1 else 0.5
            row[0], row[1] = share * x, share * y
            turns = b in (0, 2)
            row[0] += (0.0, 0.5 * length, length, 0.5 * length)[b]
            row[3] = row[7] = x / length if turns else 1.0
            row[6] = y / length if turns else 0.0
            row[4], row[11] = -row[6], 1.0
    return OK


@njit(**AS_MBREF)
def spatial_poses(thetas, numbers, poses):
    """Crank, rod and slider of the spatial slider-crank at angles θ."""
    r, l, d = numbers[:3]
    poses[:] = 0.0
    for i in range(thetas.shape[0]):
        sine, cosine, p = sin(thetas[i]), cos(thetas[i]), poses[i]
        px, pz = r * cosine, -r * sine
        h = sqrt(l * l - (px - d) ** 2 - pz * pz)
        p[0], p[2] = 0.5 * px, 0.5 * pz
        p[3] = p[11] = cosine
        p[5], p[9], p[7] = sine, -sine, 1.0
        p[12], p[13], p[14] = 0.5 * (px + d), 0.5 * h, 0.5 * pz
        x0, x1, x2 = (d - px) / l, h / l, -pz / l  # along the rod; z = x × (0, 1, 0), y = z × x
        size = sqrt(x0 * x0 + x2 * x2)
        z0, z2 = -x2 / size, x0 / size
        p[15], p[18], p[21] = x0, x1, x2
        p[16], p[19], p[22] = -z2 * x1, z2 * x0 - z0 * x2, z0 * x1
        p[17], p[20], p[23] = z0, 0.0, z2
        p[24], p[25] = d, h
        p[27] = p[31] = p[35] = 1.0
    return OK


def _crank_length(scene: Scene) -> float:
    return float(np.linalg.norm(np.subtract(scene.joint[1].anchor, scene.joint[0].anchor)))


def _rod_length(scene: Scene) -> float:
    return float(np.linalg.norm(np.subtract(scene.joint[2].anchor, scene.joint[1].anchor)))


def _length_alone(scene: Scene) -> list[float]:
    return [_crank_length(scene)]


PARALLELOGRAM = ByHand(_length_alone, None, parallelogram_poses)
SWING = ByHand(swing_numbers, swing, None)
PLANAR = ByHand(planar_numbers, planar, None)
PLANAR_EQUAL = ByHand(planar_numbers, planar_equal, None)
SPATIAL = ByHand(spatial_numbers, spatial, None)
BY_HAND = {  # by the scene's name
    "four_bar": PARALLELOGRAM,
    "five_bar": PARALLELOGRAM,
    "four_bar_gravity": SWING,
    "five_bar_gravity": SWING,
    "planar_slider_crank": PLANAR,
    "planar_slider_crank_gravity": PLANAR,
    "planar_slider_crank_equal": PLANAR_EQUAL,
    "planar_slider_crank_heavy": PLANAR_EQUAL,
    "spatial_slider_crank": SPATIAL,
    "spatial_slider_crank_gravity": SPATIAL,
    "spatial_slider_crank_driven": ByHand(spatial_numbers, None, spatial_poses),
}
