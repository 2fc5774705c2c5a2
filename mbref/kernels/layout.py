"""The scene and the working memory as tuples of arrays: what every kernel takes.

``ints`` and ``floats`` hold the scene; no kernel changes them.  ``work`` holds what an evaluation produces.
The names below are the positions in these tuples and the columns of their tables.
Columns of the velocity vector: 6 per body, (r', ω') with ω' in the body's principal frame; of the
coordinate vector: 7 per body, (r, Euler parameters).  Body ``nb`` is the fixed frame.
"""

from __future__ import annotations

from numba import types

from mbref.kernels.compilation import FLOAT, INDEX_TABLE, INDICES, INT, MATRIX, VECTOR, pointer_to

# ints
PRIMITIVES = 0  # (primitives, 5): kind, first body, second body, driver or -1, first row
ROW_BODIES = 1  # (rows, 2): the two bodies of each row, nb for the fixed frame
LOADS = 2  # (loads, 4): kind, first body, second body, index of its unwrapped angle
LIVE = 3  # (2, ·): the entries of y, see below
# floats
BODIES = 0  # (nb, 4): mass and principal moments
GEOMETRY = 1  # (primitives, 16): see the columns below
DRIVERS = 2  # (drivers, 3 + degree + 1): amplitude, frequency, phase, polynomial
LOAD_DATA = 3  # (loads, 15): points or axes, then constants
GRAVITY = 4  # (1, 3)
# work
FRAMES = 0  # (nb + 1, 18): position 3, rotation matrix 9 by rows, velocity 3, body-fixed angular velocity 3
JACOBIAN = 1  # (rows, 12): the blocks of both bodies
ROWS = 2  # (6, rows): see the rows below
COLUMNS = 3  # (5, 6 nb): see the rows below
STATE = 4  # (4, 7 nb): what the chart last made of its coordinates, see the rows below
LAST = 5  # (4, 7 nb): STATE at the last accepted step
DENSE = 6  # a matrix for the chart, and the table of extrapolations
DENSE_VECTORS = 7  # (8, ·) vectors for the chart
SCRATCH = 8  # (1, ·) memory of the formulation
ANGLES = 9  # (1, torsion springs): unwrapped angle at the last accepted step
PHI_Q = 10  # (rows, 6 nb): the dense constraint Jacobian
MEMO = 11  # (1, 4): what a chart remembers between steps, see below

PHI, NU, GAMMA, PHI_RATE, RHS, MULTIPLIERS = range(6)  # rows of ROWS
FORCE, ACCELERATION, MASS, INVERSE_ROOT, STEP_X = range(5)  # rows of COLUMNS
COORDINATES, VELOCITIES, COORDINATE_RATES, COORDINATE_SECOND = range(4)  # rows of STATE and LAST
LAST_TIME, REFERENCE_PIVOT, SMALLEST_PIVOT, GENERIC_RANK = range(4)  # entries of MEMO
ROW_ORDER, COLUMN_ORDER, SIZES, CHART_PIVOTS, FORMULATION_PIVOTS = range(5)  # rows of pivots

# ints[LIVE][0]: how many coordinates and velocities y has, and where the pieces of machine code of the
# scene's own are (see specialised/chart.py).  ints[LIVE][1]: which coordinates, then which velocities
MOVING, TURNING, RATES_CODE, PROJECT_CODE = range(4)

POSITION, ROTATION, VELOCITY, OMEGA = 0, 3, 12, 15  # columns of FRAMES
POINT_I, POINT_J, U_I, W_I, U_J, LENGTH = 0, 3, 6, 9, 12, 15  # columns of GEOMETRY
POINT, DOT1, DOT2, DISTANCE = range(4)  # kinds of primitives
MOMENT, FORCE_AT_POINT, SPRING, TORSION_SPRING = range(4)  # kinds of loads

# control, an array of floats: what the loop is to keep to
(
    ORDER, FIXED_STEP, SMALLEST_STEP, LARGEST_STEP, LARGEST_TURN, VIOLATION, MOST_STEPS, STEPS_PER_CALL,
    FORCED_STEP, FIRST_STEP,
) = range(10)  # fmt: skip

# counts, an array of integers that kernels add to
STEPS, REJECTED, EVALUATIONS, FACTORISATIONS, NEWTON, CROSSINGS = range(6)

# settings, an array of floats
VELOCITY_GAIN, POSITION_GAIN, RANK_TOLERANCE, NEWTON_TOLERANCE, KEPT_PARTITION = range(5)
FORMULATION_OPTIONS = 5  # a formulation's own numbers start here

# status of an evaluation or of a step
OK, SINGULAR, NOT_CONVERGED, NOT_FINITE = range(4)
CHANGED, HANDOVER = 4, 5  # the chart chose new coordinates; its rates leave the state to the careful ones

INTS = types.UniTuple(INDEX_TABLE, 4)
FLOATS = types.UniTuple(MATRIX, 5)
WORK = types.UniTuple(MATRIX, 12)
# pivots (5, ·), an index table: orders and exchanges; pivots[SIZES] = rank (of partitioning) and length of y
PROBLEM = INDEX_TABLE  # all of these, settings and counts behind one argument: see problem.py

# signatures of the exchangeable kernels
ACCELERATE = INT(VECTOR, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, INDICES, INDICES, VECTOR, VECTOR)
ENTER = INT(FLOAT, VECTOR, PROBLEM)
RATES = INT(pointer_to(ACCELERATE), FLOAT, VECTOR, VECTOR, PROBLEM)
ACCEPT = INT(FLOAT, VECTOR, PROBLEM)
STEP = FLOAT(
    pointer_to(RATES), pointer_to(ACCELERATE), FLOAT, FLOAT, VECTOR, VECTOR, VECTOR, MATRIX, VECTOR, PROBLEM
)  # fmt: skip
PROPOSE = FLOAT(FLOAT, FLOAT, FLOAT, VECTOR, VECTOR, MATRIX, VECTOR, VECTOR)
