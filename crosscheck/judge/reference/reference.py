"""The reference motion of any scene: two formulations, their agreement, and the bound that follows from it.

Formulation A moves the scene twice, by series of different orders and with other rows where some are
redundant; formulation B moves it once.  Where redundant rows contradict each other, because the scene's
numbers are rounded, joints are displaced by as much in the second run.  Where B ends before A, as
in a singular position, the two runs of A bound each other; where A has no time left before B, as with stiff
dampers, B moves the scene twice, and two runs of B bound each other after A's end.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock

import numpy as np

from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference import cache
from crosscheck.judge.reference.bound import USEFUL, bounds, differences, rounding
from crosscheck.judge.reference.motion import OVER, Motion, Times
from crosscheck.judge.reference.taylor import DATA, natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref.scene import Scene

SECONDS = 20.0
SECOND_RUN_ORDER, SECOND_RUN_NODES, SECOND_RUN_SEED = (
    24,
    1.8,
    1,
)  # second runs: order of A, nodes per digit of B, seed
CONSISTENT = 32 * EXTENDED.eps  # residual that is of the motion's own rounding, not of the scene's
SHARE = 0.4  # fraction of the time that is left for each run of A
FIELDS = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")

_computing: dict[str, Lock] = {}  # locks, keyed by the data that determine a motion


@dataclass(frozen=True)
class Reference:
    """Samples of the reference motion in double precision, as in Motion, and the ``bound`` (k,) on their
    error: distance over the scene's length, or angle (rad).  ``both`` (k,) marks where A and B agree and
    not two runs of one of them alone; ``seconds`` of CPU time were spent."""

    times: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray
    bound: np.ndarray
    both: np.ndarray
    seconds: float

    def at(self, times: np.ndarray) -> Reference:
        """Return the reference at some of its times (k,)."""
        chosen = np.searchsorted(self.times, times)
        arrays = {name: getattr(self, name)[chosen] for name in ("times", *FIELDS, "bound", "both")}
        return Reference(**arrays, seconds=self.seconds)


@dataclass(frozen=True)
class NoReference:
    """Why a scene has no reference at all times asked for, and the samples it has, up to ``until`` (s)."""

    reason: str
    until: float
    part: Reference


def reference(scene: Scene, times: Times, seconds: float = SECONDS) -> Reference | NoReference:
    """The reference motion at times (k,) ≥ 0, from the cache where it has them.

    Takes about so many CPU seconds of the calling thread at most; of several threads that ask for a scene,
    the first computes.  Raises SceneError where the scene's velocities contradict its joints.
    """
    wanted = np.unique(np.asarray(times, dtype=float))
    with _computing.setdefault(cache.canonical(scene), Lock()):
        kept = _known(scene, wanted, seconds)
    there = np.isin(wanted, kept.samples.times)
    part = kept.samples.at(wanted[there])
    return part if there.all() else NoReference(kept.reason, kept.until(), part)


def _known(scene: Scene, wanted: np.ndarray, seconds: float) -> _Kept:
    """From the cache, or computed and put there, with the times that it had."""
    kept = _load(scene)
    if kept is None or not kept.answers(wanted, seconds):
        known = wanted if kept is None else np.union1d(wanted, kept.samples.times)
        kept = _Kept(*judged(scene, known, *runs(scene, known, seconds)), seconds)
        cache.save(scene, kept.arrays())
    return kept


def runs(scene: Scene, times: np.ndarray, seconds: float) -> tuple[Motion, Motion, Motion]:
    """The motion at ascending times (k,) by A, by A in its other way, and by B; where A has no time left and
    B goes on, as with stiff dampers, by B, by B in its other way, and by A."""
    a = natural_motion(scene, times, EXTENDED, seconds=SHARE * seconds)
    left, moved = seconds - a.seconds, max(DATA, a.contradiction) if a.contradiction > CONSISTENT else 0.0
    if a.reason == OVER:
        b = tree_motion(scene, times, EXTENDED, seconds=left / 2)
        if len(b.times) > len(a.times):
            return b, _other_b(scene, b.times, moved, left - b.seconds), a
        return a, _other_a(scene, a.times, moved, left - b.seconds), b
    if not len(a.times):
        return a, a, a
    second_run = _other_a(scene, a.times, moved, SHARE * left)
    return a, second_run, tree_motion(scene, a.times, EXTENDED, seconds=left - second_run.seconds)


def _other_a(scene: Scene, times: np.ndarray, displaced: float, seconds: float) -> Motion:
    """By A, of another order and with other rows, the joints displaced."""
    return natural_motion(
        scene,
        times,
        EXTENDED,
        seconds=seconds,
        order=SECOND_RUN_ORDER,
        seed=SECOND_RUN_SEED,
        displaced=displaced,
    )


def _other_b(scene: Scene, times: np.ndarray, displaced: float, seconds: float) -> Motion:
    """By B, on fewer points and with other rows, the joints displaced."""
    return tree_motion(
        scene,
        times,
        EXTENDED,
        seconds=seconds,
        nodes_per_digit=SECOND_RUN_NODES,
        seed=SECOND_RUN_SEED,
        displaced=displaced,
    )


def judged(
    scene: Scene, times: np.ndarray, one: Motion, second_run: Motion, other: Motion
) -> tuple[Reference, str]:
    """Return samples of a motion with the bound from its second run and formulation B, while it is useful."""
    apart = np.zeros(max(len(second_run.times), len(other.times)))
    for second in (second_run, other):
        k = len(second.times)
        apart[:k] = np.maximum(apart[:k], differences(scene, one, second))
    bound = np.maximum(bounds(apart), rounding(scene, one)[: len(apart)])
    good = int((bound <= USEFUL).sum())
    arrays = {name: doubles(getattr(one, name)[:good]) for name in FIELDS}
    samples = Reference(
        times=one.times[:good],
        **arrays,
        bound=bound[:good],
        both=np.arange(good) < len(other.times),
        seconds=one.seconds + second_run.seconds + other.seconds,
    )
    if good < len(apart):
        return (
            samples,
            f"independent motions of it differ by {apart[good]:.0e} at t = {one.times[good]:.6g} s",
        )
    ended = one if len(one.times) < len(times) else second_run
    return samples, f"{ended.reason}, at t = {ended.reached:.6g} s" if good < len(times) else ""


@dataclass(frozen=True)
class _Kept:
    """A scene's motion as far as it is known: samples, why none are later, and the CPU time given."""

    samples: Reference
    reason: str
    seconds: float

    def answers(self, times: np.ndarray, seconds: float) -> bool:
        """Whether nothing more would be known at the times (k,) from another run of so many seconds."""
        missing = times[~np.isin(times, self.samples.times)]
        return not len(missing) or (
            missing.min() > self.until() and self.seconds >= seconds and bool(self.reason)
        )

    def until(self) -> float:
        """The last time (s) at which the motion is known."""
        return float(self.samples.times.max(initial=0.0))

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the reference as arrays, for the cache."""
        known = {name: np.asarray(getattr(self.samples, name)) for name in Reference.__dataclass_fields__}
        return known | {"reason": np.array(self.reason), "given": np.array(self.seconds)}


def _load(scene: Scene) -> _Kept | None:
    arrays = cache.load(scene)
    if not arrays:
        return None
    reason = str(arrays.pop("reason"))
    given, seconds = (float(arrays.pop(name)) for name in ("given", "seconds"))
    return _Kept(Reference(**arrays, seconds=seconds), reason, given)
