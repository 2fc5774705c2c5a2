"""Goals of a synthesis: a motion that follows given points, or whose outputs are least."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbref.design.derivatives.columns import without_derivative
from mbref.design.derivatives.natural_units import natural_units
from mbref.design.derivatives.tables import NumberTable, columns_of_numbers, refuse_not_finite
from mbref.input_error import InputError
from mbref.motions.motion import Motion
from mbref.motions.outputs import chosen, quantity_of
from mbref.scene import Scene
from mbref.simulation.simulate import SAMPLES, checked_times, simulate

RATE_OF = {  # quantity → its derivative by time
    "position": "velocity",
    "velocity": "acceleration",
    "angular_velocity": "angular_acceleration",
    "angle": "rate",
    "displacement": "displacement_rate",
    "length": "length_rate",
}


@dataclass(frozen=True, eq=False)
class Goal:
    """Values (k, c) that c columns of a motion shall have at k times (k,), s; NaN where any value is good.

    ``times`` are None if the points are to be reached in their order at any times up to the scene's duration.
    ``units`` (c,) are sizes of the columns.
    """

    columns: tuple[str, ...]
    times: np.ndarray | None
    wanted: np.ndarray
    units: np.ndarray

    @property
    def rates(self) -> tuple[str, ...]:
        """Columns that are the derivatives of the columns by time."""
        return tuple(map(_rate_of, self.columns))


def followed_points(scene: Scene, table: NumberTable) -> Goal:
    """Return the goal that columns of a table are met; raises InputError for a table without whole columns of
    the motion, or without points."""
    columns = columns_of_numbers(table, "follow")
    times = columns.pop("time", None)
    if times is not None:
        refuse_not_finite({"time": times}, "follow")
        times = checked_times(times)
    names = _whole_columns(scene, "follow", [*columns])
    wanted = np.array([columns[name] for name in names]).T
    if np.isinf(wanted).any() or not np.isfinite(wanted).any(axis=1).all():
        row = int(np.argmin(np.isfinite(wanted).any(axis=1))) + 1
        raise InputError(f"follow: needs a finite number at least in each row, and row {row} has none")
    goal = Goal(names, times, wanted, natural_units(scene, names))
    if times is None:
        _ = goal.rates
    return goal


def least_outputs(scene: Scene, outputs: Sequence[str], times: Sequence[float] | np.ndarray | None) -> Goal:
    """Return the goal that outputs are zero at times (k,), s."""
    samples = checked_times(np.linspace(0.0, scene.duration, SAMPLES) if times is None else times)
    names = _with_derivatives(first := _at_start(scene), "least", chosen(first.columns(), outputs))
    return Goal(names, samples, np.zeros((samples.size, len(names))), natural_units(scene, names))


def _rate_of(column: str) -> str:
    owner, quantity, component = column.rpartition(quantity_of(column))
    if not quantity or quantity not in RATE_OF:
        raise InputError(
            f"follow: {column} needs a column time; without times there are points of {', '.join(RATE_OF)}"
        )
    return f"{owner}{RATE_OF[quantity]}{component}"


def _whole_columns(scene: Scene, what: str, names: Sequence[str]) -> tuple[str, ...]:
    if not names:
        raise InputError(f"{what}: needs one column of outputs at least, such as rod.position.x")
    first = _at_start(scene)
    if [*names] != (whole := chosen(first.columns(), names)):
        raise InputError(f"{what}: name whole columns: {', '.join(whole)}")
    return _with_derivatives(first, what, names)


def _with_derivatives(motion: Motion, what: str, names: Sequence[str]) -> tuple[str, ...]:
    for name, reason in without_derivative(motion, names).items():
        raise InputError(f"{what}: {name} {reason}")
    return tuple(names)


def _at_start(scene: Scene) -> Motion:
    """Return the motion at t = 0; raises InputError for a scene without a state there."""
    motion = simulate(scene, times=[0.0])
    if not motion.times.size:
        raise InputError(f"{scene.name}: {motion.message}")
    return motion
