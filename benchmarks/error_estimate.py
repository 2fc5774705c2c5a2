"""Estimated error of runs beside the true one: random mechanisms, sensitive motions, built-in scenes.

``python benchmarks/error_estimate.py [COUNT] [--first SEED]``, by default 500 random mechanisms of the seeds
from 0 on. Truth is crosscheck's: a closed form or a reference with a bound. Samples beyond the end of the
truth are left out. A run counts as underestimated if its true error minus the bound on the truth is more than
ten times the estimate. A run counts as overestimated if the estimate is more than a hundred times the sum of
the true error and the bound.
"""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from crosscheck.conformance.mechanisms.parts import GRAVITY, bar, hinge
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.metrics import error_series, exact_motion
from crosscheck.judge.truth import truth_for
from mbref import Limits, Scene, simulate, with_error_estimate
from mbref.command_line import Parser
from mbref.equations.counts import undriven_freedoms
from mbref.motions.trajectory import Trajectory
from mbref.scene import Spherical, Spring, Translational
from mbref.scenes import SCENES, find_scene

METHODS = ("taylor", "mpi-svd+projection", "mpi-svd+none")
SHOWN = (1e-3, 1e-6, 1e-9, 1e-12)  # tolerances in the table of sensitive motions
TOLERANCES = tuple(10.0**-digits for digits in range(3, 14))
SECONDS = 10.0  # of CPU time for a reference
DURATION, SAMPLES = 0.25, 11
UNDER, OVER = 10.0, 100.0


@dataclass(frozen=True)
class Case:
    """A run: the group of its scene, its true and its estimated largest error, and the truth's bound."""

    group: str
    scene: str
    method: str
    rtol: float
    outcome: str
    true: float
    bound: float
    estimate: float
    says: str

    @property
    def is_under(self) -> bool:
        """Return whether the estimate is less than a tenth of the true error."""
        return not self.true - self.bound <= UNDER * self.estimate

    @property
    def is_over(self) -> bool:
        """Return whether the estimate is more than a hundred times the true error."""
        return self.estimate > OVER * (self.true + self.bound)


def main(count: int, seed: int) -> None:
    """Run and print; the random mechanisms have ``count`` seeds from ``seed`` on."""
    console = Console(width=110)
    jobs = [*sensitive_jobs(), *built_in_jobs(), *random_jobs(range(seed, seed + count))]
    cases: list[Case] = []
    with contextlib.suppress(KeyboardInterrupt):  # after an interrupt the finished runs are printed
        for job in track(jobs, console=Console(stderr=True)):
            cases += run(*job)
    console.print(table(cases))
    for case in cases:
        if case.is_under or case.is_over:
            console.print(
                f"{case.scene}, {case.method}, rtol {case.rtol:.0e}: true {case.true:.1e}, bound "
                f"{case.bound:.0e}, estimate {case.estimate:.1e}"
            )
    sensitive = Table(
        "motion", "rtol", "true error", "estimate", "the run says", title="sensitive motions, taylor"
    )
    for case in cases:
        shown = any(math.isclose(case.rtol, rtol) for rtol in SHOWN)
        if case.group == "sensitive" and case.method == "taylor" and shown:
            sensitive.add_row(
                case.scene, f"{case.rtol:.0e}", f"{case.true:.0e}", f"{case.estimate:.0e}", case.says
            )
    console.print(sensitive)


Job = tuple[str, Scene, list[tuple[str, float]]]  # group, scene, methods and tolerances


def random_jobs(seeds: range) -> Iterator[Job]:
    """Return jobs of random mechanisms, each with two methods and tolerances chosen by its seed."""
    for seed in seeds:
        random = np.random.default_rng([seed, 1])
        others = [METHODS[0], str(random.choice(METHODS[1:]))]
        chosen = [(method, float(random.choice(TOLERANCES))) for method in others]
        yield "random", random_mechanism(seed).with_(duration=DURATION), chosen


def sensitive_jobs() -> Iterator[Job]:
    """Sensitive motions, by each method of projection and each tolerance."""
    sweep = [(method, rtol) for method in ("taylor", "mpi-svd+projection") for rtol in TOLERANCES]
    for scene in (
        pendulum_on_slider_crank(1.3),
        pendulum_on_slider_crank(2.1),
        pendulums(2, 3.0),
        pendulums(3, 2.0),
        ball_pendulums(),
        spring_pendulum(),
        pendulum_on_four_bar(),
    ):
        yield "sensitive", scene, sweep


def built_in_jobs() -> Iterator[Job]:
    """Built-in scenes for up to a second, by ``taylor`` at each tolerance."""
    for name in SCENES:
        scene = find_scene(name)
        if scene.has_mass() or undriven_freedoms(scene) == 0:
            scene = scene.with_(duration=min(1.0, scene.duration))
            yield "built-in", scene, [("taylor", rtol) for rtol in TOLERANCES]


def run(group: str, scene: Scene, chosen: list[tuple[str, float]]) -> Iterator[Case]:
    """Yield the runs of a scene that have a known error."""
    times = np.linspace(0.0, scene.duration, SAMPLES)
    truth = truth_for(scene, SECONDS)
    for method, rtol in chosen:
        motion = simulate(scene, method, times, Limits(rtol=rtol))
        exact = exact_motion(scene, motion, truth) if motion.times.size else None
        if exact is None or truth is None or len(exact.times) < 2:
            continue
        estimate = with_error_estimate(motion).error_estimate
        known = len(exact.times)
        true = float(error_series(scene, first(motion, known), exact).max())
        bound = float(np.max(exact.settings.get("bound", truth.accuracy)))
        found = float(np.max(estimate.error[:known]))
        yield Case(
            group,
            scene.name,
            method,
            rtol,
            motion.outcome.name,
            true,
            bound,
            found,
            estimate.warning or estimate.sentence,
        )


def first(motion: Trajectory, count: int) -> Trajectory:
    """Return the poses of the first samples."""
    fields = ("position", "orientation", "velocity", "angular_velocity")
    arrays = {field: getattr(motion, field)[:count] for field in fields}
    return Trajectory(
        motion.scene,
        motion.engine,
        motion.version,
        motion.method,
        {},
        motion.times[:count],
        motion.bodies,
        **arrays,
    )


def table(cases: list[Case]) -> Table:
    """Return the calibration by group and method."""
    found = Table(
        "mechanisms", "method", "runs", "true ≤ 10 × estimate", "estimate ≤ 100 × true", "estimate / true"
    )
    keys = sorted({(case.group, case.method) for case in cases})
    for group, method in [*keys, ("all", "")]:
        chosen = [c for c in cases if group == "all" or (c.group, c.method) == (group, method)]
        known = [
            c.estimate / c.true for c in chosen if c.true > UNDER * c.bound and not math.isnan(c.estimate)
        ]
        low, middle, high = np.quantile(known, [0.01, 0.5, 0.9]) if known else [math.nan] * 3
        found.add_row(
            group,
            method,
            str(len(chosen)),
            share(sum(not case.is_under for case in chosen), len(chosen)),
            share(sum(not case.is_over for case in chosen), len(chosen)),
            f"{low:.2g} … {middle:.2g} … {high:.2g}",
        )
    return found


def share(part: int, whole: int) -> str:
    """Return a number of runs and its percentage."""
    return f"{part} ({100 * part / whole:.1f} %)"


def pendulums(count: int, duration: float) -> Scene:
    """A chain of rods, released from a horizontal line bent by 0.3 rad at each hinge."""
    angles = [0.3 * k for k in range(count)]
    steps = [np.array([math.cos(a), math.sin(a), 0.0]) * 0.4 for a in angles]
    places = [np.zeros(3), *np.cumsum(steps, axis=0)]
    names = ["ground", *(f"rod{k}" for k in range(count))]
    rods = [bar(n, p, q) for n, p, q in zip(names[1:], places[:-1], places[1:], strict=True)]
    hinges = [hinge(f"P{k}", names[k], names[k + 1], places[k]) for k in range(count)]
    return Scene(
        name=f"{count} pendulums", gravity=GRAVITY, duration=duration, body=tuple(rods), joint=tuple(hinges)
    )


def ball_pendulums() -> Scene:
    """Two rods on ball joints, released out of a plane."""
    chain = pendulums(2, 2.5)
    first, second = chain.body
    balls = tuple(Spherical(name=j.name, bodies=j.bodies, anchor=j.anchor) for j in chain.joint)
    moving = second.model_copy(update={"velocity": (0.0, 0.0, 1.0), "angular_velocity": (0.0, -3.0, 0.5)})
    return chain.with_(name="2 ball pendulums", body=(first, moving), joint=balls)


def spring_pendulum() -> Scene:
    """Return a rod on a hinge, with a second body connected to its end by a spring."""
    chain = pendulums(1, 3.0)
    weight = bar("weight", (0.9, 0.1, 0.0), (1.1, 0.1, 0.0), 0.5)
    spring = Spring(
        bodies=("rod0", "weight"),
        points=((0.4, 0.0, 0.0), (0.9, 0.1, 0.0)),
        stiffness=60.0,
        damping=0.0,
        natural_length=0.3,
    )
    return chain.with_(name="spring pendulum", body=(*chain.body, weight), load=(spring,))


def pendulum_on_slider_crank(rate: float) -> Scene:
    """A slider-crank of equal bars that passes singular positions, and a pendulum on its slider."""
    b, c = (0.3, -0.25, 0.0), (0.6, 0.0, 0.0)
    crank, rod = bar("crank", (0.0, 0.0, 0.0), b), bar("rod", b, c, 0.3)
    slider, pendulum = (
        bar("slider", (0.55, 0.0, 0.0), (0.65, 0.0, 0.0), 1.2),
        bar("pendulum", c, (0.4, 0.2, 0.0), 0.5),
    )
    spin = (0.0, 0.0, -5.0 * rate)
    moving = crank.model_copy(
        update={"angular_velocity": spin, "velocity": tuple(np.cross(spin, crank.position).tolist())}
    )
    guide = Translational(name="D", bodies=("ground", "slider"), anchor=c, axis=(1.0, 0.0, 0.0))
    hinges = (
        hinge("A", "ground", "crank", (0.0, 0.0, 0.0)),
        hinge("B", "crank", "rod", b),
        hinge("C", "rod", "slider", c),
        hinge("P", "slider", "pendulum", c),
    )
    return Scene(
        name=f"pendulum on slider-crank, {rate:g}",
        gravity=GRAVITY,
        duration=1.5,
        body=(moving, rod, slider, pendulum),
        joint=(*hinges, guide),
    )


def pendulum_on_four_bar() -> Scene:
    """A rhombus that passes its flat positions, and a pendulum on its coupler."""
    a, b, c, d = (0.0, 0.0, 0.0), (0.3, 0.4, 0.0), (0.8, 0.4, 0.0), (0.5, 0.0, 0.0)
    spin = (0.0, 0.0, 6.0)
    crank = bar("crank", a, b)
    moving = crank.model_copy(
        update={"angular_velocity": spin, "velocity": tuple(np.cross(spin, crank.position).tolist())}
    )
    bodies = (moving, bar("coupler", b, c), bar("rocker", d, c), bar("pendulum", c, (0.9, 0.1, 0.0), 0.5))
    hinges = (
        hinge("A", "ground", "crank", a),
        hinge("B", "crank", "coupler", b),
        hinge("C", "coupler", "rocker", c),
        hinge("D", "ground", "rocker", d),
        hinge("P", "coupler", "pendulum", c),
    )
    return Scene(name="pendulum on four-bar", gravity=GRAVITY, duration=2.0, body=bodies, joint=hinges)


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=500, help="random mechanisms; default: 500")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="seed of the first; default: 0")
    given = parser.parse_args()
    main(given.count, given.first)
