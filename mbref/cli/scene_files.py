"""mbref new, assemble and schema: scene files to start from, closed loops, and the schema for editors."""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from mbref.cli.request import add_scene
from mbref.command_line import add_output
from mbref.files import write
from mbref.input_error import InputError
from mbref.scene import Scene
from mbref.scenes import find_scene

UNMOVED = 1e-12  # rad, or m over the largest coordinate; smaller displacements are not reported


def add(commands: Any) -> None:
    """Add the parsers of the three commands."""
    new = commands.add_parser(
        "new",
        action=_new,
        help="a commented scene file to start from",
        description="Write a scene file to start from: a commented slider-crank, or a copy of a scene.",
        epilog="examples:\n  mbref new my.toml\n  mbref new my.toml --like four_bar_gravity",
    )
    add_output(new, "out", metavar="FILE", help="the .toml file")
    new.add_argument("--like", metavar="SCENE", help="a built-in name, or another .toml file")

    assemble = commands.add_parser(
        "assemble",
        action=_assemble,
        help="close the loops of a scene with given lengths of its links",
        description="Move the joints and bodies of a scene, as little as possible, so that its links have\n"
        "the given lengths and every joint is satisfied; reports what moved.",
        epilog="example:\n  mbref assemble my.toml --length A-B=0.35 --length B-C=0.9 --out closed.toml",
    )
    add_scene(assemble)
    assemble.add_argument(
        "--length",
        action="append",
        default=[],
        metavar="A-B=LENGTH",
        help="distance of the joints A and B of a link, m; may repeat",
    )
    add_output(assemble, "--out", metavar="FILE", help="write the closed scene")

    commands.add_parser(
        "schema",
        action=_schema,
        help="the JSON schema of scene files",
        description="The JSON schema of scene files, by which editors complete and check them. Editors with\n"
        "taplo (VS Code: Even Better TOML) take it from the file's first line:\n"
        "  #:schema ./scene.schema.json",
        epilog="example:\n  mbref schema > scene.schema.json",
    )


def _new(options: argparse.Namespace) -> int:
    path = Path(options.out)
    if path.suffix != ".toml":
        raise InputError(f"FILE: must end in .toml, got {options.out!r}")
    if options.like:
        find_scene(options.like).save(path)
    else:
        write(path, template())
    print(f"{path}: next, {shlex.join(['mbref', 'draw', str(path)])}")
    return 0


def template() -> str:
    """Return the text of the commented scene."""
    return (files("mbref") / "templates" / "scene.toml").read_text(encoding="utf-8")


def _assemble(options: argparse.Namespace) -> int:
    from mbref.design.assemble import assemble

    scene = find_scene(options.scene)
    found = assemble(scene, _lengths(scene, options.length))
    places = [anchor for joint in found.scene.joint for anchor in joint.anchor_pair]
    least = UNMOVED * max(abs(x) for place in (*places, *(b.position for b in scene.body)) for x in place)
    for pair, (before, after) in found.lengths.items():
        print(f"length {pair}: {before:.6g} m, now {after:.6g} m")
    for name, distance in found.joints.items():
        if distance > least:
            print(f"joint {name}: moved by {distance:.3g} m")
    for name, (distance, angle) in found.bodies.items():
        if distance > least or angle > UNMOVED:
            turned = f", turned by {angle:.3g} rad" if angle > UNMOVED else ""
            print(f"body {name}: moved by {distance:.3g} m{turned}")
    if options.out:
        found.scene.save(options.out)
        print(options.out)
    return 0


def _lengths(scene: Scene, texts: Sequence[str]) -> dict[tuple[str, str], float]:
    """Return the lengths (m) of pairs of joints; raises InputError for a pair that is given twice."""
    found: dict[tuple[str, str], float] = {}
    for text in texts:
        pair, length = _length(scene, text)
        if pair in found or pair[::-1] in found:
            raise InputError(f"--length: gives {'-'.join(pair)} twice, with {text!r}")
        found[pair] = length
    return found


def _length(scene: Scene, text: str) -> tuple[tuple[str, str], float]:
    """Return joints and length of ``A-B=0.35``; names of joints may contain a hyphen."""
    pair, equals, number = text.rpartition("=")
    names = {joint.name for joint in scene.joint}
    parts = pair.split("-")
    splits = [("-".join(parts[:k]), "-".join(parts[k:])) for k in range(1, len(parts))]
    known = [split for split in splits if set(split) <= names] or splits
    try:
        length = float(number)
    except ValueError:
        length = -1.0
    if not (equals and known and 0 < length < float("inf")):
        raise InputError(f"--length: must be A-B=LENGTH with a positive length in m, got {text!r}")
    if len(known) > 1 and known is not splits:
        both = " or ".join(f"{first!r} and {second!r}" for first, second in known)
        raise InputError(f"--length: {text!r} may be the joints {both}; rename one of them")
    return known[0], length


def _schema(options: argparse.Namespace) -> int:
    print(json.dumps(schema(), indent=2))
    return 0


def schema() -> dict[str, Any]:
    """Return the JSON schema of scene files, which is stored in mbref/templates/scene.schema.json."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "mbref scene"}
    return {**Scene.model_json_schema(), **head}
