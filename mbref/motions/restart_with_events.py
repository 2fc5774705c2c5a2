"""Scenes that start at a sample of a motion with events: later intervals, conditions, and what is latched or
released there."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from mbref.input_error import InputError
from mbref.motions.joint_motion import along, joint_motion, position_of
from mbref.motions.pieces import (
    ALWAYS,
    bare,
    constraint_parts,
    coupling_from,
    coupling_sum,
    engaged_joint,
    is_intermittent,
    parts_of,
    samples_of,
    with_permanent,
)
from mbref.motions.restart import sample_at, scene_at
from mbref.motions.trajectory import Trajectory
from mbref.motions.watched import watched
from mbref.scene import Coupling, Joint, Scene
from mbref.scene.conditions import When


def restarted(scene: Scene, motion: Trajectory, t: float) -> Scene:
    """Return ``scene_at``, also for constraints with intervals, which then count from t (s).

    Raises InputError for a joint that engages later, and needs the poses of the first scene: it has to meet
    a given pose, or has axes on both bodies.
    """
    if not is_intermittent(scene):
        return scene_at(scene, motion, t)
    k = sample_at(motion, t)
    frame, at = scene_at(with_permanent(scene), motion, t), float(motion.times[k])
    pieces = [(piece, part.times) for piece, part in parts_of(scene, motion)]
    piece = pieces[sum(event.time <= at for event in motion.events or ())][0]
    placed = {joint.name: joint for joint in scene_at(bare(piece), motion, t).joint}
    state = samples_of(motion, np.arange(len(motion.times)) == k, 0.0, {})
    joints, couplings = [], []
    held = {each.name for each in constraint_parts(piece)}
    for joint in scene.joint:
        later = _from_time(scene, joint, state, at, held)
        if joint.end_stop and joint.facts.driven:
            moved = along(joint_motion(scene, state, joint.name), joint.facts.driven)[0][0]
            later["stop"] = joint.end_stop.from_place(float(moved))
        if joint.name in held:
            joints.append(placed[joint.name].model_copy(update=later))
        elif _may_hold(later):
            if joint.engages == "given_pose" or len(joint.directions) > 1:
                raise InputError(
                    f"scene_at: joint {joint.name!r} engages later by geometry of the first scene"
                )
            joints.append(engaged_joint(scene, joint, state, at).model_copy(update=later))
    for coupling in scene.coupling:
        later = _from_time(scene, coupling, state, at, held)
        holds = coupling.name in held
        offset = 0.0 if holds else coupling.offset - coupling_sum(scene, coupling, state)
        if holds or _may_hold(later):
            couplings.append(coupling_from(scene, coupling, state, {**later, "offset": offset}))
    return frame.with_(joint=joints, coupling=couplings)


def _from_time(
    scene: Scene, constraint: Joint | Coupling, state: Trajectory, t: float, held: Collection[str]
) -> dict[str, Any]:
    """Return the intervals of a constraint that end after t (s), as times since t, its conditions from the
    state at t, and whether it holds there, as one of the names ``held``."""
    if constraint.is_permanent:
        return {**ALWAYS, "engages": constraint.engages}
    active, release, holds = constraint.active, constraint.release, constraint.name in held
    if active is not None:
        active = tuple((max(begin - t, 0.0), end - t) for begin, end in active if end > t)
    if release and release.joint and not _lasts(scene, release.joint, t, held):
        release = None
    by_default = not constraint.when and (active is None or (bool(active) and active[0][0] == 0.0))
    return {
        "active": active,
        "when": constraint.when and _watched_from(scene, constraint.when, state),
        "release": release,
        "holds_at_start": None if holds == by_default else holds,
        "engages": constraint.engages if active or constraint.when else "anywhere",
    }


def _may_hold(later: Mapping[str, Any]) -> bool:
    """Return whether a constraint with these fields, which does not hold, can begin to hold."""
    return bool(later["active"]) or (later["active"] is None and later["when"] is not None)


def _lasts(scene: Scene, name: str, t: float, held: Collection[str]) -> bool:
    """Return whether a joint holds at t (s), as one of the names ``held``, or can hold later."""
    joint = scene.joint_named(name)
    later = any(end > t for _, end in joint.active or ()) or (joint.active is None and bool(joint.when))
    return name in held or later


def _watched_from(scene: Scene, when: When, state: Trajectory) -> When:
    """Return a condition with a coordinate that counts from a state, or points of this state."""
    if when.joint is not None:
        moved = watched(scene, when, state)[0][0]
        return when.model_copy(update={"reaches": when.reaches - float(moved)})
    ends = zip(when.bodies or (), when.points or (), strict=True)
    points = [tuple(position_of(scene, state, *end)[0].tolist()) for end in ends]
    return when.model_copy(update={"points": tuple(points)})
