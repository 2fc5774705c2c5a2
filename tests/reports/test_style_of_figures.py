"""Style, looks, layout and files of figures / a few lines, with sizes by hand."""

from __future__ import annotations

import io
import re
import struct
from typing import Any

import numpy as np
from matplotlib import image
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import to_hex
from matplotlib.layout_engine import ConstrainedLayoutEngine

from reports import figures


def test_the_style_of_figures():
    """Sizes in points; two of the four sides of the axes are drawn."""
    figure, (axes,) = figures.canvas(4.0, 3.0)
    axes.plot([0.0, 1.0], [0.2, 0.8], label="a line")
    axes.set(xlabel="x", yscale="log")
    figures.legend_below(figure, axes)
    assert {name for name, side in axes.spines.items() if side.get_visible()} == {"left", "bottom"}
    assert axes.xaxis.label.get_size() == 9.0 and axes.xaxis.get_gridlines()[0].get_linewidth() == 0.6
    assert axes.xaxis.get_gridlines()[0].get_visible()
    [legend] = figure.legends
    assert legend.get_texts()[0].get_size() == 8.0 and legend.handlelength == 3.2
    picture = figures.svg(figure, "within")
    assert "3×10⁻¹" in picture, "ticks within a decade have labels"
    assert "<text" in picture and "'DejaVu Sans', sans-serif" in picture, "letters stay letters"


def test_colours_of_axes_and_of_their_labels():
    _, (axes,) = figures.canvas()
    axes.set(xlabel="x", ylabel="y", title="t")
    texts = [
        axes.title,
        *(part for axis in (axes.xaxis, axes.yaxis) for part in (axis.label, *axis.get_ticklabels())),
    ]
    assert {to_hex(text.get_color()) for text in texts} == {figures.INK}
    assert {to_hex(side.get_edgecolor()) for side in axes.spines.values()} == {to_hex(figures.GREY)}
    assert {line.get_color() for line in axes.get_xgridlines()} == {"#e6e6e6"}


def test_dashes_and_markers_are_all_different():
    assert figures.DASHES[:4] == ("-", "--", ":", "-.") and len(figures.DASHES) == 6
    assert len(set(figures.MARKERS)) == 10 and figures.FAILED not in figures.MARKERS


def test_sizes_of_a_canvas_in_inches():
    figure, panels = figures.canvas()
    assert figure.get_size_inches().tolist() == [7.2, 4.0] and len(panels) == 1
    figure, panels = figures.canvas(3.0, 2.0, 3)
    assert figure.get_size_inches().tolist() == [3.0, 2.0] and len(panels) == 3


def test_files_have_no_date_and_no_program():
    figure, _ = figures.canvas(2.0, 2.0)
    text = figures.svg(figure, "one")
    assert "<dc:date>" not in text and "Matplotlib" not in text
    assert b"Software" not in figures.png(figure)


def test_looks_of_curves_and_the_legend():
    looks = figures.looks([("b", "y"), ("a", "x"), ("a", "w"), ("a", "x")])
    assert {k: (v["linestyle"], v["marker"]) for k, v in looks.items()} == {
        ("a", "w"): ("-", "o"),
        ("a", "x"): ("--", "s"),
        ("b", "y"): ("-", "o"),
    }
    assert {v["color"] for v in looks.values()} == {figures.COLOURS[-1]}, "engines of other packages"
    dash_dot_dot, dots = figures.DASHES[4:]
    assert dash_dot_dot == (0, (6, 1.5, 1, 1.5, 1, 1.5)), "a dash of 6 and two dots of 1, at distances of 1.5"
    assert dots == (0, (1, 3)), "dots of 1 at distances of 3"
    figure, (axes,) = figures.canvas()
    figures.legend_below(figure, axes)
    assert not figure.legends, "nothing to explain"
    for name in "abcdef":
        axes.plot([1, 2], label=name)
    figures.legend_below(figure, axes)
    [legend] = figure.legends
    assert legend._ncols == 3
    legend.remove()
    figures.legend_below(figure, axes, 5)
    [legend] = figure.legends
    assert legend._ncols == 5 and not legend.get_frame_on()
    assert [text.get_text() for text in legend.get_texts()] == list("abcdef")


def test_files_of_figures():
    figure, (axes,) = figures.canvas(4.0, 3.0)
    axes.plot([1.0, 1e3], [1e-3, 1.0])
    axes.set(xscale="log", yscale="log")
    text = figures.svg(figure, "one")
    assert text.startswith("<svg") and "10⁻³" in text and figures.svg("<svg/>", "x") == "<svg/>"
    assert text == figures.svg(figure, "one") != figures.svg(figure, "two")
    width, height = struct.unpack(">II", figures.png(figure)[16:24])
    assert (width, height) == (440, 330), "110 dots per inch"
    assert image.imread(io.BytesIO(figures.png(figure))).std() > 0.01


def test_powers_of_ten_with_a_factor():
    formatter = figures.PlainPowers()
    formatter.create_dummy_axis()
    formatter.axis.set_view_interval(1e-4, 1.0)
    assert formatter(1e-4).strip() == "10⁻⁴" and formatter(1e12).strip() == "10¹²"


def test_dense_curves_are_drawn_to_half_a_point():
    """A wave of 230 points of height takes some 45 lines at a tolerance of 0.5 points, and some 90 at 1/9."""
    figure, [axes] = figures.canvas()
    axes.set_ylim(0.0, 1.0)
    x = np.linspace(0.0, 1.0, 2000)
    axes.plot(x, 0.5 + 0.4 * np.sin(2 * np.pi * x))
    curves = re.findall(r'<g id="line2d_\d+">\s*<path d="([^"]*)" clip-path', figures.svg(figure, "wave"))
    assert 30 < curves[-1].count("L") < 60


def drawing() -> Any:
    figure, (axes,) = figures.canvas(4.0, 3.0)
    axes.plot([1.0, 2.0], [3.0, 1e5], label="a long name of a line")
    axes.set(xlabel="a label", ylabel="another", title="a title")
    figures.legend_below(figure, axes)
    return figure


def test_the_layout_of_a_figure_is_found_once_and_is_that_of_the_picture(monkeypatch):
    """The layout of 72 dots an inch, which the SVG has; savefig does not find it again."""
    wanted, found, executed = drawing(), drawing(), []
    wanted.dpi = 72
    FigureCanvasSVG(wanted)
    wanted.get_layout_engine().execute(wanted)
    execute = ConstrainedLayoutEngine.execute
    monkeypatch.setattr(
        ConstrainedLayoutEngine, "execute", lambda self, fig: executed.append(fig.dpi) or execute(self, fig)
    )
    figures.svg(found, "found")
    assert executed == [72] and found.get_layout_engine() is None
    assert found.axes[0].get_position().bounds == wanted.axes[0].get_position().bounds
    once = figures.svg(found, "found")
    assert once == figures.svg(found, "found"), "a figure without a layout engine"
