"""The explanation of Table I, computed once and stored: rank of the Jacobian, the second branch (fold), and
ALF's iterations near a crossing."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.paper import settings, singular
from crosscheck.paper.settings import LINKAGES
from mbref.records import append, stored
from mbref.scenes.four_bar import four_bar

SCHEMA = 1
TURNED = 0.1  # rad; turn of the crank along the fold
LAST = 0.06  # s; last time of the listed crossings
STARTS = ("θ₂ = nπ", "θ₂ = π/4", "θ₂ = π/2")  # columns of Table I
DISTANCES, GAMMA_ERRORS = (1.0, 0.3, 0.1, 0.03, 0.01, 0.001), (0.0, 1e-10, 1e-8, 1e-6)
ANGLES = 401  # samples of one revolution

Illustration = dict[str, Any]


def illustration(path: str | Path) -> Illustration:
    """Return the record stored at ``path`` (JSON lines); it is computed and appended if it is missing.

    ``fold``: residual on the fold from θ₂ = 0 and π; ``crossings``: start, time (s), multiple of π, rank and
    smallest singular value of each; ``theta`` and ``smallest``: θ₂ (rad) over a revolution and the two
    smallest singular values; ``alf_iterations``: DISTANCES × GAMMA_ERRORS.
    """
    key = _key()
    known = stored(path)
    if key not in known:
        append(path, {"key": key, **_computed()})
        known = stored(path)
    return known[key]


def _key() -> str:
    asked = [SCHEMA, TURNED, LAST, DISTANCES, GAMMA_ERRORS, ANGLES, dict(settings.ALF)]
    return hashlib.sha256(json.dumps(asked).encode()).hexdigest()


def _computed() -> Illustration:
    turned = np.linspace(0.0, 2 * math.pi, ANGLES)
    values = singular.scaled_singular_values(four_bar(math.pi / 2), turned / singular.CRANK_RATE)
    return {
        "fold": [singular.fold_residual(theta, -TURNED) for theta in (0.0, math.pi)],
        "crossings": [row for start in STARTS for row in _crossings(start)],
        "theta": (math.pi / 2 - turned).tolist(),
        "smallest": values[:, :-3:-1].tolist(),
        "alf_iterations": [[singular.alf_iterations(d, e) for e in GAMMA_ERRORS] for d in DISTANCES],
    }


def _crossings(start: str) -> list[tuple[str, float, int, int, float]]:
    theta0, rows = LINKAGES[start][1], []
    for t, k in singular.crossings(theta0, LAST):
        if t > 0:
            [values] = singular.scaled_singular_values(four_bar(theta0), np.array([t]))
            rows.append((start, t, k, singular.rank(values), float(values[-1])))
    return rows
