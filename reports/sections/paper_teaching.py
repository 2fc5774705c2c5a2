"""Section with examples for lectures: growth of the violation, Baumgarte's parameters, and three
stabilisations compared."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from crosscheck.paper.runs import GAIN, GROWTH, SPATIAL_DYNAMIC, TEACHING, Label, Records

from .. import figures
from ..blocks import Block, Figure, Heading, Table, Text
from ..runs import Run, ended_briefly, power

SMALLEST = 1e-17
REMEDIES = ("LM2", "LM2 + CP", "ALF", "ALF + CP", "MPI (SVD)", "MPI (SVD) + CP")


def render(records: Records) -> list[Block]:
    """Return the growth of the violation (Figure 2's procedure), Baumgarte's α = β, and a comparison of
    partitioning, ALF and the pseudo-inverse."""
    growth, gains = _varied(records, GROWTH), _varied(records, GAIN)
    remedies = {row: Run(records[Label("dynamic", row, SPATIAL_DYNAMIC)]) for row in REMEDIES}
    return [
        Heading("For lectures: constraint violation and its remedies"),
        Text(
            "The spatial slider-crank under 100 N m, without redundant constraints and singular positions, "
            "so that only the remedies differ. Integrated as in the paper's Figure 2, accelerations obey "
            "Φ'' = 0 up to the error of each step; nothing pulls positions and velocities back."
        ),
        Figure("paper-growth", _growth_caption(growth), partial(plot_growth, growth)),
        _gains(gains),
        Figure(
            "paper-gains",
            "The table above: violation (circles) and error (squares) over α = β, both "
            "axes logarithmic; α = β = 0, no feedback, at the left end.",
            partial(plot_gains, gains),
        ),
        _remedies(remedies),
        Figure(
            "paper-remedies",
            "Violation of the positions over time by the methods of the table above.",
            partial(plot_violations, remedies),
        ),
    ]


def _varied(records: Records, part: str) -> dict[str, Run]:
    return {label.variant: Run(record) for label, record in records.items() if label.part == part}


def violation(run: Run) -> np.ndarray:
    """Return the largest violation of a position constraint at each sample (k,), for a logarithmic axis."""
    return np.maximum(np.array(run.record["violation"], dtype=float), SMALLEST)


def exponent(run: Run) -> float:
    """Return the exponent p of a violation that grows as t^p; NaN if it is at rounding level.

    The exponent is a least-squares fit of the logarithms after a tenth of the time.
    """
    t, values = np.array(run.record["times"]), violation(run)
    late = t >= TEACHING[-1] / 10
    if not late.any() or values[late].max() < 1e3 * np.finfo(float).eps:
        return math.nan
    return float(np.polyfit(np.log(t[late]), np.log(values[late]), 1)[0])


def _growth_caption(runs: dict[str, Run]) -> str:
    slopes = [slope for run in runs.values() if math.isfinite(slope := exponent(run))]
    ends = ", ".join(f"{power(float(violation(run)[-1]))} at rtol {name}" for name, run in runs.items())
    return (
        f"Figure 2's procedure: violation of the positions by LM2 without stabilisation, over the tolerance. "
        f"{_grows(slopes)}; after {TEACHING[-1]:g} s: {ends}. A tighter tolerance "
        "lowers the violation and does not stop its growth."
    )


def _grows(slopes: list[float]) -> str:
    return f"It grows about as t^{np.median(slopes):.1f}" if slopes else "It is of rounding"


def plot_growth(runs: dict[str, Run]) -> Drawing:
    """Return a plot of the violation over time, both logarithmic, with a curve for each tolerance."""
    return _plot({f"rtol {name}": run for name, run in runs.items()}, 1, "log")


def _plot(runs: dict[str, Run], first: int, scale: str) -> Drawing:
    """Return a plot of the logarithm of the violation, from the ``first`` sample on, over time."""
    drawing, (axes,) = figures.canvas(7.2, 3.8)
    for i, (name, run) in enumerate(runs.items()):
        axes.plot(
            run.record["times"][first:],
            violation(run)[first:],
            label=name,
            color=figures.COLOURS[i % len(figures.COLOURS)],
            linestyle=figures.DASHES[i % len(figures.DASHES)],
        )
    axes.set(xscale=scale, yscale="log", xlabel="t (s)", ylabel="violation of positions")
    figures.legend_below(drawing, axes)
    return drawing


def _gains(runs: dict[str, Run]) -> Table:
    rows = [
        (
            name,
            power(run.metric("violation_position")),
            power(run.metric("violation_velocity")),
            power(run.error),
            f"{run.rate('steps'):.0f}",
            ended_briefly(run) if not run.completed else "2 s",
        )
        for name, run in runs.items()
    ]
    best = min(runs, key=lambda name: runs[name].metric("violation_position"))
    caption = (
        "Baumgarte's stabilisation (Eq. 9) by LM2 over α = β (1/s); the paper takes 5. Feedback holds the "
        f"violation, least here with α = β = {best}; it does not bring the motion back to the true one. "
        "Large values make the equations stiff and cost steps."
    )
    header = ("α = β", "Violation", "of velocities", "Error", "Steps/s", "Ended")
    return Table(caption, header, rows, right=frozenset({0, 1, 2, 3, 4}))


def plot_gains(runs: dict[str, Run]) -> Drawing:
    """Return a plot of violation and error over α = β, all logarithmic; α = 0 is at the left end."""
    drawing, (axes,) = figures.canvas(7.2, 3.4)
    gains = np.array([float(name) for name in runs])
    places = np.where(gains > 0, gains, gains[gains > 0].min() / 3)
    for i, (label, metric) in enumerate((("violation", "violation_position"), ("error", "error"))):
        values = np.maximum([run.metric(metric) for run in runs.values()], SMALLEST)
        axes.plot(places, values, marker=("o", "s")[i], color=figures.COLOURS[i], label=label)
    axes.set(xscale="log", yscale="log", xlabel="α = β (1/s)", ylabel="violation, error")
    figures.legend_below(drawing, axes)
    return drawing


def _remedies(runs: dict[str, Run]) -> Table:
    rows = [
        (
            row,
            power(run.metric("violation_position")),
            power(run.metric("violation_velocity")),
            power(run.error),
            f"{run.rate('steps'):.0f}",
            f"{1e3 * run.rate('seconds'):.2g}",
            ended_briefly(run),
        )
        for row, run in runs.items()
    ]
    caption = (
        "Partitioning, augmented Lagrangian and Moore–Penrose side by side, at the settings of the tables. "
        "The pseudo-inverse solves for the accelerations and leaves the drift; ALF holds it by a penalty; "
        "partitioning removes it, whatever solves for the accelerations."
    )
    header = ("Method", "Violation", "of velocities", "Error", "Steps/s", "ms CPU per s", "Ended")
    return Table(caption, header, rows, right=frozenset({1, 2, 3, 4, 5}))


def plot_violations(runs: dict[str, Run]) -> Drawing:
    """Return a plot of the violation over time, logarithmic, with a curve for each method."""
    return _plot(runs, 0, "linear")
