"""The motion of a scene by formulation A: Taylor series of high order, step after step.

Steps are as long as the series' smallest term allows (À. Jorba and M. Zou, Experimental Mathematics 14,
2005); after each step the coordinates are projected onto the constraint rows.  Near a singular position
rounding dominates the series, so one step crosses the position along the branch that the series continues.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from crosscheck.judge.arithmetic import Arithmetic, doubles, largest
from crosscheck.judge.deadline import TimeIsUp, ask, within
from crosscheck.judge.reference.expansion import Expansion, Series, value
from crosscheck.judge.reference.held_rows import HeldRows, independent
from crosscheck.judge.reference.motion import Ended, Motion, Progress, Times, no_progress
from crosscheck.judge.reference.natural import NaturalCoordinates
from crosscheck.judge.reference.natural_loads import Loads
from crosscheck.judge.reference.saddle_point import SaddlePoint
from crosscheck.judge.reference.start_velocities import start_velocities
from crosscheck.judge.time_functions import next_end
from mbref.scene import Scene

ORDER = 28
NEW_ROW = 1e-4  # a row that was dependent at the start counts as independent from this pivot on
# smallest singular value / value of the best selection: below it rows are selected again
ILL_CONDITIONED = 0.25
# least (smallest singular value of new rows / value of the best selection) at which new rows are accepted,
WELL_CONDITIONED = 0.5
BETTER = 1e3  # or if their smallest singular value exceeds the old rows' value by this factor
NEAR = 0.4  # smallest singular value / usual value, below which a singular position is near
PREFERENCE = 0.2  # largest relative change of a row's weight
USUAL = 50  # number of steps whose median of the smallest singular value is the usual value
DATA = float(np.finfo(float).eps)  # rounding unit of a scene's numbers
# multiple of the tolerance: largest error of a step across a singular position without a second attempt
ENOUGH = 100.0
TRIED = 24  # number of step lengths at which a singular position is searched
FINE = 1e-6  # relative accuracy of the time of the singular position
DEPENDENT = 0.02  # smallest singular value / present value, below which rows count as dependent
SHORTER = 0.8  # factor on a step that ends too near to a singular position
LEAST_STEP = 1e-6  # s; shortest step near the time limit
SHORTEST = 1e-9  # step / time reached: a shorter step ends the run
STEPS_END = "its steps end: its series cannot be continued over a singular position there"
WITHOUT_INERTIA = 1e-13  # fraction of the largest inertia; smaller inertias count as zero


def natural_motion(
    scene: Scene,
    times: Times,
    arithmetic: Arithmetic,
    *,
    seconds: float = np.inf,
    order: int = ORDER,
    tolerance: float | None = None,
    seed: int = 0,
    displaced: float = 0.0,
    progress: Progress = no_progress,
) -> Motion:
    """Return the motion at increasing times (k,) ≥ 0 in natural coordinates (see Motion), by Taylor series of
    an order. ``tolerance`` is the relative tolerance of a step (default: the arithmetic's rounding unit).
    Another ``seed`` selects other rows if rows are redundant, and displaces joints by up to ``displaced``,
    relative to the largest coordinate. ``seconds`` limits the CPU time of the thread; ``progress`` receives
    the time of every step."""
    began, reason, samples = time.thread_time(), "", []
    stepper = Stepper(scene, arithmetic, order, tolerance or arithmetic.eps, (seed, displaced))
    try:
        with within(seconds):
            for sample in stepper.samples(times, progress):
                samples.append(sample)
    except (Ended, TimeIsUp) as end:
        reason = str(end)
    shape = (len(samples), 3, 3, 4 * len(scene.body) + 4)
    x, v, a = np.moveaxis(np.array(samples, dtype=arithmetic.dtype).reshape(shape), 1, 0)
    return Motion(
        np.asarray(times[: len(samples)], dtype=float),
        *stepper.of.bodies(x, v, a),
        reached=float(stepper.t if reason else max(times, default=0.0)),
        reason=reason,
        steps=stepper.steps,
        crossings=tuple(stepper.crossings),
        seconds=time.thread_time() - began,
        contradiction=stepper.contradiction,
    )


class Stepper:
    """The coordinates of a scene at a time ``t``, and the steps that advance them."""

    def __init__(
        self, scene: Scene, arithmetic: Arithmetic, order: int, tolerance: float, way: tuple[int, float]
    ):
        self.of = NaturalCoordinates(scene, arithmetic)
        self.t: Any = arithmetic.number(0.0)
        self.steps = 0
        self.crossings: list[float] = []
        self.contradiction = 0.0
        self._loads = Loads(self.of)
        self._order, self._tolerance = order, tolerance
        self._x, self._v = self.of.start()
        self._angles = [arithmetic.number(0.0) for _ in self._loads.turned]
        self._turned = self.of.joints.start()
        self._weights = self._varied(*way)
        self._every, self._lost = HeldRows(self.of, range(self.of.count)), np.inf
        self._held, self._conditioning = self._every, list[float]()

    def _varied(self, seed: int, displaced: float) -> np.ndarray:
        """Return row weights (m,) near one that depend on the seed, so that other rows are selected; also
        displace the joints."""
        if not seed:
            return np.ones(self.of.count)
        self.of.take_right_angles()
        rng, constants = np.random.default_rng(seed), self.of.c[6 * self.of.nb :]
        constants += self.of.arithmetic.array(displaced * self._size() * rng.uniform(-1, 1, len(constants)))
        return 1 + PREFERENCE * rng.random(self.of.count)

    def samples(self, times: Times, progress: Progress) -> Iterator[tuple[np.ndarray, ...]]:
        """Return X, X', X'' (3, n) at increasing times; raises Ended if the motion cannot be followed."""
        self._held = self._choice(self._x, self.t)[0]
        self._conditioning = [self._sharp(self._x, self.t)]
        self._refuse_undetermined()
        self._loads.refuse_abrupt(self._x)
        self._start()
        pending = list(times)
        while pending:
            ask()
            left = next_end(self.of.scene, float(self.t)) - float(self.t)
            expansion, h = self._step(min(2 * (float(times[-1]) - float(self.t)), left), left)
            series = expansion.x[: Series(expansion.x).terms(h)]
            if not self.steps:
                self._refuse_singular_start(series, self.of.arithmetic.number(h / 2))
            while pending and (pending[0], h >= left) <= (float(self.t) + h, False):
                d = self.of.arithmetic.number(pending.pop(0)) - self.t
                yield tuple(self.of.arithmetic.settled(value(series, d, n)) for n in range(3))
            self._advance(expansion, series, h)
            progress(float(self.t))

    def _start(self) -> None:
        """Project the coordinates onto the rows, and compute the velocities by the documented rule."""
        self._project()
        held, drives = self._held, self._held.drives(self.t, 1)
        rows = held.all_gradients(self._x, drives, self._turned)[: held.count].reshape(held.count, -1)
        rates = rows @ self._v[:, :-4].ravel() - self._gaps(held)[1]
        mass = np.kron(np.eye(3, dtype=int), self.of.mass) + self.of.joints.mass(self._x)
        v = start_velocities(self.of.arithmetic, rows, rates, *self.of.given_velocities(self._x), mass)
        self._v[:, :-4] = v.reshape(3, -1)
        self._project()

    def _expansion(self, order: int) -> Expansion:
        state = self._x, self._v
        return Expansion(self.of, self._held, self._loads, order, self.t, state, self._angles, self._turned)

    def _advance(self, expansion: Expansion, series: np.ndarray, h: float) -> None:
        d, settled = self.of.arithmetic.number(h), self.of.arithmetic.settled
        self._x, self._v = settled(value(series, d)), settled(value(series, d, 1))
        self._angles = [settled(value(angle[: len(series)], d))[()] for angle in expansion.angles]
        self._turned = [settled(value(one[: len(series)], d))[()] for one in expansion.turned]
        self.t = settled(self.t + d)[()]
        self.steps += 1
        self._conditioning.append(self._sharp(self._x, self.t))
        self._choose_again()
        self._project()
        self.contradiction = max(self.contradiction, largest(self._gaps(self._every)[0]) / self._size())

    def _size(self) -> float:
        """Return the largest coordinate, at least one."""
        return max(1.0, largest(self._x))

    def _choice(self, x: np.ndarray, t: Any) -> tuple[HeldRows, int]:
        """Return independent rows at the coordinates x, and the number of well-conditioned rows."""
        rows, pivots = independent(self._every.unit_gradient(x, t, self._turned), self._weights)
        return HeldRows(self.of, rows), int((pivots > NEW_ROW).sum())

    def _sharp(self, x: np.ndarray, t: Any) -> float:
        """Return the smallest singular value of the selected rows, scaled to unit length."""
        ask()
        return float(np.linalg.svd(self._held.unit_gradient(x, t, self._turned), compute_uv=False)[-1])

    def _choose_again(self) -> None:
        """Select other rows if the present rows are ill-conditioned and the position is not singular.
        Ill-conditioned rows amplify contradictions."""
        now, best = self._conditioning[-1], max(self._conditioning)
        if now <= ILL_CONDITIONED * best:
            self._hold_others(self._x, self.t, min(WELL_CONDITIONED * best, BETTER * now))

    def _hold_others(self, x: np.ndarray, t: Any, least: float) -> bool:
        """Select the rows that are independent at coordinates x if their conditioning exceeds ``least`` and
        the conditioning of the present rows. Returns whether the selection changed."""
        before, now = self._held, self._conditioning[-1]
        self._held = self._choice(x, t)[0]
        here, there = self._sharp(self._x, self.t), self._sharp(x, t)
        if self._held.count == before.count and there > least and here > now:
            self._conditioning = [here]
            return True
        self._held = before
        return False

    def _refuse_singular_start(self, series: np.ndarray, d: Any) -> None:
        """Raise Ended if more rows are independent shortly after the start than at the start."""
        if self._choice(value(series, d), self.t + d)[1] > self._held.count:
            raise Ended(
                "it starts in a singular position, from which several motions are possible: give poses and "
                "velocities of a later time on the intended branch"
            )

    def _refuse_undetermined(self) -> None:
        """Raise Ended if a degree of freedom has neither driver nor inertia."""
        rows = self._held.unit_gradient(self._x, self.t, self._turned)
        free = np.linalg.svd(rows, full_matrices=True)[2][len(rows) :].reshape(-1, 3, 4 * self.of.nb)
        if not self.of.scene.has_mass() and len(free):
            raise Ended("bodies without mass have to be driven in every freedom")
        inertia = np.einsum("ick,kl,jcl->ij", free, doubles(self.of.mass), free)
        flat = free.reshape(len(free), self._x[:, :-4].size)
        inertia = inertia + flat @ doubles(self.of.joints.mass(self._x)) @ flat.T
        sizes, ways = np.linalg.eigh(inertia)
        if len(sizes) and sizes[0] <= WITHOUT_INERTIA * doubles(self.of.mass).max():
            way = np.abs(np.einsum("i,icn->cn", ways[:, 0], free)).max(axis=0)
            raise Ended(f"body {self.of.scene.body[way.argmax() // 4].name!r} can turn without inertia")

    def _gaps(self, held: HeldRows) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals (m,) of rows and of their time derivatives."""
        drives = held.drives(self.t, 2)
        u, w = (np.stack([form(self._x), form(self._v)]) for form in (held.u, held.w))
        products = np.stack([(u[0] * w[0]).sum(axis=0), (u[0] * w[1] + u[1] * w[0]).sum(axis=0)])
        own = drives.combined(products, 0) - drives.c[0], drives.combined(products, 1) - drives.c[1]
        coupled = self.of.joints.gaps(held.couplings, self._x, self._v, self._turned)
        return np.concatenate([own[0], coupled[0]]), np.concatenate([own[1], coupled[1]])

    def _project(self) -> None:
        """Project coordinates and velocities onto the rows, with the least mass-weighted change. Raises Ended
        if the rows are dependent to the digits of the arithmetic."""
        arithmetic, held = self.of.arithmetic, self._held
        if not held.count:
            return
        rows, still = held.all_gradients(self._x, held.drives(self.t, 1), self._turned), 0 * self._x[:, :-4]
        system = SaddlePoint(self.of.mass, rows, held.compliance(arithmetic.zeros), arithmetic)
        free = arithmetic.zeros(len(rows) - held.count)
        for level, rounds in ((0, 4), (1, 2)):
            for _ in range(rounds):
                gap, state = self._gaps(held)[level], (self._x, self._v)[level]
                if largest(gap) <= 4 * arithmetic.eps * max(largest(state), 1.0):
                    break
                step = system.solve(still, np.concatenate([-gap, free]))[0]
                state[:, :-4] = arithmetic.settled(state[:, :-4] + step)
        self._turned = self.of.joints.values(self._x, self._turned)
        if not np.isfinite(doubles(np.stack([self._x, self._v]))).all():
            raise Ended("a pivot of its equations is zero to the digits of the arithmetic")

    def _step(self, most: float, left: float) -> tuple[Expansion, float]:
        """Return a series and the length (s) of its step: at most ``most``, and at most the time ``left`` (s)
        in a piece of a function of time. The step does not end much nearer to a singular position."""
        expansion = self._expansion(self._order)
        series = Series(expansion.x)
        h = series.reach(self._tolerance)
        if h <= SHORTEST * max(1e-3, float(self.t)):
            raise Ended(STEPS_END)
        h, now = min(h, max(most, LEAST_STEP), left), self._conditioning[-1]
        ahead = self._ahead(expansion.x, series, h)
        if ahead < now < NEAR * max(self._conditioning[-USUAL:]):
            middle = self._crossing(expansion.x, series, h)
            if middle and self._others_serve(expansion.x[: series.terms(h)], middle):
                return self._step(most, left)
            longer = self._expansion(2 * self._order) if middle else expansion
            if middle and 2 * middle <= left and self._may_step_across(Series(longer.x).left_out(2 * middle)):
                self.crossings.append(float(self.t) + middle)
                return longer, 2 * middle
        return expansion, self._shortened(expansion.x, series, h, ahead)

    def _shortened(self, x: np.ndarray, series: Series, h: float, ahead: float) -> float:
        """Return the length (s) of a step that does not end much nearer to a singular position; ``ahead`` is
        the conditioning at the end of a step of length h. Raises Ended if no length is short enough. The
        conditioning at the start is computed again, because the coordinates were corrected."""
        if ahead >= NEAR * self._conditioning[-1]:
            return h
        least, now = SHORTEST * max(1e-3, float(self.t)), self._sharp(self._x, self.t)
        while ahead < NEAR * now:
            if h <= least:
                raise Ended(STEPS_END)
            h *= SHORTER
            ahead = self._ahead(x, series, h)
        return h

    def _others_serve(self, series: np.ndarray, middle: float) -> bool:
        """Return whether only the selected rows are dependent at a distance (s) ahead, but other rows are
        not. In this case the position is not singular, and the other rows are selected."""
        d = self.of.arithmetic.number(middle)
        if not self._hold_others(value(series, d), self.t + d, self._conditioning[-1]):
            return False
        self._project()
        return True

    def _ahead(self, x: np.ndarray, series: Series, h: float) -> float:
        """Return the conditioning of the selected rows at the end of a step."""
        d = self.of.arithmetic.number(h)
        return self._sharp(value(x[: series.terms(h)], d), self.t + d)

    def _may_step_across(self, lost: float) -> bool:
        """Return whether a step across a singular position loses no more than rounding, or than a second
        attempt."""
        before, self._lost = self._lost, lost
        ill_conditioned = max(self._conditioning[-USUAL:]) / self._conditioning[-1]
        data = 0.0 if self.of.arithmetic.digits else DATA * ill_conditioned**2
        enough = max(ENOUGH * self._tolerance, data)
        if lost > np.sqrt(self._tolerance) or enough < lost < before:
            return False
        self._lost = np.inf
        return True

    def _crossing(self, x: np.ndarray, series: Series, h: float) -> float:
        """Return the time (s) until the selected rows become dependent, by the series; 0 if they stay
        independent."""

        def sharp(length: float) -> float:
            return self._ahead(x, series, length)

        lengths = np.geomspace(h / 4, max(h, series.reach(np.sqrt(self._tolerance))), TRIED)
        values = np.array([sharp(length) for length in lengths])
        lowest = int((np.diff(values) > 0).argmax())
        if not lowest:
            return 0.0
        around = lengths[lowest - 1], lengths[lowest + 1]
        found = minimize_scalar(sharp, bounds=around, method="bounded", options={"xatol": FINE * around[0]})
        return float(found.x) if found.fun < DEPENDENT * self._conditioning[-1] else 0.0
