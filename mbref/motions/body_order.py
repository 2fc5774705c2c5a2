"""Trajectories with their bodies in the order of a scene."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from mbref.input_error import InputError
from mbref.motions.event import EVENT_STATES
from mbref.motions.trajectory import PER_BODY, Trajectory
from mbref.scene import Scene


def fields_in_order(scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    """Return the fields of a trajectory, with the bodies in the order of the scene.

    Raises InputError if the trajectory lacks a body.
    """
    found = {each.name: getattr(trajectory, each.name) for each in fields(Trajectory)}
    names = tuple(body.name for body in scene.body)
    if tuple(trajectory.bodies) == names:
        return found
    if lacking := [name for name in names if name not in trajectory.bodies]:
        raise InputError(f"the motion of {scene.name!r} has no body {lacking[0]!r}")
    order = [trajectory.bodies.index(name) for name in names]
    arrays = {key: found[key] if found[key] is None else found[key][:, order] for key in PER_BODY}
    events = trajectory.events and tuple(
        replace(event, **{key: getattr(event, key)[order] for key in EVENT_STATES})
        for event in trajectory.events
    )
    return {**found, **arrays, "bodies": names, "events": events}
