"""Power balance of a motion, from its outputs alone: the work of all drivers and loads is the change of the
kinetic energy and of gravity's potential energy. Springs count as loads, whose power is part of the work, so
that their energy is taken from the energy of the motion."""

from collections.abc import Mapping

import numpy as np

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
EACH = len(NODES) + 1  # samples of a panel: its start and its nodes
# (16, 3): values at the nodes to their three highest Legendre coefficients, of orders n = 13 to 15
HIGHEST = (np.polynomial.legendre.legvander(NODES, 15) * WEIGHTS[:, None] * (np.arange(16) + 0.5))[:, 13:]
# largest of these coefficients / largest power of a panel that is resolved; the rule is exact to order 31
RESOLVED = 1e-6


def panel_times(duration: float, panels: int) -> np.ndarray:
    """Return the ends of panels and the Gauss–Legendre nodes between them (17 panels + 1,), s."""
    ends = np.linspace(0.0, duration, panels + 1)
    inside = ends[:-1, None] + (NODES + 1) / 2 * np.diff(ends)[:, None]
    return np.append(np.column_stack([ends[:-1], inside]).ravel(), duration)


def unbalanced(columns: Mapping[str, np.ndarray], weight: float = 0.0) -> float:
    """Return the largest difference between mean power and change of energy over time / largest power, of all
    panels that the motion completed and whose nodes resolve the power. ``columns`` are the numbers of a
    motion at ``panel_times``, by name. ``weight`` (W) is another power to which the difference may be
    relative. The result is NaN if there is no such panel."""
    panels, energy = (len(columns["time"]) - 1) // EACH, columns["energy"]
    powers = [values for name, values in columns.items() if name.endswith(").power")]
    stored = sum((values for name, values in columns.items() if name.endswith(").energy")), 0.0 * energy)
    largest = max(weight, *(float(np.abs(power).max(initial=0.0)) for power in powers))
    parts = np.array(powers)[:, : EACH * panels].reshape(len(powers), panels, EACH)[:, :, 1:]
    resolved = np.abs(parts @ HIGHEST).max(axis=(0, 2), initial=0.0) <= RESOLVED * largest
    ends = slice(0, EACH * panels + 1, EACH)
    gained = np.diff((energy - stored)[ends]) / np.diff(columns["time"][ends])
    off = np.abs(parts.sum(axis=0) @ WEIGHTS / 2 - gained)[resolved]
    return float(off.max()) / largest if off.size else float("nan")
