"""Cost at errors of 1e-3, 1e-6 and 1e-9: other families over the Taylor method with generated code.

    python benchmarks/taylor.py [SCENE …]

Each family is swept over half-decades of the tolerance; then the runs nearest to the levels take turns in
ROUNDS rounds of this process.  Process CPU seconds of stepping, medians; samples count, construction and the
making of generated code do not.  Above 1 the Taylor method is the cheaper.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - before NumPy

# isort: split
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from crosscheck.judge.metrics import cost_at_error, measure
from crosscheck.judge.tolerances import ERROR_LEVELS
from crosscheck.judge.truth import truth_for
from mbref.command_line import Parser
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate

FAMILIES = (
    ("taylor", "generated"),
    ("taylor", "generic"),
    ("lm2+projection", "generic"),
    ("alf-dual+projection", "generic"),
)
NAMES = (
    "planar_slider_crank",
    "spatial_slider_crank",
    "planar_slider_crank_gravity",
    "spatial_slider_crank_gravity",
    "four_bar_gravity",
    "five_bar_gravity",
)
TOLERANCES = 10.0 ** np.arange(-2.0, -14.1, -0.5)
SAMPLES, ROUNDS, BRIEF, MOST_TIMES = 11, 9, 5e-3, 10
FINEST = min(ERROR_LEVELS)


@dataclass
class Point:
    """A tolerance of a family: the error it reaches, and its seconds in all rounds."""

    rtol: float
    error: float
    seconds: list[float] = field(default_factory=list)


def run(scene: Scene, family: tuple[str, str], rtol: float):
    """One run, sampled at equal distances."""
    method, code = family
    times = np.linspace(0.0, scene.duration, SAMPLES)
    return simulate(scene, method, times, Limits(rtol=rtol, code=code))


def curve(scene: Scene, family: tuple[str, str]) -> list[Point]:
    """The completed runs next to the levels of error."""
    truth, points = truth_for(scene), []
    for rtol in map(float, TOLERANCES):
        motion = run(scene, family, rtol)
        if motion.outcome is not Outcome.COMPLETED:
            continue
        points.append(Point(rtol, float(measure(scene, motion, truth)["error"])))
        if points[-1].error < FINEST:
            break
    return [p for p in points if any(_is_next(p, points, level) for level in ERROR_LEVELS)]


def _is_next(point: Point, points: Sequence[Point], level: float) -> bool:
    """Whether a run is the least accurate below a level or the most accurate above it."""
    below, above = ([p.error for p in points if (p.error <= level) is side] for side in (True, False))
    return point.error in (max(below, default=0.0), min(above, default=0.0))


def costs(scene: Scene) -> dict[tuple[str, str], list[float]]:
    """Seconds of each family at each level of error."""
    curves = {family: curve(scene, family) for family in FAMILIES}
    for _ in range(ROUNDS):
        for family, points in curves.items():
            for point in points:
                first = run(scene, family, point.rtol).cost.seconds
                more = range(min(MOST_TIMES, int(BRIEF / first)))
                point.seconds += [first, *(run(scene, family, point.rtol).cost.seconds for _ in more)]
    return {
        family: [
            cost_at_error([median(p.seconds) for p in points], [p.error for p in points], level) or np.nan
            for level in ERROR_LEVELS
        ]
        for family, points in curves.items()
    }


def main(names: Sequence[str]) -> None:
    """Measure and print."""
    heading = "".join(f"{level:>9.0e}" for level in ERROR_LEVELS)
    print(f"{'':30}" + "".join(f"{method + ', ' + code:>34}" for method, code in FAMILIES[1:]))
    print(f"{'':30}" + "".join(f"{heading:>34}" for _ in FAMILIES[1:]))
    for name in names:
        found = costs(SCENES[name]())
        taylor = found[FAMILIES[0]]
        ratios = (
            "".join(f"{c / t:9.2f}" for c, t in zip(found[f], taylor, strict=True)) for f in FAMILIES[1:]
        )
        print(f"{name:30}" + "".join(f"{ratio:>34}" for ratio in ratios), flush=True)


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: six scenes")
    main(parser.parse_args().scenes or NAMES)
