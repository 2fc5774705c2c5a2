"""Mechanisms whose motions keep momenta and energy, and copies of one mechanism of other sizes and places."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from crosscheck.conformance.changes.isometry import Isometry
from crosscheck.conformance.changes.units import in_other_units, scaled
from mbref.scene import Body, Revolute, Scene, Spherical
from mbref.scenes import SCENES
from mbref.scenes.slider_crank_chain import slider_crank_chain

SPIN = 10.0  # rad/s of the ring in flight
AXIS = np.array([0.48, -0.36, 0.8])  # of its spin
CORNERS = np.array([[-0.25, -0.25, 0.03], [0.25, -0.25, -0.05], [0.3, 0.25, 0.08], [-0.25, 0.22, 0.0]])  # m
MASSES = {"a": 1.0, "b": 1.5, "c": 0.8, "d": 1.2}  # kg
OWN = (0.004, 0.02, 0.021)  # moments of inertia of a rod / its mass, m²
WAY = np.array([0.6, -0.64, 0.48])  # direction in which mechanisms are moved away from the origin


def flying_ring(spin: float = SPIN) -> Scene:
    """Return four rods, jointed in a ring by two hinges and two balls, that spin (rad/s) in flight.

    Nothing connects the ring with the ground, and nothing acts on it.
    """
    ends = list(pairwise([*CORNERS, CORNERS[0]]))
    middles = np.array([(first + second) / 2 for first, second in ends])
    masses = np.array([*MASSES.values()])
    turn, centre = spin * AXIS, masses @ middles / masses.sum()
    along = spin * np.array([0.05, 0.02, -0.03])
    bodies = tuple(
        Body(
            name=name,
            mass=mass,
            inertia=(mass * OWN[0], mass * OWN[1], mass * OWN[2]),
            position=tuple(middle.tolist()),
            velocity=tuple((along + np.cross(turn, middle - centre)).tolist()),
            angular_velocity=tuple(turn.tolist()),
        )
        for (name, mass), middle in zip(MASSES.items(), middles, strict=True)
    )
    at = [tuple(corner.tolist()) for corner in CORNERS]
    joints = (
        Revolute(name="B", bodies=("a", "b"), anchor=at[1], axis=(0.2, 0.1, 1.0)),
        Revolute(name="C", bodies=("b", "c"), anchor=at[2], axis=(-0.3, 0.2, 1.0)),
        Spherical(name="D", bodies=("c", "d"), anchor=at[3]),
        Spherical(name="A", bodies=("d", "a"), anchor=at[0]),
    )
    return Scene(name="flying ring", duration=5.0 / spin, body=bodies, joint=joints)


def whirling_crank() -> Scene:
    """Return the slider-crank that whirls under gravity at 30 rad/s without losses."""
    return SCENES["planar_slider_crank_gravity"]().with_(name="whirling crank", duration=0.5)


def four_cranks() -> Scene:
    """Return four slider-cranks in a chain, which move under gravity."""
    return slider_crank_chain(4).with_(name="four cranks", duration=0.05)


def resized(scene: Scene, size: float) -> Scene:
    """Return a scene with lengths times ``size``, of equal density and under equal gravity.

    By Froude's similarity its motion takes √size times as long.
    """
    return in_other_units(scaled(scene, size**3), size, math.sqrt(size))


def moved_away(scene: Scene, distance: float) -> Scene:
    """Return a scene that is moved by a distance (m) in a direction along no axis."""
    return Isometry(np.eye(3), distance * WAY).change(scene)
