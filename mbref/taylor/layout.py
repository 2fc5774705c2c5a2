"""The memory of a Taylor method: a scene's polynomials, their series, and the matrix that solves each order.

Sizes: nz variables, nr rows, ng functions that drivers prescribe, nb bodies, orders of a
series from 0 on.  A coefficient of the series is a row of ``lanes`` numbers: variables, multipliers,
functions, padded_size up with zeros.  Variables and lengths are in units of the scene's length.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.compilation import FLOAT, INT
from mbref.kernels.layout import Memory
from mbref.kernels.named_memory import Indices, Kernel, Matrix, Named, Vector


class PoseMaps(NamedTuple):
    """Variables as linear forms of their bodies' poses: position (m) and rotation matrix by rows.

    A direction that a driver turns by ψ is cos ψ along - sin ψ across.
    """

    body: Annotated[Indices, "nz"]  # nb for the ground
    driver: Annotated[Indices, "nz"]  # -1 for none
    along: Annotated[Matrix, "nz", 12]
    across: Annotated[Matrix, "nz", 12]


class Rows(NamedTuple):
    """Constraint rows Φ: products of two lanes (each of them twice), linear terms and constants."""

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

    Each block of lanes has as many blocks of slots as its lane with the most products needs.
    """

    left: Annotated[Indices, "slots"]  # lanes
    right: Annotated[Indices, "slots"]
    weight: Annotated[Vector, "slots"]
    start: Annotated[Indices, "blocks + 1"]  # slots where each block of lanes begins


class Inertia(NamedTuple):
    """Mass matrix, constant force, and the force of constant moments, linear in the variables."""

    mass: Annotated[Matrix, "nz", "lanes"]
    coupled: Annotated[Indices, "couplings"]  # variables with an inertia in common with one, itself included
    first: Annotated[Indices, "nz + 1"]  # place in ``coupled`` where those of a variable begin
    force: Annotated[Vector, "lanes"]
    source: Annotated[Indices, "moments"]  # lanes, of which each block of lanes has its blocks
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
    """Torsion springs: two directions across the axis on the first body, one on the second."""

    constant: Annotated[Matrix, "torsions", 9]
    form: Annotated[Matrix, "9*torsions", "nz"]
    stiffness: Annotated[Vector, "torsions"]
    damping: Annotated[Vector, "torsions"]
    natural: Annotated[Vector, "torsions"]
    slot: Annotated[Indices, "torsions"]  # of the unwrapped angle among the model's


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
    springs: Annotated[Matrix, "7*springs", "orders"]  # vector (3), length, inverse, rate, pull
    torsions: Annotated[Matrix, "15*torsions", "orders"]  # directions (9), cosine, sine, angle, three moments
    left: Annotated[Matrix, "orders", "slots"]  # factors of the products, one order later
    right: Annotated[Matrix, "orders", "slots"]
    sums: Annotated[Matrix, "orders", "lanes"]  # of products of known orders, and minus the forces
    scale: Annotated[Matrix, "orders", "lanes"]  # of the sums on the right-hand side
    growth: Annotated[Matrix, "orders", "lanes"]  # of the solution
    variable: Annotated[Vector, "lanes"]  # 1 for a variable, else 0


class Solver(NamedTuple):
    """The linear system of each order, its partition and the response.

    A row of ``response`` has the lanes that follow from one number on the right-hand side: of an equation
    (none from a row that depends on others) or of a function prescribed.
    """

    pivot_rows: Annotated[Indices, "nr"]  # the independent rows first
    pivot_columns: Annotated[Indices, "nz"]  # their dependent variables first
    work: Annotated[Matrix, "nr", "nz"]
    left: Annotated[Vector, "lanes"]  # 1 for a variable without a pivot, where pivots are chosen
    row_max: Annotated[Vector, "nr"]  # the largest entry of each row there
    first: Annotated[Vector, "nz"]  # pivots when they were chosen: of G, then of the reduced mass matrix
    last: Annotated[Vector, "nz"]  # pivots of the last factorisation
    past: Annotated[Vector, "nz"]  # pivots where the step began
    past_motion: Annotated[Vector, "nz"]  # T of the first independent variable, if any, where the step began
    past_gradient: Annotated[Matrix, "nz", "nr"]  # Gᵀ of the independent rows where the step began
    product: Annotated[Matrix, "nr", "nr"]  # of gradients at both ends of a step
    place: Annotated[Indices, "twofold"]  # in the tableau, of the products of rows
    linear: Annotated[Matrix, "nr + 1", "lanes"]  # the part of the tableau that depends on no variable
    tableau: Annotated[Matrix, "nr + 1", "lanes"]  # [G 1] of the rows; the last one takes functions
    particular: Annotated[Matrix, "nz", "lanes"]  # N, in the lanes of multipliers
    null_space: Annotated[Matrix, "nz", "lanes"]  # Tᵀ, a row for each independent variable
    momentum: Annotated[Matrix, "nz", "lanes"]  # Tᵀ M
    reduced: Annotated[Matrix, "nz", "nz"]  # Tᵀ M T
    forces: Annotated[Matrix, "nz", "lanes"]  # left at a variable by the motion due to one right-hand side
    response: Annotated[Matrix, "lanes", "lanes"]
    rhs: Annotated[Vector, "lanes"]
    phi: Annotated[Vector, "lanes"]  # in the lanes of the multipliers
    change: Annotated[Vector, "lanes"]  # the last correction


class Progress(NamedTuple):
    """Where the method is."""

    rank: int = 0  # of the constraint rows
    order: int = 0  # of the series
    tolerance: float = 0.0  # of the last terms of the series
    farthest: float = 0.0  # m by which the series may miss the coordinates of the start
    freedoms: int = 0  # at the start, by singular values of the constraint rows
    violation: float = 0.0  # the largest before the last correction
    corrected: float = 0.0  # the largest change of a variable by the last correction
    first: float = 0.0  # s, from the last step's beginning to where it crossed
    second: float = 0.0  # s, the same of the second singular position; negative if it met one
    resting: int = 0  # whether the motion began at rest beside a singular position that is near
    crossed: int = 0  # whether the last attempt crossed a singular position
    end: float = 0.0  # time of the last step's end
    choice: int = 0  # of the partition, counted
    past_choice: int = 0  # where the step began
    odd: int = 0  # whether rows and variables are chosen in an order that an odd number of exchanges makes
    past_odd: int = 0  # the same where the step began
    kept_pivot: float = (
        0.0  # the least of G just before the last choice; minus infinity if a sign had changed
    )
    past_pivot: float = 1.0  # the least of G where the step began
    approaching: int = 1  # whether it is less than where the step before began, which did not cross
    past_negative: int = 0  # whether det G of a square gradient is negative where the step began
    past_logarithm: float = 0.0  # of its size
    largest_pivot: float = 0.1  # that the least one has been, of rows of length one about
    passing: int = 0  # whether singular positions are passed, or run up to
    clearance: float = 0.0  # from singular positions, over that at which a passage ends
    is_clear: int = 0  # whether the passage has ended
    left: float = 0.0  # of the violation, where the step began; known after an attempt failed
    entered: float = 0.0  # the least pivot where the series began
    meets: float = 0.0  # s, until the series meets a singular position; negative behind one, 0 without one
    ahead: float = 0.0  # s, the same from the pivots of an attempt that came to it; 0 if there was none
    top: int = 0  # the last order of the series that is not rounding
    cut: int = 0  # the last order of the series that an attempt takes
    usual: float = 0.0  # the tolerance of steps that pass no singular position
    usual_order: int = 0  # the order of their series
    exact: float = 0.0  # the tolerance of steps that pass one
    exact_order: int = 0
    change: float = 0.0  # of velocities, relative, that a passage may not magnify
    begun: int = 0  # whether a series has been begun
    passed: int = 0  # singular positions in ``Crossings``
    taken: int = 0  # samples that are complete
    slowing: float = 0.0  # 1/s, the relative rate of the speed where orders are by power; else 0
    leaving: int = 0  # whether the series comes from a singular position that it has passed
    striding: int = 0  # whether drivers are followed, by loose series where no singular position is passed


class SeriesKernels(NamedTuple):
    """The kernels that several others call, by address: a copy in each would be cold where it is called."""

    begin: Annotated[Kernel, BEGIN]
    expand: Annotated[Kernel, EXPAND]
    step: Annotated[Kernel, STEP]


class SceneCode(NamedTuple):
    """Addresses of the functions generated for the scene at a rank of its rows; 0 for none."""

    rank: int = 0
    expand: int = 0  # finds all orders
    expand_by_power: int = 0  # finds them without multipliers, of a motion of one freedom that is not at rest
    factorise: int = 0  # finds pivots and response
    violation: int = 0  # finds Φ
    close: int = 0  # takes Φ away
    close_rate: int = 0  # takes Φ' away


class Instant(NamedTuple):
    """When a saved was taken."""

    time: float = 0.0  # s
    sample: int = 0  # the next one to take
    crossings: int = 0  # singular positions passed so far


class SavedState(NamedTuple):
    """The state of a run at an instant."""

    instant: Instant
    coordinates: Annotated[Vector, "7*nb"]
    velocities: Annotated[Vector, "n"]
    angles: Annotated[Vector, "angles"]


class Crossings(NamedTuple):
    """Singular positions passed since they were last asked for: times (s) and states, the first rows."""

    time: Annotated[Vector, "kept"]
    coordinates: Annotated[Matrix, "kept", "7*nb"]
    velocities: Annotated[Matrix, "kept", "n"]


class StepStart(NamedTuple):
    """Where a series begins: values and rates of the variables, and angles of torsion springs."""

    terms: Annotated[Matrix, 2, "lanes"]
    angles: Annotated[Vector, "torsions"]


class Waiting(NamedTuple):
    """Samples whose accelerations and multipliers are found when the steps of a call have ended."""

    state: Annotated[Matrix, "k", "3*lanes"]  # variables and their two derivatives
    angles: Annotated[Matrix, "k", "torsions"]  # rad, unwrapped
    exact: Annotated[Indices, "k"]  # whether the step was an exact one, near a singular position


class TaylorMemory(NamedTuple):
    """All that the kernels of the method share."""

    run: Memory  # of the simulation: samples, counts, limits, and the general kernels
    polynomials: Polynomials
    pose_maps: PoseMaps
    series: Series
    solver: Solver
    progress: Progress
    kernels: SeriesKernels
    code: SceneCode
    crossing_start: SavedState  # from where the last long crossing is smooth
    landed: SavedState  # where it has ended
    step_start: StepStart
    here: StepStart  # of the present series, kept while samples are completed
    crossings: Crossings
    parting: Annotated[Indices, "parting"]  # numbers of the singular positions left along another branch
    crossing_end: Annotated[Matrix, 2, "lanes"]  # values and rates of the variables where a passage ended
    state: Annotated[Matrix, 3, "lanes"]  # variables and their two derivatives at some time
    pose: Annotated[Matrix, 3, "12*nb"]
    angles: Annotated[Vector, "torsions"]  # rad, unwrapped, at the time of expansion
    waiting: Waiting
    before_samples: SavedState  # the state of the run while samples are completed


SERIES = Named(TaylorMemory)
BEGIN = STEP = INT(SERIES)
EXPAND = INT(FLOAT, SERIES)  # t
