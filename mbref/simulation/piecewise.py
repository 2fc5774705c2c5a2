"""Motions with joints and couplings that come and go, or with end stops: one run for each piece between
events, and the impacts between them.

Intervals give times of events. Stops and conditions give signals of a piece, whose first zero is an event.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from mbref.equations.lazy import LazyMapping, LazySequence
from mbref.input_error import InputError
from mbref.motions.crossing import Crossing
from mbref.motions.event import STATE_BEFORE, Event
from mbref.motions.motion import Motion
from mbref.motions.pieces import (
    cannot_hold,
    changes,
    constraint_parts,
    event_times,
    first_piece,
    in_contact,
    next_piece,
)
from mbref.motions.trajectory import PER_BODY, Outcome, Trajectory
from mbref.scene import Joint, Scene, SceneError
from mbref.scene.bodies import DRIVER
from mbref.scene.intervals import at_sample, samples_at
from mbref.simulation.conditions import Conditions
from mbref.simulation.end_stops import EndStops, laws, with_impact
from mbref.simulation.outcome import Spent
from mbref.simulation.zeros import SAME_ZERO, first_zero
from mbref.stepping.limits import Limits
from mbref.stepping.run import missing_masses

MOST_EVENTS = 1000  # events of a scene with end stops or conditions, at which a run ends
Reached = Callable[[float], None] | None
PAST_CHANGE = 1e-10  # time after a change by an interval / end time, up to which coordinates are followed
RunOfPiece = Callable[[Scene, np.ndarray, Reached], Motion]  # of a scene, at times (k,), s


@dataclass(frozen=True)
class _Piece:
    """The run of a piece that begins at a time (s): its motion, and the number of samples to be shown."""

    begin: float
    motion: Motion
    shown: int


def simulate_pieces(
    scene: Scene, times: np.ndarray, run: RunOfPiece, progress: Reached, limits: Limits
) -> Motion:
    """Return the motion at times (k,), s, of a scene with constraints that come and go.

    Raises SceneError if a constraint cannot begin to hold, or if a body has no mass, and InputError for
    branches, whose numbers count the singular positions of one piece.
    """
    if limits.branches:
        raise InputError("branches: cannot be chosen in a scene with intervals, conditions or stops")
    if not scene.has_mass():
        raise SceneError(missing_masses(scene))
    times = samples_at(times, event_times(scene, np.inf))
    spent = Spent()
    watch = _Watch(scene, lambda scene, times: spent.in_run(run(scene, times, None)), times)
    begin, ends, stops = 0.0, event_times(scene, float(times[-1])), watch.stops
    piece, pieces, events, turned = first_piece(scene), [], [], dict[str, float]()
    contacts: tuple[str, ...] = ()
    if stops.sides and stops.starts(start := spent.in_run(run(piece, np.zeros(1), None))):
        after, event = _event(scene, piece, (), _end(start, 0.0, turned), turned, stops)
        if event.stops or event.contacts:
            piece, contacts, events = after, event.contacts, [event]
    while True:
        end = next((time for time in ends if time > begin), None)
        end, names = watch.next_event(piece, contacts, turned, begin, end)
        own = times[(times >= begin) & (times < end)] if end is not None else times[times >= begin]
        local = own - begin if end is None else np.append(own - begin, end - begin)
        held, local = in_contact(piece, contacts), local if local.size else np.zeros(1)
        motion = spent.in_run(run(held, local, _later(progress, begin)))
        pieces.append(_Piece(begin, motion, min(own.size, len(motion.times))))
        if end is None or motion.outcome is not Outcome.COMPLETED:
            break
        state = _end(motion, end, turned)
        turned = {name: float(angles[0]) for name, angles in (state.angles or {}).items()}
        piece, event = _event(scene, piece, contacts, state, turned, stops, names)
        contacts, begin = event.contacts, end
        events.append(event)
        if watch.is_needed and len(events) >= MOST_EVENTS:
            pieces[-1] = replace(pieces[-1], motion=_too_many(motion, events))
            break
    return replace(_joined(scene, times, pieces, events), cost=spent.of([each.motion for each in pieces]))


class _Watch:
    """The stops and conditions of a scene, whose signals are followed together."""

    def __init__(self, scene: Scene, run: Callable[[Scene, np.ndarray], Motion], times: np.ndarray):
        self._run, self._times, end = run, times, float(times[-1]) or scene.duration
        self.stops = EndStops(scene, run, end)
        self.conditions = Conditions(scene, run, end, self.stops.length)
        every = constraint_parts(scene)
        self.is_needed = bool(self.stops.sides) or any(each.when or each.release for each in every)

    def next_event(
        self,
        piece: Scene,
        contacts: Sequence[str],
        turned: Mapping[str, float],
        begin: float,
        change: float | None,
    ) -> tuple[float | None, tuple[str, ...]]:
        """Return the time (s) of the event after a piece that begins at a time (s), up to the next ``change``
        (s) by an interval, and the names of the stops and constraints that cause it; no time without one.

        A coordinate that reaches its value at a change is found from the motion beyond it. Reactions at a
        change belong to the next piece.
        """
        end = float(self._times[-1])
        left = end - begin if change is None else change - begin + PAST_CHANGE * end
        met, names = self._first_event(piece, contacts, turned, begin, left)
        if met is None or (change is not None and begin + met > change + SAME_ZERO * end):
            return change, ()
        if change is None or begin + met < change - SAME_ZERO * end:
            return at_sample(self._times, begin + met), names
        held = {each.name for each in constraint_parts(piece)}
        return change, tuple(name for name in names if name not in held)

    def _first_event(
        self, piece: Scene, contacts: Sequence[str], turned: Mapping[str, float], begin: float, left: float
    ) -> tuple[float | None, tuple[str, ...]]:
        """Return the time (s) in a piece that begins at a time (s) at which a stop is met, a contact would
        pull or a condition is met, and the names of these stops and constraints; no time without one."""
        held = in_contact(piece, contacts)
        if released := self.conditions.exceeded(piece, held, left):
            return 0.0, released
        named = [*self.stops.signals(piece, contacts, turned)]
        named += self.conditions.signals(piece, held, turned, begin, left)
        signals = [signal for _, signal in named]
        found = named and first_zero(lambda times: self._run(held, times), signals, left, *laws(piece))
        if not found:
            return None, ()
        return found.time, tuple(named[k][0] for k in found.signals)


def _too_many(motion: Motion, events: Sequence[Event]) -> Motion:
    """Return the last piece of a run that ends because of too many events."""
    last = events[-1]
    names = ", ".join(dict.fromkeys((*last.engaged, *last.released, *last.stops))) or "end stops"
    why = f"{MOST_EVENTS} events at end stops or of conditions were met up to t = {last.time:.6g} s"
    return replace(motion, outcome=Outcome.STEP_FAILED, message=f"{why}, the last one of {names}")


def _later(progress: Reached, begin: float) -> Reached:
    """Return the progress call of a piece that begins at a time (s)."""
    return None if progress is None else lambda reached: progress(begin + reached)


def _end(motion: Motion, t: float, turned: dict[str, float]) -> Trajectory:
    """Return the last state of a piece at a time t (s), with the angles (rad) that joints turned before."""
    last = {key: getattr(motion, key)[-1:] for key in STATE_BEFORE}
    angles = {name: each[-1:] + turned.get(name, 0.0) for name, each in (motion.angles or {}).items()}
    kept = {each.name: getattr(motion, each.name) for each in fields(Trajectory)}
    others = dict.fromkeys(("acceleration", "angular_acceleration", "reactions", "open_reactions", "events"))
    return Trajectory(**{**kept, **others, **last, "times": np.array([t]), "angles": angles})


def _event(
    scene: Scene,
    piece: Scene,
    contacts: tuple[str, ...],
    state: Trajectory,
    turned: Mapping[str, float],
    stops: EndStops,
    met_by: Collection[str] = (),
) -> tuple[Scene, Event]:
    """Return the scene after an event, with its velocities and without contacts, and the event.

    ``piece`` is the scene before it, with these contacts; ``met_by`` are the stops and constraints that cause
    the event.
    """
    t = float(state.times[0])
    engaged, released = changes(scene, piece, t)
    held = {each.name for each in constraint_parts(piece)}
    met_there = [each for each in constraint_parts(scene) if each.name in met_by]
    engaged += tuple(each.name for each in met_there if each.name not in held and each.is_active(t))
    released += tuple(each.name for each in met_there if each.name in {*held} - {*released})
    before, after = next_piece(scene, piece, state, engaged, released)
    try:
        met = stops.meet(in_contact(before, contacts), after, state, contacts, met_by)
    except SceneError as fault:
        if engaged:
            raise cannot_hold(", ".join(engaged), t, fault.faults[0]) from None
        names = ", ".join(side.name for side in stops.touching(state, met_by))
        raise SceneError([f"end stops {names}: cannot be met at t = {t:.6g} s: {fault.faults[0]}"]) from None
    found = met.found
    event = Event(
        time=t,
        engaged=engaged,
        released=(*released, *(name for name in contacts if name not in met.contacts)),
        stops=met.hits,
        contacts=met.contacts,
        chatter=met.chatter,
        **{key: getattr(state, key)[0] for key in STATE_BEFORE},
        velocity_after=found.velocity,
        angular_velocity_after=found.angular_velocity,
        angles={joint.name: turned.get(joint.name, 0.0) for joint in scene.joint if _is_counted(joint)},
        impulses={name: wrench * bool(engaged or met.hits) for name, wrench in found.impulses.items()},
        open=found.open,
        energy_before=found.energy[0],
        energy_after=found.energy[1],
    )
    return with_impact(after, found), event


def _joined(scene: Scene, times: np.ndarray, pieces: Sequence[_Piece], events: Sequence[Event]) -> Motion:
    """Return the pieces as one motion at times (k,), s, up to the end of the last piece."""
    motions, first, last = [piece.motion for piece in pieces], pieces[0].motion, pieces[-1]
    shown = sum(piece.shown for piece in pieces)
    arrays: dict[str, Any] = {
        key: None
        if any(getattr(motion, key) is None for motion in motions)
        else np.concatenate([getattr(piece.motion, key)[: piece.shown] for piece in pieces])
        for key in PER_BODY
    }
    is_complete = last.motion.outcome is Outcome.COMPLETED
    return replace(
        first,
        mechanism=scene,
        times=times[:shown],
        **arrays,
        reactions=_wrenches(scene, pieces),
        open_reactions=_marks(scene, pieces),
        angles=_angles(scene, pieces),
        crossings=_crossings(pieces),
        events=tuple(events),
        outcome=last.motion.outcome,
        t_end=float(times[-1]) if is_complete else last.begin + last.motion.t_end,
        message=_message(pieces),
    )


def _message(pieces: Sequence[_Piece]) -> str:
    """Return the messages of the pieces, each with its begin, and other methods than the first piece's."""
    sentences = []
    for piece in pieces:
        other = piece.motion.method != pieces[0].motion.method
        said = "; ".join(filter(None, (f"by {piece.motion.method}" * other, piece.motion.message)))
        if said and piece.begin:
            said = f"from t = {piece.begin:.6g} s, from which times count here: {said}"
        sentences.append(said)
    return "; ".join(filter(None, sentences))


def _wrenches(scene: Scene, pieces: Sequence[_Piece]) -> Any:
    names = tuple(joint.name for joint in scene.joint)
    return LazyMapping(names, _over_pieces, names, pieces, "reactions", (6,))


def _marks(scene: Scene, pieces: Sequence[_Piece]) -> Any:
    if any(piece.motion.open_reactions is None for piece in pieces):
        return None
    names = [joint.name for joint in scene.joint]
    names += [DRIVER.format(driver.joint) for driver in scene.driver]
    return LazyMapping(tuple(names), _over_pieces, tuple(names), pieces, "open_reactions", ())


def _over_pieces(
    names: Sequence[str], pieces: Sequence[_Piece], field: str, shape: tuple[int, ...]
) -> dict[str, np.ndarray]:
    """Return numbers (k, ...) by name over all pieces, zero in a piece that does not have the name."""
    found: dict[str, np.ndarray] = {}
    for name in names:
        parts = []
        for piece in pieces:
            own = getattr(piece.motion, field) or {}
            has = name in own
            parts.append(own[name][: piece.shown] if has else np.zeros((piece.shown, *shape), dtype=int))
        found[name] = np.concatenate(parts)
    return found


def _is_counted(joint: Joint) -> bool:
    """Return whether the turns of a joint are counted: it always holds and turns about one axis."""
    return joint.is_permanent and joint.facts.turns


def _angles(scene: Scene, pieces: Sequence[_Piece]) -> dict[str, np.ndarray]:
    """Return the angles (k,), rad, since t = 0 of the joints that always hold and turn about one axis."""
    found = {}
    for joint in scene.joint:
        if _is_counted(joint):
            total, parts = 0.0, []
            for piece in pieces:
                angles = np.asarray((piece.motion.angles or {})[joint.name])
                parts.append(total + angles[: piece.shown])
                total += float(angles[-1]) if angles.size else 0.0
            found[joint.name] = np.concatenate(parts)
    return found


def _crossings(pieces: Sequence[_Piece]) -> Any:
    """Return the singular positions of all pieces; None if a method does not look for them."""
    if any(piece.motion.crossings is None for piece in pieces):
        return None
    count = sum(len(piece.motion.crossings or ()) for piece in pieces)
    return LazySequence(range(count), _later_crossings, pieces) if count else ()


def _later_crossings(pieces: Sequence[_Piece]) -> tuple[Crossing, ...]:
    """Return the singular positions of all pieces, with times from the start of the motion."""
    return tuple(
        replace(crossing, time=piece.begin + crossing.time)
        for piece in pieces
        for crossing in piece.motion.crossings or ()
    )
