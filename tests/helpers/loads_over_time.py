"""Scenes with loads of joints and functions of time, and their closed forms."""

import numpy as np
from numpy.polynomial import Polynomial

from mbref.scene import (
    Body,
    Cylindrical,
    Driver,
    Factor,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Sine,
    SlideSpring,
    TorsionSpring,
    Translational,
)

AXIS = np.array([1.0, 2.0, 2.0]) / 3
MASS, STIFFNESS, DAMPING, REST = 2.0, 50.0, 3.0, 0.2
INERTIA, TORQUE, WAVE = 0.4, 0.7, Sine(amplitude=1.5, frequency=4.0, phase=0.3)
CUBIC = Polynomial([1.0, -2.0, 3.0, -0.8])
TIMES = (0.0, 0.2, 0.7, 1.1, 1.6, 2.3)
TABLE = tuple((t, float(CUBIC(t))) for t in TIMES)  # a spline of a cubic polynomial is that polynomial
WAVY = ((0.0, 0.0), (0.3, 0.8), (0.7, -0.5), (1.1, 0.4), (1.6, 0.2), (2.5, -1.0))


def slide(*loads: object) -> Scene:
    """A block of 2 kg on a slanted slide, without gravity."""
    block = Body(name="block", mass=MASS, inertia=(0.1, 0.2, 0.25), position=(0.3, 0.0, 0.0))
    guide = Translational(name="J", bodies=("ground", "block"), anchor=(0.0, 0.0, 0.0), axis=(1.0, 2.0, 2.0))
    return Scene(name="slide", duration=2.0, body=[block], joint=[guide], load=loads)


def sprung_slide() -> Scene:
    """The block of ``slide`` with a spring and a damper along its slide."""
    return slide(SlideSpring(joint="J", stiffness=STIFFNESS, damping=DAMPING, natural_displacement=REST))


def sprung_displacement(t: np.ndarray) -> np.ndarray:
    """Return the displacement (m) of the block of ``sprung_slide``, a damped oscillator from rest."""
    root, ratio = np.sqrt(STIFFNESS / MASS), DAMPING / 2 / np.sqrt(STIFFNESS * MASS)
    damped = root * np.sqrt(1 - ratio**2)
    swing = np.cos(damped * t) + ratio * root / damped * np.sin(damped * t)
    return np.asarray(REST * (1 - np.exp(-ratio * root * t) * swing))


def pushed(factor: Factor) -> Scene:
    """A block that a force of 2 N times a factor pushes along its slide."""
    return slide(JointForce(joint="J", force=MASS, factor=factor))


def wheel() -> Scene:
    """A wheel on a hinge through its centre that a sinusoidal torque turns."""
    body = Body(name="wheel", mass=1.0, inertia=(0.3, 0.3, INERTIA), position=(0.0, 0.0, 0.0))
    hinge = Revolute(name="J", bodies=("ground", "wheel"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    torque = JointTorque(joint="J", torque=TORQUE, factor=Factor(sine=WAVE))
    return Scene(name="wheel", duration=2.0, body=[body], joint=[hinge], load=[torque])


def turned(t: np.ndarray) -> np.ndarray:
    """Return the angle (rad) of ``wheel``, at rest at the start: φ'' = M A sin(ωt + p) / I."""
    w, phase = WAVE.frequency, WAVE.phase
    rise = np.cos(phase) * t / w - (np.sin(w * t + phase) - np.sin(phase)) / w**2
    return np.asarray(TORQUE * WAVE.amplitude / INERTIA * rise)


def thrown() -> Scene:
    """A free body on which a force through its centre acts from 0.5 s to 1.5 s, by a table of a cubic."""
    body = Body(name="block", mass=MASS, inertia=(0.1, 0.2, 0.25), position=(0.0, 0.0, 0.0))
    factor = Factor(table=TABLE, start=0.5, stop=1.5)
    push = Force(body="block", point=(0.0, 0.0, 0.0), force=tuple(MASS * AXIS), factor=factor)
    return Scene(name="thrown", duration=2.0, body=[body], load=[push])


def switched(t: np.ndarray, start: float = 0.5, stop: float = 1.5, rate: Polynomial = CUBIC) -> np.ndarray:
    """Return the way (m) of a body that a polynomial (m/s²) accelerates from ``start`` to ``stop`` (s)."""
    speed = rate.integ(lbnd=start)
    place = speed.integ(lbnd=start)
    after = place(stop) + speed(stop) * (t - stop)
    return np.asarray(np.where(t < start, 0.0, np.where(t < stop, place(t), after)))


def arm(driver: tuple[Driver, ...] = ()) -> Scene:
    """A slanted arm on a hinge with a cylindrical joint on it, and loads of every kind over time."""
    rod = Body(name="rod", mass=1.0, inertia=(0.1, 0.2, 0.25), position=(0.2, 0.0, 0.0))
    block = Body(name="block", mass=0.7, inertia=(0.02, 0.03, 0.04), position=(0.4, 0.0, 0.1))
    hinge = Revolute(name="R", bodies=("ground", "rod"), anchor=(0.0, 0.0, 0.0), axis=(0.1, 0.2, 1.0))
    tube = Cylindrical(name="C", bodies=("rod", "block"), anchor=(0.3, 0.0, 0.0), axis=(1.0, 0.3, 0.2))
    loads = [
        JointForce(joint="C", force=2.0, factor=Factor(table=WAVY)),
        SlideSpring(joint="C", stiffness=30.0, damping=0.7, natural_displacement=0.05),
        JointTorque(joint="C", torque=-0.3),
        TorsionSpring(joint="C", stiffness=0.2, damping=0.01, natural_angle=0.4),
        Force(
            body="block",
            point=(0.4, 0.1, 0.2),
            force=(0.1, 0.5, -0.4),
            factor=Factor(polynomial=(0.2, 1.0, -0.5), stop=1.3),
        ),
        Moment(body="rod", moment=(0.1, 0.2, 0.3), factor=Factor(start=0.9)),
        Moment(body="block", moment=(0.05, -0.02, 0.03), factor=Factor(table=WAVY, polynomial=(0.3,))),
    ]
    if not driver:
        loads.append(JointTorque(joint="R", torque=1.2, factor=Factor(sine=WAVE)))
    parts = {"body": [rod, block], "joint": [hinge, tube], "driver": driver, "load": loads}
    return Scene(name="arm", gravity=(0.0, 0.0, -9.81), duration=2.0, **parts)


def driven_arm() -> Scene:
    """The arm with a driver that follows a table and a sine."""
    return arm((Driver(joint="R", table=WAVY, sine=Sine(amplitude=0.2, frequency=3.0)),))
