"""SVG figure of time against error whose text keeps its size: widths are percentages, heights are pixels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from html import escape

from crosscheck.judge.tolerances import FALSE_SUCCESS, FLOOR

from .engine_looks import is_hollow, mark, named, tone
from .places import of_run
from .runs import Run, SceneRuns, duration

HEIGHT, TOP, FOOT = 380.0, 26.0, 40.0  # px; height of the axes, margin above, margin below
LEAST_WIDE = 18  # least width of a grade's zone, in percent of the width, at which its name is shown
MOST_LABELS = 7  # largest number of tick labels on an axis
DASHES = ("", "6 4", "2 4", "9 3 2 3")


def speed_svg(scene_runs: SceneRuns, description: str) -> str:
    """Return the figure of a scene, in which every completed run is a mark that links to its record; empty
    without errors."""
    shown = [run for run in scene_runs.completed() if math.isfinite(run.error)]
    if not shown:
        return ""
    axes = _Axes(*zip(*(r.drawn for r in shown), strict=True))
    name = f"Time of stepping against the largest error on {scene_runs.scene.name}"
    return "".join(
        [
            f'<svg class="plot" height="{TOP + HEIGHT + FOOT:g}" role="group" aria-label="{escape(name)}">',
            f"<title>{escape(name)}</title><desc>{escape(description)}</desc>",
            f'<svg y="{TOP:g}" height="{HEIGHT:g}" overflow="visible">',
            *_zones(axes),
            *_grid(axes),
            *_curves(scene_runs, axes),
            "</svg></svg>",
        ]
    )


def toggles(scene_runs: SceneRuns) -> list[tuple[str, int, str, list[str]]]:
    """Return name, tone, mark and families of each engine, for the legend and for switching its curves."""
    families: dict[str, list[str]] = {}
    for engine, family in scene_runs.curves():
        families.setdefault(engine, []).append(family)
    return [(engine, tone(engine), mark(engine), found) for engine, found in families.items()]


class _Axes:
    """Logarithmic axes that span whole decades."""

    def __init__(self, errors: Sequence[float], times: Sequence[float]):
        self.x0, self.x1 = _decades(errors)
        self.y0, self.y1 = _decades(times)

    def x(self, error: float) -> float:
        """Return the horizontal position of an error in percent of the width."""
        return 100 * min(max((math.log10(error) - self.x0) / (self.x1 - self.x0), 0.0), 1.0)

    def y(self, time: float) -> float:
        """Return the vertical position of a time in pixels from the top."""
        return HEIGHT * (self.y1 - math.log10(time)) / (self.y1 - self.y0)


def _decades(values: Sequence[float]) -> tuple[int, int]:
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return low, max(high, low + 1)


def _ticks(low: int, high: int) -> range:
    return range(low, high + 1, max(1, math.ceil((high - low) / MOST_LABELS)))


def _zones(axes: _Axes) -> Iterator[str]:
    """Return the zones of the grades along the axis of errors."""
    ends = [axes.x(10.0**axes.x0), axes.x(FLOOR), axes.x(FALSE_SUCCESS), 100.0]
    for word, left, right in zip(("right", "inaccurate", "wrong"), ends, ends[1:], strict=False):
        wide = right - left
        if wide > 0:
            yield f'<rect class="zone {word}" x="{left:.2f}%" width="{wide:.2f}%" height="{HEIGHT:g}"/>'
        if wide > LEAST_WIDE:
            yield f'<text x="{(left + right) / 2:.2f}%" y="-9" text-anchor="middle">{word}</text>'


def _grid(axes: _Axes) -> Iterator[str]:
    for k in _ticks(axes.y0, axes.y1):
        y = axes.y(10.0**k)
        yield f'<line class="grid" x2="100%" y1="{y:.1f}" y2="{y:.1f}"/>'
        yield f'<text x="-9" y="{y + 4:.1f}" text-anchor="end">{duration(10.0**k)}</text>'
    for k in _ticks(axes.x0, axes.x1):
        yield (
            f'<text x="{axes.x(10.0**k):.2f}%" y="{HEIGHT + 20:g}" text-anchor="middle">'
            f"10{str(k).translate(SUPERSCRIPT)}</text>"
        )
    yield f'<line class="axis" x2="100%" y1="{HEIGHT:g}" y2="{HEIGHT:g}"/>'


SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _curves(scene_runs: SceneRuns, axes: _Axes) -> Iterator[str]:
    order: dict[str, int] = {}
    for (engine, family), runs in scene_runs.curves().items():
        order[engine] = order.get(engine, -1) + 1
        drawn = [run for run in runs if run.completed and math.isfinite(run.error)]
        spots = [(axes.x(r.drawn[0]), axes.y(r.drawn[1])) for r in drawn]
        look = "hollow" if is_hollow(family) else ""
        attributes = f'data-engine="{escape(engine)}" data-family="{escape(family)}"'
        yield f'<g class="tone{tone(engine)} {look}" {attributes}>'
        dash = DASHES[order[engine] % len(DASHES)]
        for (x1, y1), (x2, y2) in itertools.pairwise(spots):
            yield (
                f'<line class="curve" stroke-dasharray="{dash}" x1="{x1:.2f}%" y1="{y1:.1f}" '
                f'x2="{x2:.2f}%" y2="{y2:.1f}"/>'
            )
        yield from (_mark(scene_runs, run, *spot) for run, spot in zip(drawn, spots, strict=True))
        yield "</g>"


def _mark(scene_runs: SceneRuns, run: Run, x: float, y: float) -> str:
    """Return a mark that links to its record and has the run's numbers as data attributes."""
    settings, cost = scene_runs.varied_settings(run), run.record["cost"]
    measured = f"error {run.said}, {duration(run.seconds)}, {cost['steps']} steps"
    said = escape(f"{named(*run.curve)}, {settings}: {measured}")
    data = {
        "error": f"{run.error:.4g}",
        "seconds": f"{run.seconds:.4g}",
        "setting": settings,
        "steps": str(cost["steps"]),
        "outcome": run.outcome.label,
    }
    attributes = " ".join(f'data-{name}="{escape(value)}"' for name, value in data.items())
    return (
        f'<a class="run" href="#{of_run(run)}" aria-label="{said}" {attributes}><title>{said}</title>'
        f'<svg x="{x:.2f}%" y="{y:.1f}" overflow="visible"><circle class="hit" r="12"/>'
        f'<path d="{mark(run.curve[0])}"/></svg></a>'
    )
