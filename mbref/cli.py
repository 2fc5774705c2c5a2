"""The command line of mbref: run a scene, run variants of it, or say what it is."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref.scene import Scene, SceneError
from mbref.scenes import SCENES, find_scene
from mbref.simulation.method import DEFAULT, MethodError
from mbref.trajectory import Trajectory

if TYPE_CHECKING:
    from mbref.equations.diagnosis import Diagnosis
    from mbref.simulation.simulate import Limits

BAD_INPUT, INCOMPLETE, INTERRUPTED = 2, 1, 130
PIPED_WIDTH = 160  # characters of a line where no terminal says otherwise


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit status: 0 completed, 1 ended otherwise, 2 bad input."""
    options = _parser().parse_args(arguments)
    try:
        return options.action(options)
    except SceneError as error:
        return _refuse(error.faults)
    except (MethodError, ValueError) as error:
        return _refuse([str(error)])
    except KeyboardInterrupt:
        print("mbref: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output has gone, as `head` does
        sys.stdout = None
        return INCOMPLETE


def _refuse(faults: Sequence[str]) -> int:
    for fault in faults:
        print(fault, file=sys.stderr)
    return BAD_INPUT


def _parser() -> argparse.ArgumentParser:
    text = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="mbref",
        formatter_class=text,
        description="Reference implementation of the constraint-handling methods of multibody dynamics.",
        epilog="examples:\n  mbref run planar_slider_crank\n  mbref diagnose five_bar\n  mbref run --help",
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    scene_help = "a built-in name or a .toml file; built in: " + ", ".join(SCENES)

    run = commands.add_parser(
        "run", help="simulate a scene by one method", formatter_class=text,
        description="Simulate a scene by one method: formulation+stabilisation/integrator.",
        epilog="examples:\n"
        "  mbref run planar_slider_crank --method mpi-svd+projection --times 0.1,0.2,0.4 --rtol 1e-11\n"
        "  mbref run four_bar --method mpi-svd+partitioning --duration 0.02 --json\n"
        "  mbref run mechanism.toml --method lm1+baumgarte[alpha=10,beta=10]/rk4[step=1e-4]",
    )  # fmt: skip
    run.add_argument("scene", metavar="SCENE", help=scene_help)
    _add_method_options(run)
    run.set_defaults(action=_run)

    many = commands.add_parser(
        "ensemble", help="simulate variants of a scene on every core", formatter_class=text,
        description="Simulate copies of a scene with numbers drawn at random; mean and standard deviation\n"
        "of every body at the last time. Interrupted, --out keeps what has ended; the same command goes on.",
        epilog="example:\n"
        "  mbref ensemble planar_slider_crank --vary 'joint[B].anchor[0]=0.304+-1e-4' \\\n"
        "      --vary 'body[slider].mass=0.9:1.1' --count 500 --duration 0.1 --out runs.jsonl",
    )  # fmt: skip
    many.add_argument("scene", metavar="SCENE", help=scene_help)
    many.add_argument(
        "--vary", action="append", required=True, metavar="PATH=LOW:HIGH",
        help="a number that varies, uniform; PATH=MEAN+-DEVIATION: normal; may repeat",
    )  # fmt: skip
    many.add_argument("--count", type=int, default=100, help="variants (default 100)")
    many.add_argument("--seed", type=int, default=0, help="of the random numbers (default 0)")
    many.add_argument("--workers", type=int, help="processes (default: one a core)")
    many.add_argument("--out", metavar="FILE", help="append every trajectory, one JSON line each")
    _add_method_options(many)
    many.set_defaults(action=_ensemble)

    diagnose = commands.add_parser(
        "diagnose", help="say what a scene is: counts, rank, redundant rows", formatter_class=text,
        description="Counts, rank, redundant rows by joint, unique reactions and the distance to a singular\n"
        "position, at t = 0.",
        epilog="examples:\n  mbref diagnose five_bar\n  mbref diagnose mechanism.toml --json",
    )  # fmt: skip
    diagnose.add_argument("scene", metavar="SCENE", help=scene_help)
    diagnose.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    diagnose.set_defaults(action=_diagnose)
    return parser


def _add_method_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--method", default=DEFAULT, help=f"or kinematic; default {DEFAULT}")
    add_time_options(parser)
    parser.add_argument("--rtol", type=float, default=1e-9, help="relative tolerance per step (default 1e-9)")
    parser.add_argument(
        "--code", choices=("auto", "generic", "specialised"), default="auto",
        help="kernels that serve every scene, machine code of this scene's own, or (default) the latter\n"
        "where 20 000 steps are ahead; evaluations agree to rounding",
    )  # fmt: skip
    parser.add_argument("--max-step", type=float, default=0.0, help="largest step, s (default: the duration)")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def add_time_options(parser: argparse.ArgumentParser) -> None:
    """--times, or --samples over --duration."""
    when = parser.add_mutually_exclusive_group()
    when.add_argument("--times", help="sample times in s, increasing, e.g. 0.1,0.2,0.4")
    when.add_argument("--samples", type=int, help="this many equally spaced times from 0 to the duration")
    parser.add_argument("--duration", type=float, help="end time in s (default: the scene's)")


def sample_times(options: argparse.Namespace, scene: Scene) -> np.ndarray:
    """The sample times the options ask for; ValueError names the option that is wrong."""
    duration = scene.duration if options.duration is None else options.duration
    if not 0 < duration < np.inf:
        raise ValueError(f"--duration: must be positive, got {duration:g}")
    if options.times is None:
        samples = 101 if options.samples is None else options.samples
        if samples < 2:
            raise ValueError(f"--samples: must be at least 2, got {samples}")
        return np.linspace(0.0, duration, samples)
    try:
        times = np.array([float(word) for word in options.times.split(",")])
    except ValueError:
        raise ValueError(f"--times: must be numbers separated by commas, got {options.times!r}") from None
    if not np.isfinite(times).all() or times[0] < 0 or np.any(np.diff(times) <= 0):
        raise ValueError(f"--times: must be finite, not negative and increasing, got {options.times}")
    times = times if options.duration is None else times[times <= duration]
    if not times.size:
        raise ValueError(f"--times: none is within --duration {duration:g}")
    return times


def _run(options: argparse.Namespace) -> int:
    scene = find_scene(options.scene)
    times, limits = sample_times(options, scene), _limits(options)
    from mbref.simulation.simulate import simulate

    with _progress_bar("simulating", float(times[-1])) as progress:
        trajectory = simulate(scene, options.method, times, limits, progress)
    if options.json:
        print(json.dumps({"scene": scene.name, "records": [trajectory.to_record()]}))
    else:
        _show(scene, trajectory)
    return 0 if trajectory.outcome.name == "COMPLETED" else INCOMPLETE


def _limits(options: argparse.Namespace) -> Limits:
    from mbref.simulation.simulate import Limits

    if not 0 < options.rtol < 1:
        raise ValueError(f"--rtol: must be between 0 and 1, got {options.rtol:g}")
    if options.max_step < 0:
        raise ValueError(f"--max-step: must not be negative, got {options.max_step:g}")
    return Limits(rtol=options.rtol, largest_step=options.max_step, code=options.code)


@contextmanager
def _progress_bar(what: str, end: float) -> Iterator[Callable[[float], None]]:
    """Tells how far it is on stderr, where that is a terminal; appears only on long runs."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=end)
        yield lambda t: bar.update(task, completed=t)


def _ensemble(options: argparse.Namespace) -> int:
    from mbref.simulation.ensemble import ensemble, processes
    from mbref.variation import Variation, variants

    scene = find_scene(options.scene)
    times, limits = sample_times(options, scene), _limits(options)
    if options.count < 1 or not (options.workers is None or options.workers > 0):
        raise ValueError("--count and --workers: must be at least 1")
    scenes = variants(scene, [Variation.parse(text) for text in options.vary], options.count, options.seed)
    runs = {}
    with processes(options.workers) as pool, _progress_bar("simulating", options.count) as progress:
        for place, run in ensemble(scenes, times, options.method, limits, pool, options.out):
            runs[place] = run
            progress(len(runs))
    completed = [run for _, run in sorted(runs.items()) if run.outcome.name == "COMPLETED"]
    _show_spread(scene, float(times[-1]), completed, options)
    return 0 if len(completed) == options.count else INCOMPLETE


def _show_spread(
    scene: Scene, end: float, completed: Sequence[Trajectory], options: argparse.Namespace
) -> None:
    """Mean and standard deviation of every body over the completed runs, at the last time."""
    from rich.console import Console
    from rich.table import Table

    keys = ("position", "velocity", "angular_velocity")
    last = {key: np.array([getattr(run, key)[-1] for run in completed]) for key in keys}
    if options.json:
        spread = {
            f"{what}_{key}": {body.name: a[b].tolist() for b, body in enumerate(scene.body)}
            for key, values in last.items() if completed
            for what, a in (("mean", values.mean(axis=0)), ("deviation", values.std(axis=0)))
        }  # fmt: skip
        print(json.dumps({"scene": scene.name, "time": end, "completed": len(completed), **spread}))
        return
    console = Console() if sys.stdout.isatty() else Console(width=PIPED_WIDTH)
    seconds = sum(run.cost.seconds for run in completed)
    console.print(
        f"[bold]{scene.name}[/]: {len(completed)} of {options.count} variants completed, "
        f"{seconds:.3g} s of stepping in all"
    )
    if not completed:
        return
    table = Table(title=f"mean ± standard deviation at t = {end:g} s")
    for heading in ("body", "position, m", "velocity, m/s", "angular velocity, rad/s"):
        table.add_column(heading, no_wrap=True)
    for b, body in enumerate(scene.body):
        cells = ([_rounded(f(a[:, b], axis=0)) for f in (np.mean, np.std)] for a in last.values())
        table.add_row(
            body.name,
            *("  ".join(f"{m:.5g} ± {d:.2g}" for m, d in zip(*cell, strict=True)) for cell in cells),
        )
    console.print(table)


def _show(scene: Scene, trajectory: Trajectory) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console() if sys.stdout.isatty() else Console(width=PIPED_WIDTH)
    cost = trajectory.cost
    ended = trajectory.outcome
    console.print(f"[bold]{scene.name}[/] by {trajectory.method}: {ended.name} at t = {trajectory.t_end:g} s")
    if trajectory.message:
        console.print(trajectory.message)
    console.print(
        f"{cost.steps} steps, {cost.rejected} rejected, {cost.rhs} evaluations, "
        f"{cost.factorisations} factorisations, {cost.newton} Newton iterations\n"
        f"{cost.seconds:.3g} s of stepping, {cost.build_seconds:.2g} s of building"
    )
    if not trajectory.times.size:
        return
    table = Table(title=f"state at t = {trajectory.times[-1]:g} s")
    table.add_column("body", no_wrap=True)
    for heading in ("position, m", "velocity, m/s", "angular velocity, rad/s"):
        table.add_column(heading, justify="right", no_wrap=True)
    for b, name in enumerate(trajectory.bodies):
        arrays = trajectory.position, trajectory.velocity, trajectory.angular_velocity
        table.add_row(name, *(" ".join(f"{x:.5g}" for x in _rounded(array[-1, b])) for array in arrays))
    console.print(table)


def _rounded(vector: np.ndarray) -> np.ndarray:
    """Without the rounding errors of zeros, for reading."""
    return np.round(vector, 12) + 0.0


def _diagnose(options: argparse.Namespace) -> int:
    from dataclasses import asdict

    from mbref.equations.diagnosis import diagnose

    scene = find_scene(options.scene)
    found = diagnose(scene)
    counts = found.counts
    if options.json:
        print(json.dumps({"scene": scene.name, "ground": scene.ground, **asdict(counts), **_beyond(found)}))
        return 0
    print(
        f"{scene.name} (ground as a {scene.ground})\n"
        f"  coordinates         {counts.coordinates}\n"
        f"  constraint rows     {counts.rows}   ({_listed(counts.rows_by_joint)})\n"
        f"  rank                {counts.rank}\n"
        f"  redundant rows      {counts.redundant}\n"
        f"  degrees of freedom  {counts.degrees_of_freedom}\n"
        f"  rows in redundancy  {_listed(found.redundant_by_joint)}\n"
        f"  unique reactions    {', '.join(found.unique_reactions) or 'of no joint'}\n"
        f"  singular values     {found.smallest_singular_value:.3g} to {found.largest_singular_value:.3g}"
        " (rows of unit length; the smallest is the distance to a singular position)"
    )
    return 0


def _beyond(found: Diagnosis) -> dict[str, Any]:
    """The fields of a diagnosis besides its counts, for JSON."""
    from dataclasses import asdict

    return {key: value for key, value in asdict(found).items() if key != "counts"}


def _listed(numbers: dict[str, int]) -> str:
    return ", ".join(f"{name} {number}" for name, number in numbers.items()) or "none"
