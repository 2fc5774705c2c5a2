"""Closures by the constraint models that Pinocchio has since version 4, solved by least squares here.

M a = M a₀ + Jᵀ f and J a = -J̇ v, with the Jacobian J of the models, J̇ v by central differences of J v along
the motion, and the accelerations a₀ without closures.
"""

from __future__ import annotations

from typing import Any

import numpy as np

REDUNDANT = 1e-12  # singular value / largest singular value; smaller values belong to redundant rows
NUDGE = 1e-4  # s; differences of order four then are off by rounding over this time
WEIGHTS = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}


class NewModels:
    """Point and frame anchors in the place of legacy closures; ``forces`` act in the first frames."""

    def __init__(self, pin: Any, model: Any, closures: Any):
        self.pin, self.model = pin, model
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

    def accelerations(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Return joint accelerations (nv,), and keep the forces of the closures."""
        free = self.pin.aba(self.model, self.free, q, v, tau).copy()
        if not self.sizes:
            return free
        rows, mass = self._jacobian(q), self.pin.crba(self.model, self.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        drift = sum(w * self._jacobian(self._moved(q, k * NUDGE * v)) @ v for k, w in WEIGHTS.items()) / NUDGE
        spread = np.linalg.solve(mass, rows.T)
        pushes = np.linalg.lstsq(rows @ spread, -rows @ free - drift, rcond=REDUNDANT)[0]
        self.forces = np.split(-pushes, np.cumsum(self.sizes)[:-1])
        found: np.ndarray = free + spread @ pushes
        return found

    def _moved(self, q: np.ndarray, way: np.ndarray) -> np.ndarray:
        return self.pin.integrate(self.model, q, way)

    def _jacobian(self, q: np.ndarray) -> np.ndarray:
        """Return the Jacobian (rows, nv) of all closures at a configuration."""
        self.pin.computeJointJacobians(self.model, self.data, q)
        for constraint, data in zip(self.models, self.datas, strict=True):
            constraint.calc(self.model, self.data, data)
        rows: np.ndarray = self.pin.getConstraintsJacobian(self.model, self.data, self.models, self.datas)
        return rows.copy()
