"""Style of all figures, and figures as SVG text and PNG bytes that are reproducible bit by bit."""

from __future__ import annotations

import functools
import io
import itertools
import re
from collections.abc import Iterable, Mapping
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.text import Text as Words
from matplotlib.ticker import LogFormatterSciNotation

from crosscheck.engine import engine_names
from mbref.motions.drawing import film
from mbref.motions.drawing.svg import COLOURS, GREY, INK
from mbref.printable import printable

from .runs import Curve

MARKERS = ("o", "s", "^", "D", "v", "P", "h", "<", ">", "p")
DASHES = ("-", "--", ":", "-.", (0, (6, 1.5, 1, 1.5, 1, 1.5)), (0, (1, 3)))
FAILED = "X"
DPI_OF_SVG = 72.0  # dots in an inch of an SVG picture: its unit is the point
EXPONENT = re.compile(r"\^\{(-?\d+)\}")
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "sans-serif"],
    "font.size": 9.0,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "svg.fonttype": "none",
    "path.simplify_threshold": 0.5,  # points; matplotlib's 1/9 gives dense curves twice the lines
}


def canvas(width: float = 7.2, height: float = 4.0, rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure of ``rows`` axes above each other with a common x axis; sizes in inches."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    return figure, list(axes[:, 0])


@functools.cache
def colour(engine: str) -> str:
    """Return the engine's colour, equal in every picture; third-party engines share the last colours."""
    names = engine_names()
    return COLOURS[names.index(engine) % len(COLOURS)] if engine in names else COLOURS[-1]


Look = dict[str, Any]  # keyword arguments of a line


def looks(curves: Iterable[Curve]) -> Mapping[Curve, Look]:
    """Return line and marker of every (engine, family): colour by engine, marker and dash by family."""
    styles: dict[Curve, Look] = {}
    for engine, group in itertools.groupby(sorted(set(curves)), key=lambda curve: curve[0]):
        for i, curve in enumerate(group):
            dash, marker = DASHES[i % len(DASHES)], MARKERS[i % len(MARKERS)]
            styles[curve] = {"color": colour(engine), "linestyle": dash, "marker": marker}
    return styles


def legend_below(figure: Figure, axes: Axes, columns: int = 3) -> None:
    """Place the legend of ``axes`` in columns below the figure, so that it covers nothing."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        with matplotlib.rc_context(STYLE):
            figure.legend(handles, labels, loc="outside lower left", ncols=columns, handlelength=3.2)


class PlainPowers(LogFormatterSciNotation):
    """Powers of ten as plain text, such as 10⁻³, without formulas, which take a third of a figure's time."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        formula = super().__call__(x, pos).replace(r"\times", "×")
        return re.sub(r"[${}]|\\mathdefault|\^", "", EXPONENT.sub(_raised, formula))


def _raised(exponent: re.Match[str]) -> str:
    return exponent[1].translate(SUPERSCRIPTS)


def svg(figure: Figure | str, name: str) -> str:
    """Return the picture as an SVG element; ``name`` makes its ids unique in a page. The layout is final."""
    if isinstance(figure, str):
        return figure
    out = io.StringIO()
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if axis.get_scale() == "log":
            axis.set_major_formatter(PlainPowers())
            axis.set_minor_formatter(PlainPowers(labelOnlyBase=False))
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": name, "svg.id": name}):
        for words in figure.findobj(Words):
            words.set_parse_math(False)  # names are no formulas
        _lay_out(figure)
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    text = printable(out.getvalue())  # XML has no control characters
    return text[text.index("<svg") :]


def _lay_out(figure: Figure) -> None:
    """Find the layout of a figure as SVG; savefig would draw the figure once more to find it."""
    if engine := figure.get_layout_engine():
        FigureCanvasSVG(figure)
        figure.dpi = DPI_OF_SVG
        engine.execute(figure)
        figure.set_layout_engine(None)


def png(figure: Figure | str) -> bytes:
    """Return the picture as PNG."""
    if isinstance(figure, str):
        return film.png(figure)
    out = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        figure.savefig(out, format="png", dpi=110, metadata={"Software": None})
    return out.getvalue()
