"""Consistent initial positions and velocities (section 1 and Figure 2 of the paper)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mbref.equations.branches import MOST_BRANCHED_ROWS, velocities_along
from mbref.equations.coordinates import displace_all
from mbref.equations.gaps import CLOSED, gaps
from mbref.equations.initial_velocities import (
    GROSS,
    START_RANK_TOLERANCE,
    Rates,
    dense_velocities,
    given_velocities,
    joint_fault,
    sparse_velocities,
    speed_at_rest,
)
from mbref.equations.model import Model, Terms
from mbref.equations.units import unit_equations
from mbref.linear_algebra.least_norm import least_norm
from mbref.linear_algebra.minimum_norm import MinimumNorm
from mbref.scene import Body, Scene, SceneError

LARGE = 40  # rows; for more, dense singular values take longer than sparse factors
MET = 1e-14  # gap relative to the largest coordinate that is rounding
SHORTEST_MOVE = 1e-15  # displacement of a Newton step (lengths or rad) that is rounding
REPORTED = 1e-9  # gap, or wrong velocity / largest velocity, from which a correction is reported
MOST_ITERATIONS = 30  # largest number of Newton steps from the given pose
ON_BRANCH = 1e-13  # residual of Φ_q v = ν / largest velocity; a larger residual belongs to another branch
NEAR_SINGULAR_RANK = 1e-9  # singular values below which they are not corrected
BRANCH = (
    "initial velocities that the scene does not give belong, at a singular position, to the branch with the "
    "least kinetic energy"
)


@dataclass(frozen=True)
class Start:
    """A consistent state and the violation of the scene's data before correction."""

    q: np.ndarray  # (7 nb,)
    v: np.ndarray  # (6 nb,)
    position_violation: float  # largest gap before the correction (lengths of the mechanism or rad)
    velocity_violation: float  # largest |Φ_q v - ν| before the correction / largest velocity, of unit rows
    given: np.ndarray  # (6 nb,) velocities that the scene gives, zero elsewhere
    follows_branch: bool = False  # True if undetermined velocities were taken from a branch

    def report(self) -> str:
        """Return one sentence for the user; empty if only rounding was corrected."""
        parts = []
        if self.position_violation > REPORTED:
            parts.append(
                f"positions were off the constraints by {self.position_violation:.2e} lengths or rad"
            )
        if self.velocity_violation > REPORTED:
            parts.append(f"velocities by {self.velocity_violation:.2e} of the largest")
        corrected = f"initial {' and '.join(parts)}; corrected" if parts else ""
        return "; ".join(filter(None, (corrected, BRANCH if self.follows_branch else "")))


class Alike(NamedTuple):
    """Scenes of equal structure whose consistent starts are computed together.

    Fields are coordinates (s, 7 nb) of their poses, masses (s, n), lengths (s,) in m, and each of the
    s scenes with its bodies. ``terms`` evaluates the scenes with indices (k,), for coordinates (k, 7 nb) and
    velocities (k, n), and returns blocks (k, m, 12). ``model_of`` returns the model of a scene by index.
    """

    model: Model
    poses: np.ndarray
    mass: np.ndarray
    length: np.ndarray
    scenes: Sequence[Scene]
    bodies: Sequence[Sequence[Body]]
    terms: Callable[[np.ndarray, np.ndarray, np.ndarray], Terms]
    model_of: Callable[[int], Model]

    @property
    def units(self) -> np.ndarray:
        """Units (s, n) in which displacements compare: lengths of the mechanisms (m), and 1 rad."""
        return np.tile(np.repeat(np.stack([self.length, np.ones(len(self.length))], 1), 3, 1), self.model.nb)


def _alone(model: Model, t: float = 0.0, value: Any = 0.0) -> Alike:
    """Return one scene in this form, with its terms at a time (s), and Φ minus a value (m,)."""
    return Alike(
        model=model,
        poses=model.start()[None],
        mass=model.mass[None],
        length=np.array([model.length]),
        scenes=[model.scene],
        bodies=[model.bodies],
        terms=lambda places, q, v: model.terms(np.full(len(q), t), q, v).less(value),
        model_of=lambda place: model,
    )


def consistent_start(model: Model) -> Start:
    """Return the nearest consistent state; raises SceneError for the joint that is grossly violated."""
    return model.once(_consistent_start)


def _consistent_start(model: Model) -> Start:
    (found,) = consistent_starts(_alone(model))
    if isinstance(found, SceneError):
        raise found
    return found


def consistent_starts(scenes: Alike) -> list[Start | SceneError]:
    """Return the nearest consistent state of each scene, or an error that names the grossly violated
    joint."""
    q, before, faults, terms = _corrected(scenes, scenes.poses)
    (v, given), model = given_velocities(scenes.bodies, q), scenes.model
    if not (v.any() or terms.nu.any()):
        return [faults.get(k) or Start(q[k], v[k], float(before[k]), 0.0, v[k]) for k in range(len(q))]
    by_body = np.ones((len(q), model.nb, 2, 3))
    by_body[:, :, 1] = 1 / scenes.length[:, None, None]
    scale = by_body.reshape(v.shape)
    jacobian = terms.blocks if model.m > LARGE else terms.jacobian * scale[:, None]
    rest = map(speed_at_rest, scenes.scenes, scenes.length.tolist())
    rates = map(Rates, v, given, terms.nu, scale, jacobian, scenes.mass, scenes.length, rest)
    states = enumerate(zip(q, before.tolist(), rates, strict=True))
    return [faults.get(k) or _start(scenes, k, *state) for k, state in states]


def _start(scenes: Alike, k: int, q: np.ndarray, before: float, rates: Rates) -> Start | SceneError:
    """Return the start of one of the scenes from its corrected coordinates q."""
    solve = sparse_velocities if scenes.model.m > LARGE else dense_velocities
    try:
        v, off, is_open = solve(scenes.model, rates)
    except SceneError as fault:
        return fault
    along = _along_branch(scenes.model_of(k), q, v, rates.given) if is_open and np.any(v) else None
    follows = along is not None
    return Start(q, v if along is None else along, before, off, rates.v, follows)


def _along_branch(model: Model, q: np.ndarray, v: np.ndarray, given: np.ndarray) -> np.ndarray | None:
    """Return velocities (6 nb,) along a branch of a singular start that agree with the given entries of v.

    None if v is along a branch, or if no branch agrees."""
    if not model.closed_loops or model.m > MOST_BRANCHED_ROWS:
        return None
    along = velocities_along(model, q, v, given)
    return _best_met(model, q, along) if along else None


def rate_violation(model: Model, q: np.ndarray, v: np.ndarray) -> float:
    """Return the largest |Φ_q v - ν| of unit rows at t = 0, over the largest of the velocities v (6 nb,)."""
    terms = model.terms(0.0, q, v)
    jacobian, nu = unit_equations(terms.jacobian, terms.nu)
    return float(np.abs(jacobian @ v - nu).max() / np.abs(v).max())


def _best_met(model: Model, q: np.ndarray, along: list[np.ndarray]) -> np.ndarray:
    """Return the first of velocities (6 nb,) along branches if all satisfy Φ_q v = ν, otherwise the most
    accurate velocities, corrected to rounding."""
    off = [rate_violation(model, q, w) for w in along]
    best = along[int(np.argmin(off)) if max(off) > ON_BRANCH else 0]
    terms = model.terms(0.0, q, best)
    jacobian, nu = unit_equations(terms.jacobian, terms.nu)
    return best + np.linalg.lstsq(jacobian, nu - jacobian @ best, rcond=NEAR_SINGULAR_RANK)[0]


def _corrected(scenes: Alike, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, dict[int, SceneError], Terms]:
    """Return consistent coordinates near q (s, 7 nb), the largest |Φ| (s,) before the correction, errors by
    index, and the terms at the new coordinates for zero velocities."""
    faults: dict[int, SceneError] = {}
    found = _solved(scenes, q, GROSS)
    q, before, terms, opened = found.coordinates, found.before, found.after, found.opened
    left = opened if terms is before else gaps(terms, scenes.length)
    first, last = (gap.max(axis=1, initial=0.0) for gap in (opened, left))
    if not (last > CLOSED).any():
        return q, first, faults, terms
    for k in np.flatnonzero(first > GROSS).tolist():
        row = int(np.argmax(opened[k]))
        what = f"positions given to bodies violate it by {abs(before.phi[k, row]):.3g} m or rad"
        faults[k] = joint_fault(scenes.model, row, what)
    for k in np.flatnonzero((last > CLOSED) & (first <= GROSS)).tolist():
        row = int(np.argmax(left[k]))
        what = f"no nearby positions satisfy it; {abs(terms.phi[k, row]):.3g} m or rad remain"
        faults[k] = joint_fault(scenes.model, row, what)
    return q, first, faults, terms


def _are_met(scenes: Alike, places: np.ndarray, q: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Return for scenes with indices (k,), at coordinates q (k, 7 nb), whether their gaps (k, m) are
    rounding."""
    reach = np.abs(q.reshape(len(q), scenes.model.nb, 7)[..., :3]).max(axis=(1, 2)) / scenes.length[places]
    return np.asarray(gap.max(axis=1, initial=0.0) <= MET * np.maximum(1.0, reach))


def solve_positions(model: Model, t: float, q: np.ndarray, value: Any = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Solve Φ(q, t) = value (m,) from q (7 nb,); return the coordinates reached and Φ - value (m,) there.

    Newton–Raphson steps use the pseudo-inverse, so that redundant rows and a singular start are allowed; the
    change is least in the metric of M.
    """
    found = _solved(_alone(model, t, value), q[None], np.inf)
    return found.coordinates[0], found.after.phi[0]


class Solved(NamedTuple):
    """Coordinates (s, 7 nb), the terms before and after the correction, at zero velocities, and the gaps
    (s, m) before it."""

    coordinates: np.ndarray
    before: Terms
    after: Terms
    opened: np.ndarray


def _solved(scenes: Alike, q: np.ndarray, most: float) -> Solved:
    """Return ``solve_positions`` for each scene from q (s, 7 nb), unless the largest gap exceeds
    ``most``."""
    q, every, at_rest = q.copy(), np.arange(len(q)), np.zeros((len(q), scenes.model.n))
    first = terms = scenes.terms(every, q, at_rest)
    opened = gaps(terms, scenes.length)
    places = every
    open_ = ~_are_met(scenes, every, q, opened) & (opened.max(axis=1, initial=0.0) <= most)
    if not open_.any():
        return Solved(q, first, first, opened)
    for _ in range(MOST_ITERATIONS):
        places = places[open_]
        blocks = scenes.model.structure.of_positions(terms.blocks[open_])
        x = _least_changes(scenes, places, blocks, -terms.phi[open_])
        moves = np.abs(x / scenes.units[places]).max(axis=1) >= SHORTEST_MOVE
        places, moved = places[moves], q[places[moves]]
        displace_all(moved, x[moves], np.zeros(q.shape[1]))
        q[places] = moved
        terms = scenes.terms(places, moved, at_rest[places])
        open_ = ~_are_met(scenes, places, moved, gaps(terms, scenes.length[places]))
        if not open_.any():
            break
    return Solved(q, first, scenes.terms(every, q, at_rest), opened)


def _least_changes(scenes: Alike, places: np.ndarray, blocks: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """Return the changes (k, n), least in the metric of M, for which Φ_q (blocks (k, m, 12)) times the change
    equals rhs (k, m)."""
    model, mass = scenes.model, _weights(scenes, places)
    if model.m > LARGE:
        rows = zip(blocks, mass, rhs, strict=True)
        return np.array([MinimumNorm(model.structure.sparse(block), own)(b) for block, own, b in rows])
    inverse_root = 1 / np.sqrt(mass)
    unit, rhs = unit_equations(model.structure.dense(blocks) * inverse_root[:, None], rhs)
    return inverse_root * least_norm(unit, rhs, START_RANK_TOLERANCE)


def position_weights(model: Model) -> np.ndarray:
    """Return the weights (n,) of changes of coordinates: M; a body without mass or inertia gets the largest
    mass."""
    return _weights(_alone(model), np.zeros(1, dtype=int))[0]


def _weights(scenes: Alike, places: np.ndarray) -> np.ndarray:
    """Return M (k, n) of scenes with indices (k,); a body without mass or inertia gets the largest mass."""
    mass = scenes.mass[places]
    alike = (scenes.length[places, None] / scenes.units[places]) ** 2
    if scenes.model.kinematic:
        return alike
    return np.where(mass > 0, mass, mass[:, ::6].max(axis=1, keepdims=True) * alike)
