"""The reference motion of a scene whose joints and couplings come and go: one motion for each piece, by one
formulation, and the judge's impacts between them.

Each formulation runs through all pieces on its own, so that its errors at an event pass to its next piece.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import Arithmetic, doubles
from crosscheck.judge.constraints import joint_coordinates
from crosscheck.judge.pieces import State, at_start, changed, events, followed, has_pieces, later, names_of
from crosscheck.judge.reference.bounces import Bounces
from crosscheck.judge.reference.motion import Motion, Times
from crosscheck.judge.stops import held
from mbref.scene import Scene, SceneError

Formulation = Callable[..., Motion]
ROUNDING = 1e-14  # distance of an event from a sample / end time, by rounding
PAST_CHANGE = 1e-10  # time after a change by an interval / end time, up to which coordinates are followed
AT_ONCE = 1e-12  # difference of times / end time, by rounding, of a change and a condition that is met there
Met = tuple[float, tuple[str, ...]] | None
BETWEEN = 64  # samples of a piece between which turns of joints with loads are counted
FIELDS = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")


def motion_by(
    formulation: Formulation, scene: Scene, times: Times, arithmetic: Arithmetic, **options: Any
) -> Motion:
    """Return the motion of a scene at increasing times (k,) by a formulation, with the formulation's
    options, also through the events of constraints with intervals."""
    if not has_pieces(scene):
        return formulation(scene, times, arithmetic, **options)
    end, wanted, left = options.pop("seconds", np.inf), np.asarray(times, dtype=float), 0.0

    def run(piece: Scene, times: np.ndarray) -> Motion:
        nonlocal left
        began = time.thread_time()
        found = formulation(piece, times, arithmetic, seconds=end - left, **options)
        left += time.thread_time() - began
        return found

    bounces = Bounces(scene, run, float(wanted[-1]) or scene.duration)
    piece, begin, moved, parts = at_start(scene), 0.0, _unmoved(scene), list[Motion]()
    contacts: tuple[str, ...] = ()
    if bounces.ends:
        piece, contacts = _after(scene, piece, 0.0, run(piece, np.zeros(1)), moved, (), bounces)
    happened = [0.0] if contacts else []
    while True:
        stop = next((t for t in events(scene, float(wanted[-1])) if t > begin), None)
        left = float(wanted[-1]) - begin if stop is None else stop - begin + PAST_CHANGE * wanted[-1]
        try:
            met = bounces.next(piece, contacts, moved, begin, left)
        except SceneError as error:
            found = _later(run(held(piece, contacts), np.zeros(1)), begin, wanted[wanted == begin])
            parts.append(replace(found, reason=error.faults[0]))
            break
        stop, names = _first(piece, wanted, stop, begin, met)
        chosen = wanted[(wanted >= begin) & (wanted < (np.inf if stop is None else stop))]
        own = np.unique([*(chosen - begin), *([] if stop is None else np.linspace(0, stop - begin, BETWEEN))])
        found = run(held(piece, contacts), own)
        parts.append(_later(found, begin, chosen))
        if stop is None or found.reason:
            break
        moved = _moved(piece, found, moved)
        try:
            piece, contacts = _after(scene, piece, stop, found, moved, contacts, bounces, names)
        except SceneError as error:
            parts[-1] = replace(parts[-1], reason=error.faults[0])
            break
        begin = stop
        happened.append(stop)
    return replace(_joined(parts), events=tuple(happened))


def _first(
    piece: Scene, wanted: np.ndarray, change: float | None, begin: float, met: Met
) -> tuple[float | None, tuple[str, ...]]:
    """Return the time (s) of the first event after a piece that begins at a time (s), and the names of the
    conditions met: a ``change`` by an interval, or an event of ``Bounces``; both at a time that differs by
    rounding. Reactions at a change belong to the next piece."""
    at, same = np.inf if met is None else begin + met[0], AT_ONCE * wanted[-1]
    if met is None or (change is not None and at > change + same):
        return change, ()
    if change is not None and at >= change - same:
        return change, tuple(name for name in met[1] if name not in names_of(piece))
    near = wanted[np.abs(wanted - at) <= ROUNDING * wanted[-1]]
    return float(near[0]) if near.size else at, met[1]


def _after(
    scene: Scene,
    piece: Scene,
    t: float,
    found: Motion,
    moved: dict[str, np.ndarray],
    contacts: tuple[str, ...],
    bounces: Bounces,
    met: Collection[str] = (),
) -> tuple[Scene, tuple[str, ...]]:
    """Return the piece that begins at t (s) with the velocities after the impact at the end of a motion, and
    the end stops in contact; ``met`` are the parts whose conditions are met."""
    before = State(*(doubles(getattr(found, key)[-1]) for key in State._fields))
    names = changed(scene, piece, t, met)
    after = later(scene, piece, t, before, moved, names)
    state, contacts = bounces.meet(piece, after, before, contacts, moved)
    return later(scene, piece, t, state, moved, names), contacts


def _unmoved(scene: Scene) -> dict[str, np.ndarray]:
    """Return zero angle and displacement (2,) of the followed joints."""
    return {name: np.zeros(2) for name in followed(scene)}


def _moved(piece: Scene, found: Motion, before: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return angle (rad) and displacement (m) (2,) at the end of a piece, since t = 0, of followed joints."""
    if not before:
        return before
    place, turn, spin = map(doubles, (found.position, found.orientation, found.angular_velocity))
    coordinates = joint_coordinates(piece, found.times, place, turn, spin)
    return {name: total + coordinates[name][-1] for name, total in before.items()}


def _later(found: Motion, begin: float, times: np.ndarray) -> Motion:
    """Return the samples of a piece that begins at a time (s), at the reached times (k,) since t = 0."""
    shown = np.isin(found.times, times - begin)
    return replace(
        found,
        times=times[: int(shown.sum())],
        **{key: getattr(found, key)[shown] for key in FIELDS},
        reached=begin + found.reached,
        crossings=tuple(begin + t for t in found.crossings),
    )


def _joined(parts: list[Motion]) -> Motion:
    """Return consecutive parts as one motion."""
    arrays: dict[str, Any] = {
        key: np.concatenate([getattr(part, key) for part in parts]) for key in ("times", *FIELDS)
    }
    return replace(
        parts[-1],
        **arrays,
        steps=sum(part.steps for part in parts),
        crossings=tuple(t for part in parts for t in part.crossings),
        seconds=sum(part.seconds for part in parts),
        contradiction=max(part.contradiction for part in parts),
    )
