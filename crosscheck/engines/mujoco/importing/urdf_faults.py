"""Faults of a URDF that are reported with the names of its links and joints before MuJoCo reads it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from crosscheck.engines.shared import xml_files
from mbref.scene import SceneError
from mbref.scene.fields import LARGEST, shown

REMEDY = "write the URDF with `xacro FILE > robot.urdf`"
LOOPS = ("loop", "constraint", "loop_joint")
NUMBERS = {  # attributes of numbers → how many
    **dict.fromkeys(("xyz", "rpy"), 3),
    **dict.fromkeys(("value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    **dict.fromkeys(("damping", "friction", "multiplier", "offset"), 1),
}
SHOWN = 6  # links that a message names


def check(root: ET.Element) -> None:
    """Raise SceneError with every fault: macros of xacro, unknown links, links with two parents, circles,
    negative masses, floating joints on a link that is not the base."""
    if faults := [*_macros(root)] or [*_numbers(root)] or [*_structure(root), *_values(root)]:
        raise SceneError(faults)


def _macros(root: ET.Element) -> Iterator[str]:
    """Return a fault for the first element or value of xacro, which a program must replace beforehand."""
    for element in root.iter():
        shown = element.tag.split("}")[-1]
        if "xacro" in element.tag:
            yield f"element <xacro:{shown}>: is a macro of xacro; {REMEDY}"
            return
        for key, value in element.attrib.items():
            if "${" in value or "$(" in value:
                yield f"<{shown} {key}={value!r}>: is an expression of xacro; {REMEDY}"
                return


def _numbers(root: ET.Element) -> Iterator[str]:
    """Return a fault for each attribute that is no row of numbers of the right length."""
    for outer in (part for tag in ("link", "joint", *LOOPS) for part in root.iter(tag)):
        for element in outer.iter():
            if element is not outer and element.tag in ("visual", "collision", "limit", *LOOPS):
                continue
            for key, count in NUMBERS.items():
                text = element.get(key)
                if text is None or (outer.tag == "link" and not _is_inertial(outer, element)):
                    continue
                if not _are_numbers(text, count):
                    what = "a number" if count == 1 else f"{count} numbers"
                    where = f"{outer.tag} {outer.get('name')!r}: <{element.tag} {key}={shown(text)}>"
                    yield f"{where}: must be {what} of at most {LARGEST:g} in size"


def _is_inertial(link: ET.Element, element: ET.Element) -> bool:
    inertial = link.find("inertial")
    return inertial is not None and element in list(inertial.iter())


def _are_numbers(text: str, count: int) -> bool:
    words = text.split()
    try:
        return len(words) == count and all(abs(float(word)) <= LARGEST for word in words)
    except ValueError:
        return False


def _inertia(link: ET.Element) -> Iterator[str]:
    """Return a fault if no body has the moments of inertia of a link."""
    found = link.find("inertial/inertia")
    if found is not None:
        keys = [["".join(("i", *sorted(a + b))) for b in "xyz"] for a in "xyz"]
        matrix = np.array([[float(found.get(key) or "0") for key in row] for row in keys])
        yield from xml_files.inertia_faults(matrix, str(link.get("name")), ("ixx", "iyy", "izz"))


def _structure(root: ET.Element) -> Iterator[str]:
    links = [str(link.get("name")) for link in root.findall("link")]
    known = set(links)
    parents: dict[str, str] = {}
    yield from (f"link {name!r}: is in the file {n} times" for name, n in Counter(links).items() if n > 1)
    for joint in root.findall("joint"):
        parent, child = (_end(joint, side) for side in ("parent", "child"))
        for side, link in (("parent", parent), ("child", child)):
            if link not in known:
                yield f"joint {joint.get('name')!r}: its {side} link {link!r} is not in the file"
        if child in parents:
            yield (
                f"link {child!r}: is the child of two joints, {parents[child]!r} and {joint.get('name')!r}; "
                "let the second joint carry a link of its own, and close the loop with --close"
            )
        parents.setdefault(child, str(joint.get("name")))
    if (deepest := _depth(root)) > xml_files.DEEPEST:
        yield f"links carry each other {deepest} deep; at most {xml_files.DEEPEST} are read"
    roots = [name for name in links if name not in parents]
    if links and not roots:
        yield "every link is the child of a joint: the joints form a circle; close loops with --close"
    if len(roots) > 1:
        names = ", ".join(map(repr, roots[:SHOWN])) + (" and more" if len(roots) > SHOWN else "")
        yield f"links {names}: no joint carries them; a URDF has one such link, its base"


def _depth(root: ET.Element) -> int:
    """Return the largest number of links that carry each other; links in a circle count once each."""
    parent = {_end(joint, "child"): _end(joint, "parent") for joint in root.findall("joint")}
    known: dict[str, int] = {}
    for link in parent:
        way, seen = [link], {link}
        while way[-1] not in known and (base := parent.get(way[-1], link)) not in seen:
            way.append(base)
            seen.add(base)
        first = known.get(way[-1], 0)
        known |= {name: first + k for k, name in enumerate(reversed(way))}
    return max(known.values(), default=0)


def _values(root: ET.Element) -> Iterator[str]:
    """Return a fault for each negative mass, and for each floating joint on a link that is not the base."""
    for link in root.findall("link"):
        yield from _inertia(link)
        mass = link.find("inertial/mass")
        if mass is not None and float(mass.get("value") or "0") < 0.0:
            yield f"link {link.get('name')!r}: its mass must not be negative, got {mass.get('value')}"
    for joint in root.findall("joint"):
        parent = _end(joint, "parent")
        if joint.get("type") == "floating" and parent != base(root):
            yield f"joint {joint.get('name')!r}: floats on link {parent!r}, which is not the base of the file"


def base(root: ET.Element) -> str:
    """Return the name of the link that no joint carries; an empty text without one."""
    carried = {_end(joint, "child") for joint in root.findall("joint")}
    return next((str(k.get("name")) for k in root.findall("link") if k.get("name") not in carried), "")


def _end(joint: ET.Element, side: str) -> str:
    found = joint.find(side)
    return str(found.get("link")) if found is not None else ""


def hold(root: ET.Element, links: Sequence[str]) -> None:
    """Make the floating or planar joints of some links fixed ones; raises SceneError for another link."""
    bases = {
        _end(joint, "child"): joint
        for joint in root.findall("joint")
        if joint.get("type") in ("floating", "planar")
    }
    for link in links:
        if link not in bases:
            known = ", ".join(bases) or "none, so that the base is fixed to the ground already"
            raise SceneError([f"--hold {link}: is no link of a floating or planar joint; known: {known}"])
        bases[link].set("type", "fixed")
