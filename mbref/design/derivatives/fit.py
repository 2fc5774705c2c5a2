"""fit: numbers of a scene from measured columns of its motion, by least squares with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mbref.design.derivatives.columns import without_derivative
from mbref.design.derivatives.free_numbers import FreeNumbers
from mbref.design.derivatives.given_values import nearest_signs, refuse_wrapped
from mbref.design.derivatives.natural_units import natural_units
from mbref.design.derivatives.numbers_of_scene import AccurateStencils
from mbref.design.derivatives.result import with_none
from mbref.design.derivatives.sensitivities import motion_and_derivatives, refuse_repeats
from mbref.design.derivatives.tables import NumberTable, columns_of_numbers, refuse_not_finite
from mbref.design.derivatives.undetermined import SingularDirections
from mbref.input_error import InputError
from mbref.motions.outputs import chosen
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import checked_times, simulate
from mbref.stepping.limits import Limits

FIT_RTOL = 1e-10  # relative tolerance of the runs; derivatives then have about eight digits
# change of all columns over their sizes if a number doubles, that is rounding of derivatives (1e-14)
NO_INFLUENCE = 1e-10
CONSTANT = 1e-8  # standard deviation of a column / its size that is an error of the runs (1e-10) or rounding
FEWEST_FREE = 3  # degrees of freedom of a column's residuals, from which their own variance counts
FIT_TOLERANCE = 1e-12  # relative changes of the sum of squares and of the numbers that end the iteration


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
        Combinations of relative changes of the numbers found, of points in lengths of the mechanism, by
        path, that change no column.
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
    measured: NumberTable,
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
        free ones; if a measured number is not finite; if an angle loses full turns; if a free number is given
        twice or is of the start; if a motion that is tried ends early; and for the reasons of
        ``sensitivities``.
    """
    from scipy.optimize import least_squares

    scene = find_scene(scene)
    refuse_repeats(scene, "free", free)
    times, columns = _timed(measured)
    motion = simulate(scene, times=times[:1])
    left_out = without_derivative(motion, [*columns]) if of is None else {}
    used = [name for name in columns if name not in left_out] if of is None else chosen(columns, of)
    if used != (whole := chosen(motion.columns(), used)):
        raise InputError(f"measured: name whole columns: {', '.join(whole)}")
    refuse_not_finite(chosen_columns := {name: columns[name] for name in used}, "measured")
    problem = _Problem(scene, times, chosen_columns, free, limits or Limits(rtol=FIT_RTOL))
    begin, lowest = problem.numbers.start / problem.sizes, problem.numbers.lowest
    problem.refuse_wrapped(begin)
    tolerances = {name: FIT_TOLERANCE for name in ("ftol", "xtol", "gtol")}
    found = least_squares(problem.residuals, begin, problem.jacobian, bounds=(lowest, np.inf), **tolerances)
    return replace(problem.solution(found.x, found.status > 0), left_out=(*left_out,))


def _timed(measured: NumberTable) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the times (k,) and columns (k,) of a table; raises InputError if either is missing."""
    columns = columns_of_numbers(measured, "measured")
    if "time" not in columns or len(columns) < 2:
        raise InputError("measured: needs time and one column at least, of equal lengths")
    refuse_not_finite({"time": columns["time"]}, "measured")
    return checked_times(columns.pop("time")), columns


def _column_sizes(scene: Scene, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the largest values (c,) of columns, or their natural units if these are larger."""
    return np.maximum(natural_units(scene, [*columns]), [np.abs(values).max() for values in columns.values()])


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
        self.numbers, self.free, self.limits = FreeNumbers(scene, "free", free), tuple(free), limits
        self.times, self.measured, self.sizes = times, measured, self.numbers.sizes
        self.given = np.array([*measured.values()]).T
        if (count := times.size * len(measured)) <= len(free):
            raise InputError(
                f"measured: has {count} numbers in columns with derivatives, and {len(free)} free ones "
                f"need {len(free) + 1} at least"
            )
        spread = np.array([values.std() for values in measured.values()])
        self.column_sizes = _column_sizes(scene, measured)
        self.scales = np.where(spread > CONSTANT * self.column_sizes, spread, self.column_sizes)
        self._accurate: AccurateStencils = {}
        self._last: tuple[bytes, np.ndarray, np.ndarray] | None = None

    def _at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the differences (k, c) of the motion's columns from the measured ones, and their derivatives
        (k, c, p)."""
        if self._last is None or self._last[0] != z.tobytes():
            request = self.numbers.scene_at(z), list(self.measured), self.free, self.times, self.limits
            motion, outputs, derivatives = motion_and_derivatives(*request, self._accurate)
            if len(derivatives) < self.times.size:
                values = ", ".join(f"{name} = {x:.6g}" for name, x in self.numbers.values(z).items())
                reason = motion.message or "it passes a singular position"
                raise InputError(f"fit: the motion with {values} has no derivatives to the end: {reason}")
            table, given = motion.columns(*outputs), self.given
            found = np.array([table[name] for name in self.measured]).T
            off = found - nearest_signs([*self.measured], given, found) * given
            self._last = z.tobytes(), off, derivatives
        return self._last[1:]

    def refuse_wrapped(self, z: np.ndarray) -> None:
        """Raise InputError for a measured column of angles that loses full turns, by the motion with numbers
        z."""
        refuse_wrapped([*self.measured], self.given, self._at(z)[0] + self.given, self.times, "measured")

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Return the scaled residuals (k c,)."""
        return (self._at(z)[0] / self.scales).ravel()

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives (k c, p) of the residuals."""
        scaled = self._at(z)[1] / self.scales[:, None] * self.sizes
        return np.asarray(scaled.reshape(-1, len(self.free)))

    def _covariance(self, residuals: np.ndarray, inverse: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """Return the covariance (p, p) of the numbers over their sizes in ``jacobian`` (k c, p), by the
        variance of each column's residuals; ``inverse`` (p, p) is the inverse of JᵀJ in the determined
        directions.

        The residuals of a column lose tr(J_c (JᵀJ)⁻¹ J_cᵀ) degrees of freedom to the numbers. Where less than
        FEWEST_FREE are left, the residuals of all columns give the variance.
        """
        count = len(self.measured)
        by_column = jacobian.reshape(self.times.size, count, -1)
        squares = np.einsum("kcp,kcq->cpq", by_column, by_column)
        scatter = (residuals.reshape(-1, count) ** 2).sum(axis=0)
        free = self.times.size - np.einsum("pq,cqp->c", inverse, squares)
        own = scatter / np.maximum(free, FEWEST_FREE)
        variance = np.where(free >= FEWEST_FREE, own, scatter.sum() / free.sum())
        return np.asarray(inverse @ np.tensordot(variance, squares, 1) @ inverse)

    def solution(self, z: np.ndarray, converged: bool) -> FitResult:
        """Return the fit with numbers z (p,), over their sizes."""
        residuals, off = self.residuals(z), self._at(z)[0]
        influence = np.sqrt(self.times.size) * np.linalg.norm(self.column_sizes / self.scales)
        jacobian = self.jacobian(z)
        changes = np.sqrt((jacobian**2).mean(axis=0))
        jacobian = jacobian * (relative := self.numbers.relative(z, changes))
        directions = SingularDirections.of(jacobian, NO_INFLUENCE * influence)
        values, right, known = directions
        undetermined = directions.undetermined(self.free)
        covariance = self._covariance(
            residuals, (right[known].T / values[known] ** 2) @ right[known], jacobian
        )
        lost = [any(name in combination for combination in undetermined) for name in self.free]
        deviation = np.where(lost, np.nan, np.sqrt(np.diag(covariance)))
        with np.errstate(invalid="ignore"):
            correlations = covariance / np.outer(deviation, deviation)
        errors = np.where(lost, np.inf, deviation * self.sizes * relative)
        return FitResult(
            scene=self.numbers.scene_at(z),
            numbers=self.numbers.values(z),
            errors=dict(zip(self.free, errors.tolist(), strict=True)),
            correlations=correlations,
            undetermined=undetermined,
            deviations=dict(zip(self.measured, np.sqrt((off**2).mean(axis=0)).tolist(), strict=True)),
            converged=converged,
        )
