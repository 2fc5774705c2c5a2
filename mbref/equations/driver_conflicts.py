"""Drivers that contradict each other: more drivers than freedoms, whose motions do not fit.

Rows of drivers take part in a vanishing combination of rows of Φ_q if one of the drivers follows from the
others.  Then the poses of the other rows decide whether the motion of this driver fits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbref.equations.gaps import lengths_of_rows
from mbref.equations.model import Model, Terms, displaced
from mbref.equations.units import unit_rows
from mbref.linear_algebra.least_norm import least_norm
from mbref.scene import Scene, SceneError

COMPARED_TIMES = 101  # number of times over the motion at which drivers are compared
# singular value of unit rows / largest one, below which a combination of rows vanishes
DEPENDENT_DRIVER = 1e-9
DRIVER_WEIGHT = 1e-6  # weight of a driver's row in such a combination above which the driver takes part
# difference of the motions of drivers, lengths of the mechanism or rad, that is no rounding
CONFLICT = 1e-9
MOST_DRIVER_ROWS = 300  # constraint rows; of larger mechanisms singular values take too long
POSE_STEPS = 20  # largest number of Newton steps to a pose
LAST_MOVE = 1e-15  # change of a pose by the last Newton step, lengths of the mechanism or rad


class Conflict(NamedTuple):
    """Drivers, by their joints, whose motions differ by ``gap`` (lengths of the mechanism or rad) at a time
    (s)."""

    joints: tuple[str, ...]
    time: float
    gap: float

    @property
    def sentence(self) -> str:
        """One sentence with the drivers and the time."""
        *others, last = self.joints
        who = f"the drivers of {', '.join(others)} and {last} contradict each other"
        return (
            f"{who}: they differ by {self.gap:.2g} lengths of the mechanism or rad at t = {self.time:.6g} s"
        )

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


def _first_conflict(model: Model, until: float) -> Conflict | None:
    q = model.start()
    terms = model.terms(0.0, q)
    drivers = _driver_rows(model)
    dropped = _dependent_drivers(model, terms, drivers)
    if not dropped:
        return None
    kept = np.setdiff1d(np.arange(model.m), list(dropped))
    for time in np.linspace(0.0, until, COMPARED_TIMES):
        q, terms = _posed(model, float(time), q, kept)
        gaps = np.abs(terms.phi) / lengths_of_rows(terms.blocks, model.length)
        if gaps[kept].max(initial=0.0) > CONFLICT:
            return None  # a dead position: the other drivers cannot be followed
        row = max(dropped, key=lambda row: gaps[row])
        if gaps[row] > CONFLICT:
            still = _dependent_drivers(model, terms, drivers)
            return Conflict(still[row], float(time), float(gaps[row])) if row in still else None
    return None


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
    order = [row for row in range(model.m) if row not in drivers]
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


def _posed(model: Model, time: float, q: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, Terms]:
    """Return the pose (7 nb,) nearest to q that satisfies the kept rows at a time (s), and its terms."""
    terms = model.terms(time, q)
    for _ in range(POSE_STEPS):
        rows = terms.jacobian[kept] * model.units
        lengths = np.linalg.norm(rows, axis=1)
        step = least_norm(rows / lengths[:, None], -terms.phi[kept] / lengths, DEPENDENT_DRIVER)
        q = displaced(q, model.units * step)
        terms = model.terms(time, q)
        if np.abs(step).max(initial=0.0) < LAST_MOVE:
            break
    return q, terms
