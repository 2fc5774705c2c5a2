"""This project's own importers of MJCF, URDF and SDF, as one reader among the others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.constrained import along
from crosscheck.engines.loaders.loader import MJCF, SDF, URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import (
    FIXED,
    REVOLUTE,
    SCALAR,
    TRANSLATIONAL,
    WORLD,
    Body,
    Coupling,
    Joint,
    Loop,
    Machine,
    Statics,
    Vector,
    coefficients,
    limits,
    vector,
)
from crosscheck.engines.loaders.placing import ORIGIN, Place, vector_of
from crosscheck.engines.loaders.posed import Pose, Posed, in_single_axes
from crosscheck.engines.mujoco.importing.reading import source
from crosscheck.judge.small_motions.posed import posed as restarted
from mbref import formats, rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import GROUND, RotationalDamper, Scene, SlideSpring, TorsionSpring
from mbref.scene import Joint as AnyJoint

EVERYTHING = ("everything",)
COORDINATES = {REVOLUTE: "angle", TRANSLATIONAL: "displacement"}
MOVED = "the joints moved to close it"  # words of a note: the scene is not at the file's reference pose


class Own(Loader):
    """The importers of ``mbref import``; parts that no scene describes are left out, each with a sentence, as
    are the forces of actuators and tendons of MJCF, which are not compared."""

    name = "mbref"
    package = "mbref"
    version = ""
    formats = (MJCF, URDF, SDF)

    def load(self, path: Path, form: str) -> Loaded:
        """Import the scene."""
        ending = {MJCF: ".xml", URDF: ".urdf", SDF: ".sdf"}[form]
        if path.suffix != ending:
            raise ValueError(f"the importers read this format from files that end in {ending}")
        options, rotors = formats.ImportOptions(without=EVERYTHING), dict[str, float]()
        if form == MJCF:
            own = source(path, options, is_passive=True)
            found, groups = own.imported, own.groups
            rotors = {groups.names[g]: armature for g, armature in groups.rotors.items()}
        else:
            found = formats.read(path, options)
        return Imported(found.scene, (*found.left_out, *found.notes), rotors)


class Imported(Loaded):
    """A scene at its start; ``rotors`` are armatures of ball joints, by the body whose inertia has them."""

    def __init__(self, scene: Scene, messages: tuple[str, ...], rotors: Mapping[str, float]):
        self.scene, self.messages, self.rotors = scene, messages, rotors

    def machine(self) -> Machine:
        tree, loops = self._tree()
        bodies, couplings = [self._body(k) for k in range(len(self.scene.body))], list(self._couplings())
        if any(MOVED in message for message in self.messages):
            bodies = [replace(body, centre=None, inertia=None) for body in bodies]
            tree = [replace(joint, anchor=None, axis=None, rest=None) for joint in tree]
            loops = [replace(loop, anchors=None) for loop in loops]
            couplings = [replace(coupling, coefficients=()) for coupling in couplings]
        return Machine(
            bodies=(*bodies, *(Body(f"{name} link", 0.0) for name in self._rods())),
            joints=tuple(tree),
            loops=tuple(loops),
            couplings=tuple(couplings),
            gravity=vector(self.scene.gravity),
            messages=self.messages,
        )

    def _body(self, k: int) -> Body:
        body = self.scene.body[k]
        inertia = np.asarray(body.inertia if body.inertia is not None else np.zeros(3), float)
        moments = np.diag(inertia) if inertia.ndim == 1 else inertia
        own = moments - self.rotors.get(body.name, 0.0) * np.eye(3)
        return self._place(k).body(body.name, body.mass or 0.0, [0, 0, 0], own)

    def _tree(self) -> tuple[list[Joint], list[Loop]]:
        """Return the joints that connect new bodies, in the scene's order, and the others as loops."""
        root = {body.name: body.name for body in self.scene.body} | {GROUND: GROUND}
        tree, loops, rods = list[Joint](), list[Loop](), self._rods()
        threads = [c for c in self.scene.coupling if len(set(c.joints)) == 1]
        pitches = {c.joints[0]: 2 * math.pi * c.gear_ratio for c in threads}

        def end(name: str) -> str:
            return name if root[name] == name else end(root[name])

        for joint in self.scene.joint:
            if joint.name in rods.values():
                continue
            first, second = joint.bodies
            pair = WORLD if first == GROUND else first, WORLD if second == GROUND else second
            anchors = joint.anchor_pair
            if end(first) == end(second):
                ends = vector(anchors[0]), vector(anchors[1])
                loops.append(Loop(joint.name, joint.type, pair, ends, _axis(joint)))
                continue
            root[end(second)] = end(first)
            if joint.name in rods:
                tree += self._two_hinges(joint, self.scene.joint_named(rods[joint.name]), pair)
                continue

            if joint.type == "cylindrical" and joint.name not in pitches:
                tree += self._slide_and_hinge(joint, pair)
                continue

            tree.append(
                Joint(
                    joint.name,
                    "screw" if joint.name in pitches else joint.type,
                    pair,
                    vector(anchors[0]),
                    _axis(joint),
                    pitch=pitches.get(joint.name),
                    **(self._numbers(joint, self._springs(joint)) if joint.type != FIXED else {}),
                )
            )
        free = [body.name for body in self.scene.body if end(body.name) != end(GROUND)]
        bases = dict.fromkeys(map(end, free))
        damped = {n: coefficients(sum(x.damping for x in self._dampers((GROUND, n)))) for n in bases}
        return [*(Joint(f"{n} free", "free", (WORLD, n), damping=damped[n]) for n in bases), *tree], loops

    def _rods(self) -> dict[str, str]:
        """Return planar joints with the distance joint of the same bodies: two parallel hinges of a massless
        link, as the importer writes them."""
        names = {joint.name: joint for joint in self.scene.joint}
        pairs = [(j, names.get(f"{j.name} distance")) for j in self.scene.joint if j.type == "planar"]
        return {j.name: d.name for j, d in pairs if d is not None and d.bodies == j.bodies}

    def _two_hinges(self, joint: AnyJoint, rod: AnyJoint, pair: tuple[str, str]) -> list[Joint]:
        link, axis = f"{joint.name} link", _axis(joint)
        springs = self._springs(joint), self._springs(rod)
        first, second = (vector(anchor) for anchor in (rod.anchor_pair[0], joint.anchor_pair[1]))
        return [
            Joint(joint.name, REVOLUTE, (pair[0], link), first, axis, **self._numbers(joint, springs[0])),
            Joint(rod.name, REVOLUTE, (link, pair[1]), second, axis, **self._numbers(rod, springs[1])),
        ]

    def _slide_and_hinge(self, joint: AnyJoint, pair: tuple[str, str]) -> list[Joint]:
        """Return a cylindrical joint as two joints of the same bodies, each with its springs."""
        anchor, axis, springs = vector(joint.anchor_pair[0]), _axis(joint), self._springs(joint)
        slide = [spring for spring in springs if isinstance(spring, SlideSpring)]
        turn = [spring for spring in springs if isinstance(spring, TorsionSpring)]
        numbers = {
            TRANSLATIONAL: self._numbers(joint, slide) | {"armature": 0.0},
            REVOLUTE: self._numbers(joint, turn),
        }
        return [Joint(_single(joint, kind), kind, pair, anchor, axis, **numbers[kind]) for kind in numbers]

    def _springs(self, joint: AnyJoint) -> list[TorsionSpring | SlideSpring]:
        """Return the springs and dampers of a joint."""
        kinds = TorsionSpring | SlideSpring
        return [load for load in self.scene.load if isinstance(load, kinds) and load.joint == joint.name]

    def _dampers(self, bodies: tuple[str, str]) -> list[RotationalDamper]:
        """Return the dampers of all rotation between two bodies."""
        found = (load for load in self.scene.load if isinstance(load, RotationalDamper))
        return [load for load in found if load.bodies == bodies]

    def _numbers(self, joint: AnyJoint, springs: Sequence[TorsionSpring | SlideSpring]) -> dict[str, Any]:
        """Return the numbers of a joint with springs; a scene has neither limits nor dry friction."""
        stiffness = coefficients(sum(spring.stiffness for spring in springs))
        dampers = self._dampers(joint.bodies) if joint.type == "spherical" else []
        found: dict[str, Any] = {
            "damping": coefficients(sum(each.damping for each in (*springs, *dampers))),
            "stiffness": stiffness,
            "armature": self._armature(joint),
            "friction": 0.0,
            **limits(-math.inf, math.inf),
        }
        if stiffness and len(springs) == 1:
            found["rest"] = _rest(springs[0])
        return found

    def _armature(self, joint: AnyJoint) -> float:
        is_ball = joint.type == "spherical" and joint.bodies[0] == GROUND
        return self.rotors.get(joint.bodies[1], 0.0) if is_ball else joint.reflected_inertia

    def _couplings(self) -> Iterator[Coupling]:
        for coupling in self.scene.coupling:
            *more, leader, follower = coupling.joints
            *factors, of_leader, of_follower = coupling.factors
            if leader != follower:  # the thread of a screw couples two coordinates of one joint
                law = coefficients(coupling.offset, *(coupling.polynomial or [-of_leader / of_follower]))
                others = zip(more, (-factor / of_follower for factor in factors), strict=True)
                yield Coupling(coupling.name, follower, leader, law, tuple(others))

        for driver in self.scene.driver:
            yield Coupling(driver.joint, driver.joint, "", ())  # a joint that the file locks

    def statics(self, pose: Pose, gravity: Vector) -> Statics:
        raise NotImplementedError  # a scene has no joint coordinates

    def accelerations(self, pose: Pose, rates: Pose, gravity: Vector) -> dict[str, float]:
        """Return accelerations of joints from mbref's accelerations of bodies at the start of a run."""
        at, machine = self._run(pose, rates, gravity, np.zeros(1)), in_single_axes(self.machine())
        posed = Posed(machine, pose)
        if at.acceleration is None or at.angular_acceleration is None or not len(at.times):
            raise ValueError(at.message)
        v = np.array([rates.get(name, 0.0) for name in posed.joints])
        drift = along(lambda q: self._columns(Posed(machine, q)) @ v, pose, rates)
        theirs = np.hstack([at.acceleration[0], at.angular_acceleration[0]]).ravel()
        found = np.linalg.lstsq(self._columns(posed), theirs - drift, rcond=None)[0]
        return dict(zip(posed.joints, found.tolist(), strict=True))

    def motion(
        self, pose: Pose, rates: Pose, gravity: Vector, duration: float, step: float
    ) -> dict[str, float]:
        """Simulate by the default method; the step is mbref's own."""
        run = self._run(pose, rates, gravity, np.array([0.0, duration]))
        if run.outcome is not Outcome.COMPLETED:
            raise ValueError(run.message)
        ends = {body.name: k for k, body in enumerate(self.scene.body)}
        turns = {name: rotations.to_matrix(run.orientation[-1, k]) for name, k in ends.items()}
        now = {n: Place(run.position[-1, k], turns[n]) for n, k in ends.items()} | {WORLD: ORIGIN}
        start = {n: self._place(k) for n, k in ends.items()} | {WORLD: ORIGIN}
        moved = {name: now[name].then(start[name].inverse()) for name in now}
        return {j.name: _displacement(j, moved) for j in self.machine().joints if j.type in SCALAR}

    def _columns(self, posed: Posed) -> np.ndarray:
        """Return the columns (6 nb, n) of the bodies' centres of mass."""
        places = [(body.name, posed.places[body.name].point(body.position)) for body in self.scene.body]
        return np.vstack([posed.columns(name, np.array(point)) for name, point in places])

    def _run(self, pose: Pose, rates: Pose, gravity: Vector, times: np.ndarray) -> Trajectory:
        """Return the run of the scene from a pose and rates."""
        if any(MOVED in message for message in self.messages):
            raise NotImplementedError("the import moved the joints to close the loops")
        if self._rods():
            raise NotImplementedError("the scene has no body for a link without mass")
        posed, scene = Posed(self.machine(), pose), self.scene
        v = np.array([rates.get(name, 0.0) for name in posed.joints])
        places = [posed.places[body.name].then(self._place(k)) for k, body in enumerate(scene.body)]
        values = {
            (coordinate, joint.name): pose.get(_single(joint, kind), 0.0)
            for joint in scene.joint
            for kind, coordinate in COORDINATES.items()
            if joint.type in (kind, "cylindrical")
        }
        positions = np.array([place.position for place in places])
        turns = np.array([rotations.from_matrix(place.turn) for place in places])
        twists = (self._columns(posed) @ v).reshape(-1, 6)
        # the start obeys the couplings, whose coordinates count from it
        led = [scene.coupled(coupling)[0] for coupling in scene.coupling]
        obeyed = [
            coupling.from_pose(values.get((kind, joint.name), 0.0)).model_copy(update={"offset": 0.0})
            for coupling, (joint, kind) in zip(scene.coupling, led, strict=True)
        ]
        scene = scene.with_(gravity=tuple(gravity), coupling=obeyed)
        begun = restarted(scene, positions, turns, twists, values)
        from crosscheck.engines.mbref import ENGINE

        return ENGINE.run(begun, times, ENGINE.best_settings(begun)[-1])

    def _place(self, k: int) -> Place:
        """Return the place of a body at the reference pose."""
        body = self.scene.body[k]
        turn = rotations.to_matrix(np.array(body.orientation, float))
        return Place(np.array(body.position, float), turn)


def _axis(joint: AnyJoint) -> Vector | None:
    """Return the direction of a joint with one axis."""
    axes = joint.directions
    return vector(rotations.unit(np.array(axes[0], float))) if len(axes) == 1 else None


def _single(joint: AnyJoint, kind: str) -> str:
    """Return the name of a joint of one coordinate, which is the scene's joint or a part of it."""
    return joint.name if joint.type == kind else f"{joint.name} {kind}"


def _displacement(joint: Joint, moved: Mapping[str, Place]) -> float:
    """Return the coordinate of a hinge (less than half a turn) or slide from displacements of bodies."""
    assert joint.axis is not None
    first, second = (moved[body] for body in joint.bodies)
    relative = first.inverse().then(second)
    moving = vector_of(relative.turn) if joint.type == REVOLUTE else relative.position
    return float(moving @ np.array(joint.axis))


def _rest(spring: TorsionSpring | SlideSpring) -> float:
    """Return the displacement from the pose of the scene at which a spring is at rest."""
    if isinstance(spring, TorsionSpring):
        return float(spring.natural_angle)
    return float(spring.natural_displacement)
