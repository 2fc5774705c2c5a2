"""Joint coordinates in natural coordinates as Taylor series; the rows of couplings and armatures.

An angle follows from θ' = C S' - S C' with C = e₁ · f₁ and S = e₂ · f₁ of the cross axes e of the first body
and f of the second, a displacement is a · d.  Order j of the angle and of the displacement is linear in X_j,
with the gradient at the time of expansion, so that a coupling is a row with a multiplier. An armature I is a
row, too. Its multiplier is μ = I q''; its entry on the diagonal is -1 / I.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.judge.coupling_laws import law_value
from mbref.scene import Joint
from mbref.scene.joints import ANGLE

SETTLING = 3  # corrections of an angle, each of which leaves the cube of the previous error


def convolved(a: np.ndarray, b: np.ndarray, k: int) -> Any:
    """Return order k of the product of two series: Σ a_i b_{k-i}, i = 0 … k."""
    return (a[: k + 1] * b[k::-1]).sum(axis=0)


class AngleForm:
    """Angle of a joint: its cross axes e₁, e₂ on the first body and f₁ on the second."""

    turns = True

    def __init__(self, of: Any, joint: Joint):
        first, second = of.indices(joint.bodies)
        frame = of.frame(joint.directions[0])
        self.e1, self.e2 = of.direction(first, frame[0]), of.direction(first, frame[1])
        self.f, self.zeros = of.direction(second, frame[0]), of.arithmetic.zeros

    def series(self, start: Any, terms: int) -> AngleSeries:
        """Return the angle as a series with the given number of terms, from its value at the time of
        expansion."""
        return AngleSeries(self, start, terms)

    def value(self, x: np.ndarray, near: Any) -> Any:
        """Return the angle at coordinates x (3, n), which differs from ``near`` by rounding only."""
        f = x @ self.f
        cosine, sine = (x @ self.e1 * f).sum(), (x @ self.e2 * f).sum()
        for _ in range(SETTLING):
            near = near + sine * np.cos(near) - cosine * np.sin(near)
        return near

    def rate(self, x: np.ndarray, v: np.ndarray) -> Any:
        """Return the rate of the angle at coordinates and rates (3, n)."""
        f, f_rate = x @ self.f, v @ self.f
        (c, c_rate), (s, s_rate) = (
            ((x @ e * f).sum(), (v @ e * f).sum() + (x @ e * f_rate).sum()) for e in (self.e1, self.e2)
        )
        return c * s_rate - s * c_rate

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives (3, n) of the angle by coordinates x (3, n)."""
        e1, e2, f = x @ self.e1, x @ self.e2, x @ self.f
        c, s = (e1 * f).sum(), (e2 * f).sum()
        on_f = c * e2 - s * e1
        return (c * f)[:, None] * self.e2 - (s * f)[:, None] * self.e1 + on_f[:, None] * self.f


class AngleSeries:
    """Series of an angle and of the force that a moment about it exerts, about one time."""

    def __init__(self, form: AngleForm, start: Any, terms: int):
        self._form = form
        self._e1, self._e2, self._f = form.zeros(3, terms, 3)
        self._cos, self._sin, self._mcos, self._msin = form.zeros(4, terms)
        self.value = form.zeros(terms)
        self.value[0] = start

    def grow(self, k: int, x: np.ndarray) -> None:
        """Compute order k of the axes, of cosine and sine, and of the angle."""
        self._e1[k], self._e2[k], self._f[k] = x[k] @ self._form.e1, x[k] @ self._form.e2, x[k] @ self._form.f
        self._cos[k] = convolved(self._e1, self._f, k).sum()
        self._sin[k] = convolved(self._e2, self._f, k).sum()
        if k:
            i = np.arange(1, k + 1)
            turn = (
                self._cos[k - 1 :: -1] * self._sin[1 : k + 1] - self._sin[k - 1 :: -1] * self._cos[1 : k + 1]
            )
            self.value[k] = (i * turn).sum() / k

    def pull(self, moment: np.ndarray, k: int) -> np.ndarray:
        """Return order k (3, n) of a moment (terms,) times the gradient, C δS - S δC."""
        form = self._form
        self._mcos[k], self._msin[k] = convolved(moment, self._cos, k), convolved(moment, self._sin, k)
        cosine, sine = self._mcos[:, None], self._msin[:, None]
        on_e2, on_e1 = convolved(cosine, self._f, k), convolved(sine, self._f, k)
        on_f = convolved(cosine, self._e2, k) - convolved(sine, self._e1, k)
        return np.asarray(on_e2[:, None] * form.e2 - on_e1[:, None] * form.e1 + on_f[:, None] * form.f)


class SlideForm:
    """Displacement of a joint: its axis on the first body, and the vector between its anchors, in the unit of
    length."""

    turns = False

    def __init__(self, axis: np.ndarray, apart: np.ndarray, zeros: Any):
        self.axis, self.apart, self.zeros = axis, apart, zeros

    @classmethod
    def of_joint(cls, of: Any, joint: Joint) -> SlideForm:
        """Return the displacement of a joint."""
        first, second = of.indices(joint.bodies)
        anchors = joint.anchor_pair
        axis = of.direction(first, of.frame(joint.directions[0])[2])
        apart = of.point(second, anchors[1]) - of.point(first, anchors[0])
        return cls(axis, apart, of.arithmetic.zeros)

    def series(self, start: Any, terms: int) -> SlideSeries:
        """Return the displacement as a series with the given number of terms."""
        return SlideSeries(self, terms)

    def value(self, x: np.ndarray, near: Any) -> Any:
        """Return the displacement at coordinates x (3, n)."""
        return (x @ self.axis * (x @ self.apart)).sum()

    def rate(self, x: np.ndarray, v: np.ndarray) -> Any:
        """Return the rate of the displacement at coordinates and rates (3, n)."""
        return (v @ self.axis * (x @ self.apart)).sum() + (x @ self.axis * (v @ self.apart)).sum()

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the derivatives (3, n) of the displacement by coordinates x (3, n)."""
        return (x @ self.apart)[:, None] * self.axis + (x @ self.axis)[:, None] * self.apart


class SlideSeries:
    """Series of a displacement and of the force that acts along it, about one time."""

    def __init__(self, form: SlideForm, terms: int):
        self._form, self.value = form, form.zeros(terms)
        self._axis, self._apart = form.zeros(2, terms, 3)

    def grow(self, k: int, x: np.ndarray) -> None:
        """Compute order k of axis, vector and displacement."""
        self._axis[k], self._apart[k] = x[k] @ self._form.axis, x[k] @ self._form.apart
        self.value[k] = convolved(self._axis, self._apart, k).sum()

    def pull(self, force: np.ndarray, k: int) -> np.ndarray:
        """Return order k (3, n) of a force (terms,) times the gradient."""
        on_axis, on_apart = (convolved(force[:, None], v, k) for v in (self._apart, self._axis))
        return np.asarray(on_axis[:, None] * self._form.axis + on_apart[:, None] * self._form.apart)


Form = AngleForm | SlideForm


@dataclass(frozen=True)
class Gear:
    """The row Σ law(q), with coordinates q given by number; a law has the factors of q, q², ….

    For a coupling the sum is 0. For an armature the second derivative of the sum is the multiplier over the
    ``inertia``.
    """

    terms: tuple[tuple[int, tuple[Any, ...]], ...]
    inertia: Any = None

    @property
    def bends(self) -> bool:
        """True if a law has a power above the first."""
        return any(len(law) > 1 for _, law in self.terms)

    def total(self, values: Sequence[Any]) -> Any:
        """Return Σ law(q), with one value for each coordinate."""
        found = [law_value(law, values[i]) for i, law in self.terms]
        return sum(found[1:], found[0])

    def rate(self, rates: Sequence[Any], values: Sequence[Any]) -> Any:
        """Return Σ law'(q) × rate, with rates or gradients, and values q, of the coordinates; a linear row
        needs no values."""
        slopes = [law[0] if len(law) == 1 else law_value(law, values[i], 1) for i, law in self.terms]
        found = [slope * rates[i] for slope, (i, _) in zip(slopes, self.terms, strict=True)]
        return sum(found[1:], found[0])


class JointCoordinates:
    """The joint coordinates on which couplings and armatures act, and a row for each coupling and armature.

    ``of`` is the scene in natural coordinates.
    """

    def __init__(self, of: Any):
        self._of, self._numbers, self.forms = of, dict[tuple[str, str], int](), list[Form]()
        self.couplings = [self._coupling(coupling) for coupling in of.scene.coupling]
        geared = [j for j in of.scene.joint if j.reflected_inertia and of.scene.has_mass()]
        self.armatures = [self._armature(joint) for joint in geared]

    def _coupling(self, coupling: Any) -> Gear:
        ends = zip(self._of.scene.coupled(coupling), coupling.laws, strict=True)
        pairs = [(self._number(*end), law) for end, law in ends]
        units = [1.0 if self.forms[i].turns else self._of.length for i, _ in pairs]
        largest = max(abs(law[0]) * unit for (_, law), unit in zip(pairs, units, strict=True))
        number, terms = self._of.arithmetic.number, []
        for (i, law), unit in zip(pairs, units, strict=True):
            terms.append((i, tuple(number(c) * unit**k / largest for k, c in enumerate(law, 1))))
        return Gear(tuple(terms))

    def _armature(self, joint: Joint) -> Gear:
        i = self._number(joint, str(joint.facts.driven))
        inertia = self._of.arithmetic.number(joint.reflected_inertia)
        if self.forms[i].turns:
            inertia = inertia / self._of.length**2
        return Gear(((i, (self._of.arithmetic.number(1.0),)),), inertia)

    def _number(self, joint: Joint, coordinate: str) -> int:
        """Return the number of a coordinate; a new coordinate is appended."""
        key = joint.name, coordinate
        if key not in self._numbers:
            self._numbers[key] = len(self.forms)
            self.forms.append((AngleForm if coordinate == ANGLE else SlideForm.of_joint)(self._of, joint))
        return self._numbers[key]

    def start(self) -> list[Any]:
        """Return the coordinates at t = 0."""
        return [self._of.arithmetic.number(0.0) for _ in self.forms]

    def values(self, x: np.ndarray, near: Sequence[Any]) -> list[Any]:
        """Return the coordinates at X (3, n); angles differ from ``near`` by rounding only."""
        return [form.value(x, old) for form, old in zip(self.forms, near, strict=True)]

    def rates(self, x: np.ndarray, v: np.ndarray) -> list[Any]:
        """Return the rates of the coordinates at X and X' (3, n)."""
        return [form.rate(x, v) for form in self.forms]

    def gaps(
        self, couplings: Sequence[Gear], x: np.ndarray, v: np.ndarray, near: Sequence[Any]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals (g,) of couplings and of their time derivatives; angles differ from ``near`` by
        rounding only."""
        if not couplings:
            return (self._of.arithmetic.zeros(0),) * 2
        values, rates = self.values(x, near), self.rates(x, v)
        first = np.array([gear.total(values) for gear in couplings])
        return first, np.array([gear.rate(rates, values) for gear in couplings])

    def mass(self, x: np.ndarray) -> np.ndarray:
        """Return the armatures' part (3 (n - 4), 3 (n - 4)) of the mass matrix at coordinates x (3, n)."""
        size = 3 * (x.shape[1] - 4)
        total = self._of.arithmetic.zeros(size, size)
        for gear, gradient in zip(self.armatures, self.gradients(self.armatures, x, ()), strict=True):
            total = total + gear.inertia * (gradient.ravel()[:, None] * gradient.ravel())
        return np.asarray(total)

    def gradients(self, gears: Sequence[Gear], x: np.ndarray, near: Sequence[Any]) -> np.ndarray:
        """Return derivatives (g, 3, n - 4) of the rows of gears by coordinates x (3, n); angles are nearest
        to ``near``."""
        if not gears:
            return self._of.arithmetic.zeros(0, 3, x.shape[1] - 4)
        found = [form.gradient(x)[:, :-4] for form in self.forms]
        values = self.values(x, near) if any(gear.bends for gear in gears) else ()
        return np.array([gear.rate(found, values) for gear in gears])


class GearSeries:
    """Series of the joint coordinates, and of the multipliers of gears, about one time."""

    def __init__(
        self, of: JointCoordinates, gears: Sequence[Gear], start: Sequence[Any], terms: int, zeros: Any
    ):
        self.gears = gears
        self.coordinates = [form.series(value, terms) for form, value in zip(of.forms, start, strict=True)]
        self._moments, self._nothing = zeros(len(of.forms), terms), zeros(len(gears))
        self._multipliers = zeros(len(gears), terms)
        self._slopes: dict[tuple[int, int], np.ndarray] = {}  # series of law'(q), by gear and coordinate

    def grow(self, k: int, x: np.ndarray) -> None:
        """Add order k of the coordinates X (terms, 3, n)."""
        for coordinate in self.coordinates:
            coordinate.grow(k, x)

    def gaps(self, k: int) -> np.ndarray:
        """Return order k (g,) of the rows."""
        found = self._nothing.copy()
        for g, gear in enumerate(self.gears):
            for i, law in gear.terms:
                found[g] = found[g] + _composed(law, self.coordinates[i].value, k)
        return np.asarray(found)

    def pull(self, k: int) -> Any:
        """Return order k (3, n) of the gradients times the multipliers; 0 without gears."""
        self._act(k)
        pairs = zip(self.coordinates, self._moments, strict=True)
        return sum((coordinate.pull(moment, k) for coordinate, moment in pairs), 0)

    def put(self, multipliers: np.ndarray, k: int) -> None:
        """Add order k of the multipliers (g,)."""
        self._multipliers[:, k] = multipliers
        self.pull(k)

    def _act(self, k: int) -> None:
        """Compute order k of the moments, law'(q) times the multiplier, from known orders of multipliers."""
        self._moments[:, k] = self._moments[:, k] * 0
        for g, (known, gear) in enumerate(zip(self._multipliers, self.gears, strict=True)):
            for i, law in gear.terms:
                if len(law) == 1:
                    self._moments[i, k] = self._moments[i, k] + law[0] * known[k]
                    continue
                slopes = self._slopes.setdefault((g, i), 0 * self.coordinates[i].value)
                rest = [power * factor for power, factor in enumerate(law[1:], 2)]
                slopes[k] = law[0] * (k == 0) + _composed(rest, self.coordinates[i].value, k)
                self._moments[i, k] = self._moments[i, k] + convolved(slopes, known, k)


def _composed(law: Sequence[Any], q: np.ndarray, k: int) -> Any:
    """Return order k of law[0] q + law[1] q² + … of a series q (terms,)."""
    if len(law) < 2:
        return law[0] * q[k] if law else 0
    total = 0 * q[: k + 1]
    for factor in law[::-1]:
        total[0] = total[0] + factor
        total = np.array([convolved(total, q, n) for n in range(k + 1)])
    return total[k]
