"""All thresholds at singular positions, in one table:  ``TABLE`` has the unit, the reason and the guard of
each.

A pivot is a pivot of the constraint gradient G, whose rows have about unit length; the least pivot of a
factorisation is about the distance from a singular position.  "Largest pivot" is the largest value that the
least pivot has had in a run.
"""

from __future__ import annotations

from math import log
from typing import NamedTuple

# --- detection ------------------------------------------------------------------------------------------
PIVOT_NEAR = 0.3
PIVOT_AHEAD = 0.03
PIVOT_SLOPE = 1.5
PART_LENGTH, MAX_PARTS = 0.5, 8
MONOTONE_PARTS = 4
LOG_LEVEL = log(0.5)
LOG_DIP = log(0.2)
LOG_DIP_COARSE = -2.0
LOG_ZERO = -30.0
# --- location -------------------------------------------------------------------------------------------
SECTIONS_COARSE, SECTIONS = 12, 70
INTERPOLATIONS, BISECTIONS = 12, 45
LOCATION_ERROR = 1e-13
POLE_BRACKET = 1e-6
PAIR_OFFSET = 1e-5
PAIR_DEPTH = 1e-11
# --- steps that cross -----------------------------------------------------------------------------------
CROSSING_START = 0.6
CROSSING_NOISE = 4e-15
CROSSING_MARGIN = 1.05
OVERSHOOT = 1.25
LOOSER_RATES = 1e4
LONG_CROSSING_ORDER = 16
PIVOT_CLEAR = 0.09
# --- acceptance -----------------------------------------------------------------------------------------
VIOLATION_FLOOR = 1e-15
VIOLATION_NEAR = 1e-14
VIOLATION_ACROSS = 1e-13
VIOLATION_LEFT = 2.0
TIME_ROUNDING = 3e-16
MIN_PIVOT_RATIO = 0.2
MIN_PIVOT_RATIO_ACROSS = 0.05
MAX_SHIFT = 0.05
MIN_PIVOT = 1e-9
MIN_PIVOT_ACROSS = 1e-6
MIN_PIVOT_FREE = 2.5e-8
MIN_PIVOT_RESOLVED = 1e-7
ENTRY_RATIO = 0.5
# --- uniqueness -----------------------------------------------------------------------------------------
MIN_ENERGY = 0.02
BOUND_MARGIN = 0.5
MAX_SHORT_STEPS = 6
MIN_CHANGE = 1e-9
MAX_GAIN = 100.0
MAX_APART = 1e-2
STRICTER = 0.1
RATE_FACTOR = 10.0
# --- rounding pole --------------------------------------------------------------------------------------
MIN_SERIES_ORDER = 10
PURE_POLE = 1e-3
MAX_GAP = 3e-16
POLE_GROWTH = 0.25
POLE_ORDERS = 3
MIN_ORDER_LEFT = 4
MIN_GAIN = 0.5
# --- start ----------------------------------------------------------------------------------------------
START_ERROR = 2e-7
START_ERROR_DRIVEN = 0.05
REST_PIVOT = 5e-6
REST_TURN = 3e-8
# --- departure along a branch ---------------------------------------------------------------------------
DEPARTURE = 3e-3
DEPARTURE_CORRECTIONS = 6
DEPARTURE_PIVOT = 0.02


class Threshold(NamedTuple):
    """A threshold: its name, the unit or quantity that it is relative to, and the reason for its value."""

    name: str
    unit: str
    reason: str


TABLE = (
    Threshold(
        "PIVOT_NEAR",
        "of the largest pivot",
        "a step that starts or ends nearer is near a singular position: it is judged more strictly",
    ),
    Threshold(
        "PIVOT_AHEAD",
        "of the largest pivot",
        "a regular step that ends nearer gives way to high-accuracy steps, before its error turns velocities",
    ),
    Threshold(
        "PIVOT_SLOPE",
        "of the distance moved",
        "unit rows change by about the distance that variables move: larger pivots have not vanished",
    ),
    Threshold(
        "PART_LENGTH",
        "of the scene's length",
        "rows may turn by a right angle in a longer part, which changes the sign of the determinant too",
    ),
    Threshold("MAX_PARTS", "parts", "a step is at most a few turns long"),
    Threshold(
        "MONOTONE_PARTS",
        "parts",
        "in fewer parts the rates turn by less than a right angle, and their direction decides",
    ),
    Threshold(
        "LOG_LEVEL",
        "logarithm of a ratio",
        "a determinant that vanishes twice falls below it at one of two golden sections",
    ),
    Threshold(
        "LOG_DIP",
        "logarithm of a ratio",
        "a pivot that falls and rises linearly leaves less of the determinant where it vanishes",
    ),
    Threshold(
        "LOG_DIP_COARSE",
        "logarithm of a ratio",
        "after the coarse search a vanishing determinant is smaller; a larger one ends the search",
    ),
    Threshold(
        "LOG_ZERO", "logarithm of a ratio", "rounding of a determinant that vanishes at the end of the search"
    ),
    Threshold(
        "SECTIONS_COARSE",
        "sections",
        "reduce the interval to 3e-3, and the determinant of a simple pair to 1e-4",
    ),
    Threshold("SECTIONS", "sections", "reduce the interval to rounding"),
    Threshold(
        "INTERPOLATIONS",
        "evaluations",
        "inverse quadratic interpolation needs about six; a multiple root needs bisection",
    ),
    Threshold("BISECTIONS", "evaluations", "reduce the interval to rounding"),
    Threshold("LOCATION_ERROR", "of the step", "the time of a crossing is reported to rounding"),
    Threshold(
        "POLE_BRACKET",
        "of the time of the pole",
        "the rounding pole is at the singular position, to the accuracy of the last terms",
    ),
    Threshold("PAIR_OFFSET", "of the step", "two crossings nearer to each other are reported as one"),
    Threshold("PAIR_DEPTH", "of the determinant at the start", "a smaller negative value is rounding"),
    Threshold(
        "CROSSING_START",
        "of the step; of the largest pivot",
        "a step that starts there ends clear of the position, where pivots have recovered",
    ),
    Threshold(
        "CROSSING_NOISE",
        "times the largest pivot over the pivot",
        "rounding of the last terms of a step that crosses grows with its length over the distance",
    ),
    Threshold(
        "CROSSING_MARGIN", "of the time to the position", "a step that crosses ends behind the position"
    ),
    Threshold(
        "OVERSHOOT",
        "of the time to the position",
        "the attempt after one that came near ends clearly behind the position",
    ),
    Threshold(
        "LOOSER_RATES",
        "of the tolerance",
        "rates are less accurate than positions by the length of the step, which is short near a position",
    ),
    Threshold(
        "LONG_CROSSING_ORDER",
        "order",
        "higher orders magnify rounding more; short crossings have their own, higher order",
    ),
    Threshold(
        "PIVOT_CLEAR",
        "of the largest pivot",
        "three times PIVOT_AHEAD, so that regular steps do not stop again at once",
    ),
    Threshold("VIOLATION_FLOOR", "units of the scene", "rounding of the rows themselves"),
    Threshold(
        "VIOLATION_NEAR",
        "units of the scene, times the relative distance",
        "a gap that is wider shows in the violation of a step near it",
    ),
    Threshold(
        "VIOLATION_ACROSS",
        "units of the scene",
        "a series that goes straight on across a gap violates the rows by at least the gap",
    ),
    Threshold(
        "VIOLATION_LEFT",
        "of the violation at the start",
        "rows that depend on others keep what a correction leaves",
    ),
    Threshold("TIME_ROUNDING", "of time and speed", "drivers are evaluated at a rounded time"),
    Threshold(
        "MIN_PIVOT_RATIO",
        "of the pivot at the start",
        "a step that ends deeper makes the next one less accurate",
    ),
    Threshold(
        "MIN_PIVOT_RATIO_ACROSS",
        "of the pivot at the start",
        "a step that crosses ends as far behind as this, or is repeated from nearer",
    ),
    Threshold(
        "MAX_SHIFT", "of the pivot at the end", "a correction as large as the distance may change the branch"
    ),
    Threshold("MIN_PIVOT", "of the largest pivot", "rounding 1e-16 over its square exceeds every velocity"),
    Threshold("MIN_PIVOT_ACROSS", "of the largest pivot", "a step that starts nearer crosses by rounding"),
    Threshold(
        "MIN_PIVOT_FREE",
        "unit rows",
        "root of the gap that rounding of the lengths, 5e-16, may open or close",
    ),
    Threshold("MIN_PIVOT_RESOLVED", "unit rows", "rounding 1e-16 over its square turns a velocity by 1e-2"),
    Threshold(
        "ENTRY_RATIO",
        "of the pivot at entry",
        "a motion that starts near and leaves is not refused for its start",
    ),
    Threshold(
        "MIN_ENERGY",
        "of the kinetic energy at entry",
        "a slower motion may turn back, and the bound diverges",
    ),
    Threshold("BOUND_MARGIN", "of the bound", "error of Simpson's rule for the bound"),
    Threshold("MAX_SHORT_STEPS", "steps", "a crossing that needs more is a long one"),
    Threshold(
        "MIN_CHANGE", "of the velocities", "a smaller perturbation drowns in rounding over the distance"
    ),
    Threshold(
        "MAX_GAIN", "of the perturbation", "a crossing that magnifies more is not determined by its start"
    ),
    Threshold("MAX_APART", "scene lengths or rad", "largest distance of two runs on one branch"),
    Threshold("STRICTER", "of the limit", "runs that count different crossings may be on different branches"),
    Threshold(
        "RATE_FACTOR", "of the limit", "velocities differ more than positions near a singular position"
    ),
    Threshold("MIN_SERIES_ORDER", "order", "fewer orders do not separate a pole from the motion"),
    Threshold(
        "PURE_POLE", "relative", "last terms that form a geometric sequence to this accuracy are a pole alone"
    ),
    Threshold("MAX_GAP", "unit rows", "gap that rounding of the state explains"),
    Threshold(
        "POLE_GROWTH", "of the growth of the pole over two orders", "terms that grow faster are rounding"
    ),
    Threshold("POLE_ORDERS", "orders", "are spent on the estimate of the pole"),
    Threshold("MIN_ORDER_LEFT", "order", "at least a series that steps can use"),
    Threshold(
        "MIN_GAIN",
        "of the step with the pole",
        "a series without its pole that allows shorter steps has lost too many orders",
    ),
    Threshold(
        "START_ERROR",
        "scene lengths or rad; of the fastest velocity",
        "the series of a start without rounding trouble agrees to 1e-9",
    ),
    Threshold(
        "START_ERROR_DRIVEN",
        "of the fastest velocity",
        "drivers hold a motion whose start velocities are rounded",
    ),
    Threshold("REST_PIVOT", "unit rows", "nearer, rounding turns a motion from rest by 1e-5"),
    Threshold(
        "REST_TURN",
        "times the root of the pivot",
        "turn of a motion from rest by rounding of its rows, as a fraction of its speed",
    ),
    Threshold(
        "DEPARTURE", "scene lengths or rad", "distance behind a crossing at which another branch is entered"
    ),
    Threshold(
        "DEPARTURE_CORRECTIONS", "iterations", "the state converges linearly, by the distance each time"
    ),
    Threshold(
        "DEPARTURE_PIVOT",
        "of the distance from the crossing",
        "smaller pivots are of rows that depend on others",
    ),
)
