"""Forces and torques that drivers need for a motion (inverse dynamics), by the judge's own equations.

Let v be the twists of all bodies, J the constraint rows, I the armatures of coordinates q with the rows Jq,
and f the applied forces. The multipliers λ solve Jᵀ λ = M v' + Jqᵀ I q'' - f. A driver's row is the rate of
its coordinate. So its multiplier is the force along, or the torque about, the axis on the second body.
"""

from __future__ import annotations

import numpy as np

from crosscheck.judge.constraints import jacobian, length_rows
from crosscheck.judge.coupling_laws import unwound
from crosscheck.judge.deadline import ask
from crosscheck.judge.joint_reactions import unit_rows
from crosscheck.judge.joint_residuals import in_world, joint_frames, with_ground
from crosscheck.judge.reaction_balance import demanded, forces_of_armatures
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

# smallest share of a unit row that the other rows do not span; a redundant row has a share of at most 1/2
DETERMINED = 1 - 1e-6


def driver_forces(scene: Scene, exact: Trajectory) -> dict[str, np.ndarray]:
    """Return the force (N) or torque (N m) (k,) of each driver, by its joint; of a driven orientation the
    moment (k, 3), N m, world axes.

    The torque accelerates the armature of the joint too, and contains what couplings transmit. It is NaN at
    samples at which redundant constraints do not determine it, or full turns of a coupling cannot be counted.

    Raises ValueError if the motion has no accelerations.
    """
    rows_of = {name: len(mask) for name, mask in length_rows(scene).items()}
    ends = dict(zip(rows_of, np.cumsum(list(rows_of.values())), strict=True))
    last = [int(ends[driver.joint]) - k for driver in scene.driver for k in range(driver.rows, 0, -1)]
    wanted = demanded(scene, exact).reshape(len(exact.times), -1)
    scenes = unwound(scene, exact)
    found = np.array([_multipliers(scenes[k], exact, k, push)[last] for k, push in enumerate(wanted)])
    parts = np.split(found, np.cumsum([driver.rows for driver in scene.driver])[:-1], axis=1)
    frames = {joint.name: joint for joint in joint_frames(scene)}
    pose = with_ground(exact.position, exact.orientation)
    return {
        driver.joint: rotations.rotate(in_world(frames[driver.joint], *pose)[2][0], part)
        if driver.turn
        else part[:, 0]
        for driver, part in zip(scene.driver, parts, strict=True)
    }


def _multipliers(scene: Scene, exact: Trajectory, k: int, push: np.ndarray) -> np.ndarray:
    """Return the multipliers (rows,) at a sample, for the forces (6 nb,) that act on bodies without
    armatures."""
    ask()
    pose = exact.position[k], exact.orientation[k]
    rows = jacobian(scene, float(exact.times[k]), *pose)[0]
    if np.isnan(rows).any():
        return np.full(len(rows), np.nan)
    turned, strengths = forces_of_armatures(scene, exact, k)
    total = push - turned.T @ strengths
    rows, units, sizes = unit_rows(scene, rows)
    u, s, vt = np.linalg.svd(rows, full_matrices=False)
    rank = int((s > RANK * s[0]).sum())
    u = u[:, :rank]
    found = u @ (vt[:rank] @ (total * units) / s[:rank]) / sizes
    return np.where(np.sum(u**2, axis=1) >= DETERMINED, found, np.nan)
