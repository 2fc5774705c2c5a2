"""Beside the paper's tables: singular positions explained, every pair of methods, ALF against its dual."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from crosscheck.judge.truth import truth_for
from crosscheck.paper import runs, settings, singular
from crosscheck.paper.cells import SPATIAL
from crosscheck.paper.runs import ALPHAS, DUAL, EXACT, PENALTY, Label, Records
from mbref.formulations import FORMULATIONS
from mbref.scenes import SCENES
from mbref.scenes.four_bar import four_bar
from mbref.stabilisation import STABILISATIONS
from reports import figures
from reports.blocks import Block, Figure, Heading, Table, Text
from reports.runs import Run, number, power

TURNED = 0.1  # rad
DISTANCES, GAMMA_ERRORS = (1.0, 0.3, 0.1, 0.03, 0.01, 0.001), (0.0, 1e-10, 1e-8, 1e-6)
SMALLEST = 1e-17  # magnitudes below are drawn here


def explained() -> list[Block]:
    """Why the failure times of Table I are what they are, from the joint equations alone."""
    on_fold = {theta: singular.fold_residual(theta, -TURNED) for theta in (0.0, math.pi)}
    rows = []
    for start, theta0 in (("nπ", math.pi), ("π/4", math.pi / 4), ("π/2", math.pi / 2)):
        for t, k in singular.crossings(theta0, 0.06):
            if t > 0:
                [values] = singular.scaled_singular_values(four_bar(theta0), np.array([t]))
                parity = "meets the driven branch" if k % 2 else "is closed to it"
                rows.append((start, f"{t:.4f}", singular.turns(k), str(singular.rank(values)),
                             power(values[-1]), parity))  # fmt: skip
    header = ("Start θ₂", "t (s)", "θ₂", "Rank of 19 rows", "Smallest singular value", "The fold")
    text = (
        "Of the rhombus the Jacobian (rows of unit length, angular columns divided by the largest distance) "
        "has rank 18 along the motion and 17 at every θ₂ = kπ, where all links lie on one line and a second "
        "branch, the fold, crosses the parallelogram. "
        f"Driven {TURNED:g} rad further along the fold, the joint equations and the driver are violated by "
        f"{power(on_fold[math.pi])} from θ₂ = π: coupler and crank turn together about A, the rocker rests, "
        f"the driver is content, and a run can leave the true branch. From θ₂ = 0 they are violated by "
        f"{number(on_fold[0.0])} rad: there the fold needs the crank at rest, and so it is closed. "
        "So from π/4, π/2 and nπ the first position at which a driven linkage can leave the branch comes at "
        "0.0315, 0.0378 and 0.0503 s: the paper's 0.031, 0.037 and 0.050 s (Table I, MPI)."
    )
    return [
        Heading("Singular positions explained"),
        Text(text),
        Table("The crossings up to 0.06 s.", header, rows, right=frozenset({1, 3, 4})),
        Figure("paper-singular-values", "The smallest and the next smallest singular value of the scaled "
               "Jacobian over one revolution of the rhombus. At θ₂ = kπ one of them vanishes, linearly with "
               "the distance; accelerations found from it carry errors divided by it.", plot_values),
        _alf_near_a_crossing(),
    ]  # fmt: skip


def _alf_near_a_crossing() -> Table:
    """Why ALF ends at the first crossing, whatever branches meet there, and at a singular start."""
    rows = [
        (f"{distance:g}", *(_count(singular.alf_iterations(distance, error)) for error in GAMMA_ERRORS))
        for distance in DISTANCES
    ]
    caption = (
        "Iterations of ALF, as set for the tables, over the distance (rad) to θ₂ = 0 and over the error of γ "
        "in the direction that vanishes there, relative to γ. An iteration leaves 1 / (1 + α σ²) of what "
        "errors, rounding among them, put into it, which near a crossing is nearly all: ALF ends where the "
        f"{settings.ALF['iterations']} allowed do not suffice, and with its first step from θ₂ = nπ."
    )
    header = ("Distance", *(f"γ off by {error:g}" for error in GAMMA_ERRORS))
    return Table(caption, header, rows, right=frozenset(range(len(header))))


def _count(iterations: int) -> str:
    return f"{iterations}" if iterations < singular.MOST else f"> {singular.MOST}"


def plot_values() -> Drawing:
    """The two smallest singular values over one revolution."""
    turn = np.linspace(0.0, 2 * math.pi, 401)
    values = singular.scaled_singular_values(four_bar(math.pi / 2), turn / singular.CRANK_RATE)
    drawing, (axes,) = figures.canvas(7.2, 3.4)
    theta = (math.pi / 2 - turn) / math.pi
    for i, name in ((-1, "smallest"), (-2, "next")):
        axes.plot(theta, np.maximum(values[:, i], SMALLEST), color=figures.COLOURS[-1 - i], label=name)
    axes.set(yscale="log", xlabel="θ₂ / π", ylabel="singular value", ylim=(1e-4, 2))
    axes.invert_xaxis()
    figures.legend_below(drawing, axes)
    return drawing


def render(records: Records) -> list[Block]:
    """The table of pairs and the digits of ALF and its dual."""
    return [*_pairs(records), *_digits(records)]


def _pairs(records: Records) -> list[Block]:
    rows = []
    for formulation in FORMULATIONS:
        for stabilisation in STABILISATIONS:
            run = Run(records[Label("pairs", formulation, stabilisation)])
            ended = (
                "20 s" if run.completed else f"{run.t_end:.4g} s {run.outcome.letter or run.outcome.label}"
            )
            steps = run.record["cost"]["steps"] / run.t_end if run.t_end > 0 else math.nan
            seconds = run.seconds / run.t_end if run.t_end > 0 else math.nan
            rows.append((
                formulation, stabilisation, ended, power(run.error), power(run.metric("violation_position")),
                number(steps, 4), f"{1e3 * seconds:.3g}" if math.isfinite(seconds) else "–",
            ))  # fmt: skip
    partitioned = [Run(records[Label("pairs", f, "partitioning")]) for f in FORMULATIONS]
    violations = [run.metric("violation_position") for run in partitioned]
    caption = (
        f"The {SPATIAL}, 20 s at the settings above. With partitioning "
        f"{sum(run.completed for run in partitioned)} of {len(partitioned)} formulations complete, with "
        f"violations up to {power(max(violations))}. Every acceleration here follows from the driver, so "
        "with partitioning nothing is integrated and steps are as long as allowed."
    )
    header = ("Formulation", "Stabilisation", "Ended", "Error", "Violation", "Steps/s", "ms CPU per s")
    return [
        Heading("Every formulation with every stabilisation"),
        Table(caption, header, rows, right=frozenset({3, 4, 5, 6})),
    ]


def digit_errors(records: Records) -> dict[str, list[float]]:
    """Relative error of the accelerations at t = 0 by method, over ALPHAS; NaN without convergence."""
    return {
        name: [_relative_error(Run(records[Label("digits", name, f"{a:g}")])) for a in ALPHAS]
        for name in (PENALTY, DUAL)
    }


def _relative_error(run: Run) -> float:
    true = truth_for(SCENES[run.scene]()).poses(np.zeros(1))
    mine = run.trajectory
    if not len(mine.times) or mine.acceleration is None:
        return math.nan
    parts = [(mine.acceleration, true.acceleration), (mine.angular_acceleration, true.angular_acceleration)]
    off = math.sqrt(sum(float(np.sum((a - b) ** 2)) for a, b in parts))
    return off / math.sqrt(sum(float(np.sum(b**2)) for _, b in parts))


def _digits(records: Records) -> list[Block]:
    errors = digit_errors(records)
    exact = _relative_error(Run(records[Label("digits", EXACT, "")]))
    rows = [
        (
            f"{a:.0e}",
            *(power(errors[n][i]) for n in (PENALTY, DUAL)),
            *(_ended(records, n, a) for n in errors),
        )
        for i, a in enumerate(ALPHAS)
    ]
    caption = (
        f"Relative error of all accelerations of one state of the spatial slider-crank under gravity against "
        f"the closed form (mpi-svd: {power(exact)}), iterated to ε = {runs.DIGITS_EPSILON:g} or 100 times. "
        "The n × n matrix of ALF carries α times the rounding of its rows; the dual on m × m does not: a "
        "larger α only makes it converge faster. An en dash: not converged."
    )
    header = ("α", "ALF", "ALF, dual", "ALF ended", "Dual ended")
    return [
        Heading("ALF against its dual, digit by digit over α"),
        Table(caption, header, rows, right=frozenset({0, 1, 2})),
        Figure("paper-alf-digits", "The table above.", partial(plot_digits, errors)),
    ]


def _ended(records: Records, name: str, alpha: float) -> str:
    return Run(records[Label("digits", name, f"{alpha:g}")]).outcome.label


def plot_digits(errors: dict[str, list[float]]) -> Drawing:
    """Relative errors over α, both logarithmic."""
    drawing, (axes,) = figures.canvas(7.2, 3.4)
    for i, (name, values) in enumerate(errors.items()):
        sizes = np.maximum(values, SMALLEST)
        axes.plot(ALPHAS, sizes, label=name, marker=figures.MARKERS[i], color=figures.COLOURS[i])
    axes.set(xscale="log", yscale="log", xlabel="penalty α", ylabel="relative error of accelerations")
    figures.legend_below(drawing, axes)
    return drawing
