"""The reference motion of any scene: two formulations, their agreement, and the bound that follows from it.

Formulation A computes the motion twice, by series of different orders and, if rows are redundant, with
different independent rows. Formulation B computes it once. If redundant rows contradict each other, because
the scene's numbers are rounded, joints are displaced by the amount of the contradiction in the second run. If
B ends before A, as at a singular position, the difference of the two runs of A gives the bound. If A runs out
of time before B, as with stiff dampers, B is run twice, and the difference of the two runs of B gives the
bound from there on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock

import numpy as np

from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference import cache
from crosscheck.judge.reference.bound import USEFUL, bounds, differences, rounding
from crosscheck.judge.reference.hinges_of_balls import of_bodies, with_hinges
from crosscheck.judge.reference.motion import OVER, Motion, Times
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import DATA, natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref.scene import Scene, rolling_wheel

SECONDS = 20.0
Formulation = Callable[..., Motion]
# second runs: order of A, nodes per digit of B, and the seed that chooses rows
SECOND_RUNS: dict[Formulation, dict[str, float]] = {
    natural_motion: {"order": 24},
    tree_motion: {"nodes_per_digit": 1.8},
}
SECOND_RUN_SEED = 1
# residual that is due to the rounding of the motion, not to the scene's numbers
CONSISTENT = 32 * EXTENDED.eps
SHARE = 0.4  # fraction of the remaining time for each run of A
FIELDS = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration")
ROLLS = "the wheel of joint {!r} rolls without slip, and no formulation of the reference has its equations"

_computing: dict[str, Lock] = {}  # locks, keyed by the data that determine a motion


@dataclass(frozen=True)
class Reference:
    """Samples of the reference motion in double precision, as in Motion, and the ``bound`` (k,) on their
    error.

    The bound is a distance over the scene's length, or an angle (rad). ``both`` (k,) is True where A and B
    agree, and False where two runs of one formulation agree. ``seconds`` is the CPU time. ``events`` (e,) are
    times (s) at which constraints come or go, or stops are met, up to the last sample.
    """

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
    events: np.ndarray

    def at(self, times: np.ndarray) -> Reference:
        """Return the reference at some of its times (k,)."""
        chosen = np.searchsorted(self.times, times)
        arrays = {name: getattr(self, name)[chosen] for name in ("times", *FIELDS, "bound", "both")}
        events = self.events[self.events <= times.max(initial=0.0)]
        return Reference(**arrays, seconds=self.seconds, events=events)


@dataclass(frozen=True)
class NoReference:
    """A scene has no reference at all requested times: the reason, and the samples up to ``until`` (s)."""

    reason: str
    until: float
    part: Reference


def reference(scene: Scene, times: Times, seconds: float = SECONDS) -> Reference | NoReference:
    """Return the reference motion at times (k,) ≥ 0, from the cache if it contains them.

    The computation takes at most about ``seconds`` of CPU time of the calling thread. If several threads
    request a scene, the first one computes it.  Raises SceneError if the scene's velocities contradict its
    joints.
    """
    if wheel := rolling_wheel(scene):
        return NoReference(ROLLS.format(wheel), 0.0, _nothing(scene))
    wanted = np.unique(np.asarray(times, dtype=float))
    with _computing.setdefault(cache.canonical(scene), Lock()):
        kept = _known(scene, wanted, seconds)
    there = np.isin(wanted, kept.samples.times)
    part = kept.samples.at(wanted[there])
    return part if there.all() else NoReference(kept.reason, kept.until(), part)


def _nothing(scene: Scene) -> Reference:
    """Return a reference without samples."""
    sizes = {name: (0, len(scene.body), 4 if name == "orientation" else 3) for name in FIELDS}
    arrays = {name: np.zeros(size) for name, size in sizes.items()}
    none = np.zeros(0)
    return Reference(times=none, **arrays, bound=none, both=none > 0, seconds=0.0, events=none)


def _known(scene: Scene, wanted: np.ndarray, seconds: float) -> _Kept:
    """Return the motion from the cache, or compute and store it, together with the times that were stored."""
    kept = _load(scene)
    if kept is None or not kept.answers(wanted, seconds):
        known = wanted if kept is None else np.union1d(wanted, kept.samples.times)
        kept = _Kept(*judged(scene, known, *runs(scene, known, seconds)), seconds)
        cache.save(scene, kept.arrays())
    return kept


def runs(scene: Scene, times: np.ndarray, seconds: float) -> tuple[Motion, Motion, Motion]:
    """Return the motion at increasing times (k,) by A, by a second run of A, and by B.

    If A runs out of time and B continues, as with stiff dampers, return the motion by B, by a second run of
    B, and by A.
    """
    hinged = with_hinges(scene)
    if hinged is not scene:
        found = runs(hinged, times, seconds)
        one, second_run, other = (of_bodies(each, len(scene.body), FIELDS) for each in found)
        return one, second_run, other
    a = motion_by(natural_motion, scene, times, EXTENDED, seconds=SHARE * seconds)
    left, moved = seconds - a.seconds, max(DATA, a.contradiction) if a.contradiction > CONSISTENT else 0.0
    if a.reason == OVER:
        b = motion_by(tree_motion, scene, times, EXTENDED, seconds=left / 2)
        if len(b.times) > len(a.times):
            return b, _second(tree_motion, scene, b.times, moved, left - b.seconds), a
        return a, _second(natural_motion, scene, a.times, moved, left - b.seconds), b
    if not len(a.times):
        return a, a, a
    second_run = _second(natural_motion, scene, a.times, moved, SHARE * left)
    return a, second_run, motion_by(tree_motion, scene, a.times, EXTENDED, seconds=left - second_run.seconds)


def _second(
    formulation: Formulation, scene: Scene, times: np.ndarray, displaced: float, seconds: float
) -> Motion:
    """Return the second run of a formulation: A of another order, B on fewer points; with other rows and
    displaced joints."""
    return motion_by(
        formulation,
        scene,
        times,
        EXTENDED,
        seconds=seconds,
        seed=SECOND_RUN_SEED,
        displaced=displaced,
        **SECOND_RUNS[formulation],
    )


def judged(
    scene: Scene, times: np.ndarray, one: Motion, second_run: Motion, other: Motion
) -> tuple[Reference, str]:
    """Return samples of a motion with the bound from its second run and from formulation B, up to the time at
    which the bound becomes too large to be useful."""
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
        events=np.array([t for t in one.events if t <= one.times[:good].max(initial=0.0)]),
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
    """The known part of a scene's motion: samples, the reason for its end, and the CPU time allowed."""

    samples: Reference
    reason: str
    seconds: float

    def answers(self, times: np.ndarray, seconds: float) -> bool:
        """Return whether the known part answers a request for times (k,): a further run within these CPU
        seconds would give no more."""
        missing = times[~np.isin(times, self.samples.times)]
        return not len(missing) or (
            missing.min() > self.until() and self.seconds >= seconds and bool(self.reason)
        )

    def until(self) -> float:
        """Return the last time (s) at which the motion is known."""
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
