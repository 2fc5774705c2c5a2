"""The memory of a Taylor method: a scene's polynomials, their series, and the matrix that solves each order.

Sizes: nz variables, nr rows, ng functions that drivers prescribe, nb bodies, orders of a series from 0 on.  A
coefficient of the series is a row of ``lanes`` numbers: variables, multipliers, functions, filled up with
zeros.  Variables and lengths are in units of the scene's length.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.layout import Memory
from mbref.kernels.named_memory import Indices, Matrix, Vector


class Rows(NamedTuple):
    """Constraint rows Φ: products of two lanes (each of them twice), linear terms and constants."""

    row: Annotated[Indices, "twofold"]
    lane: Annotated[Indices, "twofold"]
    other: Annotated[Indices, "twofold"]
    weight: Annotated[Vector, "twofold"]
    linear_row: Annotated[Indices, "onefold"]
    linear_lane: Annotated[Indices, "onefold"]
    linear_weight: Annotated[Vector, "onefold"]
    constant: Annotated[Vector, "nr"]


class Products(NamedTuple):
    """Products of two series in the equations, in levels: each holds one product of a number of equations.

    Equations, forces and rows, stand in the order of how many products they have.
    """

    left: Annotated[Indices, "slots"]  # lanes
    right: Annotated[Indices, "slots"]
    weight: Annotated[Vector, "slots"]
    start: Annotated[Indices, "levels + 1"]  # slots where each level begins
    equation: Annotated[Indices, "nz + nr"]  # of each place in a level: a variable's force, or nz + row


class Inertia(NamedTuple):
    """Mass matrix, constant force, and the force of constant moments, linear in the variables."""

    mass: Annotated[Matrix, "nz", "nz"]
    force: Annotated[Vector, "nz"]
    target: Annotated[Indices, "moments"]
    source: Annotated[Indices, "moments"]
    weight: Annotated[Vector, "moments"]


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
    series: Annotated[Matrix, "7*springs", "orders"]  # vector (3), length, inverse, rate, pull


class Torsions(NamedTuple):
    """Torsion springs: two directions across the axis on the first body, one on the second."""

    constant: Annotated[Matrix, "torsions", 9]
    form: Annotated[Matrix, "9*torsions", "nz"]
    stiffness: Annotated[Vector, "torsions"]
    damping: Annotated[Vector, "torsions"]
    natural: Annotated[Vector, "torsions"]
    slot: Annotated[Indices, "torsions"]  # of the unwrapped angle among the model's
    series: Annotated[Matrix, "15*torsions", "orders"]  # directions (9), cosine, sine, angle, three moments


class Polynomials(NamedTuple):
    """A scene's equations."""

    rows: Rows
    products: Products
    inertia: Inertia
    poses: Poses
    given: Given
    springs: Springs
    torsions: Torsions


class Series(NamedTuple):
    """Taylor coefficients about a time, orders in rows; multipliers stand two orders later than variables."""

    terms: Annotated[Matrix, "orders", "lanes"]
    past: Annotated[Matrix, "orders", "lanes"]  # about the time of the step's beginning
    past_angles: Annotated[Matrix, "torsions", "orders"]
    driven: Annotated[Vector, "orders"]  # of one driver
    left: Annotated[Matrix, "orders", "slots"]  # factors of the products, one order later
    right: Annotated[Matrix, "orders", "slots"]
    sums: Annotated[Vector, "slots"]
    totals: Annotated[Vector, "lanes"]  # of each equation's place in a level
    force: Annotated[Vector, "nz"]
    powers: Annotated[Matrix, 3, "orders"]  # of a time, and their derivatives


class Solver(NamedTuple):
    """K = [M Gᵀ; G 0], its columns in the order of the pivots' rows, and its inverse.

    ``inverse`` has the lanes that follow from one number on the right-hand side in each row: of the partner
    of the equation, then of the functions prescribed.
    """

    row: Annotated[Indices, "nr"]  # the independent rows first
    order: Annotated[Indices, "nz"]  # their dependent variables first
    work: Annotated[Matrix, "nr", "nz"]
    partner: Annotated[Indices, "nz + nr"]  # of equations: where in the right-hand side they stand
    place: Annotated[Indices, "nz + nr"]  # the same of the equations' places in a level
    of_force: Annotated[Vector, "nz + nr"]  # 1 for a place's force, else 0
    of_row: Annotated[Vector, "nz + nr"]  # 1 for an independent row, else 0
    pivot: Annotated[Indices, "nz + nr"]  # the order of elimination
    first: Annotated[Vector, "nz + nr"]  # pivots when they were chosen
    base: Annotated[Matrix, "nz + nr", "lanes"]  # K without what depends on the variables
    inverse: Annotated[Matrix, "nz + nr + ng", "lanes"]
    rhs: Annotated[Vector, "nz + nr + ng"]
    solution: Annotated[Vector, "lanes"]
    phi: Annotated[Vector, "nr"]


class Progress(NamedTuple):
    """Where the method is."""

    rank: int = 0  # of the constraint rows
    order: int = 0  # of the series
    tolerance: float = 0.0  # of the last terms of the series
    violation: float = 0.0  # the largest before the last correction


class TaylorMemory(NamedTuple):
    """All that the kernels of the method share."""

    run: Memory  # of the simulation: samples, counts, limits, and the general kernels
    polynomials: Polynomials
    series: Series
    solver: Solver
    progress: Progress
    state: Annotated[Matrix, 3, "lanes"]  # variables and their two derivatives at some time
    pose: Annotated[Matrix, 3, "12*nb"]
    angles: Annotated[Vector, "torsions"]  # rad, unwrapped, at the time of expansion
