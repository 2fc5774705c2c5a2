"""How far published reference values are from the reference, digit by digit: `python benchmarks/errata.py`.

If a certified table reaches the time of the values, our values are read from the table; if not, they are
computed by formulation A in extended precision.  "Ours agree" is the number of digits in which formulations A
and B, both in extended precision, agree with our values; "published agrees" is the number of digits in which
the printed value agrees.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import EXTENDED
from crosscheck.judge.published import PUBLISHED, Published
from crosscheck.judge.reference import certify
from crosscheck.judge.reference.motion import Motion
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref.scenes import find_scene

SECONDS = 600.0  # CPU, at most, for each motion
FORMULATIONS = {"A": natural_motion, "B": tree_motion}
KEPT = ("position", "orientation", "velocity", "angular_velocity")


def agreement(a: float, b: float) -> float:
    """Return the number of decimal digits in which two numbers agree, at most the digits of a double."""
    return min(16.0, -math.log10(abs(a - b) / abs(b))) if a != b else 16.0


def main() -> None:
    """Print a table for every problem with printed values."""
    for name, problem in PUBLISHED.items():
        if problem.values:
            print(f"\n## {name}: `{problem.scene}` at {problem.time:g} s\n\nPublished: {problem.source}.\n")
            print("\n".join(rows(problem)))


def rows(problem: Published) -> list[str]:
    """Return the table of one problem, and the motions from which the table was computed."""
    scene, times = find_scene(problem.scene), problem.times()
    motions = {name: f(scene, times, EXTENDED, seconds=SECONDS) for name, f in FORMULATIONS.items()}
    table = certified(problem)
    ours = motions["A"] if table is None else at_the_end(motions["A"], table)
    values = problem.observe(scene, ours)
    compared = {n: problem.observe(scene, m) for n, m in motions.items() if not m.reason and m is not ours}
    header = (
        f"| value | published | ours | {' | '.join(f'{n} agrees' for n in compared)} | published agrees |"
    )
    lines = [basis(table, motions), header, f"|---|--:|--:|{'--:|' * len(compared)}--:|"]
    for key, printed in problem.values.items():
        digits = [agreement(found[key], values[key]) for found in (*compared.values(), problem.values)]
        cells = [key, f"{printed!r}", f"{values[key]:.16g}", *(f"{d:.1f}" for d in digits)]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def basis(table: dict[str, Any] | None, motions: dict[str, Motion]) -> str:
    """Return a paragraph on the origin of our values, and on the formulation that ended before."""
    said = ["Ours: formulation A in extended precision."]
    if table is not None:
        version, bounds = table["version"], (table["bound"], table["rate_bound"])
        said = [
            f"Ours: version {version} of the certified table; the bound on errors of positions is "
            f"{bounds[0]}, of velocities {bounds[1]}."
        ]
    said += [f"{name} ends at {m.reached:.6g} s: {m.reason}." for name, m in motions.items() if m.reason]
    return " ".join(said) + "\n"


def certified(problem: Published) -> dict[str, Any] | None:
    """Return the certified table of a problem's scene if the table reaches the time of the printed values."""
    path = certify.FOLDER / f"{problem.scene}.json"
    table: dict[str, Any] = json.loads(path.read_text())
    return table if table["times"][-1] == problem.time else None


def at_the_end(motion: Motion, table: dict[str, Any]) -> Motion:
    """A motion whose last sample is a table's; the samples before count the turns."""
    last = {name: np.array(table[name][-1], dtype=EXTENDED.dtype) for name in KEPT}
    side = np.where((last["orientation"] * motion.orientation[-1]).sum(axis=-1) < 0, -1, 1)
    last["orientation"] = last["orientation"] * side[:, None]
    arrays = {name: np.concatenate([getattr(motion, name)[:-1], last[name][None]]) for name in KEPT}
    return replace(motion, **arrays)


if __name__ == "__main__":
    main()
