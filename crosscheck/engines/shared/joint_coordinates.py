"""Coordinates of a tree for integrators outside engines: one number for a slide or turn, quaternions for all
other rotations.

Positions q start at zero, with unit quaternions; velocities v are the velocities of the tree. Angular
velocities of balls are relative to the parent, in the axes of the parent or of the child, as the engine
defines them. The twists (v, ω) of free links are in world axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engines.shared.spanning_tree import BALL_JOINT, COORDINATES, FREE, Tree
from mbref import rotations

UNIT = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class JointCoordinates:
    """Indices of a tree's coordinates.

    ``single`` (n,) are the velocities of slides and turns, and ``single_q`` their positions. ``quaternions``
    and ``places`` contain pairs of the first position and the first velocity of a quaternion or a free link's
    displacement. ``in_child`` is True if angular velocities of balls are in the axes of the child.
    """

    nv: int
    nq: int
    single: np.ndarray
    single_q: np.ndarray
    quaternions: tuple[tuple[int, int], ...]
    places: tuple[tuple[int, int], ...]
    in_child: bool

    def start(self) -> np.ndarray:
        """Return the positions (nq,) at t = 0."""
        q = np.zeros(self.nq)
        for iq, _ in self.quaternions:
            q[iq : iq + 4] = UNIT
        return q

    def of_velocities(self, q: np.ndarray) -> np.ndarray:
        """Return coordinates (nv,) in the order of the velocities; zero for joints without a single angle."""
        found = np.zeros(self.nv)
        found[self.single] = q[self.single_q]
        return found

    def rates(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the rates (nq,) of the positions."""
        out = np.empty(self.nq)
        out[self.single_q] = v[self.single]
        for iq, iv in self.quaternions:
            unit, spin = _unit(q[iq : iq + 4]), np.concatenate([[0.0], v[iv : iv + 3]])
            out[iq : iq + 4] = self._turned(iv, unit, spin) / 2
        for iq, iv in self.places:
            out[iq : iq + 3] = v[iv : iv + 3]
        return out

    def _turned(self, iv: int, unit: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Return the product of a quaternion and a turn in the axes of the velocity ``iv``."""
        is_local = self.in_child and all(iv != free + 3 for _, free in self.places)
        return rotations.multiply(unit, turn) if is_local else rotations.multiply(turn, unit)

    def normalised(self, q: np.ndarray) -> np.ndarray:
        """Return the positions with quaternions of unit length."""
        if not self.quaternions:
            return q
        q = q.copy()
        for iq, _ in self.quaternions:
            q[iq : iq + 4] = _unit(q[iq : iq + 4])
        return q

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the positions after a small step (nv,) along the velocities."""
        out = q + self.rates(q, step)
        for iq, iv in self.quaternions:
            turn, unit = rotations.from_vector(step[iv : iv + 3]), _unit(q[iq : iq + 4])
            out[iq : iq + 4] = self._turned(iv, unit, turn)
        return out


def joint_coordinates(tree: Tree, in_child: bool) -> JointCoordinates:
    """Return the coordinates of a tree."""
    nq = nv = 0
    single, quaternions, places = [], [], []
    for link in tree.links:
        for mobility in link.mobilities:
            if mobility.kind == FREE:
                places.append((nq, nv))
                quaternions.append((nq + 3, nv + 3))
                nq += 7
            elif mobility.kind == BALL_JOINT:
                quaternions.append((nq, nv))
                nq += 4
            else:
                single.append((nq, nv))
                nq += 1
            nv += COORDINATES[mobility.kind]
    at = np.array(single, dtype=int).reshape(-1, 2)
    return JointCoordinates(nv, nq, at[:, 1], at[:, 0], tuple(quaternions), tuple(places), in_child)


def rotation_vector(quaternion: np.ndarray) -> np.ndarray:
    """Return axis times angle (3,), rad, of a unit quaternion."""
    size = np.linalg.norm(quaternion[1:])
    return quaternion[1:] * (2 * np.arctan2(size, quaternion[0]) / size if size > 0 else 2.0)


def _unit(quaternion: np.ndarray) -> np.ndarray:
    return quaternion / np.sqrt(quaternion @ quaternion)
