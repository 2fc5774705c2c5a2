"""Initial velocities that satisfy the constraints and agree with the velocities that a scene gives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.driver_conflicts import conflict_of_drivers
from mbref.equations.gaps import lengths_of_rows
from mbref.equations.model import Model
from mbref.equations.units import unit_equations
from mbref.linear_algebra.least_norm import least_norm_and_null_space
from mbref.linear_algebra.minimum_norm import MinimumNorm
from mbref.scene import Body, Scene, SceneError

START_RANK_TOLERANCE = 1e-5  # smaller singular values stay uncorrected: the rank may drop at the start
GROSS = 0.05  # violation / scene's length, or violation / given velocities, above which the data are faulty
# speed / speed that gravity gives over the scene's length, or length / duration, below which a body rests:
# rounding, also of a program that wrote the file, leaves less
NO_MOTION = 1e-12
# violation by drivers / speed, above which drivers contradict the joints; rounding leaves less
CONTRADICTED = 1e-3
# weight of open velocities / weight of given velocities; number of compensating iterations
OPEN_WEIGHT, REPEATS = 1e-4, 5
LEAST_WEIGHT = 1e-6  # weight of a rotation without inertia / largest mass or inertia


class Rates(NamedTuple):
    """The velocity equations of a scene: given velocities (n,), their mask, ν, Φ_q, M (n,) and length (m).

    Φ_q (m, n) refers to velocities over their ``scale`` (n,); a large scene has blocks (m, 12) of Φ_q itself.
    Over its scale, a velocity below ``rest`` (m/s) is rounding.
    """

    v: np.ndarray
    given: np.ndarray
    nu: np.ndarray
    scale: np.ndarray
    jacobian: np.ndarray
    mass: np.ndarray
    length: float
    rest: float


def speed_at_rest(scene: Scene, length: float) -> float:
    """Return the speed (m/s) up to which bodies of a scene of a length (m) are at rest."""
    falling = math.sqrt(length * math.hypot(*scene.gravity))
    return NO_MOTION * max(falling, length / scene.duration)


def given_velocities(bodies: Sequence[Sequence[Body]], q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocities (s, 6 nb) that scenes give to their bodies (zero elsewhere), and the mask of the
    given entries, from coordinates (s, 7 nb)."""
    shape = len(q), len(bodies[0]), 6
    v, given = np.zeros(shape), np.zeros(shape, dtype=bool)
    for k, own in enumerate(bodies):
        for b, body in enumerate(own):
            if body.velocity is not None:
                v[k, b, :3], given[k, b, :3] = body.velocity, True
            if body.angular_velocity is not None:
                v[k, b, 3:], given[k, b, 3:] = body.angular_velocity, True
    if v[..., 3:].any():
        turning = v[..., 3:].any(axis=2)
        to_body = rotations.to_matrix(q.reshape(*shape[:2], 7)[turning, 3:]).swapaxes(1, 2)
        v[turning, 3:] = (to_body @ v[turning, 3:, None])[..., 0]
    return v.reshape(len(q), -1), given.reshape(len(q), -1)


def joint_fault(model: Model, row: int, what: str) -> SceneError:
    """Return the fault of the joint to which a row belongs."""
    return SceneError([f"joint[{model.row_joint[row]}]: {what}"])


def _contradiction(model: Model, row: int) -> SceneError:
    """Return the fault of drivers whose velocities at t = 0 are impossible; ``row`` has the largest
    residual."""
    if (conflict := conflict_of_drivers(model.scene)) is not None:
        return SceneError([conflict.fault])
    names = [driver.joint for driver in model.scene.driver]
    who = f"the drivers of {', '.join(names)} contradict" if len(names) > 1 else "contradicts"
    where = f"at t = 0, most of all at joint {model.row_joint[row]!r}"
    return SceneError([f"driver[{names[0]}]: {who} the joints {where}"])


def dense_velocities(model: Model, rates: Rates) -> tuple[np.ndarray, float, bool]:
    """Return velocities of a scene that satisfy Φ_q v = ν, the residual of the given velocities, and whether
    some velocities may be undetermined.

    Among the solutions the result is nearest to the given velocities (angular velocities times the scene's
    length); undetermined velocities are least in the metric of M.
    """
    v, given, nu, scale, jacobian, mass, _, rest = rates
    wanted = v[given] / scale[given]
    if not (wanted.any() or nu.any()):
        return np.zeros(model.n), 0.0, not given.all()
    unit, rhs = unit_equations(jacobian, nu)
    x, open_ = least_norm_and_null_space(unit, rhs, START_RANK_TOLERANCE)
    off = np.abs(unit @ x - rhs)
    if off.max(initial=0.0) > max(rest, CONTRADICTED * np.abs(x).max(initial=0.0)):
        raise _contradiction(model, int(np.argmax(off)))
    if open_.size and wanted.size:
        step, still_open = least_norm_and_null_space(open_[given], wanted - x[given], START_RANK_TOLERANCE)
        x, open_ = x + open_ @ step, open_ @ still_open
    as_given = x.copy()
    as_given[given] = wanted
    residual = np.abs(jacobian @ as_given - nu)
    miss = np.abs(x[given] - wanted).max(initial=0.0)
    if miss > max(rest, GROSS * np.abs(wanted).max(initial=0.0)):
        what = f"velocities given to bodies violate it by {residual.max():.3g} m/s or rad/s"
        raise joint_fault(model, int(np.argmax(residual)), what)
    if open_.size:
        weight = np.sqrt(mass) * scale
        x = x - open_ @ np.linalg.lstsq(weight[:, None] * open_, weight * x, rcond=START_RANK_TOLERANCE)[0]
    off = float(np.abs(unit @ as_given - rhs).max(initial=0.0))
    size = max(np.abs(x).max(), np.abs(as_given).max())
    return x * scale, 0.0 if off <= rest else off / size, bool(open_.size)


def sparse_velocities(model: Model, rates: Rates) -> tuple[np.ndarray, float, bool]:
    """Return velocities by sparse solutions: nearest to the given velocities first, then of least norm."""
    from scipy.sparse import csr_array, vstack

    v, given, nu, scale, blocks, mass, length, rest = rates
    jacobian = model.structure.sparse(blocks)
    x = MinimumNorm(jacobian, scale**-2)(nu)
    off = np.abs(jacobian @ x - nu)
    if np.max(off) > max(rest, CONTRADICTED * np.max(np.abs(x / scale))):
        raise _contradiction(model, int(np.argmax(off)))
    nearest, x, aim = MinimumNorm(jacobian, np.where(given, 1.0, OPEN_WEIGHT) / scale**2), v, v
    for _ in range(REPEATS):
        x = aim + nearest(nu - jacobian @ aim)
        aim = aim + np.where(given, v - x, 0.0)
    chosen = np.flatnonzero(given)
    selection = csr_array((np.ones(chosen.size), (np.arange(chosen.size), chosen)), (chosen.size, model.n))
    weight = np.where(mass > 0, mass, LEAST_WEIGHT * np.max(mass))
    x = MinimumNorm(csr_array(vstack([jacobian, selection])), weight)(np.append(nu, x[given]))
    residual = np.abs(jacobian @ np.where(given, v, x) - nu)
    miss, wanted = np.abs((x - v) / scale)[given], np.abs(v / scale)[given]
    if np.max(miss, initial=0.0) > max(rest, GROSS * np.max(wanted, initial=0.0)):
        what = f"velocities given to bodies violate it by {residual.max():.3g} m/s or rad/s"
        raise joint_fault(model, int(np.argmax(residual)), what)
    size = max(np.abs(x / scale).max(), np.abs(v / scale).max())
    off = float(np.max(residual / lengths_of_rows(blocks, length), initial=0.0))
    return x, 0.0 if off <= rest else off / size, not given.all()
