"""mbref sensitivities and mbref fit: derivatives of motions by numbers of a scene, and their estimation."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref.cli.output import console, open_combinations, warn
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
    """Add the parsers of both commands."""
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

    match = commands.add_parser(
        "fit",
        action=_fit,
        help="numbers of a scene from measured columns of its motion",
        description="Least squares over numbers of a scene, by exact derivatives: finds the motion that is\n"
        "nearest to measured columns, each relative to its standard deviation. Prints the numbers with\n"
        "standard errors, and the combinations of numbers that the columns do not determine.",
        epilog="example:\n"
        "  mbref fit my.toml run.csv --free 'body[rod].mass' --free 'joint[B].anchor.x' --out fitted.toml",
    )
    add_scene(match)
    match.add_argument("measured", metavar="FILE.csv", help="time and columns (mbref list outputs), SI units")
    match.add_argument(
        "--free", action="append", required=True, metavar="NUMBER", help="number to fit; may be repeated"
    )
    match.add_argument(
        "--of", metavar="NAME,…", help="columns to use, or their beginnings (default: all with derivatives)"
    )
    add_output(match, "--out", metavar="FILE.toml", help="write the scene with the fitted numbers")
    match.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


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


def _fit(options: argparse.Namespace) -> int:
    from mbref.design.derivatives.fit import fit

    if options.out and not options.out.endswith(".toml"):
        raise InputError(f"--out: must end in .toml, got {options.out!r}")
    of = options.of.split(",") if options.of else None
    found = fit(options.scene, options.measured, options.free, of)
    if options.out:
        found.scene.save(options.out)
    if options.json:
        print(strict_json(found.to_record()))
        return 0 if found.converged else 1
    lines = [
        f"{name} = {x:.9g}, standard error {found.errors[name]:.2g}" for name, x in found.numbers.items()
    ]
    lines += open_combinations(found.undetermined)
    lines += [f"root mean square residual of {name}: {x:.3g}" for name, x in found.deviations.items()]
    if found.left_out:
        lines.append(f"left out, without a derivative: {', '.join(found.left_out)}")
    lines += ["the iteration ended before a minimum"] * (not found.converged)
    console().print("\n".join(lines), soft_wrap=True)
    return 0 if found.converged else 1
