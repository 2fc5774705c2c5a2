"""Numbers of a reference's piece that are positive until an event: gaps to end stops, forces of contacts,
distances of coordinates from the values of conditions, and reactions below the limits of releases."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.constraints import joint_coordinates, scene_length
from crosscheck.judge.driver_forces import driver_forces
from crosscheck.judge.joint_reactions import shared_wrenches
from crosscheck.judge.pieces import names_of, parts_of
from crosscheck.judge.reaction_balance import with_exact_reactions
from crosscheck.judge.reference.motion import Motion
from crosscheck.judge.stops import TOUCHING, End, width
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, Release, Scene, SceneError, When
from mbref.scene.joints import ANGLE

PULL = 1e-9  # force / largest force, which rounding may leave
FLOOR = 1e-2  # gap that rounding may leave / gap of a coordinate at its end
JUMP = 1e-10  # interval of samples / longest time, below which it is at a change of a function's law
OPEN = 1e-6  # share of a reaction along wrenches that redundant constraints leave open
FIELDS = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
Moved = Mapping[str, np.ndarray]  # angle (rad) and displacement (m) (2,) since t = 0, by joint


class Seen:
    """A motion of a piece, with its coordinates and forces in double precision, computed when asked for."""

    def __init__(self, piece: Scene, motion: Motion):
        self.piece, self.times = piece, doubles(motion.times)
        arrays: dict[str, Any] = {key: doubles(getattr(motion, key)) for key in FIELDS}
        names = tuple(body.name for body in piece.body)
        self.run = Trajectory(piece.name, "judge", "", "", {}, self.times, names, **arrays)

    @cached_property
    def coordinates(self) -> dict[str, np.ndarray]:
        """Angle (rad) and displacement (m) (k, 2) since the begin of the piece, by joint."""
        run = self.run
        return joint_coordinates(self.piece, self.times, run.position, run.orientation, run.angular_velocity)

    @cached_property
    def pushes(self) -> dict[str, np.ndarray]:
        """Forces of drivers (k,), also of those that stand for contacts, by joint."""
        return driver_forces(self.piece, self.run)

    @cached_property
    def reactions(self) -> Mapping[str, np.ndarray]:
        """Reactions (k, 6) by joint."""
        return with_exact_reactions(self.piece, self.run).reactions or {}


class Signal(NamedTuple):
    """A number of a motion, named after its stop or constraint, with the size that rounding may give to it;
    of a force also a share of its largest value."""

    name: str
    value: Callable[[Seen], np.ndarray]
    least: float
    is_force: bool = False

    def floor(self, values: np.ndarray) -> float:
        """Return the size that rounding may give to values (k,) that are zero."""
        return max(self.least, self.is_force * PULL * float(np.abs(values).max(initial=0.0)))


def lowest_samples(times: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Return the indices of samples (k,) at which a positive signal has minima that may be negative between
    samples; there are none beside a change of a function's law."""
    low, high = np.minimum(value[:-2], value[2:]), np.maximum(value[:-2], value[2:])
    even = np.minimum(np.diff(times)[:-1], np.diff(times)[1:]) > JUMP * times[-1]
    return 1 + np.flatnonzero(even & (value[1:-1] >= 0.0) & (value[1:-1] <= low) & (value[1:-1] < high / 2))


def of_stop(piece: Scene, end: End, contacts: Collection[str], moved: Moved) -> Signal:
    """Return the force of a contact, or the gap to an end stop."""
    if end.name in contacts:
        return Signal(end.name, lambda seen: -end.sign * seen.pushes[end.joint], 0.0, True)
    start = moved[end.joint][end.column]
    return Signal(
        end.name,
        lambda seen: end.sign * (end.limit - start - seen.coordinates[end.joint][:, end.column]),
        FLOOR * width(piece, end),
    )


def of_conditions(scene: Scene, piece: Scene, begin: float, moved: Moved, seen: Seen) -> Iterator[Signal]:
    """Yield the signals of the conditions of a scene in a piece that begins at a time (s) and moves as
    ``seen``."""
    yield from releases(scene, piece)
    for part in parts_of(scene):
        if part.when and part.name not in names_of(piece) and part.is_active(begin):
            signal = _of_value(scene, piece, part.name, part.when, moved, seen)
            if signal is not None:
                yield signal


def releases(scene: Scene, piece: Scene) -> Iterator[Signal]:
    """Yield the limits of releases in a piece minus the reactions."""
    for part in parts_of(scene):
        by = part.release and (part.release.joint or part.name)
        if part.release and by and {part.name, by} <= names_of(piece):
            limit = part.release.limit
            yield Signal(part.name, _spare(part.release, by), PULL * limit, True)


def refuse_open(scene: Scene, seen: Seen) -> None:
    """Raise SceneError if redundant constraints leave a reaction open that releases a constraint."""
    run = seen.run
    for signal in releases(scene, seen.piece):
        release = next(part.release for part in parts_of(scene) if part.name == signal.name)
        assert release is not None
        by, limit = release.joint or signal.name, release.limit
        shared = shared_wrenches(seen.piece, 0.0, run.position[0], run.orientation[0])[by]
        used = np.zeros(6)
        if release.component is None:
            part = slice(0, 3) if release.force else slice(3, 6)
            pulls = seen.reactions[by][:, part]
            sizes = np.linalg.norm(pulls, axis=1)
            first = int(np.argmax(sizes > PULL * limit))  # a joint may be without load at the begin
            used[part] = pulls[first] / max(float(sizes[first]), 1e-300)
        else:
            used[_place(release)] = 1.0
        if (np.abs(used @ shared) > OPEN).any():
            raise SceneError([f"{signal.name}: redundant constraints leave the reaction open that releases"])


def _place(release: Release) -> int:
    """Return the place of a named component in a wrench (6,)."""
    return (0 if release.force else 3) + "xyz".index((release.component or "x")[-1])


def _spare(release: Release, by: str) -> Callable[[Seen], np.ndarray]:
    def spare(seen: Seen) -> np.ndarray:
        wrench = seen.reactions[by]
        limit = release.limit
        if release.component is not None:
            sign = -1.0 if release.component[0] == "-" else 1.0
            return np.asarray(limit - sign * wrench[:, _place(release)])
        return np.asarray(limit - np.linalg.norm(wrench[:, :3] if release.force else wrench[:, 3:], axis=1))

    return spare


def _of_value(scene: Scene, piece: Scene, name: str, when: When, moved: Moved, seen: Seen) -> Signal | None:
    """Return the distance of a coordinate from its value on the side from which it comes; None if the motion
    stays at the value."""
    off, size = _off(scene, when, moved), scene_length(piece)
    if when.joint and _kind(scene, when) == ANGLE:
        size = 1.0
    away = [x for x in off(seen).tolist() if abs(x) > 10 * TOUCHING * size]
    if not away:
        return None
    return Signal(name, lambda seen: np.sign(away[0]) * off(seen), FLOOR * TOUCHING * size)


def _kind(scene: Scene, when: When) -> str:
    return when.coordinate or scene.joint_named(when.joint or "").facts.main


def _off(scene: Scene, when: When, moved: Moved) -> Callable[[Seen], np.ndarray]:
    """Return a coordinate minus its value, as a function of a motion of the piece."""
    if when.joint is not None:
        name, column = when.joint, int(_kind(scene, when) != ANGLE)
        return lambda seen: seen.coordinates[name][:, column] + moved[name][column] - when.reaches
    ends = list(zip(when.bodies or (), when.points or (), strict=True))

    def distance(seen: Seen) -> np.ndarray:
        first, second = (_carried(scene, seen.run, *end) for end in ends)
        return np.asarray(np.linalg.norm(second - first, axis=-1) - when.reaches)

    return distance


def _carried(scene: Scene, run: Trajectory, name: str, point: Sequence[float]) -> np.ndarray:
    """Return the places (k, 3) of a point (world, t = 0) that a body carries."""
    if name == GROUND:
        return np.array(point, dtype=float)
    b = scene.body_index(name)
    back = rotations.conjugate(np.array(scene.body[b].orientation))
    arm = rotations.rotate(back, np.array(point) - scene.body[b].position)
    return np.asarray(run.position[:, b] + rotations.rotate(run.orientation[:, b], arm[None]))
