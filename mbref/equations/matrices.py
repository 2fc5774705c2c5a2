"""Matrices: the equations of a scene at one state as labelled NumPy arrays, for study and for own methods.

The equations of the paper are Φ(q, t) = 0, Φ_q q̇ = ν, Φ_q q̈ = γ and M q̈ + Φ_qᵀ λ = g. Rotations are in the
bodies' own frames here; a Model has principal frames.
"""

from __future__ import annotations

import functools
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.equations.joints import ROWS_OF
from mbref.equations.model import Model
from mbref.equations.structure import LAST_PART
from mbref.equations.units import row_lengths
from mbref.kernels.scene_layout import (
    CONTACT,
    COUPLED_ANGLE,
    COUPLED_SLIDE,
    DISTANCE,
    DOT1,
    DOT2,
    NO_SLIP,
    POINT,
    TURN_1,
    TURN_2,
    TURN_3,
)

ROW_WORDS = {
    POINT: "point", DOT1: "perpendicular", DOT2: "in plane", DISTANCE: "distance", CONTACT: "contact",
    NO_SLIP: "no slip",
}  # fmt: skip
ROW_UNITS = {
    POINT: "m", DOT1: "rad", DOT2: "m", DISTANCE: "m", COUPLED_ANGLE: "rad", COUPLED_SLIDE: "m", CONTACT: "m",
    NO_SLIP: "m", TURN_1: "rad", TURN_2: "rad", TURN_3: "rad",
}  # fmt: skip
COLUMN_WORDS = ("x", "y", "z", "about x'", "about y'", "about z'")
RANK_OF_MATRICES = 1e-10  # singular value of unit rows / largest one, below which a row counts as dependent


@dataclass(frozen=True, eq=False, repr=False)
class Matrices:
    """Equations of motion of a scene at one state: n = 6 nb velocities, m constraint rows.

    The bodies of the scene come first, then a modelled ground and the rotors of armatures.

    Attributes
    ----------
    t : float
        Time, s.
    q : ndarray, shape (7 nb,)
        Coordinates: of each body the centre of mass (m, world) and a unit quaternion (w, x, y, z).
    v : ndarray, shape (n,)
        Velocities q̇: of each body the velocity (m/s, world) and the angular velocity (rad/s, body axes).
    M : ndarray, shape (n, n), or None
        Mass matrix: kg, and kg m² in body axes. None if a body has no mass.
    Phi : ndarray, shape (m,)
        Constraints Φ(q, t), in the ``row_units``; zero in rows between velocities alone (no slip).
    Phi_q : ndarray, shape (m, n)
        Constraint Jacobian: row units per m and per rad.
    nu : ndarray, shape (m,)
        Right-hand side of Φ_q q̇ = ν, row units per s.
    gamma : ndarray, shape (m,)
        Right-hand side of Φ_q q̈ = γ, row units per s².
    g : ndarray, shape (n,), or None
        Applied and gyroscopic forces (N, world) and moments (N m, body axes). None if a body has no mass.
    rows, columns : tuple of str
        Labels: ``"A: point x"`` of joint A, ``"rod about z'"`` of body rod.
    row_units : tuple of str
        ``"m"`` or ``"rad"``; ``"rad"`` of cosines of right angles, too.
    units : ndarray, shape (n,)
        Displacements that compare when ranks are computed: a length of the mechanism, m, and 1 rad.
    """

    t: float
    q: np.ndarray
    v: np.ndarray
    M: np.ndarray | None
    Phi: np.ndarray
    Phi_q: np.ndarray
    nu: np.ndarray
    gamma: np.ndarray
    g: np.ndarray | None
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    row_units: tuple[str, ...]
    units: np.ndarray

    def __repr__(self) -> str:
        return f"<Matrices at t = {self.t:g} s: {len(self.columns)} velocities, {len(self.rows)} rows>"

    @property
    def q_rate(self) -> np.ndarray:
        """Rates of the coordinates q (7 nb,): ṙ, and ½ p ⊗ (0, ω') of the quaternions."""
        q, v = self.q.reshape(-1, 7), self.v.reshape(-1, 6)
        turn = np.concatenate([np.zeros((len(v), 1)), v[:, 3:]], axis=1)
        return np.concatenate([v[:, :3], 0.5 * rotations.multiply(q[:, 3:], turn)], axis=1).ravel()

    @functools.cached_property
    def rank(self) -> int:
        """Rank of Φ_q: unit rows, displacements in lengths of the mechanism or rad."""
        return self._factors.values.size

    @functools.cached_property
    def qdd(self) -> np.ndarray:
        """Accelerations q̈ (n,): m/s² world, rad/s² body axes; also for redundant rows.

        Without masses the least accelerations that satisfy Φ_q q̈ = γ; the accelerations of the motion if
        drivers prescribe it. Raises ``numpy.linalg.LinAlgError`` if massless bodies leave them open.
        """
        left, values, right, free, lengths = self._factors
        x = right.T @ ((left.T @ (self.gamma / lengths)) / values)
        if self.M is not None and self.g is not None:
            mass, force = self.units[:, None] * self.M * self.units, self.units * self.g
            x += free.T @ np.linalg.solve(free @ mass @ free.T, free @ (force - mass @ x))
        return np.asarray(self.units * x)

    @functools.cached_property
    def lam(self) -> np.ndarray:
        """Multipliers λ (m,) of M q̈ + Φ_qᵀ λ = g: N per m, N m per rad; of redundant rows the least ones.

        Raises ValueError if a body has no mass.
        """
        return self.multipliers_of(self.qdd)

    def multipliers_of(self, qdd: np.ndarray) -> np.ndarray:
        """Return the least multipliers λ (m,) for which Φ_qᵀ λ is nearest to g - M q̈, for given
        accelerations q̈.

        Parameters
        ----------
        qdd : ndarray, shape (n,)
            Accelerations, m/s² world and rad/s² body axes.

        Returns
        -------
        ndarray, shape (m,)
            Multipliers: N per m of a row, N m per rad.

        Raises
        ------
        ValueError
            If a body has no mass.
        """
        if self.M is None or self.g is None:
            raise ValueError("multipliers need the mass and inertia of every body")
        left, values, right, _, lengths = self._factors
        rest = self.units * (self.g - self.M @ qdd)
        return np.asarray(left @ ((right @ rest) / values) / lengths)

    @functools.cached_property
    def _factors(self) -> _Factors:
        jacobian = self.Phi_q * self.units
        lengths = row_lengths(jacobian)
        left, values, right = np.linalg.svd(jacobian / lengths[:, None])
        rank = int(np.sum(values > RANK_OF_MATRICES * values.max(initial=0.0)))
        return _Factors(left[:, :rank], values[:rank], right[:rank], right[rank:], lengths)


class _Factors(NamedTuple):
    """Singular values of Φ_q with unit rows, their vectors, free motions (n - r, n), lengths of the rows."""

    left: np.ndarray
    values: np.ndarray
    right: np.ndarray
    free: np.ndarray
    lengths: np.ndarray


class BodyFrames:
    """Conversion between the principal frames of a model and the bodies' own frames."""

    def __init__(self, model: Model):
        self._principal = model.principal
        turned = np.eye(6)[None] * np.ones((model.nb, 1, 1))
        turned[:, 3:, 3:] = rotations.to_matrix(model.principal)
        self._turns = turned

    def own_coordinates(self, q: np.ndarray) -> np.ndarray:
        """Return coordinates (7 nb,) with the quaternions of the bodies' own frames."""
        return self._turned(q, rotations.conjugate(self._principal))

    def principal_coordinates(self, q: np.ndarray) -> np.ndarray:
        """Return coordinates (7 nb,) with the quaternions of the principal frames."""
        return self._turned(q, self._principal)

    def _turned(self, q: np.ndarray, turn: np.ndarray) -> np.ndarray:
        found = q.reshape(-1, 7).copy()
        found[:, 3:] = rotations.multiply(found[:, 3:], turn)
        return found.ravel()

    def own(self, vectors: np.ndarray) -> np.ndarray:
        """Return velocities or forces (…, n) with rotations in the bodies' own axes."""
        parts = vectors.reshape(*vectors.shape[:-1], -1, 6, 1)
        return np.asarray((self._turns @ parts).reshape(vectors.shape))

    def principal(self, vectors: np.ndarray) -> np.ndarray:
        """Return velocities (…, n) with rotations in principal axes."""
        parts = vectors.reshape(*vectors.shape[:-1], -1, 6, 1)
        return np.asarray((np.swapaxes(self._turns, 1, 2) @ parts).reshape(vectors.shape))


def matrices_at(model: Model, frames: BodyFrames, t: float, q: np.ndarray, v: np.ndarray) -> Matrices:
    """Return the equations at time t (s), coordinates q (7 nb,) and velocities v (n,) of principal frames."""
    terms = model.terms(t, q, v)
    has_mass = not model.kinematic
    mass = frames.own(frames.own(np.diag(terms.mass)).T) if has_mass else None
    return Matrices(
        t=float(t),
        q=frames.own_coordinates(q),
        v=frames.own(v),
        M=mass,
        Phi=terms.phi,
        Phi_q=frames.own(terms.jacobian),
        nu=terms.nu,
        gamma=terms.gamma,
        g=frames.own(terms.force) if has_mass else None,
        units=model.units,
        **model.once(_labels),
    )


def _labels(model: Model) -> dict[str, tuple[str, ...]]:
    """Return labels and units of the rows, and labels of the columns of a model."""
    words: list[str] = []
    units: list[str] = []
    for place in model.structure.places.primitives:
        word = "driver" if place.driver >= 0 else ROW_WORDS.get(place.kind, "coupling")
        count = ROWS_OF[place.kind] * (place.part in (0, LAST_PART))
        axes = (" x", " y", " z") if count > 1 else ("",)
        words += [f"{place.joint}: {word}{axis}" for axis in axes[:count]]
        units += [ROW_UNITS[place.kind]] * count
    columns = tuple(f"{body.name} {word}" for body in model.bodies for word in COLUMN_WORDS)
    return {"rows": _numbered(words), "row_units": tuple(units), "columns": columns}


def _numbered(words: list[str]) -> tuple[str, ...]:
    """Return words, with a number behind those that appear more than once."""
    total, seen = Counter(words), Counter[str]()
    found = []
    for word in words:
        seen[word] += 1
        found.append(f"{word} {seen[word]}" if total[word] > 1 else word)
    return tuple(found)
