"""Joint reactions from Lagrange multipliers: -Φ_qᵀ λ of a joint's rows, moved to its anchor.

The part of a coupling's or an armature's row that acts along a joint's coordinate is part of its reaction,
like a driver's row.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.counts import perturbed_state
from mbref.equations.initial_state import consistent_start
from mbref.equations.joint_angles import angles_of_pose
from mbref.equations.lazy import LazyMapping
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.equations.structure import MOST_KEPT, Structure
from mbref.equations.units import row_lengths
from mbref.kernels.scene_layout import COUPLED_ANGLE
from mbref.scene import Scene
from mbref.scene.bodies import DRIVER

MOST_OPEN_ROWS = 120  # rows; for more, singular values at every sample take longer than the run
OPEN = 1e-6  # singular value of unit rows / largest one: below it a combination of rows vanishes
UNBALANCED = 1e-9  # such a value, below which no reactions along the combination are computed
SHARE = 1e-6  # weight of a joint in such a combination below which it does not take part


def lazy_reactions(
    scene: Scene, times: np.ndarray, q: np.ndarray, multipliers: np.ndarray, angles: np.ndarray
) -> dict[str, Any]:
    """Return ``reactions`` by joint, and ``open_reactions`` by joint and driver, of a Motion, without those
    that are not computed.

    Arguments are times (k,) in s, q (k, nb, 7), λ (k, m), and angles (k, a) of turning joints since the
    start.
    """
    if not scene.has_mass():
        return {}
    names = tuple(joint.name for joint in scene.joint)
    found = {"reactions": LazyMapping(names, _reactions, scene, times, q, multipliers, angles)}
    if multipliers.shape[1] <= MOST_OPEN_ROWS:
        drivers = tuple(DRIVER.format(driver.joint) for driver in scene.driver)
        found["open_reactions"] = LazyMapping(names + drivers, _open_dimensions, scene, times, q, angles)
    return found


def _reactions(
    scene: Scene, times: np.ndarray, q: np.ndarray, multipliers: np.ndarray, angles: np.ndarray
) -> dict[str, np.ndarray]:
    model = Model(assembled(scene))
    blocks = model.terms(times, q, angles=angles).blocks
    found = least_reactions(model, q, blocks, multipliers, angles)
    model.release()
    return found


def least_reactions(
    model: Model,
    q: np.ndarray,
    blocks: np.ndarray,
    multipliers: np.ndarray,
    angles: np.ndarray | None = None,
    always: int | None = None,
) -> dict[str, np.ndarray]:
    """Return ``reactions`` of least norm, if redundant rows leave a choice and are few.

    ``always`` combinations of rows vanish at every pose; by default they are counted at the scene's start.
    """
    if model.m <= MOST_OPEN_ROWS:
        always = model.once(_redundant_at_start) if always is None else always
        multipliers = _of_least_norm(model, blocks, multipliers, always) if always else multipliers
    return reactions(model, q, blocks, multipliers, angles)


def _redundant_at_start(model: Model) -> int:
    """Return the number of combinations of rows that vanish at the scene's pose, and also near it: at a
    singular position more of them vanish than elsewhere."""
    found = vanishing_at(model, 0.0, model.start())
    return min(found, vanishing_at(model, *perturbed_state(model, consistent_start(model)))) if found else 0


def vanishing_at(model: Model, t: float, q: np.ndarray) -> int:
    """Return the number of combinations of rows that vanish at coordinates q (7 nb,)."""
    return vanishing_combinations(model, model.terms(t, q).blocks[None]).along.shape[-1]


def _at_every_sample(vanishing: VanishingCombinations, always: int) -> int:
    """Return the number of combinations of rows that vanish at every sample, at most ``always``."""
    found = np.any(vanishing.along != 0.0, axis=1).sum(axis=1)
    return int(found.min(initial=always))


def _of_least_norm(model: Model, blocks: np.ndarray, multipliers: np.ndarray, always: int) -> np.ndarray:
    """Return λ (k, m) without the part along combinations of rows that vanish at every pose.

    A run computes this part with a penalty, which magnifies rounding. The norm is of rows of unit length in
    the metric of projections. Near a singular position, a further combination nearly vanishes, along which
    the reactions may be large.
    """
    vanishing = vanishing_combinations(model, blocks)
    first = vanishing.along.shape[-1] - _at_every_sample(vanishing, always)
    units = row_lengths(model.structure.dense(blocks) * model.data.metric_root)
    along = (units / vanishing.lengths)[..., None] * vanishing.along[..., first:]
    part = along @ (np.linalg.pinv(along, rcond=OPEN) @ (units * multipliers)[..., None])
    return np.asarray(multipliers - part[..., 0] / units)


def _open_dimensions(
    scene: Scene, times: np.ndarray, q: np.ndarray, angles: np.ndarray
) -> dict[str, np.ndarray]:
    model = Model(assembled(scene))
    blocks = model.terms(times, q, angles=angles).blocks
    model.release()
    return open_dimensions(model, blocks)


def reactions(
    model: Model,
    q: np.ndarray,
    blocks: np.ndarray,
    multipliers: np.ndarray,
    angles: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """Return for each joint force (N) and moment (N m) (k, 6) on its second body at the anchor, world axes.

    Arguments are q (k, nb, 7), the blocks (k, m, 12) of Φ_q, λ (k, m), and the angles (k, a) of turning
    joints, by default within half a turn.
    """
    names = tuple(joint.name for joint in model.scene.joint)
    held = [j for j, name in enumerate(names) if name in model.structure.row_joint]
    body, side, of, starts = _places(model.structure, tuple(names[j] for j in held))
    rows, sign = np.arange(of.size), np.where(side == 1, -1.0, 1.0)[of]
    pulls = blocks.reshape(len(q), model.m, model.structure.sides, 6)[:, rows, side[of]]
    wrench = np.add.reduceat((sign * multipliers[:, rows])[..., None] * pulls, starts, axis=1)
    pose, force = q[:, body], wrench[..., :3]  # about the centre of mass, moments in body axes
    arm = model.anchors(q)[:, held] - pose[..., :3]
    moment = rotations.rotate(pose[..., 3:], wrench[..., 3:]) - rotations.cross(arm, force)
    found = np.zeros((len(q), len(names), 6))  # joints without rows have no reaction
    found[:, held] = np.concatenate([force, moment], axis=-1)
    _add_coupled(model, q, multipliers, names, found, angles)
    return {name: found[:, j] for j, name in enumerate(names)}


def _add_coupled(
    model: Model,
    q: np.ndarray,
    multipliers: np.ndarray,
    names: Sequence[str],
    wrench: np.ndarray,
    angles: np.ndarray | None,
) -> None:
    """Add the forces of couplings and armatures along the coordinates of joints to their wrenches (k, j, 6).

    Each is a force along, or a moment about, the axis that the first body carries.
    """
    primitives, number = model.data.primitives, {name: j for j, name in enumerate(names)}
    for p, place in enumerate(model.structure.places.primitives):
        if not place.part or place.of not in number:
            continue
        x, y = primitives.direction_first[p], primitives.turning_first[p]
        turns = place.kind == COUPLED_ANGLE
        axis = rotations.cross(x, y) if turns else x
        if place.first < model.nb:
            axis = rotations.rotate(q[:, place.first, 3:], axis[None])
        slope = primitives.length[p] + (_bend(model, q, p, angles) if primitives.higher[p].any() else 0.0)
        strength = -multipliers[:, primitives.row[p]] * slope
        components = slice(3, 6) if turns else slice(0, 3)
        wrench[:, number[place.of], components] += strength[:, None] * axis


def _bend(model: Model, q: np.ndarray, p: int, angles: np.ndarray | None) -> np.ndarray:
    """Return the part (k,) of the slope of a coupled coordinate's polynomial that depends on the
    coordinate."""
    primitives, slot = model.data.primitives, int(model.data.primitives.angle[p])
    if slot >= 0:
        every = [angles_of_pose(model, each.ravel()) for each in q] if angles is None else angles
        value = np.asarray(every)[:, slot]
    else:
        frame = np.broadcast_to([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(q), 1, 7))
        first, second = (
            np.concatenate([q, frame], axis=1)[:, body[p]] for body in (primitives.first, primitives.second)
        )
        ends = [
            pose[:, :3] + rotations.rotate(pose[:, 3:], point[None])
            for pose, point in ((first, primitives.point_first[p]), (second, primitives.point_second[p]))
        ]
        axis = rotations.rotate(first[:, 3:], primitives.direction_first[p][None])
        value = ((ends[1] - ends[0]) * axis).sum(axis=1)
    law = np.polynomial.Polynomial([0.0, 0.0, *primitives.higher[p]])
    return np.asarray(law.deriv()(value))


def open_dimensions(model: Model, blocks: np.ndarray, always: int | None = None) -> dict[str, np.ndarray]:
    """Return for each joint the number (k,) of reaction components that equilibrium does not determine at
    each sample, and for ``driver(A)`` 1 where it does not determine the force or torque of the driver.

    Redundant rows leave reactions undetermined at all times, a singular position only when the motion passes
    it. At a singular position a linear combination of rows vanishes, a left null vector of Φ_q (Wojtyra, J.
    Theor. Appl. Mech. 43, 2005). There, no finite reactions may balance the forces, and no driver's force is
    determined. The argument ``blocks`` (k, m, 12) contains Φ_q, and ``always`` is as for ``least_reactions``.
    """
    combinations = vanishing_combinations(model, blocks)
    vanishing = combinations.along
    always = _at_every_sample(combinations, model.once(_redundant_at_start) if always is None else always)
    is_singular = (combinations.values < UNBALANCED).sum(axis=1) > always
    rows = dict.fromkeys((joint.name for joint in model.scene.joint), slice(0))  # joints without rows
    held = tuple(name for name in rows if name in model.structure.row_joint)
    _, _, of, starts = _places(model.structure, held)
    rows |= {name: slice(*pair) for name, pair in zip(held, pairwise([*starts, of.size]), strict=True)}
    for d, driver in enumerate(model.scene.driver):
        row = int(model.structure.row[model.structure.driver == d][0])
        rows[DRIVER.format(driver.joint)] = slice(row, row + driver.rows)
    found = {name: np.sum(_singular_values(vanishing[:, own]) > SHARE, axis=1) for name, own in rows.items()}
    for driver in model.scene.driver:
        found[DRIVER.format(driver.joint)] |= is_singular
    return found


def determined_components(
    model: Model, q: np.ndarray, blocks: np.ndarray, angles: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Return by joint which components (k, 6) of its reaction every solution of equilibrium shares.

    Force and moment on the second body at the anchor, along world axes; from q (k, nb, 7), the blocks (k, m,
    12) of Φ_q and angles as for ``reactions``. A component is undetermined if a vanishing combination of
    rows, added to the multipliers, changes the component.
    """
    found = {joint.name: np.ones((len(q), 6), dtype=bool) for joint in model.scene.joint}
    for changes in open_changes(model, q, blocks, angles):
        for name, change in changes.items():
            found[name] &= np.abs(change) <= SHARE
    return found


def open_changes(
    model: Model, q: np.ndarray, blocks: np.ndarray, angles: np.ndarray | None = None
) -> Iterator[dict[str, np.ndarray]]:
    """Yield by joint the changes (k, 6) of its reaction by each vanishing combination of unit rows, with
    forces times the mechanism's length; arguments as for ``reactions``."""
    vanishing = vanishing_combinations(model, blocks)
    units = np.repeat([model.length, 1.0], 3)
    for k in range(vanishing.along.shape[-1]):
        found = reactions(model, q, blocks, vanishing.along[..., k] / vanishing.lengths, angles)
        yield {name: change * units for name, change in found.items()}


class VanishingCombinations(NamedTuple):
    """Left null vectors (k, m, c) of unit rows, the lengths (k, m) of the rows, and the singular values
    (k, c) of the vectors over the largest one."""

    along: np.ndarray
    lengths: np.ndarray
    values: np.ndarray


def vanishing_combinations(model: Model, blocks: np.ndarray) -> VanishingCombinations:
    """Return left null vectors of the unit rows of Φ_q.

    Displacements are in units of the mechanism, so that its size has no influence. The argument is Φ_q as
    blocks (k, m, 12). Samples with fewer null vectors than other samples have zeros in place of the missing
    vectors, and their singular values.
    """
    jacobian = model.structure.dense(blocks) * model.units
    lengths = row_lengths(jacobian)
    left, values, _ = np.linalg.svd(jacobian / lengths[..., None])
    values = values / np.maximum(values.max(axis=1, initial=0.0), 1e-300)[:, None]
    rank = np.sum(values > OPEN, axis=1)
    least = int(rank.min(initial=model.m))
    missing = np.zeros((len(values), model.m - values.shape[1]))  # more rows than coordinates
    return VanishingCombinations(
        (left * (np.arange(model.m) >= rank[:, None])[:, None, :])[..., least:],
        lengths,
        np.concatenate([values, missing], axis=1)[:, least:],
    )


def _singular_values(matrices: np.ndarray) -> np.ndarray:
    """Return singular values (k, …) of matrices (k, r, c): the length of a single column."""
    if matrices.shape[-1] < 2:
        return np.sqrt((matrices * matrices).sum(axis=1))
    return np.asarray(np.linalg.svd(matrices, compute_uv=False))


class JointPlaces(NamedTuple):
    """For every joint: the body in whose coordinates its wrench is computed, first or second body (0 or 1),
    and its rows."""

    body: np.ndarray
    side: np.ndarray
    of: np.ndarray  # joint of each row
    starts: np.ndarray  # first row of each joint; the rows of a joint are adjacent


@functools.lru_cache(maxsize=MOST_KEPT)
def _places(structure: Structure, names: tuple[str, ...]) -> JointPlaces:
    """Return the places of the named joints, which are the first joints with rows in the structure."""
    number = {name: j for j, name in enumerate(names)}
    of = np.array([number[name] for name in structure.row_joint if name in number], dtype=int)
    starts = np.searchsorted(of, np.arange(len(names)))
    bodies = structure.row_bodies[starts]
    side = (bodies[:, 1] < structure.nb).astype(int)
    return JointPlaces(bodies[np.arange(len(names)), side], side, of, starts)
