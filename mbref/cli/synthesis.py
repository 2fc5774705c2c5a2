"""mbref design: numbers of a scene whose motion follows points, or whose outputs are least."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref.cli.output import console, open_combinations, progress_bar, warn
from mbref.cli.request import add_scene, add_time_options, sample_times
from mbref.command_line import add_output, output_file, whole
from mbref.files import replaced
from mbref.input_error import InputError
from mbref.records import strict_json
from mbref.scene import Scene
from mbref.scenes import find_scene

if TYPE_CHECKING:
    from mbref.design.synthesis.result import SynthesisResult

MOST_SEARCHES = 1000
MOST_ROWS_SHOWN = 20  # points in the printed table; --json has all


def add(commands: Any) -> None:
    """Add the command's parser."""
    command = commands.add_parser(
        "design",
        action=_design,
        help="numbers of a scene whose motion follows points, or whose outputs are least",
        description="Dimensional synthesis: changes numbers of a scene until its motion goes through\n"
        "given points (--follow), or until outputs such as a driver's torque are least (--least).\n"
        "Derivatives are exact, loops stay closed, and the search is repeated from several starts.\n"
        "Prints the numbers, the residual at each point, active bounds, and combinations of numbers\n"
        "that have no effect.",
        epilog="points.csv has a line of columns (mbref list outputs) and a line for each point, SI units.\n"
        "With a column time, points are reached at these times; without, in their order at any\n"
        "times up to the duration. An empty cell gives no condition:\n"
        "  time,coupler.position.x,coupler.position.y\n"
        "  0.1,0.42,0.31\n"
        "  0.2,,0.33\n\n"
        "examples:\n"
        "  mbref design my.toml --let 'joint[B].anchor.x' --let 'body[coupler].position.y 0.1 0.5' \\\n"
        "      --follow points.csv --out found.toml --plot found.svg\n"
        "  mbref design my.toml --let 'body[crank].position.x -0.3 0.3' --least 'driver(A).torque' --peak",
    )
    add_scene(command)
    command.add_argument(
        "--let",
        action="append",
        required=True,
        metavar="NUMBER",
        help="number that may change, with two bounds if there are any: 'joint[B].anchor.x 0.5 2';\n"
        "may be repeated",
    )
    goal = command.add_mutually_exclusive_group(required=True)
    goal.add_argument("--follow", metavar="FILE.csv", help="points: columns with their wanted values")
    goal.add_argument("--least", metavar="NAME,…", help="outputs that become as small as possible")
    command.add_argument(
        "--peak", action="store_true", help="minimise the largest residual (default: the mean square)"
    )
    command.add_argument(
        "--starts",
        type=whole(1, MOST_SEARCHES),
        default=4,
        help="the scene's own numbers, and random ones (default 4); more find better minima",
    )
    command.add_argument(
        "--seed", type=whole(0, 2**31), default=0, help="seed of the random numbers (default 0)"
    )
    add_time_options(command)
    add_output(command, "--out", metavar="FILE.toml", help="write the scene that was found")
    command.add_argument(
        "--plot", type=output_file, metavar="FILE", help="plot before and after: .svg or .png"
    )
    command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def _design(options: argparse.Namespace) -> int:
    from mbref.design.synthesis.synthesise import synthesise

    for option, ends in (("out", (".toml",)), ("plot", (".svg", ".png"))):
        if (path := getattr(options, option)) and not path.endswith(ends):
            raise InputError(f"--{option}: must end in {' or '.join(ends)}, got {path!r}")
    scene, (let, bounds) = find_scene(options.scene), _numbers(options.let)
    warn(scene)
    timed = options.least is not None
    if not timed and (options.times or options.samples):
        raise InputError("--follow: has its times in the column time; leave out --times and --samples")
    times = sample_times(options, scene)
    if options.duration:
        scene = scene.with_(duration=options.duration)
    with progress_bar("searching", float(options.starts)) as progress:
        found = synthesise(
            scene,
            let,
            follow=options.follow,
            least=options.least.split(",") if timed else None,
            bounds=bounds,
            peak=options.peak,
            times=times if timed else None,
            starts=options.starts,
            seed=options.seed,
            progress=progress,
        )
    if options.out:
        found.scene.save(options.out)
    if options.plot:
        _plot(options.plot, scene, found, points=not timed)
    if options.json:
        print(strict_json(found.to_record()))
    else:
        _show(found, timed)
    return 0 if found.converged else 1


def _numbers(words: Sequence[str]) -> tuple[list[str], dict[str, tuple[float, float]]]:
    """Return the numbers that may change, and the bounds of those that have them."""
    let, bounds = [], {}
    for word in words:
        parts = word.split()
        count = len([*itertools.takewhile(_is_limit, reversed(parts))])
        if count not in (0, 2) or count == len(parts):
            raise InputError(
                f"--let: must be a number, or one with two bounds: 'joint[B].anchor.x 0.5 2', got {word!r}"
            )
        label, *given = word.rsplit(maxsplit=count) if count else [word]
        let.append(label)
        if given:
            bounds[label] = float(given[0]), float(given[1])
    return let, bounds


def _is_limit(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _show(found: SynthesisResult, least: bool) -> None:
    """Print the numbers, the residuals, and what else is known of the result."""
    lines = [f"{name} = {x:.12g}" for name, x in found.numbers.items()]
    lines += [f"at its {side} bound: {name}" for name, side in found.at_bounds.items()]
    lines += open_combinations(found.undetermined)
    console().print("\n".join(lines), soft_wrap=True)
    if not least:
        _show_points(found)
    for name, before, after in zip(found.columns, found.residuals_before.T, found.residuals.T, strict=True):
        sizes = [f"{_mean(values):.3g} (largest {_largest(values):.3g})" for values in (before, after)]
        console().print(f"root mean square of {name}: {sizes[0]} before, {sizes[1]} now", soft_wrap=True)
    console().print("\n".join(_sentences(found, least)), soft_wrap=True)


def _mean(values: np.ndarray) -> float:
    return float(np.sqrt((values[np.isfinite(values)] ** 2).mean())) if np.isfinite(values).any() else np.nan


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values[np.isfinite(values)]).max()) if np.isfinite(values).any() else np.nan


def _show_points(found: SynthesisResult) -> None:
    """Print the residual at each point."""
    from rich.table import Table

    count, shown = len(found.times), min(len(found.times), MOST_ROWS_SHOWN)
    table = Table(title=f"residuals, {shown} of {count} points" if shown < count else "residuals")
    for title in ("point", "time, s", *found.columns):
        table.add_column(title, overflow="fold", justify="right")
    for k, (t, row) in enumerate(zip(found.times[:MOST_ROWS_SHOWN], found.residuals, strict=False), 1):
        table.add_row(str(k), f"{t:.6g}", *("" if np.isnan(x) else f"{x:.3g}" for x in row))
    console().print(table)


def _sentences(found: SynthesisResult, least: bool) -> list[str]:
    """Return the outcome, in sentences."""
    lines = []
    if not least:
        far = "not all points are reached"
        far += "; the residuals are the least ones near the starts" * found.converged
        lines.append("all points are reached" if found.reached else far)
    known = [size for size in found.starts if size is not None]
    if len(found.starts) > 1:
        lines.append(f"{len(known)} of {len(found.starts)} starts end at a result, with sizes of residuals:")
        lines.append(", ".join(f"{size:.3g}" for size in known))
    if found.refused:
        lines.append(
            f"the search stepped back from {found.refused} trials that cannot move so far, the last one: "
            f"{found.last_reason}"
        )
    lines += ["the search ended before a minimum"] * (not found.converged)
    return lines


def _plot(path: str, scene: Scene, found: SynthesisResult, points: bool) -> None:
    from mbref.design.synthesis.before_after import before_and_after

    try:
        figure = before_and_after(scene, found, points)
    except ImportError:
        raise InputError("a plot needs matplotlib: pip install 'mbref[report]'") from None
    with replaced(path) as fresh:
        figure.savefig(fresh, dpi=150)
