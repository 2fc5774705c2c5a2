"""Changes of a file that keep its meaning and let more readers build it; each is tried before it is named."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from crosscheck.engines.loaders.loader import DOUBLE, MJCF, SDF, URDF
from crosscheck.engines.shared import xml_files
from crosscheck.files.differences import of_reading
from crosscheck.files.matching import matched
from crosscheck.files.meaning import meant
from crosscheck.files.reading import SAME, File, Reader, Reading, Say, read
from mbref.scene import SceneError

NAME = "root_of_all"
DRAKE = "{drake.mit.edu}mimic"  # an element of Drake's own in SDF
ET.register_namespace("drake", "drake.mit.edu")


@dataclass(frozen=True)
class Repair:
    """A change of files of ``forms``: ``says`` is an instruction, ``change`` returns whether it applied."""

    says: str
    forms: Sequence[str]
    change: Callable[[ET.Element], bool]


def _under_one_root(root: ET.Element) -> bool:
    world = root.find("worldbody")
    bodies = [] if world is None else world.findall("body")
    if world is None or len(bodies) < 2 or any(_floats(body) for body in bodies):
        return False
    holder = ET.SubElement(world, "body", name=NAME)
    for body in bodies:
        world.remove(body)
        holder.append(body)
    return True


def _floats(body: ET.Element) -> bool:
    return body.find("freejoint") is not None or body.find("joint[@type='free']") is not None


def _named(root: ET.Element) -> bool:
    if root.get("model"):
        return False
    root.set("model", "robot")
    return True


def _linear(root: ET.Element) -> bool:
    """Leave the first of several coefficients where the others are zero."""
    found = False
    for joint in root.iter("joint"):
        for key in ("damping", "stiffness"):
            first, *more = (joint.get(key) or "0").split()
            if more and not any(map(float, more)):
                joint.set(key, first)
                found = True
    return found


def _typed(root: ET.Element) -> bool:
    """Write the default types of joints and geoms."""
    found = False
    for tag, default in (("joint", "hinge"), ("geom", "sphere")):
        for world in root.findall("worldbody"):
            for element in world.iter(tag):
                if element.get("type") is None and element.get("class") is None and not _defaults(root):
                    element.set("type", default)
                    found = True
    return found


def _defaults(root: ET.Element) -> bool:
    return root.find("default") is not None


def _unit_axes(root: ET.Element) -> bool:
    found = False
    tags = {"robot": ("axis", "xyz"), "mujoco": ("joint", "axis")}
    tag, key = tags[root.tag]
    for element in root.iter(tag):
        axis = np.array([float(word) for word in (element.get(key) or "").split()])
        size = float(np.linalg.norm(axis))
        if axis.size == 3 and size and abs(size - 1.0) > DOUBLE:
            element.set(key, " ".join(repr(float(x)) for x in axis / size))
            found = True
    return found


def _direct_mimics(root: ET.Element) -> bool:
    """Let a follower of a follower follow the first leader."""
    found = {str(j.get("name")): j.find("mimic") for j in root.findall("joint")}
    changed = False
    for mimic in filter(lambda m: m is not None, found.values()):
        assert mimic is not None
        for _ in found:
            if (outer := found.get(str(mimic.get("joint")))) is None:
                break
            ratio, offset = (float(mimic.get(k, d)) for k, d in (("multiplier", "1"), ("offset", "0")))
            of_outer = (float(outer.get(k, d)) for k, d in (("multiplier", "1"), ("offset", "0")))
            first, more = of_outer
            mimic.set("joint", str(outer.get("joint")))
            mimic.set("multiplier", repr(ratio * first))
            mimic.set("offset", repr(offset + ratio * more))
            changed = True
    return changed


def _drake_mimics(root: ET.Element) -> bool:
    """Write each law without reference also as an element of Drake."""
    found = False
    for joint in root.iter("joint"):
        if (mimic := joint.find("axis/mimic")) is None or joint.find(DRAKE) is not None:
            continue
        if float(mimic.findtext("reference", "0")):
            continue
        law = {"joint": str(mimic.get("joint"))}
        law |= {tag: mimic.findtext(tag, d) for tag, d in (("multiplier", "1"), ("offset", "0"))}
        ET.SubElement(joint, DRAKE, law)
        found = True
    return found


def _gravity(root: ET.Element) -> bool:
    world = root.find("world")
    if world is None or world.find("gravity") is not None:
        return False
    ET.SubElement(world, "gravity").text = "0 0 -9.8"
    return True


REPAIRS = (
    Repair("put all bodies of <worldbody> into one massless body", (MJCF,), _under_one_root),
    Repair("give the model a name, <mujoco model=…>", (MJCF,), _named),
    Repair("write damping and stiffness with one number", (MJCF,), _linear),
    Repair("write the types of joints and geoms, type='hinge' and type='sphere'", (MJCF,), _typed),
    Repair("give each axis the length one", (MJCF, URDF), _unit_axes),
    Repair("let each <mimic> name a joint that follows none", (URDF,), _direct_mimics),
    Repair("write the gravity of the world", (SDF,), _gravity),
    Repair(
        "write each <mimic> also as <drake:mimic joint multiplier offset> of the joint", (SDF,), _drake_mimics
    ),
)


@dataclass(frozen=True)
class Advice:
    """A change, the readers that build the file's machine after it, and those that come nearer to it."""

    says: str
    same: tuple[str, ...]
    nearer: tuple[str, ...]


def advice(file: File, found: Sequence[tuple[Reader, Reading]], time_limit: float, say: Say) -> list[Advice]:
    """Return changes of the file that were tried: its meaning stays, and a reader has fewer differences."""
    wrong = [(reader, reading) for reader, reading in found if reading.grade != SAME]
    root = xml_files.parsed(file.path)
    if not wrong or any(e.get("filename") or e.get("file") for e in root.iter()):
        return []  # a copy elsewhere would not find the file's meshes
    results = []
    for repair in REPAIRS:
        changed = copy.deepcopy(root)
        if file.form not in repair.forms or not repair.change(changed):
            continue
        say(f"tries: {repair.says}")
        with TemporaryDirectory(prefix="crosscheck-") as folder:
            path = Path(folder) / file.path.name
            ET.ElementTree(changed).write(path)
            if (made := _equal(file, path)) is not None:
                results.append(_tried(repair, made, wrong, time_limit))
    return [result for result in results if result.same or result.nearer]


def _equal(file: File, path: Path) -> File | None:
    """Return a changed file if it means the machine of the file."""
    try:
        machine = meant(path, file.form)
    except SceneError:
        return None
    changes = of_reading(matched(file.machine, machine, DOUBLE), DOUBLE)
    return None if changes else replace(file, path=path)


def _tried(repair: Repair, made: File, wrong: Sequence[tuple[Reader, Reading]], time_limit: float) -> Advice:
    same, nearer = list[str](), list[str]()
    for reader, before in wrong:
        after = read(reader, made, time_limit)
        if after.grade == SAME:
            same.append(after.reader)
        elif not after.refusal and (before.refusal or _fewer(after, before)):
            nearer.append(after.reader)
    return Advice(repair.says, tuple(same), tuple(nearer))


def _fewer(after: Reading, before: Reading) -> bool:
    """Return whether the differences are a proper part of those before."""
    new, old = ({(d.part, d.name, d.field) for d in r.differences} for r in (after, before))
    return new < old
