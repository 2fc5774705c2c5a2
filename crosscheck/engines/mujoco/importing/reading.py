"""MJCF and URDF as scenes: bodies, joints, closures, springs and gravity of the compiled model.

Bodies that are fixed to each other are one body of the scene.  The frame of the scene's body has its origin
at the centre of mass and the axes of the file's body.  A scene is returned only if its matrices agree with
the model's.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing import (
    couplings,
    keyframes,
    left_out,
    limits,
    loads,
    massless,
    urdf,
    values,
)
from crosscheck.engines.mujoco.importing.actuators import Actuators
from crosscheck.engines.mujoco.importing.agreement import Agreement
from crosscheck.engines.mujoco.importing.asked_closures import Frames, asked, unclosed
from crosscheck.engines.mujoco.importing.chains import Chain, branching, kind_of, renamed
from crosscheck.engines.mujoco.importing.closures import Closure, of_equalities
from crosscheck.engines.mujoco.importing.compiling import compiled, extent_of, root_link
from crosscheck.engines.mujoco.importing.groups import WORLD, Groups
from crosscheck.engines.mujoco.importing.left_out import Part
from crosscheck.engines.mujoco.importing.posing import JointRow, Poses
from crosscheck.engines.mujoco.warnings_off import without_warnings
from crosscheck.engines.shared.entries import entry
from mbref.formats import Imported, ImportOptions
from mbref.scene import Body, Coupling, Driver, Joint, Scene, SceneError
from mbref.scene.joints import ANGLE, DISPLACEMENT, Coordinate

OPEN = 1e-6  # gap / extent of the model; a wider gap at the start is reported


@dataclass(frozen=True)
class Source:
    """A file that was read: the scene, and MuJoCo's model of it at the pose of the scene.

    ``model`` is without the parts that were left out; ``qpos`` and ``qvel`` are its coordinates.
    ``original`` is ``model`` with the file's own options; ``groups`` has the bodies of the scene.
    """

    imported: Imported
    model: Any
    original: Any
    groups: Groups
    actuators: Actuators
    qpos: np.ndarray
    qvel: np.ndarray


def source(path: Path, options: ImportOptions, is_passive: bool = False) -> Source:
    """Return the scene and the model of a .xml (MJCF) or .urdf file; raises SceneError, ValueError, OSError.

    A passive scene has no forces of actuators and of tendons.

    SceneError names a part that changes the motion and that a scene cannot describe, a loop that cannot be
    closed, or a part in which the scene and the compiled model disagree.
    """
    import mujoco

    with without_warnings(mujoco):
        return _read(mujoco, path, options, is_passive)


def _read(mujoco: Any, path: Path, options: ImportOptions, is_passive: bool) -> Source:
    without = left_out.checked(options.without)
    model, text, notes = compiled(mujoco, path, options)
    values.check(mujoco, model)
    if is_passive:
        left_out.actuators_and_tendons(mujoco, model)
    if model.nbody < 2:  # the first body is the world
        raise SceneError([f"{path}: has no body"])
    reader = _Reader(mujoco, model, text, options, without, notes=notes)
    if not reader.groups.massive:
        raise SceneError([f"{path}: has no body that moves"])
    left_out.refuse_others(left_out.flexible(model), without)
    reader.read()
    left_out.refuse_others(reader.parts, without)
    scene, data = reader.scene(path.stem), reader.poses.data
    state = data.qpos.copy(), data.qvel.copy()
    left_out.stripped(model, reader.kept)
    original = copy.copy(model)
    reader.actuators.prepare(data)
    Agreement(mujoco, model, reader.groups, reader.poses).check(scene, reader.tree)
    wanted = tuple(f"{part.sentence} (--without {part.kind})" for part in reader.parts)
    imported = Imported(
        scene,
        (*wanted, *reader.unread, *left_out.notes(mujoco, model, options.keyframe, reader.actuators.idle)),
        tuple(reader.notes),
    )
    return Source(imported, model, original, reader.groups, reader.actuators, *state)


@dataclass
class _Reader:
    """A compiled model, and everything that was read from it."""

    mujoco: Any
    model: Any
    text: urdf.Text | None
    options: ImportOptions
    without: frozenset[str]
    parts: list[Part] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    rows: list[JointRow] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    drivers: list[Driver] = field(default_factory=list)
    loads: list[Any] = field(default_factory=list)
    tree: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.groups = Groups(self.mujoco, self.model)
        self.unread: tuple[str, ...] = ()
        self.kept: list[int] = []  # indices of joint velocities whose armature is in the scene

    def read(self) -> None:
        """Read everything, at a pose with closed loops."""
        mujoco, model = self.mujoco, self.model
        key = keyframes.number_of(mujoco, model, self.options.keyframe)
        if model.opt.enableflags & getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0):
            self.parts += left_out.asleep(mujoco, model, key)
            self.unread = ("the sleep of bodies that come to rest",)
        self.actuators = Actuators(mujoco, model, key)
        self.parts += self.actuators.parts
        closures = self._closures()
        self.poses = Poses(mujoco, model, closures, self.rows, extent_of(mujoco, model))
        self.poses.start(self.options.keyframe, self.options.pose)
        self._close()
        self._read_joints(closures)
        self._read_loads()
        self.parts += left_out.of_model(model, self.kept)
        self.parts += limits.acting(mujoco, model, self.poses.data, self.actuators)
        if self.text is not None:
            self.parts += [*urdf.couplings(self.text.root), *urdf.impossible_limits(self.text.root)]
            self.unread = tuple(urdf.unread(self.text.root))
        self.notes += unclosed(self.groups, self.poses.data, closures, self.poses.extent)

    def scene(self, name: str) -> Scene:
        """Return the scene made of the parts that were read."""
        gravity_off = self.model.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_GRAVITY
        return Scene(
            name=name,
            gravity=(0.0, 0.0, 0.0) if gravity_off else self.model.opt.gravity.tolist(),
            body=tuple(self._bodies()),
            joint=tuple(self.joints),
            coupling=tuple(self.couplings),
            driver=tuple(self.drivers),
            load=tuple(self.loads),
        )

    def _bodies(self) -> Iterator[Body]:
        data = self.poses.data
        for piece in self.groups.pieces:
            twist = self.groups.placed(data, piece).jacobian @ data.qvel if np.any(data.qvel) else None
            yield self.groups.body(data, piece, twist)

    def _closures(self) -> list[Closure]:
        """Return the closures of the file and of the user; joint rows are stored separately."""
        reference = self.mujoco.MjData(self.model)
        self.mujoco.mj_kinematics(self.model, reference)
        root = root_link(self.text)
        self.frames = Frames(self.mujoco, self.model, root, urdf.child_links(self.text))
        found = [] if self._disabled("EQUALITY") else list(of_equalities(self.mujoco, self.model))
        if self.text is not None:
            found += urdf.loops(self.text.root, lambda name: self.frames.find(name).body, reference)
            self.rows += urdf.mimics(self.text.root, self._joint_number)
        found += asked(self.options.close, self.frames)
        if not self._disabled("EQUALITY"):
            self._read_equalities()
        return [c for c in found if self._between_groups(c)]

    def _joint_number(self, name: str) -> int:
        return int(self.mujoco.mj_name2id(self.model, self.mujoco.mjtObj.mjOBJ_JOINT, name))

    def _disabled(self, what: str) -> bool:
        bits = self.mujoco.mjtDisableBit
        flags = bits.mjDSBL_CONSTRAINT | getattr(bits, f"mjDSBL_{what}")
        return bool(self.model.opt.disableflags & flags)

    def _between_groups(self, closure: Closure) -> bool:
        first, second = (int(self.groups.of[frame.body]) for frame in closure.frames)
        if first == second:
            self.notes.append(f"closure {closure.name!r}: both sides are on {self.groups.names[first]!r}")
        return first != second

    def _read_equalities(self) -> None:
        """Read equalities of joints and tendons: rows of coordinates, parts to be left out and notes."""
        for found in couplings.of_equalities(self.mujoco, self.model):
            if isinstance(found, Part):
                self.parts.append(found)
            elif isinstance(found, JointRow):
                self.rows.append(found)
            else:
                self.notes.append(found)

    def _close(self) -> None:
        """Close the loops, and report how large their gaps were."""
        wide = {n: gap for n, gap in self.poses.gaps().items() if gap > OPEN * self.poses.extent}
        self.poses.close(self.options.say)
        for name, gap in wide.items():
            self.notes.append(
                f"closure {name!r} was open by {gap:.3g} m or rad; the joints moved to close it"
            )
        data = self.poses.data
        given = data.qvel.copy()
        data.qvel[:] = self.poses.allowed(given) if np.any(given) else given
        if (change := np.abs(data.qvel - given).max(initial=0.0)) > OPEN * np.abs(given).max(initial=0.0):
            self.notes.append(
                f"velocities of keyframe {self.options.keyframe!r} violate the loops; the nearest ones that "
                f"obey them differ by up to {change:.3g} m/s or rad/s"
            )

    def _read_joints(self, closures: list[Closure]) -> None:
        data, extent = self.poses.data, self.poses.extent
        self.joint_of: dict[int, Joint] = {}
        held = massless.held(self.model, self.groups, closures)
        self.notes += massless.idle(self.groups, held)
        self.groups.keep(branching(self.groups, held), ())
        wanted = massless.needs(self.model, self.rows, self.actuators.laws)
        found: list[Joint] = []
        whole: dict[int, int] = {}
        for chain, joints in massless.read(self.mujoco, self.groups, data, wanted, extent):
            whole.update({j: len(found) for j in chain.joints if len(joints) == 1})
            found += self._with_armature(chain, joints)
        count = len(found)
        found += [c.joint(data, self.groups) for c in closures]
        self.joints = list(renamed(found))
        self.tree = [joint.name for joint in self.joints[:count]]
        self.joint_of = {j: self.joints[k] for j, k in whole.items()}
        self._read_merged()
        self._couple()

    def _with_armature(self, chain: Chain, joints: list[Joint]) -> list[Joint]:
        """Return the joints of a chain; the joint of a single hinge or slide has its armature. No inertia of
        one body describes the armature of a ball joint between two, which turns at ω₂ - ω₁."""
        if chain.kinds == ("ball",) and chain.ends[0].group == WORLD:
            return self._on_world(chain, joints)
        has_armature = len(joints) == 1 and "armature" in type(joints[0]).model_fields
        driven = joints[0].facts.driven if has_armature else None
        wanted = {"hinge": ANGLE, "slide": DISPLACEMENT}
        kinds = [wanted.get(kind) for kind in chain.kinds]
        own = [j for j, kind in zip(chain.joints, kinds, strict=True) if driven and kind == driven]
        if len(own) != 1:
            return joints
        dof = int(self.model.jnt_dofadr[own[0]])
        if not (armature := float(self.model.dof_armature[dof])):
            return joints
        self.kept.append(dof)
        return [joints[0].model_copy(update={"armature": armature})]

    def _on_world(self, chain: Chain, joints: list[Joint]) -> list[Joint]:
        """Return the ball joint between the world and a body, whose inertia gets the joint's armature a: its
        energy is ½ a ω², and its momentum a ω along ω has no gyroscopic moment."""
        dof, body = int(self.model.jnt_dofadr[chain.joints[0]]), chain.ends[1]
        if armature := float(self.model.dof_armature[dof]):
            self.groups.rotors[body.group] = armature
            self.kept += range(dof, dof + 3)
            of = left_out.joint_name(self.model, chain.joints[0])
            what = f"armature {armature:g} kg m² of joint {of}"
            self.notes.append(f"{what}: is added to each moment of inertia of {self.groups.name(body)!r}")
        return joints

    def _read_merged(self) -> None:
        for members in self.groups.members.values():
            main = self.groups.main(members[0])
            heavy = [b for b in members if b != main and self.model.body_mass[b] > 0 and members[0]]
            if heavy:
                names = ", ".join(repr(self.model.body(b).name) for b in heavy)
                self.notes.append(f"fixed to {self.groups.name_of(main)!r} and part of it: {names}")

    def _couple(self) -> None:
        """Add a coupling for a coordinate that follows another coordinate, and a constant driver for a locked
        coordinate; rows of coordinates that no scene has are parts to be left out."""
        taken = {joint.name for joint in self.joints}
        for row in list(self.rows):
            found = [self._coordinate(row, j) for j in row.joints]
            ends = [end for end in found if end is not None]
            if len(ends) < len(found):
                self.parts.append(couplings.removed(self.mujoco, self.model, row))
                self.rows.remove(row)
                continue
            if len(ends) == 1:
                self.drivers.append(Driver(joint=ends[0][0].name))
                continue
            name = row.name
            while name in taken:
                name = f"coupling {name}"
            taken.add(name)
            joints, kinds = zip(*reversed(ends), strict=True)
            names = tuple(joint.name for joint in joints)
            driven = tuple(joint.facts.driven for joint in joints)
            law: dict[str, Any] = {"ratio": -row.factors[1]}
            law = law if len(names) == 2 else {"ratios": row.factors[::-1]}
            if row.higher:
                here = np.polynomial.Polynomial([self.poses.moved(row.joints[1]), 1.0])
                law = {"polynomial": tuple(row.law(here).coef[1:].tolist())}
            law["coordinates"] = None if kinds == driven and len(set(names)) == len(names) else kinds
            self.couplings.append(entry(f"equality {row.name!r}", Coupling, name=name, joints=names, **law))

    def _coordinate(self, row: JointRow, j: int) -> tuple[Joint, Coordinate] | None:
        """Return the scene's joint of a hinge or slide in the file, and its coordinate; None without one."""
        joint, couples = self.joint_of.get(j), len(row.joints) > 1
        if joint is None or (joint.type == "cylindrical" and not couples):
            return None
        coordinate = ANGLE if kind_of(self.mujoco, self.model, j) == "hinge" else DISPLACEMENT
        return (joint, coordinate) if coordinate in joint.facts.coordinates else None

    def _read_loads(self) -> None:
        mujoco, model, data = self.mujoco, self.model, self.poses.data
        found = [
            *loads.of_joints(mujoco, model, data, self.groups, self.joint_of),
            *loads.of_actuators(mujoco, model, data, self.actuators, self.joint_of),
            *loads.of_tendons(mujoco, model, data, self.groups),
        ]
        self.parts += [part for part in found if isinstance(part, Part)]
        self.notes += [note for note in found if isinstance(note, str)]
        self.loads += [load for load in found if not isinstance(load, Part | str)]
