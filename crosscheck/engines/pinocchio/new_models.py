"""Closures by the constraint models that Pinocchio has since version 4: point and frame anchors.

M a = M a₀ + Jᵀ f and J a + J̇ v = -2 β J v - β² Φ, with the Jacobian J, the bias J̇ v and the errors J v and
Φ of the models, and the accelerations a₀ without closures. So G f + g = 0 with G = J M⁻¹ Jᵀ. Pinocchio's
ADMM or PGS solves for f, or least squares here.

As in Pinocchio's own examples, a step of length h can also be made by impulses h f, with the end velocities
v + h a: J (v + h a) = -(Kp / h) Φ. Closures with the compliance C (m/N) and the damping d (N s/m) push with
f = -(Φ + h J (v + h a)) / C - d J (v + h a), which is (G + R) f + g = 0 with R = C / (h² + C d h) and
Kp = h / (h + C d).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from crosscheck.engines.shared.sampling import Failed
from mbref.motions.trajectory import Outcome

REDUNDANT = 1e-12  # singular value / largest singular value; smaller values belong to redundant rows
# tolerances of ADMM and PGS, in m/s² and of the largest value, and most iterations
SOLVED, ITERATIONS = 1e-10, 10_000
TOLERANCES = (
    "absolute_feasibility_tol",
    "relative_feasibility_tol",
    "absolute_complementarity_tol",
    "relative_complementarity_tol",
)
LEAST = "least squares"
Solver = Callable[[np.ndarray, np.ndarray], np.ndarray | None]


class Impulses(NamedTuple):
    """Feedback of closure errors in steps by impulses: the share Kp of an error that a step removes, the
    ``compliance`` C of closures (m/N), and their ``damping`` d (N s/m)."""

    kp: float = 1.0
    compliance: float = 0.0
    damping: float = 0.0

    def softness(self, step: float) -> float:
        """Return R (1/kg) in a step of a length (s)."""
        return self.compliance / (step**2 + self.compliance * self.damping * step)

    def share(self, step: float) -> float:
        """Return Kp in a step of a length (s)."""
        return self.kp * step / (step + self.compliance * self.damping)


class NewModels:
    """Point and frame anchors in the place of legacy closures; ``forces`` act in the first frames.

    ``solver`` is ADMM, PGS or least squares, ``beta`` the decay rate of the closure errors (1/s). With
    ``impulses`` the accelerations belong to a step of length ``step`` (s).
    """

    def __init__(
        self,
        pin: Any,
        model: Any,
        closures: Any,
        solver: str,
        beta: float = 0.0,
        impulses: Impulses | None = None,
    ):
        self.pin, self.model, self.beta = pin, model, beta
        self.impulses, self.step = impulses, 0.0
        self.data, self.free = model.createData(), model.createData()
        self.models = pin.StdVec_ConstraintModel()
        for closure in closures:
            is_point = closure.type == pin.ContactType.CONTACT_3D
            kind = pin.PointAnchorConstraintModel if is_point else pin.FrameAnchorConstraintModel
            places = closure.joint1_placement, closure.joint2_placement
            anchored = kind(model, closure.joint1_id, places[0], closure.joint2_id, places[1])
            self.models.append(pin.ConstraintModel(anchored))
        self.sizes = [3 if closure.type == pin.ContactType.CONTACT_3D else 6 for closure in closures]
        self.datas = pin.StdVec_ConstraintData()
        self.datas.extend([constraint.createData() for constraint in self.models])
        self.forces: list[np.ndarray] = []
        self.solver = solver
        self.solved: Solver = _least if solver == LEAST else self._by(solver)

    def accelerations(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Return joint accelerations (nv,), and store the forces of the closures.

        Raises Failed if the solver does not converge.
        """
        free = self.pin.aba(self.model, self.free, q, v, tau).copy()
        if not self.sizes:
            return free
        rows, mass = self._jacobian(q), self.pin.crba(self.model, self.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        spread = np.linalg.solve(mass, rows.T)
        pushes = self.solved(rows @ spread, rows @ free + self._bias(q, v))
        if pushes is None:
            words = f"Pinocchio's {self.solver} did not converge in {ITERATIONS} iterations at {t:.6g} s"
            raise Failed(Outcome.NOT_CONVERGED, t, words)
        self.forces = np.split(-pushes, np.cumsum(self.sizes)[:-1])
        found: np.ndarray = free + spread @ pushes
        return found

    def _calc(self) -> None:
        for constraint, data in zip(self.models, self.datas, strict=True):
            constraint.calc(self.model, self.data, data)

    def _jacobian(self, q: np.ndarray) -> np.ndarray:
        """Return the Jacobian (rows, nv) of all closures at a configuration."""
        self.pin.computeJointJacobians(self.model, self.data, q)
        self._calc()
        rows: np.ndarray = self.pin.getConstraintsJacobian(self.model, self.data, self.models, self.datas)
        return rows.reshape(-1, self.model.nv).copy()  # Pinocchio gives a vector for one coordinate

    def _bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return J̇ v + 2 β J v + β² Φ (rows,), from the errors that the models have without acceleration, or
        (J v + Kp Φ / h) / h for impulses."""
        self.pin.forwardKinematics(self.model, self.data, q, v, 0 * v)
        self._calc()
        found = []
        for data in (data.extract() for data in self.datas):
            if self.impulses:
                gap = self.impulses.share(self.step) * data.constraint_position_error / self.step
                found.append((data.constraint_velocity_error + gap) / self.step)
                continue
            feedback = 2 * self.beta * data.constraint_velocity_error
            feedback = feedback + self.beta**2 * data.constraint_position_error
            found.append(data.constraint_acceleration_error + feedback)
        return np.concatenate(found)

    def _by(self, name: str) -> Solver:
        """Return ADMM or PGS as a function that solves G f + g = 0, or returns None if it does not converge.

        Raises ValueError for another name.
        """
        if name not in ("ADMM", "PGS"):
            raise ValueError(f"solver {name!r}: the anchors' solvers are ADMM, PGS and {LEAST}")
        solver = getattr(self.pin, f"{name}ConstraintSolver")(sum(self.sizes))
        settings = getattr(self.pin, f"{name}SolverSettings")()
        settings.max_iterations = ITERATIONS
        for tolerance in TOLERANCES:
            setattr(settings, tolerance, SOLVED)

        def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray | None:
            result = getattr(self.pin, f"{name}SolverResult")()
            delassus = self.pin.DelassusOperatorDense(matrix)
            if self.impulses and self.impulses.compliance:
                delassus.updateCompliance(np.full(len(right), self.impulses.softness(self.step)))
            solver.solve(delassus, right, self.models, self.datas, settings, result)
            return result.retrieveConstraintImpulses().copy() if result.converged else None

        return solved


def _least(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    found: np.ndarray = np.linalg.lstsq(matrix, -right, rcond=REDUNDANT)[0]
    return found
