"""Scenes with couplings and an armature whose exact motions are formulas of this module."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.special import ellipj

from crosscheck.conformance.mechanisms.closed_forms import Exact
from mbref import rotations
from mbref.scene import Body, Coupling, Cylindrical, Joint, Moment, Revolute, Scene, Translational

ORIGIN, Y, Z = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN, G, DURATION = (0.0, -9.81, 0.0), 9.81, 0.5


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
    rate, k = math.sqrt(mass * G * arm / (inertia + mass * arm**2 + armature)), math.sin(math.pi / 4)

    def exact(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        _, cn, dn, _ = ellipj(rate * t, k**2)
        turned = 2 * np.arcsin(k * cn / dn) - math.pi / 2
        orientation = _about_z(turned)
        return rotations.rotate(orientation, np.array(place)), orientation

    return scene, exact


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


GEARED: tuple[Callable[[], tuple[Scene, Exact]], ...] = (gear_pair, rack, screw, armature_pendulum)
