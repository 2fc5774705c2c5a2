"""Kinetic and potential energy of a scene along a trajectory."""

from __future__ import annotations

import numpy as np

from mbref import rotations
from mbref.input_error import InputError
from mbref.motions.actuation import load_motion
from mbref.motions.joint_motion import along, joint_motion
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


def kinetic(scene: Scene, motion: Trajectory) -> np.ndarray:
    """Return the kinetic energy (k,), J: Σ (m v·v + ω·J ω)/2 over the bodies plus Σ I q'²/2 over armatures.

    Raises InputError if a body has no mass.
    """
    _need_masses(scene)
    mass = np.array([body.mass for body in scene.body])
    inertia = np.array([_matrix(body.inertia) for body in scene.body])
    turned_back = rotations.conjugate(motion.orientation)
    own = rotations.rotate(turned_back, motion.angular_velocity)
    turning = np.einsum("kbi,bij,kbj->k", own, inertia, own)
    moving = np.einsum("b,kbi,kbi->k", mass, motion.velocity, motion.velocity)
    total = moving + turning
    for joint in scene.joint:
        if joint.reflected_inertia and joint.facts.driven:
            _, rate = along(joint_motion(scene, motion, joint.name), joint.facts.driven)
            total = total + joint.reflected_inertia * rate**2
    return np.asarray(total / 2)


def potential(scene: Scene, motion: Trajectory) -> np.ndarray:
    """Return the potential energy (k,), J, of gravity (zero at the origin), of springs and springs of joints.

    Forces, moments and torques have no potential here: their work changes the energy.

    Raises InputError where a body has no mass.
    """
    _need_masses(scene)
    mass = np.array([body.mass for body in scene.body])
    total = -np.einsum("b,kbi,i->k", mass, motion.position, np.array(scene.gravity))
    for place in range(len(scene.load)):
        energy = load_motion(scene, motion, place).energy
        total = total if energy is None else total + energy
    return np.asarray(total)


def _need_masses(scene: Scene) -> None:
    if not scene.has_mass():
        without = next(body.name for body in scene.body if body.mass is None)
        raise InputError(f"body {without!r} has no mass; energies need the mass and inertia of every body")


def _matrix(inertia: tuple[float, ...] | tuple[tuple[float, ...], ...] | None) -> np.ndarray:
    array = np.array(inertia, dtype=float)
    return np.diag(array) if array.ndim == 1 else array
