"""Hints for failing engines: the term of the equations whose change explains an engine's accelerations best.

Accelerations are finite differences of the engine's velocities in the middle of a failing scene. The judge's
mass matrix, forces and constraint rows are evaluated at the engine's own state, so that integration errors
have no influence.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.conformance.runners import Runner
from crosscheck.conformance.trial import NEIGHBOURS, Bench, Broken, set_up
from crosscheck.judge.constraints import initial_twists, scene_length
from crosscheck.judge.equations_of_motion import PARTS, accelerations, terms_at, variants
from crosscheck.judge.tolerances import GRAINS
from crosscheck.processes.pool import ChildFailed
from mbref.scene import Scene

# relative error of accelerations that counts as wrong; finite differences are exact to 1e-5 in engines that
# conform
WRONG = 1e-3
EXPLAINED = 0.02  # fraction of the difference that may remain after a change that explains it
MOST = 8  # largest number of examined failing scenes; scenes that need the fewest terms come first
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # weights of central differences of order 8


class Failure(NamedTuple):
    """The first check of the suite that an engine fails on a scene."""

    specimen: Specimen
    check: str


def hint(runner: Runner, failures: Sequence[Failure], family: str = "") -> str:
    """Return one sentence on the cause that explains most failing scenes; empty if no scene can be
    examined."""
    ordered = sorted(failures, key=lambda failure: len(parts_of(failure.specimen.scene)))
    asked = [f for f in ordered if f.specimen.scene.has_mass() and not f.specimen.large][:MOST]
    found = [pair for failure in asked for pair in _looked_at(runner, failure, family)]
    if not found:
        return ""
    wrong = [(failure, changes) for failure, changes in found if changes is not None]
    first, _ = (wrong or found)[0]
    needs = ", ".join(parts_of(first.specimen.scene))
    begin = (
        f"hint: begin with the scene {first.specimen.scene.name!r}, check {first.check} (it needs: {needs})"
    )
    if not wrong:
        return f"{begin}; accelerations agree with the judge's, so look at the integration or at the output"
    count = Counter(change for _, changes in wrong for change in changes)
    if not count:
        return f"{begin}; its accelerations are wrong, and no single term explains them"
    best = max(count, key=lambda change: (count[change], -PARTS.index(change[0])))
    scenes = f"{count[best]} of {len(wrong)} scenes with wrong accelerations"
    return f"{begin}; look at the {best[0]}: {best[1]} explains {scenes}"


def parts_of(scene: Scene) -> list[str]:
    """Return the parts of an engine that a scene needs, in order of dependence."""
    needed = {
        "mass matrix": True,
        "gravity": any(scene.gravity),
        "velocity terms": any(np.any(part) for part in initial_twists(scene)),
        "loads": bool(scene.load),
        "constraints": bool(scene.joint),
        "drivers": bool(scene.driver),
    }
    return [part for part in PARTS if needed[part]]


# (part, change) pairs that explain wrong accelerations; None if the accelerations are right
Changes = set[tuple[str, str]] | None


def _looked_at(runner: Runner, failure: Failure, family: str) -> Iterator[tuple[Failure, Changes]]:
    """Yield a failure with the changes that explain it; nothing if the engine has no motion there."""
    with suppress(Broken, ChildFailed):
        yield failure, explanations(set_up(runner, failure.specimen, family))


def explanations(bench: Bench) -> Changes:
    """Return the changes that explain the wrong accelerations of a bench's engine; None if the accelerations
    are right."""
    scene, motion, middle = bench.scene, bench.close, NEIGHBOURS
    own = _differences(scene, bench)
    right = accelerations(scene, terms_at(scene, motion, middle))
    difference = float(np.linalg.norm(own - right))
    if not np.isfinite(difference):
        raise Broken("the terms of its motion are not known")
    if difference <= WRONG * max(float(np.linalg.norm(right)), _least(scene)) + _rounded(bench):
        return None
    return {
        (part, change)
        for part, change, terms in variants(scene, motion, middle)
        if np.linalg.norm(own - accelerations(scene, terms)) <= EXPLAINED * difference
    }


def _differences(scene: Scene, bench: Bench) -> np.ndarray:
    """Return accelerations (6 nb,) from finite differences of neighbouring samples; angular ones are
    multiplied by the scene's length."""
    rates, step = _rates(scene, bench)
    found = sum(
        w * (rates[NEIGHBOURS + k] - rates[NEIGHBOURS - k]) for k, w in enumerate(WEIGHTS[:NEIGHBOURS], 1)
    )
    return np.ravel(found / step)


def _rounded(bench: Bench) -> float:
    """Return the accelerations, as of `_differences`, that the rounding of the engine's velocities causes."""
    rates, step = _rates(bench.scene, bench)
    return GRAINS * bench.rounding * float(np.linalg.norm(rates[NEIGHBOURS])) / step


def _rates(scene: Scene, bench: Bench) -> tuple[np.ndarray, float]:
    """Return the velocities of neighbouring samples (k, nb, 6), angular ones multiplied by the scene's
    length, and the time between two samples (s)."""
    motion = bench.close
    rates = np.concatenate([motion.velocity, scene_length(scene) * motion.angular_velocity], axis=-1)
    return rates, float(motion.times[1] - motion.times[0])


def _least(scene: Scene) -> float:
    """Return the acceleration that moves a body by the scene's length within its duration; smaller
    accelerations are ignored."""
    return scene_length(scene) / scene.duration**2
