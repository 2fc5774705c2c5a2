"""A joint as a list of primitive constraints between two bodies, which follow from the facts of its type."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import dist, sqrt
from typing import NamedTuple

from mbref.kernels.scene_layout import (
    CONTACT,
    COUPLED_ANGLE,
    COUPLED_SLIDE,
    DISTANCE,
    DOT1,
    DOT2,
    NO_SLIP,
    POINT,
    TURN_1,
    TURN_2,
    TURN_3,
)
from mbref.rotations import Vector3
from mbref.scene import JOINT_TYPES, Joint, SceneError
from mbref.scene.joints import ANGLE, Coordinate, X, Y, Z
from mbref.scene.rolling import RollingWheel

MOST_JOINTS = 4096  # number of joints whose primitives are kept
ORIGIN = (0.0, 0.0, 0.0)
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FAR_FROM_AXIS = 0.65  # cosine of an angle, above √(1/3), which one component at least does not exceed
ROWS_OF = {POINT: 3} | dict.fromkeys(
    (DOT1, DOT2, DISTANCE, COUPLED_ANGLE, COUPLED_SLIDE, CONTACT, NO_SLIP, TURN_1, TURN_2, TURN_3), 1
)
# directions of the first and of the second body that stay perpendicular: the first two pairs keep the axes
# parallel, the third prevents rotation about them
AROUND_AXIS = ((X, Z), (Y, Z), (X, Y))
WITHOUT_AXIS = ((X, Y), (Y, Z), (Z, X))


class Primitive(NamedTuple):
    """One primitive equation; vectors and points are in the world at t = 0, ``first`` is fixed in the first
    body."""

    kind: int
    point_first: Vector3 = ORIGIN
    point_second: Vector3 = ORIGIN
    first: Vector3 = ORIGIN
    second: Vector3 = ORIGIN
    # of drivers a direction in the first body, perpendicular to `first`, or the axis of a turn; of wheels the
    # normal of their plane
    turning: Vector3 = ORIGIN
    length: float = 0.0  # length of a distance constraint, radius of a wheel, or factor of a joint coordinate
    higher: tuple[float, ...] = ()  # factors of the square of a joint coordinate, and of higher powers
    driven: bool = False


def primitives_of(joint: Joint) -> list[Primitive]:
    """Return the primitive constraints of a joint; raises SceneError for a joint type without equations."""
    if joint.type not in JOINT_TYPES:
        raise SceneError([f"joint {joint.name!r}: mbref has no equations for joints of type {joint.type!r}"])
    facts, (first, second) = joint.facts, joint.anchor_pair
    if facts.condition == "constant distance":
        return [Primitive(DISTANCE, point_first=first, point_second=second, length=dist(first, second))]
    if facts.condition == "perpendicular axes":
        return [coincident(first), perpendicular(*map(unit, joint.directions))]
    if isinstance(joint, RollingWheel):
        return wheel_rows(joint)
    axes, pairs = (frame(joint.directions[0]), AROUND_AXIS) if joint.directions else (AXES, WITHOUT_AXIS)
    parallel = [perpendicular(axes[j], axes[k]) for j, k in pairs[: len(facts.forbidden_rotations)]]
    if len(facts.forbidden_translations) == len(axes):
        return [coincident(first), *parallel]
    return [*parallel, *(in_plane(first, axes[k]) for k in facts.forbidden_translations)]


def wheel_rows(joint: RollingWheel) -> list[Primitive]:
    """Return the contact of a wheel with its plane, and the directions in which it does not slip."""
    (first, second), (normal, axis) = joint.anchor_pair, map(unit, joint.directions)
    rows = [(CONTACT, normal), *((NO_SLIP, along) for along in joint.without_slip)]
    return [Primitive(kind, first, second, along, axis, normal, joint.radius) for kind, along in rows]


def driver_primitives(joint: Joint, axes: tuple[Vector3, ...]) -> list[Primitive]:
    """Return the row of a driver of the joint, or three rows for the ``axes`` of its turns; raises SceneError
    if the joint cannot be driven."""
    if axes:
        return [
            Primitive(kind, first=AXES[j], second=AXES[k], turning=unit(axis), driven=True)
            for kind, (j, k), axis in zip((TURN_1, TURN_2, TURN_3), WITHOUT_AXIS, axes, strict=True)
        ]
    if joint.facts.driven is None:
        raise SceneError([f"joint {joint.name!r}: joints of type {joint.type!r} cannot be driven"])
    return [of_coordinate(joint, joint.facts.driven, (DOT1, DOT2), driven=True)]


def function_of(primitive: Primitive, functions: Sequence[int]) -> int:
    """Return which function of its joint's driver a primitive has; -1 for a primitive without a driver."""
    return functions[max(0, primitive.kind - TURN_1)] if primitive.driven else -1


@lru_cache(maxsize=MOST_JOINTS)
def rows_of_joint(
    joint: Joint, driven: tuple[Vector3, ...] | None
) -> tuple[list[Primitive], list[tuple[float, ...]]]:
    """Return the primitives of a joint and its driver, and ``vectors_of`` each of them; ``driven`` are the
    axes of the driver's turns, empty for the driver of a coordinate, None without a driver."""
    found = [*primitives_of(joint), *(driver_primitives(joint, driven) if driven is not None else [])]
    return found, [*map(vectors_of, found)]


def vectors_of(p: Primitive) -> tuple[float, ...]:
    """Return 16 numbers of a primitive: two points, the directions ``direction_first``, ``turning_first`` and
    ``direction_second``, and a length or the factor of a joint coordinate."""
    return *p.point_first, *p.point_second, *p.first, *p.turning, *p.second, p.length


def unit(v: Sequence[float]) -> Vector3:
    """Return v / |v|."""
    x, y, z = map(float, v)
    length = sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def frame(axis: Sequence[float]) -> tuple[Vector3, Vector3, Vector3]:
    """Return a right-handed triad (x, y, z) with z along the axis.

    It changes smoothly with an axis near X, Y or Z, and jumps where a component passes ``FAR_FROM_AXIS``.
    """
    z = unit(axis)
    helper = next(each for each, c in zip(AXES, z, strict=True) if abs(c) < FAR_FROM_AXIS)
    x = unit(cross(helper, z))
    return x, cross(z, x), z


def coincident(anchor: Vector3) -> Primitive:
    """Return the constraint that the points of both bodies at the anchor coincide."""
    return Primitive(POINT, point_first=anchor, point_second=anchor)


def perpendicular(first: Vector3, second: Vector3) -> Primitive:
    """Return the constraint that a direction of each body stays perpendicular to the other."""
    return Primitive(DOT1, first=first, second=second)


def in_plane(anchor: Vector3, normal: Vector3) -> Primitive:
    """Return the constraint that the second body's anchor stays in the plane through the first body's anchor
    with that normal."""
    return Primitive(DOT2, point_first=anchor, point_second=anchor, first=normal)


def of_coordinate(
    joint: Joint,
    coordinate: Coordinate,
    kinds: tuple[int, int],
    law: tuple[float, ...] = (0.0,),
    driven: bool = False,
) -> Primitive:
    """Return the primitive of a joint's angle about, or displacement along, its axis.

    ``kinds`` are the kinds of primitives for an angle and for a displacement. A driver prescribes the
    coordinate (``driven``); a coupling adds a polynomial of the coordinate, with coefficients ``law`` of its
    first and higher powers, to its row.
    """
    (x, y, z), (factor, *higher) = frame(joint.directions[0]), law
    powers = tuple(higher)
    if coordinate == ANGLE:
        return Primitive(kinds[0], first=x, turning=y, second=x, length=factor, higher=powers, driven=driven)
    anchor = joint.anchor_pair[0]
    return Primitive(kinds[1], anchor, anchor, first=z, length=factor, higher=powers, driven=driven)
