"""mbref diagnose: links, joints, redundancy at t = 0 and along the motion, and singular positions."""

from __future__ import annotations

import argparse
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbref.cli.output import console, warn
from mbref.cli.request import add_scene
from mbref.records import strict_json
from mbref.scene import Scene, SceneError
from mbref.scene.slips import link_lengths
from mbref.scene.units import echoed
from mbref.scenes import find_scene

if TYPE_CHECKING:
    from mbref.design.along_motion import AlongMotion
    from mbref.design.diagnosis import Diagnosis

LISTED = 5  # largest number of printed singular positions


def add(commands: Any) -> None:
    """Add the command's parser."""
    diagnose = commands.add_parser(
        "diagnose",
        action=_diagnose,
        help="links, redundant constraints, singular positions of a scene",
        description="Lengths of links and joints; counts, rank, redundant rows by joint and unique\n"
        "reactions at t = 0; redundancy along the motion, which exchange of joints\n"
        "removes it, and the nearest singular position.",
        epilog="examples:\n  mbref diagnose five_bar\n  mbref diagnose mechanism.toml --json\n"
        "  mbref diagnose mechanism.toml --start\n"
        "  crosscheck diagnose mechanism.toml --engine mujoco    known defects of an engine there",
    )
    add_scene(diagnose)
    diagnose.add_argument("--start", action="store_true", help="at t = 0 only, without simulating")
    diagnose.add_argument("--json", action="store_true", help="print one JSON object and nothing else")


def _diagnose(options: argparse.Namespace) -> int:
    from mbref.design.diagnosis import diagnose
    from mbref.design.exchange import exchanges
    from mbref.design.idle_freedoms import idle_freedoms

    scene = find_scene(options.scene)
    warn(scene)
    found = diagnose(scene)
    along = None if options.start else _along(scene)
    redundant = bool(found.counts.redundant) or along_redundant(along)
    swaps = exchanges(scene) if redundant else []
    idle = idle_freedoms(scene)
    if options.json:
        driven = {"drivers": [line.strip() for line in _driver_lines(scene)]}
        print(strict_json(_record(scene, found, along, swaps) | {"idle_freedoms": idle} | driven))
    else:
        console().print(
            "\n".join(
                [
                    *_scene_lines(scene),
                    *_unit_lines(options.scene),
                    *_start_lines(found),
                    *(f"    idle freedom        {sentence}" for sentence in idle),
                    *_motion_lines(along),
                    *_swap_lines(swaps, redundant),
                    *_driver_lines(scene),
                ]
            ),
            soft_wrap=True,
        )
    return 0


def _along(scene: Scene) -> AlongMotion | str:
    """Return the diagnosis along the motion, or the reason why the motion cannot be diagnosed."""
    from mbref.design.along_motion import along_motion

    try:
        return along_motion(scene)
    except SceneError as error:
        return error.faults[0]


def along_redundant(along: AlongMotion | str | None) -> bool:
    """Return whether rows are redundant along the motion."""
    return along is not None and not isinstance(along, str) and along.redundant > 0


def _record(
    scene: Scene, found: Diagnosis, along: AlongMotion | str | None, swaps: list[dict[str, str]]
) -> dict[str, Any]:
    beyond = {key: value for key, value in asdict(found).items() if key != "counts"}
    motion: dict[str, Any] | None = {"why_not": along} if isinstance(along, str) else None
    if along is not None and not isinstance(along, str):
        motion = asdict(along) | {"crossings": [crossing.to_record() for crossing in along.crossings]}
    return {
        "scene": scene.name,
        "ground": scene.ground,
        "links": link_lengths(scene),
        **asdict(found.counts),
        **beyond,
        "along_motion": motion,
        "exchanges": swaps,
    }


def _scene_lines(scene: Scene) -> list[str]:
    lines = [f"{scene.name} (ground as a {scene.ground})", "  links"]
    for body, lengths in link_lengths(scene).items():
        lines.append(
            f"    {body:12} {', '.join(f'{pair} {length:.6g} m' for pair, length in lengths.items())}"
        )
    lines.append("  joints")
    lines += [f"    {joint.name:12} {joint.type}, {' and '.join(joint.bodies)}" for joint in scene.joint]
    return lines


def _unit_lines(path: str) -> list[str]:
    """Return a line for each number with a unit in the scene's file, with its value in SI units."""
    if not path.endswith(".toml"):
        return []
    found = list(echoed(tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))))
    return ["  units", *(f"    {line}" for line in found)] * bool(found)


def _start_lines(found: Diagnosis) -> list[str]:
    counts = found.counts
    return [
        "  at t = 0",
        f"    coordinates         {counts.coordinates}",
        f"    constraint rows     {counts.rows}   ({_listed(counts.rows_by_joint)})",
        f"    rank                {counts.rank}",
        f"    redundant rows      {counts.redundant}",
        f"    degrees of freedom  {counts.degrees_of_freedom}",
        f"    rows in redundancy  {_listed(found.redundant_by_joint)}",
        f"    unique reactions    {_unique(found)}",
        *_determined_lines(found),
        f"    singular values     {found.smallest_singular_value:.3g} to {found.largest_singular_value:.3g}"
        " (rows of unit length;",
        "                        the smallest is 0 in a singular position)",
    ]


def _determined_lines(found: Diagnosis) -> list[str]:
    """Return a line for each set of components that equilibrium determines, with its joints."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, components in (found.determined_reactions or {}).items():
        if name not in found.unique_reactions:
            groups.setdefault(components, []).append(name)
    return [
        f"    determined          {', '.join(components) or 'nothing'} of {', '.join(names)}"
        for components, names in groups.items()
    ]


def _motion_lines(along: AlongMotion | str | None) -> list[str]:
    if isinstance(along, str):
        return [f"  along the motion      not known: {along}"]
    if along is None:
        return []
    still = "" if along.moves or along.stopped else ": nothing moves"
    lines = [
        f"  along the motion of {along.end:g} s{still}",
        *[f"    it ends early       {along.stopped}"] * bool(along.stopped),
        f"    rank                {along.rank}",
        f"    redundant rows      {along.redundant}",
    ]
    if not along.crossings:
        nearly = " (passed, or nearly)" if along.nearest < 1e-3 else ""
        lines.append(
            f"    nearest singular    at t = {along.nearest_time:.3g} s: smallest singular value"
            f" {along.nearest:.3g} of the largest{nearly}"
        )
    shown = along.crossings[:LISTED]
    lines += [f"    singular position   at t = {c.time:.6g} s: {c.sentence}" for c in shown]
    if len(along.crossings) > LISTED:
        lines.append(f"    singular positions  {len(along.crossings)} in all")
    if along.shaky:
        lines.append(
            "    infinitesimal       velocities satisfy the joints but belong to no motion, at every pose:\n"
            "                        an engine may let the mechanism move along them"
        )
    if along.by_rounding:
        sizes = ", ".join(f"{s:.1g}" for s in along.by_rounding)
        lines.append(
            f"    nearly redundant    singular values up to {sizes}, explained by rounding of the numbers"
        )
    return lines


def _swap_lines(swaps: list[dict[str, str]], redundant: bool) -> list[str]:
    if not swaps:
        return ["  no exchange or removal of joints that was tried ends the redundancy"] * redundant
    shown = [" and ".join(f"{name} {kind}" for name, kind in swap.items()) for swap in swaps]
    return [
        "  exchanges that end the redundancy and keep the degrees of freedom",
        *(f"    {words}" for words in shown),
    ]


def _driver_lines(scene: Scene) -> list[str]:
    """Return a line if the scene has more drivers than degrees of freedom: constraint rows are then redundant
    whatever the joints are. A second line names drivers that contradict each other."""
    from mbref.equations.counts import counts
    from mbref.equations.driver_conflicts import conflict_of_drivers
    from mbref.equations.offsets import assembled

    conflict = conflict_of_drivers(assembled(scene))
    freedoms = counts(scene.with_(driver=(), load=())).degrees_of_freedom
    driven = sum(driver.rows for driver in scene.driver)
    sentence = f"  more drivers than degrees of freedom ({driven} and {freedoms}): redundant rows remain"
    lines = [sentence] * (driven > freedoms)
    return [*lines, *([f"  {conflict.sentence}"] if conflict else [])]


def _unique(found: Diagnosis) -> str:
    """Return the text with the joints whose whole reaction is unique."""
    return ", ".join(found.unique_reactions) or "none as a whole"


def _listed(numbers: dict[str, int]) -> str:
    return ", ".join(f"{name} {number}" for name, number in numbers.items()) or "none"
