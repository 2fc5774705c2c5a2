"""Ball joints with driven orientations as chains of three driven hinges, which both formulations know.

The hinges meet at the ball's centre, with two links without mass between them. The link after a turn has the
orientation R₁ … Rₖ relative to the first body, so the last hinge turns the second body as the driver
prescribes. All links begin at the centre of the ball, in the world's axes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from mbref.scene import Body, Driver, Revolute, Scene, Turn

Motion = TypeVar("Motion", bound=Any)
LINK = "link {} of {}"  # name of a link, and of the hinge before it


def with_hinges(scene: Scene) -> Scene:
    """Return the scene with three hinges and two links for each driven ball joint; links are its last
    bodies."""
    driven = {driver.joint: driver for driver in scene.driver if driver.turn}
    if not driven:
        return scene
    bodies, joints, drivers = list(scene.body), [], [d for d in scene.driver if not d.turn]
    mass = (0.0, (0.0, 0.0, 0.0)) if scene.has_mass() else (None, None)
    for joint in scene.joint:
        if joint.name not in driven:
            joints.append(joint)
            continue
        anchor, turns = joint.anchor_pair[0], driven[joint.name].turns
        names = [LINK.format(k + 1, joint.name) for k in range(len(turns))]
        chain = [joint.bodies[0], *names[:-1], joint.bodies[1]]
        bodies += [Body(name=name, position=anchor, mass=mass[0], inertia=mass[1]) for name in names[:-1]]
        for k, (name, turn) in enumerate(zip(names, turns, strict=True)):
            pair = chain[k], chain[k + 1]
            joints.append(Revolute(name=name, bodies=pair, anchor=anchor, axis=turn.axis))
            drivers.append(_angle(name, turn))
    return scene.with_(body=bodies, joint=joints, driver=drivers)


def of_bodies(motion: Motion, count: int, fields: tuple[str, ...]) -> Motion:
    """Return a motion with the first bodies only, ``count`` of them, in arrays (k, nb, …) of some fields."""
    arrays: dict[str, np.ndarray] = {field: getattr(motion, field)[:, :count] for field in fields}
    return replace(motion, **arrays)


def _angle(joint: str, turn: Turn) -> Driver:
    """Return the driver of a hinge by the angle of a turn."""
    fields = {name: getattr(turn, name) for name in Turn.model_fields if name != "axis"}
    return Driver(joint=joint, **fields)
