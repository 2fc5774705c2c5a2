"""Hints for failing engines: the term of the equations whose change explains an engine's accelerations best.

Accelerations are finite differences of the engine's velocities in the middle of a failing scene. The judge's
mass matrix, forces and constraint rows are evaluated at the engine's own state, so that integration errors
have no influence.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np

from crosscheck.conformance.mechanisms.specimens import Specimen
from crosscheck.conformance.runners import Runner
from crosscheck.conformance.trial import NEIGHBOURS, Bench, Broken, set_up
from crosscheck.judge.constraints import initial_twists, scene_length
from crosscheck.judge.equations_of_motion import (
    PARTS,
    Scaled,
    Terms,
    accelerations,
    scaled_terms,
    terms_at,
    variants,
)
from crosscheck.judge.gauss_principle import rank_of
from crosscheck.judge.pieces import has_pieces
from crosscheck.judge.tolerances import GRAINS
from crosscheck.judge.violations import violation_series
from crosscheck.processes.pool import ChildFailed
from mbref.scene import Scene

# relative error of accelerations that counts as wrong; finite differences are exact to 1e-5 in engines that
# conform
WRONG = 1e-3
# relative error of accelerations over the violation of joints (lengths or rad) that explains it: there the
# rows of two right engines differ
DRIFTED = 10.0
EXPLAINED = 0.02  # fraction of the difference that may remain after a change that explains it
FACTORS = {0.0: "left out", -1.0: "of opposite sign", 2.0: "counted twice"}
NEAR_FACTOR = 0.01  # distance from one of these factors within which a factor counts as this one
FITS = 3  # corrections of a factor; accelerations are linear in forces, and nearly so in mass
STEP = 1e-3  # change of a factor for the difference of accelerations
MOST = 8  # largest number of examined failing scenes; scenes that need the fewest terms come first
AT_EVENTS = "hint: begin with the scene {!r}, check {}; look at the times of its events and at its impacts"
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # weights of central differences of order 8


class Failure(NamedTuple):
    """The first check of the suite that an engine fails on a scene."""

    specimen: Specimen
    check: str


def hint(runner: Runner, failures: Sequence[Failure], family: str = "") -> str:
    """Return one sentence on the cause that explains most failing scenes; empty if no scene can be
    examined."""
    always = [failure for failure in failures if not has_pieces(failure.specimen.scene)]
    ordered = sorted(always, key=lambda failure: len(parts_of(failure.specimen.scene)))
    asked = [f for f in ordered if f.specimen.scene.has_mass() and not f.specimen.large][:MOST]
    found = [pair for failure in asked for pair in _looked_at(runner, failure, family)]
    if not found:
        sometimes = [failure for failure in failures if failure not in always][:1]
        return "".join(AT_EVENTS.format(each.specimen.scene.name, each.check) for each in sometimes)
    wrong = [(failure, changes) for failure, changes in found if changes is not None]
    first, _ = (wrong or found)[0]
    needs = ", ".join(parts_of(first.specimen.scene))
    begin = (
        f"hint: begin with the scene {first.specimen.scene.name!r}, check {first.check} (it needs: {needs})"
    )
    if not wrong:
        return f"{begin}; accelerations agree with the judge's, so look at the integration or at the output"
    count = Counter(change for _, changes in wrong for change in changes)
    certain = {change for _, changes in wrong for change, alone in changes.items() if alone}
    known = [change for change in count if count[change] > 1 or change in certain]
    if not known:
        return f"{begin}; its accelerations are wrong, and no single term explains them"
    named = tuple(FACTORS.values())

    def rank(change: tuple[str, str]) -> tuple[int, bool, bool, int]:
        return count[change], change in certain, change[1].endswith(named), -PARTS.index(change[0])

    best = max(known, key=rank)
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


# (part, change) pairs that explain wrong accelerations, of one body or load first, and whether one scene
# proves them: where one freedom is left, a multiple of nearly every term explains all; None if none is wrong
Changes = dict[tuple[str, str], bool] | None


def _looked_at(runner: Runner, failure: Failure, family: str) -> Iterator[tuple[Failure, Changes]]:
    """Yield a failure with the changes that explain it; nothing if the engine has no motion there."""
    with suppress(Broken, ChildFailed):
        yield failure, explanations(set_up(runner, failure.specimen, family))


def explanations(bench: Bench) -> Changes:
    """Return the changes that explain the wrong accelerations of a bench's engine; None if the accelerations
    are right, or if violated joints may explain the difference."""
    scene, orientation = bench.scene, bench.close.orientation[NEIGHBOURS]
    own, terms = _differences(scene, bench), terms_at(scene, bench.close, NEIGHBOURS)
    right = accelerations(scene, terms)
    difference = float(np.linalg.norm(own - right))
    if not np.isfinite(difference):
        raise Broken("the terms of its motion are not known")
    size = max(float(np.linalg.norm(right)), _least(scene))
    if difference <= WRONG * size + _rounded(bench):
        return None
    explains = partial(_explains, scene, own, EXPLAINED * difference)
    changed = variants(scene, orientation, terms)
    found = {(each.part, each.change): True for each in changed if explains(each.terms)}
    freedoms = len(own) - rank_of(np.linalg.svd(terms.rows, compute_uv=False))
    for scaled in scaled_terms(scene, terms):
        tried = (_factor(scene, scaled, own), *(FACTORS if scaled.is_armature else ()))
        factor = next((each for each in tried if explains(scaled.times(each))), None)
        if factor is not None:
            words = _words(factor)
            found[scaled.part, f"{scaled.name} {words}"] = freedoms > 1 or words in FACTORS.values()
    drift = float(violation_series(scene, bench.close).max())
    return None if not found and difference <= DRIFTED * drift * size else found


def _explains(scene: Scene, own: np.ndarray, most: float, terms: Terms) -> bool:
    """Return whether terms give the engine's accelerations, up to a distance."""
    return bool(np.linalg.norm(own - accelerations(scene, terms)) <= most)


def _factor(scene: Scene, scaled: Scaled, own: np.ndarray) -> float:
    """Return the factor of a term whose accelerations are nearest to the engine's, by Gauss–Newton steps."""
    factor = 1.0
    for _ in range(FITS):
        found = accelerations(scene, scaled.times(factor))
        slope = (accelerations(scene, scaled.times(factor + STEP)) - found) / STEP
        if not slope.any():
            return factor
        factor += float(slope @ (own - found) / (slope @ slope))
    return factor


def _words(factor: float) -> str:
    """Return how a term is changed by a factor."""
    named = (words for known, words in FACTORS.items() if abs(factor - known) < NEAR_FACTOR)
    return next(named, f"times {factor:.3g}")


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
