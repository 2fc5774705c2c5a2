"""Diagnosis of a scene: counts, degrees of freedom, redundant rows, unique reactions, singular values."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbref.equations.initial_state import LARGE, Start, consistent_start, solve_positions
from mbref.equations.joint_reactions import determined_components
from mbref.equations.model import Model, displaced
from mbref.equations.units import unit_rows
from mbref.linear_algebra.redundancy import Redundancy
from mbref.scene import Scene
from mbref.scene_services import Counts
from mbref.scenes import find_scene

RANK_TOLERANCE = 1e-10  # relative to the largest singular value of the scaled Jacobian
# weight of a row in a left null vector above which the row takes part in a redundancy
UNIQUE_TOLERANCE = 1e-8
UNIQUE_SHARE = 1e-9  # limit of squared weights in large scenes, whose rounding is 1e-12
PERTURBATION = 1e-2  # rad or lengths of the mechanism; movement of the fastest body from a singular start
MOST_DIAGNOSED_ROWS = 300  # rows; for more, a dense singular value decomposition takes more than about 0.1 s
COMPONENTS = tuple(f"{kind} {axis}" for kind in ("force", "moment") for axis in "xyz")


@dataclass(frozen=True)
class Diagnosis:
    """Counts, redundancy by joint and distance from a singular position, at t = 0.

    Attributes
    ----------
    counts : Counts
        Coordinates, rows, rank, redundant rows and degrees of freedom.
    redundant_by_joint : dict of str to int
        Rows that take part in a redundancy. Their reactions are not unique.
    unique_reactions : tuple of str
        Joints all of whose rows have a unique multiplier.
    smallest_singular_value : float
        Smallest nonzero singular value of Φ_q with unit rows: the distance from a singular position.
        Displacements are relative to the mechanism's length, so that the value does not depend on its size.
    largest_singular_value : float
        Largest singular value of this matrix.
    determined_reactions : dict of str to tuple of str, or None
        Components of the reactions that equilibrium determines, by joint, such as ``"force x"``, along world
        axes. None for scenes of more than 300 rows.
    """

    counts: Counts
    redundant_by_joint: dict[str, int]
    unique_reactions: tuple[str, ...]
    smallest_singular_value: float
    largest_singular_value: float
    determined_reactions: dict[str, tuple[str, ...]] | None = None


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
    model = Model(scene)
    return _counts(model, rank_at_start(model, consistent_start(model)))


def rank_at_start(model: Model, start: Start) -> int:
    """Return the rank of Φ_q at the corrected initial positions."""
    if model.m > LARGE:
        return _redundancy(model, start).rank
    return rank_of(scaled_jacobian(model, 0.0, start.q), RANK_TOLERANCE)


def undriven_freedoms(scene: Scene) -> int:
    """Return the degrees of freedom that no driver prescribes, counted near the start if the start is
    singular."""
    model = Model(scene)
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


def diagnose(scene: Scene | str | Path) -> Diagnosis:
    """Return counts, redundancy by joint and the distance to a singular position at t = 0.

    A multiplier is unique if its row takes part in no vanishing combination of rows, that is in no left null
    vector of Φ_q (Wojtyra, J. Theor. Appl. Mech. 43, 2005).

    Parameters
    ----------
    scene : Scene, str or path
        The mechanism, the name of a built-in one, or a .toml file. Masses are not needed.

    Returns
    -------
    Diagnosis
        Redundancy by joint, singular values of Φ_q with unit rows, determined reactions.

    Raises
    ------
    SceneError
        If the scene is faulty, or its initial positions contradict the joints.
    """
    model = Model(find_scene(scene))
    start = consistent_start(model)
    if model.m > LARGE:
        found = _redundancy(model, start)
        rank, shared = found.rank, found.shares > UNIQUE_SHARE
        smallest, largest = found.singular_values()
    else:
        jacobian = scaled_jacobian(model, 0.0, start.q)
        left, values, _ = np.linalg.svd(jacobian)
        rank = _count_above(values, RANK_TOLERANCE)
        shared = take_part(left[:, rank:])
        smallest = float(values[rank - 1]) if rank else 0.0
        largest = float(values[0]) if values.size else 0.0
    determined = _determined(model, start) if model.m <= MOST_DIAGNOSED_ROWS else None
    total = _counts(model, rank)
    involved = Counter(name for name, part in zip(model.row_joint, shared, strict=True) if part)
    unique = tuple(name for name in total.rows_by_joint if name not in involved)
    return Diagnosis(total, dict(involved), unique, smallest, largest, determined)


def take_part(left: np.ndarray) -> np.ndarray:
    """Return which rows (m,) take part in the dependences given by left null vectors (m, c)."""
    weights: np.ndarray = np.linalg.norm(left, axis=1)
    return weights > UNIQUE_TOLERANCE


def _determined(model: Model, start: Start) -> dict[str, tuple[str, ...]]:
    """Return for each joint the names of the components of its reaction that equilibrium determines at t =
    0."""
    q = start.q.reshape(1, model.nb, 7)
    found = determined_components(model, q, model.terms(np.zeros(1), q).blocks)
    return {name: tuple(np.array(COMPONENTS)[mask[0]].tolist()) for name, mask in found.items()}


def _counts(model: Model, rank: int) -> Counts:
    by_joint = dict(Counter(model.row_joint))
    return Counts(model.n, model.m, by_joint, rank, model.m - rank, model.n - rank)


def _redundancy(model: Model, start: Start) -> Redundancy:
    jacobian = model.structure.sparse(model.terms(0.0, start.q).blocks)
    return Redundancy(jacobian.multiply(model.units).tocsr())


def scaled_jacobian(model: Model, t: float, q: np.ndarray) -> np.ndarray:
    """Return Φ_q (m, n) for displacements in units of the mechanism, with rows of unit length."""
    return unit_rows(model.terms(t, q).jacobian * model.units)


def rank_of(matrix: np.ndarray, tolerance: float) -> int:
    """Return the number of singular values above the tolerance times the largest singular value."""
    return _count_above(np.linalg.svd(matrix, compute_uv=False), tolerance)


def _count_above(values: np.ndarray, tolerance: float) -> int:
    """Return the number of singular values, largest first, above the tolerance times the largest one."""
    return int(np.sum(values > tolerance * values[0])) if values.size else 0
