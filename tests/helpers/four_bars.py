"""Pins of planar four-bars in closed form."""

import numpy as np


def crank_pins(
    lengths: tuple[float, ...], angle: float | np.ndarray, side: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pins B and C (…, 2) of a four-bar at angles of its crank, which turns about (0, 0). C is
    where circles about B and D = (ground, 0) cross: on the left of the way from B to D if ``side`` is 1, on
    the right if it is -1."""
    crank, coupler, rocker, ground = lengths
    b = crank * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    across = np.array([ground, 0.0]) - b
    apart = np.linalg.norm(across, axis=-1, keepdims=True)
    along = (coupler**2 - rocker**2 + apart**2) / (2 * apart)
    height = np.sqrt(np.maximum(coupler**2 - along**2, 0.0))
    unit = across / apart
    return b, b + along * unit + side * height * np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
