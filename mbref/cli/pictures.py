"""mbref draw and mbref animate: a picture or an animation of a scene."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from mbref.cli.branches import along_branches, chosen_crossing, of_several_branches, sentence
from mbref.cli.options import TEXT, add_method_options, add_scene, request_of, simulator
from mbref.cli.output import exit_status, progress_bar, warn
from mbref.drawing.film import png, write_film
from mbref.drawing.picture import moving, side_by_side, still
from mbref.drawing.view import View
from mbref.scenes import find_scene

MOVING = (".svg", ".gif", ".mp4")
VIEW = """\
xy, xz, yz, oblique, or AZIMUTH,ELEVATION in degrees (write --view=-60,20);
default: perpendicular to the plane of a planar mechanism, otherwise oblique"""


def add(commands: Any) -> None:
    """Add the parsers of both commands."""
    draw = commands.add_parser(
        "draw",
        help="a picture of a scene at t = 0",
        formatter_class=TEXT,
        description="A picture of a scene at t = 0: bodies, joints by type, ground, loads and drivers.",
        epilog="examples:\n  mbref draw mechanism.toml\n  mbref draw bricard --view xz --out bricard.png",
    )
    add_scene(draw)
    draw.add_argument("--view", metavar="VIEW", help=VIEW)
    draw.add_argument("--out", metavar="FILE", help=".svg or .png (default: as the scene, with .svg)")
    draw.set_defaults(action=_draw)

    animate = commands.add_parser(
        "animate",
        help="an animation of the mechanism as SVG, GIF or MP4",
        formatter_class=TEXT,
        description="Simulate a scene and write its motion as an SVG that every browser plays,\n"
        "a GIF or an MP4.",
        epilog="examples:\n  mbref animate mechanism.toml\n"
        "  mbref animate flyball_governor --duration 2 --view oblique --out governor.svg\n"
        "  mbref animate four_bar --branches\n  mbref animate four_bar_gravity --out four_bar.gif",
    )
    add_scene(animate)
    animate.add_argument("--view", metavar="VIEW", help=VIEW)
    animate.add_argument(
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
        type=int,
        metavar="NUMBER",
        help="--branches at this singular position, counted from 1 (default: the first at which several\n"
        "branches meet)",
    )
    add_method_options(animate, json=False)
    animate.set_defaults(action=_animate)


def _draw(options: argparse.Namespace) -> int:
    scene, view = find_scene(options.scene), _view(options)
    path = path_of(options, "", (".svg", ".png"))
    warn(scene)
    picture = still(scene, view)
    if path.suffix == ".png":
        path.write_bytes(png(picture))
    else:
        path.write_text(picture, encoding="utf-8")
    print(path)
    return 0


def _animate(options: argparse.Namespace) -> int:
    parted = options.branches or options.crossing is not None
    path = path_of(options, *(("-branches", (".svg",)) if parted else ("-moving", MOVING)))
    run, view = request_of(options), _view(options)
    scene = run.scene
    simulate = simulator(run.method)
    with progress_bar("simulating", float(run.times[-1])) as progress:
        motion = simulate(*run, progress)
        motions, picture = {"": motion}, partial(moving, scene, motion, view)
        if parted:
            number = chosen_crossing(motion, options.crossing)
            motions = along_branches(motion, run.method, run.limits, number)
            picture = partial(side_by_side, scene, motions, f"{scene.name}: {sentence(motion, number)}", view)
    if path.suffix == ".svg":
        path.write_text(picture(), encoding="utf-8")
    else:
        write_film(path, scene, motion, view)
    print(path)
    if not parted and (several := of_several_branches(motion)):
        print(f"{sentence(motion, several[0])}; --branches shows them side by side")
    return exit_status(*motions.values())


def _view(options: argparse.Namespace) -> View | None:
    return View.parse(options.view) if options.view else None


def path_of(options: argparse.Namespace, ending: str, suffixes: tuple[str, ...]) -> Path:
    """Return the requested file, or a file in the working directory named after the scene or its file.

    Raises ValueError for another kind of file.
    """
    path = Path(options.out or f"{Path(options.scene).name.removesuffix('.toml')}{ending}.svg")
    if path.suffix not in suffixes:
        raise ValueError(f"--out: must end in {' or '.join(suffixes)}, got {str(path)!r}")
    return path
