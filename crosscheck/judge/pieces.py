"""Pieces of a motion between the events at which joints and couplings begin or cease to hold, by the judge.

A piece is a scene of its own, whose time counts from its begin.  A joint begins to hold at the anchor and the
axis that its first body carries; the second body then carries the anchor.  A distance joint keeps the
distance, and a coupling the sum, of the moment at which it begins to hold.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from crosscheck.judge.constraints import closure, length_rows, scene_length
from crosscheck.judge.coupling_laws import from_coordinate
from mbref import rotations
from mbref.scene import GROUND, Body, Coupling, Joint, JointLoad, Scene, SceneError
from mbref.scene.joints import ANGLE

MISSED = 1e-6  # gap of a given pose (lengths of the mechanism, or rad) above which a joint cannot engage
AT_REST = 1e-12  # velocity after an impact / speed of the scene, below which bodies have come to rest
PERMANENT: dict[str, Any] = {
    "active": None,
    "when": None,
    "release": None,
    "holds_at_start": None,
    "engages": "anywhere",
}


class State(NamedTuple):
    """Positions (nb, 3), orientations (nb, 4), velocities and angular velocities (nb, 3), world axes."""

    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray


def without_rounding(scene: Scene, after: State, before: State) -> State:
    """Return the state after an impact, at rest if its velocities are rounding: of the velocities before it,
    or of the speeds of falling and of crossing the scene's length in its duration."""
    length = scene_length(scene)
    speeds = [
        np.sqrt(length * np.linalg.norm(scene.gravity)),
        length / scene.duration,
        _fastest(before, length),
    ]
    if _fastest(after, length) > AT_REST * max(speeds):
        return after
    return after._replace(velocity=0.0 * after.velocity, angular_velocity=0.0 * after.angular_velocity)


def _fastest(state: State, length: float) -> float:
    """Return the largest velocity, or angular velocity times a length (m), in m/s."""
    return float(max(np.abs(state.velocity).max(), length * np.abs(state.angular_velocity).max()))


def has_pieces(scene: Scene) -> bool:
    """Return whether a joint or a coupling of the scene comes and goes, or a joint has an end stop."""
    sometimes = not all(part.is_permanent for part in parts_of(scene))
    return sometimes or any(joint.end_stop is not None for joint in scene.joint)


def parts_of(scene: Scene) -> tuple[Joint | Coupling, ...]:
    """Return the joints and couplings of a scene."""
    return (*scene.joint, *scene.coupling)


def names_of(scene: Scene) -> set[str]:
    """Return the names of the joints and couplings of a scene."""
    return {part.name for part in parts_of(scene)}


def events(scene: Scene, end: float) -> list[float]:
    """Return the times (s) in (0, end] at which an interval of a joint or a coupling begins or ends."""
    times = {time for part in parts_of(scene) for interval in part.active or () for time in interval}
    return sorted(time for time in times if 0.0 < time <= end)


def at_start(scene: Scene) -> Scene:
    """Return the scene with the parts that hold from t = 0 on; without intervals the scene itself."""
    if not has_pieces(scene):
        return scene
    return scene.with_(
        joint=[permanent(part) for part in scene.joint if part.starts_held],
        coupling=[permanent(part) for part in scene.coupling if part.starts_held],
    )


def always_held(scene: Scene) -> Scene:
    """Return a scene that has only the joints that hold at all times, without drivers and couplings. A scene
    without intervals, conditions and stops is returned as it is."""
    if not has_pieces(scene):
        return scene
    joints = [permanent(joint) for joint in scene.joint if joint.is_permanent]
    return scene.with_(joint=joints, coupling=[], driver=[])


def changed(scene: Scene, before: Scene, t: float, met: Collection[str] = ()) -> set[str]:
    """Return the names of the joints and couplings that hold after an event at t (s).

    ``before`` is the piece that ends there. Intervals begin or end; conditions are met of the parts ``met``,
    which change between holding and not.
    """
    names = names_of(before)
    for part in parts_of(scene):
        first, last = zip(*part.active, strict=True) if part.active else ((), ())
        if t in last or (part.name in met and part.name in names):
            names -= {part.name}
        elif (t in first and t and not part.when) or part.name in met:
            names |= {part.name}
    return names


def holds(part: Any, t: float) -> bool:
    """Return whether a joint or a coupling holds from t (s) on by its intervals."""
    return part.active is None or any(first <= t < last for first, last in part.active)


def permanent(part: Any) -> Any:
    """Return a joint or a coupling without intervals and end stops."""
    return part.model_copy(update=_always(part))


def _always(part: Any) -> dict[str, Any]:
    """Return the changed fields of a joint or a coupling without intervals and end stops."""
    return {**PERMANENT, "stop": None} if getattr(part, "end_stop", None) else PERMANENT


def later(
    scene: Scene,
    before: Scene,
    t: float,
    state: State,
    moved: Mapping[str, np.ndarray],
    names: Collection[str],
) -> Scene:
    """Return the piece that begins at t (s) in a state, after the piece ``before``, in which the joints and
    couplings of these names hold.

    ``moved`` has angle (rad, full turns counted) and displacement (m) since t = 0 of ``followed``.
    Raises SceneError if a joint does not meet a given pose.
    """
    return scene.with_(
        duration=max(scene.duration - t, 1e-3 * scene.duration),
        body=[_moved(body, b, state) for b, body in enumerate(scene.body)],
        joint=[_placed(scene, before, joint, t, state) for joint in scene.joint if joint.name in names],
        coupling=[
            from_coordinate(part, _led(scene, part, moved)).model_copy(update={**PERMANENT, "offset": 0.0})
            for part in scene.coupling
            if part.name in names
        ],
        driver=[driver.from_time(t) for driver in scene.driver],
        load=[found for load in scene.load for found in _load(scene, load, t, state, moved)],
    )


def followed(scene: Scene) -> list[str]:
    """Return the joints on whose coordinates since t = 0 a later piece depends: those with loads or end
    stops, the first ones of polynomial couplings, and those that conditions watch."""
    loaded = [load.joint for load in scene.load if isinstance(load, JointLoad)]
    loaded += [joint.name for joint in scene.joint if joint.end_stop]
    loaded += [part.when.joint for part in parts_of(scene) if part.when and part.when.joint]
    return loaded + [coupling.joints[0] for coupling in scene.coupling if coupling.powers > 1]


def _led(scene: Scene, coupling: Coupling, moved: Mapping[str, np.ndarray]) -> float:
    """Return the first coordinate of a polynomial coupling since t = 0, rad or m; 0 for a linear one."""
    if coupling.powers == 1:
        return 0.0
    joint, kind = scene.coupled(coupling)[0]
    return float(moved[joint.name][int(kind != ANGLE)])


def _moved(body: Body, b: int, state: State) -> Body:
    """Return a body with the pose and the velocities that it has in a state."""
    return body.model_copy(update={key: tuple(x[b].tolist()) for key, x in state._asdict().items()})


def _placed(scene: Scene, before: Scene, joint: Joint, t: float, state: State) -> Joint:
    """Return a joint of the scene, which holds from t (s) on, at the poses of a state."""
    held = next((each for each in before.joint if each.name == joint.name), None)
    if held is None and joint.engages == "given_pose":
        _refuse_gap(scene, joint, t, state)
    origin, given = (scene, joint) if held is None else (before, held)
    ends = [_carried(origin, state, *end) for end in zip(given.bodies, given.anchor_pair, strict=True)]
    axes = [_turned(origin, state, *end) for end in zip(given.bodies, given.directions, strict=False)]
    if len(axes) > 1:
        along = axes[0] / np.linalg.norm(axes[0])
        axes[1] = axes[1] - along * (along @ axes[1])
    listed = [tuple(axis.tolist()) for axis in axes]
    places = {
        "anchor": tuple(ends[0 if held is None else 1].tolist()),
        "anchors": tuple(tuple(end.tolist()) for end in ends),
        "axis": listed[0] if listed else None,
        "axes": tuple(listed),
    }
    fields = {key: place for key, place in places.items() if key in type(joint).model_fields}
    return joint.model_copy(update={**_always(joint), **fields})


def _carried(scene: Scene, state: State, name: str, point: Sequence[float]) -> np.ndarray:
    """Return the place (3,) in a state of a point (world, at the poses of the scene) of a body."""
    if name == GROUND:
        return np.array(point, dtype=float)
    arm = np.array(point) - scene.body[scene.body_index(name)].position
    return np.asarray(state.position[scene.body_index(name)] + _turned(scene, state, name, arm))


def _turned(scene: Scene, state: State, name: str, vector: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the direction (3,) in a state of a vector (world, at the poses of the scene) of a body."""
    if name == GROUND:
        return np.array(vector, dtype=float)
    b = scene.body_index(name)
    own = rotations.rotate(rotations.conjugate(np.array(scene.body[b].orientation)), np.array(vector))
    return np.asarray(rotations.rotate(state.orientation[b], own))


def _load(scene: Scene, load: Any, t: float, state: State, moved: Mapping[str, np.ndarray]) -> Iterator[Any]:
    """Yield a load of the scene as it acts from t (s) on, unless it is switched off by then."""
    changes: dict[str, Any] = {}
    if load.over_time is not None:
        changes["factor"] = load.over_time.from_time(t)
        if changes["factor"] is None:
            return
    if load.acts_on == "bodies":
        ends = zip(load.bodies, load.points, strict=True)
        changes["points"] = tuple(tuple(_carried(scene, state, *end).tolist()) for end in ends)
    elif hasattr(load, "point"):
        changes["point"] = tuple(_carried(scene, state, load.body, load.point).tolist())
    elif isinstance(load, JointLoad) and hasattr(load, field := f"natural_{load.coordinate}"):
        changes[field] = getattr(load, field) - float(moved[load.joint][int(load.coordinate != ANGLE)])
    yield load.model_copy(update=changes)


def _refuse_gap(scene: Scene, joint: Joint, t: float, state: State) -> None:
    """Raise SceneError if the poses of a state do not obey a joint as the scene gives it."""
    alone = scene.with_(joint=[permanent(joint)], coupling=(), driver=(), load=())
    rows = closure(alone, 0.0, state.position, state.orientation)[joint.name]
    lengths = np.where(length_rows(alone)[joint.name], scene_length(alone), 1.0)
    if (gap := float(np.abs(rows / lengths).max(initial=0.0))) > MISSED:
        raise SceneError(
            [f"{joint.name}: misses its given pose at t = {t:.6g} s by {gap:.3g} lengths or rad"]
        )
