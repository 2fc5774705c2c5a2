"""mbref equilibrium and mbref modes: static equilibria, their stability, and vibrations about them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mbref.cli.output import console, warn
from mbref.cli.pictures import VIEW, path_of, requested_view
from mbref.cli.request import add_scene
from mbref.command_line import MOST_PLACE, add_output, whole
from mbref.input_error import InputError
from mbref.motions.drawing.film import MOVING, write_film
from mbref.records import strict_json
from mbref.rotations import to_vector
from mbref.scene import Scene
from mbref.scenes import find_scene

if TYPE_CHECKING:
    from mbref.design.equilibrium import Equilibrium

MOST_STARTS = 10_000
PUSHING = ("moment", "force", "joint_torque", "joint_force")  # loads that do not change with the pose
AT_SINGULAR_POSITION = (
    "at a singular position, where the number of freedoms, stability and reactions are not defined"
)
PRINTED_AS_ZERO = 1e-9  # part of the largest number below which a number is printed as zero
WOUND = "Torsion springs may also be in balance in further windings, full turns away."
LIMITS = "Other equilibria may exist: the search begins at the scene's pose and follows the constraints."


def add(commands: Any) -> None:
    """Add the parsers of both commands."""
    rest = commands.add_parser(
        "equilibrium",
        action=_equilibrium,
        help="static equilibria or steady motions of a mechanism, with forces and stability",
        description="Static equilibria under gravity, springs and constant loads, from several starts:\n"
        "pose, reactions and stability of each. With a driver that turns a body at a constant rate\n"
        "about an axis parallel to gravity: steady motions in which all bodies turn with it.\n" + LIMITS,
        epilog="examples:\n  mbref equilibrium four_bar_gravity\n"
        "  mbref equilibrium mechanism.toml --number 2 --out rest.toml",
    )
    _add_search(rest)
    add_output(rest, "--out", metavar="FILE.toml", help="write the scene at an equilibrium, at rest")

    shake = commands.add_parser(
        "modes",
        action=_modes,
        help="eigenvalues and vibrations about an equilibrium or a steady motion",
        description="Eigenvalues, frequencies and damping ratios of small motions about an equilibrium or a\n"
        "steady motion (see `mbref equilibrium`), by default about the first stable one.\n"
        "--out writes one vibration as a moving picture.",
        epilog="examples:\n  mbref modes four_bar_gravity\n"
        "  mbref modes mechanism.toml --mode 2 --out second.svg\n"
        "  mbref modes motor.toml --undriven A    # joint A turns freely",
    )
    _add_search(shake)
    shake.add_argument(
        "--mode",
        type=whole(1, MOST_PLACE),
        default=1,
        help="vibration of --out, from the slowest (default 1)",
    )
    shake.add_argument("--view", metavar="VIEW", help=VIEW)
    add_output(shake, "--out", metavar="FILE", help=".svg, .gif or .mp4 of one vibration")


def _add_search(parser: argparse.ArgumentParser) -> None:
    add_scene(parser)
    parser.add_argument(
        "--starts", type=whole(1, MOST_STARTS), default=24, help="number of poses to search from (default 24)"
    )
    parser.add_argument(
        "--number", type=whole(1, MOST_PLACE), metavar="K", help="number of the equilibrium, as listed"
    )
    parser.add_argument(
        "--undriven",
        action="append",
        metavar="JOINT",
        default=[],
        help="leave out the driver of this joint; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def _undriven(scene: Scene, joints: Sequence[str]) -> Scene:
    """Return the scene without the drivers of the joints; raises InputError for a joint without a driver."""
    driven = [driver.joint for driver in scene.driver]
    for name in joints:
        if name not in driven:
            raise InputError(
                f"--undriven: joint {name!r} has no driver; driven joints: {', '.join(driven) or 'none'}"
            )
    return scene.with_(driver=[driver for driver in scene.driver if driver.joint not in joints])


def _found(options: argparse.Namespace) -> list[Equilibrium]:
    """Return the equilibria; raises InputError if no equilibrium is found, or if the requested number is
    larger than theirs."""
    from mbref.design.equilibrium import equilibria

    scene = _undriven(find_scene(options.scene), options.undriven)
    warn(scene)
    found = equilibria(scene, options.starts)
    if not found:
        pushing = [f"load[{k}] ({load.type})" for k, load in enumerate(scene.load) if load.type in PUSHING]
        cause = f"perhaps {' and '.join(pushing)} moves it at every pose; " * bool(pushing)
        raise InputError(
            f"{scene.name}: no equilibrium is found from {options.starts} starts; {cause}--starts tries more"
        )
    if options.number is not None and not 1 <= options.number <= len(found):
        raise InputError(f"--number: must be from 1 to {len(found)}, got {options.number}")
    return found


def _equilibrium(options: argparse.Namespace) -> int:
    if options.out and not options.out.endswith(".toml"):
        raise InputError(f"--out: must end in .toml, got {options.out!r}")
    found = _found(options)
    if options.out:
        found[(options.number or 1) - 1].scene.save(options.out)
    if options.json:
        print(strict_json({"equilibria": [_record(each) for each in found]}))
        return 0
    for number, each in enumerate(found, 1):
        if options.number in (None, number):
            console().print("\n".join(_lines(number, each)), soft_wrap=True)
    if options.number is None:
        console().print(LIMITS)
        if any(load.type == "torsion_spring" for load in found[0].scene.load):
            console().print(WOUND)
    if options.out:
        console().print(options.out, soft_wrap=True)
    return 0


def _lines(number: int, each: Equilibrium) -> list[str]:
    lines = [_title(number, each)]
    places = [body.position for body in each.scene.body]
    places += [end for joint in each.scene.joint for end in joint.anchor_pair]
    reach, length = float(np.abs(places).max()), float(np.ptp(places, axis=0).max())
    wrenches = list(each.reactions.values())
    force, moment = (
        max((float(np.abs(wrench[part]).max()) for wrench in wrenches), default=0.0)
        for part in (slice(0, 3), slice(3, 6))
    )
    size = force + (moment / length if length > 0.0 else 0.0)
    for body in each.scene.body:
        place, turned = _three(body.position, reach), to_vector(np.array([body.orientation]))[0]
        lines.append(f"  {body.name:12} position {place} m, rotation vector {_three(turned, 1.0)} rad")
    for name, wrench in each.reactions.items():
        pushed, twisted = _three(wrench[:3], size), _three(wrench[3:], size * length or moment)
        lines.append(f"  joint {name:6} force {pushed} N, moment {twisted} N m")
    return lines


def _title(number: int, each: Equilibrium) -> str:
    """Return the heading of an equilibrium, or of a steady motion with its rate."""
    kind = AT_SINGULAR_POSITION if each.is_singular else each.stability
    if each.rate:
        return f"steady motion {number}: {kind}, turns at {each.rate:.9g} rad/s"
    return f"equilibrium {number}: {kind}"


def _three(vector: Any, size: float) -> str:
    """Return three numbers, where numbers that are rounding of a size are zero."""
    return "(" + ", ".join(f"{x if abs(x) > PRINTED_AS_ZERO * size else 0.0:.6g}" for x in vector) + ")"


def _record(each: Equilibrium) -> dict[str, Any]:
    return {
        "stability": each.stability,
        "rate": each.rate,
        "scene": each.scene.to_dict(),
        "eigenvalues": [[float(s.real), float(s.imag)] for s in each.eigenvalues],
        "bounds": each.bounds.tolist(),
        "frequencies": each.frequencies.tolist(),
        "damping_ratios": each.damping_ratios.tolist(),
        "reactions": {name: wrench.tolist() for name, wrench in each.reactions.items()},
    }


def _modes(options: argparse.Namespace) -> int:
    from mbref.design.equilibrium import motion_of_mode

    path = path_of(options, "-mode", MOVING) if options.out else None
    found = _found(options)
    kinds = [each.stability for each in found]
    wanted = next((kind for kind in ("stable", "indifferent", "unstable") if kind in kinds), kinds[0])
    number = options.number or kinds.index(wanted) + 1
    each = found[number - 1]
    if each.is_singular:
        raise InputError(f"{each.scene.name}: {_title(number, each)}; --number chooses another equilibrium")
    if path is not None:
        write_film(path, each.scene, motion_of_mode(each, options.mode), requested_view(options))
    if options.json:
        print(strict_json({"number": number, **_record(each)}))
        return 0
    console().print("\n".join(_mode_lines(number, each)), soft_wrap=True)
    if path:
        console().print(str(path), soft_wrap=True)
    return 0


def _mode_lines(number: int, each: Equilibrium) -> list[str]:
    lines = [_title(number, each), "  eigenvalues, 1/s"]
    lines += [f"    {s.real:+.12g} {s.imag:+.12g} i" for s in each.eigenvalues]
    pairs = enumerate(zip(each.frequencies, each.damping_ratios, strict=True), 1)
    lines += [f"  vibration {k}: {hertz:.9g} Hz, damping ratio {ratio:.6g}" for k, (hertz, ratio) in pairs]
    return lines
