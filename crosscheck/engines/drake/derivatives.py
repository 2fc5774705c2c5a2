"""Derivatives of accelerations by Drake's AutoDiffXd: of its terms, from which closures are solved here.

A continuous plant has no constraints. Mass matrix, bias, Jacobians and poses of the continuous plant are
computed with AutoDiffXd, and M a + h = τ + Jᵀ λ, J a + J̇ v = 0 is differentiated at constant a and λ. A step
of the discrete plant, which AutoDiffXd differentiates too, is not compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from crosscheck.differentiating import Differentiating, OwnDerivatives
from crosscheck.engines.drake.model import ANGULAR_FIRST, Mechanism
from crosscheck.engines.shared.initial_velocities import initial_rates
from crosscheck.engines.shared.least_change import REDUNDANT
from crosscheck.engines.shared.rates import names_of_rates, spins_of_rods
from crosscheck.engines.shared.spanning_tree import GROUND_LINK, spanning_tree
from mbref.scene import Scene

TERMS = "terms, AutoDiffXd"


class Differentiated(Differentiating):
    """Derivatives of the equations with Drake's terms, which AutoDiffXd differentiates."""

    differentiates_by: Mapping[str, str] = {
        TERMS: "MultibodyPlant_[AutoDiffXd]: CalcMassMatrix, CalcBiasTerm, Jacobians; closures solved by "
        "crosscheck"
    }

    def own_derivatives(self, scene: Scene, function: str, away: np.ndarray | None = None) -> OwnDerivatives:
        """Return the derivatives at the start, displaced by ``away`` along unit velocities."""
        model = _Differentiated(scene, away)
        v, none = model.start, np.zeros(model.nv)
        terms, a, multipliers = model.solved(none, v, none)
        by_state = model.derivatives(v, a, multipliers, terms)
        return OwnDerivatives(
            coordinates=names_of_rates(scene, model.tree),
            velocity=v,
            acceleration=a,
            by_position=by_state[:, : model.nv],
            by_velocity=by_state[:, model.nv :],
            by_force=np.array([_saddle(terms, e, 0 * terms.drift)[0] for e in np.eye(model.nv)]).T,
            bodies=model.bodies,
            opening=lambda step, rate: model.terms(step, rate).rows @ rate,
            own=lambda step, rate, force: model.solved(step, rate, force)[1],
            spins=model.spins,
        )


class _Terms(NamedTuple):
    """Mass matrix (nv, nv), bias (nv,), rows (m, nv) of the closures and their accelerations (m,) at v' = 0,
    of floats or of AutoDiffXd."""

    mass: np.ndarray
    bias: np.ndarray
    rows: np.ndarray
    drift: np.ndarray


class _Differentiated:
    """A scene's continuous plant of doubles and of AutoDiffXd."""

    def __init__(self, scene: Scene, away: np.ndarray | None):
        from pydrake.autodiffutils import AutoDiffXd

        self.dual, self.scene, self.tree = AutoDiffXd, scene, spanning_tree(scene)
        self.mechanism = Mechanism(scene, self.tree)
        self.away = np.zeros(self.tree.nv) if away is None else away
        self.nv, self.coordinates = self.tree.nv, self.mechanism.coordinates
        self.start = initial_rates(scene, self.tree)
        self.plant = self.mechanism.plant.ToAutoDiffXd()
        self.context = self.plant.CreateDefaultContext()

    def put(self, step: np.ndarray, v: np.ndarray) -> None:
        """Set the plant of doubles to the start, displaced by ``away`` and in turn by a step along unit
        velocities, and velocities (nv,)."""
        away = self.coordinates.moved(self.coordinates.start(), self.away)
        self.mechanism.put(self.coordinates.moved(away, step), v)

    def terms(self, step: np.ndarray, v: np.ndarray) -> _Terms:
        """Return the terms (floats) at a displacement and velocities (nv,)."""
        self.put(step, v)
        return self._terms(self.mechanism.plant, self.mechanism.context)

    def _terms(self, plant: Any, context: Any) -> _Terms:
        at = self.mechanism.v_index
        bias = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        rows: list[Any] = [np.zeros((0, self.nv))]
        drift: list[Any] = [np.zeros(0)]
        for closure in self.tree.closures:
            first, second = (self._end(plant, context, link, closure.anchor) for link in closure.links)
            n = 3 if closure.kind == "point" else 6
            rows.append((second[0] - first[0])[:n])
            drift.append((second[1] - first[1])[:n])
        mass = plant.CalcMassMatrix(context)[np.ix_(at, at)]
        for coupling in self.scene.coupling:
            one, other = self.tree.coupled(self.scene, coupling)
            row = np.zeros(self.nv)
            row[one], row[other] = -coupling.gear_ratio, 1.0
            rows.append(row[None] + 0.0 * mass[:1])
            drift.append(0.0 * mass[0, :1])
        for i, inertia in self.tree.armatures(self.scene):
            mass[i, i] += inertia
        return _Terms(mass, bias[at], np.concatenate(rows), np.concatenate(drift))

    def _end(self, plant: Any, context: Any, link: int, anchor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the Jacobian (6, nv) of a point of a link and its accelerations (6,) at v' = 0."""
        if link == GROUND_LINK:
            return np.zeros((6, self.nv)), np.zeros(6)
        body = plant.get_body(self.mechanism.bodies[link].index())
        return self._moving(plant, context, body, anchor - self.tree.links[link].position)

    def _moving(
        self, plant: Any, context: Any, body: Any, point: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        by_v = self.mechanism.parts.JacobianWrtVariable.kV
        of = context, by_v, body.body_frame(), point, plant.world_frame(), plant.world_frame()
        jacobian = plant.CalcJacobianSpatialVelocity(*of)[ANGULAR_FIRST][:, self.mechanism.v_index]
        left = plant.CalcBiasSpatialAcceleration(*of)
        return jacobian, np.concatenate([left.translational(), left.rotational()])

    def solved(
        self, step: np.ndarray, v: np.ndarray, force: np.ndarray
    ) -> tuple[_Terms, np.ndarray, np.ndarray]:
        """Return the terms, the accelerations (nv,) and the multipliers (m,)."""
        terms = self.terms(step, v)
        return terms, *_saddle(terms, force - terms.bias, -terms.drift)

    def derivatives(self, v: np.ndarray, a: np.ndarray, multipliers: np.ndarray, terms: _Terms) -> np.ndarray:
        """Return the derivatives (nv, 2 nv) of the accelerations along unit velocities and by velocities."""
        self.put(0 * v, v)
        plant, context, at, nv = self.mechanism.plant, self.mechanism.context, self.mechanism.v_index, self.nv
        rates = np.array([plant.MapVelocityToQDot(context, e) for e in np.eye(nv)[at]]).T
        turned, moved = np.hstack([rates, 0 * rates]), np.zeros((nv, 2 * nv))
        moved[at, nv + np.arange(nv)] = 1.0
        self.plant.SetPositions(self.context, self._duals(plant.GetPositions(context), turned))
        self.plant.SetVelocities(self.context, self._duals(plant.GetVelocities(context), moved))
        dual = self._terms(self.plant, self.context)
        pull, gap = dual.mass @ a + dual.bias - dual.rows.T @ multipliers, dual.rows @ a + dual.drift
        columns = zip(_gradients(pull, 2 * nv).T, _gradients(gap, 2 * nv).T, strict=True)
        return np.array([_saddle(terms, -left, -right)[0] for left, right in columns]).T

    def _duals(self, values: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        return np.array([self.dual(x, row) for x, row in zip(values, gradients, strict=True)])

    def bodies(self, step: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return twists and accelerations (6 nb,) of the bodies."""
        self.put(step, v)
        plant, context, centre = self.mechanism.plant, self.mechanism.context, np.zeros(3)
        own = [self.mechanism.bodies[link] for link in self.tree.own]
        found = [self._moving(plant, context, body, centre) for body in own]
        twists = [jacobian @ v for jacobian, _ in found]
        return np.concatenate(twists), np.concatenate([jacobian @ a + drift for jacobian, drift in found])

    def spins(self, step: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the rates at which rods spin about their own axes."""
        self.put(step, v)
        found = [self._turning(body) for body in self.mechanism.bodies]
        self.mechanism.put(self.coordinates.start(), v)
        return spins_of_rods(
            self.tree, found.__getitem__, lambda link: self._turning(self.mechanism.bodies[link])
        )

    def _turning(self, body: Any) -> tuple[np.ndarray, np.ndarray]:
        plant, context = self.mechanism.plant, self.mechanism.context
        spin = plant.EvalBodySpatialVelocityInWorld(context, body).rotational()
        return plant.EvalBodyPoseInWorld(context, body).rotation().matrix(), spin


def _saddle(terms: _Terms, pull: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a and λ with M a - Jᵀ λ = pull and J a = wanted, by least squares in the metric of M."""
    root = np.linalg.cholesky(terms.mass)
    pushed, spread = np.linalg.solve(root, pull), np.linalg.solve(root, terms.rows.T).T
    held = np.linalg.lstsq(spread, wanted - spread @ pushed, rcond=REDUNDANT)[0]
    a = np.linalg.solve(root.T, pushed + held)
    return a, np.linalg.lstsq(spread.T, held, rcond=REDUNDANT)[0]


def _gradients(values: np.ndarray, size: int) -> np.ndarray:
    """Return the gradients (n, size) of numbers of AutoDiffXd; floats have none."""
    rows = [getattr(value, "derivatives", lambda: np.zeros(0))() for value in values]
    return np.array([row if len(row) else np.zeros(size) for row in rows]).reshape(len(values), size)
