"""Power balance of a motion, from its outputs alone: work of drivers and loads against the change of energy.

Gravity and springs store energy: the work of all drivers and loads is the change of kinetic plus potential
energy, without the energy of the springs, whose power is a load's.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
EACH = len(NODES) + 1  # samples of a panel: its start and its nodes


def panel_times(duration: float, panels: int) -> np.ndarray:
    """Return the ends of panels and the Gauss–Legendre nodes between them (17 panels + 1,), s."""
    ends = np.linspace(0.0, duration, panels + 1)
    inside = ends[:-1, None] + (NODES + 1) / 2 * np.diff(ends)[:, None]
    return np.append(np.column_stack([ends[:-1], inside]).ravel(), duration)


def unbalanced(columns: Mapping[str, np.ndarray], weight: float = 0.0) -> float:
    """Return the largest difference between mean power and change of energy over time, of all panels that the
    motion completed, relative to the largest power.

    ``columns`` are the numbers of a motion at ``panel_times``, by name. ``weight`` (W) is another power to
    which the difference may be relative. Raises ValueError if no panel is complete.
    """
    panels = (len(columns["time"]) - 1) // EACH
    if panels < 1:
        raise ValueError("the motion ended before the end of the first panel")
    powers = [values for name, values in columns.items() if name.endswith(").power")]
    stored = [values for name, values in columns.items() if name.endswith(").energy")]
    mean = (
        sum(powers, np.zeros_like(columns["time"]))[: EACH * panels].reshape(panels, EACH)[:, 1:]
        @ WEIGHTS
        / 2
    )
    ends = slice(0, EACH * panels + 1, EACH)
    gained = np.diff(columns["energy"][ends] - sum(stored, 0.0 * columns["energy"])[ends])
    largest = max(weight, *(float(np.abs(power).max()) for power in powers))
    return float(np.abs(mean - gained / np.diff(columns["time"][ends])).max()) / largest
