"""`python -m reports.robot_files DOCUMENT --out DIR`: the result of `crosscheck files ROBOT` as a page.

Pictures show the machines that differ."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.files.reading import ANOTHER
from crosscheck.files.words import shown
from mbref.command_line import Parser, status_of
from mbref.motions.drawing.picture import still
from mbref.motions.drawing.view import View, view_of
from mbref.scene import GROUND, JOINT_TYPES, Body, Scene

from . import render
from .blocks import Block, Heading, Moving, Table, Text

WIDTH = 420.0  # px of a picture
DRAWN = {"screw": "cylindrical", "universal": "spherical"}  # types of which only one axis or none is known
Part = Mapping[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page; returns 0, or 2 for bad input."""
    return status_of(lambda: _write(argv))


def _write(argv: Sequence[str] | None) -> int:
    parser = Parser(description=__doc__)
    parser.add_argument("document", type=Path, help="JSON of `crosscheck files ROBOT --json`")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of index.html")
    options = parser.parse_args(argv)
    document = json.loads(options.document.read_text(encoding="utf-8"))
    name = Path(document["file"]).name
    render.write(blocks(document), options.out, f"{name} in {len(document['readers'])} readers")
    print(f"written: {options.out / 'index.html'}", file=sys.stderr)
    return 0


def blocks(document: Part) -> list[Block]:
    """Return the page: verdicts, pictures of the file's machine and of each other machine, differences."""
    readers = document["readers"]
    verdicts = [(r["reader"], r["version"], r["verdict"]) for r in readers]
    other = [r for r in readers if r["grade"] == ANOTHER]
    found: list[Block] = [
        Heading("Machines", 2),
        Table(f"{document['file']}: {document['format']}.", ("reader", "version", "machine"), verdicts),
        *_pictures(document, other),
    ]
    rows = [
        (r["reader"], d["name"], d["field"], shown(_tuples(d["file"])), shown(_tuples(d["reader"])))
        for r in readers
        for d in r["differences"]
    ]
    if rows:
        header = ("reader", "part", "field", "in the file", "in the reader")
        found += [Heading("Differences", 2), Table("Numbers of the file and of the reader.", header, rows)]
    tried = [f"{a['says']}: helps {', '.join((*a['same'], *a['nearer']))}." for a in document["advice"]]
    if tried:
        found += [Heading("Changes that were tried", 2), *map(Text, tried)]
    return found


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _pictures(document: Part, other: Sequence[Part]) -> Iterator[Block]:
    if not other:
        yield Text("No reader builds another machine, so that there is no picture.")
        return
    own = scene_of("file", document["machine"])
    view = _view(own)
    panels = [("the file", still(own, view, WIDTH))]
    panels += [(r["reader"], still(scene_of(r["reader"], r["machine"]), view, WIDTH)) for r in other]
    caption = (
        "Bodies and joints at the reference pose: the file, and each reader that builds another machine."
    )
    yield Moving(caption, panels, is_still=True)


def _view(scene: Scene) -> View:
    """Return one direction of sight for all pictures: across the file's plane, otherwise oblique."""
    points = [body.position for body in scene.body]
    points += [anchor for joint in scene.joint for anchor in joint.anchor_pair]
    return view_of(np.array(points), [axis for joint in scene.joint for axis in joint.directions])


def scene_of(name: str, machine: Part) -> Scene:
    """Return a scene without masses that has a machine's bodies and joints, and its loops as joints."""
    bodies = {body["name"]: body for body in machine["bodies"]}
    loops = [{**loop, "anchor": (loop["anchors"] or (None,))[0]} for loop in machine["loops"] or ()]
    joints = [part for part in (*machine["joints"], *loops) if {*part["bodies"]} <= {"world", *bodies}]
    new = _unique([*bodies, *(part["name"] for part in joints)])
    names = {"world": GROUND} | dict(zip(bodies, new, strict=False))
    anchors = {part["bodies"][1]: part["anchor"] for part in joints if part["anchor"]}
    places = {n: tuple(b["centre"] or anchors.get(n) or (0.0, 0.0, 0.0)) for n, b in bodies.items()}
    made = [
        _joint(own, part, (names[first], names[second]), part["anchor"] or places[second])
        for own, part in zip(new[len(bodies) :], joints, strict=True)
        for first, second in [part["bodies"]]
        if part["anchor"] or second in places
    ]
    return Scene(
        name=name,
        body=tuple(Body(name=names[n], position=place) for n, place in places.items()),
        joint=tuple(joint for joint in made if joint is not None),
    )


def _unique(given: Sequence[str]) -> list[str]:
    """Return names of a scene: a name that is empty, taken or the ground's gets a number."""
    found: list[str] = []
    for number, name in enumerate(given, start=1):
        is_free = name and name not in (*found, GROUND, "world")
        found.append(name if is_free else f"{name} {number}".strip())
    return found


def _joint(name: str, part: Part, pair: tuple[str, str], anchor: Sequence[float]) -> Any:
    """Return the joint of a picture; None for a free body, or a joint of unknown type."""
    kind = DRAWN.get(part["type"], part["type"])
    if kind not in JOINT_TYPES or kind == "distance" or pair[0] == pair[1]:
        return None
    return JOINT_TYPES[kind].at(name, pair, anchor=anchor, axis=part.get("axis") or (0.0, 0.0, 1.0))


if __name__ == "__main__":
    sys.exit(main())
