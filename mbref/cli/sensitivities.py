"""mbref sensitivities: derivatives of outputs of a motion with respect to numbers of the scene."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref.cli.output import console, warn
from mbref.cli.request import add_scene, add_time_options, sample_times
from mbref.command_line import add_output
from mbref.input_error import InputError
from mbref.motions.trajectory import Outcome
from mbref.records import strict_json
from mbref.scenes import find_scene

if TYPE_CHECKING:
    from mbref.design.derivatives.result import Sensitivities

ENDINGS = (".npz", ".json", ".csv")


def add(commands: Any) -> None:
    """Add the parser of the command."""
    command = commands.add_parser(
        "sensitivities",
        action=_sensitivities,
        help="derivatives of outputs of a motion with respect to numbers of the scene",
        description="Derivatives of columns of a motion (mbref list outputs) with respect to numbers of the\n"
        "scene, such as masses, anchors, stiffnesses, gravity, and angles and rates of joints at t = 0, by\n"
        "the variational equations. All other numbers of the scene stay as they are. Prints the\n"
        "derivatives at the last sample; --out writes all.",
        epilog="examples:\n"
        "  mbref sensitivities four_bar_gravity --of A.angle,energy --to body[rocker].mass,gravity.y\n"
        "  mbref sensitivities my.toml --of slider.position --to 'joint[A].angle(0)' --out d.csv",
    )
    add_scene(command)
    for option, what in (("--of", "outputs: columns or their beginnings"), ("--to", "numbers of the scene")):
        command.add_argument(option, required=True, metavar="NAME,…", help=what)
    add_time_options(command)
    command.add_argument(
        "--rtol", type=float, default=1e-12, help="relative tolerance of the runs (default 1e-12)"
    )
    add_output(command, "--out", metavar="FILE", help="write all samples: .npz, .json or .csv")
    command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def _sensitivities(options: argparse.Namespace) -> int:
    from mbref.design.derivatives.sensitivities import sensitivities
    from mbref.stepping.limits import Limits

    if options.out and not options.out.lower().endswith(ENDINGS):
        raise InputError(f"--out: must end in {', '.join(ENDINGS)}, got {options.out!r}")
    scene = find_scene(options.scene)
    times = sample_times(options, scene)
    warn(scene)
    of, to = (text.split(",") for text in (options.of, options.to))
    found = sensitivities(scene, of, to, times, Limits(rtol=options.rtol))
    if options.out:
        found.save(options.out)
    if options.json:
        print(strict_json(found.to_record()))
    else:
        _show(found)
        if options.out:
            console().print(options.out, soft_wrap=True)
    return 0 if found.outcome is Outcome.COMPLETED else 1


def _show(found: Sensitivities) -> None:
    """Print the derivatives at the last sample at which they exist, with their estimated errors."""
    from rich.table import Table

    known = np.flatnonzero(np.isfinite(found.values).all(axis=(1, 2)))
    if found.message:
        console().print(found.message, soft_wrap=True)
    if not known.size:
        return
    table = Table(title=f"derivatives at t = {found.times[known[-1]]:g} s")
    for title in ("output", "number", "derivative", "error", "unit"):
        table.add_column(title, overflow="fold")
    for o, output in enumerate(found.outputs):
        for p, parameter in enumerate(found.parameters):
            value, error = found.values[known[-1], o, p], found.errors[known[-1], o, p]
            table.add_row(output, parameter, f"{value:.12g}", f"{error:.1e}", found.units[o][p])
    console().print(table)
