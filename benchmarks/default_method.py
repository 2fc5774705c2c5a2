"""Default method: the number of bodies from which on the sparse method costs less than `taylor`, on both
chains.

    python benchmarks/default_method.py [LOOPS …]

Milliseconds of stepping (medians of REPEATS interleaved runs) and errors against the exact motion, up to END:
the sparse method ends at the first singular position.  ``mbref.method.MOST_BODIES`` follows from the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import numpy as np

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref import Limits, simulate
from mbref.command_line import Parser
from mbref.method import SERIES_METHOD, SPARSE_METHOD
from mbref.scenes import find_scene

LOOPS, REPEATS, RTOL = (2, 5, 10, 15, 20, 30, 40), 5, 1e-8
END = {"four_bar_chain": 0.5, "slider_crank_chain": 0.02}  # s


def main(sizes: Sequence[int]) -> None:
    """Print a row for each chain and number of loops."""
    print(f"{'scene':26} {'bodies':>6} {'taylor':>9} {'error':>8} {'sparse':>9} {'error':>8}")
    for family, end in END.items():
        for loops in sizes:
            scene = find_scene(f"{family}[{loops}]")
            times, truth = np.linspace(0.0, end, 5), truth_for(scene)
            runs = [
                [
                    simulate(scene, method, times, Limits(rtol=RTOL))
                    for method in (SERIES_METHOD, SPARSE_METHOD)
                ]
                for _ in range(REPEATS)
            ]
            cells = []
            for of_method in zip(*runs, strict=True):
                last = of_method[-1]
                error = measure(scene, last, truth)["error"] if last.outcome.name == "COMPLETED" else None
                said = last.outcome.name[:8] if error is None else f"{error:8.1e}"
                cells.append(f"{1e3 * median(run.cost.seconds for run in of_method):9.3f} {said:>8}")
            print(f"{scene.name:26} {len(scene.body):6} {' '.join(cells)}", flush=True)


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("loops", nargs="*", type=int, metavar="LOOPS", help="numbers of loops")
    main(parser.parse_args().loops or LOOPS)
