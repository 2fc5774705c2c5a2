"""End stops by the judge: gaps of coordinates, impacts with restitution, contacts that last.

A gap is sign · (limit - q) of a joint's coordinate q since t = 0. Where it closes, its rate becomes
-e times the rate before. A coordinate in contact is a driver that stands still.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.judge.constraints import jacobian, joint_rates, scene_length
from crosscheck.judge.impacts import Impact, impact, pushing
from crosscheck.judge.joint_coordinates import COORDINATES, coordinate_accelerations, coordinate_jacobian
from crosscheck.judge.joint_residuals import grounded, joint_frames, with_ground
from crosscheck.judge.pieces import State
from crosscheck.judge.tolerances import RANK
from mbref.scene import Driver, Scene

TOUCHING = 1e-11  # gap (lengths of the mechanism, or rad) of a coordinate at its end
STILL = 1e-12  # rate of a gap / largest velocity, which rounding may leave
LOCKED = 1e-8  # part of a coordinate's unit row that other rows do not span, below which they lock it
CHATTER = 1e-6  # flight between two impacts / end time, below which a coordinate stays at its end


class End(NamedTuple):
    """An end of a joint's range, such as ``A.upper``; ``column`` is 0 for an angle, 1 for a displacement."""

    name: str
    joint: str
    column: int
    limit: float
    sign: float
    restitution: float


def ends_of(scene: Scene) -> list[End]:
    """Return the ends of all ranges of a scene."""
    found = []
    for joint in scene.joint:
        stop, driven = joint.end_stop, joint.facts.driven
        for name, sign in (("lower", -1.0), ("upper", 1.0)):
            if stop and driven and (limit := getattr(stop, name)) is not None:
                column = COORDINATES.index(driven)
                found.append(End(f"{joint.name}.{name}", joint.name, column, limit, sign, stop.restitution))
    return found


def held(piece: Scene, names: Collection[str]) -> Scene:
    """Return a piece whose joints with these ends stay where they are."""
    return _driven(piece, {name.rpartition(".")[0]: 0.0 for name in names})


def _driven(piece: Scene, rates: Mapping[str, float]) -> Scene:
    """Return a piece with drivers that prescribe rates (rad/s or m/s) of joints."""
    drivers = [Driver(joint=joint, polynomial=(0.0, rate)) for joint, rate in rates.items()]
    return piece.with_(driver=[*piece.driver, *drivers]) if drivers else piece


def rates_of(piece: Scene, ends: Sequence[End], state: State) -> np.ndarray:
    """Return the rates (e,) of gaps in a state."""
    found = joint_rates(piece, *state)
    return np.array([-end.sign * found[end.joint][end.column] for end in ends])


def second_rates(
    piece: Scene, ends: Sequence[End], state: State, acceleration: np.ndarray, spin_rate: np.ndarray
) -> np.ndarray:
    """Return the second derivatives (e,) of gaps from accelerations (nb, 3) of the bodies."""
    joints = {joint.name: joint for joint in joint_frames(piece)}
    pose = with_ground(state.position, state.orientation)
    rates = map(grounded, (state.velocity, state.angular_velocity, acceleration, spin_rate))
    motion = (*pose, *rates)
    return np.array(
        [-end.sign * coordinate_accelerations(joints[end.joint], *motion)[end.column] for end in ends]
    )


def bounced(after: Scene, before: State, touching: Sequence[End], wanted: Mapping[End, float]) -> Impact:
    """Return the impact of least change after which gaps have at least the wanted rates, other gaps zero."""
    if not touching:
        return impact(after, before)
    least = np.array([wanted.get(end, 0.0) for end in touching])
    pose = before.position, before.orientation
    gaps = [-end.sign * coordinate_jacobian(after, end.joint, *pose)[end.column] for end in touching]
    chosen = np.flatnonzero(pushing(after, before, np.array(gaps), least))
    return impact(_driven(after, {touching[k].joint: -touching[k].sign * least[k] for k in chosen}), before)


def is_locked(piece: Scene, joint: str, state: State, column: int) -> bool:
    """Return whether rows of joints and couplings of a piece lock a joint's angle (column 0) or displacement
    (1) in a state; drivers may move it."""
    rows, _ = jacobian(piece.with_(driver=[]), 0.0, state.position, state.orientation)
    own = coordinate_jacobian(piece, joint, state.position, state.orientation)[column]
    units = np.tile(np.repeat([1.0, 1 / scene_length(piece)], 3), len(piece.body))
    rows, own = rows * units, own * units / np.linalg.norm(own * units)
    rows = rows / np.linalg.norm(rows, axis=1)[:, None]
    left = own - rows.T @ np.linalg.lstsq(rows.T, own, rcond=RANK)[0]
    return bool(np.linalg.norm(left) < LOCKED)


def hits(piece: Scene, touching: Sequence[End], before: State, contacts: Collection[str]) -> dict[End, float]:
    """Return the ends that are met, with the rates of their gaps after the impact."""
    rates, least = rates_of(piece, touching, before), still(piece, before)
    return {
        end: -end.restitution * rate
        for end, rate in zip(touching, rates, strict=True)
        if rate < -least and end.name not in contacts
    }


def still(scene: Scene, state: State) -> float:
    """Return the rate of a gap (m/s or rad/s) that is rounding."""
    largest = max(float(np.abs(state.velocity).max()), float(np.abs(state.angular_velocity).max()))
    return STILL * max(largest, 1e-300)


def width(scene: Scene, end: End) -> float:
    """Return the gap (m or rad) below which a coordinate touches its end."""
    return TOUCHING * (scene_length(scene) if end.column else 1.0)
