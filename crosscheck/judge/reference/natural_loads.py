"""Loads of a scene in natural coordinates, as Taylor series.

A force F (3, n) on the coordinates X (3, n) does the work Σ F δX.  Each load contributes its order k when the
coordinates are known to order k + 1, which dampers need.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.reference.held_rows import function_series
from crosscheck.judge.reference.motion import Ended
from crosscheck.judge.reference.natural import NaturalCoordinates, skew
from crosscheck.judge.reference.natural_joints import AngleForm, SlideForm, convolved
from mbref.scene import Factor, Force, JointLoad, Moment, PointDamper, RotationalDamper, Spring
from mbref.scene.joints import ANGLE
from mbref.scene.loads import Action

MEETING = 1e-12  # length of a spring / length of the mechanism, up to which its ends meet


class Loads:
    """Gravity and the loads of a scene; ``turned`` are loads about joints' axes, ``slid`` are loads along
    joints' axes."""

    def __init__(self, of: NaturalCoordinates):
        self.constant = of.arithmetic.zeros(3, 4 * of.nb + 4)
        self.arithmetic = of.arithmetic
        self.moments: list[tuple[slice, np.ndarray]] = []
        self.timed: list[tuple[Factor, np.ndarray]] = []
        self.timed_moments: list[tuple[Factor, slice, np.ndarray]] = []
        self.springs: list[SpringForm] = []
        self.turned: list[JointForm] = []
        self.slid: list[JointForm] = []
        for b, body in enumerate(of.scene.body if of.scene.has_mass() else ()):
            self.constant[:, 4 * b] = of.lengths(of.scene.gravity) * of.arithmetic.number(body.mass)
        for load in of.scene.load if of.scene.has_mass() else ():
            self._add(of, load)

    def _add(self, of: NaturalCoordinates, load: Any) -> None:
        if isinstance(load, Moment):
            b = of.scene.body_index(load.body)
            half = skew(of.arithmetic.array(load.moment) / of.length**2) / 2
            axes = slice(4 * b + 1, 4 * b + 4)
            if load.factor:
                self.timed_moments.append((load.factor, axes, half))
            else:
                self.moments.append((axes, half))
        elif isinstance(load, Force):
            form = of.point(of.scene.body_index(load.body), load.point)
            force = of.lengths(load.force)[:, None] * form
            if load.factor:
                self.timed.append((load.factor, force))
            else:
                self.constant = self.constant + force
        elif isinstance(load, Spring):
            self.springs.append(SpringForm(of, load))
        elif isinstance(load, JointLoad):
            (self.turned if load.coordinate == ANGLE else self.slid).append(_of_joint(of, load))
        else:
            self.slid += _damped(of, load)

    def refuse_abrupt(self, x: np.ndarray) -> None:
        """Raise Ended if the ends of a spring meet at coordinates x (3, n) where its force has no series."""
        for spring in self.springs:
            if not spring.is_linear and np.abs(doubles(x @ spring.vector)).max() <= MEETING:
                raise Ended(f"the ends of load[{spring.place}] meet, where its force has no direction")

    def series(self, t: Any, angles: Sequence[Any], terms: int) -> LoadSeries:
        """Return the loads as series about t with the given number of terms, from the angles of ``turned`` at
        t."""
        return LoadSeries(self, t, angles, terms)

    def factor(self, factor: Factor | None, t: Any, terms: int) -> np.ndarray:
        """Return Taylor coefficients (terms,) about t of a load's factor; 1 for a load without factor."""
        if factor is not None:
            return function_series(factor, t, terms, self.arithmetic)
        found = self.arithmetic.zeros(terms)
        found[0] = self.arithmetic.number(1.0)
        return found


class LoadSeries:
    """Series of the loads about one time."""

    def __init__(self, loads: Loads, t: Any, angles: Sequence[Any], terms: int):
        self._loads = loads
        self._timed = [(loads.factor(f, t, terms), force) for f, force in loads.timed]
        self._timed_moments = [
            (loads.factor(f, t, terms), axes, half) for f, axes, half in loads.timed_moments
        ]
        starts = [*angles, *(0 * loads.constant[0, 0] for _ in loads.slid)]
        pushes = [
            JointSeries(form, start, form.amount * loads.factor(form.over_time, t, terms))
            for form, start in zip([*loads.turned, *loads.slid], starts, strict=True)
        ]
        self.turned = pushes[: len(loads.turned)]
        self._all: list[SpringSeries | JointSeries] = [
            *(SpringSeries(form, terms) for form in loads.springs),
            *pushes,
        ]

    def grow(self, k: int, x: np.ndarray) -> None:
        """Add order k of the coordinates x (terms, 3, n)."""
        for load in self._all:
            load.grow(k, x)

    def order(self, k: int, x: np.ndarray) -> np.ndarray:
        """Return order k (3, n) of the force; the coordinates must be known to order k + 1."""
        force = self._loads.constant if k == 0 else 0 * self._loads.constant
        for load in self._all:
            force = force + load.order(k)
        for factor, constant in self._timed:
            force = force + factor[k] * constant
        force = force.copy()
        for axes, half in self._loads.moments:
            force[:, axes] = force[:, axes] + half @ x[k][:, axes]
        for factor, axes, half in self._timed_moments:
            force[:, axes] = force[:, axes] + half @ convolved(factor[:, None, None], x[:, :, axes], k)
        return force


class SpringForm:
    """A spring between two points: its vector X e, stiffness, damping, natural length. If it ``is_linear``,
    its force is stiffness times the vector, also where the ends meet."""

    def __init__(self, of: NaturalCoordinates, load: Spring):
        ends = (of.point(b, p) for b, p in zip(of.indices(load.bodies), load.points, strict=True))
        start, stop = ends
        self.place = of.scene.load.index(load)
        self.vector, self.zeros = stop - start, of.arithmetic.zeros
        self.stiffness, self.damping = of.arithmetic.array([load.stiffness, load.damping])
        self.rest = of.arithmetic.number(load.natural_length) / of.length
        self.is_linear = load.damping == 0.0 and load.natural_length == 0.0


class SpringSeries:
    """Series of a spring's force (k (1 - l₀ / l) + c l' / l) d, with recurrences for l² = d · d and 1 / l."""

    def __init__(self, form: SpringForm, terms: int):
        self._form = form
        self._d = form.zeros(terms, 3)
        self._length, self._inverse, self._rate, self._pull = form.zeros(4, terms)

    def grow(self, k: int, x: np.ndarray) -> None:
        """Compute order k of the vector, of its length and of 1 / length, and order k - 1 of the rate."""
        self._d[k] = x[k] @ self._form.vector
        if self._form.is_linear:
            return
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
        """Return order k (3, n) of the force."""
        form = self._form
        if form.is_linear:
            return -form.stiffness * self._d[k][:, None] * form.vector
        elastic = -form.stiffness * form.rest * self._inverse[k]
        self._pull[k] = elastic + form.damping * convolved(self._rate, self._inverse, k)
        if k == 0:
            self._pull[0] = self._pull[0] + form.stiffness
        return -convolved(self._pull[:, None], self._d, k)[:, None] * form.vector


class JointForm:
    """A load along a joint coordinate: the coordinate, stiffness, damping, natural value, applied amount."""

    def __init__(
        self,
        of: NaturalCoordinates,
        coordinate: AngleForm | SlideForm,
        unit: float,
        action: Action,
        over_time: Factor | None = None,
    ):
        number = of.arithmetic.number
        self.coordinate, self.over_time = coordinate, over_time
        self.stiffness, self.damping = (number(x) * unit**2 / of.length**2 for x in action[:2])
        self.rest, self.amount = number(action.natural) / unit, number(action.amount) * unit / of.length**2


def _of_joint(of: NaturalCoordinates, load: JointLoad) -> JointForm:
    joint = of.scene.joint_named(load.joint)
    if load.coordinate == ANGLE:
        return JointForm(of, AngleForm(of, joint), 1.0, load.action, load.over_time)
    return JointForm(of, SlideForm.of_joint(of, joint), of.length, load.action, load.over_time)


def _damped(of: NaturalCoordinates, load: RotationalDamper | PointDamper) -> Iterator[JointForm]:
    """Yield products q = a · d with the dissipation of a damper: d leads to its point, along three axes a of
    the first body; or d are axes of the second body, as (ω₂ - ω₁)² = ½ Σ q'² over nine products."""
    first, second = of.indices(load.bodies)
    axes = of.arithmetic.array(np.eye(3))
    if isinstance(load, PointDamper):
        aparts = [of.point(second, load.point) - of.point(first, load.point)]
        unit, action = of.length, Action(damping=load.damping)
    else:
        aparts = [of.direction(second, axis) for axis in axes]
        unit, action = 1.0, Action(damping=load.damping / 2)
    for axis, apart in itertools.product(axes, aparts):
        yield JointForm(of, SlideForm(of.direction(first, axis), apart, of.arithmetic.zeros), unit, action)


class JointSeries:
    """Series of a load's force or torque along a joint coordinate; an angle counts full turns, ``applied``
    has (terms,)."""

    def __init__(self, form: JointForm, start: Any, applied: np.ndarray):
        self._form, self._applied, self._moment = form, applied, 0 * applied
        self._moved = form.coordinate.series(start, len(applied))

    @property
    def value(self) -> np.ndarray:
        """Series of the coordinate (terms,)."""
        return self._moved.value

    def grow(self, k: int, x: np.ndarray) -> None:
        """Compute order k of the coordinate."""
        self._moved.grow(k, x)

    def order(self, k: int) -> np.ndarray:
        """Return order k (3, n) of the force: (amount - stiffness (q - rest) - damping q') times the
        gradient."""
        form = self._form
        elastic = self.value[k] - form.rest if k == 0 else self.value[k]
        resistance = form.stiffness * elastic + form.damping * (k + 1) * self.value[k + 1]
        self._moment[k] = resistance - self._applied[k]
        return -self._moved.pull(self._moment, k)
