"""A scene's spanning tree as a MuJoCo model: bodies and joints, closures and drivers as equalities, loads.

Every body frame has its origin at the centre of mass of the scene's body and world-aligned axes at t = 0.
Masses are written after compilation, because the compiler refuses some thin discs and rods due to rounding.
Until then placeholder inertias are used, with distinct frames and moments, so that the compiler does not
simplify the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.engines.mujoco import dampers
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.everything import EVERYTHING
from crosscheck.engines.shared.initial_velocities import initial_rates
from crosscheck.engines.shared.spanning_tree import (
    BALL_JOINT,
    COORDINATES,
    FREE,
    GROUND_LINK,
    SLIDE,
    TURN,
    Link,
    Tree,
    spanning_tree,
)
from crosscheck.judge.pieces import at_start, holds
from crosscheck.refusals import FACTOR, TABLE
from mbref import rotations
from mbref.scene import (
    GROUND,
    Coupling,
    Driver,
    Factor,
    Force,
    Joint,
    JointLoad,
    Moment,
    PointDamper,
    RotationalDamper,
    Scene,
    Spring,
)

POWERS = 4  # of the polynomial in MuJoCo's equality of two joints
SUPPORTS = replace(
    EVERYTHING,
    joints=(*EVERYTHING.joints, "inline"),
    over_time=(TABLE, FACTOR),
    massless_links=True,
    powers=POWERS,
)
COUPLING = "coupling "  # prefix of the names of equalities that are couplings
SWITCHED = "switched "  # prefix of the names of equalities that are joints with intervals, and of their sites
FAR = 1e10  # rad or m, the end of a range that has no stop
UNIT = (1.0, 0.0, 0.0, 0.0)
# placeholder moments, centre and axes during compilation
GENERAL = ((1.0, 1.1, 1.2), (0.1, 0.2, 0.3), (0.5, 0.5, 0.1, 0.7))


@dataclass(frozen=True)
class Compiled:
    """A compiled model, and the numbers of its parts that a run needs."""

    model: Any
    tree: Tree
    links: np.ndarray  # MuJoCo's body of each link
    single: tuple[Any, ...]  # types of MuJoCo joints with one coordinate
    drivers: list[tuple[int, Driver]]  # equality and motion of each driver
    applied: np.ndarray  # (nbody, 6) constant world forces and moments at the centres of mass
    pushed: np.ndarray  # (nv,) constant forces and torques along joint coordinates
    timed: list[tuple[Factor, int, np.ndarray]]  # factor, body or joint velocity, force on it
    rates: np.ndarray  # joint velocities at t = 0

    def apply(self, data: Any, since: float) -> None:
        """Set the forces on bodies and along joint coordinates to their values at the time of the data.

        Functions of time are of the piece that acts from ``since`` (s) on.
        """
        data.xfrc_applied[:], data.qfrc_applied[:] = self.applied, self.pushed
        for factor, number, force in self.timed:
            target = data.xfrc_applied if force.ndim else data.qfrc_applied
            target[number] += force * motion(factor, data.time, since)[0]


def compiled(scene: Scene, switched: Sequence[Joint | Coupling] = ()) -> Compiled:
    """Return the scene as a MuJoCo model with the library's default options and softness.

    ``switched`` joints and couplings, which the scene does not have, are equalities that can be activated.
    """
    import mujoco

    tree = spanning_tree(scene)
    built = _built(mujoco, scene, tree)
    for part in switched:
        built.add_switched(part)
    model = built.spec.compile()
    _write_masses(mujoco, model, tree)
    applied, pushed, timed = np.zeros((model.nbody, 6)), np.zeros(model.nv), []
    for name, wrench, factor in built.applied:
        if factor is None:
            applied[model.body(name).id] += wrench
        else:
            timed.append((factor, model.body(name).id, wrench))
    for name, amount, factor in built.pushed:
        velocity = int(model.joint(name).dofadr[0])
        if factor is None:
            pushed[velocity] += amount
        else:
            timed.append((factor, velocity, np.array(amount)))
    return Compiled(
        model=model,
        tree=tree,
        applied=applied,
        pushed=pushed,
        timed=timed,
        rates=initial_rates(at_start(scene), tree),
        links=np.array([model.body(_name(k)).id for k in range(len(tree.links))]),
        single=(mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE),
        drivers=[(model.equality(f"driver {d.joint}").id, d) for d in scene.driver],
    )


def description(scene: Scene, tree: Tree) -> tuple[Any, list[tuple[str, float, Factor | None]]]:
    """Return the scene's tree as a MjSpec of bodies ``link k``, joints ``joint k.i``, stand-ins for masses;
    and the joint, amount and factor of each force or torque along a joint."""
    import mujoco

    built = _built(mujoco, scene, tree)
    return built.spec, built.pushed


def _built(mujoco: Any, scene: Scene, tree: Tree) -> _Builder:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = scene.gravity
    built = _Builder(mujoco, scene, tree, spec)
    for k, link in enumerate(tree.links):
        built.add_link(k, link)
    for k, closure in enumerate(tree.closures):
        built.add_closure(k, closure)
    for coupling in scene.coupling:
        built.add_coupling(coupling)
    for i, inertia in tree.armatures(scene):
        built.joint[i].armature = inertia
    for joint in scene.joint:
        built.add_stop(joint)
    for driver in scene.driver:
        built.add_driver(driver)
    for k, load in enumerate(scene.load):
        built.add_load(k, load)
    return built


def _name(link: int) -> str:
    return "world" if link == GROUND_LINK else f"link {link}"


class _Builder:
    """Adds the parts of a tree to a MjSpec."""

    def __init__(self, mujoco: Any, scene: Scene, tree: Tree, spec: Any):
        self.mujoco, self.scene, self.tree, self.spec = mujoco, scene, tree, spec
        self.body = {GROUND_LINK: spec.worldbody}
        self.joint: dict[int, Any] = {}  # keyed by first joint velocity
        self.applied: list[tuple[str, np.ndarray, Factor | None]] = []
        self.pushed: list[tuple[str, float, Factor | None]] = []

    def centre(self, link: int) -> np.ndarray:
        """Return the origin of a link's frame (world) at t = 0."""
        return self.tree.links[link].position if link != GROUND_LINK else np.zeros(3)

    def add_link(self, k: int, link: Link) -> None:
        body = self.body[link.parent].add_body(name=_name(k), pos=link.position - self.centre(link.parent))
        _inertial(body, 1.0, *GENERAL)
        self.body[k] = body
        kinds = self.mujoco.mjtJoint
        of_kind = {SLIDE: kinds.mjJNT_SLIDE, TURN: kinds.mjJNT_HINGE, BALL_JOINT: kinds.mjJNT_BALL}
        for i, mobility in enumerate(link.mobilities):
            if mobility.kind == FREE:
                body.add_freejoint(name=f"free {k}")
                return
            axis = mobility.axis if mobility.kind != BALL_JOINT else np.ones(3)
            before = sum(COORDINATES[each.kind] for each in link.mobilities[:i])
            self.joint[self.tree.starts[k] + before] = body.add_joint(
                name=f"joint {k}.{i}", type=of_kind[mobility.kind], pos=link.anchor - link.position, axis=axis
            )

    def site(self, link: int, point: np.ndarray, name: str) -> str:
        """Add a site at a point (world at t = 0) of a link."""
        self.body[link].add_site(name=name, pos=point - self.centre(link))
        return name

    def add_closure(self, k: int, closure: Any) -> None:
        kinds = self.mujoco.mjtEq
        kind, point = kinds.mjEQ_CONNECT, closure.anchor
        if closure.kind == "weld":
            kind, point = kinds.mjEQ_WELD, self.centre(closure.links[0])
        names = [self.site(link, point, f"closure {k}.{i}") for i, link in enumerate(closure.links)]
        self._equality(kind, self.mujoco.mjtObj.mjOBJ_SITE, f"closure {k}", *names)

    def add_switched(self, part: Joint | Coupling) -> None:
        """Add a fixed or spherical joint, or a coupling, as an equality that is active from t = 0 on or
        later."""
        kinds = self.mujoco.mjtEq
        if isinstance(part, Coupling):
            equality = self.add_coupling(part)
        else:
            ends = enumerate(zip(part.bodies, part.anchor_pair, strict=True))
            names = [
                self.site(self.link_of(body), np.array(point), f"{SWITCHED}{part.name}.{i}")
                for i, (body, point) in ends
            ]
            kind = kinds.mjEQ_WELD if part.type == "fixed" else kinds.mjEQ_CONNECT
            equality = self._equality(kind, self.mujoco.mjtObj.mjOBJ_SITE, SWITCHED + part.name, *names)
        equality.active = holds(part, 0.0)

    def add_driver(self, driver: Driver) -> None:
        joint = self.joint[self.tree.coordinate(self.scene, driver.joint)]
        kind = self.mujoco.mjtEq.mjEQ_JOINT
        equality = self._equality(
            kind, self.mujoco.mjtObj.mjOBJ_JOINT, f"driver {driver.joint}", joint.name, ""
        )
        equality.data[:5] = 0.0

    def add_stop(self, joint: Joint) -> None:
        """Add the end stop of a joint as a limit, with the library's default softness."""
        if joint.end_stop:
            limited = self.joint[self.tree.coordinate(self.scene, joint.name)]
            ends = (joint.end_stop.lower, -FAR), (joint.end_stop.upper, FAR)
            limited.limited = self.mujoco.mjtLimited.mjLIMITED_TRUE
            limited.range = [far if end is None else end for end, far in ends]

    def add_coupling(self, coupling: Coupling) -> Any:
        """Add the equality of two joints, as MuJoCo's polynomial of degree 4."""
        first, second = (self.joint[i].name for i in self.tree.coupled(self.scene, coupling))
        kind, objects = self.mujoco.mjtEq.mjEQ_JOINT, self.mujoco.mjtObj.mjOBJ_JOINT
        equality = self._equality(kind, objects, COUPLING + coupling.name, second, first)
        law = coupling.polynomial or (coupling.gear_ratio,)
        equality.data[: POWERS + 1] = 0.0, *law, *[0.0] * (POWERS - len(law))
        return equality

    def _equality(self, kind: Any, objects: Any, name: str, first: str, second: str) -> Any:
        return self.spec.add_equality(type=kind, objtype=objects, name=name, name1=first, name2=second)

    def add_load(self, k: int, load: Any) -> None:
        if isinstance(load, Moment):
            wrench = np.concatenate([np.zeros(3), load.moment])
            self.applied.append((_name(self.link_of(load.body)), wrench, load.factor))
        elif isinstance(load, Force):
            self._force(k, load)
        elif isinstance(load, Spring):
            self._spring(k, load)
        elif isinstance(load, RotationalDamper | PointDamper):
            self._damper(k, load)
        else:
            self._along(load)

    def _damper(self, k: int, load: RotationalDamper | PointDamper) -> None:
        """Add damping to the tree's joint between the bodies, or actuators between sites."""
        turning = dampers.turning_joints(self.scene, self.tree, load)
        for i in turning:
            self.joint[i].damping[0] += load.damping
        if not turning:
            points = dampers.points_of(load, [self.centre(self.link_of(body)) for body in load.bodies])
            ends = [
                self.site(self.link_of(body), np.array(point), f"damper {k}.{i}")
                for i, (body, point) in enumerate(zip(load.bodies, points, strict=True))
            ]
            dampers.add_actuators(self.mujoco, self.spec, f"damper {k}", ends, load)

    def _along(self, load: JointLoad) -> None:
        """Add spring, damper and force along a joint coordinate."""
        joint, action = self.joint[self.tree.coordinate(self.scene, load.joint, load.coordinate)], load.action
        before, added = joint.stiffness[0], action.stiffness
        if added > 0:  # two springs act as one; natural value: mean weighted by stiffness
            moment = before * joint.springref + added * action.natural
            joint.stiffness[0], joint.springref = before + added, moment / (before + added)
        joint.damping[0] += action.damping
        if action.amount:
            self.pushed.append((joint.name, action.amount, load.over_time))

    def link_of(self, body: str) -> int:
        """Return the link of a scene's body, or of the ground, by name."""
        return GROUND_LINK if body == GROUND else self.tree.link_of(self.scene.body_index(body))

    def _force(self, k: int, load: Force) -> None:
        """Add a massless body fixed at the point of attack, because MuJoCo applies forces at centres of
        mass."""
        link = self.link_of(load.body)
        body = self.body[link].add_body(name=f"force {k}", pos=np.array(load.point) - self.centre(link))
        _inertial(body, 0.0, np.zeros(3), np.zeros(3), UNIT)
        self.applied.append((f"force {k}", np.concatenate([load.force, np.zeros(3)]), load.factor))

    def _spring(self, k: int, load: Spring) -> None:
        tendon = self.spec.add_tendon(name=f"spring {k}", springlength=[load.natural_length] * 2)
        tendon.stiffness[0], tendon.damping[0] = load.stiffness, load.damping
        for i, (body, point) in enumerate(zip(load.bodies, load.points, strict=True)):
            tendon.wrap_site(self.site(self.link_of(body), np.array(point), f"spring {k}.{i}"))


def _inertial(body: Any, mass: float, inertia: Any, position: Any, orientation: Any) -> None:
    body.explicitinertial = True
    body.mass, body.inertia, body.ipos, body.iquat = mass, inertia, position, orientation


def _write_masses(mujoco: Any, model: Any, tree: Tree) -> None:
    """Write the true masses, centres of mass and principal moments, and recompute the constants that depend
    on them."""
    for k, link in enumerate(tree.links):
        b = model.body(_name(k)).id
        moments, axes = np.linalg.eigh(link.inertia)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        model.body_mass[b], model.body_ipos[b] = link.mass, link.offset
        model.body_inertia[b], model.body_iquat[b] = moments, rotations.from_matrix(axes)
    mujoco.mj_setConst(model, mujoco.MjData(model))
