"""Tolerances of the judge, each with its reason; they are not adapted to results."""

from __future__ import annotations

import numpy as np

ROUNDING = float(np.finfo(float).eps)

RANK = 1e-9
"""Singular values below this part of the largest count as zero: poses are consistent to about 1e-15, so
true zeros are 1e-15. A mechanism 1e-9 from a singular position behaves like a singular one in practice."""

FREEDOM = 1e-7
"""The same for the mobility of a family's path away from singular positions: a freedom is exactly zero
there, while the least true singular value of any linkage worth the name is above 1e-3."""

ON_PATH = 1e-9
"""Relative gap up to which a scene is of a truth's family. Scenes written with twelve digits pass; one
whose lengths differ by more is another mechanism, and its truth would be off by as much. Beyond a singular
position the truth is that of the family without the gap."""

SAME_LENGTH = 1e-13
"""Relative difference up to which crank and rod are equal: with computed anchors rounding leaves 1e-16. A
larger one, however small, sends the motion to the other branch."""

PARALLEL = 1e-9
"""Sine of the angle up to which directions are parallel: errors of work from it are its square."""

CONTRADICTION = 0.05
"""Part of the velocity scale by which given velocities may miss the joints and still be corrected: more
is not a rounded number but another motion than the one meant."""

CONTRADICTED = 1e-3
"""Part of the velocity scale by which drivers may miss the joints and one another: rounding leaves less."""

TRUTH_DRIVEN = 1e-13
"""Accuracy of closed forms: a few roundings of double precision in poses, times the angle's size."""

TRUTH_DYNAMIC = 1e-12
"""Accuracy of reduced equations, solved in extended precision: measured 1e-15 on all built-in scenes
(rounding of the result to double); where extended precision is double, 1e-13."""

AT_REST = 1e-12
"""Part of the energies a mechanism could have (its weight over its length, its mass crossing its length in
the motion's time) below which those it has are rounding: thousands of roundings."""

STRAIGHT_LINE = 0.1
"""Root mean square distance, in decades, from a line of a convergence curve's asymptotic range: error
constants of rejected-step or event effects scatter by tens of percent, a floor bends by decades."""

LEAST_ORDER = 0.5
"""Slope below which errors do not converge: no consistent method has an order below one."""

ERROR_LEVELS = (1e-3, 1e-6, 1e-9)
"""Errors at which costs are compared: animation, engineering, reference."""

FLOOR = 1e-8
"""Error that every engine should reach at some setting: beyond what its integrator leaves when used with
care, and far above rounding, which singular positions magnify to 1e-10."""

FALSE_SUCCESS = 1e-2
"""Error of a completed run that makes it a false success: one percent of the mechanism's size or 0.6
degrees is beyond any accuracy asked for, and a wrong branch or a lost constraint leaves as much."""

EXCESS = 100.0
"""Multiples of the relative tolerance asked for beyond which the error of a completed run makes it a false
success too: a tolerance is of one step, and over a motion its errors add up to some ten times that."""

SAME_START = 1e-8
"""Relative difference of initial poses and velocities between engines: joint-coordinate engines rebuild
them from tree coordinates by Newton iterations that stop at 1e-10 or better."""

SAME_CHANGE = 1e-4
"""Relative difference of the velocity changes over the gate's short time, and of given accelerations: one
percent of one body's mass changes them by 5e-4 or more in most built-in scenes; integration errors of an
engine at its finer settings are below 1e-6 over so short a time."""

SINGLE_CHANGE = 0.1
"""Relative difference of the velocity changes for engines in single precision: rounding of poses, fed back by
closures, and velocities that are off by a part of a step change them by up to 4e-2 over the gate's short time
(Newton on the heavy top); a load that is lost or has another sign changes them by more where it matters."""

LEAST_CHANGE = 1e-3
"""Part of the accelerations that gravity, loads, drivers and velocities can cause, below which differences
count relative to it: engines solve for accelerations that balance to 1e-8 of it or better."""

SAME_FORCES = 1e-2
"""Relative difference of accelerations that a run reports from the judge's own at the run's states, before a
wrong motion is blamed on the model: soft closures and integrators of first order report them to 1e-3, and a
load that is lost changes them by more where it matters to the motion."""

NEXT_TO_SINGULAR = 1e-3
"""Least singular value, of the largest, of a pose at which accelerations are compared: nearer to a singular
position, closure errors of 1e-6 change them by more than a thousandth."""

GATE_TIME = 1e-3
"""Part of the scene's duration that the gate simulates: long enough that changes are 1e10 roundings,
short enough that they are accelerations times time."""

UNIT_NORM = 1e-12
"""Allowed distance from 1 of the length of an orientation's quaternion: rounding after a normalisation."""

STAYS_CLOSED = 1e-6
"""Joint residual (rad, or relative to the scene's length) that a conforming engine may leave at the finest
of its settings: a hundredth of what accuracy is asked of it, and far below a lost constraint."""

LIKE_TRUTH = 1e-5
"""Error and energy drift of a conforming engine at its finest setting: one percent of a mass, inertia or
load, or an axis off by half a degree, leaves 1e-4 or more over the suite's scenes; methods of second order
reach 1e-6."""

SAME_MOTION = 1e-9
"""Difference of two runs of a conforming engine that should agree, where its own accuracy (the difference of
its two finest settings) is better: rounding grows to this over some thousand steps."""

GRAINS = 16.0
"""Multiples of the rounding that an engine claims by which states at neighbouring times may leave a smooth
curve: each is the sum of some rotated arms and of the rounding of a few steps between."""

SAME_PUSHES = 1e-6
"""The same for accelerations and unique reactions, which are solved for at each sample: rounding of poses
times the condition of the equations, of 1e6 at most away from singular positions."""

OWN_ACCURACY = 4.0
"""Multiples of an engine's own accuracy by which such runs may differ: each is off by about one, and what
the coarser setting adds is not all of it."""

COARSEST = 0.1
"""Residual, error or drift beyond which no engine conforms, even if it decreases with the engine's steps:
above a tenth of the mechanism's size, a radian or the energy, a decrease is no convergence yet."""

PERTURBED = 100.0
"""Multiples of the difference of perturbed runs, whose data differ by two units in the last place, by which
runs that should agree may differ: a rotated or reordered scene rounds in every operation."""

REACTIONS = 1e-3
"""Part of the largest force by which reactions of a conforming engine may miss what moves the bodies: they
hang on accelerations, one derivative less smooth than poses, and on nearly rigid springs in some engines."""
