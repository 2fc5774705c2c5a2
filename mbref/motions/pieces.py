"""Pieces of a motion, between the events at which joints and couplings begin or cease to constrain.

The scene of a piece has the constraints that hold in it, and starts at the poses of its first moment.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mbref import rotations
from mbref.equations.gaps import gaps
from mbref.equations.model import Model, poses
from mbref.input_error import InputError
from mbref.motions.event import STATE_BEFORE, Event
from mbref.motions.joint_motion import along, joint_motion, positions_of, turned_since_start
from mbref.motions.restart import scene_at
from mbref.motions.trajectory import PER_BODY, Trajectory
from mbref.scene import Coupling, Driver, Joint, Scene, SceneError
from mbref.scene.structure import intermittent

POSE_MET = (
    1e-6  # gap (lengths of the mechanism, or rad) of a given pose that counts as met; the run leaves less
)
NEARLY_PARALLEL = 0.1  # sine of the angle of the axes of a universal joint, below which it cannot engage
ALWAYS: dict[str, Any] = {
    **dict.fromkeys(("active", "when", "release", "holds_at_start")),
    "engages": "anywhere",
}


def is_intermittent(scene: Scene) -> bool:
    """Return whether a joint or a coupling comes and goes, or a joint has an end stop."""
    return any(True for _ in intermittent(scene))


def event_times(scene: Scene, end: float) -> list[float]:
    """Return the times (s) after 0, up to an end, at which an interval of a constraint begins or ends."""
    every = (interval for each in (*scene.joint, *scene.coupling) for interval in each.active or ())
    return sorted({time for interval in every for time in interval if 0.0 < time <= end})


def first_piece(scene: Scene) -> Scene:
    """Return the scene with the constraints that hold at t = 0, without contacts."""
    return scene.with_(**_holding(scene, {each.name for each in constraint_parts(scene) if each.starts_held}))


def constraint_parts(scene: Scene) -> tuple[Joint | Coupling, ...]:
    """Return the joints and couplings of a scene."""
    return (*scene.joint, *scene.coupling)


def in_contact(piece: Scene, contacts: Sequence[str]) -> Scene:
    """Return a piece in which the joints of end stops, such as ``"A.upper"``, stay where they are."""
    held = [Driver(joint=name.rpartition(".")[0], polynomial=(0.0,)) for name in contacts]
    return piece.with_(driver=[*piece.driver, *held]) if held else piece


def _holding(scene: Scene, names: Collection[str]) -> dict[str, list[Any]]:
    """Return the joints and couplings with these names, as in the file, without intervals."""
    return {
        key: [_permanent(each) for each in getattr(scene, key) if each.name in names]
        for key in ("joint", "coupling")
    }


def _permanent(constraint: Any) -> Any:
    """Return a constraint without intervals and end stops."""
    stops = {"stop": None} if getattr(constraint, "end_stop", None) else {}
    return constraint.model_copy(update={**ALWAYS, **stops})


def changes(scene: Scene, piece: Scene, t: float) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the joints and couplings that begin, and that cease, to constrain by their
    intervals at t (s), after a piece."""
    if t == 0.0:  # constraints that hold from the start do not begin
        return (), ()
    held = {each.name for each in constraint_parts(piece)}
    begun, ceased = [], []
    for each in constraint_parts(scene):
        begins, ends = zip(*each.active, strict=True) if each.active else ((), ())
        if t in begins and not each.when and each.name not in held:
            begun.append(each.name)
        if t in ends and each.name in held:
            ceased.append(each.name)
    return tuple(begun), tuple(ceased)


def next_piece(
    scene: Scene, piece: Scene, state: Trajectory, engaged: Sequence[str], released: Sequence[str]
) -> tuple[Scene, Scene]:
    """Return two scenes that start at the time t of a state: with the constraints and velocities before t,
    and with the constraints from t on, of which some are ``engaged`` and others ``released`` then.

    ``piece`` is the scene of the piece before, and ``state`` has all turns since t = 0. Raises SceneError if
    a constraint cannot engage there.
    """
    t = float(state.times[0])
    frame, placed = scene_at(with_permanent(scene), state, t), scene_at(bare(piece), state, t)
    before = {joint.name: joint for joint in placed.joint}
    held = {each.name for each in constraint_parts(piece)} - {*released} | {*engaged}
    joints = [
        engaged_joint(scene, scene.joint_named(joint.name), state, t)
        if joint.name in engaged
        else before[joint.name]
        for joint in _holding(scene, held)["joint"]
    ]
    for coupling in scene.coupling:
        if coupling.name in engaged and coupling.engages == "given_pose":
            _refuse_coupling(scene, coupling, state, t)
    earlier, later = (
        [coupling_from(scene, each, state, {"offset": 0.0}) for each in _holding(scene, names)["coupling"]]
        for names in ({each.name for each in piece.coupling}, held)
    )
    return frame.with_(joint=placed.joint, coupling=earlier), frame.with_(joint=joints, coupling=later)


def with_permanent(scene: Scene) -> Scene:
    """Return the scene with the joints that always hold only, on which drivers and loads act."""
    held = [_permanent(joint) for joint in scene.joint if joint.is_permanent]
    return scene.with_(joint=held, coupling=())


def bare(scene: Scene) -> Scene:
    """Return the scene without loads and drivers."""
    return scene.with_(load=(), driver=())


def engaged_joint(scene: Scene, joint: Joint, state: Trajectory, t: float) -> Joint:
    """Return a joint of the scene that begins to hold at the poses of t (s): its anchor and its axis are
    those that the first body carries, in the file."""
    if joint.engages == "given_pose":
        _refuse_gap(scene, joint, state, t)
    ends = [
        tuple(positions_of(scene, state, body, [point])[0, 0].tolist())
        for body, point in zip(joint.bodies, joint.anchor_pair, strict=True)
    ]
    turned = [turned_since_start(scene, state, body) for body in joint.bodies]
    axes = [
        rotations.rotate(q, np.array([axis]))[0] for q, axis in zip(turned, joint.directions, strict=False)
    ]
    if len(axes) > 1:
        axes[1] = _across(joint, axes[0], axes[1], t)
    given = [tuple(axis.tolist()) for axis in axes]
    every: dict[str, Any] = {"anchor": ends[0], "anchors": ends, "axis": given and given[0], "axes": given}
    moved = {key: value for key, value in every.items() if key in type(joint).model_fields}
    try:
        return type(joint)(**{**joint.model_dump(exclude={"type"}), **moved, **ALWAYS})
    except SceneError as fault:
        raise cannot_hold(joint.name, t, fault.faults[0]) from None


def _across(joint: Joint, first: np.ndarray, second: np.ndarray, t: float) -> np.ndarray:
    """Return the part (3,) of the second axis of a universal joint that is perpendicular to its first axis;
    raises SceneError if the axes are nearly parallel."""
    unit = rotations.unit(first)
    part = second - (second @ unit) * unit
    if np.linalg.norm(part) < NEARLY_PARALLEL * np.linalg.norm(second):
        raise cannot_hold(joint.name, t, "its axes are nearly parallel")
    return np.asarray(part)


def _refuse_gap(scene: Scene, joint: Joint, state: Trajectory, t: float) -> None:
    """Raise SceneError if the poses of t (s) do not obey a joint as the file gives it."""
    alone = joint.model_copy(update=ALWAYS)
    bodies = [body.model_copy(update={"mass": 1.0, "inertia": (1.0, 1.0, 1.0)}) for body in scene.body]
    model = Model(scene.with_(body=bodies, joint=[alone], coupling=(), driver=(), load=()))
    q = poses(model, state.position, state.orientation)
    terms = model.terms(np.array([t]), q)
    worst = int(gaps(terms, np.array([model.length]))[0].argmax())
    gap, size = float(gaps(terms, np.array([model.length]))[0, worst]), abs(float(terms.phi[0, worst]))
    model.release()
    if gap > POSE_MET:
        raise cannot_hold(joint.name, t, f"the given pose is missed by {size:.3g} m or rad")


def _refuse_coupling(scene: Scene, coupling: Coupling, state: Trajectory, t: float) -> None:
    """Raise SceneError if the coordinates of t (s) do not obey a coupling with its offset."""
    if (gap := abs(coupling_sum(scene, coupling, state) - coupling.offset)) > POSE_MET:
        raise cannot_hold(
            coupling.name, t, f"the sum of its coordinates misses the offset by {gap:.3g} m or rad"
        )


def coupling_sum(scene: Scene, coupling: Coupling, state: Trajectory) -> float:
    """Return the sum of the polynomials of a coupling's coordinates, m or rad, at a state."""
    ends = zip(scene.coupled(coupling), coupling.laws, strict=True)
    terms = (
        np.polynomial.Polynomial([0.0, *law])(along(joint_motion(scene, state, joint.name), kind)[0][0])
        for (joint, kind), law in ends
    )
    return float(sum(terms))


def coupling_from(scene: Scene, coupling: Coupling, state: Trajectory, fields: Mapping[str, Any]) -> Coupling:
    """Return a coupling whose coordinates count from a state, with changed fields."""
    joint, kind = scene.coupled(coupling)[0]
    moved = along(joint_motion(scene, state, joint.name), kind)[0][0] if coupling.powers > 1 else 0.0
    return coupling.from_pose(float(moved)).model_copy(update=fields)


def cannot_hold(name: str, t: float, why: str) -> SceneError:
    """Return the error of a constraint that cannot begin to hold at t (s), with the reason."""
    return SceneError([f"{name}: cannot begin to hold at t = {t:.6g} s: {why}"])


def parts_of(scene: Scene, motion: Trajectory) -> Iterator[tuple[Scene, Trajectory]]:
    """Yield the scene of each piece of a motion, without loads, and the samples in it, from its begin.

    Raises InputError for a motion without events, whose constraints are not known.
    """
    if motion.events is None:
        raise InputError(
            f"the motion of {scene.name!r} by {motion.engine} has no events (joints with intervals)"
        )
    held = {
        key: [each.model_copy(update={"engages": "anywhere"}) for each in getattr(scene, key)]
        for key in ("joint", "coupling")
    }
    bare = scene.with_(load=(), **held)
    piece, begin, turned, contacts = first_piece(bare), 0.0, dict[str, float](), tuple[str, ...]()
    for event in (*motion.events, None):
        end = np.inf if event is None else event.time
        chosen = (motion.times >= begin) & (motion.times < end)
        yield in_contact(piece, contacts), samples_of(motion, chosen, begin, turned)
        if event is not None:
            _, piece = next_piece(bare, piece, state_at(motion, event), event.engaged, event.released)
            begin, turned, contacts = event.time, dict(event.angles), event.contacts


def samples_of(
    motion: Trajectory, chosen: np.ndarray, begin: float, turned: Mapping[str, float]
) -> Trajectory:
    """Return the chosen (k,) samples, with times (s) and angles (rad) from the begin of a piece."""

    def part(values: Any) -> Any:
        return None if values is None else values[chosen]

    def parts(values: Mapping[str, Any] | None) -> Any:
        return None if values is None else {name: part(each) for name, each in values.items()}

    angles = {name: part(each) - turned.get(name, 0.0) for name, each in (motion.angles or {}).items()}
    return replace(
        motion,
        times=motion.times[chosen] - begin,
        **{key: part(getattr(motion, key)) for key in PER_BODY},
        reactions=parts(motion.reactions),
        open_reactions=parts(motion.open_reactions),
        angles=angles,
        events=None,
    )


def state_at(motion: Trajectory, event: Event) -> Trajectory:
    """Return the state before an event as a trajectory of one sample."""
    none: dict[str, Any] = dict.fromkeys(
        ("acceleration", "angular_acceleration", "reactions", "open_reactions", "events")
    )
    return replace(
        motion,
        times=np.array([event.time]),
        **{key: getattr(event, key)[None] for key in STATE_BEFORE},
        **none,
        angles={name: np.array([angle]) for name, angle in event.angles.items()},
    )
