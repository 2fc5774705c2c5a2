"""Cost and bounds of the references of built-in scenes and of random mechanisms.

    python benchmarks/references.py [--random 200] [--duration 0.5] [--seconds 60]

Of each built-in scene and closed form of the conformance suite: steps of formulation A, CPU seconds of A, of
its twin and of B, the difference of A and B, the bound, and the true error where a closed form is known.
Of the random mechanisms of 3 to 8 bodies: the part with a bound of 1e-11 or less, and the median CPU seconds.
Nothing is taken from the cache.
"""

from __future__ import annotations

import argparse

import numpy as np

from crosscheck.conformance.closed_forms import CLOSED_FORMS
from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.judge.metrics import error_series
from crosscheck.judge.reference.bound import differences
from crosscheck.judge.reference.reference import Reference, judged, runs
from crosscheck.judge.truth import closed_form
from crosscheck.judge.truth.reference_truth import trajectory
from mbref.scene import Scene
from mbref.scenes import SCENES

TIGHT = 1e-11
SAMPLES = 21


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--random", type=int, default=200, help="how many random mechanisms")
    parser.add_argument("--duration", type=float, default=0.5, help="of their motion, s")
    parser.add_argument("--seconds", type=float, default=60.0, help="of CPU time for each reference")
    asked = parser.parse_args()
    heads = "".join(f" {head:>7}" for head in ("A", "twin", "B", "A - B", "bound", "error"))
    print(f"{'scene':28} {'s':>5} {'steps':>5}{heads}")
    for scene in [*(make() for make in SCENES.values()), *(make()[0] for make in CLOSED_FORMS)]:
        line(scene, scene.duration, asked.seconds)
    found = [line(random_mechanism(k), asked.duration, asked.seconds) for k in range(asked.random)]
    if found:
        bounds, seconds = np.array(found).T
        print(f"{len(found)} random mechanisms of {asked.duration:g} s: bound at most {TIGHT:g} in "
              f"{np.mean(bounds <= TIGHT):.1%}, median {np.median(seconds):.2f} CPU s")  # fmt: skip


def line(scene: Scene, duration: float, seconds: float) -> tuple[float, float]:
    """Print one scene's line; its bound (infinite without a reference) and its CPU seconds."""
    times = np.linspace(0.0, duration, SAMPLES)
    a, twin, b = runs(scene, times, seconds)
    found, reason = judged(scene, times, a, twin, b)
    apart = differences(scene, a, b).max(initial=0.0)
    cells = [f"{duration:5.3g} {a.steps:5d}", *(f"{run.seconds:7.2f}" for run in (a, twin, b))]
    cells += [f"{apart:7.0e}", f"{found.bound.max(initial=0.0):7.0e}", _error(scene, found)]
    early = "" if found.both.all() else f"  B to {b.reached:.4g} s: {b.reason}"
    print(f"{scene.name:28} {' '.join(cells)}{early}{'  no reference: ' * bool(reason)}{reason}", flush=True)
    return (np.inf if reason else float(found.bound.max())), found.seconds


def _error(scene: Scene, found: Reference) -> str:
    """The true error, where a closed form is known, and whether it is above the bound."""
    truth = closed_form(scene)
    if truth is None or not len(found.times):
        return " " * 7
    errors = error_series(scene, trajectory(scene, found), truth.poses(found.times))
    return f"{errors.max():7.0e}{' ABOVE THE BOUND' * bool((errors > found.bound).any())}"


if __name__ == "__main__":
    main()
