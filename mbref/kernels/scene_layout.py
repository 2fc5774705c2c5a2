"""A scene as kernels read it: bodies, primitive constraints, functions of time and loads as named arrays.

Sizes: nb bodies, m constraint rows, p primitives, f functions of time, l loads.  Body ``nb`` is the fixed
frame.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from mbref.kernels.named_memory import IndexTable, Indices, Matrix, Vector

# kinds of primitive constraints
POINT, DOT1, DOT2, DISTANCE, COUPLED_ANGLE, COUPLED_SLIDE, CONTACT, NO_SLIP = range(8)
# dot-1 constraints whose first direction all three turns of a driver turn; each has the axis of one turn
TURN_1, TURN_2, TURN_3 = range(8, 11)
# kinds of loads: on a body, between points, of a joint's coordinate, and against relative rotation and motion
MOMENT, FORCE, SPRING, ABOUT_AXIS, ALONG_AXIS, TURN_DAMPER, POINT_DAMPER = range(7)


class Bodies(NamedTuple):
    """Masses (kg) and principal moments of inertia (kg m²)."""

    mass: Annotated[Vector, "nb"]
    inertia: Annotated[Matrix, "nb", 3]


class Primitives(NamedTuple):
    """Primitive constraints: bodies, first row, and vectors fixed in the first and the second body.

    Joint coordinates q, COUPLED_ANGLE or COUPLED_SLIDE, share the row of a coupling. Each of them adds
    ``length`` q + ``higher``[0] q² + … to the row.
    """

    kind: Annotated[Indices, "p"]
    first: Annotated[Indices, "p"]
    second: Annotated[Indices, "p"]
    driver: Annotated[Indices, "p"]  # index of the driver's function of time, -1 without
    row: Annotated[Indices, "p"]
    begins: Annotated[Indices, "p"]  # 0 for the second coordinate in the row of a coupling, otherwise 1
    column_first: Annotated[Indices, "p"]  # index in the blocks of the first body's columns
    column_second: Annotated[Indices, "p"]
    angle: Annotated[Indices, "p"]  # index in ``TurningJoints`` of the joint of a coupled angle, otherwise -1
    point_first: Annotated[Matrix, "p", 3]
    point_second: Annotated[Matrix, "p", 3]
    direction_first: Annotated[Matrix, "p", 3]
    # direction_first rotated by 90°, if a driver rotates it; the axis of a turn of a driven orientation; the
    # normal of the plane on which a wheel rolls
    turning_first: Annotated[Matrix, "p", 3]
    direction_second: Annotated[Matrix, "p", 3]
    # length of a distance constraint or radius of a wheel (m), or the factor of a joint coordinate
    length: Annotated[Vector, "p"]
    higher: Annotated[Matrix, "p", "powers"]  # factors of higher powers of a joint coordinate


class TurningJoints(NamedTuple):
    """Joints that turn about one axis: their bodies, and directions across the axis, fixed in the bodies."""

    first: Annotated[Indices, "angles"]
    second: Annotated[Indices, "angles"]
    x_first: Annotated[Matrix, "angles", 3]
    y_first: Annotated[Matrix, "angles", 3]  # x_first rotated by 90° about the axis
    x_second: Annotated[Matrix, "angles", 3]  # x_first at t = 0, in the second body


class Functions(NamedTuple):
    """Functions of time, drivers' first (rad or m), then factors of loads, then further turns of drivers.

    On a piece: part (amplitude sin(frequency t + phase) + Σ polynomial[k] t^k) + Σ cubic[k] (t - begin)^k.
    """

    first: Annotated[Indices, "f + 1"]  # index of the first piece of each function
    amplitude: Annotated[Vector, "f"]
    frequency: Annotated[Vector, "f"]
    phase: Annotated[Vector, "f"]
    polynomial: Annotated[Matrix, "f", "terms"]
    begin: Annotated[Vector, "pieces"]  # s
    part: Annotated[Vector, "pieces"]  # 1, or 0 where the function is switched off
    cubic: Annotated[Matrix, "pieces", 4]


class Loads(NamedTuple):
    """Loads of all kinds; a kind uses some of the vectors only. Points and axes are body-fixed, forces are in
    the world frame."""

    kind: Annotated[Indices, "l"]
    first: Annotated[Indices, "l"]
    second: Annotated[Indices, "l"]
    function: Annotated[Indices, "l"]  # index of the function of time that multiplies the load, else -1
    angle: Annotated[Indices, "l"]  # index in ``TurningJoints`` of the joint of a load about an axis, else -1
    force: Annotated[Matrix, "l", 3]  # N, or the moment in N m; along a joint coordinate the first number
    point_first: Annotated[Matrix, "l", 3]
    point_second: Annotated[Matrix, "l", 3]
    axis: Annotated[Matrix, "l", 3]  # joint axis in the first body's frame
    stiffness: Annotated[Vector, "l"]
    damping: Annotated[Vector, "l"]
    natural: Annotated[Vector, "l"]  # length or displacement (m) or angle (rad)


FIRST_NUMBERS = Primitives._fields.index("point_first")  # all earlier fields belong to the structure
FIRST_OF_LOADS = Loads._fields.index("force")


class SceneData(NamedTuple):
    """A scene as kernels read it; no kernel changes it."""

    gravity: Annotated[Matrix, "nb", 3]  # m/s², of each body; zero for rotors and a modelled ground
    lengths: Annotated[Vector, "nb"]  # lengths of the bodies (m), see equations.units
    metric_root: Annotated[Vector, "n"]  # inverse roots of the projection's metric
    bodies: Bodies
    primitives: Primitives
    turning: TurningJoints
    row_bodies: Annotated[IndexTable, "m", "sides"]  # bodies of each row, padded with the fixed frame
    velocity_rows: Annotated[Indices, "velocity_rows"]  # rows between velocities alone, whose Φ is zero
    functions: Functions
    loads: Loads

    @property
    def numbers(self) -> tuple[Any, ...]:
        """Return the arrays in which scenes of one structure differ."""
        primitives, loads = self.primitives[FIRST_NUMBERS:], self.loads[FIRST_OF_LOADS:]
        return (
            self.gravity,
            self.lengths,
            self.metric_root,
            *self.bodies,
            *primitives,
            *self.turning[2:],
            *self.functions[1:],
            *loads,
        )
