"""Figures draw what the records say."""

import functools
import io
import re

import numpy as np
import pytest
from PIL import Image

from reports import figures, time_series
from reports.blocks import Figure, Plot
from reports.sections import blocks, speed
from tests.reports.synthetic import groups


@functools.cache
def pictures() -> dict[str, Figure]:
    """The figures of all sections; those that can be asked are drawn for Markdown too."""
    shown = [block.figure if isinstance(block, Plot) else block for block in blocks(groups())]
    return {block.name: block for block in shown if isinstance(block, Figure)}


def pixels(png: bytes) -> int:
    """How many different rows of pixels a PNG has: a blank picture has few."""
    with Image.open(io.BytesIO(png)) as picture:
        return len({row.tobytes() for row in np.asarray(picture)})


@pytest.mark.parametrize(
    "name", [f"spatial_slider_crank-{k}" for k in ("mechanism", "speed", "violation", "energy")]
)
def test_figure_is_not_blank_and_reproducible(name):
    """Drawn twice a figure is one SVG. A blank one has at most 10 paths and 60 different rows of pixels."""
    picture = pictures()[name]
    once, again = figures.svg(picture.draw(), name), figures.svg(picture.draw(), name)
    assert once == again, f"{name} changes from one drawing to the next"
    assert once.count("<path") + once.count("<poly") > 10, f"{name} has few lines"
    assert pixels(figures.png(picture.draw())) > 60, f"{name} is nearly blank"


def test_speed_plot_has_a_mark_for_each_run():
    """Marks are at recorded errors and seconds; three failed runs are beside the plot, 1 and 2 by cause."""
    group = groups()[0]
    failures = speed.failed(group.runs)
    main, strip = speed.plot(group, failures).axes
    drawn = {line.get_label(): line.get_xydata() for line in main.lines}
    for curve, runs in group.curves().items():
        points = [(run.error, run.seconds) for run in runs if run.completed]
        if points:
            label = " ".join(curve)
            np.testing.assert_allclose(drawn[label], points, err_msg=f"{label}: drawn / recorded")
    marks = sum(len(line.get_xdata()) for line in strip.lines)
    assert marks == sum(not run.completed for run in group.runs) == 3, marks
    assert [text.get_text() for text in strip.texts] == ["1", "2"], [text.get_text() for text in strip.texts]
    assert main.get_ylim() == strip.get_ylim(), "the strip has another time axis"


def test_time_series_has_a_cross_at_the_last_sample_of_a_run_that_ended_early():
    """Only the best run of Exudyn, to 0.6 of the duration, ended early among those shown. Of 13 samples at
    twelfths of the duration its last one is at 7/12."""
    group = groups()[0]
    values = time_series.series(group, lambda run: [np.ones_like(run.trajectory.times)])
    [axes] = time_series.plot(group, values, ["one"]).axes
    crosses = [line.get_xdata()[0] for line in axes.lines if line.get_marker() == figures.FAILED]
    assert crosses == pytest.approx([7 / 12 * group.scene.duration])


def test_twelve_curves_of_an_engine_have_one_colour_and_different_lines():
    """Twelve families of mbref: each has another pair of line style and marker."""
    looks = figures.looks([("mbref", str(i)) for i in range(12)])
    kinds = {(str(look["linestyle"]), look["marker"]) for look in looks.values()}
    assert len(kinds) == 12, kinds
    assert {look["color"] for look in looks.values()} == {figures.colour("mbref")}


def test_powers_of_ten_at_the_axes_are_plain_text():
    """10⁻⁷ is written with raised digits, not as a formula, so that the text can be found and copied."""
    picture, (axes,) = figures.canvas()
    axes.plot([1e-7, 1e-3, 1.0], [2.0, 3.0, 5.0])
    axes.set(xscale="log", yscale="log")
    labels = re.findall(r">([^<>\n]+)</text>", figures.svg(picture, "powers"))
    assert {"10⁻⁷", "10⁰", "2×10⁰", "3×10⁰"} <= set(labels), labels


def test_figure_files_have_neither_date_nor_program():
    """A figure drawn again on another day, or by another version, is the same file."""
    figure, _ = figures.canvas(2.0, 2.0)
    text = figures.svg(figure, "one")
    assert "<dc:date>" not in text and "Matplotlib" not in text
    assert b"Software" not in figures.png(figure)
