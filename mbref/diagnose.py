"""What a scene is: coordinates, rows by joint, rank, redundant rows, degrees of freedom."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from mbref.initial import consistent_start
from mbref.model import Model
from mbref.scene import Scene

RANK_TOLERANCE = 1e-10  # relative to the largest singular value of the scaled Jacobian


@dataclass(frozen=True)
class Counts:
    """Counts at t = 0, the ground's where it is a body."""

    coordinates: int  # 6 per body
    rows: int
    rows_by_joint: dict[str, int]  # drivers under their joint, a modelled ground under "ground"
    rank: int
    redundant: int
    degrees_of_freedom: int


def counts(scene: Scene) -> Counts:
    """Counts of a scene at its corrected initial positions."""
    model = Model(scene)
    rank = model.m and rank_of(scaled_jacobian(model, 0.0, consistent_start(model).q))
    return Counts(model.n, model.m, dict(Counter(model.row_joint)), rank, model.m - rank, model.n - rank)


def scaled_jacobian(model: Model, t: float, q: np.ndarray) -> np.ndarray:
    """Φ_q (m, n) with rows of unit length, so that its rank does not depend on units."""
    jacobian = model.terms(t, q, np.zeros(model.n)).jacobian
    return jacobian / np.linalg.norm(jacobian, axis=1, keepdims=True)


def rank_of(matrix: np.ndarray) -> int:
    """Number of singular values above the rank tolerance times the largest."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(values > RANK_TOLERANCE * values[0]))
