"""mbref draw and mbref animate: a picture or an animation of a scene, also along branches that meet."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from mbref.cli.output import exit_status, warn
from mbref.cli.request import add_method_options, add_scene, request_of
from mbref.command_line import MOST_PLACE, add_output, whole
from mbref.equations.branches import SMOOTH
from mbref.files import free, write
from mbref.input_error import InputError
from mbref.method import MethodError
from mbref.motions.drawing.film import MOVING, png, write_film
from mbref.motions.drawing.picture import side_by_side, still
from mbref.motions.drawing.view import View
from mbref.motions.motion import Motion
from mbref.motions.trajectory import Outcome
from mbref.scenes import find_scene
from mbref.stepping.limits import Limits

BRANCH_SAMPLES = 101  # number of samples of a motion along a branch
VIEW = """\
xy, xz, yz, oblique, or AZIMUTH,ELEVATION in degrees (write --view=-60,20);
default: perpendicular to the plane of a planar mechanism, otherwise oblique"""


def add(commands: Any) -> None:
    """Add the parsers of both commands."""
    draw = commands.add_parser(
        "draw",
        action=_draw,
        help="a picture of a scene at t = 0",
        description="A picture of a scene at t = 0: bodies, joints by type, ground, loads and drivers.",
        epilog="examples:\n  mbref draw mechanism.toml\n  mbref draw bricard --view xz --out bricard.png",
    )
    add_scene(draw)
    draw.add_argument("--view", metavar="VIEW", help=VIEW)
    add_output(draw, "--out", metavar="FILE", help=".svg or .png (default: as the scene, with .svg)")

    animate = commands.add_parser(
        "animate",
        action=_animate,
        help="an animation of the mechanism as SVG, GIF or MP4",
        description="Simulate a scene and write its motion as an SVG that every browser plays,\n"
        "a GIF or an MP4.",
        epilog="examples:\n  mbref animate mechanism.toml\n"
        "  mbref animate flyball_governor --duration 2 --view oblique --out governor.svg\n"
        "  mbref animate four_bar --branches\n  mbref animate four_bar_gravity --out four_bar.gif",
    )
    add_scene(animate)
    animate.add_argument("--view", metavar="VIEW", help=VIEW)
    add_output(
        animate,
        "--out",
        metavar="FILE",
        help=".svg, .gif or .mp4 (default: as the scene, with -moving.svg);\n"
        ".gif and .mp4 need the extra video",
    )
    animate.add_argument(
        "--branches",
        action="store_true",
        help="the mechanism on every branch at a singular position that the motion passes, side by side",
    )
    animate.add_argument(
        "--crossing",
        type=whole(1, MOST_PLACE),
        metavar="NUMBER",
        help="--branches at this singular position, counted from 1 (default: the first at which several\n"
        "branches meet)",
    )
    add_method_options(animate, json=False)


def _draw(options: argparse.Namespace) -> int:
    scene, view = find_scene(options.scene), requested_view(options)
    path = path_of(options, "", (".svg", ".png"))
    warn(scene)
    picture = still(scene, view)
    write(path, png(picture) if path.suffix == ".png" else picture)
    print(path)
    return 0


def _animate(options: argparse.Namespace) -> int:
    parted = options.branches or options.crossing is not None
    path = path_of(options, *(("-branches", (".svg",)) if parted else ("-moving", MOVING)))
    run, view = request_of(options), requested_view(options)
    scene, motion = run.scene, run.motion()
    motions = {"": motion}
    if parted:
        number = chosen_crossing(motion, options.crossing)
        motions = along_branches(motion, motion.method, run.limits, number)
        title = f"{scene.name}: {sentence(motion, number)}"
        write(path, side_by_side(scene, motions, title, view))
    else:
        write_film(path, scene, motion, view)
    print(path)
    if not parted and (several := of_several_branches(motion)):
        print(f"{sentence(motion, several[0])}; --branches shows them side by side")
    return exit_status(motions)


def requested_view(options: argparse.Namespace) -> View | None:
    """Return the requested view, None for the default."""
    return View.parse(options.view) if options.view else None


def path_of(options: argparse.Namespace, ending: str, suffixes: tuple[str, ...]) -> Path:
    """Return the requested file, or a file in the working directory named after the scene or its file.

    Raises InputError for another kind of file, and for a file that exists, unless ``--force`` is given.
    """
    path = Path(options.out or f"{Path(options.scene).name.removesuffix('.toml')}{ending}.svg")
    if path.suffix not in suffixes:
        raise InputError(f"--out: must end in {' or '.join(suffixes)}, got {str(path)!r}")
    return free(path, options.force)


def chosen_crossing(smooth: Motion, number: int | None) -> int:
    """Return the number, from 1, of the chosen singular position; without a choice, of the first position
    with several branches.

    Raises MethodError if the method does not detect singular positions, InputError if the motion passes none.
    """
    if smooth.crossings is None:
        raise MethodError(
            f"--branches: {smooth.method} does not detect singular positions; use --method taylor"
        )
    passed, until = len(smooth.crossings), f"up to t = {smooth.t_end:g} s"
    if number is not None and not 1 <= number <= passed:
        raise InputError(
            f"--crossing: must be at most {passed}, the singular positions {until}, got {number}"
        )
    several = of_several_branches(smooth)
    if number is None and not several:
        which = "; ".join(sentence(smooth, k) for k in range(1, passed + 1)) or "the motion passes none"
        raise InputError(f"--branches: no singular position {until} has several branches: {which}")
    return number or several[0]


def of_several_branches(motion: Motion) -> list[int]:
    """Return the numbers, from 1, of the passed singular positions at which several branches meet."""
    return [k for k, crossing in enumerate(motion.crossings or (), 1) if len(crossing.velocity) > 1]


def along_branches(smooth: Motion, method: str, limits: Limits, number: int) -> dict[str, Motion]:
    """Return the motions by title, from before a singular position of the smooth motion to after it."""
    from mbref.simulation.simulate import simulate

    assert smooth.crossings is not None
    crossing = smooth.crossings[number - 1]
    times = crossing.instants(smooth.t_end, BRANCH_SAMPLES)
    motions = [
        simulate(smooth.mechanism, method, times, replace(limits, branches={number: branch}))
        for branch in range(1, len(crossing.velocity) + 1)
    ]
    return {_title(branch, motion): motion for branch, motion in enumerate(motions, SMOOTH)}


def sentence(motion: Motion, number: int) -> str:
    """Return one sentence on a singular position."""
    assert motion.crossings is not None
    crossing = motion.crossings[number - 1]
    return f"singular position {number} at t = {crossing.time:.6g} s: {crossing.sentence}"


def _title(branch: int, motion: Motion) -> str:
    """Return the branch's name, with the end time if its run ended early."""
    name = f"branch {branch}{', smooth' * (branch == SMOOTH)}"
    return name if motion.outcome is Outcome.COMPLETED else f"{name}, ended at {motion.t_end:.4g} s"
