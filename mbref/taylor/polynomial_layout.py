"""The equations of a scene in natural coordinates, as kernels of a Taylor method read them.

Sizes: nz variables, ng functions that drivers prescribe, nb bodies; ``lanes`` as in ``taylor.layout``.
Variables and lengths are in units of the scene's length.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.named_memory import Indices, Matrix, Vector


class PoseMaps(NamedTuple):
    """Variables as linear forms of their bodies' poses: position (m) and rotation matrix by rows.

    A direction that a driver turns by ψ is cos ψ times ``along`` minus sin ψ times ``across``.
    """

    body: Annotated[Indices, "nz"]  # nb for the ground
    driver: Annotated[Indices, "nz"]  # -1 for none
    along: Annotated[Matrix, "nz", 12]
    across: Annotated[Matrix, "nz", 12]


class RowPolynomials(NamedTuple):
    """Constraint rows Φ: products of two variables or prescribed functions (each product twice), linear terms
    and constants."""

    row: Annotated[Indices, "twofold"]
    lane: Annotated[Indices, "twofold"]
    other: Annotated[Indices, "twofold"]
    weight: Annotated[Vector, "twofold"]
    linear_row: Annotated[Indices, "onefold"]
    linear_lane: Annotated[Indices, "onefold"]
    linear_weight: Annotated[Vector, "onefold"]
    constant: Annotated[Vector, "lanes"]  # in the lanes of the multipliers


class Products(NamedTuple):
    """Products of two series in the equations: of the force on a lane's variable, or of a lane's row.

    A block of lanes has room for its lane with the most products."""

    left: Annotated[Indices, "slots"]  # lanes
    right: Annotated[Indices, "slots"]
    weight: Annotated[Vector, "slots"]
    start: Annotated[Indices, "blocks + 1"]  # slots where each block of lanes begins


class Inertia(NamedTuple):
    """Mass matrix, constant force, and the force of constant moments, linear in the variables."""

    mass: Annotated[Matrix, "nz", "lanes"]
    coupled: Annotated[Indices, "couplings"]  # variables coupled with each by inertia, itself included
    first: Annotated[Indices, "nz + 1"]  # index in ``coupled`` of the first variable coupled with each
    force: Annotated[Vector, "lanes"]
    source: Annotated[Indices, "moments"]  # lanes that each block of lanes reads
    weight: Annotated[Vector, "moments"]
    start: Annotated[Indices, "blocks + 1"]


class Poses(NamedTuple):
    """Position (m) and rotation matrix by rows of each body, 12 numbers, affine in the variables."""

    constant: Annotated[Vector, "12*nb"]
    start: Annotated[Indices, "12*nb + 1"]
    variable: Annotated[Indices, "places"]
    weight: Annotated[Vector, "places"]


class Given(NamedTuple):
    """The functions that drivers prescribe: a driver's value over ``unit``, its cosine or its sine."""

    driver: Annotated[Indices, "ng"]
    function: Annotated[Indices, "ng"]
    unit: Annotated[Vector, "ng"]


class Springs(NamedTuple):
    """Springs between points: their vectors, affine in the variables, and constants."""

    constant: Annotated[Matrix, "springs", 3]
    form: Annotated[Matrix, "3*springs", "nz"]
    stiffness: Annotated[Vector, "springs"]
    damping: Annotated[Vector, "springs"]
    natural: Annotated[Vector, "springs"]


class Torsions(NamedTuple):
    """Angles of joints: two directions across the axis on the first body, one direction on the second
    body."""

    constant: Annotated[Matrix, "torsions", 9]
    form: Annotated[Matrix, "9*torsions", "nz"]
    stiffness: Annotated[Vector, "torsions"]
    damping: Annotated[Vector, "torsions"]
    natural: Annotated[Vector, "torsions"]
    amount: Annotated[Vector, "torsions"]  # of a torque
    function: Annotated[Indices, "torsions"]  # function of time that multiplies the torque; -1 without
    slot: Annotated[Indices, "torsions"]  # index of the unwrapped angle among the model's angles
    row: Annotated[Indices, "torsions"]  # row of the coupling to which the angle belongs; -1 for a load
    law: Annotated[Matrix, "torsions", "powers + 1"]  # factors of powers of the angle in the row


class Slides(NamedTuple):
    """Displacements of joints: the axis on the first body, and the vector between the anchors."""

    constant: Annotated[Matrix, "slides", 6]
    form: Annotated[Matrix, "6*slides", "nz"]
    stiffness: Annotated[Vector, "slides"]
    damping: Annotated[Vector, "slides"]
    natural: Annotated[Vector, "slides"]
    amount: Annotated[Vector, "slides"]  # of a force
    function: Annotated[Indices, "slides"]  # function of time that multiplies the force; -1 without
    row: Annotated[Indices, "slides"]  # row of the coupling to which the displacement belongs; -1 for a load
    law: Annotated[Matrix, "slides", "powers + 1"]  # factors of powers of the displacement in the row


class TimedForces(NamedTuple):
    """Forces and moments on bodies that functions of time multiply: constant, or linear in the variables."""

    function: Annotated[Indices, "timed"]
    constant: Annotated[Matrix, "timed", "nz"]
    linear: Annotated[Matrix, "nz*timed", "nz"]


class Polynomials(NamedTuple):
    """A scene's equations."""

    rows: RowPolynomials
    products: Products
    inertia: Inertia
    poses: Poses
    given: Given
    springs: Springs
    torsions: Torsions
    slides: Slides
    timed: TimedForces
