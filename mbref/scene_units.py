"""Numbers with a unit, such as "300 mm" or "30 deg", as SI numbers."""

from __future__ import annotations

import math
import re
from typing import Literal

from mbref.scene_fields import meant

Dimension = Literal["length", "angle"]
UNITS: dict[Dimension, dict[str, float]] = {  # name → factor to m or rad
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048},
    "angle": {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180, "mrad": 1e-3, "rev": 2 * math.pi},
}
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def in_si(text: str, dimension: Dimension) -> float:
    """Return a number with a unit of length or angle in m or rad.

    Raises ValueError for what is no number with a unit, or has no unit or another one.
    """
    known, match = UNITS[dimension], NUMBER.fullmatch(text)
    if match and match[2] in known:
        return float(match[1]) * known[match[2]]
    if match and match[2]:
        raise ValueError(
            f"{match[2]!r} is no unit of {dimension}; known: {', '.join(known)}{meant(match[2], known)}"
        )
    example = "300 mm" if dimension == "length" else "30 deg"
    raise ValueError(f'must be a number, or a number with a unit, such as "{example}"; got {text!r}')
