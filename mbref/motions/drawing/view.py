"""Views: directions of sight, and the page's pixels of world points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mbref.input_error import InputError
from mbref.motions.drawing.shapes import FLAT

NAMED = {"xy": (-90.0, 90.0), "xz": (-90.0, 0.0), "yz": (0.0, 0.0), "oblique": (-60.0, 22.0)}  # degrees
ACROSS = ("yz", "xz", "xy")  # the view along each axis


class Form(NamedTuple):
    """Sizes of a picture, px: width, margin and largest height of a panel, letters; and number of panels in a
    row."""

    width: float = 720.0
    margin: float = 64.0
    tallest: float = 520.0
    letters: int = 12
    columns: int = 1


BESIDE = Form(width=360.0, margin=44.0, letters=20, columns=2)  # layout of motions side by side


@dataclass(frozen=True)
class View:
    """A direction of sight, from azimuth about z and elevation above the xy-plane (rad)."""

    azimuth: float
    elevation: float

    @staticmethod
    def parse(text: str) -> View:
        """Return the view of a name, or of ``AZIMUTH,ELEVATION`` in degrees; raises InputError."""
        try:
            azimuth, elevation = NAMED.get(text) or map(float, text.split(","))
        except ValueError:
            known = ", ".join(NAMED)
            raise InputError(
                f"view: must be {known}, or AZIMUTH,ELEVATION in degrees, got {text!r}"
            ) from None
        if not (math.isfinite(azimuth) and -90 <= elevation <= 90):
            raise InputError(f"view: the elevation must be from -90 to 90 degrees, got {text!r}")
        return View(math.radians(azimuth), math.radians(elevation))

    @property
    def axes(self) -> np.ndarray:
        """World directions (3, 3) that point right, up, and out of the page."""
        (ca, sa), (ce, se) = ((math.cos(x), math.sin(x)) for x in (self.azimuth, self.elevation))
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]]).round(15)


def view_of(points: np.ndarray, axes: Sequence[Sequence[float]]) -> View:
    """Return the view normal to the coordinate plane that contains the points (n, 3) and is normal to the
    axes.

    Return an oblique view if there is no such plane.
    """
    spans = np.ptp(points, axis=0)
    thin = np.flatnonzero(spans <= FLAT * max(spans.max(), 1e-300))
    across = [k for k in thin[::-1] if all(abs(axis[k]) > (1 - FLAT) * math.hypot(*axis) for axis in axes)]
    return View.parse(ACROSS[across[0]] if across else "oblique")


@dataclass(frozen=True)
class Page:
    """Map from metres to pixels: scale (px/m), and the coordinates (m) of the upper left corner of the shown
    area."""

    view: View
    scale: float
    corner: np.ndarray  # (2,) least x and greatest y of the projected points, m
    margin: float
    width: float
    height: float

    @staticmethod
    def around(points: np.ndarray, view: View, width: float, margin: float, tallest: float) -> Page:
        """Return the page of a width (px) that shows all of points (n, 3), not taller than ``tallest``
        (px)."""
        flat = points @ view.axes[:2].T
        least, most = flat.min(axis=0), flat.max(axis=0)
        spans = np.maximum(most - least, 1e-3 * max((most - least).max(), 1e-300))
        scale = float(min((np.array([width, tallest]) - 2 * margin) / spans))
        height = max(spans[1] * scale + 2 * margin, tallest / 3)
        room = np.array([width, height]) - 2 * margin
        slack = (room / scale - (most - least)) / 2
        return Page(view, scale, np.array([least[0] - slack[0], most[1] + slack[1]]), margin, width, height)

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """World points (…, 3), m, on the page (…, 2), px."""
        flat = points @ self.view.axes[:2].T
        return (flat - self.corner) * np.array([1.0, -1.0]) * self.scale + self.margin

    def directions(self, vectors: np.ndarray) -> np.ndarray:
        """World directions (…, 3) projected onto the page (…, 2), with y downwards."""
        seen: np.ndarray = vectors @ self.view.axes[:2].T * np.array([1.0, -1.0])
        return seen


def round_length(longest: float) -> float:
    """Return the largest length of the form 1, 2 or 5 times a power of ten that is not longer than the given
    length."""
    power = 10.0 ** math.floor(math.log10(longest))
    return float(f"{max(k for k in (1, 2, 5) if k * power <= longest * (1 + 1e-9)) * power:.6g}")
