"""fit: numbers of a scene from measured columns of its motion, by least squares with exact derivatives."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mbref.design.derivatives.columns import without_derivative
from mbref.design.derivatives.numbers_of_scene import number_at
from mbref.design.derivatives.result import with_none
from mbref.design.derivatives.sensitivities import motion_and_derivatives, refuse_repeats
from mbref.design.derivatives.start_numbers import is_of_start
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.input_error import InputError
from mbref.motions.outputs import UNIT_OF, chosen, quantity_of
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import checked_times, simulate
from mbref.stepping.limits import Limits

FIT_RTOL = 1e-10  # relative tolerance of the runs; derivatives then have about eight digits
# singular value of the scaled Jacobian / largest one, below which the columns do not determine a combination
INDETERMINATE = 1e-6
# change of all columns over their sizes if a number doubles, that is rounding of derivatives (1e-14)
NO_INFLUENCE = 1e-10
CONSTANT = 1e-8  # standard deviation of a column / its size that is an error of the runs (1e-10) or rounding
PART_OF_COMBINATION = 1e-3  # weight of a number in such a unit combination from which it takes part
FIT_TOLERANCE = 1e-12  # relative changes of the sum of squares and of the numbers that end the iteration
NOT_NEGATIVE = ("mass", "stiffness", "damping", "natural_length", "armature")
MOMENT = re.compile(r"\.inertia(\[\d\]|\.[xyz]|\[(\d)\]\[\2\])$")  # principal, or on the diagonal


@dataclass(frozen=True, eq=False)
class FitResult:
    """Numbers of a scene that fit measured columns, at k times with c columns.

    Attributes
    ----------
    scene : Scene
        The scene with the fitted numbers.
    numbers : dict of str to float
        Fitted values by path, SI units.
    errors : dict of str to float
        Standard errors by path, from the scatter of the residuals; infinite for a number that the columns do
        not determine.
    correlations : ndarray, shape (p, p)
        Correlations of the p numbers, in their order; NaN for undetermined ones.
    undetermined : tuple of dict of str to float
        Combinations of relative changes of numbers, by path, that change no column.
    deviations : dict of str to float
        Root mean square residual of each column, in its unit.
    converged : bool
        Whether the iteration ended at a minimum.
    left_out : tuple of str
        Columns of the table without a derivative, which were not used.
    """

    scene: Scene
    numbers: dict[str, float]
    errors: dict[str, float]
    correlations: np.ndarray
    undetermined: tuple[dict[str, float], ...]
    deviations: dict[str, float]
    converged: bool
    left_out: tuple[str, ...] = ()

    def to_record(self) -> dict[str, Any]:
        """Return the attributes by name as numbers, lists and text, for JSON, with the scene's tables.

        Returns
        -------
        dict
            Errors that are infinite and correlations that are NaN are None.
        """
        return {
            **vars(self),
            "scene": self.scene.to_dict(),
            "errors": {name: error if np.isfinite(error) else None for name, error in self.errors.items()},
            "correlations": with_none(self.correlations),
            "undetermined": list(self.undetermined),
        }


def fit(
    scene: Scene | str | Path,
    measured: Mapping[str, np.ndarray] | str | Path,
    free: Sequence[str],
    of: Sequence[str] | None = None,
    limits: Limits | None = None,
) -> FitResult:
    """Return the scene whose motion is nearest to measured columns, by least squares over some numbers.

    Each column counts relative to its standard deviation over the samples, and a constant one relative to its
    size. Derivatives are by
    ``sensitivities``, iterations are by ``scipy.optimize.least_squares``, from the scene's own numbers.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    measured : mapping of str to ndarray, shape (k,), or path
        ``time`` (s) and columns of ``Motion.columns``, SI units; or a .csv file with a line of their names.
    free : sequence of str
        Numbers to fit: paths of the scene such as ``"body[rod].mass"``.
    of : sequence of str, optional
        Columns to use, or their beginnings. Default: all that have a derivative.
    limits : Limits, optional
        Tolerances of the runs. Default: a relative tolerance of 1e-10.

    Returns
    -------
    FitResult
        Fitted numbers, standard errors, correlations, and combinations that the columns do not determine.

    Raises
    ------
    SceneError
        If the scene has no number at a path, or the iteration meets a scene that is not valid.
    InputError
        If the table has no time, an unknown column or one column twice, or no more measured numbers than
        free ones; if a measured number is not finite; if a free number is given twice or is of the start; if
        a motion that is tried ends early; and for the reasons of ``sensitivities``.
    """
    from scipy.optimize import least_squares

    scene, columns = find_scene(scene), _columns(measured)
    refuse_repeats(scene, "free", free)
    times = checked_times(_finite({"time": columns.pop("time")})["time"])
    motion = simulate(scene, times=times[:1])
    left_out = without_derivative(motion, [*columns]) if of is None else {}
    used = [name for name in columns if name not in left_out] if of is None else chosen(columns, of)
    if used != (whole := chosen(motion.columns(), used)):
        raise InputError(f"measured: name whole columns: {', '.join(whole)}")
    measured = _finite({name: columns[name] for name in used})
    problem = _Problem(scene, times, measured, free, limits or Limits(rtol=FIT_RTOL))
    begin = problem.start / problem.sizes
    lower = np.where([_is_not_negative(label) for label in free], 0.0, -np.inf)
    tolerances = {name: FIT_TOLERANCE for name in ("ftol", "xtol", "gtol")}
    found = least_squares(problem.residuals, begin, problem.jacobian, bounds=(lower, np.inf), **tolerances)
    return replace(problem.solution(found.x, found.status > 0), left_out=(*left_out,))


def _columns(measured: Mapping[str, np.ndarray] | str | Path) -> dict[str, np.ndarray]:
    """Return measured columns (k,); raises InputError for a table that is not of numbers."""
    if not isinstance(measured, Mapping):
        with open(measured, encoding="utf-8-sig", newline="") as file:
            names, *rows = [*csv.reader(file)] or [[]]
        if uneven := [k for k, row in enumerate(rows, 1) if len(row) != len(names)]:
            raise InputError(f"{measured}: row {uneven[0]} of the numbers needs {len(names)} of them")
        try:
            table = np.array(rows, dtype=float).reshape(len(rows), len(names))
        except ValueError as fault:
            raise InputError(f"{measured}: needs a line of names, and lines of numbers: {fault}") from None
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"{measured}: has the column {name!r} twice; remove one")
        measured = dict(zip(names, table.T, strict=True))
    found = {name: np.asarray(values, dtype=float) for name, values in measured.items()}
    if named := next((name for name in found if name.endswith("]")), None):
        raise InputError(f"measured: column {named!r} has a unit; give SI units, and names without units")
    if "time" not in found or len(found) < 2 or len({values.shape for values in found.values()}) > 1:
        raise InputError("measured: needs time and one column at least, of equal lengths")
    return found


def _finite(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return columns (k,); raises InputError for the first number that is not finite."""
    for name, values in columns.items():
        for row in np.flatnonzero(~np.isfinite(values)):
            raise InputError(f"measured: {name} is {values[row]} in row {row + 1} of the numbers")
    return columns


def _is_not_negative(label: str) -> bool:
    return label.rpartition(".")[2] in NOT_NEGATIVE or MOMENT.search(label) is not None


def _column_sizes(scene: Scene, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the largest values (c,) of columns, or the units of the mechanism if these are larger: its
    length, its mass and the scene's duration."""
    length, time = Model(assembled(scene)).length, scene.duration
    mass = sum(body.mass or 0.0 for body in scene.body)
    force = mass * length / time**2
    units = {"m": length, "s": time, "s²": time**2, "rad": 1.0, "N": force, "J": force * length}
    units["W"] = units["J"] / time

    def product(text: str) -> float:
        return float(np.prod([units[unit] for unit in text.split()]))

    parts = [UNIT_OF[quantity_of(name)].partition("/") for name in columns]
    natural = np.array([product(over) / product(under) for over, _, under in parts])
    sizes = np.maximum(natural, [np.abs(values).max() for values in columns.values()])
    return np.where(sizes > 0.0, sizes, 1.0)


class _Problem:
    """Residuals and Jacobian of measured columns as functions of numbers over their sizes."""

    def __init__(
        self,
        scene: Scene,
        times: np.ndarray,
        measured: dict[str, np.ndarray],
        free: Sequence[str],
        limits: Limits,
    ):
        for label in free:
            if is_of_start(label):
                raise InputError(
                    f"{label}: numbers of the start are no fields of the scene, and cannot be fitted"
                )
        self.scene, self.free, self.limits = scene, tuple(free), limits
        self.times, self.measured = times, measured
        self.start = np.array([number_at(scene, label) for label in free])
        self.sizes = np.where(self.start == 0.0, 1.0, np.abs(self.start))
        if (count := times.size * len(measured)) <= len(free):
            raise InputError(
                f"measured: has {count} numbers in columns with derivatives, and {len(free)} free ones "
                f"need {len(free) + 1} at least"
            )
        spread = np.array([values.std() for values in measured.values()])
        self.column_sizes = _column_sizes(scene, measured)
        self.scales = np.where(spread > CONSTANT * self.column_sizes, spread, self.column_sizes)
        self._last: tuple[bytes, np.ndarray, np.ndarray] | None = None

    def scene_at(self, z: np.ndarray) -> Scene:
        """Return the scene with numbers z (p,), over their sizes."""
        scene = self.scene
        for label, value in zip(self.free, (z * self.sizes).tolist(), strict=True):
            scene = scene.with_(label, value)
        return scene

    def _at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the differences (k, c) of the motion's columns from the measured ones, and their derivatives
        (k, c, p)."""
        if self._last is None or self._last[0] != z.tobytes():
            request = self.scene_at(z), list(self.measured), self.free, self.times, self.limits
            motion, outputs, derivatives = motion_and_derivatives(*request)
            if len(derivatives) < self.times.size:
                numbers = zip(self.free, z * self.sizes, strict=True)
                values = ", ".join(f"{name} = {x:.6g}" for name, x in numbers)
                reason = motion.message or "it passes a singular position"
                raise InputError(f"fit: the motion with {values} has no derivatives to the end: {reason}")
            table = motion.columns(*outputs)
            off = np.array([table[name] - values for name, values in self.measured.items()]).T
            self._last = z.tobytes(), off, derivatives
        return self._last[1:]

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Return the scaled residuals (k c,)."""
        return (self._at(z)[0] / self.scales).ravel()

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives (k c, p) of the residuals."""
        scaled = self._at(z)[1] / self.scales[:, None] * self.sizes
        return np.asarray(scaled.reshape(-1, len(self.free)))

    def solution(self, z: np.ndarray, converged: bool) -> FitResult:
        """Return the fit with numbers z (p,), over their sizes."""
        residuals, off = self.residuals(z), self._at(z)[0]
        _, values, right = np.linalg.svd(self.jacobian(z), full_matrices=False)
        influence = np.sqrt(self.times.size) * np.linalg.norm(self.column_sizes / self.scales)
        known = values > max(INDETERMINATE * values.max(initial=0.0), NO_INFLUENCE * influence)
        variance = residuals @ residuals / (residuals.size - known.sum())
        covariance = variance * (right[known].T / values[known] ** 2) @ right[known]
        lost = (np.abs(right[~known]) > PART_OF_COMBINATION).any(axis=0)
        deviation = np.where(lost, np.nan, np.sqrt(np.diag(covariance)))
        with np.errstate(invalid="ignore"):
            correlations = covariance / np.outer(deviation, deviation)
        errors = np.where(lost, np.inf, deviation * self.sizes)
        return FitResult(
            scene=self.scene_at(z),
            numbers=dict(zip(self.free, (z * self.sizes).tolist(), strict=True)),
            errors=dict(zip(self.free, errors.tolist(), strict=True)),
            correlations=correlations,
            undetermined=tuple(
                {
                    name: x
                    for name, x in zip(self.free, row.tolist(), strict=True)
                    if abs(x) > PART_OF_COMBINATION
                }
                for row in right[~known]
            ),
            deviations=dict(zip(self.measured, np.sqrt((off**2).mean(axis=0)).tolist(), strict=True)),
            converged=converged,
        )
