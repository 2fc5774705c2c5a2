"""Preparation of a URDF for MuJoCo: links with too little inertia, loops and coupled joints are handled
here."""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing import urdf_faults
from crosscheck.engines.mujoco.importing.closures import TYPES, Closure, Frame
from crosscheck.engines.mujoco.importing.left_out import Part
from crosscheck.engines.mujoco.importing.posing import JointRow
from crosscheck.engines.shared import xml_files
from crosscheck.engines.shared.geometry import joint_frame
from mbref.scene import SceneError

KNOWN = {  # outer elements → inner elements that are read, or that change no motion
    "robot": ("link", "joint", "material", "loop", "constraint", "loop_joint", "coupling"),
    "link": ("inertial", "visual", "collision"),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "dynamics", "limit", "mimic", "calibration"),
}
FOR_MUJOCO = {  # inner elements that MuJoCo is given
    "robot": ("link", "joint"),
    "link": ("inertial",),
    "joint": ("origin", "parent", "child", "axis", "dynamics", "limit"),
}
CLOSURES = ("constraint", "loop_joint")  # loops that name parent and child, each with an origin
ENDS = ("lower", "upper")
LEAST = 1e-12  # kg and kg m²; MuJoCo refuses moving bodies with smaller values
BodyOf = Callable[[str], int]


@dataclass(frozen=True)
class Text:
    """A URDF text for MuJoCo, and the mass and moments that were added to each link."""

    text: str
    added: dict[str, tuple[float, float]]
    root: ET.Element

    def take_back(self, mujoco: Any, model: Any) -> None:
        """Subtract the added masses and moments from the compiled model."""
        for link, (mass, moment) in self.added.items():
            b = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, link)
            if b > 0:
                model.body_mass[b] = max(model.body_mass[b] - mass, 0.0)
                left = model.body_inertia[b] - moment
                model.body_inertia[b] = np.where(left > LEAST * moment, left, 0.0)  # the rest is rounding
        _correct_diagonal(mujoco, model)
        model.body_subtreemass[:] = model.body_mass
        for b in range(model.nbody - 1, 0, -1):
            model.body_subtreemass[model.body_parentid[b]] += model.body_subtreemass[b]


def prepared(text: str | bytes, hold: Sequence[str] = (), where: str = "URDF") -> Text:
    """Return the URDF with links and joints alone; links are not merged.

    The joints of the links ``hold`` become fixed joints. Raises SceneError if the text is no tree of links;
    ``where`` begins the sentence if the text is no XML.
    """
    root = xml_files.parsed_bytes(text.encode() if isinstance(text, str) else text, where)
    urdf_faults.check(root)
    whole = copy.deepcopy(root)
    urdf_faults.hold(root, hold)
    _name_base_of_floating_joints(root)
    for parent in (part for tag in FOR_MUJOCO for part in root.iter(tag)):
        for child in [c for c in parent if c.tag not in FOR_MUJOCO[parent.tag]]:
            parent.remove(child)
    for joint in root.iter("joint"):
        _complete_limit(joint)
    added = {str(link.get("name")): _enough(link) for link in root.iter("link")}
    options = ET.SubElement(ET.SubElement(root, "mujoco"), "compiler")
    options.attrib.update(fusestatic="false", discardvisual="true", balanceinertia="false")
    moved = {name: more for name, more in added.items() if more != (0.0, 0.0)}
    return Text(ET.tostring(root, encoding="unicode"), moved, whole)


def _correct_diagonal(mujoco: Any, model: Any) -> None:
    """Compute the entries of the mass matrix that MuJoCo stores: of bodies on the world without children,
    whose part of the matrix is diagonal."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    for v in np.flatnonzero(model.dof_simplenum):
        b, moves, turns = int(model.dof_bodyid[v]), np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacBodyCom(model, data, moves, turns, b)
        spin = data.ximat[b].reshape(3, 3).T @ turns[:, v]
        inertia = model.body_mass[b] * moves[:, v] @ moves[:, v] + model.body_inertia[b] @ spin**2
        model.dof_M0[v] = inertia + model.dof_armature[v]


def _name_base_of_floating_joints(root: ET.Element) -> None:
    """Name the base "world" if a joint floats on it: MuJoCo lets bodies float on this link only."""
    name, joints = urdf_faults.base(root), root.findall("joint")
    if not any(joint.get("type") == "floating" for joint in joints):
        return
    for link in root.findall("link"):
        if link.get("name") == name:
            link.set("name", "world")
    for parent in (joint.find("parent") for joint in joints):
        if parent is not None and parent.get("link") == name:
            parent.set("link", "world")


def _enough(link: ET.Element) -> tuple[float, float]:
    """Add inertia to a link that MuJoCo would refuse; returns the added mass and moment."""
    inertial = link.find("inertial")
    inertial = ET.SubElement(link, "inertial") if inertial is None else inertial
    mass = _part(inertial, "mass", {"value": "0"})
    inertia = _part(inertial, "inertia", dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0"))
    x, y, z = "ixx", "iyy", "izz"
    matrix = np.array(
        [[float(inertia.get("".join(("i", *sorted(a + b)))) or "0") for b in "xyz"] for a in "xyz"]
    )
    moments = np.linalg.eigvalsh(matrix)
    heavy = float(mass.get("value") or "0")
    more = 1.0 if heavy < LEAST else 0.0
    is_flat = moments[2] > moments[0] + moments[1]  # by rounding, which MuJoCo refuses
    is_slender = moments[0] < max(LEAST, 1e-9 * moments[-1])
    moment = (float(moments[-1]) or 1.0) if is_slender or is_flat else 0.0
    mass.set("value", repr(heavy + more))
    for k, key in enumerate((x, y, z)):
        inertia.set(key, repr(float(matrix[k, k]) + moment))
    return more, moment


def _part(element: ET.Element, tag: str, default: dict[str, str]) -> ET.Element:
    found = element.find(tag)
    return ET.SubElement(element, tag, default) if found is None else found


def child_links(text: Text | None) -> dict[str, str]:
    """Return the child link of each joint of a URDF."""
    joints = [] if text is None else text.root.iter("joint")
    ends = {str(joint.get("name")): joint.find("child") for joint in joints}
    return {name: str(child.get("link")) for name, child in ends.items() if child is not None}


def mimics(root: ET.Element, number_of: Callable[[str], int]) -> Iterator[JointRow]:
    """Return joints that follow others by ``<mimic>``; raises SceneError for an unknown joint."""
    for joint in root.iter("joint"):
        if (mimic := joint.find("mimic")) is not None:
            name, other = str(joint.get("name")), str(mimic.get("joint"))
            pair = number_of(name), number_of(other)
            if min(pair) < 0:
                raise SceneError([f"joint {name!r} mimics {other!r}: the file has no such joint that moves"])
            offset, ratio = (float(mimic.get(key, n)) for key, n in (("offset", 0.0), ("multiplier", 1.0)))
            yield JointRow(f"{name} mimics {other}", pair, offset, (1.0, -ratio))


def couplings(root: ET.Element) -> Iterator[Part]:
    """Return joints that follow others by ``<coupling>`` of URDF+."""
    for coupling in root.iter("coupling"):
        yield Part("couplings", f"coupling {coupling.get('name', '')!r}")


def unread(root: ET.Element) -> Iterator[str]:
    """Yield a sentence for each kind of element that neither this reader nor MuJoCo knows, and one for limits
    without a range, which MuJoCo reads as no limits."""
    yield from xml_files.unread(root, KNOWN)
    joints = [joint for joint in root.iter("joint") if joint.get("type") in ("revolute", "prismatic")]
    if names := [repr(str(joint.get("name"))) for joint in joints if _has_no_range(joint)]:
        yield f"limits of joints {', '.join(names)}: lower and upper are 0 or missing; the joints are free"


def _complete_limit(joint: ET.Element) -> None:
    """Write the format's default, 0, for one missing end of a limit: MuJoCo then reads no limit."""
    limit = joint.find("limit")
    if limit is not None and any(limit.get(end) for end in ENDS):
        for end in ENDS:
            limit.set(end, limit.get(end, "0"))


def impossible_limits(root: ET.Element) -> Iterator[Part]:
    """Return limits without a range between their ends, of which MuJoCo reads none."""
    for joint in root.iter("joint"):
        limit, name = joint.find("limit"), joint.get("name")
        if joint.get("type") not in ("revolute", "prismatic") or limit is None or _has_no_range(joint):
            continue
        lower, upper = (_number(limit.get(end, "0")) for end in ENDS)
        if lower == upper:
            yield Part("limits", f"limit of joint {name!r}, whose ends are both {lower:g}")
        elif lower > upper:
            ends = f"lower end {lower:g} is above its upper end {upper:g}"
            yield Part("limits", f"limit of joint {name!r}, whose {ends}")


def _number(text: str) -> float:
    """Return a number, NaN for other text, about which MuJoCo has a message."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _has_no_range(joint: ET.Element) -> bool:
    """Return whether a joint has no limits, or limits whose ends are 0 or missing."""
    limit = joint.find("limit")
    return limit is None or not any(limit.get(end, "0").strip(" +-.0") for end in ENDS)


def loops(root: ET.Element, body_of: BodyOf, data: Any) -> Iterator[Closure]:
    """Return the closures of all loops: of ``<loop>`` elements, and of elements with parent and child."""
    yield from _predecessor_loops(root, body_of, data)
    for tag in CLOSURES:
        for element in root.iter(tag):
            yield _constraint(element, body_of)


def _constraint(element: ET.Element, body_of: BodyOf) -> Closure:
    """Return the closure of ``<constraint name type>`` with the elements parent, child, parent_origin,
    child_origin, parent_axis and child_axis; the axes are in the frames of the origins.

    Raises SceneError for an unknown type or a missing link.
    """
    name, kind = element.get("name", element.tag), element.get("type", "")
    if kind not in TYPES:
        raise SceneError([f"{element.tag} {name!r}: type {kind!r} is none of {', '.join(TYPES)}"])
    frames = []
    for side in ("parent", "child"):
        link = element.find(side)
        if link is None or not link.get("link"):
            raise SceneError([f"{element.tag} {name!r}: names no {side} link"])
        origin = element.find(f"{side}_origin")
        axis = element.find(f"{side}_axis")
        axis = element.find("axis") if axis is None else axis
        turn = _roll_pitch_yaw(_numbers(origin, "rpy", (0.0, 0.0, 0.0)))
        turn = turn @ joint_frame(_numbers(axis, "xyz", (1.0, 0.0, 0.0)))
        frames.append(Frame(body_of(str(link.get("link"))), _numbers(origin, "xyz", (0.0, 0.0, 0.0)), turn))
    return Closure(name, TYPES[kind], (frames[0], frames[1]))


def _predecessor_loops(root: ET.Element, body_of: BodyOf, data: Any) -> Iterator[Closure]:
    """Return the closures of the loops, at the origins of their predecessors, as the reference position has
    them.

    Format: ``<loop name type><predecessor link><origin/></predecessor><successor
    link>…</successor><axis/></loop>`` with the axis in the predecessor's origin frame. Raises SceneError for
    an unknown type or link.
    """
    for loop in root.iter("loop"):
        name, kind = loop.get("name", "loop"), loop.get("type", "")
        if kind not in TYPES:
            raise SceneError([f"loop {name!r}: type {kind!r} is none of {', '.join(TYPES)}"])
        first, second = (_end(loop, side, body_of, name) for side in ("predecessor", "successor"))
        axis = first.axes @ _numbers(loop.find("axis"), "xyz", (1.0, 0.0, 0.0))
        first = Frame(first.body, first.origin, joint_frame(axis))
        turn = data.xmat[second.body].reshape(3, 3).T @ first.turn(data)
        yield Closure(name, TYPES[kind], (first, Frame(second.body, second.origin, turn)))


def _end(loop: ET.Element, side: str, body_of: BodyOf, name: str) -> Frame:
    """Return the frame of one side of a loop."""
    found = loop.find(side)
    if found is None or not found.get("link"):
        raise SceneError([f"loop {name!r}: names no {side}"])
    origin = found.find("origin")
    turn = _roll_pitch_yaw(_numbers(origin, "rpy", (0.0, 0.0, 0.0)))
    return Frame(body_of(str(found.get("link"))), _numbers(origin, "xyz", (0.0, 0.0, 0.0)), turn)


def _numbers(element: Any, key: str, default: tuple[float, float, float]) -> np.ndarray:
    text = element.get(key) if element is not None else None
    return np.array([float(word) for word in text.split()] if text else default)


def _roll_pitch_yaw(angles: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of angles about fixed x, y, z axes."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
