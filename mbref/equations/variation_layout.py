"""Memory of variations: changes of a scene's data by numbers, and of a state along directions."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.named_memory import Indices, Matrix, Vector


class PrimitiveChanges(NamedTuple):
    """Changes of ``Primitives`` by each number of the scene."""

    point_first: Annotated[Matrix, "numbers", "3*p"]
    point_second: Annotated[Matrix, "numbers", "3*p"]
    direction_first: Annotated[Matrix, "numbers", "3*p"]
    turning_first: Annotated[Matrix, "numbers", "3*p"]
    direction_second: Annotated[Matrix, "numbers", "3*p"]
    length: Annotated[Matrix, "numbers", "p"]
    higher: Annotated[Matrix, "numbers*p", "powers"]


class TurningChanges(NamedTuple):
    """Changes of ``TurningJoints`` by each number."""

    x_first: Annotated[Matrix, "numbers", "3*angles"]
    y_first: Annotated[Matrix, "numbers", "3*angles"]
    x_second: Annotated[Matrix, "numbers", "3*angles"]


class FunctionChanges(NamedTuple):
    """Changes of ``Functions`` by each number; none moves the begin of a piece."""

    amplitude: Annotated[Matrix, "numbers", "f"]
    frequency: Annotated[Matrix, "numbers", "f"]
    phase: Annotated[Matrix, "numbers", "f"]
    polynomial: Annotated[Matrix, "numbers*f", "terms"]
    begin: Annotated[Matrix, "numbers", "pieces"]
    part: Annotated[Matrix, "numbers", "pieces"]
    cubic: Annotated[Matrix, "numbers", "4*pieces"]


class LoadChanges(NamedTuple):
    """Changes of ``Loads`` by each number."""

    force: Annotated[Matrix, "numbers", "3*l"]
    point_first: Annotated[Matrix, "numbers", "3*l"]
    point_second: Annotated[Matrix, "numbers", "3*l"]
    axis: Annotated[Matrix, "numbers", "3*l"]
    stiffness: Annotated[Matrix, "numbers", "l"]
    damping: Annotated[Matrix, "numbers", "l"]
    natural: Annotated[Matrix, "numbers", "l"]


class SceneChanges(NamedTuple):
    """Changes of a scene's data by each number of the scene: one row for each number."""

    gravity: Annotated[Matrix, "numbers", "3*nb"]
    mass: Annotated[Matrix, "numbers", "nb"]
    inertia: Annotated[Matrix, "numbers", "3*nb"]
    diagonal: Annotated[Matrix, "numbers", "n"]  # of M
    primitives: PrimitiveChanges
    turning: TurningChanges
    functions: FunctionChanges
    loads: LoadChanges
    moves: Annotated[Indices, "numbers"]  # 1 if the number changes constraints, otherwise 0


class VariedState(NamedTuple):
    """Motion of the bodies at one state, its changes along c directions, and the changes of the equations.

    Rows of bodies end with the fixed frame, which does not move.
    """

    spin: Annotated[Matrix, "nb + 1", 3]  # ω, world
    acceleration: Annotated[Matrix, 1, "n + 6"]
    multipliers: Annotated[Vector, "m"]
    torque: Annotated[Matrix, "nb + 1", 3]  # of Φ_qᵀ λ - g, world
    x: Annotated[Matrix, "c", "n + 6"]
    w: Annotated[Matrix, "c", "n + 6"]
    turn: Annotated[Matrix, "c", "3*nb + 3"]  # θ
    twist: Annotated[Matrix, "c", "3*nb + 3"]  # ψ
    rows: Annotated[Matrix, "c", "m"]  # of δΦ, δΦ' or δΦ''
    wrench: Annotated[Matrix, "c", "n + 6"]  # of Φ_qᵀ λ - g, force and moment, world
