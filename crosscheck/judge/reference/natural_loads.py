"""Loads of a scene in natural coordinates, as Taylor series.

A force F (3, n) on the coordinates X (3, n) does the work Σ F δX.  Each load adds its order k once the
coordinates are known to order k + 1, which dampers need.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crosscheck.judge.reference.natural import NaturalCoordinates, skew
from mbref.scene import Force, Moment, Spring, TorsionSpring


def convolved(a: np.ndarray, b: np.ndarray, k: int) -> Any:
    """Order k of the product of two series: Σ a_i b_{k-i}, i = 0 … k."""
    return (a[: k + 1] * b[k::-1]).sum(axis=0)


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


class TorsionForm:
    """A torsion spring: the joint's cross axes e₁, e₂ on its first body and f₁ on its second."""

    def __init__(self, of: NaturalCoordinates, load: TorsionSpring):
        joint: Any = next(j for j in of.scene.joint if j.name == load.joint)
        first, second = of.indices(joint.bodies)
        frame = of.frame(joint.axis)
        self.e1, self.e2 = of.direction(first, frame[0]), of.direction(first, frame[1])
        self.f, self.zeros = of.direction(second, frame[0]), of.arithmetic.zeros
        self.stiffness, self.damping = of.arithmetic.array([load.stiffness, load.damping]) / of.length**2
        self.rest = of.arithmetic.number(load.natural_angle)


class TorsionSeries:
    """Its angle, unwrapped, from θ' = C S' - S C' with C = e₁ · f₁ and S = e₂ · f₁."""

    def __init__(self, form: TorsionForm, angle: Any, terms: int):
        self._form = form
        self._e1, self._e2, self._f = form.zeros(3, terms, 3)
        self._cos, self._sin, self._moment, self._mcos, self._msin = form.zeros(5, terms)
        self.angle = form.zeros(terms)
        self.angle[0] = angle

    def grow(self, k: int, x: np.ndarray) -> None:
        """Order k of the axes, of cosine and sine, and of the angle."""
        self._e1[k], self._e2[k], self._f[k] = x[k] @ self._form.e1, x[k] @ self._form.e2, x[k] @ self._form.f
        self._cos[k] = convolved(self._e1, self._f, k).sum()
        self._sin[k] = convolved(self._e2, self._f, k).sum()
        if k:
            i = np.arange(1, k + 1)
            turn = (
                self._cos[k - 1 :: -1] * self._sin[1 : k + 1] - self._sin[k - 1 :: -1] * self._cos[1 : k + 1]
            )
            self.angle[k] = (i * turn).sum() / k

    def order(self, k: int) -> np.ndarray:
        """Order k (3, n) of the force: -moment × (C δS - S δC)."""
        form = self._form
        elastic = self.angle[k] - form.rest if k == 0 else self.angle[k]
        self._moment[k] = form.stiffness * elastic + form.damping * (k + 1) * self.angle[k + 1]
        self._mcos[k] = convolved(self._moment, self._cos, k)
        self._msin[k] = convolved(self._moment, self._sin, k)
        cosine, sine = self._mcos[:, None], self._msin[:, None]
        on_e2, on_e1 = convolved(cosine, self._f, k), convolved(sine, self._f, k)
        on_f = convolved(cosine, self._e2, k) - convolved(sine, self._e1, k)
        return -(on_e2[:, None] * form.e2 - on_e1[:, None] * form.e1 + on_f[:, None] * form.f)
