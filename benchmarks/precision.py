"""Single against double precision: ``python benchmarks/precision.py [HEADING …]`` for MJX and MuJoCo Warp.

Closed loops of `docs/results/closed-loops.md` move by RK4 with the stiffest documented closures, from 0 to
END s. The table has the largest error of MJX in double and in single precision and their difference, and the
error of MuJoCo in C and of MuJoCo Warp, which computes in single precision, and their difference. Code is
compiled first, for minutes. Everything runs on the processor.
"""

import argparse

import numpy as np

from crosscheck.closed_loops.mechanisms import DIFFICULTIES, Difficulty
from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import error_series
from crosscheck.judge.truth import truth_for
from mbref.motions.trajectory import Trajectory

END, STEP = 0.2, 1e-3  # s
FAST = {"singular": (0.06, 1e-4)}  # END and STEP of a mechanism that turns ten times as fast
PAIRS = (("mjx", "stock", "mjx", "stock, single"), ("mujoco", "stock", "warp", "stock"))
HEADINGS = ("four-bar", "redundant", "Bennett", "singular")


def row(column: Difficulty) -> list[str]:
    """Cells of a mechanism: for each pair both errors and the difference."""
    end, step = FAST.get(column.heading, (END, STEP))
    scene, times = column.make().with_(duration=end), np.linspace(0.0, end, 5)
    exact, cells = truth_for(scene).poses(times), []

    def moved(name: str, family: str) -> Trajectory:
        return engine(name).run(scene, times, Setting(family, {"step": step}))

    for double, of_double, single, of_single in PAIRS:
        runs = moved(double, of_double), moved(single, of_single)
        cells += [f"{error_series(scene, run, exact).max():.1e}" for run in runs]
        cells.append(f"{error_series(scene, *runs).max():.1e}")
    return [column.heading, f"{step:g}", *cells]


def main() -> None:
    """Print one row for each mechanism."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("heading", nargs="*", default=list(HEADINGS), metavar="HEADING")
    asked = parser.parse_args().heading
    if unknown := [name for name in asked if name not in HEADINGS]:
        parser.error(f"no mechanism {unknown[0]!r}; there are: {', '.join(HEADINGS)}")
    print("| mechanism | step (s) | MJX double | MJX single | apart | MuJoCo in C | Warp | apart |")
    print("| --- | --: | --: | --: | --: | --: | --: | --: |")
    for column in DIFFICULTIES:
        if column.heading in asked:
            print("| " + " | ".join(row(column)) + " |", flush=True)


if __name__ == "__main__":
    main()
