"""The scene of an SDF file: links become bodies, joints keep their frames, and loops stay closed."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing.left_out import Part, checked, refuse_others
from crosscheck.engines.sdf import gearing, limits
from crosscheck.engines.sdf.elements import (
    direction,
    inertia_of,
    is_true,
    limits_of,
    number,
    of_world,
    pitch,
    plain,
    unused,
)
from crosscheck.engines.sdf.flattening import STATIC, flattened
from crosscheck.engines.sdf.frames import ORIGIN, WORLD, Frames, check_names, numbers, pose_of
from crosscheck.engines.sdf.including import expanded
from crosscheck.engines.shared import xml_files
from crosscheck.engines.shared.entries import entry
from mbref import rotations
from mbref.formats import Imported, ImportOptions
from mbref.scene import (
    GROUND,
    Body,
    Coupling,
    Cylindrical,
    Fixed,
    Joint,
    Revolute,
    RotationalDamper,
    Scene,
    SceneError,
    SlideSpring,
    Spherical,
    TorsionSpring,
    Translational,
    Universal,
)

GRAVITY = (0.0, 0.0, -9.8)  # m/s², the format's default for a file without gravity
ENDS, GEARBOX = ("parent", "child"), "gearbox"
ROUNDED = 1e-12  # offset of a mimic / its terms; a smaller offset is rounding of the file's numbers
SQUARE = 1e-6  # cosine between the axes of a universal joint; a larger cosine is no rounding
TYPES: dict[str, Any] = {
    "fixed": Fixed,
    "revolute": Revolute,
    "continuous": Revolute,
    "prismatic": Translational,
    "ball": Spherical,
    "universal": Universal,
    "revolute2": Universal,
    "screw": Cylindrical,
}


def read(path: Path, options: ImportOptions) -> Imported:
    """Return the scene in a .sdf file; raises SceneError for a faulty file, ValueError for a faulty option,
    OSError."""
    without = checked(options.without)
    if options.keyframe or options.pose or options.close:
        raise SceneError(
            ["--keyframe, --pose, --close: an SDF file gives the poses and closes its own loops"]
        )
    root = xml_files.parsed(path)
    reader = _Reader()
    world = root.find("world")
    parts = {part.tag for part in (root if world is None else world)}
    if root.tag != "sdf" or not parts & {"model", "include"}:
        raise SceneError([f"{path}: has no model"])
    if world is not None and (others := _beside(root, world)):
        raise SceneError(
            [f"{path}: has {', '.join(others)} beside world {world.get('name')!r}; keep one of them"]
        )
    root = expanded(root, path)
    reader.parts += of_world(root)
    reader.read(flattened(root))
    if not reader.bodies:
        raise SceneError([f"{path}: has no body that moves"])
    given = root.find("world/gravity")
    gravity = GRAVITY if given is None else tuple(numbers(given, "gravity", 3).tolist())
    refuse_others(reader.parts, without)
    scene = reader.scene(path.stem, gravity, options.hold)
    acting = list(limits.acting(scene, reader.limits))
    refuse_others(acting, without)
    reader.parts += acting
    wanted = tuple(f"{part.sentence} (--without {part.kind})" for part in reader.parts)
    notes = [] if given is not None else ["gravity is 9.8 m/s² downwards, the default of SDF"]
    return Imported(scene, (*wanted, *unused(root)), tuple([*reader.notes, *notes]))


def _beside(root: ET.Element, world: ET.Element) -> list[str]:
    """Return the other worlds of a file, and the models outside of worlds."""
    parts = [part for tag in ("world", "model", "include") for part in root.findall(tag)]
    return [f"{part.tag} {part.get('name', '')!r}" for part in parts if part is not world]


@dataclass
class _Reader:
    """Collects bodies, joints, couplings and loads of the models of a file."""

    bodies: list[Body] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    loads: list[Any] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)

    def scene(self, name: str, gravity: Any, hold: Any) -> Scene:
        """Return the scene of all models, with some bodies fixed to the ground; raises SceneError for an
        unknown body."""
        known = {body.name: body for body in self.bodies}
        if unknown := [body for body in hold if body not in known]:
            raise SceneError([f"--hold {unknown[0]}: no such link that moves; known: {', '.join(known)}"])
        held = [Fixed.at(f"hold {body}", (GROUND, body), anchor=known[body].position) for body in hold]
        return Scene(
            name=name,
            gravity=gravity,
            body=tuple(self.bodies),
            joint=(*self.joints, *held),
            coupling=tuple(self.couplings),
            load=tuple(self.loads),
        )

    def read(self, model: ET.Element) -> None:
        """Read a flat model."""
        frames = Frames(model)
        self.name_of = {WORLD: GROUND}
        check_names(model)
        for link in model.findall("link"):
            own = str(link.get("name"))
            is_fixed = link.get(STATIC) is not None
            self.name_of[own] = GROUND if is_fixed else f"link {own}" if own == GROUND else own
            if not is_fixed:
                self.bodies.append(self._body(link, own, frames))
        gears = [joint for joint in model.findall("joint") if joint.get("type") == GEARBOX]
        for joint in model.findall("joint"):
            if joint not in gears:
                self._joint(joint, frames)
        for joint in gears:
            self._gearbox(joint, frames)

    def _body(self, link: ET.Element, own: str, frames: Frames) -> Body:
        inertial = link.find("inertial")
        at, place = frames.pose(link), ORIGIN
        mass, inertia = 1.0, np.eye(3)  # the defaults of the format
        if inertial is None:
            self.notes.append(f"link {own!r} has no inertial: 1 kg and 1 kg m², the defaults of SDF")
        else:
            place = pose_of(inertial, f"link {own!r}: inertial pose")
            if inertial.get("auto", "false").lower() in ("true", "1"):
                raise SceneError([f"link {own!r}: inertial auto='true' is not read; give mass and inertia"])
            mass = number(inertial.find("mass"), f"link {own!r}: mass", 1.0)
            if not mass > 0:
                raise SceneError([f"link {own!r}: mass must be positive, got {mass:g}"])
            inertia = inertia_of(inertial.find("inertia"), own)
            if faults := list(xml_files.inertia_faults(inertia, own, ("<ixx>", "<iyy>", "<izz>"))):
                raise SceneError(faults)
            if inertial.find("fluid_added_mass") is not None:
                self.parts.append(Part("fluid", f"the added mass of link {own!r} in a fluid"))
        if link.find("gravity") is not None and not is_true(link.find("gravity")):
            self.parts.append(Part("gravity-compensation", f"link {own!r} without weight"))
        if is_true(link.find("kinematic")):
            self.parts.append(Part("kinematic-links", f"kinematic link {own!r}"))
        if link.find("velocity_decay") is not None:
            self.parts.append(Part("damping", f"velocity_decay of link {own!r}"))
        centre = at.then(place)
        turn = place.turn
        return entry(
            f"link {own!r}",
            Body,
            name=self.name_of[own],
            mass=mass,
            inertia=plain(turn @ inertia @ turn.T),
            position=centre.position.tolist(),
            orientation=rotations.from_matrix(at.turn).tolist(),
        )

    def _joint(self, joint: ET.Element, frames: Frames) -> None:
        name, kind = str(joint.get("name")), str(joint.get("type"))
        if kind not in TYPES:
            raise SceneError([f"joint {name!r}: type {kind!r} is none of {', '.join((*TYPES, GEARBOX))}"])
        first, second = (self._body_at(joint, joint.findtext(side, ""), frames) for side in ENDS)
        if first == second and first != GROUND:
            raise SceneError([f"joint {name!r}: both sides are on link {first!r}"])
        if first == second:
            self.notes.append(f"joint {name!r}: both sides are fixed to the ground")
            return
        at = frames.pose(joint)
        axes = [direction(joint.find(tag), name, at, frames) for tag in ("axis", "axis2")]
        places = {
            "anchor": at.position.tolist(),
            "axis": axes[0].tolist(),
            "axes": [a.tolist() for a in axes],
        }
        if TYPES[kind] is Universal and abs(axes[0] @ axes[1]) > SQUARE:
            raise SceneError([f"joint {name!r}: the axes of its type {kind} must be perpendicular"])
        made: Joint = entry(f"joint {name!r}", TYPES[kind].at, name, (first, second), **places)
        self.joints.append(made)
        if kind == "screw":
            self._screw(joint, made)
        for tag in ("axis", "axis2"):
            if (axis := joint.find(tag)) is not None:
                self._dynamics(axis, made)
                self._mimic(axis, made)
                self._limit(axis, made, tag)
                if number(axis.find("initial_position"), f"joint {name!r}: initial_position", 0.0):
                    self.parts.append(Part("start", f"initial position of joint {name!r}"))

    def _body_at(self, joint: ET.Element, end: str, frames: Frames) -> str:
        """Return the body of a link or frame that a joint names."""
        if (end := end.strip()) != WORLD and not frames.has(end):
            raise SceneError([f"joint {joint.get('name')!r}: the file has no link or frame {end!r}"])
        return self.name_of[frames.link_of(end)]

    def _gearbox(self, joint: ET.Element, frames: Frames) -> None:
        """Add the coupling of two hinges that a gearbox is."""
        name, reference = str(joint.get("name")), gearing.reference_of(joint)
        ends = *(joint.findtext(side, "") for side in ENDS), reference
        parent, child, base = (self._body_at(joint, end, frames) for end in ends)
        at = frames.pose(joint)
        axes = [direction(joint.find(tag), name, at, frames) for tag in ("axis", "axis2")]
        ratio = number(joint.find("gearbox_ratio"), f"joint {name!r}: gearbox_ratio", 1.0)
        links = parent, child, base
        self.couplings.append(gearing.of_gearbox(name, links, axes, ratio, self.joints))

    def _screw(self, joint: ET.Element, made: Joint) -> None:
        pair = made.name, made.name
        ratio = pitch(joint) / (2 * math.pi)
        where = f"joint {made.name!r}: thread"
        self.couplings.append(entry(where, Coupling, name=f"{made.name} thread", joints=pair, ratio=ratio))

    def _limit(self, axis: ET.Element, made: Joint, tag: str) -> None:
        """Collect the limits of a hinge or slide; another joint is only compared with its zero position."""
        low, high = limits_of(axis, made.name)
        if tag == "axis" and made.facts.driven:
            self.limits[made.name] = low, high
        elif low > 0.0 or high < 0.0:
            self.parts.append(Part("limits", f"limit of joint {made.name!r}, which acts at the start"))

    def _dynamics(self, axis: ET.Element, made: Joint) -> None:
        """Add a spring and damper of a hinge or a slide, or the damper of a ball joint; friction and springs
        of other joints are parts to be left out."""
        found = axis.find("dynamics")
        if found is None:
            return
        damping, friction, rest, stiffness = (
            number(found.find(tag), f"joint {made.name!r}: {tag}", 0.0)
            for tag in ("damping", "friction", "spring_reference", "spring_stiffness")
        )
        if friction:
            self.parts.append(Part("friction", f"dry friction of joint {made.name!r}"))
        where = f"joint {made.name!r}: dynamics"
        given: dict[str, Any] = {"joint": made.name, "stiffness": stiffness, "damping": damping}
        if not (damping or stiffness):
            return
        if made.type == "revolute":
            self.loads.append(entry(where, TorsionSpring, **given, natural_angle=rest))
            return
        if made.type == "translational":
            self.loads.append(entry(where, SlideSpring, **given, natural_displacement=rest))
            return
        if made.type == "spherical" and damping:
            self.loads.append(entry(where, RotationalDamper, bodies=made.bodies, damping=damping))
            damping = 0.0
        for kind, size in (("damping", damping), ("springs", stiffness)):
            if size:
                self.parts.append(Part(kind, f"{kind} of joint {made.name!r}"))

    def _mimic(self, axis: ET.Element, made: Joint) -> None:
        mimic = axis.find("mimic")
        if mimic is None:
            return
        other, where = str(mimic.get("joint")), f"joint {made.name!r}: mimic"
        ratio, offset, reference = (
            number(mimic.find(tag), f"{where} {tag}", default)
            for tag, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
        )
        moved = offset - ratio * reference  # of this joint where the other one is at 0
        if abs(moved) <= ROUNDED * (abs(offset) + abs(ratio * reference)):
            moved = 0.0
        if not ratio:
            raise SceneError([f"{where} multiplier must not be 0, which would lock the joint"])
        name = f"{made.name} mimics {other}"
        if moved:
            self.notes.append(
                f"{name} with an offset of {moved:.6g}: the motion starts where the joints obey it"
            )
        pair = other, made.name
        self.couplings.append(entry(where, Coupling, name=name, joints=pair, ratio=ratio, offset=moved))


class SdfFiles:
    """SDF files of Gazebo and other programs, which are read and not written."""

    reads = (".sdf",)
    writes = ()

    def read(self, path: Path, options: ImportOptions) -> Imported:
        """Return the scene in a .sdf file; raises SceneError, ValueError, OSError."""
        return read(path, options)

    def write(self, scene: Scene) -> Any:
        """Refuse: no scene is written as SDF."""
        raise SceneError(["SDF: is read only; export as .xml"])


FORMAT = SdfFiles()
