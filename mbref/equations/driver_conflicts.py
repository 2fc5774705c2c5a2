"""Drivers that contradict each other: more drivers than freedoms, whose motions do not fit.

Rows of drivers take part in a vanishing combination of rows of Φ_q if one of the drivers follows from the
others.  Then the poses of the other rows decide whether the motion of this driver fits.  Rows between
velocities alone, as of a wheel that does not slip, decide nothing here: a run in which the wheel has to slip
ends as VIOLATION.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbref.equations.gaps import lengths_of_rows
from mbref.equations.joint_angles import angles_at, counted_from
from mbref.equations.model import Model, Terms, displaced
from mbref.equations.units import unit_equations, unit_rows
from mbref.linear_algebra.least_norm import least_norm
from mbref.scene import Scene, SceneError

COMPARED_TIMES = 101  # least number of times over the motion at which drivers are compared
MOST_TIMES = 1000  # largest number; of a longer motion its begin is compared
EVEN_TIMES = 10_001  # number of times between which the way of drivers is measured
GOLDEN_RATIO = (5**0.5 - 1) / 2  # its multiples are nowhere even
LARGEST_MOTION = 0.4  # of a driver between compared times, lengths or rad: Newton's method follows it
# singular value of unit rows / largest one, below which a combination of rows vanishes
DEPENDENT_DRIVER = 1e-9
DRIVER_WEIGHT = 1e-6  # weight of a driver's row in such a combination above which the driver takes part
# difference of the motions of drivers, lengths of the mechanism or rad, that is no rounding
CONFLICT = 1e-9
ROUNDED_VALUE = 1e-15  # the same, over the largest value of a driver
RATE_CONFLICT = 5e-11  # difference of rates over the largest rate of a driver that is no rounding
RATE_SHARE = 2e-10  # the same over 1/duration: tables of 13 digits differ by less
MOST_DRIVER_ROWS = 300  # constraint rows; of larger mechanisms singular values take too long
POSE_STEPS = 20  # largest number of Newton steps to a pose
TURN_OF_A_PART = 1.0  # rad of a body at a time; two bodies then turn by less than half a turn to each other
MOST_PARTS_OF_STEP = 100  # largest number of parts of a Newton step
LAST_MOVE = 1e-15  # change of a pose by the last Newton step, lengths of the mechanism or rad


class Conflict(NamedTuple):
    """Drivers, by their joints, whose motions differ by ``gap`` (lengths of the mechanism or rad) at a time
    (s), or whose rates differ by ``gap`` (over s)."""

    joints: tuple[str, ...]
    time: float
    gap: float
    of_rates: bool = False

    @property
    def sentence(self) -> str:
        """One sentence with the drivers and the time."""
        *others, last = self.joints
        who = f"the drivers of {', '.join(others)} and {last} contradict each other"
        what, unit = ("their rates", " per s") if self.of_rates else ("they", "")
        gap = f"{self.gap:.2g} lengths of the mechanism or rad{unit}"
        return f"{who}: {what} differ by {gap} at t = {self.time:.6g} s"

    @property
    def fault(self) -> str:
        """The sentence with the path of the last of the drivers and an advice."""
        return f"driver[{self.joints[-1]}]: {self.sentence}; remove one of them"


def conflict_of_drivers(scene: Scene, until: float | None = None) -> Conflict | None:
    """Return the first contradiction of drivers up to a time (s), by default the scene's duration.

    The scene is assembled. None if drivers are independent, or agree.
    """
    if len(scene.driver) < 2:
        return None
    model = Model(scene)
    if model.m > MOST_DRIVER_ROWS:
        return None
    found = _first_conflict(model, scene.duration if until is None else until)
    model.release()
    return found


def refuse_conflict(scene: Scene, until: float | None = None) -> None:
    """Raise SceneError if drivers contradict each other up to a time (s)."""
    if (found := conflict_of_drivers(scene, until)) is not None:
        raise SceneError([found.fault])


class _Pose(NamedTuple):
    """Coordinates q (7 nb,) and angles (k,), rad, of turning joints with their full turns."""

    q: np.ndarray
    angles: np.ndarray


class _Limits(NamedTuple):
    """Differences of motions (lengths of the mechanism or rad) and of rates (over s) that are rounding."""

    gap: float
    rate: float


def _first_conflict(model: Model, until: float) -> Conflict | None:
    times, limits = _compared(model, until)
    pose = _Pose(model.start(), np.zeros(model.memory.values.angles.size))
    every, drivers = model.structure.position_rows, _driver_rows(model)
    for k, time in enumerate(times.tolist()):
        before, (pose, terms) = pose, _posed(model, time, pose, every)
        gaps = np.abs(terms.phi) / lengths_of_rows(terms.blocks, model.length)
        if gaps.max(initial=0.0) > limits.gap:
            return _of_motions(model, time, before, drivers, limits)
        rows, rates = unit_equations(terms.jacobian[every] * model.units, terms.nu[every])
        off = np.abs(rows @ least_norm(rows, rates, DEPENDENT_DRIVER) - rates)
        if off.max(initial=0.0) > limits.rate:
            return _of_rates(model, time, terms, drivers, limits)
        if k == 1 and not _dependent_drivers(model, terms, drivers):
            return None
    return None


def _compared(model: Model, until: float) -> tuple[np.ndarray, _Limits]:
    """Return times (k,) at which drivers are compared, and the limits of differences.

    Times are irregular, so that no sine vanishes at all of them, and contain the inner rows of tables.
    """
    even = np.linspace(0.0, until, EVEN_TIMES)
    values = _driven_way(model.scene, model.length, even)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(values)).max(axis=0))])
    paced = np.interp(np.arange(0.0, way[-1], LARGEST_MOTION)[:MOST_TIMES], way, even)
    places = np.arange(COMPARED_TIMES - 1)
    shifted = until * (places + 0.8 * (places * GOLDEN_RATIO % 1.0)) / (COMPARED_TIMES - 1)
    functions = [function for driver in model.scene.driver for function in driver.functions]
    rows = [t for function in functions for t, _ in function.table or () if 0.0 < t < until]
    times = np.unique(np.concatenate([shifted, paced, rows, [until]]))[:MOST_TIMES]
    gap = max(CONFLICT, ROUNDED_VALUE * np.abs(values).max())
    rate = RATE_CONFLICT * fastest_rate(model.scene, model.length, until) + RATE_SHARE / (until or np.inf)
    return times, _Limits(gap, rate)


def fastest_rate(scene: Scene, length: float, until: float) -> float:
    """Return the largest rate of a driver up to a time (s), in lengths (m) or rad per s."""
    even = np.linspace(0.0, until, COMPARED_TIMES)
    steps = np.diff(_driven_way(scene, length, even))
    return float(np.abs(steps).max(initial=0.0) / even[1]) if until > 0.0 else 0.0


def _driven_way(scene: Scene, length: float, times: np.ndarray) -> np.ndarray:
    """Return the values (f, k) of functions of drivers at times (k,), in lengths (m) or rad."""
    slides = {joint.name for joint in scene.joint if joint.facts.driven == "displacement"}
    functions = [(length if d.joint in slides else 1.0, f) for d in scene.driver for f in d.functions]
    values = [function.values(times) / unit for unit, function in functions]
    return np.reshape(values, (-1, len(times)))


def _of_motions(
    model: Model, time: float, pose: _Pose, drivers: dict[int, str], limits: _Limits
) -> Conflict | None:
    """Return the conflict of motions at a time (s); None if the other drivers come to a dead position.

    The pose satisfies all rows a little earlier.
    """
    _, terms = _posed(model, time, pose, model.structure.position_rows)
    dropped = _dependent_drivers(model, terms, drivers)
    kept = np.setdiff1d(model.structure.position_rows, list(dropped))
    _, terms = _posed(model, time, pose, kept)
    gaps = np.abs(terms.phi) / lengths_of_rows(terms.blocks, model.length)
    if not dropped or gaps[kept].max(initial=0.0) > limits.gap:
        return None
    row = max(dropped, key=lambda row: gaps[row])
    still = _dependent_drivers(model, terms, drivers)
    return Conflict(still[row], time, float(gaps[row])) if row in still and gaps[row] > limits.gap else None


def _of_rates(
    model: Model, time: float, terms: Terms, drivers: dict[int, str], limits: _Limits
) -> Conflict | None:
    """Return the conflict of rates at a time (s) and a pose; None if the other drivers have none."""
    dropped = _dependent_drivers(model, terms, drivers)
    rows, rates = unit_equations(terms.jacobian * model.units, terms.nu)
    kept = np.setdiff1d(model.structure.position_rows, list(dropped))
    off = np.abs(rows @ least_norm(rows[kept], rates[kept], DEPENDENT_DRIVER) - rates)
    off[model.structure.velocity_rows] = 0.0
    if not dropped or off[kept].max(initial=0.0) > limits.rate:
        return None
    row = max(dropped, key=lambda row: off[row])
    return Conflict(dropped[row], time, float(off[row]), of_rates=True)


def _driver_rows(model: Model) -> dict[int, str]:
    """Return the joint of each row of a driver."""
    driven = {driver.joint for driver in model.scene.driver}
    primitives = model.data.primitives
    rows = primitives.row[primitives.driver >= 0].tolist()
    return {row: model.row_joint[row] for row in rows if model.row_joint[row] in driven}


def _dependent_drivers(model: Model, terms: Terms, drivers: dict[int, str]) -> dict[int, tuple[str, ...]]:
    """Return rows of drivers that follow from the other rows, with the joints of the drivers that take part.

    Later drivers follow from earlier ones.
    """
    rows = unit_rows(terms.jacobian * model.units)
    found: dict[int, tuple[str, ...]] = {}
    order = [row for row in model.structure.position_rows.tolist() if row not in drivers]
    for row in sorted(drivers, key=lambda row: _place(model, drivers[row])):
        weights = _combination(rows[order], rows[row])
        if weights is None:
            order.append(row)
            continue
        parts = [drivers[other] for other, w in zip(order, weights, strict=True) if other in drivers and w]
        if parts:
            found[row] = (*parts, drivers[row])
    return found


def _place(model: Model, joint: str) -> int:
    return [driver.joint for driver in model.scene.driver].index(joint)


def _combination(rows: np.ndarray, row: np.ndarray) -> np.ndarray | None:
    """Return which rows (k, n) take part in the combination that equals a row (n,); None if none does."""
    weights = np.linalg.lstsq(rows.T, row, rcond=DEPENDENT_DRIVER)[0]
    if np.abs(rows.T @ weights - row).max() > DEPENDENT_DRIVER:
        return None
    return np.asarray(np.abs(weights) > DRIVER_WEIGHT)


def _posed(model: Model, time: float, pose: _Pose, kept: np.ndarray) -> tuple[_Pose, Terms]:
    """Return the pose nearest to another one that satisfies the kept rows at a time (s), and its terms."""
    terms = _terms(model, time, pose)
    for _ in range(POSE_STEPS):
        rows = terms.jacobian[kept] * model.units
        lengths = np.linalg.norm(rows, axis=1)
        step = least_norm(rows / lengths[:, None], -terms.phi[kept] / lengths, DEPENDENT_DRIVER)
        pose = _moved(model, pose, model.units * step)
        terms = _terms(model, time, pose)
        if np.abs(step).max(initial=0.0) < LAST_MOVE:
            break
    return pose, terms


def _terms(model: Model, time: float, pose: _Pose) -> Terms:
    with counted_from(model, pose.angles):
        return model.terms(time, pose.q)


def _moved(model: Model, pose: _Pose, x: np.ndarray) -> _Pose:
    """Return the pose after displacements x (n,), in parts over which angles are counted."""
    turned = np.linalg.norm(x.reshape(-1, 6)[:, 3:], axis=1).max(initial=0.0)
    count = max(1, min(math.ceil(turned / TURN_OF_A_PART), MOST_PARTS_OF_STEP))
    for _ in range(count):
        q = displaced(pose.q, x / count)
        pose = _Pose(q, angles_at(model, q, pose.angles))
    return pose
