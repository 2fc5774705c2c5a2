"""Errors of LM2 with stabilisations on the mechanism of Table IV: ``python benchmarks/partitioning.py``.

The spatial slider-crank with a flywheel, under 100 N m from rest, over 4 s. Errors are the largest
differences of positions from `taylor` at a tolerance of 1e-13, over the scene's length, or of orientations in
rad.
"""

from __future__ import annotations

import argparse

import numpy as np

import mbref
from crosscheck.judge.metrics import error_series
from crosscheck.paper.runs import teaching_scene
from mbref import Limits

STABILISATIONS = ("none", "partitioning", "projection")
STEPS = ("4e-3", "2e-3", "1e-3")  # s, of rk4
RTOLS = (1e-4, 1e-6, 1e-8)  # of dop853
KEPT = (0.1, 0.3, 0.6, 0.9)  # shares of a pivot below which other coordinates are chosen


def main() -> None:
    """Print errors by equal steps and by tolerances, then by the share at which coordinates change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--end", type=float, default=4.0, help="end time, s")
    scene, times = teaching_scene(), np.linspace(0.0, parser.parse_args().end, 41)
    exact = mbref.simulate(scene, "taylor", times, rtol=1e-13)

    def cell(method: str, rtol: float = 1e-9) -> str:
        motion = mbref.simulate(scene, method, times, Limits(rtol=rtol))
        if len(motion.times) < len(times):
            return motion.outcome.label
        return f"{error_series(scene, motion, exact).max():.1e} ({motion.cost.steps} steps)"

    print("| integrator | " + " | ".join(STABILISATIONS) + " |\n|---|" + "--:|" * len(STABILISATIONS))
    runs = [(f"rk4[step={step}]", 1e-9) for step in STEPS] + [("dop853", rtol) for rtol in RTOLS]
    for integrator, rtol in runs:
        cells = [cell(f"lm2+{name}/{integrator}", rtol) for name in STABILISATIONS]
        name = integrator if integrator != "dop853" else f"dop853, rtol {rtol:g}"
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    print("\n| kept | " + " | ".join(map(str, KEPT)) + " |\n|---|" + "--:|" * len(KEPT))
    for integrator, rtol in (("rk4[step=2e-3]", 1e-9), ("dop853", 1e-6)):
        cells = [cell(f"lm2+partitioning[kept={share}]/{integrator}", rtol) for share in KEPT]
        print(f"| {integrator} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
