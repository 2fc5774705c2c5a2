"""Gaps: the violations of constraints as displacements in units of the mechanism.

Φ has rows in metres, in radians, and in mixed units where a coupling joins a slide and a hinge.  |Φ| over the
length of its row of Φ_q compares all rows, and does not depend on the units of the scene.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbref.equations.model import Model, Terms

CLOSED = 1e-10  # largest gap (lengths of the mechanism or rad) of positions that satisfy the constraints


def gaps(terms: Terms, length: Any) -> np.ndarray:
    """Return |Φ| (…, m) over the lengths of the rows of Φ_q, for displacements in lengths (…,) or rad.

    A gap is the least displacement that closes its row, whatever the unit of the row.
    """
    return np.asarray(np.abs(terms.phi) / lengths_of_rows(terms.blocks, length))


def lengths_of_rows(blocks: np.ndarray, length: Any) -> np.ndarray:
    """Return the lengths (…, m) of rows given as blocks (…, m, 12), for displacements in lengths or rad."""
    sides = blocks.reshape(*blocks.shape[:-1], blocks.shape[-1] // 6, 6)
    squares = (sides * sides).sum(axis=-2)
    scaled = squares[..., :3].sum(axis=-1) * np.square(length)[..., None] + squares[..., 3:].sum(axis=-1)
    return np.sqrt(np.where(scaled > 0.0, scaled, 1.0))


def is_closed(model: Model, terms: Terms) -> bool:
    """Return whether the constraints hold at the pose of some terms of a model, up to ``CLOSED``."""
    return bool(gaps(terms, model.length).max(initial=0.0) <= CLOSED)
