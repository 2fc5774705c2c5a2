"""Consistent initial positions and velocities (section 1 and Figure 2 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbref import rotations
from mbref.equations.branches import MOST_ROWS, velocities_along
from mbref.equations.model import Model, displaced
from mbref.equations.units import row_lengths
from mbref.linear_algebra.minimum_norm import MinimumNorm
from mbref.scene import SceneError

RANK_TOLERANCE = 1e-5  # singular values below it (relative) are left alone: rank may drop at the start
LARGE = 40  # rows; above, dense singular values take longer than sparse factors
GROSS = 0.05  # of the scene's length, or of given velocities: a larger inconsistency is a fault
CONTRADICTED = 1e-3  # of the speed by which drivers may miss the joints: rounded rates leave less
MOST_ITERATIONS = 30
OPEN_WEIGHT, REPEATS = 1e-4, 5  # weight of open velocities beside given ones, and how often it is compensated
MET = 1e-13  # of the largest velocity: those of another branch miss Φ_q v = ν by more
BESIDE_RANK = 1e-9  # singular values below which they are not corrected
BRANCH = (
    "initial velocities that the scene leaves open at a singular position are those of the branch with the "
    "least kinetic energy"
)
LEAST_WEIGHT = 1e-6  # of a turn that no inertia resists, relative to the largest mass or inertia


@dataclass(frozen=True)
class Start:
    """A consistent state and the violation of the scene's data before correction."""

    q: np.ndarray  # (7 nb,)
    v: np.ndarray  # (6 nb,)
    position_violation: float  # largest |Φ| before correction (m or rad)
    velocity_violation: float  # largest |Φ_q v - ν| of fully given velocities before correction
    follows_branch: bool = False  # whether velocities that the scene leaves open are those of a branch

    def report(self) -> str:
        """One sentence for the user; empty where nothing but rounding was corrected."""
        parts = []
        if self.position_violation > 1e-9:
            parts.append(f"positions were off the constraints by {self.position_violation:.2e}")
        if self.velocity_violation > 1e-9:
            parts.append(f"velocities by {self.velocity_violation:.2e}")
        corrected = f"initial {' and '.join(parts)}; corrected" if parts else ""
        return "; ".join(filter(None, (corrected, BRANCH if self.follows_branch else "")))


def consistent_start(model: Model) -> Start:
    """The nearest consistent state; raises SceneError naming the joint that is grossly violated."""
    q, position_violation = corrected_positions(model, model.start())
    v, velocity_violation, leaves_open = _velocities(model, q)
    along = _along_branch(model, q, v) if leaves_open and np.any(v) else None
    follows = along is not None
    return Start(q, along if follows else v, position_violation, velocity_violation, follows)


def _along_branch(model: Model, q: np.ndarray, v: np.ndarray) -> np.ndarray | None:
    """Velocities (6 nb,) along a branch of a singular start that agree with those that the scene gives; None
    where v (6 nb,) are, or where second order tells no such branch."""
    if not model.closed_loops or model.m > MOST_ROWS:
        return None
    along = velocities_along(model, q, v, given_velocities(model, q)[1])
    return _best_met(model, q, along) if along else None


def rate_violation(model: Model, q: np.ndarray, v: np.ndarray) -> float:
    """The largest |Φ_q v - ν| of unit rows at t = 0, over the largest of the velocities v (6 nb,)."""
    terms = model.terms(0.0, q, v)
    jacobian, nu = _unit_rows(terms.jacobian, terms.nu)
    return float(np.abs(jacobian @ v - nu).max() / np.abs(v).max())


def _best_met(model: Model, q: np.ndarray, along: list[np.ndarray]) -> np.ndarray:
    """Of velocities (6 nb,) along branches the first, where all meet Φ_q v = ν; else those that meet it best,
    as one branch does beside a singular position.  They are corrected as far as rounding allows."""
    off = [rate_violation(model, q, w) for w in along]
    best = along[int(np.argmin(off)) if max(off) > MET else 0]
    terms = model.terms(0.0, q, best)
    jacobian, nu = _unit_rows(terms.jacobian, terms.nu)
    return best + np.linalg.lstsq(jacobian, nu - jacobian @ best, rcond=BESIDE_RANK)[0]


def _fault(model: Model, row: int, what: str) -> SceneError:
    return SceneError([f"joint[{model.row_joint[row]}]: {what}"])


def _contradiction(model: Model, row: int) -> SceneError:
    """The fault of drivers whose velocities at t = 0 no motion has; ``row`` is missed most."""
    names = [driver.joint for driver in model.scene.driver]
    who = f"the drivers of {', '.join(names)} contradict" if len(names) > 1 else "contradicts"
    where = f"at t = 0, most of all at joint {model.row_joint[row]!r}"
    return SceneError([f"driver[{names[0]}]: {who} the joints {where}"])


def corrected_positions(model: Model, q: np.ndarray) -> tuple[np.ndarray, float]:
    """Consistent coordinates (7 nb,) near q at t = 0, and the largest |Φ| before.

    Raises SceneError naming the joint where q is grossly inconsistent or cannot be corrected.
    """
    if not model.m:
        return q, 0.0
    phi = np.abs(model.blocks(0.0, q, np.zeros(model.n)).phi)
    before, worst = float(phi.max()), int(np.argmax(phi))
    if before > GROSS * max(1.0, model.length):
        raise _fault(model, worst, f"positions given to bodies violate it by {before:.3g} m or rad")
    q, phi = solve_positions(model, 0.0, q)
    left, worst = float(np.abs(phi).max()), int(np.argmax(np.abs(phi)))
    if left > 1e-10:
        raise _fault(model, worst, f"no positions nearby meet it; {left:.3g} m or rad are left")
    return q, before


def is_met(violation: Any, length: Any) -> Any:
    """Whether the largest |Φ| of a scene of a length (m) is rounding; of numbers or of arrays."""
    return violation <= 1e-14 * np.maximum(1.0, length)


def solve_positions(model: Model, t: float, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Newton–Raphson on Φ(q, t) = 0 from q (7 nb,); the coordinates reached and Φ (m,) there.

    With the pseudo-inverse, so that redundant rows and a singular start do no harm; the change is least
    in the metric of M.
    """
    v, phi = np.zeros(model.n), np.zeros(model.m)
    for _ in range(MOST_ITERATIONS):
        terms = model.blocks(t, q, v)
        phi = terms.phi
        if is_met(np.max(np.abs(phi), initial=0.0), model.length):
            break
        x = _least_change(model, terms.jacobian, -phi)
        if np.max(np.abs(x)) < 1e-15:
            break
        q = displaced(q, x)
    return q, phi


def _least_change(model: Model, blocks: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """The change (6 nb,), least in the metric of M, by which Φ_q grows by rhs (m,)."""
    mass = np.where(model.mass > 0, model.mass, 1.0)
    if model.m > LARGE:
        return MinimumNorm(model.sparse(blocks), mass)(rhs)
    inverse_root = 1 / np.sqrt(mass)
    return _least_norm(*_unit_rows(model.dense(blocks) * inverse_root, rhs)) * inverse_root


def _least_norm(matrix: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(matrix, rhs, rcond=RANK_TOLERANCE)[0]


def given_velocities(model: Model, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The velocities the scene gives (zero elsewhere) and which those are, both (6 nb,)."""
    v, given = np.zeros((model.nb, 6)), np.zeros((model.nb, 6), dtype=bool)
    for b, body in enumerate(model.bodies):
        if body.velocity is not None:
            v[b, :3], given[b, :3] = body.velocity, True
        if body.angular_velocity is not None:
            to_body = rotations.conjugate(q.reshape(-1, 7)[b, 3:])
            turning = any(body.angular_velocity)
            v[b, 3:] = rotations.rotate(to_body, np.array(body.angular_velocity)) if turning else 0.0
            given[b, 3:] = True
    return v.ravel(), given.ravel()


def _velocities(model: Model, q: np.ndarray) -> tuple[np.ndarray, float, bool]:
    """Velocities that meet Φ_q v = ν, how far the given ones were from that, and whether some may be open.

    Among the solutions those nearest to the given velocities (angular ones times the scene's length);
    velocities left open are least in the metric of M.
    """
    v, given = given_velocities(model, q)
    if model.m > LARGE:
        return *_sparse_velocities(model, q, v, given), not given.all()
    scale = np.tile(np.repeat([1.0, 1 / model.length], 3), model.nb)
    wanted = v[given] / scale[given]
    terms = model.blocks(0.0, q, v)
    if not (wanted.any() or terms.nu.any()):
        return np.zeros(model.n), 0.0, not given.all()
    terms = replace(terms, jacobian=model.dense(terms.jacobian))
    jacobian, nu = _unit_rows(terms.jacobian * scale, terms.nu)
    x, open_ = _solutions(jacobian, nu)
    if np.max(np.abs(jacobian @ x - nu), initial=0.0) > CONTRADICTED * np.max(np.abs(x), initial=0.0):
        raise _contradiction(model, int(np.argmax(np.abs(jacobian @ x - nu))))
    step, still_open = _solutions(open_[given], wanted - x[given])
    x, open_ = x + open_ @ step, open_ @ still_open
    as_given = x.copy()
    as_given[given] = wanted
    residual = np.abs(terms.jacobian @ (as_given * scale) - terms.nu)
    if np.max(np.abs(x[given] - wanted), initial=0.0) > GROSS * np.max(np.abs(wanted), initial=0.0):
        what = f"velocities given to bodies violate it by {residual.max():.3g} m/s or rad/s"
        raise _fault(model, int(np.argmax(residual)), what)
    if open_.size:
        weight = np.sqrt(model.mass) * scale
        x = x - open_ @ _least_norm(weight[:, None] * open_, weight * x)
    return x * scale, float(np.max(residual, initial=0.0)), bool(open_.size)


def _sparse_velocities(
    model: Model, q: np.ndarray, v: np.ndarray, given: np.ndarray
) -> tuple[np.ndarray, float]:
    """The same by sparse solutions: nearest to the given velocities first, then least where open."""
    from scipy.sparse import csr_array, vstack

    scale = np.tile(np.repeat([1.0, 1 / model.length], 3), model.nb)
    terms = model.blocks(0.0, q, v)
    jacobian, nu = model.sparse(terms.jacobian), terms.nu
    x = MinimumNorm(jacobian, scale**-2)(nu)
    if np.max(np.abs(jacobian @ x - nu)) > CONTRADICTED * np.max(np.abs(x / scale)):
        raise _contradiction(model, int(np.argmax(np.abs(jacobian @ x - nu))))
    nearest, x, aim = MinimumNorm(jacobian, np.where(given, 1.0, OPEN_WEIGHT) / scale**2), v, v
    for _ in range(REPEATS):
        x = aim + nearest(nu - jacobian @ aim)
        aim = aim + np.where(given, v - x, 0.0)
    chosen = np.flatnonzero(given)
    selection = csr_array((np.ones(chosen.size), (np.arange(chosen.size), chosen)), (chosen.size, model.n))
    weight = np.where(model.mass > 0, model.mass, LEAST_WEIGHT * np.max(model.mass))
    x = MinimumNorm(csr_array(vstack([jacobian, selection])), weight)(np.append(nu, x[given]))
    residual = np.abs(jacobian @ np.where(given, v, x) - nu)
    miss, wanted = np.abs((x - v) / scale)[given], np.abs(v / scale)[given]
    if np.max(miss, initial=0.0) > GROSS * np.max(wanted, initial=0.0):
        what = f"velocities given to bodies violate it by {residual.max():.3g} m/s or rad/s"
        raise _fault(model, int(np.argmax(residual)), what)
    return x, float(np.max(residual, initial=0.0))


def _unit_rows(matrix: np.ndarray, rhs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same equations with rows of unit length, so that their rank does not depend on units."""
    lengths = row_lengths(matrix)
    return matrix / lengths[:, None], rhs / lengths


def _solutions(matrix: np.ndarray, rhs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least-norm least-squares solution (n,), and an orthonormal basis (n, k) of the null space."""
    if not matrix.size:
        return np.zeros(matrix.shape[1]), np.eye(matrix.shape[1])
    u, values, vt = np.linalg.svd(matrix)
    rank = int(np.sum(values > RANK_TOLERANCE * values[0]))
    return vt[:rank].T @ ((u[:, :rank].T @ rhs) / values[:rank]), vt[rank:].T
