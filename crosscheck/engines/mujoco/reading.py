"""MJCF and URDF as scenes: bodies, joints, equalities, springs and gravity of the compiled model.

A body's frame in the scene has its origin at the centre of mass and the axes of the file's body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.left_out import left_out
from crosscheck.engines.mujoco.urdf import closures, without_shapes
from mbref import rotations
from mbref.formats import Imported
from mbref.scene import (
    GROUND,
    Body,
    Cylindrical,
    Driver,
    Fixed,
    Joint,
    Planar,
    Revolute,
    Scene,
    SceneError,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
    Universal,
)

ALIGNED = 1e-9  # between directions; and between points, of the model's extent
OPEN = 1e-6  # a closure wider than this, of the model's extent, is told


def read(path: Path) -> Imported:
    """The scene of a .xml (MJCF) or .urdf file at its reference position; raises SceneError, OSError."""
    import mujoco

    text = path.read_text(encoding="utf-8")
    try:
        if path.suffix == ".urdf":
            model = mujoco.MjModel.from_xml_string(without_shapes(text))
        else:
            model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise SceneError([f"{path}: MuJoCo cannot read it: {' '.join(str(error).split())}"]) from None
    reader = _Reader(mujoco, model)
    if model.nbody < 2:  # the first is the world
        raise SceneError([f"{path}: has no body"])
    joints = [*reader.tree_joints(), *reader.equalities()]
    if path.suffix == ".urdf":
        joints += closures(text, reader.world_place, reader.name_of)
    scene = Scene(
        name=path.stem, gravity=model.opt.gravity.tolist(), body=tuple(reader.bodies()),
        joint=tuple(_renamed(joints)), driver=tuple(reader.drivers), load=tuple(reader.loads()),
    )  # fmt: skip
    return Imported(scene, (*reader.notes, *left_out(mujoco, model)))


def _renamed(joints: list[Joint]) -> Iterator[Joint]:
    """Joints with names of their own: a second one of a name gets a number."""
    seen: set[str] = set()
    for joint in joints:
        name, number = joint.name, 2
        while name in seen:
            name, number = f"{joint.name} {number}", number + 1
        seen.add(name)
        yield joint.model_copy(update={"name": name})


class _Reader:
    """A compiled model at qpos0, and the parts left out while it was read."""

    def __init__(self, mujoco: Any, model: Any):
        self.mujoco, self.model, self.data = mujoco, model, mujoco.MjData(model)
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        self.notes: list[str] = []
        self.drivers: list[Driver] = []
        self.of_joint: dict[int, Joint] = {}  # by MuJoCo's joint
        self.extent = max(float(np.ptp(self.data.xipos, axis=0).max()), 1e-3)

    def name_of(self, b: int) -> str:
        """The scene's body of MuJoCo's: its own, its parent's where it has no mass, or the ground."""
        while b and self.model.body_mass[b] == 0 and self.model.body_jntnum[b] == 0:
            b = int(self.model.body_parentid[b])
        return (self.model.body(b).name or f"body {b}") if b else GROUND

    def world_place(self, name: str, place: np.ndarray) -> tuple[int, np.ndarray]:
        """Index of MuJoCo's body of a name, and the world place of a point (3,) in its frame."""
        b = self.mujoco.mj_name2id(self.model, self.mujoco.mjtObj.mjOBJ_BODY, name)
        b = max(b, 0)  # the root link of a URDF is the world
        return b, self.data.xpos[b] + self.data.xmat[b].reshape(3, 3) @ place

    def bodies(self) -> Iterator[Body]:
        """Every body with mass; raises SceneError for one without that has joints."""
        model, data = self.model, self.data
        for b in range(1, model.nbody):
            if model.body_mass[b] == 0:
                if model.body_jntnum[b]:
                    raise SceneError([f"body {self.name_of(b)!r} has joints and no mass; a scene needs one"])
                continue
            to_body = data.xmat[b].reshape(3, 3).T @ data.ximat[b].reshape(3, 3)
            inertia = to_body @ np.diag(model.body_inertia[b]) @ to_body.T
            plain = np.abs(inertia - np.diag(np.diag(inertia))).max() <= 1e-15 * np.abs(inertia).max()
            yield Body(
                name=self.name_of(b), mass=float(model.body_mass[b]),
                inertia=(np.diag(inertia) if plain else (inertia + inertia.T) / 2).tolist(),
                position=data.xipos[b], orientation=data.xquat[b],
            )  # fmt: skip

    def tree_joints(self) -> Iterator[Joint]:
        """The joints that hang each body on its parent."""
        for b in range(1, self.model.nbody):
            first, count = int(self.model.body_jntadr[b]), int(self.model.body_jntnum[b])
            numbers = range(first, first + count)
            kinds = tuple(
                self.mujoco.mjtJoint(self.model.jnt_type[j]).name.removeprefix("mjJNT_").lower()
                for j in numbers
            )
            if kinds == ("free",) or (not count and self.model.body_mass[b] == 0):
                continue
            joint = self._joint(b, kinds, list(numbers))
            self.of_joint.update(dict.fromkeys(numbers, joint))
            yield joint

    def _joint(self, b: int, kinds: tuple[str, ...], numbers: list[int]) -> Joint:
        pair = (self.name_of(int(self.model.body_parentid[b])), self.name_of(b))
        name = self.model.joint(numbers[0]).name if numbers else ""
        anchors, axes = self.data.xanchor[numbers], self.data.xaxis[numbers]
        if not kinds:
            return Fixed(name=f"{pair[1]} fixed", bodies=pair, anchor=self.data.xipos[b])
        made = _as_joint(kinds, anchors, axes, self.extent)
        if made is None:
            kind = " and ".join(kinds)
            raise SceneError([f"body {pair[1]!r}: joints {kind} together are no joint of a scene"])
        return made(name or f"{pair[1]} joint", pair)

    def equalities(self) -> Iterator[Joint]:
        """Closures by connect and weld; joints held by an equality become drivers that stand still."""
        kinds, model = self.mujoco.mjtEq, self.model
        for e in range(model.neq):
            name = model.equality(e).name or f"equality {e}"
            if not model.eq_active0[e]:
                self.notes.append(f"equality {name!r} is not active")
            elif model.eq_type[e] == kinds.mjEQ_CONNECT:
                yield self._connect(e, name)
            elif model.eq_type[e] == kinds.mjEQ_WELD:
                yield self._weld(e, name)
            elif model.eq_type[e] == kinds.mjEQ_JOINT:
                self._held(e, name)
            else:
                self.notes.append(
                    f"equality {name!r} of type {kinds(model.eq_type[e]).name} has no counterpart"
                )

    def _ends(
        self, e: int, points: tuple[np.ndarray, np.ndarray]
    ) -> tuple[tuple[str, str], list[np.ndarray]]:
        """Bodies of an equality and world places of its points, of its sites where it names sites."""
        objects = (int(self.model.eq_obj1id[e]), int(self.model.eq_obj2id[e]))
        if self.model.eq_objtype[e] == self.mujoco.mjtObj.mjOBJ_SITE:
            owners = [int(self.model.site_bodyid[s]) for s in objects]
            places = [self.data.site_xpos[s].copy() for s in objects]
        else:
            owners = list(objects)
            places = [
                self.data.xpos[b] + self.data.xmat[b].reshape(3, 3) @ p
                for b, p in zip(owners, points, strict=True)
            ]
        return (self.name_of(owners[0]), self.name_of(owners[1])), places

    def _connect(self, e: int, name: str) -> Joint:
        data = self.model.eq_data[e]
        pair, places = self._ends(e, (data[0:3], data[3:6]))
        self._tell_open(name, float(np.linalg.norm(places[1] - places[0])))
        return Spherical(name=name, bodies=pair, anchor=places[0].tolist())

    def _weld(self, e: int, name: str) -> Joint:
        data = self.model.eq_data[e]
        pair, places = self._ends(e, (data[3:6], data[0:3]))
        self._tell_open(name, float(np.linalg.norm(places[1] - places[0])))
        self._tell_turned(e, name)
        return Fixed(name=name, bodies=pair, anchor=places[1].tolist())

    def _tell_open(self, name: str, gap: float) -> None:
        if gap > OPEN * self.extent:
            self.notes.append(f"equality {name!r} is open by {gap:.3g} m at the reference position")

    def _tell_turned(self, e: int, name: str) -> None:
        """Tells where a weld holds its bodies turned from the reference position."""
        if self.model.eq_objtype[e] == self.mujoco.mjtObj.mjOBJ_SITE:
            ends = [
                self.data.site_xmat[s].reshape(3, 3)
                for s in (self.model.eq_obj1id[e], self.model.eq_obj2id[e])
            ]
            held, found = (rotations.from_matrix(m) for m in ends)
        else:
            first, found = (self.data.xquat[b] for b in (self.model.eq_obj1id[e], self.model.eq_obj2id[e]))
            held = rotations.multiply(first, self.model.eq_data[e, 6:10])
        if (angle := float(rotations.angle_between(held, found))) > OPEN:
            self.notes.append(f"weld {name!r} holds its bodies turned by {angle:.3g} rad")

    def _held(self, e: int, name: str) -> None:
        """An equality of one joint with a constant: the joint stands still."""
        j, other, first = int(self.model.eq_obj1id[e]), int(self.model.eq_obj2id[e]), self.model.eq_data[e, 0]
        joint = self.of_joint.get(j)
        if other >= 0 or first != 0 or joint is None or not joint.facts.driven:
            self.notes.append(f"equality {name!r} couples coordinates of joints, which a scene cannot")
        else:
            self.drivers.append(Driver(joint=joint.name))

    def loads(self) -> Iterator[Any]:
        """Springs and dampers of joints and of tendons between two sites."""
        model = self.model
        for j in range(model.njnt):
            stiffness, damping = float(model.jnt_stiffness[j]), float(model.dof_damping[model.jnt_dofadr[j]])
            if not stiffness and not damping:
                continue
            q, joint, name = int(model.jnt_qposadr[j]), self.of_joint.get(j), model.joint(j).name
            if joint is None or not joint.facts.takes_torsion_spring or "HINGE" not in self._kind(j):
                self.notes.append(f"joint {name!r}: its stiffness and damping have no counterpart")
                continue
            angle = float(model.qpos_spring[q] - model.qpos0[q])
            yield TorsionSpring(joint=joint.name, stiffness=stiffness, damping=damping, natural_angle=angle)
        yield from self._tendons()

    def _kind(self, j: int) -> str:
        return str(self.mujoco.mjtJoint(self.model.jnt_type[j]).name)

    def _tendons(self) -> Iterator[Any]:
        model, site = self.model, self.mujoco.mjtWrap.mjWRAP_SITE
        for k in range(model.ntendon):
            wraps = range(int(model.tendon_adr[k]), int(model.tendon_adr[k] + model.tendon_num[k]))
            low, high = model.tendon_lengthspring[k]
            if len(wraps) != 2 or any(model.wrap_type[w] != site for w in wraps) or low != high:
                self.notes.append(f"tendon {model.tendon(k).name!r} is no spring between two sites")
                continue
            first, second = (self._site(int(model.wrap_objid[w])) for w in wraps)
            yield Spring(
                bodies=(first[0], second[0]), points=(first[1], second[1]), natural_length=float(low),
                stiffness=float(model.tendon_stiffness[k]), damping=float(model.tendon_damping[k]),
            )  # fmt: skip

    def _site(self, s: int) -> tuple[str, Any]:
        """Body and world place of a site."""
        return self.name_of(int(self.model.site_bodyid[s])), self.data.site_xpos[s].tolist()


def _as_joint(
    kinds: tuple[str, ...], anchors: np.ndarray, axes: np.ndarray, extent: float
) -> Callable[[str, tuple[str, str]], Joint] | None:  # fmt: skip
    """The scene's joint of a body's MuJoCo joints, from parent to child; None where there is none."""
    together = np.ptp(anchors, axis=0).max() <= ALIGNED * extent
    turns = [k for k, kind in enumerate(kinds) if kind == "hinge"]
    across = np.abs(axes @ axes.T - np.eye(len(kinds))).max() <= ALIGNED
    along = np.abs(np.abs(axes @ axes.T) - 1).max() <= ALIGNED
    of = {"anchor": anchors[turns[-1] if turns else 0], "axis": axes[turns[-1] if turns else 0]}
    simple: dict[tuple[str, ...], type[Any]] = {
        ("hinge",): Revolute, ("slide",): Translational, ("ball",): Spherical,
    }  # fmt: skip
    chosen: type[Any] | None = simple.get(kinds)
    if sorted(kinds) == ["hinge", "slide"] and along:
        chosen = Cylindrical
    elif kinds == ("hinge", "hinge") and across and together:
        chosen, of = Universal, {"anchor": anchors[0], "axes": (axes[0], axes[1])}
    elif kinds == ("slide", "slide", "hinge") and across:
        chosen = Planar
    elif kinds == ("hinge", "hinge", "hinge") and across and together:
        chosen = Spherical
    return None if chosen is None else lambda name, pair: chosen.at(name, pair, **of)
