"""The checks of the conformance suite; each is one short function of a bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import NamedTuple, cast

import numpy as np

from crosscheck.conformance.agreeing import accelerations_at_start, alternatives_agree
from crosscheck.conformance.balancing import balanced, workless
from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.changes.relations import RELATIONS
from crosscheck.conformance.keeping import LAWS
from crosscheck.conformance.precise import double_precision, refined, settled, smooth
from crosscheck.conformance.related import related
from crosscheck.conformance.trial import NEIGHBOURS, Bench, Finding, Specimen, difference, worst_body
from crosscheck.conformance.vanishing import vanishing
from crosscheck.engine import Cannot
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.energy import energy_series
from crosscheck.judge.gauss_principle import stacked
from crosscheck.judge.metrics import in_scene_order
from crosscheck.judge.momentum import momentum_series
from crosscheck.judge.openings import counted_violation, uncounted_couplings
from crosscheck.judge.pieces import has_pieces
from crosscheck.judge.precision import motion_rate
from crosscheck.judge.tolerances import GRAINS, LIKE_TRUTH, REACTIONS, SAME_MOTION, STAYS_CLOSED, UNIT_NORM
from crosscheck.judge.violations import most_violated, violation_series
from crosscheck.refusals import shortened
from crosscheck.study.words.text import listed
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Moment

SECOND = ("acceleration", "angular_acceleration")
NORMS = 4.0  # largest deviation of a quaternion's length from 1, in roundings of the engine
STATE = ("position", "orientation", "velocity", "angular_velocity")
NO_ENDS = (Outcome.COMPLETED, Outcome.CRASHED, Outcome.TIMED_OUT)  # outcomes that are wrong at a dead end
DENSE = 65  # number of samples with which the work of a moment is integrated to 1e-8


Check = Callable[[Bench], Finding | Cannot | Outside]


class Property(NamedTuple):
    """A check: ``about`` describes it, ``of`` selects the scenes to which it applies. ``version`` increases
    when the check changes, so that verdicts of different versions are kept apart."""

    about: str
    check: Check
    of: Callable[[Specimen], bool]
    version: int


def sample_times(bench: Bench) -> Finding:
    """Samples are at the requested times, bit for bit, and the run ends at the last one."""
    times = np.array([*bench.motion.times, bench.motion.t_end])
    wanted = np.array([*bench.times, bench.times[-1]])
    same = times.shape == wanted.shape
    return Finding(float(np.abs(times - wanted).max()) if same else np.inf, 0.0)


def unit_orientations(bench: Bench) -> Finding:
    """Orientations are unit quaternions."""
    norms = np.linalg.norm(bench.motion.orientation, axis=-1)
    return Finding(float(np.abs(norms - 1).max()), max(UNIT_NORM, NORMS * bench.rounding))


def closure(bench: Bench) -> Finding:
    """Joints and drivers hold at every sample, by the judge's own joint equations."""
    uncounted = uncounted_couplings(bench.scene, bench.motion)
    remark = f"turns of {listed(uncounted)} cannot be counted between samples" if uncounted else ""
    return vanishing(
        bench,
        lambda k: counted_violation(bench.scene, bench.sweep[k]),
        STAYS_CLOSED,
        remark,
        lambda: f"most at {most_violated(bench.scene, bench.motion)!r}",
    )


def honest_end(bench: Bench) -> Finding:
    """A run driven beyond the last pose of the mechanism ends with a failure; joints hold at its samples."""
    run = bench.finest.value
    if run.outcome in NO_ENDS:
        return Finding(np.inf, STAYS_CLOSED, f"{run.outcome.label} {run.message}".rstrip())
    worst = counted_violation(bench.scene, in_scene_order(bench.scene, run))
    return Finding(worst if np.isfinite(worst) else np.inf, STAYS_CLOSED, run.outcome.label)


def velocities(bench: Bench) -> Finding:
    """Velocities and angular velocities (world) agree with central differences of the poses."""
    noise = GRAINS * bench.rounding / (np.diff(bench.close.times)[0] * motion_rate(bench.scene, bench.close))
    return vanishing(bench, lambda k: _unlike_differences(bench, k), max(LIKE_TRUTH, float(noise)))


def _unlike_differences(bench: Bench, coarser: int) -> float:
    """Return the largest difference of velocities from central differences of poses, relative to the largest
    velocity."""
    run = _at(bench.near(coarser) if coarser else bench.close, slice(NEIGHBOURS - 1, NEIGHBOURS + 2))
    h = (run.times[2] - run.times[0]) / 2
    moved = (run.position[2] - run.position[0]) / (2 * h)
    turn = rotations.multiply(run.orientation[2], rotations.conjugate(run.orientation[0]))
    turned = rotations.to_vector(turn) / (2 * h)
    length = scene_length(bench.scene)
    speeds = np.concatenate([run.velocity[1], length * run.angular_velocity[1]])
    off = speeds - np.concatenate([moved, length * turned])
    scale = max(np.linalg.norm(speeds, axis=1).max(), length / bench.scene.duration)
    return float(np.linalg.norm(off, axis=1).max() / scale)


def truth(bench: Bench) -> Finding:
    """Poses agree with a closed form, the judge's reference, or an integration of Gauss's principle."""
    return vanishing(
        bench,
        lambda k: difference(bench.scene, bench.sweep[k], bench.exact),
        LIKE_TRUTH,
        bench.exact.engine,
        lambda: f"most of {worst_body(bench.scene, bench.motion, bench.exact)!r}",
    )


def convergence(bench: Bench) -> Finding | Outside:
    """The error is at most what the engine's measured order and accuracy limit explain."""
    if len(bench.settings) < 2:
        return Outside("the engine offers one setting")
    error, allowed = difference(bench.scene, bench.motion, bench.exact), bench.resolution
    if error > allowed:
        allowed += bench.exact_bound
    remark = f"{bench.floors}, {bench.contraction:.1e} of the difference before"
    return Finding(error, allowed, remark)


def rates_closed(bench: Bench) -> Finding:
    """Velocities obey joints and drivers at every sample."""
    rate = motion_rate(bench.scene, bench.motion)
    return vanishing(
        bench, lambda k: float(violation_series(bench.scene, bench.sweep[k], 1).max()) / rate, LIKE_TRUTH
    )


def true_velocities(bench: Bench) -> Finding | Outside:
    """Velocities and angular velocities (world) agree with the exact velocities."""
    exact, length = bench.exact, scene_length(bench.scene)
    if np.isnan(exact.velocity).any():
        return Outside("the closed form of this scene gives poses only")
    rate = motion_rate(bench.scene, bench.motion)

    def off(k: int) -> float:
        linear = np.linalg.norm(bench.sweep[k].velocity - exact.velocity, axis=2) / length
        angular = np.linalg.norm(bench.sweep[k].angular_velocity - exact.angular_velocity, axis=2)
        return float(max(linear.max(), angular.max())) / rate

    return vanishing(bench, off, LIKE_TRUTH)


def true_accelerations(bench: Bench) -> Finding | Outside:
    """Linear and angular accelerations (world), if the engine gives them, agree with the exact motion."""
    if bench.motion.acceleration is None:
        return Outside("the engine gives no accelerations")
    if bench.exact.acceleration is None:
        return Outside("the closed form of this scene gives poses only")
    samples = range(len(bench.times))
    exact = np.array([stacked(bench.scene, bench.exact, n) for n in samples])
    scale = max(float(np.abs(exact).max()), scene_length(bench.scene) / bench.scene.duration**2)

    def off(k: int) -> float:
        found = np.array([stacked(bench.scene, bench.sweep[k], n) for n in samples])
        return float(np.abs(found - exact).max()) / scale

    return vanishing(bench, off, REACTIONS)


def energy(bench: Bench) -> Finding | Outside:
    """Energy minus the work of loads is constant, in scenes without dampers and drivers."""
    has_moment = any(isinstance(load, Moment) for load in bench.scene.load)  # its work is a sum over samples
    dense = np.linspace(0.0, bench.scene.duration, DENSE)

    @cache
    def motion(k: int) -> Trajectory:
        return bench.run(bench.scene, dense, k) if has_moment else bench.sweep[k]

    at_start = _at(motion(0), np.zeros(len(motion(0).times), dtype=int))
    if difference(bench.scene, motion(0), at_start) < SAME_MOTION:
        return Outside("nothing moves")
    if energy_series(bench.scene, motion(0)) is None:
        return Outside("a driver or a damper does work, or nothing has mass or energy")
    return vanishing(bench, lambda k: _largest(energy_series(bench.scene, motion(k))), LIKE_TRUTH)


def momentum(bench: Bench) -> Finding | Outside:
    """Momentum and angular momentum change by gravity and external loads only."""
    if momentum_series(bench.scene, bench.motion) is None:
        return Outside("a joint or spring is fixed to the ground, or nothing moves or has mass")
    return vanishing(bench, lambda k: _largest(momentum_series(bench.scene, bench.sweep[k])), LIKE_TRUTH)


def _largest(series: np.ndarray | None) -> float:
    return np.inf if series is None else float(series.max())


def silence(bench: Bench) -> Finding:
    """A run prints nothing and leaves no file in its working directory."""
    seen = bench.finest
    if seen.printed or seen.files:  # allowed if it happens once on a machine
        seen = bench.observed(bench.scene, bench.times, bench.settings[-1])
    said = seen.printed.strip().splitlines()
    remark = "; ".join([*(f"printed {shortened(line)!r}" for line in said[:1]), *seen.files[:3]])
    return Finding(float(len(said) + len(seen.files)), 0.0, remark)


def determinism(bench: Bench) -> Finding:
    """A repeated run gives equal bits, in another process and after a run of another scene."""
    others = [bench.run(bench.scene, bench.times), *bench.shared_runs]
    return Finding(float(np.max([_bits_apart(bench.motion, other) for other in others])), 0.0)


def _bits_apart(first: Trajectory, other: Trajectory) -> float:
    """Return the largest difference between two runs in states, accelerations and reactions; infinite if only
    one run has a number."""
    pairs = [(getattr(first, name), getattr(other, name)) for name in (*STATE, *SECOND)]
    found = other.reactions or {}
    pairs += [(wrench, found.get(joint)) for joint, wrench in (first.reactions or {}).items()]
    given = [(a, b) for a, b in pairs if a is not None]
    return float(np.max([np.inf if b is None else np.abs(a - b).max() for a, b in given]))


def other_times(bench: Bench) -> Finding:
    """The motion does not depend on the number of samples and their times."""
    between = bench.times[:-1] + np.diff(bench.times) * np.resize([0.3, 0.7], len(bench.times) - 1)
    times = np.sort([*bench.times[1:], *between])
    common = _at(bench.run(bench.scene, times), np.isin(times, bench.times))
    alone = bench.run(bench.scene, bench.times[-1:])
    apart = max(
        difference(bench.scene, _at(bench.motion, slice(1, None)), common),
        difference(bench.scene, _at(bench.motion, slice(-1, None)), alone),
    )
    return Finding(apart, bench.own_accuracy, bench.floors)


def _at(run: Trajectory, samples: slice | np.ndarray) -> Trajectory:
    """Return a run at some of its samples."""
    arrays = {name: getattr(run, name)[samples] for name in ("times", *STATE)}
    return replace(run, **arrays, acceleration=None, angular_acceleration=None, reactions=None)


def _every(specimen: Specimen) -> bool:
    return not (specimen.dead_end or specimen.large or specimen.keeps)


def _always_held(specimen: Specimen) -> bool:
    return _every(specimen) and not has_pieces(specimen.scene)


def _large(specimen: Specimen) -> bool:
    return specimen.large


def _several_ways(specimen: Specimen) -> bool:
    return specimen.related or specimen.large


def _without_joints(specimen: Specimen) -> bool:
    return not specimen.scene.joint


def _keeps(quantity: str) -> Callable[[Specimen], bool]:
    return lambda specimen: specimen.keeps == quantity


def _dead_end(specimen: Specimen) -> bool:
    return specimen.dead_end


def _related(specimen: Specimen) -> bool:
    return specimen.related


def _property(check: Check, of: Callable[[Specimen], bool] = _every, version: int = 1) -> Property:
    return Property(cast(str, check.__doc__).splitlines()[0], check, of, version)


PROPERTIES: Mapping[str, Property] = {
    "times": _property(sample_times),
    "unit": _property(unit_orientations),
    "closure": _property(closure, _always_held),
    "dead end": _property(honest_end, _dead_end),
    "rates": _property(rates_closed, _always_held),
    "velocities": _property(velocities),
    "truth": _property(truth, version=2),
    "convergence": _property(convergence, version=2),
    "speeds": _property(true_velocities),
    "accelerations": _property(true_accelerations),
    "refined": _property(refined, _without_joints),
    "settled": _property(settled, _always_held),
    "digits": _property(double_precision),
    "smooth": _property(smooth),
    "start": _property(accelerations_at_start, _large),
    "alternatives": _property(alternatives_agree, _several_ways),
    "energy": _property(energy, _always_held, version=2),
    "momentum": _property(momentum),
    **{name: _property(check, _keeps(quantity)) for name, (check, quantity) in LAWS.items()},
    "balance": _property(balanced),
    "workless": _property(workless, _always_held),
    "silence": _property(silence),
    "repeated": _property(determinism, _related, version=2),
    "resampled": _property(other_times, _related, version=3),
    **{
        name: Property(f"Changed scene: {relation.about}.", partial(related, name), _related, 3)
        for name, relation in RELATIONS.items()
    },
}
