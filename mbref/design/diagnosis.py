"""Diagnosis of a scene: counts, degrees of freedom, redundant rows, unique reactions, singular values."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbref.design.start import diagnosed_start
from mbref.equations.counts import (
    RANK_TOLERANCE,
    Counts,
    count_above,
    counts_of,
    redundancy_of,
    scaled_jacobian,
)
from mbref.equations.initial_state import LARGE, Start
from mbref.equations.joint_reactions import determined_components
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.scene import Scene
from mbref.scenes import find_scene

# weight of a row in a left null vector above which the row takes part in a redundancy
UNIQUE_TOLERANCE = 1e-8
UNIQUE_SHARE = 1e-9  # limit of squared weights in large scenes, whose rounding is 1e-12
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
    model = Model(assembled(find_scene(scene)))
    start = diagnosed_start(model)
    if model.m > LARGE:
        found = redundancy_of(model, start)
        rank, shared = found.rank, found.shares > UNIQUE_SHARE
        smallest, largest = found.singular_values()
    else:
        jacobian = scaled_jacobian(model, 0.0, start.q)
        left, values, _ = np.linalg.svd(jacobian)
        rank = count_above(values, RANK_TOLERANCE)
        shared = np.linalg.norm(left[:, rank:], axis=1) > UNIQUE_TOLERANCE
        smallest = float(values[rank - 1]) if rank else 0.0
        largest = float(values[0]) if values.size else 0.0
    determined = _determined(model, start) if model.m <= MOST_DIAGNOSED_ROWS else None
    total = counts_of(model, rank)
    involved = Counter(name for name, part in zip(model.row_joint, shared, strict=True) if part)
    unique = tuple(name for name in total.rows_by_joint if name not in involved)
    return Diagnosis(total, dict(involved), unique, smallest, largest, determined)


def _determined(model: Model, start: Start) -> dict[str, tuple[str, ...]]:
    """Return for each joint the names of the components of its reaction that equilibrium determines at t =
    0."""
    q = start.q.reshape(1, model.nb, 7)
    found = determined_components(model, q, model.terms(np.zeros(1), q).blocks)
    return {name: tuple(np.array(COMPONENTS)[mask[0]].tolist()) for name, mask in found.items()}
