"""The memory of a Taylor method: a scene's polynomials, their series, and the matrix that solves each order.

Sizes: nz variables, nr rows, ng functions that drivers prescribe, nb bodies, orders of a
series from 0 on.  A coefficient of the series is a row of ``lanes`` numbers: variables, multipliers,
functions, padded with zeros.  Variables and lengths are in units of the scene's length.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.compilation import BOOLEAN, FLOAT, INT, MATRIX, pair_of
from mbref.kernels.layout import Memory
from mbref.kernels.named_memory import Indices, Kernel, Matrix, Named, Vector
from mbref.taylor.polynomial_layout import Polynomials, PoseMaps


class Series(NamedTuple):
    """Taylor coefficients about a time, orders in rows; multipliers are two rows later than variables."""

    terms: Annotated[Matrix, "orders", "lanes"]
    past: Annotated[Matrix, "orders", "lanes"]  # about the time at the start of the step
    past_angles: Annotated[Matrix, "torsions", "orders"]
    driven: Annotated[Vector, "orders"]  # of one driver
    # vector (3), length, inverse length, rate, force over length
    springs: Annotated[Matrix, "7*springs", "orders"]
    torsions: Annotated[Matrix, "15*torsions", "orders"]  # directions (9), cosine, sine, angle, three moments
    slides: Annotated[Matrix, "8*slides", "orders"]  # axis (3), vector (3), displacement, force
    # derivatives of the polynomials of coupled angles, then of coupled displacements, from the first one on
    slopes: Annotated[Matrix, "(powers + 1)*(torsions + slides)", "orders"]
    factors: Annotated[Matrix, "f", "orders"]  # functions of time that multiply loads
    left: Annotated[Matrix, "orders", "slots"]  # factors of the products, one order later
    right: Annotated[Matrix, "orders", "slots"]
    sums: Annotated[Matrix, "orders", "lanes"]  # sums of products of known orders, minus the forces
    scale: Annotated[Matrix, "orders", "lanes"]  # scale of the sums on the right-hand side
    growth: Annotated[Matrix, "orders", "lanes"]  # scale of the solution
    variable: Annotated[Vector, "lanes"]  # 1 for a variable, otherwise 0


class Solver(NamedTuple):
    """The linear system of each order, its partition and the response."""

    pivot_rows: Annotated[Indices, "nr"]  # the independent rows first
    pivot_columns: Annotated[Indices, "nz"]  # dependent variables first
    work: Annotated[Matrix, "nr", "nz"]
    left: Annotated[Vector, "lanes"]  # 1 for a variable without a pivot, while pivots are chosen
    row_max: Annotated[Vector, "nr"]  # largest entry of each row, while pivots are chosen
    unit: Annotated[Vector, "lanes"]  # unit of each variable in pivots: 1, or the growth of the mechanism
    # pivots of G and of the reduced mass matrix when the dependent variables were chosen
    first: Annotated[Vector, "nz"]
    last: Annotated[Vector, "nz"]  # pivots of the last factorisation
    past: Annotated[Vector, "nz"]  # pivots at the start of the step
    past_motion: Annotated[Vector, "nz"]  # T of the first independent variable at the start of the step
    past_gradient: Annotated[Matrix, "nz", "nr"]  # Gᵀ of the independent rows at the start of the step
    product: Annotated[Matrix, "nr", "nr"]  # product of the gradients at both ends of a step
    place: Annotated[Indices, "twofold"]  # index in the tableau of each product of rows
    linear: Annotated[Matrix, "nr + 1", "lanes"]  # constant part of the tableau
    tableau: Annotated[Matrix, "nr + 1", "lanes"]  # [G 1] of the rows; the last row is for functions
    particular: Annotated[Matrix, "nz", "lanes"]  # N, in the lanes of multipliers
    null_space: Annotated[Matrix, "nz", "lanes"]  # Tᵀ, a row for each independent variable
    momentum: Annotated[Matrix, "nz", "lanes"]  # Tᵀ M
    reduced: Annotated[Matrix, "nz", "nz"]  # Tᵀ M T
    # residual force f - M q'' of each variable (rows), for each right-hand side (lanes)
    forces: Annotated[Matrix, "nz", "lanes"]
    response: Annotated[
        Matrix, "lanes", "lanes"
    ]  # row k: change of all lanes for a unit entry k of the right-hand side
    rhs: Annotated[Vector, "lanes"]
    phi: Annotated[Vector, "lanes"]  # in the lanes of the multipliers
    change: Annotated[Vector, "lanes"]  # the last correction


class SeriesOptions(NamedTuple):
    """Numbers of a run that its steps do not change."""

    regular_tolerance: float = 0.0  # tolerance of the last terms of the series, in regular steps
    regular_order: int = 0  # order of the series in regular steps
    accurate_tolerance: float = 0.0  # tolerance of high-accuracy steps, which cross singular positions
    accurate_order: int = 0
    velocity_change: float = 0.0  # relative velocity change of a perturbed run
    start_distance: float = 0.0  # m or rad; largest distance of the series from the start
    rest_speed: float = 0.0  # m/s or rad/s; a slower driven motion starts from rest
    start_freedoms: int = 0  # degrees of freedom at the start, from singular values
    follows_drivers: int = 0  # 1 if steps are predictor steps away from singular positions


class Mode(NamedTuple):
    """The kind of the next steps, as ``mbref.taylor.mode`` sets it."""

    kind: int = 0  # REGULAR, HIGH_ACCURACY or PREDICTOR
    tolerance: float = 0.0  # tolerance of the last terms of the series
    order: int = 0  # of the series


class Partition(NamedTuple):
    """The independent rows and the variables that depend on them."""

    rank: int = 0  # rank of the constraint rows
    partition_id: int = 0  # number of selections of rows and variables so far
    parity: int = 0  # 1 if the order of pivots is an odd permutation
    replaced_pivot: float = 0.0  # least pivot before the last selection; minus infinity if a sign had changed
    start_entry: float = 0.0  # largest entry of G at the first selection


class Step(NamedTuple):
    """The state of a step: its start, the series that it evaluates, and its last attempt."""

    start_partition_id: int = 0
    start_parity: int = 0
    start_negative: int = 0  # 1 if det G of a square gradient is negative
    start_logarithm: float = 0.0  # logarithm of the size of det G
    start_violation: float = 0.0  # violation of the rows; computed after a failed attempt
    last_order: int = 0  # last order that rounding does not dominate
    used_order: int = 0  # the last order that an attempt evaluates
    time_to_pole: float = 0.0  # s to the rounding pole that is subtracted; 0 without one
    deceleration: float = 0.0  # 1/s, relative rate of the speed if orders are computed by power; otherwise 0
    violation: float = 0.0  # largest violation before the last correction
    correction: float = 0.0  # largest change of a variable by the last correction
    crossed: int = 0  # 1 if the last attempt crossed a singular position
    first_crossing: float = 0.0  # s from the start of the last step
    second_crossing: float = 0.0  # s; negative if the step crossed one position only


class Progress(NamedTuple):
    """Progress of a run: its end, and what is recorded."""

    end: float = 0.0  # s, end of the last step
    begun: int = 0  # 1 after the first Taylor series of the run has begun
    recorded: int = 0  # singular positions in ``Crossings``
    completed: int = 0  # samples that have accelerations and multipliers


class SingularDistance(NamedTuple):
    """Distance of the motion from singular positions, by the pivots of G."""

    start_pivot: float = 1.0  # least pivot at the start of the step
    largest_pivot: float = 0.1  # largest value of the least pivot so far
    entry_pivot: float = 0.0  # least pivot at the start of the high-accuracy steps
    approaching: int = 1  # 1 if the pivot falls since the previous step, which did not cross
    leaving: int = 0  # 1 if the motion leaves a singular position that it has crossed
    rests_near: int = 0  # 1 if the motion started at rest near a singular position and is still near
    time_to_crossing: float = 0.0  # s to a singular position, from the pivots of an attempt; 0 without one
    clearance: float = 0.0  # distance / distance at which a long crossing may end
    is_clear: int = 0  # 1 if the distance is large enough to end a long crossing


class SeriesKernels(NamedTuple):
    """The kernels that several others call by address, so that each is compiled once. Neighbours call common
    helpers."""

    orders: Annotated[Kernel, TERMS]
    balance: Annotated[Kernel, BALANCE]
    sample: Annotated[Kernel, SAMPLE]
    multipliers: Annotated[Kernel, TERMS]
    terms: Annotated[Kernel, TERMS]
    correct: Annotated[Kernel, CORRECT]
    expand: Annotated[Kernel, EXPAND]
    respond: Annotated[Kernel, RESPOND]
    partition: Annotated[Kernel, PARTITION]
    choose: Annotated[Kernel, PARTITION]
    return_to_start: Annotated[Kernel, RETURN_TO_START]
    save_series: Annotated[Kernel, SAVE_SERIES]
    record: Annotated[Kernel, RECORD_CROSSINGS]
    judge_start: Annotated[Kernel, JUDGE_START]
    begin: Annotated[Kernel, BEGIN]
    gradient: Annotated[Kernel, GRADIENT]
    determinant: Annotated[Kernel, DETERMINANT]
    detect: Annotated[Kernel, DETECT]
    turning_pivot: Annotated[Kernel, TURNING_PIVOT]
    step: Annotated[Kernel, TAKE_STEP]


class SceneCode(NamedTuple):
    """Addresses of the functions generated for the scene at a rank of its rows; 0 for none."""

    rank: int = 0
    expand: int = 0  # computes all orders
    expand_by_power: int = 0  # address: orders without multipliers, for one degree of freedom in motion
    factorise: int = 0  # computes pivots and response
    violation: int = 0  # computes Φ
    close: int = 0  # removes Φ
    close_rate: int = 0  # removes Φ'


class Instant(NamedTuple):
    """The time at which a state was saved."""

    time: float = 0.0  # s
    sample: int = 0  # index of the next sample
    crossings: int = 0  # singular positions passed so far


class SavedState(NamedTuple):
    """The state of a run at a saved time."""

    instant: Instant
    coordinates: Annotated[Vector, "7*nb"]
    velocities: Annotated[Vector, "n"]
    angles: Annotated[Vector, "angles"]


class Crossings(NamedTuple):
    """Singular positions passed since the last request: times (s) and states, in the first rows."""

    time: Annotated[Vector, "kept"]
    coordinates: Annotated[Matrix, "kept", "7*nb"]
    velocities: Annotated[Matrix, "kept", "n"]


class StepStart(NamedTuple):
    """Start of a series: values and rates of the variables, and angles of joints."""

    terms: Annotated[Matrix, 2, "lanes"]
    angles: Annotated[Vector, "angles"]


class TurnWatch(NamedTuple):
    """Rotation since angles of joints and signs of quaternions were computed."""

    unseen: float = 0.0  # rad, a bound for each body


class Turns(NamedTuple):
    """Bounds of the bodies' rotations (``mbref.taylor.turning``)."""

    watch: TurnWatch
    weights: Annotated[Vector, "lanes"]  # largest rate of a body's rotation / rate of a variable
    squares: Annotated[Vector, "lanes"]  # of one body, while weights are computed


class Waiting(NamedTuple):
    """Samples whose accelerations and multipliers are computed after the steps of a call."""

    state: Annotated[Matrix, "k", "3*lanes"]  # variables and their two derivatives
    angles: Annotated[Matrix, "k", "angles"]  # rad, up to MOST_TURN of each body from the sample
    coordinates: Annotated[Matrix, "k", "7*nb"]  # whose quaternions are of a rotation up to MOST_TURN away
    exact: Annotated[Indices, "k"]  # 1 for a high-accuracy step near a singular position


class TaylorMemory(NamedTuple):
    """Memory of all kernels of the method."""

    run: Memory  # of the simulation: samples, counts, limits, and the general kernels
    polynomials: Polynomials
    pose_maps: PoseMaps
    series: Series
    solver: Solver
    options: SeriesOptions
    mode: Mode
    partition: Partition
    step: Step
    progress: Progress
    distance: SingularDistance
    kernels: SeriesKernels
    code: SceneCode
    crossing_start: SavedState  # state from which the last long crossing started
    crossing_result: SavedState  # state at which the last long crossing ended
    step_start: StepStart
    series_start: StepStart  # of the present series, saved while samples are completed
    crossings: Crossings
    branch_switches: Annotated[Indices, "branch_switches"]  # crossings left along another branch
    crossing_end: Annotated[Matrix, 2, "lanes"]  # values and rates of the variables at the end of a crossing
    state: Annotated[Matrix, 3, "lanes"]  # variables and their two derivatives at some time
    pose: Annotated[Matrix, 3, "12*nb"]
    turns: Turns
    waiting: Waiting
    before_samples: SavedState  # the state of the run while samples are completed


SERIES = Named(TaylorMemory)
BEGIN = TAKE_STEP = PARTITION = RESPOND = TERMS = CORRECT = SAMPLE = INT(SERIES)
SAVE_SERIES = RETURN_TO_START = RECORD_CROSSINGS = INT(SERIES)
JUDGE_START = INT(INT, SERIES)  # arguments: status
TURNING_PIVOT = FLOAT(FLOAT, SERIES)  # arguments: length of the step (s)
DETECT = INT(FLOAT, FLOAT, SERIES)  # arguments: length of the step (s), least pivot at its end
EXPAND = INT(FLOAT, SERIES)  # arguments: t
BALANCE = EXPAND  # arguments: t
GRADIENT = INT(MATRIX, SERIES)  # arguments: variables
DETERMINANT = pair_of(BOOLEAN, FLOAT)(MATRIX, SERIES)  # arguments: variables
