"""The branches of motion that meet at a singular position, to second order.

At a pose where the rank of Φ_q drops, more velocities are possible, and each left null vector w of Φ_q gives
an equation of second order, wᵀ γ(q, v, t) = 0: the quadratic cone of A. Müller (Mech. Mach. Theory 2016) and
P. C. López-Custodio et al. (2020).  With time as one more coordinate, u = (v, t'), both equations are
homogeneous: [Φ_q -ν] u = 0 and wᵀ (γ₂(v, v) + t' γ₁(v) + t'² γ₀) = 0.  Two different directions u belong to
two branches that cross. A double direction u is a common tangent of branches, which only higher orders can
separate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.equations.model import Model
from mbref.equations.units import row_lengths
from mbref.input_error import InputError
from mbref.linear_algebra.least_norm import unique_basis

SMOOTH = 1  # number of the smooth branch, which is taken unless another is requested
MOST_BRANCHED_ROWS = 120  # constraint rows; for more, the analysis takes longer than the run
RANK = 1e-6  # relative singular value that counts as zero at a singular position
ZERO_FORM = 1e-7  # relative size of a quadratic form below which it counts as zero
SAME = 1e-4  # rad; directions at a smaller angle count as equal
BROAD = 0.05  # distance of multiple roots, to which Newton's method converges slowly
ZERO_AT_ROOT = 1e-12  # size of the forms at a root
# number of starts and iterations of Newton's method for more than two degrees of freedom
ROOT_STARTS, ROOT_ITERATIONS = 200, 40

NO_OTHER = "the smooth branch only"
ALONE = "one branch"
ALL_AGREE = "all directions agree with the constraints to second order"
TANGENT = "branches with a common tangent, which second order does not separate"
NOT_LOOKED_FOR = f"branches of scenes with more than {MOST_BRANCHED_ROWS} rows are not computed"
MULTIPLE = " and others that second order does not determine"
CONE = "infinitely many directions (a cone); the smooth one is listed"


class Branches(NamedTuple):
    """Velocities (b, n) of the branches, the branch of the motion first, and a sentence on what second order
    determines."""

    velocities: np.ndarray
    sentence: str


class Passed(NamedTuple):
    """A crossing at a time (s): coordinates (7 nb,), velocities (n,) on the smooth branch, and the branch
    taken, from 1."""

    time: float
    coordinates: np.ndarray
    velocities: np.ndarray
    taken: int


class Fit(NamedTuple):
    """Test result: whether velocities at a singular position belong to a branch to second order, and to one
    branch only."""

    fits: bool
    is_simple: bool


class SecondOrder(NamedTuple):
    """Directions (n + 1, d) that the constraints allow to first order, and the quadratic forms (c, d, d) of
    second order."""

    kernel: np.ndarray
    forms: np.ndarray
    scale: np.ndarray  # scaling of velocities and time that gives columns of unit length


def branches(model: Model, t: float, q: np.ndarray, v: np.ndarray) -> Branches:
    """Return the branches at a singular position, q (7 nb,) at t (s), which a motion passes with velocities v
    (n,).

    If drivers exist, they determine a branch's velocities. Without drivers all branches have the kinetic
    energy of v.
    """
    found = second_order(model, t, q, v)
    freedoms = found.kernel.shape[1]
    mine = _direction(found, v)
    if freedoms < 2:
        return Branches(v[None], NO_OTHER)
    if not len(found.forms):
        return Branches(v[None], ALL_AGREE)
    roots, sort = _lines(found)
    if sort == CONE:
        return Branches(v[None], CONE)
    if freedoms == 2 and len(found.forms) == 1 and len(roots) == 1:
        return Branches(v[None], TANGENT)
    if not mine.any():  # at rest, v is the velocity of each branch
        count = max(1, len(roots))
        return Branches(np.tile(v, (count, 1)), (f"{count} branches" if count > 1 else ALONE) + sort)
    velocities = [_velocity(model, found, a, v) for a in roots if _angle(a, mine) > SAME]
    velocities = [w for w in velocities if w is not None]
    sentence = f"{1 + len(velocities)} branches" if velocities else ALONE
    return Branches(np.array([v, *velocities]), sentence + sort)


def tangents(model: Model, q: np.ndarray) -> np.ndarray:
    """Return directions (b, n) of the branches of undriven motions that meet at q (7 nb,).

    The result is empty if second order does not give simple directions.
    """
    found = second_order(model, 0.0, q, np.zeros(model.n))
    along = [((found.kernel @ a) * found.scale)[:-1] for a in _lines(found)[0]]
    return np.array(along) if along else np.zeros((0, model.n))


def fit_to_branches(model: Model, t: float, q: np.ndarray, v: np.ndarray) -> Fit | None:
    """Return how velocities v (n,) agree with the branches at q (7 nb,), t (s); None if no branches meet."""
    found = second_order(model, t, q, v)
    if not _is_singular(found):
        return None
    a = _direction(found, v)
    rank = np.linalg.matrix_rank(2.0 * found.forms @ a, tol=SAME)
    return Fit(
        fits=_fits(found, a),
        is_simple=bool(rank == min(len(found.forms), len(a) - 1)),
    )


def velocities_along(model: Model, q: np.ndarray, v: np.ndarray, given: np.ndarray) -> list[np.ndarray]:
    """Return velocities (n,) of the branches at q (7 nb,), t = 0, that agree with the given entries (n,) of v
    (n,).

    Branches with the least kinetic energy come first. The list is empty if v fits a branch itself, or if
    second order decides no branch.
    """
    found = second_order(model, 0.0, q, v)
    if not _is_singular(found) or _fits(found, _direction(found, v)):
        return []
    along = [_as_given((found.kernel @ a) * found.scale, v, given) for a in _lines(found)[0]]
    return sorted((w for w in along if w is not None), key=lambda w: float(w @ (model.mass * w)))


def _as_given(u: np.ndarray, v: np.ndarray, given: np.ndarray) -> np.ndarray | None:
    """Return a direction (n + 1,) scaled to the given entries of v, or to the rate of time; None if the
    direction does not agree with them."""
    velocities, share = u[:-1], u[:-1] @ np.where(given, u[:-1], 0.0)
    if abs(u[-1]) > SAME * np.linalg.norm(u):
        velocities = velocities / u[-1]
    elif share > SAME**2 * (u @ u):
        velocities = velocities * (velocities @ np.where(given, v, 0.0)) / share
    off = np.abs(np.where(given, velocities - v, 0.0)).max()
    return velocities if off <= SAME * np.abs(v).max() else None


def second_order(model: Model, t: float, q: np.ndarray, v: np.ndarray) -> SecondOrder:
    """Return the constraints at q (7 nb,) to second order: rows of unit length, columns scaled by the lengths
    of bodies.

    Time is scaled by the velocities v (n,), and left out if nothing depends on it.
    """
    at_rest = model.terms(t, q)
    lengths = np.column_stack([np.ones((model.nb, 3)), np.tile(1.0 / model.data.lengths[:, None], 3)]).ravel()
    rows = row_lengths(at_rest.jacobian * lengths)
    driven = bool(np.any(at_rest.nu) or np.any(at_rest.gamma))
    scale = np.append(lengths, 1.0 / (np.linalg.norm(v / lengths) or 1.0) if driven else 0.0)
    first = np.column_stack([at_rest.jacobian, -at_rest.nu]) * scale / rows[:, None]
    left, values, right = np.linalg.svd(first if driven else first[:, :-1])
    rank = int(np.sum(values > RANK * values.max(initial=0.0)))
    kernel = unique_basis(right[rank:].T)  # so that the branches' order does not depend on rounding
    kernel = kernel if driven else np.vstack([kernel, np.zeros(kernel.shape[1])])
    null = left[:, rank:].T / rows
    return SecondOrder(kernel, _independent(_forms(model, t, q, kernel * scale[:, None], null)), scale)


def _forms(model: Model, t: float, q: np.ndarray, directions: np.ndarray, null: np.ndarray) -> np.ndarray:
    """Return wᵀ γ as quadratic forms (c, d, d) of d directions (n + 1, d), for c left null vectors (c, m)."""
    d = directions.shape[1]
    i, j = np.tril_indices(d)
    one, other = directions.T[i], directions.T[j]
    sums, differences = np.split(_rates(model, t, q, np.concatenate([one + other, one - other])), 2)
    forms = np.zeros((len(null), d, d))
    forms[:, i, j] = forms[:, j, i] = null @ (sums - differences).T / 4
    return forms


def _rates(model: Model, t: float, q: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return second-order terms (k, m) along directions u (k, n + 1): γ₂ + t' γ₁ + t'² γ₀."""
    count, v, time = len(directions), directions[:, :-1], directions[:, -1:]
    velocities = np.concatenate([v, -v, np.zeros((1, model.n))])
    states = len(velocities)
    gamma = model.terms(np.full(states, t), np.tile(q, (states, 1)), velocities).gamma
    there, back, at_rest = gamma[:count], gamma[count:-1], gamma[-1]
    return (there + back) / 2 - at_rest + time * (there - back) / 2 + time**2 * at_rest


def _independent(forms: np.ndarray) -> np.ndarray:
    """Return the smallest set of forms, of unit size, that have equal zeros."""
    count, d, _ = forms.shape
    if not forms.size:
        return np.zeros((0, d, d))
    _, sizes, right = np.linalg.svd(forms.reshape(count, d * d), full_matrices=False)
    return right[sizes > ZERO_FORM * max(1.0, sizes.max(initial=0.0))].reshape(-1, d, d)


def _values(forms: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.einsum("kij,i,j->k", forms, a, a)


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle (rad) between two lines."""
    return float(np.arccos(min(1.0, abs(a @ b))))


def _is_singular(found: SecondOrder) -> bool:
    """Return whether a position has more first-order degrees of freedom than any motion of second order."""
    return found.kernel.shape[1] >= 2 and len(found.forms) > 0


def _fits(found: SecondOrder, a: np.ndarray) -> bool:
    """Return whether all forms are zero along a direction (d,)."""
    return bool(np.abs(_values(found.forms, a)).max() < SAME)


def _lines(found: SecondOrder) -> tuple[list[np.ndarray], str]:
    """Return isolated directions (d,) on which all forms are zero, and a text on further directions: CONE,
    MULTIPLE or empty."""
    if not _is_singular(found):
        return [], ""
    several = (_roots(found.forms[0]), False) if len(found.kernel.T) == 2 else _roots_of_many(found.forms)
    if several is None:
        return [], CONE
    roots, multiple = several
    return [a for a in roots if _fits(found, a)], MULTIPLE * multiple


def _roots(form: np.ndarray) -> list[np.ndarray]:
    """Return the lines through the origin on which a form of two variables is zero: no line, a double line,
    or two lines."""
    values, axes = np.linalg.eigh(form)
    if values[0] * values[1] > SAME**2:
        return []
    tangent = np.sqrt(max(0.0, -values[0] / values[1])) if values[1] > -values[0] else None
    weights = (1.0, tangent) if tangent is not None else (np.sqrt(max(0.0, -values[1] / values[0])), 1.0)
    lines = [axes @ (np.array([weights[0], sign * weights[1]])) for sign in (1.0, -1.0)]
    lines = [a / np.linalg.norm(a) for a in lines]
    # axes and their order have no fixed sign
    lines.sort(key=lambda a: float(np.arctan2(a[1], a[0]) % np.pi))
    return lines[:1] if _angle(*lines) < SAME else lines


def _roots_of_many(forms: np.ndarray) -> tuple[list[np.ndarray], bool] | None:
    """Return simple lines on which all forms are zero, by Newton's method from random starts, and whether
    multiple lines exist.

    None if lines are not isolated: at most 2ᵈ⁻¹ isolated lines exist (Bézout).
    """
    (_, d, _), random = forms.shape, np.random.default_rng(0)
    simple: list[np.ndarray] = []
    multiple: list[np.ndarray] = []
    for _ in range(ROOT_STARTS if len(forms) >= d - 1 else 0):
        a, left, is_simple = _root_from(forms, np.asarray(random.normal(size=d)))
        known, near = (simple, SAME) if is_simple else (multiple, BROAD)
        if left <= ZERO_AT_ROOT and all(_angle(a, b) >= near for b in known):
            known.append(a)
        if len(simple) + len(multiple) > 2 ** (d - 1):
            return None
    return (simple, bool(multiple)) if len(forms) >= d - 1 else None


def _root_from(forms: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, float, bool]:
    """Return the end of Newton's method from a, the largest form there, and whether the end is a simple
    root."""
    for _ in range(ROOT_ITERATIONS):
        a = a / np.linalg.norm(a)
        a = a - np.linalg.lstsq(2.0 * forms @ a, _values(forms, a), rcond=None)[0]
    a = a / np.linalg.norm(a)
    full = np.linalg.matrix_rank(2.0 * forms @ a, tol=SAME) == len(a) - 1
    left = float(np.abs(_values(forms, a)).max())
    return a, left, bool(full)


def _direction(found: SecondOrder, v: np.ndarray) -> np.ndarray:
    """Return the direction (d,) of unit length of a motion's velocities."""
    scale = np.where(found.scale > 0, found.scale, 1.0)
    u = np.append(v, float(found.scale[-1] > 0)) / scale
    a = found.kernel.T @ u
    return a / (np.linalg.norm(a) or 1.0)


def _velocity(model: Model, found: SecondOrder, a: np.ndarray, v: np.ndarray) -> np.ndarray | None:
    """Return the velocities (n,) of a branch; None for a branch with constant time."""
    u = (found.kernel @ a) * found.scale
    if found.scale[-1] > 0:
        return u[:-1] / u[-1] if abs(u[-1]) > SAME * np.linalg.norm(u) else None
    energy, own = v @ (model.mass * v), u[:-1] @ (model.mass * u[:-1])
    along = v @ (model.mass * u[:-1])
    return u[:-1] * np.copysign(np.sqrt(energy / own), along)


def branches_passed(model: Model, passed: Passed) -> Branches:
    """Return the branches at a crossing that a motion passed; the first branch is the smooth branch.

    Raises InputError if the requested branch does not exist.
    """
    t, q, v, taken = passed
    found = Branches(v[None], NOT_LOOKED_FOR) if model.m > MOST_BRANCHED_ROWS else branches(model, t, q, v)
    if taken > len(found.velocities):
        raise InputError(f"branches: the crossing at t = {t:.6g} s has no branch {taken}: {found.sentence}")
    return found
