"""This project's own importers of MJCF, URDF and SDF, as one reader among the others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.loaders.loader import MJCF, SDF, URDF, Loaded, Loader
from crosscheck.engines.loaders.machine import (
    FIXED,
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
from crosscheck.engines.loaders.placing import Place
from crosscheck.engines.mujoco.importing.actuators import Actuators
from mbref import formats, rotations
from mbref.scene import GROUND, Scene, SlideSpring, TorsionSpring
from mbref.scene import Joint as AnyJoint

EVERYTHING = ("everything",)
MOVED = "the joints moved to close it"  # words of a note: the scene is not at the file's reference pose


class Own(Loader):
    """The importers of ``mbref import``; parts that no scene describes are left out, each with a sentence."""

    name = "mbref"
    package = "mbref"
    version = ""
    formats = (MJCF, URDF, SDF)

    def load(self, path: Path, form: str) -> Loaded:
        """Import the scene."""
        ending = {MJCF: ".xml", URDF: ".urdf", SDF: ".sdf"}[form]
        if path.suffix != ending:
            raise ValueError(f"the importers read this format from files that end in {ending}")
        found = formats.read(path, formats.ImportOptions(without=EVERYTHING))
        motors = _servos(path) if form == MJCF else {}
        return Imported(found.scene, (*found.left_out, *found.notes), motors)


class Imported(Loaded):
    """A scene at its start; ``motors`` are stiffness and damping that actuators give joints."""

    def __init__(self, scene: Scene, messages: tuple[str, ...], motors: Mapping[str, tuple[float, float]]):
        self.scene, self.messages, self.motors = scene, messages, motors

    def machine(self) -> Machine:
        tree, loops = self._tree()
        bodies, couplings = [self._body(k) for k in range(len(self.scene.body))], list(self._couplings())
        if any(MOVED in message for message in self.messages):
            bodies = [replace(body, centre=None, inertia=None) for body in bodies]
            tree = [replace(joint, anchor=None, axis=None) for joint in tree]
            loops = [replace(loop, anchors=None) for loop in loops]
            couplings = [replace(coupling, coefficients=()) for coupling in couplings]
        return Machine(
            bodies=tuple(bodies),
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
        turn = rotations.to_matrix(np.array(body.orientation, float))
        return Place(np.array(body.position, float), turn).body(
            body.name, body.mass or 0.0, [0, 0, 0], moments
        )

    def _tree(self) -> tuple[list[Joint], list[Loop]]:
        """Return the joints that connect new bodies, in the scene's order, and the others as loops."""
        root = {body.name: body.name for body in self.scene.body} | {GROUND: GROUND}
        tree, loops = list[Joint](), list[Loop]()
        threads = [c for c in self.scene.coupling if c.joints[0] == c.joints[1]]
        pitches = {c.joints[0]: 2 * math.pi * c.gear_ratio for c in threads}

        def end(name: str) -> str:
            return name if root[name] == name else end(root[name])

        for joint in self.scene.joint:
            first, second = joint.bodies
            pair = WORLD if first == GROUND else first, WORLD if second == GROUND else second
            anchors = joint.anchor_pair
            if end(first) == end(second):
                loops.append(Loop(joint.name, joint.type, pair, (vector(anchors[0]), vector(anchors[1]))))
                continue
            root[end(second)] = end(first)
            axes = [rotations.unit(np.array(axis, float)) for axis in joint.directions]
            tree.append(
                Joint(
                    joint.name,
                    "screw" if joint.name in pitches else joint.type,
                    pair,
                    vector(anchors[0]),
                    vector(axes[0]) if len(axes) == 1 else None,
                    pitch=pitches.get(joint.name),
                    **(self._numbers(joint) if joint.type != FIXED else {}),
                )
            )
        free = [body.name for body in self.scene.body if end(body.name) != end(GROUND)]
        bases = dict.fromkeys(map(end, free))
        return [*(Joint(f"{n} free", "free", (WORLD, n)) for n in bases), *tree], loops

    def _numbers(self, joint: AnyJoint) -> dict[str, Any]:
        """Return the numbers of a joint; a scene has neither limits nor dry friction."""
        springs = [
            load
            for load in self.scene.load
            if isinstance(load, TorsionSpring | SlideSpring)
            and load.joint == joint.name
            and not np.allclose((load.stiffness, load.damping), self.motors.get(joint.name, math.inf))
        ]
        stiffness = coefficients(sum(spring.stiffness for spring in springs))
        found: dict[str, Any] = {
            "damping": coefficients(sum(spring.damping for spring in springs)),
            "stiffness": stiffness,
            "armature": joint.reflected_inertia,
            "friction": 0.0,
            **limits(-math.inf, math.inf),
        }
        if stiffness and len(springs) == 1:
            found["rest"] = _rest(springs[0])
        return found

    def _couplings(self) -> Iterator[Coupling]:
        for coupling in self.scene.coupling:
            leader, follower = coupling.joints
            if leader != follower:  # the thread of a screw couples two coordinates of one joint
                law = coefficients(coupling.offset, coupling.gear_ratio)
                yield Coupling(coupling.name, follower, leader, law)

        for driver in self.scene.driver:
            yield Coupling(driver.joint, driver.joint, "", ())  # a joint that the file locks

    def statics(self, pose: Mapping[str, float], gravity: Vector) -> Statics:
        raise NotImplementedError  # a scene has no joint coordinates


def _servos(path: Path) -> dict[str, tuple[float, float]]:
    """Return the stiffness and damping of the actuators of each joint, which a scene has as springs."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    found: dict[str, tuple[float, float]] = {}
    for law in Actuators(mujoco, model, -1).laws:
        name = str(model.joint(law.joint).name)
        stiffness, damping = found.get(name, (0.0, 0.0))
        found[name] = stiffness + law.stiffness, damping + law.damping
    return found


def _rest(spring: TorsionSpring | SlideSpring) -> float:
    """Return the displacement from the pose of the scene at which a spring is at rest."""
    if isinstance(spring, TorsionSpring):
        return float(spring.natural_angle)
    return float(spring.natural_displacement)
