"""Times at which the reference meets or leaves end stops or meets conditions, and the impacts there, by one
formulation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Sequence

import numpy as np
from scipy.optimize import brentq

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.pieces import State, parts_of
from crosscheck.judge.reference.motion import Motion
from crosscheck.judge.reference.signals import (
    FIELDS,
    PULL,
    Moved,
    Seen,
    Signal,
    lowest_samples,
    of_conditions,
    of_stop,
    refuse_open,
)
from crosscheck.judge.stops import (
    CHATTER,
    End,
    bounced,
    ends_of,
    held,
    hits,
    is_locked,
    rates_of,
    second_rates,
    still,
    width,
)
from crosscheck.judge.time_functions import functions_of
from mbref.scene import Scene

Run = Callable[[Scene, np.ndarray], Motion]  # of a piece, at increasing times (k,), s
SAMPLES = 129  # least number of a piece, between which a signal has at most one minimum
PER_STEP, PER_PERIOD = 8, 32  # samples for each step of the reference, and period of a function of time
BETWEEN = 9  # samples from one change of a function's law to the next
BEFORE = 1e-12  # time before such a change / its time, at which forces have their values before it
SOONEST = 1e-10  # of the longest time, below which an event is at the beginning
AFTER = 1e-6  # time / end time, at which the force of a contact has its sign
DIP_NODES = 13  # samples of an interval in which a signal may be negative; the polynomial's error is rounding
REAL = 1e-6  # imaginary part of a turning point / half the interval, below which it is real
SAME = 1e-12  # difference of times / longest time, by rounding, of events at once


class Bounces:
    """End stops and conditions of a scene that a formulation moves up to an end time (s)."""

    def __init__(self, scene: Scene, run: Run, end: float):
        self.ends, self._scene, self._run, self._end = ends_of(scene), scene, run, end
        self._locks = not all(part.is_permanent for part in parts_of(scene))
        self._conditions = any(part.when or part.release for part in parts_of(scene))

    def next(
        self, piece: Scene, contacts: Collection[str], moved: Moved, begin: float, left: float
    ) -> tuple[float, tuple[str, ...]] | None:
        """Return the time (s) of the next event of a piece that begins at a time (s), up to ``left``, and the
        names of the stops and constraints that cause it: a gap closes, a contact would pull, a coordinate
        reaches its value, or a reaction its limit. Return None without one.

        Raises SceneError for a reaction that redundant constraints leave open.
        """
        if not self.ends and not self._conditions:
            return None
        whole, window = held(piece, contacts), left
        seen = Seen(whole, found := self._followed(whole, window))
        signals = [of_stop(piece, end, contacts, moved) for end in self._acting(piece, contacts, seen)]
        if self._conditions and len(seen.times):
            refuse_open(self._scene, seen)
            signals += of_conditions(self._scene, piece, begin, moved, seen)
        while signals and len(seen.times):
            values = np.stack([signal.value(seen) for signal in signals], axis=1)
            if dips := [*self._dips(whole, signals, seen.times, values)]:
                seen = Seen(whole, self._run(whole, np.unique([*seen.times, *dips])))
                values = np.stack([signal.value(seen) for signal in signals], axis=1)
            floors = [signal.floor(values[:, k]) for k, signal in enumerate(signals)]
            below = values < -np.array(floors)
            released = below[0] & [signal.is_force for signal in signals]
            if released.any() or (len(values) > 1 and below[1].any() and window <= SOONEST * left):
                first = released if released.any() else below[1]
                return 0.0, tuple(signals[k].name for k in np.flatnonzero(first))
            rows = 1 + np.flatnonzero(below[1:].any(axis=1))
            if rows.size and rows[0] > 1:
                around = slice(int(rows[0]) - 1, int(rows[0]) + 1)
                met = {
                    signals[k].name: self._between(whole, signals[k], seen.times[around])
                    for k in np.flatnonzero(below[rows[0]])
                }
                time = min(met.values())
                return time, tuple(name for name, each in met.items() if each <= time + SAME * left)
            if not rows.size and (window >= left or found.reason):
                return None
            window = min(16 * window, left) if not rows.size else float(seen.times[1])
            seen = Seen(whole, found := self._followed(whole, window))
        return None

    def _acting(self, piece: Scene, contacts: Collection[str], seen: Seen) -> list[End]:
        """Return the ends in contact, and those that may be met: no end of their joint is in contact, and the
        piece does not lock their coordinate."""
        busy = {name.rpartition(".")[0] for name in contacts}
        free = self._free(piece, [end for end in self.ends if end.joint not in busy], _first(seen))
        return [end for end in self.ends if end.name in contacts or end in free]

    def _free(self, piece: Scene, ends: Sequence[End], state: State | None) -> list[End]:
        """Return the ends of coordinates that a piece does not lock in a state."""
        if not self._locks or state is None:
            return [*ends]
        return [end for end in ends if not is_locked(piece, end.joint, state, end.column)]

    def _followed(self, piece: Scene, window: float) -> Motion:
        """Return the motion up to a time (s), at samples that resolve its steps and the functions of time."""
        functions = functions_of(piece)
        knots = {each.begin for function in functions for each in function.pieces()}
        cuts = [0.0, *sorted(knot for knot in knots if 0.0 < knot < window), window]
        parts = [np.linspace(a, b, BETWEEN) for a, b in itertools.pairwise(cuts)]
        parts.append(np.array(cuts[1:-1]) * (1 - BEFORE))
        frequency = max((abs(each.sine.frequency) for each in functions if each.sine), default=0.0)
        count = max(SAMPLES, math.ceil(PER_PERIOD * frequency * window / (2 * math.pi)))
        found = self._run(piece, np.unique([*np.concatenate(parts), *np.linspace(0.0, window, count)]))
        if PER_STEP * found.steps <= count:
            return found
        even = np.linspace(0.0, window, PER_STEP * found.steps)
        return self._run(piece, np.unique([*np.concatenate(parts), *even]))

    def _dips(
        self, whole: Scene, signals: Sequence[Signal], times: np.ndarray, values: np.ndarray
    ) -> Iterator[float]:
        """Yield times (s) between samples (k,) at which signals (k, s) have minima that may be negative.

        They are turning points of the polynomial through samples of two intervals.
        """
        for signal, value in zip(signals, values.T, strict=True):
            for k in lowest_samples(times, value):
                middle, half = (times[k + 1] + times[k - 1]) / 2, (times[k + 1] - times[k - 1]) / 2
                nodes = middle - half * np.cos(np.pi * np.arange(DIP_NODES) / (DIP_NODES - 1))
                found = Seen(whole, self._run(whole, np.unique([0.0, *nodes])))
                law = np.polynomial.Chebyshev.fit(nodes, signal.value(found)[-DIP_NODES:], DIP_NODES - 1)
                turns = law.deriv().roots()
                turns = turns.real[np.abs(turns.imag) < half * REAL]
                yield from turns[np.abs(turns - middle) < half]

    def _between(self, whole: Scene, signal: Signal, times: np.ndarray) -> float:
        """Return the time (s) between two samples (2,) at which a signal is zero."""

        def value(at: float) -> float:
            return float(signal.value(Seen(whole, self._run(whole, np.linspace(0.0, at, 9))))[-1])

        low, high = map(float, times)
        if value(low) <= 0.0:
            return low
        return float(brentq(value, low, high, xtol=4 * np.finfo(float).eps * high))

    def meet(
        self, piece: Scene, after: Scene, before: State, contacts: Collection[str], moved: Moved
    ) -> tuple[State, tuple[str, ...]]:
        """Return the state after an event, and the ends in contact from then on; ``after`` is the next piece,
        at the poses of the state, and ``moved`` are the coordinates there."""
        gaps = {end: end.sign * (end.limit - moved[end.joint][end.column]) for end in self.ends}
        touching = [end for end in self.ends if gaps[end] <= width(piece, end)]
        touching = self._free(after, touching, before)
        wanted = hits(after, touching, before, contacts)
        found = bounced(after, before, touching, wanted).state
        flying = [end for end, rate in wanted.items() if rate > 0]
        if flying:
            there = _moving(after, found)
            there = held(there, self._lasting(there, _resting(after, touching, found, before)))
            for end, second in zip(flying, self._second(there, flying), strict=True):
                if second < 0 and -2 * wanted[end] / second < CHATTER * self._end:
                    wanted[end] = 0.0
            found = bounced(after, before, touching, wanted).state
        resting = _resting(after, touching, found, before)
        return found, self._lasting(_moving(after, found), resting)

    def _second(self, piece: Scene, ends: Sequence[End]) -> np.ndarray:
        motion = self._run(piece, np.zeros(1))
        now = (doubles(getattr(motion, key)[0]) for key in FIELDS)
        place, turn, velocity, spin, acceleration, spin_rate = now
        return second_rates(piece, ends, State(place, turn, velocity, spin), acceleration, spin_rate)

    def _lasting(self, piece: Scene, resting: Sequence[End]) -> tuple[str, ...]:
        """Return the ends that push soon after an event, among those whose gaps neither open nor close."""
        kept = [*resting]
        while kept:
            names = [end.name for end in kept]
            found = self._run(held(piece, names), np.array([0.0, AFTER * self._end]))
            seen = Seen(held(piece, names), found)
            pushes = np.array([of_stop(piece, end, names, {}).value(seen)[-1] for end in kept])
            if pushes.min() > PULL * np.abs(pushes).max():
                break
            del kept[int(pushes.argmin())]
        return tuple(end.name for end in kept)


def _resting(piece: Scene, touching: Sequence[End], state: State, before: State) -> list[End]:
    """Return the ends whose gaps neither open nor close in a state after an impact."""
    slow = np.abs(rates_of(piece, touching, state)) <= still(piece, before)
    return [end for end, rests in zip(touching, slow, strict=True) if rests]


def _moving(piece: Scene, state: State) -> Scene:
    """Return a piece with the velocities of a state."""
    rates = zip(piece.body, state.velocity.tolist(), state.angular_velocity.tolist(), strict=True)
    return piece.with_(
        body=[b.model_copy(update={"velocity": tuple(v), "angular_velocity": tuple(w)}) for b, v, w in rates]
    )


def _first(seen: Seen) -> State | None:
    """Return the first state of a motion; None without one."""
    if not len(seen.times):
        return None
    return State(*(getattr(seen.run, key)[0] for key in State._fields))
