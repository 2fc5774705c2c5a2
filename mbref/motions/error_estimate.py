"""ErrorEstimate: the estimated global error of a motion at its samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbref import rotations
from mbref.motions.record_fields import typed
from mbref.motions.trajectory import Trajectory

# error / relative tolerance, and error: a warning is given if both are exceeded
RATIO, LEAST_WARNED = 1e3, 1e-6


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated global error of a motion at its k samples.

    The error of a sample is the largest distance of a body's centre of mass from its true place, divided by
    the length of the mechanism, or the angle between its orientation and the true one, rad, whichever is
    larger. It is estimated by the difference from a second run, and is at least the error by rounding.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Sample times of the motion, s.
    error : ndarray, shape (k,)
        Estimated error; NaN at samples that the second run did not reach.
    rtol : float or None
        Relative tolerance of the motion. None for a method in fixed steps.
    second_run : str
        Method and tolerance of the second run. Empty if no estimate was made.
    reason : str
        The reason why some samples have no estimate. Empty if all samples have one.
    tighter : tuple of (float, float), or None
        A smaller relative tolerance that was tried, and its largest error. None for motions without a
        warning.
    """

    times: np.ndarray
    error: np.ndarray
    rtol: float | None
    second_run: str
    reason: str = ""
    tighter: tuple[float, float] | None = None

    def __repr__(self) -> str:
        return f"<ErrorEstimate: {self.sentence}>"

    @staticmethod
    def none(times: np.ndarray, rtol: float | None, reason: str) -> ErrorEstimate:
        """Return the error estimate of a motion for which no second run could be made.

        Parameters
        ----------
        times : ndarray, shape (k,)
            Sample times of the motion, s.
        rtol : float or None
            Relative tolerance of the motion.
        reason : str
            The reason, as a clause.

        Returns
        -------
        ErrorEstimate
            With NaN as error of every sample.
        """
        return ErrorEstimate(times, np.full(len(times), math.nan), rtol, "", reason)

    @property
    def largest(self) -> float | None:
        """Largest estimated error. None if no sample has an estimate."""
        known = self.error[~np.isnan(self.error)]
        return float(known.max()) if known.size else None

    def exceeds_from(self, level: float) -> float | None:
        """Return the time of the first sample whose error is above a level.

        Parameters
        ----------
        level : float
            Relative error, or angle in rad.

        Returns
        -------
        float or None
            Time, s; None if no sample has such an error.
        """
        above = np.flatnonzero(self.error > level)
        return float(self.times[above[0]]) if above.size else None

    @property
    def exceeds_rtol_from(self) -> float | None:
        """Time, s, of the first sample whose error is above ``rtol``; None if no sample has such an error."""
        return None if self.rtol is None else self.exceeds_from(self.rtol)

    def _warned_from(self) -> float | None:
        """Time, s, of the first sample whose error the warning reports; None without a warning."""
        return None if self.rtol is None else self.exceeds_from(max(RATIO * self.rtol, LEAST_WARNED))

    @property
    def warning(self) -> str:
        """Sentence on an error above 1000 times the relative tolerance and above 1e-6. Empty if no error is
        as large.

        The sentence calls the motion sensitive, unless a run with a smaller tolerance has an error below 1000
        times that tolerance.
        """
        begin = self._warned_from()
        if begin is None:
            return ""
        better = "; rtol {:.0e} gives {:.0e}".format(*self.tighter) if self.tighter else ""
        cured = self.tighter is not None and self.tighter[1] < RATIO * self.tighter[0]
        what = "inaccurate run" if cured else "sensitive motion"
        return f"{what}: error about {_short(self.largest)} from t = {begin:.3g} s on{better}"

    @property
    def sentence(self) -> str:
        """Sentence on the error estimate, or on the reason why no estimate was made."""
        if self.largest is None:
            return f"no error estimate: {self.reason}"
        begin = self.exceeds_rtol_from
        above = "" if begin is None else f", above rtol {self.rtol:g} from t = {begin:.3g} s on"
        ends = f"; {self.reason}" if self.reason else ""
        return f"largest estimated error: {self.largest:.1e}{above}{ends}"

    def to_record(self) -> dict[str, Any]:
        """Return numbers, lists and text, for JSON.

        Returns
        -------
        dict
            The attributes by name, with ``largest``, ``exceeds_rtol_from`` (s) and ``sentence``.
        """
        return {
            "largest": self.largest,
            "exceeds_rtol_from": self.exceeds_rtol_from,
            "error": self.error.tolist(),
            "rtol": self.rtol,
            "second_run": self.second_run,
            "reason": self.reason,
            "tighter": None if self.tighter is None else list(self.tighter),
            "sentence": self.sentence,
        }

    @staticmethod
    def from_record(times: np.ndarray, record: Mapping[str, Any]) -> ErrorEstimate:
        """Return the estimate that ``to_record`` wrote.

        Parameters
        ----------
        times : ndarray, shape (k,)
            Sample times of the motion, s, which the record does not contain.
        record : mapping
            Result of ``to_record``.
        """
        tighter = record["tighter"]
        found = ErrorEstimate(
            times,
            np.array(record["error"], dtype=float).reshape(len(times)),
            **{key: record[key] for key in ("rtol", "second_run", "reason")},
            tighter=None if tighter is None else (float(tighter[0]), float(tighter[1])),
        )
        return typed(found)


def distances(
    pose: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray], length: float
) -> np.ndarray:
    """Return the largest distance (k,) of a body between two motions, over a length (m), or angle, rad.

    A pose is positions (k, nb, 3) and quaternions (k, nb, 4).
    """
    places = np.linalg.norm(other[0] - pose[0], axis=-1) / length
    turns = rotations.angle_between(other[1], pose[1])
    found: np.ndarray = np.maximum(places, turns).max(axis=-1, initial=0.0)
    return found


def rounding(motion: Trajectory, length: float) -> np.ndarray:
    """Return the error (k,) that rounding alone leaves in a motion, over the length (m), or rad.

    ``u (|r| / length + √(n + 1) (1 + s))`` with the unit u of doubles, the largest distance |r| from the
    origin so far, the n steps so far, and the way s = t max(|v| / length, |ω|) of the fastest body: each step
    rounds velocities by u at random, and rounded velocities act until the end.
    """
    k = len(motion.times)
    far, fast, spin = (
        np.linalg.norm(each, axis=-1).reshape(k, -1).max(axis=1, initial=0.0)
        for each in (motion.position, motion.velocity, motion.angular_velocity)
    )
    way = motion.times * np.maximum.accumulate(np.maximum(fast / length, spin))
    steps = motion.cost.steps * motion.times / (motion.t_end or 1.0)
    unit = float(np.finfo(float).eps)
    return np.asarray(unit * (np.maximum.accumulate(far) / length + np.sqrt(steps + 1.0) * (1.0 + way)))


def _short(number: float | None) -> str:
    return f"{number:.0e}" if number is not None and number < 0.01 else f"{number:.1g}"
