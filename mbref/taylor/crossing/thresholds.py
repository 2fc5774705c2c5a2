"""All thresholds at singular positions in one table: name, value, unit or relative quantity, and reason.

A pivot is a pivot of the constraint gradient G, whose rows have about unit length; the least pivot of a
factorisation is about the distance from a singular position.  "Largest pivot" is the largest value that the
least pivot has had in a run.
"""

from __future__ import annotations

from math import log

# --- detection ------------------------------------------------------------------------------------------
PIVOT_NEAR = 0.3  # pivot / largest pivot: a step that starts or ends nearer is tested more strictly
PIVOT_AHEAD = 0.03  # pivot / largest pivot: errors of nearer regular steps would change directions
PIVOT_SLOPE = 1.5  # pivot / distance moved: a larger pivot cannot have vanished in the step
PART_LENGTH = 0.5  # part / scene's length: rows may turn by a right angle in a longer part
MAX_PARTS = 8  # parts: a step is at most a few turns long
MONOTONE_PARTS = 4  # parts: in fewer, rates turn by less than a right angle, and their signs suffice
LOG_LEVEL = log(0.5)  # log(det / larger end): two zeros leave less at one of two golden sections
LOG_DIP = log(0.2)  # log(det / smaller end): a zero of a linear pivot leaves less
LOG_DIP_COARSE = -2.0  # log(det / ends) after the coarse search: above it there is no zero
LOG_ZERO = -30.0  # log(det / ends): a determinant that vanishes to rounding is below
# --- location -------------------------------------------------------------------------------------------
SECTIONS_COARSE = 12  # golden sections: they reduce the interval to 3e-3
SECTIONS = 70  # golden sections: they reduce the interval to rounding
INTERPOLATIONS = 12  # evaluations: usually six; a multiple root needs bisection
BISECTIONS = 45  # evaluations: they reduce the interval to rounding
LOCATION_ERROR = 1e-13  # error of a reported time / step: rounding
POLE_BRACKET = 1e-6  # half width / time of the pole: the position is searched so near the pole
PAIR_OFFSET = 1e-5  # distance / step: nearer crossings are reported as one
PAIR_DEPTH = 1e-11  # det / det at the start: a smaller negative value is rounding
# --- steps that cross -----------------------------------------------------------------------------------
CROSSING_START = 0.6  # part of the step, pivot / largest pivot: a step from there ends clear behind
CROSSING_NOISE = 4e-15  # last terms × relative distance: rounding of a crossing step
CROSSING_MARGIN = 1.05  # step / time to the position: a crossing step ends behind the position
OVERSHOOT = 1.25  # next attempt / time to the position: it ends clearly behind the position
LOOSER_RATES = 1e4  # tolerance of rates / of positions: rates lose more digits in short steps
LONG_CROSSING_ORDER = 16  # order of long crossings: higher orders magnify rounding
PIVOT_CLEAR = 0.09  # pivot / largest pivot: from here regular steps do not stop again at once
# --- acceptance -----------------------------------------------------------------------------------------
VIOLATION_FLOOR = 1e-15  # scene units: violation by rounding of the rows
VIOLATION_NEAR = 1e-14  # violation / relative distance: a wider gap is detected by a step near it
VIOLATION_ACROSS = 1e-13  # scene units: a step across a gap violates the rows by the gap
VIOLATION_LEFT = 2.0  # violation at the end / start of a step: corrections do not reduce it in dependent rows
TIME_ROUNDING = 3e-16  # violation / (time × speed): drivers are evaluated at a rounded time
MIN_PIVOT_RATIO = 0.2  # pivot at the end / start: below it the next step loses accuracy
MIN_PIVOT_RATIO_ACROSS = 0.05  # pivot at the end / start of a crossing step: a step below it starts nearer
ROUNDED_MOTION = 30.0  # error of accelerations at the end of a run / its estimate: rounding explains it
MAX_SHIFT = 0.05  # correction / pivot at the end: a larger one may change the branch
MIN_PIVOT = 1e-9  # pivot / largest pivot: rounding 1e-16 / pivot² exceeds every velocity below it
MIN_PIVOT_ACROSS = 1e-6  # pivot / largest pivot: rounding decides crossings that start nearer
MIN_PIVOT_FREE = 2.5e-8  # pivot of unit rows: square root of a gap that rounding of lengths may open or close
MIN_PIVOT_RESOLVED = 1e-7  # pivot of unit rows: rounding 1e-16 / pivot² turns a velocity by 1e-2
ENTRY_RATIO = 0.5  # pivot / pivot before the crossing: a motion that moves away is accepted
# --- uniqueness -----------------------------------------------------------------------------------------
MIN_ENERGY = 0.02  # kinetic energy / its value before the crossing: a slower motion may turn back
BOUND_MARGIN = 0.5  # fraction of the bound: the rest is for the error of Simpson's rule
MAX_SHORT_STEPS = 6  # steps: a short crossing that takes more is replaced by a long one
MIN_CHANGE = 1e-9  # perturbation / velocities: a smaller one is hidden by rounding
MAX_GAIN = 100.0  # final / initial perturbation: above it the continuation is not determined
MAX_APART = 1e-2  # scene lengths or rad: largest distance of two runs on one branch
STRICTER = 0.1  # factor on the limit: both runs count different crossings
RATE_FACTOR = 10.0  # factor on the limit: velocities differ more than positions
# --- rounding pole --------------------------------------------------------------------------------------
MIN_SERIES_ORDER = 10  # order: a lower one does not separate a pole from the motion
PURE_POLE = 1e-3  # relative deviation of the last terms from a geometric series: below it, a pole
MAX_GAP = 3e-16  # gap of unit rows: rounding of the state explains a smaller one
POLE_GROWTH = 0.25  # growth of the pole / of the terms in two orders: faster growth is rounding
POLE_ORDERS = 3  # orders: the highest ones estimate the pole and are then discarded
MIN_ORDER_LEFT = 4  # order: a step needs at least this one
MIN_GAIN = 0.5  # step without the pole / with it: otherwise too many orders are lost
# --- start ----------------------------------------------------------------------------------------------
START_ERROR = 2e-7  # scene lengths, rad, or / fastest velocity: largest error of the start
START_ERROR_DRIVEN = 0.05  # velocity error / fastest velocity: drivers hold a motion whose start is rounded
START_REST = 1e-9  # speed / fastest speed of drivers: a driven motion with less starts from rest
REST_PIVOT = 5e-6  # pivot of unit rows: below it, rounding turns a motion from rest by 1e-5
REST_TURN = 3e-8  # change of direction / √pivot: rounding turns a motion from rest by less
# --- departure along a branch ---------------------------------------------------------------------------
DEPARTURE = 3e-3  # scene lengths or rad: distance behind the crossing at which a branch is entered
DEPARTURE_CORRECTIONS = 6  # iterations: each multiplies the error by DEPARTURE
DEPARTURE_PIVOT = 0.02  # pivot / distance: smaller pivots belong to dependent rows
