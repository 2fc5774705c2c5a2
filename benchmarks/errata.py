"""How far published reference values are from the reference, digit by digit: `python benchmarks/errata.py`.

Two formulations compute each motion in extended precision.  "Ours agree" tells in how many digits they agree
with each other, "published agrees" in how many the printed value agrees with the first of them.
"""

from __future__ import annotations

import math

from crosscheck.judge.published import PUBLISHED
from crosscheck.judge.reference.arithmetic import EXTENDED
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref.scenes import find_scene

SECONDS = 600.0  # CPU, at most, for each motion


def agreement(a: float, b: float) -> float:
    """Decimal digits in which two numbers agree; at most those of a double."""
    return min(16.0, -math.log10(abs(a - b) / abs(b))) if a != b else 16.0


def main() -> None:
    """Print a table for every problem with printed values."""
    for name, problem in PUBLISHED.items():
        if not problem.values:
            continue
        scene = find_scene(problem.scene)
        motions = [
            f(scene, problem.times(), EXTENDED, seconds=SECONDS) for f in (natural_motion, tree_motion)
        ]
        print(f"\n## {name}: `{problem.scene}` at {problem.time:g} s\n\nPublished: {problem.source}.\n")
        for motion in motions:
            if motion.reason:
                print(f"One formulation ends at {motion.reached:.6g} s: {motion.reason}.\n")
        complete = [problem.observe(scene, motion) for motion in motions if not motion.reason]
        if not complete:
            continue
        print("| value | published | ours | ours agree | published agrees |\n|---|--:|--:|--:|--:|")
        for key, printed in problem.values.items():
            ours = [found[key] for found in complete]
            own = f"{agreement(ours[1], ours[0]):.1f}" if len(ours) > 1 else "-"
            print(f"| {key} | {printed:.16g} | {ours[0]:.16g} | {own} | {agreement(printed, ours[0]):.1f} |")


if __name__ == "__main__":
    main()
