"""The memory of a simulation: every array and number that kernels share, by name, with shapes and units.

Sizes: nb bodies, n = 6 nb velocities, m constraint rows, k sample times.
Velocities are (r', ω') per body, ω' in the body's principal frame; coordinates are (r, Euler parameters).
Body ``nb`` is the fixed frame.  Units are SI.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from mbref.kernels.compilation import FLOAT, INT, VECTOR, pointer_to
from mbref.kernels.named_memory import (
    Address,
    Indices,
    Kernel,
    Matrix,
    Named,
    Unsigned,
    Vector,
)
from mbref.kernels.scene_layout import SceneData

# status of an evaluation or of a step
OK, SINGULAR, NOT_CONVERGED, NOT_FINITE = range(4)
CHANGED, SINGULAR_AHEAD = (
    4,
    5,
)  # status: the chart chose new coordinates; the rank drops inside the step or at its end


class Frames(NamedTuple):
    """World positions, rotation matrices by rows, world velocities, body-fixed angular velocities."""

    position: Annotated[Matrix, "nb + 1", 3]
    rotation: Annotated[Matrix, "nb + 1", 9]
    velocity: Annotated[Matrix, "nb + 1", 3]
    angular_velocity: Annotated[Matrix, "nb + 1", 3]


class Rows(NamedTuple):
    """Per constraint row: Φ, ν and γ of Eqs. 1 to 3 and Φ' = Φ_q v - ν."""

    phi: Annotated[Vector, "m"]
    nu: Annotated[Vector, "m"]
    gamma: Annotated[Vector, "m"]
    phi_rate: Annotated[Vector, "m"]


class Settings(NamedTuple):
    """Numbers of a method: gains of Φ' and Φ in the right-hand side (Eq. 9), tolerances."""

    velocity_gain: float = 0.0
    position_gain: float = 0.0
    rank_tolerance: float = 1e-10
    newton_tolerance: float = 1e-13
    stuck: float = 1e-10  # violation below which iterations may fail to reduce it further; m or rad
    rounding: float = 1e-15  # violation of positions below which they are not corrected
    independent: int = 0  # 1 if rows with small singular values are known to be independent
    # squared pivot of unit rows above which one solution for the accelerations suffices, without refinement
    clear_pivot: float = 0.08
    nearly_dependent: int = 0  # 1 if rows are nearly dependent at the start, as with two tilted hinges


class OperationCounts(NamedTuple):
    """Counts of operations."""

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    factorisations: int = 0
    newton: int = 0
    crossings: int = 0


class System(NamedTuple):
    """M q̈ + Φ_qᵀ λ = g, Φ_q q̈ = rhs: all that a formulation reads, and the accelerations and multipliers
    that it writes.

    The constraint Jacobian stands as the blocks of the columns of each row's bodies, or as a dense matrix, or
    both: ``Formulation.is_sparse`` says which form a formulation reads.
    """

    mass: Annotated[Vector, "n"]  # diagonal of M
    inverse_root: Annotated[Vector, "n"]  # M^(-1/2); 1 where the mass is zero
    force: Annotated[Vector, "n"]  # g
    acceleration: Annotated[Vector, "n"]  # q̈
    blocks: Annotated[Matrix, "m", "width"]  # width: 6 per body of a row, or n for a dense matrix
    jacobian: Annotated[Matrix, "dense_rows", "n"]
    rhs: Annotated[Vector, "m"]
    multipliers: Annotated[Vector, "m"]  # λ
    settings: Settings
    counts: OperationCounts
    options: Address  # the formulation's own numbers
    scratch: Address  # the formulation's own memory


class Equations(NamedTuple):
    """Memory of one evaluation."""

    scene: SceneData
    frames: Frames
    rows: Rows
    system: System
    angles: Annotated[
        Vector, "angles"
    ]  # rad, of turning joints at the last accepted step, full turns counted
    angle_rates: Annotated[Vector, "angles"]  # rad/s, at the last accepted step of an explicit integrator
    piece: Annotated[Indices, "f"]  # index of the interval in use, for each piecewise function of time


class State(NamedTuple):
    """State: q, v, q' and q''."""

    coordinates: Annotated[Vector, "7*nb"]
    velocities: Annotated[Vector, "n"]
    coordinate_rates: Annotated[Vector, "7*nb"]
    coordinate_second: Annotated[Vector, "7*nb"]


class Active(NamedTuple):
    """Which entries of q and of v are integrated: y = (q[coordinates], v[velocities])."""

    coordinates: Annotated[Unsigned, "active_coordinates"]
    velocities: Annotated[Unsigned, "active_velocities"]


LINK = 2**32 - 1  # in place of the index of a row that links copies of a body (``linear_algebra.hubs``)


class Symbolic(NamedTuple):
    """Positions of all numbers of D, S = D Dᵀ and its factor L; r rows and c columns are in the
    factorisation."""

    row: Annotated[Unsigned, "r"]  # index in the system of each row, in the order of elimination; or LINK
    column: Annotated[Unsigned, "c"]  # index in the system of each column; copies of a body have equal ones
    link: Annotated[Unsigned, "links"]  # entries of D in rows that link copies, in pairs
    d_start: Annotated[Unsigned, "r + 1"]  # first entry of each row of D = Φ_q M^(-1/2)
    d_entry: Annotated[Unsigned, "nd"]  # index of each entry of D in the constraint Jacobian
    d_column: Annotated[Unsigned, "nd"]
    s_entry: Annotated[Unsigned, "products"]  # place in L of the number of S to which each product is added
    s_left: Annotated[Unsigned, "products"]  # the products: two numbers of D
    s_right: Annotated[Unsigned, "products"]
    l_start: Annotated[Unsigned, "r + 1"]  # first entry of each column of L, its diagonal element
    l_row: Annotated[Unsigned, "nl"]
    # first column of each panel: a column of L, or two neighbours with the same rows below both
    panel: Annotated[Unsigned, "panels + 1"]
    update: Annotated[Unsigned, "updates"]  # entry of L that each pair of rows below a panel changes


class SparseFactor(NamedTuple):
    """D = Φ_q M^(-1/2) and the factor L Δ Lᵀ of S + I/α over the rows and columns of ``symbolic``."""

    symbolic: Symbolic
    d: Annotated[Vector, "nd"]
    l: Annotated[Vector, "nl"]
    scaled: Annotated[Vector, "nl"]  # L Δ, below the diagonal
    diagonal: Annotated[Vector, "r"]  # S_ii (1 + 1/α)
    squared_pivots: Annotated[Vector, "r"]
    residual: Annotated[Vector, "r"]
    step: Annotated[Vector, "r"]
    total: Annotated[Vector, "r"]
    direction: Annotated[Vector, "r"]
    root: Annotated[Vector, "c"]  # M^(-1/2)
    share: Annotated[Vector, "c"]  # 1 / number of copies of the body
    change: Annotated[Vector, "c"]


class Control(NamedTuple):
    """Limits of the stepping loop."""

    order: float  # of the integrator
    fixed_step: float  # s; 0 for an adaptive integrator
    smallest_step: float  # s
    largest_step: float  # s
    largest_turn: float  # rad that a body may turn in a step
    violation: float  # largest |Φ| (m or rad)
    rate: float  # largest |Φ'| / sum of the sizes of its terms, in scenes with rolling wheels
    rate_share: float  # of the largest such sum: a smaller sum counts as much
    rest: float  # m/s and rad/s; smaller |Φ'| are rounding
    most_steps: float
    steps_per_call: float
    forced_step: float  # s; a step this short is taken whatever its error estimate
    first_step: float  # s; 0 if the integrator chooses it
    rtol: float
    atol: float
    closed_loops: float  # number of closed loops; without loops no position is singular


class Watch(NamedTuple):
    """The smallest pivot of Φ_q that a chart monitors, and its value at the last accepted state."""

    smallest_pivot: float = 0.0
    past_pivot: float = 0.0  # smallest_pivot at the last accepted state
    nearest: float = 1.0  # least value of smallest_pivot so far, over the reference at that time
    reference_pivot: float = 0.0  # largest value of smallest_pivot so far; 0 if nothing is monitored
    generic_rank: int = 0
    regular: int = 0  # 1 if the motion does not begin at a singular position
    accepted_time: float = 0.0  # s
    angle_time: float = 0.0  # s, of the angles of joints
    # position of the singular position in the last step, as a fraction of the step
    singular_part: float = 0.0


class Clock(NamedTuple):
    """Time and step lengths of the stepping loop."""

    time: float = 0.0  # s
    length: float = 0.0  # s, length of the last step
    suggested: float = 0.0  # s, length of the last step before sample times limited it
    ratio: float = 0.0  # error of the last step over its tolerance
    past_length: float = 0.0  # s, length of the step before the last
    past_ratio: float = 0.0  # error / tolerance of the step before the last
    share: float = 1.0  # factor on rtol and atol (``stepping.loop.share``)
    y_size: int = 0  # length of y
    sample: int = 0  # index of the next sample
    restart: int = 0  # first step of the present smooth piece of the motion
    attempt_end: float = 0.0  # s, end of the step that reaches a singular position
    violated_row: int = -1


class Samples(NamedTuple):
    """States, accelerations, multipliers and angles of joints (rad, turns counted) at the sample times."""

    coordinates: Annotated[Matrix, "k", "7*nb"]
    velocities: Annotated[Matrix, "k", "n"]
    accelerations: Annotated[Matrix, "k", "n"]
    multipliers: Annotated[Matrix, "k", "m"]
    angles: Annotated[Matrix, "k", "angles"]


class Ends(NamedTuple):
    """Both ends of a step of a run that monitors pivots, and the product of their constraint gradients."""

    gradient: Annotated[Vector, "watched_entries"]  # D of ``SparseFactor`` at the start of the step
    squared_pivots: Annotated[Vector, "watched_rows"]  # at the start of the step
    lower: Annotated[Vector, "watched_numbers"]  # lower factor of ``sparse_lu.factorise_product``
    upper: Annotated[Vector, "watched_numbers"]
    pivots: Annotated[Vector, "watched_rows"]
    past_pivots: Annotated[Vector, "watched_rows"]  # at the start of a part of the step; their signs count
    alone: Annotated[Vector, "watched_rows"]  # pivots that change sign without a partner, below each row
    rates: Annotated[Matrix, 2, "7*nb"]  # q' at both ends
    pose: Annotated[Vector, "7*nb"]  # inside the step


class Loop(NamedTuple):
    """Memory of the stepping loop."""

    times: Annotated[Vector, "k"]
    samples: Samples
    clock: Clock
    y: Annotated[Vector, "14*nb"]
    y_rate: Annotated[Vector, "14*nb"]
    y_new: Annotated[Vector, "14*nb"]
    ends: Ends


class Kernels(NamedTuple):
    """The kernels of a run that the stepping loop receives as arguments: formulation, chart and
    integrator."""

    step: Annotated[Kernel, STEP]
    propose: Annotated[Kernel, PROPOSE]
    rates: Annotated[Kernel, RATES]
    rates_with_outputs: Annotated[Kernel, RATES]
    accept: Annotated[Kernel, ACCEPT]
    accelerate: Annotated[Kernel, ACCELERATE]


class Memory(NamedTuple):
    """Everything that kernels share."""

    equations: Equations  # of steps
    state: State
    previous: State  # at the last accepted step
    active: Active
    factor: SparseFactor
    control: Control
    watch: Watch
    pivots: Annotated[Vector, "pivots"]  # pivot of every row at the last test
    loop: Loop
    kernels: Kernels
    chart: Address  # the stabilisation's own memory
    chart_options: Address  # parameters of the chart
    integrator: Address  # the integrator's own memory
    # Equations and SparseFactor of samples, with rows that only carry reactions (``equations.planes``)
    sampled: Address
    balance: Address


MEMORY, SYSTEM = Named(Memory), Named(System)
EQUATIONS = Named(Equations)

# signatures of the kernels that other kernels receive as arguments
ACCELERATE = INT(SYSTEM)
ENTER = INT(FLOAT, VECTOR, MEMORY)  # t, y
RATES = INT(FLOAT, VECTOR, VECTOR, MEMORY)  # t, y, y'
ACCEPT = INT(FLOAT, VECTOR, MEMORY)  # t, y
STEP = FLOAT(pointer_to(RATES), FLOAT, FLOAT, VECTOR, VECTOR, VECTOR, MEMORY)  # rates, t, h, y, y', y_new
PROPOSE = FLOAT(FLOAT, FLOAT, FLOAT, VECTOR, VECTOR, MEMORY)  # h, suggested, ratio, y, y'
