"""Cost and bounds of reference solutions of built-in scenes and random mechanisms, compared with more
accurate runs.

    python benchmarks/references.py [NAME …] [--random 200] [--duration 0.5] [--seconds 60] [--tight 120]
                                    [--records F]

Of each scene: CPU seconds of formulation A, of the twin, which is a second run of A, or of B where A had no
time left, and of B, the difference of A and B, the bound, the true error where a closed form is known, and
elsewhere the difference of a tighter run: formulation A in DIGITS decimal digits, with other rows where some
are redundant.  "ABOVE" marks an error or a difference above the bound.  Nothing is taken from the cache of
references; with --records, lines that the same code made are taken from the file, and the command goes on
where it was interrupted.
"""

from __future__ import annotations

import argparse
import hashlib
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

import mbref
from crosscheck.conformance.mechanisms.awkward import AWKWARD, awkward
from crosscheck.conformance.mechanisms.closed_forms import CLOSED_FORMS
from crosscheck.conformance.mechanisms.hard import HARD
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.arithmetic import EXTENDED, many_digits
from crosscheck.judge.metrics import error_series
from crosscheck.judge.reference import cache
from crosscheck.judge.reference.bound import differences
from crosscheck.judge.reference.motion import Motion
from crosscheck.judge.reference.reference import Reference, judged, runs
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.truth import closed_form
from crosscheck.judge.truth.reference_truth import trajectory
from mbref.records import append, opened
from mbref.scene import Scene, TorsionSpring
from mbref.scenes import SCENES

TIGHT = 1e-11
SAMPLES = 21
DIGITS, TOLERANCE, ORDER, OTHER_ROWS = 26, 1e-22, 30, 2  # of the tighter run
COLUMNS = ("scene", "s", "A", "twin", "B", "A − B", "bound", "error", "tighter", "remark")
Line = dict[str, Any]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("name", nargs="*", metavar="NAME", help="only these built-in scenes")
    parser.add_argument("--random", type=int, default=200, help="how many random mechanisms")
    parser.add_argument("--first", type=int, default=0, help="the seed of the first of them")
    parser.add_argument("--duration", type=float, default=0.5, help="of their motion, s")
    parser.add_argument("--seconds", type=float, default=60.0, help="of CPU time for each reference")
    parser.add_argument(
        "--tight", type=float, default=120.0, help="of CPU time for each tighter run; 0: none"
    )
    parser.add_argument(
        "--every", type=int, default=1, help="tighter runs of one random mechanism in so many"
    )
    parser.add_argument("--records", metavar="FILE", help="keep the lines and go on from them")
    parser.add_argument("--only-random", action="store_true", help="leave the built-in scenes out")
    parser.add_argument("--hard", action="store_true", help="hard mechanisms instead of the built-in scenes")
    parser.add_argument("--awkward", type=int, metavar="N", help="N mechanisms of each awkward kind instead")
    asked = parser.parse_args()
    built_in = [*(make() for make in SCENES.values()), *(make()[0] for make in CLOSED_FORMS)]
    if asked.hard:
        built_in = [make() for make in HARD.values()]
    if asked.awkward:
        built_in = [awkward(kind, seed) for kind in AWKWARD for seed in range(asked.awkward)]
    built_in = [scene for scene in built_in if not asked.name or scene.name in asked.name]
    print(f"| {' | '.join(COLUMNS)} |\n| --- {'| --: ' * (len(COLUMNS) - 2)}| --- |")
    for scene in () if asked.only_random else built_in:
        line(scene, scene.duration, asked.seconds, asked.tight, asked.records)
    found = []
    for seed in range(asked.first, asked.first + asked.random):
        tight = 0.0 if seed % asked.every else asked.tight
        scene = with_torsion_spring(random_mechanism(seed))
        found.append(line(scene, asked.duration, asked.seconds, tight, asked.records))
    if found:
        print("\n".join(summary(found, asked.duration)))


def line(scene: Scene, duration: float, seconds: float, tight: float, records: str | None) -> Line:
    """Print the line of one scene, computed now or read from a file of records."""
    made_of = [cache.version(), cache.canonical(scene), duration, seconds, DIGITS, TOLERANCE]
    key = hashlib.sha256(repr(made_of).encode()).hexdigest()
    found = opened(records).get(key)
    if found is None or found["tight"] < tight:
        found = {"key": key, "tight": tight, **examined(scene, duration, seconds, tight)}
        append(records, found)
    print(text(found), flush=True)
    return found


def examined(scene: Scene, duration: float, seconds: float, tight: float) -> Line:
    """Return the numbers of one scene; None if the scene has no reference."""
    times = np.linspace(0.0, duration, SAMPLES)
    motions = one, _, other = runs(scene, times, seconds)
    found, reason = judged(scene, times, *motions)
    tighter = _tighter(scene, found.times, tight)
    apart = [] if tighter is None else differences(scene, one, tighter)[: len(found.times)]
    return {
        "scene": scene.name,
        "duration": duration,
        "bodies": len(scene.body),
        "joints": dict(Counter(joint.type for joint in scene.joint)),
        "loads": dict(Counter(load.type for load in scene.load)),
        "redundant": mbref.counts(scene).redundant,
        "by": [motion.formulation for motion in motions],
        "seconds": [motion.seconds for motion in motions],
        "apart": largest(differences(scene, one, other)),
        "bound": None if reason else largest(found.bound),
        "reason": reason,
        "other_to": None if found.both.all() else other.reached,
        "other_reason": other.reason,
        "error": _compared(_error(scene, found), found),
        "tighter": _compared(apart, found),
        "tighter_reason": "" if tighter is None else tighter.reason,
    }


def _tighter(scene: Scene, times: np.ndarray, seconds: float) -> Motion | None:
    """Return the motion by formulation A in more digits; None if it is not requested, or if a closed form is
    known."""
    if not seconds or closed_form(scene) is not None:
        return None
    motion = natural_motion(
        scene, times, many_digits(DIGITS), order=ORDER, tolerance=TOLERANCE, seconds=seconds, seed=OTHER_ROWS
    )
    return replace(motion, position=_rounded(motion.position), orientation=_rounded(motion.orientation))


def _rounded(values: np.ndarray) -> np.ndarray:
    """Numbers of many digits as the nearest of extended precision."""
    texts = [x.str(DIGITS, radius=False) for x in values.ravel()]
    return np.array([EXTENDED.dtype(text) for text in texts], dtype=EXTENDED.dtype).reshape(values.shape)


def _error(scene: Scene, found: Reference) -> np.ndarray:
    """True errors (k,), where a closed form is known."""
    truth = closed_form(scene)
    if truth is None or not len(found.times):
        return np.zeros(0)
    return error_series(scene, trajectory(scene, found), truth.poses(found.times))


def _compared(errors: Any, found: Reference) -> dict[str, Any] | None:
    """Return the largest of some errors, the largest ratio of an error to its bound, and the time (s) up to
    which errors are known."""
    if not len(errors):
        return None
    k = len(errors)
    parts = np.asarray(errors) / found.bound[:k]
    return {"largest": largest(errors), "part": largest(parts), "until": float(found.times[k - 1])}


def largest(values: Any) -> float:
    """The largest; 0 of none."""
    return float(np.max(values, initial=0.0))


def text(found: Line) -> str:
    """Return one row of the table."""
    by, other, seconds = found["by"], found["by"][-1], [f"{s:.2f}" for s in found["seconds"]]
    if by == ["B", "B", "A"]:
        seconds = [seconds[2], seconds[1], seconds[0]]
    cells = [found["scene"], f"{found['duration']:.3g}", *seconds]
    bound = "none" if found["bound"] is None else f"{found['bound']:.0e}"
    cells += [f"{found['apart']:.0e}", bound, _cell(found["error"]), _cell(found["tighter"])]
    remarks = [f"{other} to {found['other_to']:.4g} s"] if found["other_to"] is not None else []
    remarks += ["twin by B"] if by == ["B", "B", "A"] else []
    reasons = {"no reference": found["reason"], "tighter run": found["tighter_reason"]}
    remarks += [f"{what}: {reason}" for what, reason in reasons.items() if reason]
    return f"| {' | '.join(cells)} | {'; '.join(remarks)} |"


def _cell(compared: dict[str, Any] | None) -> str:
    return "" if compared is None else f"{compared['largest']:.0e}{' ABOVE' * (compared['part'] > 1)}"


def with_torsion_spring(scene: Scene) -> Scene:
    """Return the scene with a torsion spring on the first joint that can have one."""
    for joint in scene.joint:
        if "angle" in joint.facts.loaded:
            spring = TorsionSpring(joint=joint.name, stiffness=5.0, damping=0.1, natural_angle=0.3)
            return scene.with_(load=(*scene.load, spring))
    return scene


def summary(found: list[Line], duration: float) -> list[str]:
    """The sums of the lines of random mechanisms."""
    bodies, redundant = [f["bodies"] for f in found], sum(f["redundant"] > 0 for f in found)
    bounds = np.array([np.inf if f["bound"] is None else f["bound"] for f in found])
    seconds = [sum(f["seconds"]) for f in found]
    tight = [f["tighter"] for f in found if f["tighter"] is not None]
    whole = sum(t["until"] == duration for t in tight)
    apart, part = (largest([t[name] for t in tight]) for name in ("largest", "part"))
    above = sum(t["part"] > 1 for t in tight)
    return [
        "",
        f"{len(found)} random mechanisms of {min(bodies)} to {max(bodies)} bodies over {duration:g} s, "
        f"{redundant} with redundant rows.",
        f"Joints: {_counted(found, 'joints')}. Loads: {_counted(found, 'loads')}.",
        f"With a reference: {np.isfinite(bounds).sum()}; its bound is at most {TIGHT:g} in "
        f"{np.mean(bounds <= TIGHT):.1%}, the largest {bounds[np.isfinite(bounds)].max(initial=0.0):.0e}.",
        f"CPU seconds of the three runs: median {np.median(seconds):.2f}, largest {max(seconds):.0f}.",
        f"Tighter runs: {len(tight)}, {whole} of them to the end; their differences are at most {apart:.0e}, "
        f"and at most {part:.2g} of the bound; {above} are above it.",
    ]


def _counted(found: list[Line], what: str) -> str:
    """Return the number of entries of each type, the most frequent type first."""
    total = sum((Counter(f[what]) for f in found), Counter())
    return ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in total.most_common())


if __name__ == "__main__":
    main()
