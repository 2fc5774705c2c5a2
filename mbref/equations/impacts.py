"""Impacts: jumps of velocities where constraints begin to hold, by impulses of all constraints.

M (v⁺ - v⁻) = -Φ_qᵀ Λ,   Φ_q v⁺ = ν

The change is the least one in the metric of M, so that momentum along the directions that stay free is
constant. Redundant rows leave a choice of Λ; the multipliers of unit rows have the least norm.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.equations.initial_state import consistent_start, position_weights
from mbref.equations.joint_reactions import least_reactions, open_dimensions, vanishing_at
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.equations.units import row_lengths
from mbref.scene import Driver, Scene, SceneError

IMPACT_RANK = 1e-9  # singular value of unit rows / largest one, below which a row counts as redundant
NO_VELOCITIES = 1e-8  # residual of unit rows / speed in the metric of M, above which no velocities obey them


class Impact(NamedTuple):
    """Velocities and impulses of an impact of nb bodies.

    ``velocity`` and ``angular_velocity`` (nb, 3) after it, world axes; ``impulses`` (6,) by joint, N s and
    N m s, on its second body at its anchor; ``open`` counts by joint the components that the equations leave
    open; ``energy`` is the kinetic energy before and after the impact, J, with rotors of armatures;
    ``of_drivers`` (d,) are the impulses along the coordinates of the drivers of joints, N s or N m s.
    """

    velocity: np.ndarray
    angular_velocity: np.ndarray
    impulses: dict[str, np.ndarray]
    open: dict[str, int]
    energy: tuple[float, float]
    of_drivers: np.ndarray


def impact(before: Scene, after: Scene) -> Impact:
    """Return the impact of a scene on the constraints of another one, with equal bodies and poses.

    The velocities of ``before`` obey its own constraints.  Raises SceneError, with the reason, if no
    velocities obey the constraints of ``after``, as where drivers contradict them.
    """
    model, v = Model(after), consistent_start(Model(before)).v
    q = model.start()
    terms = model.terms(0.0, q, v)
    change, multipliers = _least_change(model, terms.jacobian, terms.nu - terms.jacobian @ v)
    poses, w = q.reshape(1, model.nb, 7), v + change
    _refuse_contradiction(model, terms.jacobian, terms.nu - terms.jacobian @ w, np.append(v, w))
    motion = model.motion(poses, w.reshape(1, model.nb, 6), np.zeros((1, model.nb, 6)))
    blocks, energy = terms.blocks[None], (float(v @ (model.mass * v)) / 2, float(w @ (model.mass * w)) / 2)
    redundant = vanishing_at(model, 0.0, q)
    wrenches = least_reactions(model, poses, blocks, multipliers[None], always=redundant)
    marks = open_dimensions(model, blocks, redundant)
    rows = [model.structure.row[model.structure.driver == d][0] for d in range(len(after.driver))]
    model.release()
    return Impact(
        motion["velocity"][0],
        motion["angular_velocity"][0],
        {name: wrench[0] for name, wrench in wrenches.items()},
        {name: int(marks[name][0]) for name in wrenches},
        energy,
        -multipliers[np.array(rows, dtype=int)],
    )


def is_locked(scene: Scene, joint: str) -> bool:
    """Return whether joints and couplings of a scene lock the coordinate of a joint that a driver could
    prescribe, at the scene's poses: its row is a combination of theirs. Drivers may move it."""
    model = Model(assembled(scene).with_(driver=[Driver(joint=joint, polynomial=(0.0,))]))
    root, rows = 1 / np.sqrt(position_weights(model)), model.terms(0.0, model.start()).jacobian
    unit = rows * root / row_lengths(rows * root)[:, None]
    own = model.structure.row[model.structure.driver == 0][0]
    others = np.delete(unit, own, axis=0)
    left = unit[own] - others.T @ np.linalg.lstsq(others.T, unit[own], rcond=IMPACT_RANK)[0]
    model.release()
    return bool(np.linalg.norm(left) < NO_VELOCITIES)


def _least_change(model: Model, jacobian: np.ndarray, rhs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the change (n,) with Φ_q change = rhs (m,) that is least in the metric of M, and Λ (m,).

    A massless body follows the bodies with mass.
    """
    if not rhs.size:
        return np.zeros(model.n), rhs
    root, has_mass = 1 / np.sqrt(position_weights(model)), model.mass > 0
    lengths = row_lengths(jacobian * root)
    left, values, right = np.linalg.svd(jacobian * root / lengths[:, None], full_matrices=not has_mass.all())
    rank = int((values > IMPACT_RANK * values.max()).sum())
    left, values, right, free = left[:, :rank], values[:rank], right[:rank], right[rank:].T
    x = right.T @ (left.T @ (rhs / lengths) / values)
    if not has_mass.all():
        x -= free @ np.linalg.lstsq(free * has_mass[:, None], has_mass * x, rcond=IMPACT_RANK)[0]
    return root * x, -left @ (right @ (has_mass * x) / values) / lengths


def _refuse_contradiction(model: Model, jacobian: np.ndarray, left: np.ndarray, v: np.ndarray) -> None:
    """Raise SceneError if residuals (m,) are more than rounding of velocities (2 n,), before and after."""
    root = 1 / np.sqrt(position_weights(model))
    off = np.abs(left) / row_lengths(jacobian * root)
    if off.max(initial=0.0) > NO_VELOCITIES * np.linalg.norm(v / np.tile(root, 2)):
        worst = model.row_joint[int(off.argmax())]
        raise SceneError([f"the drivers contradict the constraints then, most of all {worst!r}"])
