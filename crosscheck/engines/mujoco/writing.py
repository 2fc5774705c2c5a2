"""A scene as MJCF: the tree, closures as equalities, true masses and inertias, springs and gravity.

Bodies have the names of the scene's bodies. At t = 0 their frames have world axes and the origin at the
centre of mass. A cut joint carries a part of its body's mass on its other side, named ``rod (share 1)``.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from typing import Any

import numpy as np

from crosscheck.engines.mujoco import dampers
from crosscheck.engines.mujoco.model import COUPLING, POWERS, description
from crosscheck.engines.mujoco.pivots import LEAST_INERTIA
from crosscheck.engines.shared.spanning_tree import FREE, Link, Tree, spanning_tree
from crosscheck.refusals import MOST_COUPLED
from mbref import rotations
from mbref.formats import Exported
from mbref.scene import (
    Force,
    JointForce,
    JointLoad,
    JointTorque,
    Load,
    Moment,
    PointDamper,
    RotationalDamper,
    Scene,
    SceneError,
)

CONSTANT = (Moment, Force)  # loads that MJCF cannot describe
DAMPERS = (RotationalDamper, PointDamper)  # which MJCF describes for some joints
RESERVED = ("world",)  # names that a body of MJCF cannot have
KEYFRAME = "loads"  # with the control values of motors that stand for forces and torques of joints


def write(scene: Scene) -> Exported:
    """Return the MJCF text; drivers, constant loads, and couplings of more than two joints or of high powers
    are reported as left out.  SceneError without masses."""
    if not scene.has_mass():
        raise SceneError([f"{scene.name}: MJCF needs the mass and inertia of every body"])
    if links := [body.name for body in scene.body if body.mass == 0]:
        raise SceneError([f"body {links[0]!r}: is a massless link; MuJoCo reads no moving body of mass 0"])
    kept = [load for load in scene.load if not (isinstance(load, (*CONSTANT, *DAMPERS)) or load.over_time)]
    pairs = [each for each in scene.coupling if len(each.joints) == MOST_COUPLED and each.powers <= POWERS]
    acting = {load.joint for load in kept if isinstance(load, JointLoad)}
    acting |= {name for coupling in pairs for name in coupling.joints}
    joints = [joint for joint in scene.joint if joint.facts.rows or joint.name in acting]
    bare = scene.with_(joint=joints, driver=(), load=kept, coupling=pairs)
    tree = spanning_tree(bare)
    damped = {k: dampers.of_free_link(scene, tree, k) for k in range(len(tree.links))}
    damping = [x for x in scene.load if isinstance(x, DAMPERS) and dampers.turning_joints(bare, tree, x)]
    spec, pushed = description(bare.with_(load=[*kept, *damping]), tree)
    for k, found in damped.items():
        for load in found[:1]:
            spec.joint(f"free {k}").damping[0] = load.damping
        damping += found
    spec.modelname = scene.name
    parts = {f"link {k}": name for k, name in enumerate(_names(bare, tree))}
    for (key, name), link in zip(parts.items(), tree.links, strict=True):
        body = spec.body(key)
        _true_inertia(body, link)
        if link.mobilities and (least := min(body.mass, *body.inertia)) < LEAST_INERTIA:
            fault = (
                f"body {name!r}: MuJoCo reads no moving body with a mass or moment of inertia of {least:.3g}"
            )
            raise SceneError([fault])
    joints_of_file, equalities = _joint_names(bare, tree), _equality_names(bare, tree)
    new: dict[str, str] = {}
    other: list[str] = []
    for kind, wanted in ("body", parts), ("joint", joints_of_file), ("equality", equalities):
        given = _distinct(wanted, RESERVED if kind == "body" else ())
        new |= given
        other += [f"{kind} name {wanted[k]!r}: is {given[k]!r}" for k in wanted if given[k] != wanted[k]]
    motors = [(new[name], amount) for name, amount, _ in pushed]
    return Exported(_text(spec, new, motors), (*other, *_left_out(scene, damping), *_divided(bare, tree)))


def _distinct(names: dict[str, str], taken: Iterable[str]) -> dict[str, str]:
    """Return different names by key: a name that is taken gets a number, as in ``world (2)``."""
    found, used = {}, {*taken, *names.values()}
    seen = set(taken)
    for key, name in names.items():
        numbered = (f"{name} ({k})" for k in count(2))
        found[key] = next(each for each in numbered if each not in used | seen) if name in seen else name
        seen.add(found[key])
    return found


def _text(spec: Any, new: dict[str, str], motors: Sequence[tuple[str, float]]) -> str:
    """Return the MJCF text with all digits: MuJoCo's own writer prints six.

    ``new`` has the file's name of each body, joint and equality by its name in ``spec``. ``motors`` are
    joints with their forces or torques, the control values of the keyframe ``loads``.
    """
    root = ET.Element("mujoco", model=spec.modelname)
    ET.SubElement(root, "compiler", angle="radian")
    ET.SubElement(root, "option", gravity=_digits(spec.option.gravity))
    _add_body(ET.SubElement(root, "worldbody"), spec.worldbody, new)
    equalities = ET.SubElement(root, "equality")
    for closure in spec.equalities:
        kind = closure.type.name.removeprefix("mjEQ_").lower()
        if kind == "joint":
            ends = {"joint1": new[closure.name1], "joint2": new[closure.name2]}
            own = {"name": new[closure.name], "polycoef": _digits(closure.data[:5])}
            ET.SubElement(equalities, kind, own | ends)
            continue
        ET.SubElement(equalities, kind, name=new[closure.name], site1=closure.name1, site2=closure.name2)
    tendons = ET.SubElement(root, "tendon")
    for spring in spec.tendons:
        element = ET.SubElement(
            tendons,
            "spatial",
            name=spring.name,
            springlength=_digits(spring.springlength),
            stiffness=_digits(spring.stiffness[:1]),
            damping=_digits(spring.damping[:1]),
        )
        for i in range(2):
            ET.SubElement(element, "site", site=f"{spring.name}.{i}")
    actuators = ET.SubElement(root, "actuator")
    for k, (joint, _) in enumerate(motors):
        ET.SubElement(actuators, "motor", name=f"motor {k} of {joint}", joint=joint)
    keyframes = ET.SubElement(root, "keyframe")
    if motors:
        ET.SubElement(keyframes, "key", name=KEYFRAME, ctrl=_digits([amount for _, amount in motors]))
    for section in (equalities, tendons, actuators, keyframes):
        if not len(section):
            root.remove(section)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_body(element: ET.Element, body: Any, new: dict[str, str]) -> None:
    """Add inertia, joints, sites and children of a body."""
    if element.tag == "body":
        ET.SubElement(
            element,
            "inertial",
            mass=_digits([body.mass]),
            pos=_digits(body.ipos),
            quat=_digits(body.iquat),
            diaginertia=_digits(body.inertia),
        )
    for joint in body.joints:
        kind = joint.type.name.removeprefix("mjJNT_").lower()
        turning = {} if kind in ("free", "ball") else {"axis": _digits(joint.axis)}
        numbers = {
            "stiffness": joint.stiffness[:1],
            "damping": joint.damping[:1],
            "springref": [joint.springref],
            "armature": [joint.armature],
        }
        spring = {key: _digits(value) for key, value in numbers.items() if np.any(value)}
        place = {} if kind == "free" else {"pos": _digits(joint.pos)}
        ET.SubElement(element, "joint", {"name": new[joint.name], "type": kind, **place, **turning, **spring})
    for site in body.sites:
        ET.SubElement(element, "site", name=site.name, pos=_digits(site.pos))
    for child in body.bodies:
        _add_body(ET.SubElement(element, "body", name=new[child.name], pos=_digits(child.pos)), child, new)


def _digits(numbers: Any) -> str:
    return " ".join(repr(float(x)) for x in np.atleast_1d(numbers))


def _names(scene: Scene, tree: Tree) -> list[str]:
    """Return the name of every link: the scene's body, with a number for parts of split bodies and rods of
    distance joints."""
    names: list[str] = []
    for k, link in enumerate(tree.links):
        name = scene.body[link.body].name if link.body >= 0 else "rod of a distance joint"
        own = link.body >= 0 and tree.own[link.body] == k
        names.append(name if own else f"{name} (share {k})")
    return names


def _joint_names(scene: Scene, tree: Tree) -> dict[str, str]:
    """Return the scene's names of joints, with a number if a joint consists of several elementary motions, by
    names in the specification."""
    new: dict[str, str] = {}
    for k, link in enumerate(tree.links):
        motions = len(link.mobilities)
        for i, mobility in enumerate(link.mobilities):
            old = f"free {k}" if mobility.kind == FREE else f"joint {k}.{i}"
            name = scene.joint[link.joint].name if link.joint >= 0 else old
            new[old] = name if motions == 1 or link.joint < 0 else f"{name} {i + 1}"
    return new


def _equality_names(scene: Scene, tree: Tree) -> dict[str, str]:
    """Return the scene's names of closures and couplings by names in the specification."""
    closures = {
        # a weld joins two parts of a body
        f"closure {k}": scene.joint[each.joint].name if each.kind == "point" else f"closure {k}"
        for k, each in enumerate(tree.closures)
    }
    return closures | {COUPLING + each.name: each.name for each in scene.coupling}


def _true_inertia(body: Any, link: Link) -> None:
    """Return mass, centre and principal moments; the largest moment is at most the sum of the two others, as
    the compiler demands."""
    moments, axes = np.linalg.eigh(link.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    moments = np.maximum(moments, 0.0)
    moments[2] = max(moments[1], min(moments[2], (moments[0] + moments[1]) * (1 - 1e-15)))
    body.mass, body.inertia = link.mass, moments
    body.ipos, body.iquat = link.offset, rotations.from_matrix(axes)


def _divided(scene: Scene, tree: Tree) -> Iterator[str]:
    """Yield sentences on bodies whose mass the file divides; the motion is the scene's."""
    for closure in tree.closures:
        if closure.kind == "weld":
            name = scene.body[tree.links[closure.links[0]].body].name
            joint = scene.joint[closure.joint].name
            yield f"joint {joint}: its body {name} is in parts that welds hold, each with a share of its mass"
    for rod in (link for link in tree.links if link.ends):
        ends = [anchor.tolist() for _, anchor in rod.ends]
        joint = next(
            j.name for j in scene.joint if j.type == "distance" and list(map(list, j.anchors)) == ends
        )
        names = " and ".join(scene.body[b].name for b, _ in rod.ends if b >= 0)
        rod_of = f"a rod of {rod.mass:.3g} kg between ball joints"
        yield f"distance joint {joint}: is {rod_of}, with mass of {names}"


def _left_out(scene: Scene, damping: Sequence[Load]) -> Iterator[str]:
    """Yield sentences on what MJCF does not have; it has the dampers ``damping``."""
    for coupling in scene.coupling:
        if len(coupling.joints) > MOST_COUPLED:
            coupled = len(coupling.joints)
            yield f"coupling {coupling.name}: an equality of MJCF relates two joints, not {coupled}"
        elif coupling.powers > POWERS:
            yield f"coupling {coupling.name}: an equality of MJCF has degree {POWERS}, not {coupling.powers}"
    for driver in scene.driver:
        yield f"driver of {driver.joint}: MJCF prescribes no motion over time"
    for i, load in enumerate(scene.load):
        if isinstance(load, CONSTANT):
            yield f"load[{i}] ({load.type} on {load.body}): apply it by mjData.xfrc_applied"
        elif isinstance(load, DAMPERS) and load not in damping:
            yield f"load[{i}] ({load.type}): MJCF has dampers of joints, at the centre of mass of a free body"
        elif isinstance(load, JointTorque | JointForce):
            motor = f"its motor is controlled in keyframe {KEYFRAME!r}"
            reason = "MJCF has no loads over time" if load.over_time else motor
            yield f"load[{i}] ({load.type} of {load.joint}): {reason}"
    for body in scene.body:
        if body.velocity is not None or body.angular_velocity is not None:
            yield f"initial velocity of {body.name}: set mjData.qvel"
    yield "exactness of joints: MuJoCo's equalities are soft (solref, solimp)"
