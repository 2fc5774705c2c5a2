"""Conditions of joints and couplings: coordinates that reach a value, and reactions that exceed a limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from mbref.equations.joint_reactions import SHARE, open_changes
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.motions.motion import Motion
from mbref.motions.pieces import constraint_parts
from mbref.motions.trajectory import Trajectory
from mbref.motions.watched import loaded, watched
from mbref.scene import Scene, SceneError
from mbref.scene.conditions import Release, When
from mbref.scene.joints import ANGLE
from mbref.simulation.end_stops import GAP_CLOSED, GAP_ROUNDED, counted
from mbref.simulation.zeros import PULL, Signal

PROBES = 32  # intervals of a piece, or of a part of it, in one of which a coordinate leaves its value
PARTS = 4  # such parts, each inside the one before; intervals of the last one are 1e-6 of the piece
MotionOf = Callable[[Scene, np.ndarray], Motion]  # of a piece, at times (k,), s
Watched = Callable[[Trajectory], tuple[np.ndarray, np.ndarray]]  # a coordinate and its rate (k,)


class Conditions:
    """The conditions of a scene of a length (m), with the function that runs a piece and its end time (s)."""

    def __init__(self, scene: Scene, run: MotionOf, end: float, length: float):
        self._scene, self._run, self._end, self._length = scene, run, end, length

    def exceeded(self, piece: Scene, held: Scene, left: float) -> tuple[str, ...]:
        """Return the names of the constraints that reactions release at the begin of a piece of length
        ``left`` (s); ``held`` is the piece with its contacts.

        Raises SceneError for a reaction that redundant constraints leave open.
        """
        releasing = list(self._releasing(piece))
        if not releasing:
            return ()
        motion = self._run(held, np.zeros(1))
        if not len(motion.times):
            return ()
        model = Model(assembled(held))
        q, blocks = model.start(), model.terms(0.0, model.start()).blocks
        changes = list(open_changes(model, q.reshape(1, model.nb, 7), blocks[None]))
        model.release()
        probed = self._run(held, np.linspace(0.0, left, PROBES + 1)) if changes and left else motion
        for each, release, name in releasing:
            wrench = _first_load(release, (probed.reactions or {})[name])
            if _is_open(release, wrench, [change[name] for change in changes]):
                kind = "force" if release.force else "moment"
                why = f"redundant constraints leave the {kind} in joint {name!r} open"
                raise SceneError([f"{each}.release: {why}; exchange joints (mbref exchange)"])
        return tuple(
            each
            for each, release, name in releasing
            if _spare(release, name, motion)[0] < -PULL * release.limit
        )

    def signals(
        self, piece: Scene, held: Scene, turned: Mapping[str, float], begin: float, left: float
    ) -> Iterator[tuple[str, Signal]]:
        """Yield a signal for each condition of a piece that begins at a time (s), with the name of the
        constraint."""
        for own, release, name in self._releasing(piece):
            yield own, Signal(partial(_spare, release, name), least=PULL * release.limit)
        names = {each.name for each in constraint_parts(piece)}
        for each in constraint_parts(self._scene):
            if each.when and each.name not in names and each.is_active(begin):
                watch = self._counted(each.when, turned)
                if side := self._side(held, watch, each.when, left):
                    floor = GAP_ROUNDED / GAP_CLOSED * self._least(each.when)
                    yield each.name, Signal(*_parts(watch, side, each.when.reaches), floor)

    def _releasing(self, piece: Scene) -> Iterator[tuple[str, Release, str]]:
        """Yield the constraints of a piece that a reaction releases, with the joint of this reaction."""
        names = {each.name for each in constraint_parts(piece)}
        for each in constraint_parts(self._scene):
            if each.release and each.name in names and (each.release.joint or each.name) in names:
                yield each.name, each.release, each.release.joint or each.name

    def _counted(self, when: When, turned: Mapping[str, float]) -> Watched:
        """Return the watched coordinate and its rate, with angles (rad) since t = 0, as a function of the
        motion of a piece."""
        return lambda motion: watched(self._scene, when, counted(motion, turned))

    def _least(self, when: When) -> float:
        """Return the distance from its value, rad or m, at which a coordinate is there."""
        kind = when.joint and (when.coordinate or self._scene.joint_named(when.joint).facts.main)
        return GAP_CLOSED * (1.0 if kind == ANGLE else self._length)

    def _side(self, held: Scene, watch: Watched, when: When, left: float) -> float:
        """Return the sign of a coordinate minus its value, from which it can reach the value: where a piece
        begins, or after the coordinate has left the value; 0 if it stays there."""

        def sides(times: np.ndarray) -> np.ndarray:
            off = watch(self._run(held, times))[0] - when.reaches
            return np.sign(off) * (np.abs(off) > 10 * self._least(when))

        side, first, last = float(sides(np.zeros(1)).sum()), 0.0, left
        for _ in range(PARTS if left and not side else 0):
            times = np.linspace(first, last, PROBES + 1)
            away = np.flatnonzero(found := sides(times))
            if not away.size or not away[0]:
                break
            side, first, last = (float(each) for each in (found[away[0]], *times[away[0] - 1 : away[0] + 1]))
        return side


def _parts(
    watch: Watched, side: float, reaches: float
) -> tuple[Callable[[Motion], np.ndarray], Callable[[Motion], np.ndarray]]:
    """Return the distance of a coordinate from its value, positive on a side, and its rate, as functions."""
    return lambda motion: side * (watch(motion)[0] - reaches), lambda motion: side * watch(motion)[1]


def _spare(release: Release, name: str, motion: Motion) -> np.ndarray:
    """Return the limit of a release minus the reaction (k,) of a joint, N or N m."""
    return np.asarray(release.limit - loaded(release, (motion.reactions or {})[name]))


def _first_load(release: Release, wrench: np.ndarray) -> np.ndarray:
    """Return the first reaction (1, 6) of a joint, of (k, 6), whose size that releases is not rounding."""
    size = np.linalg.norm(wrench[:, :3] if release.force else wrench[:, 3:], axis=1)
    k = int(np.argmax(size > PULL * release.limit))
    return wrench[k : k + 1]


def _is_open(release: Release, wrench: np.ndarray, changes: Sequence[np.ndarray]) -> bool:
    """Return whether a reaction (1, 6) of a joint can have another size, or component, that releases; by
    changes (1, 6) that redundant constraints leave open."""
    if release.component is not None:
        return any(abs(loaded(release, change)[0]) > SHARE for change in changes)
    part = slice(0, 3) if release.force else slice(3, 6)
    size = np.linalg.norm(wrench[0, part])
    return any(abs(change[0, part] @ wrench[0, part]) > SHARE * size for change in changes)
