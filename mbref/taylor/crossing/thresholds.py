"""All thresholds at singular positions in one table: name, value, unit or relative quantity, and reason.

A pivot is a pivot of the constraint gradient G, whose rows have about unit length; the least pivot of a
factorisation is about the distance from a singular position.  "Largest pivot" is the largest value that the
least pivot has had in a run.  A check of each name in ``tests/mbref/interpreted_thresholds.py`` fails when
the threshold moves; ``benchmarks/thresholds.py`` moves them and shows which runs of a sweep change.
"""

from __future__ import annotations

from math import log

# --- detection ------------------------------------------------------------------------------------------
PIVOT_NEAR = 0.3  # of the largest pivot: a step that starts or ends nearer is judged more strictly
PIVOT_AHEAD = 0.03  # of the largest pivot: nearer, errors of regular steps would turn velocities
PIVOT_SLOPE = 1.5  # of the distance moved: unit rows change by about it, larger pivots have not vanished
PART_LENGTH = 0.5  # of the scene's length: rows may turn by a right angle in a longer part
MAX_PARTS = 8  # parts: a step is at most a few turns long
MONOTONE_PARTS = 4  # parts: in fewer the rates turn by less than a right angle, and decide
LOG_LEVEL = log(0.5)  # of the larger end: a pair of zeros leaves less at one of two golden sections
LOG_DIP = log(0.2)  # of the smaller end: a linear pivot leaves less of the determinant at its zero
LOG_DIP_COARSE = -2.0  # logarithm of a ratio: larger after the coarse search means no zero
LOG_ZERO = -30.0  # logarithm of a ratio: rounding of a determinant that vanishes
# --- location -------------------------------------------------------------------------------------------
SECTIONS_COARSE = 12  # sections: reduce the interval to 3e-3
SECTIONS = 70  # sections: reduce the interval to rounding
INTERPOLATIONS = 12  # evaluations: six are usual; a multiple root needs bisection
BISECTIONS = 45  # evaluations: reduce the interval to rounding
LOCATION_ERROR = 1e-13  # of the step: rounding of the time that is reported
POLE_BRACKET = 1e-6  # of the time of the pole: error of the time of the position found there
PAIR_OFFSET = 1e-5  # of the step: crossings that are nearer are reported as one
PAIR_DEPTH = 1e-11  # of the determinant at the start: a smaller negative value is rounding
# --- steps that cross -----------------------------------------------------------------------------------
CROSSING_START = 0.6  # of the step and of the largest pivot: from there a step ends clear of the position
CROSSING_NOISE = 4e-15  # over the relative distance: rounding of the last terms of a step that crosses
CROSSING_MARGIN = 1.05  # of the time to the position: a step that crosses ends behind it
OVERSHOOT = 1.25  # of the time to the position: the next attempt ends clearly behind it
LOOSER_RATES = 1e4  # of the tolerance: rates lose more than positions in short steps
LONG_CROSSING_ORDER = 16  # order: higher orders magnify rounding more
PIVOT_CLEAR = 0.09  # of the largest pivot: regular steps that follow do not stop again at once
# --- acceptance -----------------------------------------------------------------------------------------
VIOLATION_FLOOR = 1e-15  # units of the scene: rounding of the rows
VIOLATION_NEAR = 1e-14  # times the relative distance: a wider gap shows in a step near it
VIOLATION_ACROSS = 1e-13  # units of the scene: a series straight across a gap violates rows by the gap
VIOLATION_LEFT = 2.0  # of the violation at the start: dependent rows keep what a correction leaves
TIME_ROUNDING = 3e-16  # of time and speed: drivers are evaluated at a rounded time
MIN_PIVOT_RATIO = 0.2  # of the pivot at the start: a step that ends deeper makes the next less accurate
MIN_PIVOT_RATIO_ACROSS = 0.05  # of the pivot at the start: a step ends as far behind, or is repeated nearer
MAX_SHIFT = 0.05  # of the pivot at the end: a correction as large as the distance may change the branch
MIN_PIVOT = 1e-9  # of the largest pivot: rounding 1e-16 over its square exceeds every velocity
MIN_PIVOT_ACROSS = 1e-6  # of the largest pivot: a step that starts nearer crosses by rounding
MIN_PIVOT_FREE = 2.5e-8  # unit rows: root of the gap that rounding of lengths may open or close
MIN_PIVOT_RESOLVED = 1e-7  # unit rows: rounding 1e-16 over its square turns a velocity by 1e-2
ENTRY_RATIO = 0.5  # of the pivot at entry: a motion that leaves is not refused for its start
# --- uniqueness -----------------------------------------------------------------------------------------
MIN_ENERGY = 0.02  # of the kinetic energy at entry: a slower motion may turn back
BOUND_MARGIN = 0.5  # of the bound: error of Simpson's rule
MAX_SHORT_STEPS = 6  # steps: a crossing that needs more is a long one
MIN_CHANGE = 1e-9  # of the velocities: a smaller perturbation drowns in rounding
MAX_GAIN = 100.0  # of the perturbation: a crossing that magnifies more is not determined
MAX_APART = 1e-2  # scene lengths or rad: largest distance of two runs on one branch
STRICTER = 0.1  # of the limit: runs that count different crossings may be on different branches
RATE_FACTOR = 10.0  # of the limit: velocities differ more than positions near a position
# --- rounding pole --------------------------------------------------------------------------------------
MIN_SERIES_ORDER = 10  # order: fewer do not separate a pole from the motion
PURE_POLE = 1e-3  # relative: last terms that are geometric to this accuracy are a pole alone
MAX_GAP = 3e-16  # unit rows: gap that rounding of the state explains
POLE_GROWTH = 0.25  # of the growth of the pole in two orders: terms that grow faster are rounding
POLE_ORDERS = 3  # orders: spent on the estimate of the pole
MIN_ORDER_LEFT = 4  # order: the least that steps can use
MIN_GAIN = 0.5  # of the step with the pole: a shorter step without it has lost too many orders
# --- start ----------------------------------------------------------------------------------------------
START_ERROR = 2e-7  # scene lengths, rad, fastest velocity: a start without rounding trouble agrees to 1e-9
START_ERROR_DRIVEN = 0.05  # of the fastest velocity: drivers hold a motion whose start is rounded
REST_PIVOT = 5e-6  # unit rows: nearer, rounding turns a motion from rest by 1e-5
REST_TURN = 3e-8  # times √pivot: turn of a motion from rest by rounding, of its speed
# --- departure along a branch ---------------------------------------------------------------------------
DEPARTURE = 3e-3  # scene lengths or rad: where another branch is entered behind a crossing
DEPARTURE_CORRECTIONS = 6  # iterations: each reduces the error by the distance
DEPARTURE_PIVOT = 0.02  # of the distance: smaller pivots are of rows that depend on others
