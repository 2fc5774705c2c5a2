"""Timeline of an animation: the samples that it shows, and when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FRAMES = 120  # largest number of samples in an animation, since the SVG grows in proportion to it
# s; limits of the duration of one round, within which an animation runs in real time
SHORTEST, LONGEST = 4.0, 12.0


@dataclass(frozen=True)
class Timeline:
    """Playback of a motion, repeated without end.

    A picture without a timeline stands still.
    """

    times: np.ndarray  # (k,) s, times of the displayed samples
    samples: np.ndarray  # (k,) their numbers in the motion
    seconds: float  # duration of one round
    marks: tuple[float, ...] = ()  # s; times marked on a line of time, which is drawn only if there are any
    label: str = ""  # meaning of the marks

    @staticmethod
    def of(times: np.ndarray, marks: Sequence[float] = (), label: str = "") -> Timeline:
        """Return the timeline that shows every n-th of samples at times (n,), s, at most 120 of them."""
        samples = np.arange(0, len(times), math.ceil(len(times) / FRAMES))
        seconds = float(np.clip(times[-1] - times[0], SHORTEST, LONGEST))
        return Timeline(times[samples], samples, seconds, tuple(marks), label)

    def fractions(self, times: np.ndarray) -> np.ndarray:
        """Return times (n,), s, as fractions of the time shown."""
        return (times - self.times[0]) / ((self.times[-1] - self.times[0]) or 1.0)

    def animate(self, attribute: str, values: Sequence[str], tag: str = "animate", more: str = "") -> str:
        """Return the SMIL element that gives an attribute its value (k,) at each sample; an empty text for a
        constant value."""
        if len(set(values)) == 1:
            return ""
        once = f'attributeName="{attribute}"{more} dur="{self.seconds:g}s" values="{";".join(values)}"'
        return f'<{tag} {once}{self._key_times()} repeatCount="indefinite"/>'

    def _key_times(self) -> str:
        """Return the attribute that samples at unequal distances need."""
        fractions = self.fractions(self.times)
        if np.allclose(fractions, np.linspace(0.0, 1.0, len(fractions)), rtol=0, atol=1e-3):
            return ""
        return f' keyTimes="{";".join(f"{fraction:.4g}" for fraction in fractions)}"'
