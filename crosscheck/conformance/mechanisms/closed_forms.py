"""Scenes whose exact motions are formulas of this module, some with couplings or an armature: a second source
of exact motions besides crosscheck's judge."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np
from scipy.special import ellipj

from mbref import rotations
from mbref.scene import (
    Body,
    Coupling,
    Cylindrical,
    Driver,
    Joint,
    Moment,
    Revolute,
    Scene,
    Sine,
    Spring,
    TorsionSpring,
    Translational,
)

Exact = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # times (k,) → positions, orientations

ORIGIN, X, Y, Z = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN, G, DURATION = (0.0, -9.81, 0.0), 9.81, 0.5
MASS, MOMENT, ARM = 2.0, 0.03, 0.4  # kg, kg m² about z, m from the axis to the centre of mass
BESIDE = (ARM, 0.0, 0.0)  # m, the centre of mass beside the axis
PIVOT = Revolute(name="pivot", bodies=("ground", "body"), anchor=ORIGIN, axis=Z)


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
    scene = Scene(name="pendulum", gravity=DOWN, duration=0.8, body=(_body(place),), joint=(PIVOT,))
    rate = math.sqrt(MASS * G * ARM / (MOMENT + MASS * ARM**2))

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(_from_rest(released, rate * t) - released, place)

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
    spring = TorsionSpring(joint="pivot", stiffness=stiffness, damping=damping, natural_angle=natural)
    scene = Scene(name="torsion", duration=0.8, body=(_body(BESIDE),), joint=(PIVOT,), load=(spring,))
    about = MOMENT + MASS * ARM**2

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(natural * (1 - _decay(t, stiffness / about, damping / about)), BESIDE)

    return scene, exact


def driven() -> tuple[Scene, Exact]:
    """Return a body whose angle is prescribed by a driver."""
    driver = Driver(joint="pivot", polynomial=(0.0, 1.0, -0.5), sine=Sine(amplitude=0.3, frequency=5.0))
    scene = Scene(
        name="driven", gravity=DOWN, duration=0.8, body=(_body(BESIDE),), joint=(PIVOT,), driver=(driver,)
    )

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(t - 0.5 * t**2 + 0.3 * np.sin(5.0 * t), BESIDE)

    return scene, exact


def turntable() -> tuple[Scene, Exact]:
    """Return a body with its centre off a vertical axis, driven at constant angular acceleration: the
    driver's moment is constant."""
    driver = Driver(joint="pivot", polynomial=(0.0, 1.5, 2.0))
    scene = Scene(
        name="turntable",
        gravity=(0.0, 0.0, -9.81),
        duration=0.8,
        body=(_body(BESIDE),),
        joint=(PIVOT,),
        driver=(driver,),
    )

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(1.5 * t + 2.0 * t**2, BESIDE)

    return scene, exact


def gear_pair() -> tuple[Scene, Exact]:
    """Return two wheels that a constant moment turns: q₁'' = M / (I₁ + ratio² I₂)."""
    moment, ratio, first, second = 2.0, -0.5, 0.03, 0.2
    centre = (0.4, 0.1, 0.0)
    scene = _scene(
        "gear pair",
        (_wheel("pinion", ORIGIN, first), _wheel("wheel", centre, second)),
        (_hinge("A", "pinion", ORIGIN), _hinge("B", "wheel", centre)),
        Coupling(name="teeth", joints=("A", "B"), ratio=ratio),
        gravity=ORIGIN,
    ).with_(load=[Moment(body="pinion", moment=(0.0, 0.0, moment))])
    rate = moment / (first + ratio**2 * second)

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned, still = rate * t**2 / 2, np.zeros_like(t)
        return _places(still, ORIGIN, centre), _about_z(turned, ratio * turned)

    return scene, exact


def rack() -> tuple[Scene, Exact]:
    """Return a rack that falls and turns its pinion: x'' = -m g / (m + I / r²)."""
    radius, inertia, mass, place = 0.05, 0.2, 1.5, (0.05, 0.2, 0.0)
    slide = Translational(name="B", bodies=("ground", "rack"), anchor=(radius, 0.0, 0.0), axis=Y)
    scene = _scene(
        "rack",
        (_wheel("pinion", ORIGIN, inertia), _wheel("rack", place, 0.1).model_copy(update={"mass": mass})),
        (_hinge("A", "pinion", ORIGIN), slide),
        Coupling(name="teeth", joints=("A", "B"), ratio=radius),
    )
    rate = -mass * G / (mass + inertia / radius**2)

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        fallen = rate * t**2 / 2
        position = _places(np.zeros_like(t), ORIGIN, place)
        position[:, 1, 1] += fallen
        return position, _about_z(fallen / radius, np.zeros_like(t))

    return scene, exact


def screw() -> tuple[Scene, Exact]:
    """Return a nut that its weight turns down a screw with the lead 2π p: q'' = -m g p / (I + m p²), q the
    angle."""
    lead, inertia, mass = 0.01, 0.02, 2.0
    joint = Cylindrical(name="S", bodies=("ground", "nut"), anchor=ORIGIN, axis=Z)
    thread = Coupling(name="thread", joints=("S", "S"), ratio=lead)
    scene = _scene("screw", (_wheel("nut", ORIGIN, inertia),), (joint,), thread, gravity=(0.0, 0.0, -G))
    rate = -mass * G * lead / (inertia + mass * lead**2)

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = rate * t**2 / 2
        return np.outer(lead * turned, Z)[:, None], _about_z(turned)

    return scene, exact


def armature_pendulum() -> tuple[Scene, Exact]:
    """Return a pendulum on the shaft of a motor, from rest beside its pivot: sin(φ/2) = sin 45° cd(ω t), φ
    measured from below."""
    arm, inertia, mass, armature = 0.5, 0.03, 2.0, 0.3
    joint = _hinge("A", "rod", ORIGIN).model_copy(update={"armature": armature})
    place = (arm, 0.0, 0.0)
    scene = _scene("armature pendulum", (_wheel("rod", place, inertia),), (joint,))
    rate = math.sqrt(mass * G * arm / (inertia + mass * arm**2 + armature))

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _swung(_from_rest(math.pi / 2, rate * t) - math.pi / 2, place)

    return scene, exact


CLOSED_FORMS = (free_fall, pendulum, oscillator, torsion, driven, turntable)
GEARED: tuple[Callable[[], tuple[Scene, Exact]], ...] = (gear_pair, rack, screw, armature_pendulum)


def _body(place: tuple[float, float, float]) -> Body:
    return Body(name="body", mass=MASS, inertia=(0.01, 0.025, MOMENT), position=place)


def _decay(t: np.ndarray, stiffness: float, damping: float) -> np.ndarray:
    """Return the solution y (k,) of y'' = -stiffness y - damping y' with y(0) = 1 and y'(0) = 0."""
    root = cmath.sqrt(damping**2 / 4 - stiffness)
    a, b = -damping / 2 + root, -damping / 2 - root
    return np.real((a * np.exp(b * t) - b * np.exp(a * t)) / (a - b))


def _scene(
    name: str,
    bodies: tuple[Body, ...],
    joints: tuple[Joint, ...],
    *couplings: Coupling,
    gravity: tuple[float, float, float] = DOWN,
) -> Scene:
    return Scene(name=name, gravity=gravity, duration=DURATION, body=bodies, joint=joints, coupling=couplings)


def _wheel(name: str, centre: tuple[float, float, float], moment: float) -> Body:
    return Body(name=name, mass=2.0, inertia=(0.7 * moment, 0.8 * moment, moment), position=centre)


def _hinge(name: str, body: str, anchor: tuple[float, float, float]) -> Revolute:
    return Revolute(name=name, bodies=("ground", body), anchor=anchor, axis=Z)


def _places(still: np.ndarray, *centres: tuple[float, float, float]) -> np.ndarray:
    """Return positions (k, nb, 3) of bodies that stay, for times (k,)."""
    return np.tile(np.array(centres), (len(still), 1, 1))


def _about_z(*angles: np.ndarray) -> np.ndarray:
    """Return orientations (k, nb, 4) of bodies turned about z by angles (k,)."""
    return np.stack([rotations.from_vector(np.outer(angle, Z)) for angle in angles], axis=1)


def _from_rest(released: float, phase: np.ndarray) -> np.ndarray:
    """Return the angles (k,) from below of a pendulum released at an angle, at phases ω t (k,)."""
    k = math.sin(released / 2)
    _, cn, dn, _ = ellipj(phase, k**2)
    return np.asarray(2 * np.arcsin(k * cn / dn))


def _swung(angle: np.ndarray, place: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of a body that turns about the z axis through the origin and starts at ``place``."""
    turned = _about_z(angle)
    return rotations.rotate(turned, np.array(place)), turned
