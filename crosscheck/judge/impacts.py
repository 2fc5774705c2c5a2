"""Impacts by the judge: velocities after constraints begin to hold, impulses, and balances of a run's events.

Twists x (6 nb,) are velocities of the centres of mass and angular velocities, world axes.  After an impact
J x = b holds, and x is nearest to the twists before it in the metric of the mass matrix: a particular
solution plus a combination of the null space of J.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import nnls

from crosscheck.judge.constraints import jacobian
from crosscheck.judge.joint_coordinates import Reflected, reflected
from crosscheck.judge.joint_reactions import of_multipliers, on_second, unit_rows
from crosscheck.judge.loads import mass_matrix, world_inertia
from crosscheck.judge.pieces import State, without_rounding
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.scene import Scene, SceneError

CONTRADICTED = 1e-8  # residual of unit rows / largest twist, above which no twists obey the constraints


class Impact(NamedTuple):
    """State after an impact, impulses (6,) by joint on its second body at its anchor (N s, N m s), and the
    kinetic energy of the twists that are lost, J."""

    state: State
    impulses: dict[str, np.ndarray]
    lost: float


def impact(after: Scene, state: State) -> Impact:
    """Return the impact of a state on the constraints of a scene, whose bodies are at the poses of the state.

    Redundant impulses have the least norm for unit rows.  Raises SceneError if no twists obey the rows.
    """
    rows, wanted = jacobian(after, 0.0, state.position, state.orientation)
    before = np.hstack([state.velocity, state.angular_velocity]).ravel()
    mass, geared = _mass_matrix(after, state)
    change = _change(after, rows, wanted - rows @ before, mass)
    left = np.abs(rows @ (before + change) - wanted)
    if left.max(initial=0.0) > CONTRADICTED * max(np.abs(before).max(), np.abs(change).max()):
        raise SceneError(["the drivers contradict constraints that begin to hold"])
    twists = (before + change).reshape(-1, 6)
    found = state._replace(velocity=twists[:, :3].copy(), angular_velocity=twists[:, 3:].copy())
    impulses = _impulses(after, rows, state, mass, geared, change)
    return Impact(without_rounding(after, found, state), impulses, float(change @ mass @ change) / 2)


def pushing(after: Scene, state: State, gaps: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Return which gaps (e,), with rows (e, 6 nb) in the twists, have impulses where an impact leaves rates
    of at least ``least`` (e,): the change of twists is then the least one, and no impulse pulls.

    Least distance programming by non-negative least squares (Lawson & Hanson, Solving Least Squares Problems,
    1974, ch. 23), which holds for dependent gaps, too.
    """
    rows, _ = jacobian(after, 0.0, state.position, state.orientation)
    mass, _ = _mass_matrix(after, state)
    scaled, units, _ = unit_rows(after, rows)
    free = units[:, None] * (null_space(scaled, rcond=RANK) if len(rows) else np.eye(len(units)))
    inner, turned = np.linalg.eigh(free.T @ mass @ free)
    kept = inner > RANK * inner.max(initial=0.0)  # others are velocities of bodies without mass
    pushes = (free @ turned[:, kept] / np.sqrt(inner[kept])).T @ gaps.T  # (f, e), by unit impulses
    sizes = np.maximum(np.linalg.norm(pushes, axis=0), np.finfo(float).tiny)
    after_joints = impact(after, state).state
    twists = np.hstack([after_joints.velocity, after_joints.angular_velocity]).ravel()
    lacking = (least - gaps @ twists) / sizes
    largest = np.abs(lacking).max()
    rows = np.vstack([pushes / sizes, lacking / (largest if largest > 0.0 else 1.0)])
    return np.asarray(nnls(rows, np.eye(len(rows))[-1])[0] > 0)


def _mass_matrix(scene: Scene, state: State) -> tuple[np.ndarray, Reflected]:
    """Return the mass matrix (6 nb, 6 nb) of the bodies and armatures, and the armatures."""
    inertia = world_inertia(scene, rotations.to_matrix(state.orientation))
    geared = reflected(scene, *state)
    return mass_matrix(scene, inertia) + geared.mass, geared


def _change(scene: Scene, rows: np.ndarray, rhs: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Return the change (6 nb,) of twists with J change = rhs (m,) and the least kinetic energy."""
    if not len(rows):
        return np.zeros(len(mass))
    scaled, units, sizes = unit_rows(scene, rows)
    one = np.linalg.lstsq(scaled, rhs / sizes, rcond=RANK)[0]
    free, metric = null_space(scaled, rcond=RANK), units[:, None] * mass * units
    inner = free.T @ metric @ free
    return np.asarray(units * (one - free @ np.linalg.lstsq(inner, free.T @ metric @ one, rcond=RANK)[0]))


def _impulses(
    scene: Scene, rows: np.ndarray, state: State, mass: np.ndarray, geared: Reflected, change: np.ndarray
) -> dict[str, np.ndarray]:
    """Return impulses (6,) by joint whose rows cause a change of twists, with the impulses of armatures."""
    pose = state.position, state.orientation
    found = {joint.name: np.zeros(6) for joint in scene.joint}
    if len(rows):
        scaled, units, sizes = unit_rows(scene, rows)
        pushes = np.linalg.lstsq(scaled.T, units * (mass @ change), rcond=RANK)[0] / sizes
        found = {joint.name: wrenches @ pushes for joint, wrenches in of_multipliers(scene, rows, *pose)}
    joints = {joint.name: joint for joint in scene.joint}
    for name, inertia, row in zip(geared.joints, geared.inertia, geared.jacobian, strict=True):
        found[name] = (
            found[name] - inertia * (row @ change) * on_second(scene, joints[name], row[None], *pose)[:, 0]
        )
    return found
