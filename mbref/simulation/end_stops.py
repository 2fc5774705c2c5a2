"""End stops of joint coordinates: the impacts where gaps close, and the contacts that last.

The gap g of a coordinate to an end of its range is not negative. Where it closes, velocities jump such that
its rate becomes g'+ = -e g'-, by impulses of all constraints. A coordinate that does not leave the end is
held there by a row while the force of this row pushes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations, islice
from typing import NamedTuple

import numpy as np

from mbref.equations.impacts import Impact, impact, is_locked
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.motions.driving_forces import coordinate_acceleration
from mbref.motions.joint_motion import along, joint_motion
from mbref.motions.motion import Motion
from mbref.motions.pieces import constraint_parts, first_piece, in_contact
from mbref.motions.trajectory import Trajectory
from mbref.scene import Driver, Scene, SceneError
from mbref.scene.joints import DISPLACEMENT, Coordinate
from mbref.scene.scene import functions_of
from mbref.simulation.zeros import PULL, Signal

GAP_CLOSED = 1e-12  # gap (lengths of the mechanism, or rad) of a coordinate at its end
GAP_ROUNDED = 1e-14  # gap (lengths, or rad) that rounding may leave in a motion
AT_REST_RATE = 1e-12  # rate of a gap / largest rate before the impact that rounding may leave
LOOK = 1e-6  # time after an event / end time, at which the force of a contact has its sign
MOST_CHOICES = 1000  # of stops that act together; each takes milliseconds
CHATTER = 1e-6  # flight between two impacts / end time, below which the coordinate stays at its end


class Side(NamedTuple):
    """An end of the range of a coordinate q: the gap is sign · (limit - q)."""

    name: str
    joint: str
    coordinate: Coordinate
    limit: float
    sign: float
    restitution: float

    def gap(self, scene: Scene, motion: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return the gap and its rate (k,), with coordinates since the poses of the scene."""
        value, rate = along(joint_motion(scene, motion, self.joint), self.coordinate)
        return self.sign * (self.limit - value), -self.sign * rate

    def push(self, motion: Motion) -> np.ndarray:
        """Return the force (N) or torque (N m) (k,) that keeps the coordinate in its range, in contact."""
        found = motion.driver(self.joint)
        force = found.force if self.coordinate == DISPLACEMENT else found.torque
        return -self.sign * np.asarray(force)


class StopsMet(NamedTuple):
    """Velocities after an event at stops: the impact, the sides that were met, and the contacts after it;
    ``chatter`` are sides whose bounces end there."""

    found: Impact
    hits: tuple[str, ...]
    contacts: tuple[str, ...]
    chatter: tuple[str, ...]


class EndStops:
    """The end stops of a scene, with the function that runs a piece at times (k,), s."""

    def __init__(self, scene: Scene, run: Callable[[Scene, np.ndarray], Motion], end: float):
        self.scene, self._run, self._end = scene, run, end
        self.sides = [*_sides(scene)]
        model = Model(assembled(first_piece(scene)))
        self.length = float(model.length)
        model.release()

    def _least(self, side: Side) -> float:
        return GAP_CLOSED * (self.length if side.coordinate == DISPLACEMENT else 1.0)

    def signals(
        self, piece: Scene, contacts: Sequence[str], turned: Mapping[str, float]
    ) -> Iterator[tuple[str, Signal]]:
        """Yield a signal for each stop of a piece that can be met, and for each contact, with its name."""
        free = self._free(piece, self.sides)
        for side in self.sides:
            if side.name in contacts:
                yield side.name, Signal(side.push)
            elif side in free and side.joint not in {name.rpartition(".")[0] for name in contacts}:
                value, rate = (self._part(side, turned, k) for k in (0, 1))
                yield side.name, Signal(value, rate, GAP_ROUNDED / GAP_CLOSED * self._least(side))

    def _free(self, piece: Scene, sides: Sequence[Side]) -> list[Side]:
        """Return the sides of coordinates that a piece does not lock; constraints that always hold lock
        none."""
        if all(each.is_permanent for each in constraint_parts(self.scene)):
            return [*sides]
        locked = {name for name in {side.joint for side in sides} if is_locked(piece, name)}
        return [side for side in sides if side.joint not in locked]

    def _part(self, side: Side, turned: Mapping[str, float], part: int) -> Callable[[Motion], np.ndarray]:
        return lambda motion: side.gap(self.scene, counted(motion, turned))[part]

    def touching(self, state: Trajectory, met: Collection[str]) -> list[Side]:
        """Return the sides at which the gaps of a state are closed, up to errors of the method for sides that
        are ``met`` there."""
        gaps = {side: side.gap(self.scene, state)[0][0] for side in self.sides}
        return [side for side in self.sides if side.name in met or gaps[side] <= 10 * self._least(side)]

    def starts(self, state: Trajectory) -> bool:
        """Return whether a coordinate starts at an end; raises SceneError if it starts beyond one."""
        if not len(state.times):
            return False  # a method that fails at once has no state
        gaps = {side: float(side.gap(self.scene, state)[0][0]) for side in self.sides}
        for side, gap in gaps.items():
            if gap < -self._least(side):
                raise SceneError([f"joint[{side.joint}].stop: the start is beyond its end by {-gap:.3g}"])
        return any(gap <= self._least(side) for side, gap in gaps.items())

    def meet(
        self,
        before: Scene,
        after: Scene,
        state: Trajectory,
        contacts: Sequence[str],
        met: Collection[str] = (),
    ) -> StopsMet:
        """Return the event of a state at t: velocities after it, and the contacts that last.

        ``before`` and ``after`` are the scenes of both pieces, at the poses of the state; ``met`` are stops
        that cause the event.
        """
        touching = self._free(after, self.touching(state, met))
        rates = {side: float(side.gap(self.scene, state)[1][0]) for side in touching}
        speeds = (float(np.abs(x).max()) for x in (state.velocity, state.angular_velocity))
        still = AT_REST_RATE * max(1e-300, *speeds)
        hits = [side for side in touching if rates[side] < -still and side.name not in contacts]
        wanted = {side: -side.restitution * rates[side] for side in hits}
        found, chatter = self._impact(before, after, state, touching, wanted, still), list[Side]()
        bouncing = [side for side in hits if wanted[side] > still]
        if bouncing:
            flying = self._in_lasting(after, found, self._resting(touching, state, found, still))
            rates = {side: self._rate(side, state, found) for side in bouncing}
            chatter = [s for s in bouncing if self._flight(flying, s, rates[s]) < CHATTER * self._end]
        if chatter:
            wanted |= dict.fromkeys(chatter, 0.0)
            found = self._impact(before, after, state, touching, wanted, still)
        resting = self._resting(touching, state, found, still)
        lasting = self._lasting(with_impact(after, found), resting)
        names = [tuple(side.name for side in sides) for sides in (hits, lasting, chatter)]
        return StopsMet(found, *names)

    def _impact(
        self,
        before: Scene,
        after: Scene,
        state: Trajectory,
        touching: Sequence[Side],
        wanted: Mapping[Side, float],
        still: float,
    ) -> Impact:
        """Return the impact of least change after which gaps have at least given rates, other gaps zero.

        Stops whose impulses would pull take none; their coordinates leave faster. The first stop against this
        changes, which ends for independent stops (Murty, Opsearch 11, 1974). Of others, as of geared joints,
        the fewest that suffice act. Raises SceneError if none suffice.
        """
        least = dict.fromkeys(touching, 0.0) | dict(wanted)

        def attempt(acting: Collection[Side]) -> tuple[Impact, Side | None]:
            held = [side for side in least if side in acting]
            driven = [Driver(joint=s.joint, polynomial=(0.0, -s.sign * least[s])) for s in held]
            found = impact(before, after.with_(driver=[*after.driver, *driven]))
            pulling = self._pulling(held, found)
            wrong = (
                s
                for s in least
                if (s in pulling if s in acting else self._rate(s, state, found) < least[s] - still)
            )
            return found, next(wrong, None)

        acting, tried, fault = frozenset(wanted), set[frozenset[Side]](), None
        try:
            while acting not in tried:
                found, wrong = attempt(acting)
                if wrong is None:
                    return found
                tried.add(acting)
                acting ^= {wrong}
        except SceneError as contradiction:
            if not acting:
                raise
            fault = contradiction
        choices = (some for size in range(len(least)) for some in combinations(least, size))
        for some in islice(choices, MOST_CHOICES):
            with suppress(SceneError):
                other, wrong = attempt(some)
                if wrong is None:
                    return other
        if fault:
            raise fault
        return found

    def _pulling(self, held: Sequence[Side], found: Impact) -> list[Side]:
        """Return the sides, whose drivers are the last ones of an impact, with impulses that pull."""
        lengths = np.array([self.length if side.coordinate == DISPLACEMENT else 1.0 for side in held])
        signs = np.array([side.sign for side in held])
        pushes = -signs * lengths * found.of_drivers[len(found.of_drivers) - len(held) :]
        least = PULL * np.abs(pushes).max(initial=0.0)
        return [side for side, push in zip(held, pushes, strict=True) if push < -least]

    def _rate(self, side: Side, state: Trajectory, found: Impact) -> float:
        moved = replace(state, velocity=found.velocity[None], angular_velocity=found.angular_velocity[None])
        return float(side.gap(self.scene, moved)[1][0])

    def _resting(
        self, touching: Sequence[Side], state: Trajectory, found: Impact, still: float
    ) -> list[Side]:
        """Return the sides whose gaps neither open nor close after an impact."""
        return [side for side in touching if abs(self._rate(side, state, found)) <= still]

    def _in_lasting(self, after: Scene, found: Impact, resting: Sequence[Side]) -> Scene:
        """Return the scene after an impact with the contacts that last, whose forces act on other flights."""
        piece = with_impact(after, found)
        return in_contact(piece, [side.name for side in self._lasting(piece, resting)])

    def _flight(self, piece: Scene, side: Side, rate: float) -> float:
        """Return the time (s) until a gap closes again, at the acceleration at the start of a piece."""
        motion = self._run(piece, np.zeros(1))
        if not len(motion.times) or motion.acceleration is None:
            return np.inf
        joint = piece.joint_named(side.joint)
        second = -side.sign * float(coordinate_acceleration(piece, motion, joint, side.coordinate)[0])
        return -2 * rate / second if second < 0 else np.inf

    def _lasting(self, piece: Scene, resting: Sequence[Side]) -> list[Side]:
        """Return the sides at which contacts push, among those whose gaps neither open nor close."""
        held = [*resting]
        while held:
            held_piece = in_contact(piece, [side.name for side in held])
            motion = self._run(held_piece, np.array([LOOK * self._end]))
            pushes = [float(side.push(motion)[0]) for side in held] if len(motion.times) else [0.0]
            if min(pushes) > PULL * max(map(abs, pushes)):
                break
            del held[int(np.argmin(pushes))]
        return held


def _sides(scene: Scene) -> list[Side]:
    """Return the ends of all ranges, named such as ``"A.upper"``."""
    found = []
    for joint in scene.joint:
        for end, sign in (("lower", -1.0), ("upper", 1.0)):
            stop, coordinate = joint.end_stop, joint.facts.driven
            if stop and coordinate and (limit := getattr(stop, end)) is not None:
                found.append(
                    Side(f"{joint.name}.{end}", joint.name, coordinate, limit, sign, stop.restitution)
                )
    return found


def laws(scene: Scene) -> tuple[list[float], float]:
    """Return the times (s) after 0 at which a driver, or a load over time, changes its law, and the largest
    frequency (rad/s) of their sines."""
    functions = functions_of(scene)
    knots = {piece.begin for each in functions for piece in each.pieces()}
    sines = [each.sine.frequency for each in functions if each.sine]
    return sorted(knots - {0.0}), max(map(abs, sines), default=0.0)


def counted(motion: Trajectory, turned: Mapping[str, float]) -> Trajectory:
    """Return the motion of a piece with angles since t = 0, from the angles (rad) at its begin."""
    angles = {name: each + turned.get(name, 0.0) for name, each in (motion.angles or {}).items()}
    return replace(motion, angles=angles)


def with_impact(scene: Scene, found: Impact) -> Scene:
    """Return a scene with the velocities after an impact."""
    rates = zip(scene.body, found.velocity.tolist(), found.angular_velocity.tolist(), strict=True)
    return scene.with_(
        body=[
            body.model_copy(update={"velocity": tuple(v), "angular_velocity": tuple(w)})
            for body, v, w in rates
        ]
    )
