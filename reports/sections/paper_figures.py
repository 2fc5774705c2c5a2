"""Section: the paper's Figures 4, 5, 6, 8 and 11 to 16, from runs with the paper's methods."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from crosscheck.paper.cells import FIVE_BAR
from crosscheck.paper.runs import (
    FINE,
    HEAVY,
    PEAKS,
    SPATIAL_DYNAMIC,
    TRUE_BRANCH,
    UNEQUAL,
    Records,
    dynamic_scene,
    linkage,
)
from crosscheck.paper.settings import BASE
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

from .. import figures, mechanisms
from ..blocks import Block, Figure, Heading
from ..runs import Run
from ..sections.paper_teaching import violation

HALF = "θ₂ = π/2"
POSES = 12
SMALLEST = 1e-17
Named = Mapping[str, Run]


def render(records: Records) -> list[Block]:
    """Return the figures in the paper's order."""
    four, five = _runs(records, "figures", HALF), _runs(records, "figures", FIVE_BAR)
    heavy, unequal, spatial = (_runs(records, "dynamic", c) for c in (HEAVY, UNEQUAL, SPATIAL_DYNAMIC))
    four_bar, five_bar = (linkage("MPI (GS)", column, [0.0]).scene for column in (HALF, FIVE_BAR))
    free = ("MPI (GS)", "MPI (SVD)")
    partitioned = ("MPI (GS) + CP", "MPI (SVD) + CP")
    branches = ("MPI (GS)", "MPI (GS) + B", TRUE_BRANCH)
    plain, held = ("ALF", "MPI (GS)", "MPI (SVD)"), ("ALF + CP", "MPI (GS) + CP", "MPI (SVD) + CP")
    return [
        Heading("Figures 4 to 8: kinematic analysis"),
        _poses(4, four_bar, _only(four, ("ALF", *free, "MPI (GS) + B")), "The four-bar from θ₂ = π/2"),
        _violations(5, _only(four, free), "without partitioning"),
        _violations(6, _only(four, partitioned), "with partitioning"),
        _poses(8, five_bar, _only(five, (*free, "MPI (SVD) + CP")), "The five-bar"),
        Heading("Figures 11 to 16: dynamic analysis, 100 N m on the crank"),
        _rates(
            11,
            _only(heavy, branches),
            "planar slider-crank, a = b: the first singular position comes "
            "at 1.81 s. The flywheel outweighs the links, so the branches hardly differ here",
        ),
        _poses(
            12,
            dynamic_scene(HEAVY),
            _only(heavy, ("MPI (GS)", "MPI (GS) + B")),
            "The slider-crank with a = b, in the last seconds of both runs",
            (3.4, 4.8),
        ),
        _accelerations(13, {PEAKS.row: Run(records[PEAKS])}),
        _rates(
            14,
            _only(unequal, held),
            "planar slider-crank, a ≠ b, partitioning; there is no singular position",
        ),
        _rates(15, _only(spatial, plain), "spatial slider-crank without partitioning"),
        _rates(16, _only(spatial, held), "spatial slider-crank with partitioning"),
    ]


def _runs(records: Records, part: str, column: str) -> dict[str, Run]:
    return {
        k.row: Run(r)
        for k, r in records.items()
        if (k.part, k.column, k.variant) == (part, column, BASE.name)
    }


def _only(runs: Named, rows: Sequence[str]) -> dict[str, Run]:
    return {row: runs[row] for row in rows}


def _ended(runs: Named) -> str:
    return ", ".join(
        f"{name} {'to the end' if run.completed else f'to {run.t_end:.4g} s ({run.outcome.letter})'}"
        for name, run in runs.items()
    )


def _poses(
    paper: int, scene: Scene, runs: Named, what: str, span: tuple[float, float] | None = None
) -> Figure:
    caption = (
        f"Figure {paper}. {what}: poses from the start, light, to the last sample before the end, dark; "
        f"{_ended(runs)}. Steps end at samples, so that the end may differ from the tables'."
    )
    return Figure(f"paper-figure-{paper}", caption, partial(plot_poses, scene, runs, span))


def plot_poses(scene: Scene, runs: Named, span: tuple[float, float] | None) -> str:
    """Return poses of the links side by side as SVG, one panel for each method, within a span of time (s); a
    run that ended before it shows its last pose."""
    shown = {}
    for name, run in runs.items():
        times = run.trajectory.times
        low, high = span or (0.0, times[-1])
        first, end = np.searchsorted(times, [min(low, times[-1]), np.nextafter(high, np.inf)])
        motion = mechanisms.sample(run.trajectory, slice(int(first), int(end)))
        shown[name] = f"to {motion.times[-1]:.4g} s", motion
    return mechanisms.poses_side_by_side(scene, shown, POSES)


def _violations(paper: int, runs: Named, what: str) -> Figure:
    worst = {name: float(violation(run).max()) for name, run in runs.items()}
    sizes = ", ".join(f"{name} {size:.1e}" for name, size in worst.items())
    caption = (
        f"Figure {paper}. The largest violation of a constraint of the four-bar from θ₂ = π/2, MPI {what}; "
        f"at most: {sizes}. Dashed: θ₂ = kπ."
    )
    return Figure(f"paper-figure-{paper}", caption, partial(plot_violations, runs))


def plot_violations(runs: Named) -> Drawing:
    """Return a plot of the largest violation over time, logarithmic."""
    drawing, (axes,) = figures.canvas(7.2, 3.4)
    last = 0.0
    for i, (name, run) in enumerate(runs.items()):
        t = run.trajectory.times
        last = max(last, float(t[-1]))
        axes.plot(t, violation(run), label=name, color=figures.COLOURS[i], linestyle=figures.DASHES[i])
        if not run.completed:
            axes.plot(t[-1], violation(run)[-1], figures.FAILED, color=figures.COLOURS[i], markersize=8)
    for k in range(1, 10):
        if (crossing := (2 * k - 1) * math.pi / 2 / 124.8) < last * 1.05:
            axes.axvline(crossing, color=figures.GREY, linestyle="--", linewidth=0.8, zorder=0)
    axes.set(yscale="log", xlabel="t (s)", ylabel="largest violation (rad, or of the length)")
    figures.legend_below(drawing, axes)
    return drawing


def _rates(paper: int, runs: Named, what: str) -> Figure:
    caption = f"Figure {paper}. Angular velocity of the crank, {what}; {_ended(runs)}."
    return Figure(f"paper-figure-{paper}", caption, partial(plot_rates, runs))


def _along_axis(vectors: np.ndarray) -> np.ndarray:
    """Return the crank's component (k,) about its axis: z in the plane, y in space, whichever is larger on
    average."""
    axis = int(np.argmax(np.abs(vectors[:, 0]).sum(axis=0)))
    return vectors[:, 0, axis]


def plot_rates(runs: Named) -> Drawing:
    """Return a plot of the crank's angular velocity over time."""
    drawing, (axes,) = figures.canvas(7.2, 3.6)
    for i, (name, run) in enumerate(runs.items()):
        motion: Trajectory = run.trajectory
        look: figures.Look = {"color": figures.COLOURS[i], "linestyle": figures.DASHES[i]}
        rates = _along_axis(motion.angular_velocity)
        axes.plot(motion.times, rates, label=name, linewidth=2.4 - 0.6 * i, **look)
        if not run.completed:
            axes.plot(motion.times[-1], rates[-1], figures.FAILED, color=look["color"], markersize=8)
    axes.set(xlabel="t (s)", ylabel="crank angular velocity (rad/s)")
    figures.legend_below(drawing, axes)
    return drawing


def _accelerations(paper: int, runs: Named) -> Figure:
    highest = max(float(_crank_acceleration(run).max()) for run in runs.values())
    caption = (
        f"Figure {paper}. Logarithm of the crank's angular acceleration, planar slider-crank with a = b and "
        f"partitioning: away from singular positions it is 100 N m over the inertia, about 1 rad/s², near "
        f"some, as near as samples every {1e3 * FINE[1]:g} ms come, up to {highest:.3g}; {_ended(runs)}."
    )
    return Figure(f"paper-figure-{paper}", caption, partial(plot_accelerations, runs))


def _crank_acceleration(run: Run) -> np.ndarray:
    """Return the magnitude (k,) of the crank's angular acceleration, rad/s²."""
    assert run.trajectory.angular_acceleration is not None
    return np.linalg.norm(run.trajectory.angular_acceleration[:, 0], axis=-1)


def plot_accelerations(runs: Named) -> Drawing:
    """Return a plot of the magnitude of the crank's angular acceleration over time, logarithmic."""
    drawing, (axes,) = figures.canvas(7.2, 3.4)
    for i, (name, run) in enumerate(runs.items()):
        values = np.maximum(_crank_acceleration(run), SMALLEST)
        axes.plot(run.trajectory.times, values, label=name, color=figures.COLOURS[i], linewidth=1)
    axes.set(yscale="log", xlabel="t (s)", ylabel="|crank angular acceleration| (rad/s²)")
    figures.legend_below(drawing, axes)
    return drawing
