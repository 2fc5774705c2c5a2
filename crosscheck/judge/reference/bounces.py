"""Times at which the reference meets or leaves end stops, and the impacts there, by one formulation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.constraints import joint_coordinates
from crosscheck.judge.driver_forces import driver_forces
from crosscheck.judge.pieces import State
from crosscheck.judge.reference.motion import Motion
from crosscheck.judge.stops import (
    CHATTER,
    End,
    bounced,
    ends_of,
    held,
    hits,
    rates_of,
    second_rates,
    still,
    width,
)
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

Run = Callable[[Scene, np.ndarray], Motion]  # of a piece, at increasing times (k,), s
Moved = Mapping[str, np.ndarray]  # angle (rad) and displacement (m) (2,) since t = 0, by joint
FIELDS = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
SAMPLES = 129  # least number of a piece, between which a gap closes at most once
PER_STEP, PER_PERIOD = 8, 32  # samples for each step of the reference, and period of a function of time
BETWEEN = 9  # samples from one change of a function's law to the next
BEFORE = 1e-12  # time before such a change / its time, at which forces have their values before it
STEPS = 12  # of a search for a time, each of which doubles its digits or halves its interval
SOONEST = 1e-10  # of the longest time, below which an event is at the beginning
AFTER = 1e-6  # time / end time, at which the force of a contact has its sign
PULL = 1e-9  # force / largest force, which rounding may leave


class Bounces:
    """End stops of a scene that a formulation moves up to an end time (s)."""

    def __init__(self, scene: Scene, run: Run, end: float):
        self.ends, self._run, self._end = ends_of(scene), run, end

    def next(self, piece: Scene, contacts: Collection[str], moved: Moved, left: float) -> float | None:
        """Return the time (s) in a piece at which a gap closes or a contact would pull; None otherwise."""
        signals = [end for end in self.ends if self._acts(end, contacts)]
        whole, window = held(piece, contacts), left
        while signals:
            found = self._followed(whole, window)
            values = self._signals(whole, signals, contacts, moved, found)
            floors = self._floors(piece, signals, contacts, values)
            below = values < -floors
            if below[1].any() if len(values) > 1 else False:
                if window <= SOONEST * left:
                    return 0.0
                window = float(found.times[1])
                continue
            rows = np.flatnonzero(below.any(axis=1))
            if rows.size:
                around = slice(int(rows[0]) - 1, int(rows[0]) + 1)
                return min(
                    self._between(whole, signals[e], contacts, moved, found.times[around], values[around, e])
                    for e in np.flatnonzero(below[rows[0]])
                )
            if window >= left or found.reason:
                return None
            window = min(16 * window, left)
        return None

    def _followed(self, piece: Scene, window: float) -> Motion:
        """Return the motion up to a time (s), at samples that resolve its steps and the functions of time."""
        functions = [*piece.driver, *(load.over_time for load in piece.load if load.over_time)]
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

    def _acts(self, end: End, contacts: Collection[str]) -> bool:
        """Return whether an end is in contact, or may be met because no end of its joint is in contact."""
        return end.name in contacts or end.joint not in {name.rpartition(".")[0] for name in contacts}

    def _floors(
        self, piece: Scene, signals: Sequence[End], contacts: Collection[str], values: np.ndarray
    ) -> np.ndarray:
        """Return the sizes (e,) that rounding may give to gaps and to forces that are zero."""
        sizes = np.abs(values).max(axis=0, initial=0.0)
        return np.array(
            [
                PULL * size if end.name in contacts else 1e-2 * width(piece, end)
                for end, size in zip(signals, sizes, strict=True)
            ]
        )

    def _signals(
        self, whole: Scene, signals: Sequence[End], contacts: Collection[str], moved: Moved, found: Motion
    ) -> np.ndarray:
        """Return gaps, and forces of contacts (k, e), along a motion."""
        place, turn, spin = map(doubles, (found.position, found.orientation, found.angular_velocity))
        coordinates = joint_coordinates(whole, doubles(found.times), place, turn, spin)
        forces = driver_forces(whole, _as_trajectory(whole, found)) if contacts else {}
        columns = []
        for end in signals:
            if end.name in contacts:
                columns.append(-end.sign * forces[end.joint])
            else:
                q = coordinates[end.joint][:, end.column] + moved[end.joint][end.column]
                columns.append(end.sign * (end.limit - q))
        return np.stack(columns, axis=1)

    def _between(
        self,
        whole: Scene,
        end: End,
        contacts: Collection[str],
        moved: Moved,
        times: np.ndarray,
        values: np.ndarray,
    ) -> float:
        """Return the time (s) in an interval at which a signal is zero, by inverse interpolation."""
        (low, high), (first, last) = map(float, times), map(float, values)
        points = [(low, first), (high, last)]
        for _ in range(STEPS):
            at = float(_inverse(points))
            at = at if low < at < high else (low + high) / 2
            found = self._run(whole, np.linspace(0.0, at, 9))
            value = float(self._signals(whole, [end], contacts, moved, found)[-1, 0])
            points = [*points[-3:], (at, value)]
            low, high = (at, high) if value > 0 else (low, at)
            if abs(points[-1][0] - points[-2][0]) <= 4 * np.finfo(float).eps * high or value == 0.0:
                return at
        return at

    def meet(
        self, piece: Scene, after: Scene, before: State, contacts: Collection[str], moved: Moved
    ) -> tuple[State, tuple[str, ...]]:
        """Return the state after an event, and the ends in contact from then on; ``after`` is the next piece,
        at the poses of the state, and ``moved`` are the coordinates there."""
        gaps = {end: end.sign * (end.limit - moved[end.joint][end.column]) for end in self.ends}
        touching = [end for end in self.ends if gaps[end] <= width(piece, end)]
        wanted = hits(after, touching, before, contacts)
        found = bounced(after, before, touching, wanted).state
        for end in [end for end, rate in wanted.items() if rate > 0]:
            second = self._second(after, found, [end])[0]
            if second < 0 and -2 * wanted[end] / second < CHATTER * self._end:
                wanted[end] = 0.0
        found = bounced(after, before, touching, wanted).state
        slow = np.abs(rates_of(after, touching, found)) <= still(after, before)
        resting = [end for end, rests in zip(touching, slow, strict=True) if rests]
        return found, self._lasting(_moving(after, found), resting)

    def _second(self, piece: Scene, state: State, ends: Sequence[End]) -> np.ndarray:
        motion = self._run(_moving(piece, state), np.zeros(1))
        now = (doubles(getattr(motion, key)[0]) for key in FIELDS)
        place, turn, velocity, spin, acceleration, spin_rate = now
        return second_rates(piece, ends, State(place, turn, velocity, spin), acceleration, spin_rate)

    def _lasting(self, piece: Scene, resting: Sequence[End]) -> tuple[str, ...]:
        """Return the ends that push soon after an event, among those whose gaps neither open nor close."""
        kept = [*resting]
        while kept:
            names = [end.name for end in kept]
            found = self._run(held(piece, names), np.array([0.0, AFTER * self._end]))
            pushes = self._signals(held(piece, names), kept, names, {}, found)[-1]
            if pushes.min() > PULL * np.abs(pushes).max():
                break
            del kept[int(pushes.argmin())]
        return tuple(end.name for end in kept)


def _inverse(points: Sequence[tuple[float, float]]) -> float:
    """Return the time at value zero by the polynomial t(value) through points (t, value)."""
    total = 0.0
    for i, (time, value) in enumerate(points):
        weight = 1.0
        for j, (_, other) in enumerate(points):
            if i != j:
                if other == value:
                    return np.nan
                weight *= -other / (value - other)
        total += weight * time
    return total


def _moving(piece: Scene, state: State) -> Scene:
    """Return a piece with the velocities of a state."""
    rates = zip(piece.body, state.velocity.tolist(), state.angular_velocity.tolist(), strict=True)
    return piece.with_(
        body=[b.model_copy(update={"velocity": tuple(v), "angular_velocity": tuple(w)}) for b, v, w in rates]
    )


def _as_trajectory(piece: Scene, found: Motion) -> Trajectory:
    """Return a motion as a trajectory in double precision."""
    arrays: dict[str, Any] = {key: doubles(getattr(found, key)) for key in FIELDS}
    names = tuple(body.name for body in piece.body)
    return Trajectory(piece.name, "judge", "", "", {}, doubles(found.times), names, **arrays)
