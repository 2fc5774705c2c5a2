"""Scenes whose exact motions are formulas of this module, as a second source of exact motions besides
crosscheck's judge."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np
from scipy.special import ellipj

from mbref import rotations
from mbref.scene import (
    Body,
    Driver,
    Revolute,
    Scene,
    Sine,
    Spring,
    TorsionSpring,
    Translational,
)

Exact = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # times (k,) → positions, orientations

ORIGIN, X, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
DOWN = (0.0, -9.81, 0.0)
MASS, MOMENT, ARM = 2.0, 0.03, 0.4  # kg, kg m² about z, m from the axis to the centre of mass


def free_fall() -> tuple[Scene, Exact]:
    """Return a thrown body that spins about its z axis: p + v t + g t²/2, rotation angle w t."""
    place, velocity, spin = (0.1, 0.2, 0.0), (1.0, 3.0, 0.0), 2.0
    thrown = _body(place).model_copy(update={"velocity": velocity, "angular_velocity": (0.0, 0.0, spin)})
    scene = Scene(name="free_fall", gravity=DOWN, duration=0.5, body=(thrown,))

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        fallen = np.outer(t, velocity) + np.outer(t**2 / 2, DOWN) + place
        return fallen[:, None], _about_z(spin * t)

    return scene, exact


def pendulum() -> tuple[Scene, Exact]:
    """Return a physical pendulum released at 1.2 rad: sin(θ/2) = sin(θ₀/2) cd(ω t), Jacobi's elliptic
    function."""
    released = 1.2
    place = (ARM * math.sin(released), -ARM * math.cos(released), 0.0)
    joint = Revolute(name="pivot", bodies=("ground", "body"), anchor=ORIGIN, axis=Z)
    scene = Scene(name="pendulum", gravity=DOWN, duration=0.8, body=(_body(place),), joint=(joint,))
    rate = math.sqrt(MASS * 9.81 * ARM / (MOMENT + MASS * ARM**2))
    k = math.sin(released / 2)

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        _, cn, dn, _ = ellipj(rate * t, k**2)
        return _swung(2 * np.arcsin(k * cn / dn) - released, place)

    return scene, exact


def oscillator() -> tuple[Scene, Exact]:
    """Return a mass with a spring and a damper that slides along x."""
    stiffness, damping, length, start = 50.0, 3.0, 0.5, 0.8
    joint = Translational(name="slide", bodies=("ground", "body"), anchor=ORIGIN, axis=X)
    place = (start, 0.0, 0.0)
    spring = Spring(
        bodies=("ground", "body"),
        points=(ORIGIN, place),
        stiffness=stiffness,
        damping=damping,
        natural_length=length,
    )
    scene = Scene(name="oscillator", duration=0.8, body=(_body(place),), joint=(joint,), load=(spring,))

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = length + (start - length) * _decay(t, stiffness / MASS, damping / MASS)
        return np.outer(x, X)[:, None], _about_z(0 * t)

    return scene, exact


def torsion() -> tuple[Scene, Exact]:
    """Return a body on a revolute joint with a torsion spring and damper, its centre off the axis, without
    gravity."""
    stiffness, damping, natural = 6.0, 0.2, 0.9
    place = (ARM, 0.0, 0.0)
    joint = Revolute(name="pivot", bodies=("ground", "body"), anchor=ORIGIN, axis=Z)
    spring = TorsionSpring(joint="pivot", stiffness=stiffness, damping=damping, natural_angle=natural)
    scene = Scene(name="torsion", duration=0.8, body=(_body(place),), joint=(joint,), load=(spring,))
    about = MOMENT + MASS * ARM**2

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(natural * (1 - _decay(t, stiffness / about, damping / about)), place)

    return scene, exact


def driven() -> tuple[Scene, Exact]:
    """Return a body whose angle is prescribed by a driver."""
    driver = Driver(joint="pivot", polynomial=(0.0, 1.0, -0.5), sine=Sine(amplitude=0.3, frequency=5.0))
    place = (ARM, 0.0, 0.0)
    joint = Revolute(name="pivot", bodies=("ground", "body"), anchor=ORIGIN, axis=Z)
    scene = Scene(
        name="driven", gravity=DOWN, duration=0.8, body=(_body(place),), joint=(joint,), driver=(driver,)
    )

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(t - 0.5 * t**2 + 0.3 * np.sin(5.0 * t), place)

    return scene, exact


def turntable() -> tuple[Scene, Exact]:
    """Return a body with its centre off a vertical axis, driven at constant angular acceleration: the
    driver's moment is constant."""
    driver = Driver(joint="pivot", polynomial=(0.0, 1.5, 2.0))
    place = (ARM, 0.0, 0.0)
    joint = Revolute(name="pivot", bodies=("ground", "body"), anchor=ORIGIN, axis=Z)
    scene = Scene(
        name="turntable",
        gravity=(0.0, 0.0, -9.81),
        duration=0.8,
        body=(_body(place),),
        joint=(joint,),
        driver=(driver,),
    )

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(1.5 * t + 2.0 * t**2, place)

    return scene, exact


CLOSED_FORMS = (free_fall, pendulum, oscillator, torsion, driven, turntable)


def _body(place: tuple[float, float, float]) -> Body:
    return Body(name="body", mass=MASS, inertia=(0.01, 0.025, MOMENT), position=place)


def _decay(t: np.ndarray, stiffness: float, damping: float) -> np.ndarray:
    """Return the solution y (k,) of y'' = -stiffness y - damping y' with y(0) = 1 and y'(0) = 0."""
    root = cmath.sqrt(damping**2 / 4 - stiffness)
    a, b = -damping / 2 + root, -damping / 2 - root
    return np.real((a * np.exp(b * t) - b * np.exp(a * t)) / (a - b))


def _about_z(angle: np.ndarray) -> np.ndarray:
    """Return orientations (k, 1, 4) rotated about z by the given angles."""
    return rotations.from_vector(np.outer(angle, Z))[:, None]


def _swung(angle: np.ndarray, place: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of a body that turns about the z axis through the origin and starts at ``place``."""
    turned = _about_z(angle)
    return rotations.rotate(turned, np.array(place)), turned
