"""Accelerations of large mechanisms at the start, and agreement of an engine's alternatives: several ways to
solve the same equations, on the same state.

The ways are compared in accelerations and reactions at the start and after a short motion, and in the
velocities after it. Gauss's principle decides which of two ways is right.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.changes.copies import Outside
from crosscheck.conformance.runners import Runner
from crosscheck.conformance.trial import Bench, Finding, completed
from crosscheck.engine import Alternatives
from crosscheck.judge.connected_parts import least_constraint
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_motion import accelerations
from crosscheck.judge.gauss_principle import stacked
from crosscheck.judge.joint_loads import turning_loads
from crosscheck.judge.joint_reactions import resultants
from crosscheck.judge.model_identity import acceleration_scale
from crosscheck.judge.tolerances import LEAST_CHANGE, REACTIONS
from crosscheck.refusals import shortened
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Scene

SHARE, SHORTEST = 0.01, 1e-3  # the short motion takes this part of the scene's duration, at least 1 ms
# ratio of two ways' distances from Gauss's principle at which it supports the nearer one
CLEARLY = 10.0
ACCELERATION, MEAN, FORCE = "acceleration", "mean acceleration", "force of the joints"
NO_ANGLES = np.zeros(0)


class Way(NamedTuple):
    """A run of one way, and its quantities (samples, nb, 6) by name, angular parts with the scene's
    length."""

    run: Trajectory
    quantities: dict[str, np.ndarray]


class Apart(NamedTuple):
    """Difference of two ways, relative to the largest value, with its quantity, body and sample."""

    size: float
    ways: tuple[str, str]
    quantity: str
    body: str
    sample: int


def accelerations_at_start(bench: Bench) -> Finding | Outside:
    """Accelerations of a large mechanism at the start agree with Gauss's principle."""
    if bench.motion.acceleration is None:
        return Outside("the engine gives no accelerations")
    true = least_constraint(bench.scene)
    scale = max(float(np.abs(true).max()), LEAST_CHANGE * acceleration_scale(bench.scene))
    return Finding(float(np.abs(stacked(bench.scene, bench.motion, 0) - true).max() / scale), REACTIONS)


def alternatives_agree(bench: Bench) -> Finding | Outside:
    """Ways to the same equations that the engine declares agree in accelerations, reactions and motion."""
    if not bench.runner.alternatives:
        return Outside("the engine declares no alternatives")
    if not acceleration_scale(bench.scene):
        return Outside("nothing moves, and nothing acts")
    found, failures = [], dict[str, str]()
    for each in bench.runner.alternatives:
        ways = _ways(bench, each, failures)
        if len(ways) > 1:
            found.append(_finding(bench.scene, each.within, ways))
    if not found:
        return Outside(f"fewer than two ways complete: {'; '.join(failures.values())}")
    return max(found, key=lambda one: one.measured / one.allowed)


def runs_of(runner: Runner, scene: Scene, given: Alternatives, share: float = SHARE) -> dict[str, Trajectory]:
    """Return the runs, from the start to the end of a short motion, of the ways that serve the scene.

    The motion takes ``share`` of the scene's duration, at least SHORTEST.
    """
    times = np.array([0.0, min(scene.duration, max(SHORTEST, share * scene.duration))])
    settings = {n: s for n, s in given.ways.items() if not runner.refuses(scene, s.family)}
    runs = runner.in_turn([(scene, setting) for setting in settings.values()], times)
    return dict(zip(settings, runs, strict=True))


def way_of(scene: Scene, run: Trajectory) -> Way:
    """Return a run with its quantities; raises Broken for a run that ended early, or with numbers that are
    not finite."""
    whole = completed(scene, run, 2)
    return Way(whole, quantities_of(scene, whole))


def _ways(bench: Bench, given: Alternatives, failures: dict[str, str]) -> dict[str, Way]:
    """Return the completed ways; ways that fail and say so are left out. Raises Broken for a way that
    crashes, or claims to have completed with numbers that are not finite."""
    found = {}
    for name, run in runs_of(bench.runner, bench.scene, given).items():
        if run.outcome in (Outcome.COMPLETED, Outcome.CRASHED):
            found[name] = way_of(bench.scene, run)
        else:
            failures[name] = shortened(f"{name}: {run.message or run.outcome.sentence}")
    return found


def quantities_of(scene: Scene, run: Trajectory) -> dict[str, np.ndarray]:
    """Return accelerations, forces of all joints on a body, and mean accelerations since the start."""
    units = np.repeat([1.0, scene_length(scene)], 3)
    twists = units * np.concatenate([run.velocity, run.angular_velocity], axis=2)
    found = {MEAN: (twists - twists[0]) / run.times[-1]}
    if run.acceleration is not None and run.angular_acceleration is not None:
        found[ACCELERATION] = units * np.concatenate([run.acceleration, run.angular_acceleration], axis=2)
    if run.reactions and scene.has_mass():
        found[FORCE] = resultants(scene, run, np.arange(len(run.times))) / units
    return found


def _finding(scene: Scene, within: float, ways: Mapping[str, Way]) -> Finding:
    worst, words = worst_of(scene, within, ways)
    return Finding(worst.size, within, words)


def worst_of(scene: Scene, within: float, ways: Mapping[str, Way]) -> tuple[Apart, str]:
    """Return the largest difference of two ways, and words on it.

    Above the limit ``within`` one of the two ways is the way that Gauss's principle supports, if it can tell.
    """
    worst = max(differences(scene, ways, itertools.combinations(ways, 2)))
    if worst.size <= within:
        return worst, f"{' and '.join(map(repr, worst.ways))} in {worst.quantity}"
    if off := off_from_gauss(scene, ways, worst.sample):
        right = min(off, key=lambda name: off[name])
        beside = max(differences(scene, ways, ((right, name) for name in ways if name != right)))
        worst = beside if beside.size > within else worst
    return worst, _sentence(worst, off)


def _sentence(worst: Apart, off: Mapping[str, float]) -> str:
    first, second = worst.ways
    said = f"{first!r} and {second!r} differ in {worst.quantity} of {worst.body!r}"
    if not off.keys() >= {*worst.ways}:
        return said
    near, far = sorted(worst.ways, key=lambda name: off[name])
    if off[far] < CLEARLY * off[near]:
        return f"{said}; Gauss's principle is {off[near]:.1e} from {near!r} and {off[far]:.1e} from {far!r}"
    return f"{said}; Gauss's principle supports {near!r}, {off[near]:.1e} off, against {off[far]:.1e}"


def differences(scene: Scene, ways: Mapping[str, Way], pairs: Iterable[tuple[str, str]]) -> list[Apart]:
    """Return the largest difference of each pair in each quantity and sample."""
    least, mass = LEAST_CHANGE * acceleration_scale(scene), sum(body.mass or 0.0 for body in scene.body)
    found = []
    for pair in pairs:
        first, second = (ways[name].quantities for name in pair)
        for quantity in first.keys() & second.keys():
            a, b = first[quantity], second[quantity]
            floor = least * mass if quantity == FORCE else least
            off = np.abs(a - b).max(axis=2)
            for sample, values in enumerate(off):
                scale = max(np.abs(a[sample]).max(), np.abs(b[sample]).max(), floor)
                worst = int(values.argmax())
                found.append(
                    Apart(float(values[worst] / scale), pair, quantity, scene.body[worst].name, sample)
                )
    return found


def off_from_gauss(scene: Scene, ways: Mapping[str, Way], sample: int) -> dict[str, float]:
    """Return each way's distance from the accelerations by Gauss's principle at its own state, relative to
    the largest one; nothing where they are not known."""
    reporting = {name: way for name, way in ways.items() if ACCELERATION in way.quantities}
    if not scene.has_mass() or (sample and turning_loads(scene)):
        return {}
    units = np.repeat([1.0, scene_length(scene)], 3)
    true = np.zeros(0) if sample else np.hstack(np.split(least_constraint(scene), 2))
    off = {}
    for name, (run, quantities) in reporting.items():
        if sample:
            pose = run.position[sample], run.orientation[sample]
            state = (*pose, run.velocity[sample], run.angular_velocity[sample], NO_ANGLES)
            true = units * accelerations(scene, float(run.times[sample]), state)
        scale = max(np.abs(true).max(), LEAST_CHANGE * acceleration_scale(scene))
        off[name] = float(np.abs(quantities[ACCELERATION][sample] - true).max() / scale)
    return off
