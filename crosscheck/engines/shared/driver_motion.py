"""Driver motions as numbers, and the fastest rate in a scene."""

from __future__ import annotations

import bisect
import functools
import math
from collections.abc import Callable, Sequence

import numpy as np

from crosscheck.judge import time_functions
from crosscheck.judge.arithmetic import DOUBLE
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Driver, JointLoad, PointDamper, RotationalDamper, Scene, Spring, TimeFunction
from mbref.scene.joints import ANGLE

SCOUT = (2000, 16000)  # numbers of steps of the coarse run that measures the scene's fastest rate
SCOUT_TURN = 0.5  # rad; largest rotation in a step of the coarse run


def motion(driver: TimeFunction, t: float, since: float | None = None) -> tuple[float, float, float]:
    """Return value, rate and acceleration of a driver, or of a factor of a load, at time t (s).

    The piece is the one that acts from ``since`` (s) on, by default the one at t.
    """
    value = rate = acceleration = 0.0
    start, stop = driver.interval
    if not start <= (t if since is None else since) < stop:
        return 0.0, 0.0, 0.0
    for c in reversed(driver.coefficients):
        acceleration = acceleration * t + 2 * rate
        rate = rate * t + value
        value = value * t + c
    if sine := driver.sine:
        w, phase = sine.frequency, sine.frequency * t + sine.phase
        value += sine.amplitude * math.sin(phase)
        rate += sine.amplitude * w * math.cos(phase)
        acceleration -= sine.amplitude * w * w * math.sin(phase)
    if driver.table:
        knot, (a, b, c, d) = _cubic(driver, t if since is None else since)
        s = t - knot
        value += a + s * (b + s * (c + s * d))
        rate += b + s * (2 * c + 3 * s * d)
        acceleration += 2 * c + 6 * s * d
    return value, rate, acceleration


def _cubic(driver: TimeFunction, since: float) -> tuple[float, tuple[float, ...]]:
    """Return knot and coefficients of the piece of a driver's table that acts from a time (s) on."""
    begins, pieces = _pieces(driver)
    return pieces[bisect.bisect_right(begins, since)]


@functools.lru_cache(maxsize=64)
def _pieces(driver: TimeFunction) -> tuple[tuple[float, ...], list[tuple[float, tuple[float, ...]]]]:
    """Return the ends of pieces, and knot and coefficients of each."""
    ends, found = time_functions.ends(driver), []
    for begin in (0.0, *ends):
        piece = time_functions.piece_of(driver, begin, DOUBLE)
        found.append((float(piece.knot), tuple(piece.cubic.tolist())))
    return ends, found


def mean_rate(driver: Driver, t: float, h: float) -> float:
    """Return the mean rate of a driver from time t over h (s): steps with this rate end at the prescribed
    value."""
    return (motion(driver, t + h)[0] - motion(driver, t)[0]) / h


def moving(driver: Driver) -> Callable[[float], tuple[float, float, float]]:
    """Return `motion` of a driver as a function of time that stores its last result.

    The iterations and the rows of a step ask for the motion at equal times.
    """
    kept: tuple[float, tuple[float, float, float]] = (math.nan, (0.0, 0.0, 0.0))

    def at(t: float) -> tuple[float, float, float]:
        nonlocal kept
        if t != kept[0]:
            kept = t, motion(driver, t)
        return kept[1]

    return at


def stated_rate(scene: Scene) -> float:
    """Return the fastest rate (rad/s) in the scene's data: of its duration, drivers, springs,
    dampers and velocities."""
    rates = [1 / scene.duration]
    for driver in scene.driver:
        rates += [abs(motion(driver, t)[1]) for t in np.linspace(0, scene.duration, 101)]
        rates += [abs(driver.sine.frequency)] if driver.sine else []
    for body in scene.body:
        rates += [math.hypot(*body.angular_velocity)] if body.angular_velocity else []
    mass = min((body.mass for body in scene.body if body.mass), default=math.inf)
    inertia = min((_middle_moment(body.inertia) for body in scene.body if body.inertia), default=math.inf)
    for load in scene.load:
        if isinstance(load, Spring):
            rates += [math.sqrt(load.stiffness / mass), load.damping / mass]
        elif isinstance(load, PointDamper):
            rates.append(load.damping / mass)
        elif isinstance(load, RotationalDamper) and inertia > 0:
            rates.append(load.damping / inertia)
        elif isinstance(load, JointLoad) and (of := inertia if load.coordinate == ANGLE else mass) > 0:
            rates += [math.sqrt(load.action.stiffness / of), load.action.damping / of]
        if load.over_time and load.over_time.sine:
            rates += [abs(load.over_time.sine.frequency)]
    return max(rates)


def _middle_moment(inertia: Sequence[float] | Sequence[Sequence[float]]) -> float:
    """Return the middle principal moment; the least one is nearly zero for thin rods."""
    matrix = np.array(inertia)
    return float(np.linalg.eigvalsh(np.diag(matrix) if matrix.ndim == 1 else matrix)[1])


def fastest_rate(scene: Scene, coarse: Callable[[float], Trajectory], counts: Sequence[int] = SCOUT) -> float:
    """Return the fastest angular velocity (rad/s) in a coarse run, or `stated_rate` if that is larger.

    ``coarse(step)`` runs the scene with steps of that length (s).  ``counts`` are the numbers of steps to try
    in turn: a run that fails, or turns by more than SCOUT_TURN in a step, is repeated with the next. The
    result is at most the rate at which a body turns by SCOUT_TURN in a step of the largest count.
    """
    for steps in counts:
        run = coarse(scene.duration / steps)
        speed = float(np.linalg.norm(run.angular_velocity, axis=2).max(initial=0.0))
        if run.outcome is Outcome.COMPLETED and speed < SCOUT_TURN * steps / scene.duration:
            break
    return min(max(stated_rate(scene), speed), SCOUT_TURN * max(counts) / scene.duration)
