"""Loads of a scene in natural coordinates, as Taylor series.

A force F (3, n) on the coordinates X (3, n) does the work Σ F δX.  Each load adds its order k once the
coordinates are known to order k + 1, which dampers need.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.judge.reference.natural import NaturalCoordinates, skew
from crosscheck.judge.reference.natural_joints import AngleForm, convolved
from mbref.scene import Force, Moment, Spring, TorsionSpring


class Loads:
    """Gravity and the loads of a scene; ``turned`` are the angles of the torsion springs at the start."""

    def __init__(self, of: NaturalCoordinates):
        self.constant = of.arithmetic.zeros(3, 4 * of.nb + 4)
        self.moments: list[tuple[slice, np.ndarray]] = []
        self.springs: list[SpringForm] = []
        self.torsions: list[TorsionForm] = []
        for b, body in enumerate(of.scene.body if of.scene.has_mass() else ()):
            self.constant[:, 4 * b] = of.lengths(of.scene.gravity) * of.arithmetic.number(body.mass)
        for load in of.scene.load if of.scene.has_mass() else ():
            self._add(of, load)

    def _add(self, of: NaturalCoordinates, load: Any) -> None:
        if isinstance(load, Moment):
            b = of.scene.body_index(load.body)
            moment = of.arithmetic.array(load.moment) / of.length**2
            self.moments.append((slice(4 * b + 1, 4 * b + 4), skew(moment) / 2))
        elif isinstance(load, Force):
            form = of.point(of.scene.body_index(load.body), load.point)
            self.constant = self.constant + of.lengths(load.force)[:, None] * form
        elif isinstance(load, Spring):
            self.springs.append(SpringForm(of, load))
        else:
            self.torsions.append(TorsionForm(of, load))

    def series(self, angles: Sequence[Any], terms: int) -> LoadSeries:
        """The loads as series of so many terms, from the torsion springs' angles at the time of expansion."""
        return LoadSeries(self, angles, terms)


class LoadSeries:
    """The loads about one time."""

    def __init__(self, loads: Loads, angles: Sequence[Any], terms: int):
        self._loads = loads
        self.torsions = [
            TorsionSeries(form, angle, terms) for form, angle in zip(loads.torsions, angles, strict=True)
        ]
        self._all: list[SpringSeries | TorsionSeries] = [
            *(SpringSeries(form, terms) for form in loads.springs),
            *self.torsions,
        ]

    def grow(self, k: int, x: np.ndarray) -> None:
        """Take order k of the coordinates in; x (terms, 3, n)."""
        for load in self._all:
            load.grow(k, x)

    def order(self, k: int, x: np.ndarray) -> np.ndarray:
        """Order k (3, n) of the force; the coordinates are known to order k + 1."""
        force = self._loads.constant if k == 0 else 0 * self._loads.constant
        for load in self._all:
            force = force + load.order(k)
        for axes, half in self._loads.moments:
            force = force.copy()
            force[:, axes] = force[:, axes] + half @ x[k][:, axes]
        return force


class SpringForm:
    """A spring between two points: its vector X e, stiffness, damping, natural length."""

    def __init__(self, of: NaturalCoordinates, load: Spring):
        ends = (of.point(b, p) for b, p in zip(of.indices(load.bodies), load.points, strict=True))
        start, stop = ends
        self.vector, self.zeros = stop - start, of.arithmetic.zeros
        self.stiffness, self.damping = of.arithmetic.array([load.stiffness, load.damping])
        self.rest = of.arithmetic.number(load.natural_length) / of.length


class SpringSeries:
    """Its pull (k (1 - l₀ / l) + c l' / l) d, with l² = d · d and 1 / l by their recurrences."""

    def __init__(self, form: SpringForm, terms: int):
        self._form = form
        self._d = form.zeros(terms, 3)
        self._length, self._inverse, self._rate, self._pull = form.zeros(4, terms)

    def grow(self, k: int, x: np.ndarray) -> None:
        """Order k of the vector, of its length and of that's inverse, and order k - 1 of its rate."""
        self._d[k] = x[k] @ self._form.vector
        square = convolved(self._d, self._d, k).sum()
        if k == 0:
            self._length[0] = np.sqrt(square)
            self._inverse[0] = 1 / self._length[0]
            return
        lower = (self._length[1:k] * self._length[k - 1 : 0 : -1]).sum() if k > 1 else 0
        self._length[k] = (square - lower) / (2 * self._length[0])
        self._inverse[k] = -(self._length[1 : k + 1] * self._inverse[k - 1 :: -1]).sum() * self._inverse[0]
        self._rate[k - 1] = k * self._length[k]

    def order(self, k: int) -> np.ndarray:
        """Order k (3, n) of the force."""
        form = self._form
        elastic = -form.stiffness * form.rest * self._inverse[k]
        self._pull[k] = elastic + form.damping * convolved(self._rate, self._inverse, k)
        if k == 0:
            self._pull[0] = self._pull[0] + form.stiffness
        return -convolved(self._pull[:, None], self._d, k)[:, None] * form.vector


class TorsionForm(AngleForm):
    """A torsion spring: its joint's angle, stiffness, damping, natural angle."""

    def __init__(self, of: NaturalCoordinates, load: TorsionSpring):
        super().__init__(of, of.scene.joint_named(load.joint))
        self.stiffness, self.damping = of.arithmetic.array([load.stiffness, load.damping]) / of.length**2
        self.rest = of.arithmetic.number(load.natural_angle)


class TorsionSeries:
    """Its moment by the angle, which unwraps."""

    def __init__(self, form: TorsionForm, angle: Any, terms: int):
        self._form, self._moment = form, form.zeros(terms)
        self._turned = form.series(angle, terms)

    @property
    def angle(self) -> np.ndarray:
        """The angle (terms,)."""
        return self._turned.value

    def grow(self, k: int, x: np.ndarray) -> None:
        """Order k of the angle."""
        self._turned.grow(k, x)

    def order(self, k: int) -> np.ndarray:
        """Order k (3, n) of the force: -moment × (C δS - S δC)."""
        form = self._form
        elastic = self.angle[k] - form.rest if k == 0 else self.angle[k]
        self._moment[k] = form.stiffness * elastic + form.damping * (k + 1) * self.angle[k + 1]
        return -self._turned.pull(self._moment, k)
