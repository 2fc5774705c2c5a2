"""Section: additions to the paper's tables: singular positions explained, every pair of methods, ALF and its
dual form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from crosscheck.judge.truth import truth_for
from crosscheck.paper import runs, settings, singular
from crosscheck.paper.cells import SPATIAL
from crosscheck.paper.illustration import DISTANCES, GAMMA_ERRORS, TURNED, Illustration
from crosscheck.paper.runs import ALPHAS, DUAL, EXACT, PENALTY, Label, Records, digits_scene
from mbref.motions.trajectory import Trajectory

from .. import figures
from ..blocks import Block, Figure, Heading, Table, Text
from ..runs import Run, ended_briefly, number, power

SMALLEST = 1e-17  # smaller magnitudes are plotted at this value


def explained(found: Illustration) -> list[Block]:
    """Return the explanation of Table I's failure times by the joint equations alone."""
    return [
        Heading("Singular positions explained"),
        Text(_about(*found["fold"])),
        _crossings(found["crossings"]),
        Figure(
            "paper-singular-values",
            "The smallest and the next smallest singular value of the scaled "
            "Jacobian over one revolution of the rhombus. At θ₂ = kπ one of them vanishes, linearly with "
            "the distance; accelerations found from it carry errors divided by it.",
            partial(plot_values, found["theta"], found["smallest"]),
        ),
        _alf_near_a_crossing(found["alf_iterations"]),
    ]


def _about(closed: float, opened: float) -> str:
    """Return the text, from the residuals of the joint equations on the second branch (the fold) from θ₂ = 0
    and from θ₂ = π."""
    return (
        "The constraint Jacobian of the rhombus (rows of unit length, angular columns divided by the largest "
        "distance) has rank 18 along the motion and 17 at every θ₂ = kπ, where all links lie on one line and "
        f"a second branch, the fold, crosses the parallelogram. Driven {TURNED:g} rad further along the "
        f"fold, the joint equations and the driver are violated by {power(opened)} from θ₂ = π: coupler and "
        "crank turn together about A, the rocker rests, the driver's equation holds, and a run can leave the "
        f"true branch. From θ₂ = 0 they are violated by {number(closed)} rad: on the fold the crank would "
        "have to rest, which its driver excludes. From π/4, π/2 and nπ the first position at which a driven "
        "linkage can leave the branch therefore comes at 0.0315, 0.0378 and 0.0503 s: the paper's 0.031, "
        "0.037 and 0.050 s (Table I, MPI)."
    )


def _crossings(found: Sequence[Sequence[Any]]) -> Table:
    rows = [
        (
            start.removeprefix("θ₂ = "),
            f"{t:.4f}",
            singular.turns(k),
            str(rank),
            power(value),
            "admits a turning crank" if k % 2 else "excludes a turning crank",
        )
        for start, t, k, rank, value in found
    ]
    header = ("Start θ₂", "t (s)", "θ₂", "Rank of 19 rows", "Smallest singular value", "The fold")
    return Table("Singular positions up to 0.06 s.", header, rows, right=frozenset({1, 3, 4}))


def _alf_near_a_crossing(iterations: Sequence[Sequence[int]]) -> Table:
    """Return the table of ALF's iterations near a crossing. ALF fails at the first crossing, and at a start
    in a singular position."""
    rows = [(f"{distance:g}", *map(_count, row)) for distance, row in zip(DISTANCES, iterations, strict=True)]
    caption = (
        "Iterations of ALF, as set for the tables, over the distance (rad) to θ₂ = 0 and over the error of γ "
        "in the direction that vanishes there, relative to γ. Each iteration leaves 1 / (1 + α σ²) of the "
        "errors, rounding among them, in that direction, which near a crossing is nearly all: ALF ends where "
        f"the {settings.ALF['iterations']} allowed do not suffice, and with its first step from θ₂ = nπ."
    )
    header = ("Distance", *(f"γ off by {error:g}" for error in GAMMA_ERRORS))
    return Table(caption, header, rows, right=frozenset(range(len(header))))


def _count(iterations: int) -> str:
    return f"{iterations}" if iterations < singular.MOST else f"> {singular.MOST}"


def plot_values(theta: Sequence[float], smallest: Sequence[Sequence[float]]) -> Drawing:
    """Return a plot of the two smallest singular values (k, 2) over θ₂ (k,), rad, for one revolution."""
    drawing, (axes,) = figures.canvas(7.2, 3.4)
    for i, (name, values) in enumerate(zip(("smallest", "next"), zip(*smallest, strict=True), strict=True)):
        axes.plot(
            np.array(theta) / math.pi, np.maximum(values, SMALLEST), color=figures.COLOURS[i], label=name
        )
    axes.set(yscale="log", xlabel="θ₂ / π", ylabel="singular value", ylim=(1e-4, 2))
    axes.invert_xaxis()
    figures.legend_below(drawing, axes)
    return drawing


def render(records: Records) -> list[Block]:
    """Return the table of all pairs of methods, and the accuracy of ALF and its dual form."""
    return [*_pairs(records), *_digits(records)]


def _pairs(records: Records) -> list[Block]:
    pairs = {label: Run(record) for label, record in records.items() if label.part == "pairs"}
    rows = [_pair(label, run) for label, run in pairs.items()]
    partitioned = [run for label, run in pairs.items() if label.column == "partitioning"]
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


def _pair(label: Label, run: Run) -> tuple[str, ...]:
    """Return the cells of a formulation with a stabilisation."""
    seconds = 1e3 * run.rate("seconds")
    return (
        label.row,
        label.column,
        ended_briefly(run),
        power(run.error),
        power(run.metric("violation_position")),
        number(run.rate("steps"), 4),
        f"{seconds:.3g}" if math.isfinite(seconds) else "–",
    )


def digit_errors(records: Records) -> dict[str, list[float]]:
    """Return the relative error of the accelerations at t = 0 by method for each α in ALPHAS; NaN if not
    converged."""
    return {
        name: [_relative_error(Run(records[Label("digits", name, f"{a:g}")])) for a in ALPHAS]
        for name in (PENALTY, DUAL)
    }


def _relative_error(run: Run) -> float:
    truth = truth_for(digits_scene())
    assert truth is not None
    exact, found = (_accelerations(motion) for motion in (truth.poses(np.zeros(1)), run.trajectory))
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact)) if found.size else math.nan


def _accelerations(motion: Trajectory) -> np.ndarray:
    """Return accelerations and angular accelerations at every sample; empty if there are none."""
    if not len(motion.times) or motion.acceleration is None or motion.angular_acceleration is None:
        return np.zeros(0)
    return np.stack([motion.acceleration, motion.angular_acceleration])


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
    """Return a plot of the relative errors over α, both logarithmic."""
    drawing, (axes,) = figures.canvas(7.2, 3.4)
    for i, (name, values) in enumerate(errors.items()):
        sizes = np.maximum(values, SMALLEST)
        axes.plot(ALPHAS, sizes, label=name, marker=figures.MARKERS[i], color=figures.COLOURS[i])
    axes.set(xscale="log", yscale="log", xlabel="penalty α", ylabel="relative error of accelerations")
    figures.legend_below(drawing, axes)
    return drawing
