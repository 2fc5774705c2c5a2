"""mbref plot: numbers of a motion over time as a figure."""

from __future__ import annotations

import argparse
from typing import Any

from mbref.cli.output import exit_status
from mbref.cli.pictures import path_of
from mbref.cli.request import add_method_options, add_scene, add_units, request_of
from mbref.command_line import add_output
from mbref.files import replaced
from mbref.input_error import InputError
from mbref.motions.outputs import OUTPUTS

COLUMN_LIST = "columns:\n" + "\n".join(f"  {o.column:31} {o.unit:13} {o.meaning}" for o in OUTPUTS)


def add(commands: Any) -> None:
    """Add the command's parser."""
    plot = commands.add_parser(
        "plot",
        action=_plot,
        help="numbers of a motion over time as PNG or SVG",
        description="Simulate a scene and plot columns of its motion over time, one panel for each\n"
        "quantity. Needs the extra report.",
        epilog="examples:\n  mbref plot mechanism.toml\n"
        "  mbref plot four_bar_gravity rocker.position A.angle --out run.png\n"
        '  mbref plot spatial_slider_crank slider.position "driver(A).torque"\n'
        "  mbref plot four_bar coupler.position.y --over A.angle --units mm,deg\n\n" + COLUMN_LIST,
    )
    add_scene(plot)
    plot.add_argument(
        "columns",
        nargs="*",
        metavar="COLUMN",
        help="a column or its beginning, such as rod.position (default: joint coordinates and energy)",
    )
    plot.add_argument(
        "--over",
        default="time",
        metavar="COLUMN",
        help="column of the horizontal axis, such as A.angle of a driven joint (default: time)",
    )
    plot.add_argument("--together", action="store_true", help="one panel for all columns of one unit")
    add_units(plot)
    add_output(plot, "--out", metavar="FILE", help=".svg or .png (default: as the scene, with -plot.svg)")
    add_method_options(plot, json=False)


def _plot(options: argparse.Namespace) -> int:
    path, run = path_of(options, "-plot", (".svg", ".png")), request_of(options)
    over = [] if options.over == "time" else [options.over]
    names = [*options.columns, *over]
    motion = run.motion((lambda first: first.columns(*names)) if names else None)
    style = {"over": options.over, "units": options.units or "", "together": options.together}
    try:
        figure = motion.plot(*options.columns, **style)
    except ImportError:
        raise InputError("a plot needs matplotlib: pip install 'mbref[report]'") from None
    with replaced(path) as fresh:
        figure.savefig(fresh, dpi=150)
    print(path)
    return exit_status(motion)
