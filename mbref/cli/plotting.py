"""mbref plot: numbers of a motion over time as a figure."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mbref.cli.motors import add_motors, motion_by
from mbref.cli.output import exit_status
from mbref.cli.pictures import path_of
from mbref.cli.request import Request, add_method_options, add_scene, add_units, request_of
from mbref.command_line import add_output, each_once
from mbref.files import replaced
from mbref.input_error import InputError
from mbref.motions.drawing.plot import plot
from mbref.motions.outputs import OUTPUTS

if TYPE_CHECKING:
    from mbref.method import Method
    from mbref.motions.motion import Motion

COLUMN_LIST = "columns:\n" + "\n".join(f"  {o.column:31} {o.unit:13} {o.meaning}" for o in OUTPUTS)


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "plot",
        action=_plot,
        help="numbers of a motion over time as PNG or SVG",
        description="Simulate a scene and plot columns of its motion over time, one panel for each\n"
        "quantity. Needs the extra report.",
        epilog="examples:\n  mbref plot mechanism.toml\n"
        "  mbref plot four_bar_gravity rocker.position A.angle --out run.png\n"
        '  mbref plot spatial_slider_crank slider.position "driver(A).torque"\n'
        "  mbref plot four_bar coupler.position.y --over A.angle --units mm,deg\n"
        "  mbref plot mechanism.toml position_violation --method lm1+baumgarte --vary alpha=1,5,25\n\n"
        + COLUMN_LIST,
    )
    add_scene(parser)
    parser.add_argument(
        "columns",
        nargs="*",
        metavar="COLUMN",
        help="a column or its beginning, such as rod.position (default: joint coordinates and energy)",
    )
    parser.add_argument(
        "--over",
        default="time",
        metavar="COLUMN",
        help="column of the horizontal axis, such as A.angle of a driven joint (default: time)",
    )
    parser.add_argument("--together", action="store_true", help="one panel for all columns of one unit")
    parser.add_argument(
        "--vary",
        action="append",
        metavar="OPTION=NUMBERS",
        default=[],
        help="one curve for each value of an option of the method, such as alpha=1,5,25, or\n"
        "baumgarte.alpha=1,5 if two parts have it; may be repeated: all combinations",
    )
    add_motors(parser)
    add_units(parser)
    add_output(parser, "--out", metavar="FILE", help=".svg or .png (default: as the scene, with -plot.svg)")
    add_method_options(parser, json=False)


def _values(words: Sequence[str]) -> dict[str, list[float]]:
    """Return the values of ``--vary`` by option; raises InputError for a word without numbers, or an option
    that is given twice."""
    found = []
    for word in words:
        name, _, numbers = word.partition("=")
        try:
            found.append((name, [float(number) for number in numbers.split(",")]))
        except ValueError:
            raise InputError(f"--vary: must be OPTION=NUMBER,…, such as alpha=1,5,25, got {word!r}") from None
    return each_once("--vary", found)


def _motions(options: argparse.Namespace, run: Request, names: Sequence[str]) -> dict[str, Motion]:
    """Return the motions to plot by label: one, or one for each value of ``--vary``."""
    methods: dict[str, Method | str | None] = {"": run.method}
    if options.vary:
        if run.method is None:
            raise InputError("--vary: needs --method, whose options it varies")
        from mbref.simulation.sweep import methods_of

        methods = dict(methods_of(run.method, _values(options.vary)))
    return {
        label: motion_by(run._replace(method=each), options.motors, names) for label, each in methods.items()
    }


def _plot(options: argparse.Namespace) -> int:
    path, run = path_of(options, "-plot", (".svg", ".png")), request_of(options)
    over = [] if options.over == "time" else [options.over]
    names = [*options.columns, *over]
    motions = _motions(options, run, names)
    style = {"over": options.over, "units": options.units or "", "together": options.together}
    try:
        figure = plot(motions, *options.columns, **style)
    except ImportError:
        raise InputError("a plot needs matplotlib: pip install 'mbref[report]'") from None
    with replaced(path) as fresh:
        figure.savefig(fresh, dpi=150)
    print(path)
    return exit_status(motions)
