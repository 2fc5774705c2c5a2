"""Numbers of loads and of turning joints, and their places in a structure, as ``packing`` reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mbref.equations.joints import frame, unit
from mbref.equations.parts import ORIGIN
from mbref.equations.structure import LoadPlace
from mbref.kernels.scene_layout import (
    ABOUT_AXIS,
    ALONG_AXIS,
    FORCE,
    MOMENT,
    POINT_DAMPER,
    SPRING,
    TURN_DAMPER,
)
from mbref.scene import (
    Force,
    Joint,
    JointLoad,
    Load,
    Moment,
    PointDamper,
    RotationalDamper,
    Scene,
    SceneError,
    Spring,
)
from mbref.scene.joints import ANGLE

Values = tuple[float, ...]
BETWEEN_BODIES = {Spring: SPRING, RotationalDamper: TURN_DAMPER, PointDamper: POINT_DAMPER}


def loaded_joints(scene: Scene) -> dict[str, Joint]:
    """Return the joints of a scene by name if a load acts along or about a joint's axis, otherwise none."""
    has_joint_loads = any(isinstance(load, JointLoad) for load in scene.load)
    return {joint.name: joint for joint in scene.joint} if has_joint_loads else {}


def load_place(
    load: Load, place: int, joints: Mapping[str, Joint], index: Mapping[str, int], turning: Mapping[str, int],
    function: int,
) -> LoadPlace:  # fmt: skip
    """Return kind, bodies, function of time and angle of load[place]; raises SceneError for an unknown type.

    ``joints`` are ``loaded_joints``, ``index`` the bodies by name, ``turning`` the turning joints.
    """
    if isinstance(load, Moment | Force):
        return LoadPlace(FORCE if isinstance(load, Force) else MOMENT, index[load.body], 0, function)
    if isinstance(load, Spring | RotationalDamper | PointDamper):
        first, second = map(index.__getitem__, load.bodies)
        return LoadPlace(BETWEEN_BODIES[type(load)], first, second, function)
    if not isinstance(load, JointLoad):
        raise SceneError([f"load[{place}]: mbref has no equations for loads of type {load.type!r}"])
    first, second = map(index.__getitem__, joints[load.joint].bodies)
    if load.coordinate == ANGLE:
        return LoadPlace(ABOUT_AXIS, first, second, function, turning[load.joint])
    return LoadPlace(ALONG_AXIS, first, second, function)


def anchors_of(joint: Joint) -> tuple[float, ...]:
    """Return the anchors on the first and on the second body, world at t = 0."""
    first, second = joint.anchor_pair
    return *first, *second


def numbers_of_load(load: Load, joints: Mapping[str, Joint]) -> tuple[float, ...]:
    """Return force, two points and axis (world, t = 0), stiffness, damping, and natural length or angle of a
    load; unused vectors are zero. ``joints`` are ``loaded_joints``."""
    if isinstance(load, Moment):
        return *load.moment, *ORIGIN * 4
    if isinstance(load, Force):
        return *load.force, *load.point, *ORIGIN * 3
    if isinstance(load, Spring):
        first, second = load.points
        return *ORIGIN, *first, *second, *ORIGIN, load.stiffness, load.damping, load.natural_length
    if isinstance(load, RotationalDamper | PointDamper):
        ends = (*load.point, *load.point) if isinstance(load, PointDamper) else ORIGIN * 2
        return *ORIGIN, *ends, *ORIGIN, 0.0, load.damping, 0.0
    joint, action = joints[load.joint], load.action
    numbers = action.stiffness, action.damping, action.natural
    return action.amount, 0.0, 0.0, *anchors_of(joint), *unit(joint.directions[0]), *numbers


def turning_joints(joints: Sequence[Joint]) -> list[Joint]:
    """Return the joints that turn about one axis."""
    return [joint for joint in joints if joint.facts.turns]


def directions_across(joint: Joint) -> Values:
    """Return x and y on the first body of a turning joint, across its axis, and x on the second body (world,
    t = 0)."""
    x, y, _ = frame(joint.directions[0])
    return *x, *y, *x
