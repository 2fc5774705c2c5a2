"""Motion equations: rows and columns of a mechanism that moves in parallel planes, without repeated rows.

Links of a real planar mechanism lie side by side. A point at a distance from its body's plane couples the
rows in the plane with rotations out of the plane, so that no row or column drops out by itself. Where bodies
cannot leave their planes, whatever the forces, the rows and columns in the plane alone determine the motion.
The rows out of the plane only carry reactions, which samples compute from all rows.

A pair of bodies is locked to the plane if the rows between them without entries in the plane fix their
displacement out of the plane and both rotations. All bodies that can move must be connected to the ground
by locked pairs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.active_coordinates import STATES, random_states
from mbref.equations.initial_state import Start
from mbref.equations.model import Model, Terms
from mbref.linear_algebra.connected_parts import connected_parts
from mbref.scene.joints import Fixed

ROUNDED_TERM = 1e-12  # entry or right-hand side / the largest of its kind, below which it is rounding
LOCKED = 1e-3  # smallest singular value of unit rows that lock a pair of bodies
EQUAL = 1e-9  # largest difference of rows with a largest entry of 1 that repeat each other


class MotionEquations(NamedTuple):
    """Columns (n,) and entries (m, width) of the Jacobian that determine the motion."""

    moving: np.ndarray
    entries: np.ndarray


def motion_equations(
    model: Model, start: Start, moving: np.ndarray, entries: np.ndarray
) -> MotionEquations | None:
    """Return the part of the active columns (n,) and entries (m, width) that determines the motion; None if
    that is all of them."""
    plane = _plane(model, start, moving, entries)
    columns, inside = plane or (moving, entries)
    kept = _without_repeated(model, start, columns, inside)
    if plane is None and kept[entries.any(axis=1)].all():
        return None
    return MotionEquations(columns, inside & kept[:, None])


def _nonzero(terms: Terms, entries: np.ndarray) -> np.ndarray:
    """Return which of the entries (m, width) are more than rounding at one of k states."""
    blocks = np.abs(np.where(entries, terms.blocks, 0.0))
    found: np.ndarray = (blocks > ROUNDED_TERM * blocks.max(axis=2, keepdims=True, initial=0.0)).any(axis=0)
    return found


def _of_columns(model: Model, columns: np.ndarray) -> np.ndarray:
    """Return which entries (m, width) of the blocks belong to the given columns (n,)."""
    found: np.ndarray = np.append(columns, np.zeros(6, dtype=bool))[model.entry_columns]
    return found


def _terms(model: Model, start: Start, columns: np.ndarray) -> Terms:
    """Return the terms at random states in which the given columns (n,) are displaced and move."""
    times, q, v = random_states(STATES, model.n).of(columns).about(start.q, model.scene.duration)
    return model.terms(times, q, v)


def _plane(model: Model, start: Start, moving: np.ndarray, entries: np.ndarray) -> MotionEquations | None:
    """Return the moving columns (n,) in the plane of a planar mechanism, and their entries; None for other
    mechanisms, and if all moving columns are in the plane."""
    for normal in (2, 1, 0):
        plane = _columns_in_plane(model, start, normal)
        columns = plane & moving
        if not (moving & ~plane).any():
            return None
        if columns.any() and not start.v[~plane].any():
            terms = _terms(model, start, columns)
            nonzero = _nonzero(terms, entries)
            pairs = _locked_pairs(model, terms, plane, moving, entries, nonzero)
            if _hang_on_ground(model.nb, pairs)[moving.reshape(-1, 6).any(axis=1)].all():
                return MotionEquations(columns, _of_columns(model, columns) & nonzero)
    return None


def _columns_in_plane(model: Model, start: Start, normal: int) -> np.ndarray:
    """Return the velocities (n,) in the planes perpendicular to a world axis.

    A rotation in the plane is about a principal axis of the body. A body without such an axis has none.
    """
    axes = rotations.to_matrix(start.q.reshape(-1, 7)[:, 3:])[:, normal]
    found = np.zeros((model.nb, 6), dtype=bool)
    found[:, :3] = np.arange(3) != normal
    found[:, 3:] = np.abs(np.abs(axes) - 1.0) < ROUNDED_TERM
    return found.ravel()


def _locked_pairs(
    model: Model,
    terms: Terms,
    plane: np.ndarray,
    moving: np.ndarray,
    entries: np.ndarray,
    nonzero: np.ndarray,
) -> np.ndarray:
    """Return the pairs (p, 2) of bodies that rows without entries in the plane lock to each other, at all of
    k states; none if these rows require a motion.

    Arguments are the columns (n,) in the plane, the columns that can move, the entries (m, width), and which
    of these are nonzero in the terms.
    """
    bodies = model.structure.row_bodies
    holding = ~(nonzero & _of_columns(model, plane)).any(axis=1) & entries.any(axis=1)
    for values in (terms.phi, terms.nu, terms.gamma):
        rounding = ROUNDED_TERM * max(1.0, np.abs(values).max(initial=0.0))
        if np.abs(values[:, holding]).max(initial=0.0) > rounding:
            return np.zeros((0, 2), dtype=int)
    rows = np.flatnonzero(holding & (bodies[:, 2:] == model.nb).all(axis=1))
    order = np.argsort(bodies[rows, :2], axis=1)
    pairs, of_pair = np.unique(np.sort(bodies[rows, :2], axis=1), axis=0, return_inverse=True)
    blocks = np.where(entries, terms.blocks, 0.0)[:, rows, :12].reshape(len(terms.blocks), len(rows), 2, 6)
    units, out = np.tile(model.units[:6], (model.nb + 1, 1)), np.zeros((model.nb + 1, 6), dtype=bool)
    out[:-1] = (moving & ~plane).reshape(-1, 6)
    locked = np.ones(len(pairs), dtype=bool)
    for side in (0, 1):
        own = blocks[:, np.arange(len(rows)), order[:, side]] * (units * out)[pairs[of_pair.ravel(), side]]
        own = own / np.maximum(np.linalg.norm(own, axis=2, keepdims=True), np.finfo(float).tiny)
        gram = np.zeros((len(pairs), len(blocks), 6, 6))
        np.add.at(gram, of_pair.ravel(), np.swapaxes(own[..., :, None] * own[..., None, :], 0, 1))
        ranks = (np.linalg.eigvalsh(gram) > LOCKED**2).sum(axis=2).min(axis=1)
        locked &= ranks == out[pairs[:, side]].sum(axis=1)
    return pairs[locked]


def _hang_on_ground(nb: int, pairs: np.ndarray) -> np.ndarray:
    """Return which bodies (nb,) are connected to the ground by pairs (p, 2)."""
    label = connected_parts(nb + 1, pairs)
    held: np.ndarray = label[:nb] == label[nb]
    return held


def _without_repeated(model: Model, start: Start, columns: np.ndarray, entries: np.ndarray) -> np.ndarray:
    """Return which rows (m,) have entries (m, width), without rows that repeat an earlier row up to a factor.

    Rows are compared as functions of the motions of rigid groups of bodies, at random states in which the
    given columns (n,) move: bearings of a shaft that is made of several bodies repeat each other.
    """
    group = _rigid_groups(model)
    times, q, v = random_states(STATES, model.n).of(columns).about(start.q, model.scene.duration)
    q, v = _rigid(group, start, q.reshape(STATES, -1, 7), v.reshape(STATES, -1, 6))
    terms = model.terms(times, q.reshape(STATES, -1), v.reshape(STATES, -1))
    kept = np.asarray(entries.any(axis=1))
    bodies = model.structure.row_bodies
    of_group = np.append(group, model.nb)[bodies[:, :2]]
    of_pair = (bodies[:, 2:] == model.nb).all(axis=1) & (of_group[:, 0] != of_group[:, 1])
    rows = np.flatnonzero(of_pair & kept)
    blocks = np.where(entries, terms.blocks, 0.0)[:, rows, :12].reshape(STATES, len(rows), 2, 6)
    sides, gamma = _by_groups(np.append(group, model.nb), bodies[rows, :2], blocks, q, v)
    sides *= np.append(columns, np.ones(6, dtype=bool)).reshape(-1, 6)[of_group[rows]]
    order = np.argsort(of_group[rows], axis=1)
    sides = np.take_along_axis(sides, order[None, :, :, None], axis=2)
    rates = [terms.phi[:, rows], terms.nu[:, rows], terms.gamma[:, rows] - gamma]
    unit = np.concatenate([sides.reshape(STATES, len(rows), 12), np.stack(rates, axis=2)], axis=2)
    unit, numbers = np.moveaxis(unit, 0, 1).reshape(len(rows), STATES * 15), np.arange(len(rows))
    largest = unit[numbers, np.abs(unit[:, :12]).argmax(axis=1)]  # at the first state
    unit = unit / np.where(largest != 0.0, largest, 1.0)[:, None]
    low, high = np.sort(of_group[rows], axis=1).T
    key = unit @ np.random.default_rng(1).normal(size=unit.shape[1])  # equal for equal rows
    order = np.lexsort((numbers, np.round(key, 6), high, low))
    before, after = order[:-1], order[1:]
    same = (low[before] == low[after]) & (high[before] == high[after])
    same &= (np.abs(unit[before] - unit[after]).max(axis=1, initial=0.0) < EQUAL) & (largest[after] != 0.0)
    kept[rows[after[same]]] = False
    return kept


def _rigid_groups(model: Model) -> np.ndarray:
    """Return for each body (nb,) the first body to which fixed joints connect it."""
    pairs = [joint.bodies for joint in model.scene.joint if isinstance(joint, Fixed)]
    ends = np.array([[model.index(name) for name in pair] for pair in pairs], dtype=int).reshape(-1, 2)
    ends = ends[(ends < model.nb).all(axis=1)]
    label = connected_parts(model.nb, ends)
    first: np.ndarray = np.unique(label, return_index=True)[1][label]
    return first


def _rigid(group: np.ndarray, start: Start, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return states (k, nb, 7), (k, nb, 6) in which bodies follow the first body of their group."""
    here, first = start.q.reshape(-1, 7), start.q.reshape(-1, 7)[group]
    lead, back = q[:, group], rotations.conjugate(first[:, 3:])
    arm = rotations.rotate(lead[..., 3:], rotations.rotate(back, here[:, :3] - first[:, :3]))
    turned = rotations.multiply(lead[..., 3:], rotations.multiply(back, here[:, 3:]))
    spin = rotations.rotate(lead[..., 3:], v[:, group, 3:])
    own = rotations.rotate(rotations.conjugate(turned), spin)
    places = np.concatenate([lead[..., :3] + arm, turned], axis=-1)
    return places, np.concatenate([v[:, group, :3] + np.cross(spin, arm), own], axis=-1)


def _by_groups(
    group: np.ndarray, bodies: np.ndarray, blocks: np.ndarray, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return entries (k, r, 2, 6) of rows on two bodies each, by the velocities of the first bodies of their
    groups; and the part (k, r) of γ by centripetal accelerations in the groups."""
    pose = np.concatenate([q, np.broadcast_to(np.eye(7)[3], (len(q), 1, 7))], axis=1)  # and of the ground
    spin = np.concatenate([rotations.rotate(q[..., 3:], v[..., 3:]), np.zeros((len(q), 1, 3))], axis=1)
    own, lead, turn = pose[:, bodies], pose[:, group[bodies]], spin[:, bodies]
    arm, force = own[..., :3] - lead[..., :3], blocks[..., :3]
    turning = rotations.rotate(own[..., 3:], blocks[..., 3:]) + np.cross(arm, force)
    turning = rotations.rotate(rotations.conjugate(lead[..., 3:]), turning)
    centripetal = np.cross(turn, np.cross(turn, arm))
    return np.concatenate([force, turning], axis=-1), (force * centripetal).sum(axis=(2, 3))
