"""Crossing: a singular position on a motion, and the branches that meet there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbref.motions.record_fields import typed


@dataclass(frozen=True, eq=False)
class Crossing:
    """A singular position that a run crossed, and the branches of motion that meet there.

    Attributes
    ----------
    time : float
        Time of the singular position, s.
    position : ndarray, shape (nb, 3)
        Centres of mass of the nb bodies, world frame, m.
    orientation : ndarray, shape (nb, 4)
        Unit quaternions (w, x, y, z), body to world.
    velocity, angular_velocity : ndarray, shape (b, nb, 3)
        Velocities on each of the b branches, world frame, m/s and rad/s. The smooth branch is the first one.
    taken : int
        The branch that the run followed, counted from 1.
    sentence : str
        How many branches there are, or the reason why they are not known.
    """

    time: float
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    taken: int
    sentence: str

    def instants(self, end: float, count: int) -> np.ndarray:
        """Return times at which the branches are seen to separate.

        From a quarter turn of the fastest body before the crossing to slightly less than half a turn after
        it, where the next crossing often is. If no body turns, the times cover the whole run.

        Parameters
        ----------
        end : float
            End of the run, s.
        count : int
            Number of times.

        Returns
        -------
        ndarray, shape (count,)
            Times, s.
        """
        rate = float(np.linalg.norm(self.angular_velocity, axis=-1).max(initial=0.0))
        if not rate:
            return np.linspace(0.0, end, count)
        turn = 2 * math.pi / rate
        return np.linspace(max(0.0, self.time - 0.25 * turn), min(end, self.time + 0.45 * turn), count)

    def to_record(self) -> dict[str, Any]:
        """Return the crossing as numbers, lists and text, for JSON.

        Returns
        -------
        dict
            The attributes by name, in their units; arrays are nested lists.
        """
        arrays = ("position", "orientation", "velocity", "angular_velocity")
        return {
            "time": self.time, "taken": self.taken, "sentence": self.sentence,
            **{key: getattr(self, key).tolist() for key in arrays},
        }  # fmt: skip

    @staticmethod
    def from_record(record: Mapping[str, Any]) -> Crossing:
        """Return the crossing that ``to_record`` wrote.

        Parameters
        ----------
        record : mapping
            Result of ``to_record``.

        Returns
        -------
        Crossing
            The crossing, with arrays as attributes.
        """
        arrays = {key: np.array(v, dtype=float) for key, v in record.items() if isinstance(v, list)}
        return typed(Crossing(**{**record, **arrays}))
