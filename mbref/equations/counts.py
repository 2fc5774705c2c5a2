"""Coordinates, constraint rows, rank of Φ_q and degrees of freedom of a scene at its start."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from mbref.equations.initial_state import LARGE, Start, consistent_start, solve_positions
from mbref.equations.model import Model, displaced
from mbref.equations.offsets import assembled
from mbref.equations.units import unit_rows
from mbref.linear_algebra.redundancy import Redundancy
from mbref.scene import Scene

RANK_TOLERANCE = 1e-10  # relative to the largest singular value of the scaled Jacobian
PERTURBATION = 1e-2  # rad or lengths of the mechanism; movement of the fastest body from a singular start


@dataclass(frozen=True)
class Counts:
    """Coordinates, constraint rows and their rank at t = 0.

    Attributes
    ----------
    coordinates : int
        Six for each body; the ground counts if it is modelled as a body.
    rows : int
        Number of constraint rows.
    rows_by_joint : dict of str to int
        Rows by joint. Rows of a driver count under its joint, rows of a modelled ground under ``"ground"``.
    rank : int
        Rank of the constraint Jacobian.
    redundant : int
        Rows minus rank.
    degrees_of_freedom : int
        Coordinates minus rank.
    """

    coordinates: int
    rows: int
    rows_by_joint: dict[str, int]
    rank: int
    redundant: int
    degrees_of_freedom: int


def counts(scene: Scene) -> Counts:
    """Return the counts of a scene at its corrected initial positions.

    Parameters
    ----------
    scene : Scene
        The mechanism; masses are not needed.

    Returns
    -------
    Counts
        Coordinates, rows by joint, rank, redundant rows and degrees of freedom.

    Raises
    ------
    SceneError
        If the initial positions contradict the joints.
    """
    model = Model(assembled(scene))
    return counts_of(model, rank_at_start(model, consistent_start(model)))


def rank_at_start(model: Model, start: Start) -> int:
    """Return the rank of Φ_q at the corrected initial positions."""
    if model.m > LARGE:
        return redundancy_of(model, start).rank
    return rank_of(scaled_jacobian(model, 0.0, start.q), RANK_TOLERANCE)


def undriven_freedoms(scene: Scene) -> int:
    """Return the degrees of freedom that no driver prescribes, counted near the start if the start is
    singular."""
    model = Model(assembled(scene))
    return freedoms_left(model, consistent_start(model))


def freedoms_left(model: Model, start: Start) -> int:
    """Return ``undriven_freedoms`` of a model with its start."""
    freedoms = model.n - rank_at_start(model, start)
    if freedoms == 0 or not model.scene.driver:
        return freedoms
    return model.n - rank_of(scaled_jacobian(model, *perturbed_state(model, start)), RANK_TOLERANCE)


def perturbed_state(model: Model, start: Start) -> tuple[float, np.ndarray]:
    """Return time and coordinates (7 nb,) at which the fastest body has moved by PERTURBATION."""
    q, v = start.q, start.v
    terms = model.terms(0.0, q, v)
    jacobian = terms.jacobian * model.units
    acceleration = model.units * np.linalg.lstsq(jacobian, terms.gamma, rcond=RANK_TOLERANCE)[0]
    fastest = np.max(np.abs(v / model.units), initial=0.0)
    longest = model.scene.duration
    t = min(longest, PERTURBATION / fastest) if fastest > 0 else longest
    q, _ = solve_positions(model, t, displaced(q, t * v + 0.5 * t * t * acceleration))
    return t, q


def counts_of(model: Model, rank: int) -> Counts:
    """Return the counts of a model with the rank of its Φ_q."""
    by_joint = dict(Counter(model.row_joint))
    return Counts(model.n, model.m, by_joint, rank, model.m - rank, model.n - rank)


def redundancy_of(model: Model, start: Start) -> Redundancy:
    """Return the sparse analysis of redundant rows at the start."""
    jacobian = model.structure.sparse(model.terms(0.0, start.q).blocks)
    return Redundancy(jacobian.multiply(model.units).tocsr())


def scaled_jacobian(model: Model, t: float, q: np.ndarray) -> np.ndarray:
    """Return Φ_q (m, n) for displacements in units of the mechanism, with rows of unit length."""
    return unit_rows(model.terms(t, q).jacobian * model.units)


def rank_of(matrix: np.ndarray, tolerance: float) -> int:
    """Return the number of singular values above the tolerance times the largest singular value."""
    return count_above(np.linalg.svd(matrix, compute_uv=False), tolerance)


def count_above(values: np.ndarray, tolerance: float) -> int:
    """Return the number of singular values, largest first, above the tolerance times the largest one."""
    return int(np.sum(values > tolerance * values[0])) if values.size else 0
