"""mbref run: simulate a scene by one method."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref.cli.motors import add_motors, motion_by
from mbref.cli.output import STATE, body_table, column_tables, console, largest_numbers, progress_bar, rounded
from mbref.cli.request import add_method_options, add_scene, add_units, request_of
from mbref.command_line import add_output, each_once
from mbref.input_error import InputError
from mbref.motions.motion import Motion
from mbref.motions.output_units import requested_units, unit_of_column
from mbref.motions.outputs import UNIT_OF, chosen
from mbref.records import strict_json
from mbref.scene import Scene
from mbref.scene.bodies import DRIVER
from mbref.scene.interpolation import interpolation_notes

if TYPE_CHECKING:
    from rich.table import Table

# CPU seconds of a run below which its error is estimated by default, and limit of the second run
ESTIMATE_SECONDS = 5.0
SHOWN_POSITIONS = 10  # number of singular positions, and of events, in the text; --json prints all


def add(commands: Any) -> None:
    """Add the command's parser."""
    run = commands.add_parser(
        "run",
        action=_run,
        help="simulate a scene by one method",
        description="Simulate a scene by one method: formulation+stabilisation/integrator.",
        epilog="examples:\n"
        "  mbref run planar_slider_crank --method mpi-svd+projection --times 0.1,0.2,0.4 --rtol 1e-11\n"
        "  mbref run four_bar --method mpi-svd+partitioning --duration 0.02 --json\n"
        "  mbref run mechanism.toml --method 'lm1+baumgarte[alpha=10,beta=10]/rk4[step=1e-4]'\n"
        "  mbref run four_bar --duration 0.1 --branch 2=2\n"
        "  mbref run mechanism.toml --out run.csv --units mm,deg --decimal-comma\n"
        '  mbref run spatial_slider_crank --samples 5 --columns slider.position "driver(A).torque"\n'
        "  mbref run arm.toml --motors A E --out torques.csv",
    )
    add_scene(run)
    add_method_options(run)
    add_output(
        run,
        "--out",
        metavar="FILE",
        help="write the whole motion: .csv is a table of columns, .json what\nmbref.Motion.load reads",
    )
    run.add_argument(
        "--columns",
        nargs="+",
        metavar="COLUMN",
        default=[],
        help="print these numbers over time, and write only them to a .csv, such as rod.position energy;\n"
        "mbref list outputs prints their names",
    )
    add_units(run)
    add_motors(run)
    run.add_argument(
        "--decimal-comma",
        action="store_true",
        help="write a .csv with decimal commas and ; between numbers, for spreadsheets that expect them",
    )
    run.add_argument(
        "--maxima",
        action="store_true",
        help="print the largest force and moment of each joint among the samples, with their times",
    )
    run.add_argument(
        "--branch",
        action="append",
        metavar="CROSSING=BRANCH",
        default=[],
        help="at a singular position, counted from 1, take another branch than the smooth one, which is 1;\n"
        "a run lists the branches at every crossing; e.g. --branch 2=2.  May be repeated",
    )
    run.add_argument(
        "--estimate",
        choices=("auto", "yes", "no"),
        default="auto",
        help="estimate the global error by a second run at a smaller tolerance: auto (default), unless it\n"
        f"takes longer than {ESTIMATE_SECONDS:g} s; yes, however long it takes; no",
    )


def _run(options: argparse.Namespace) -> int:
    if options.decimal_comma and not str(options.out).endswith(".csv"):
        raise InputError("--decimal-comma: needs --out FILE.csv, whose numbers it writes")
    if options.motors and (options.json or str(options.out).endswith(".json")):
        raise InputError("--motors: JSON has no numbers of motors; use --columns, or --out FILE.csv")
    write, run = _writer(options.out), request_of(options, _branches(options.branch))
    motion = motion_by(
        run, options.motors, options.columns, lambda motion: _estimated(motion, options.estimate)
    )
    if options.out:
        write(motion, options)
    if options.json:
        print(strict_json({"scene": run.scene.name, "records": [motion.to_record()]}))
    else:
        show(run.scene, motion, options.columns, requested_units(options.units or ""), options.maxima)
    return 0 if motion.outcome.name == "COMPLETED" else 1


def _estimated(motion: Motion, wanted: str) -> Motion:
    """Return the motion, with its error estimate if the options request an estimate."""
    if wanted == "no":
        return motion
    from mbref.simulation.second_run import with_error_estimate

    with progress_bar("estimating the error", motion.t_end) as progress:
        return with_error_estimate(motion, ESTIMATE_SECONDS if wanted == "auto" else math.inf, progress)


def _branches(words: list[str]) -> dict[int, int]:
    """Return the branch for each crossing; raises InputError for a word that is not of the form
    ``CROSSING=BRANCH``, or a crossing that is given twice."""
    try:
        pairs = [(int(crossing), int(branch)) for crossing, branch in (word.split("=") for word in words)]
    except ValueError:
        raise InputError(f"--branch: must be CROSSING=BRANCH, such as 2=2, got {' '.join(words)!r}") from None
    return each_once("--branch", pairs)


def _writer(out: str | None) -> Any:
    """Return the writer for a file of that name; raises InputError for an unknown file suffix."""
    writers = {".csv": _write_table, ".json": lambda motion, options: motion.save(options.out)}
    if out is not None and Path(out).suffix not in writers:
        raise InputError(f"--out: must end in {' or '.join(writers)}, got {out!r}")
    return writers[Path(out).suffix] if out else None


def _write_table(motion: Motion, options: argparse.Namespace) -> None:
    style = {"units": options.units, "decimal_comma": options.decimal_comma}
    motion.to_csv(options.out, *options.columns, **style)


def show(
    scene: Scene,
    trajectory: Motion,
    columns: Sequence[str] = (),
    units: Sequence[str] = (),
    with_maxima: bool = False,
) -> None:
    """Print the end of a run, its error estimate and cost, and its last state or the requested columns."""
    out, cost = console(), trajectory.cost
    out.print(f"{scene.name} by {trajectory.method}: {trajectory.outcome.name} at t = {trajectory.t_end:g} s")
    if trajectory.message:
        out.print(trajectory.message)
    if trajectory.error_estimate is not None:
        out.print(trajectory.error_estimate.sentence)
    for note in interpolation_notes(scene):
        out.print(note)
    out.print(
        f"{cost.steps} steps, {cost.rejected} rejected, {cost.rhs} evaluations\n"
        f"{cost.factorisations} factorisations, {cost.newton} Newton iterations\n"
        f"{cost.seconds:.3g} s of stepping, {cost.build_seconds:.2g} s of building"
    )
    for number, crossing in enumerate((trajectory.crossings or ())[:SHOWN_POSITIONS], 1):
        taken = f"number {crossing.taken} taken" if crossing.taken else "none taken"
        out.print(f"singular position {number} at t = {crossing.time:.6g} s: {crossing.sentence}, {taken}")
    for event in (trajectory.events or ())[:SHOWN_POSITIONS]:
        out.print(f"event at t = {event.time:.6g} s: {event.sentence}")
    if not trajectory.times.size:
        return
    out.print("\n".join((*_largest(trajectory, units), *_motors(trajectory, units))))
    if with_maxima:
        out.print(_maxima_table(trajectory, units))
    if columns:
        table_of_all = trajectory.columns()
        shown = {name: table_of_all[name] for name in ["time", *chosen(table_of_all, columns)]}
        largest = largest_numbers(table_of_all, trajectory.t_end)
        for table in column_tables(shown, largest, units, out.width):
            out.print(table)
        for sentence in _undetermined(trajectory, columns):
            out.print(sentence)
        return

    largest = largest_numbers({field: getattr(trajectory, field) for field in STATE}, trajectory.t_end)

    def numbers(b: int, field: str) -> list[str]:
        values = rounded(field, getattr(trajectory, field)[-1, b], largest)
        return [f"{x:.5g}" for x in values / unit_of_column(field, units)[1]]

    out.print(body_table(f"state at t = {trajectory.times[-1]:g} s", trajectory.bodies, numbers, units))


def _maxima_table(motion: Motion, units: Sequence[str]) -> Table:
    """Return a table with the largest force and moment of each joint, their times, and open components."""
    from rich.table import Table

    quantities = ("force", "time", "moment", "time")
    forms = [unit_of_column(quantity, units) for quantity in quantities]
    table = Table(title="largest reactions among the samples")
    table.add_column("joint", overflow="fold")
    for quantity, (unit, _) in zip(quantities, forms, strict=True):
        table.add_column(f"{quantity}\n{unit}", justify="right")
    table.add_column("open", justify="right")
    maxima = motion.reaction_maxima()
    columns = {"force": [each.force for each in maxima.values()], "position": motion.position}
    largest = largest_numbers({name: np.array(values) for name, values in columns.items()}, motion.t_end)
    for name, found in maxima.items():
        moment = float(rounded("moment", np.array(found.moment), largest))
        values = (found.force, found.force_time, moment, found.moment_time)
        table.add_row(
            name, *(f"{x / size:.6g}" for x, (_, size) in zip(values, forms, strict=True)), str(found.open)
        )
    return table


def _undetermined(motion: Motion, columns: Sequence[str]) -> Iterator[str]:
    """Yield a sentence for each driver among the columns whose force or torque equilibrium does not
    determine."""
    for driver in motion.mechanism.driver:
        name, marks = DRIVER.format(driver.joint), motion.driver(driver.joint).open
        if marks is not None and marks.any() and any(column.startswith(name) for column in columns):
            yield (
                f"{name}: equilibrium does not determine its force or torque at {int(marks.sum())} of "
                f"{len(marks)} samples; another driver or constraint can take its place"
            )


def _motors(motion: Motion, units: Sequence[str]) -> Iterator[str]:
    """Yield the largest force or torque of each motor, redundant motors, and undecided samples."""
    for name, motor in motion.motors.items():
        kind, size = "force" if motor.torque is None else "torque", motor.amount
        (unit, one), known = unit_of_column(kind, units), ~np.isnan(size)
        if known.any():
            k = int(np.nanargmax(np.abs(size)))
            at = f"at t = {motion.times[k]:.6g} s"
            yield f"motor({name}): largest {kind} {size[k] / one:.5g} {unit} {at}"
        if not known.all():
            yield (
                f"motor({name}): UNDECIDED near a singular position, at {int((~known).sum())} of "
                f"{known.size} samples"
            )
    if shared := [name for name, motor in motion.motors.items() if motor.open.any()]:
        yield f"motors {', '.join(shared)} can replace each other; their torques have the least norm"


def _largest(motion: Motion, units: Sequence[str]) -> Iterator[str]:
    """Yield sentences on the largest violations of constraint rows, and on the largest reaction with its
    joint and time."""
    levels = [
        f"{float(rows.max()):.2g} {UNIT_OF[f'{level}_violation']}"
        for level, rows in motion.violation._asdict().items()
        if rows is not None
    ]
    yield f"largest violation of a constraint row {', '.join(levels)}"
    if maxima := motion.reaction_maxima():
        name, found = max(maxima.items(), key=lambda item: item[1].force)
        unit, size = unit_of_column("force", units)
        at = f"in joint {name} at t = {found.force_time:.6g} s"
        yield f"largest reaction among the samples {found.force / size:.5g} {unit} {at}"
