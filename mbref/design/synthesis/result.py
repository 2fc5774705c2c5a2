"""SynthesisResult: the scene that a synthesis found, with its residuals, bounds and undetermined numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbref.design.derivatives.result import with_none
from mbref.scene import Scene


@dataclass(frozen=True, eq=False)
class SynthesisResult:
    """A scene whose motion comes nearest to a goal: values of c columns at k times.

    Attributes
    ----------
    scene : Scene
        The scene with the numbers found.
    numbers : dict of str to float
        Their values by path, SI units.
    at_bounds : dict of str to str
        ``"lower"`` or ``"upper"`` for each number that ends at a bound.
    undetermined : tuple of dict of str to float
        Combinations of changes of numbers, and of times of points, that do not change the goal's columns:
        of points in lengths of the mechanism, of other numbers relative to their values, of times in
        durations of the scene.
    columns : tuple of str
        The c columns.
    times : ndarray, shape (k,)
        Times of the goal, s; those that were found if none were given.
    wanted : ndarray, shape (k, c)
        Values of the columns that the goal asks for; NaN where any is good.
    residuals, residuals_before : ndarray, shape (k, c)
        Differences from the goal, in the columns' units, with the numbers found and with the scene's own;
        NaN where no value was wanted, and if the scene's own motion ends early.
    reached : bool
        Whether all residuals are rounding, 1e-9 of the mechanism's length or 1 rad.
    converged : bool
        Whether the search ended at a local minimum.
    starts : tuple of (float or None)
        Size of the residuals from each start that was tried: the root of the mean square, or the largest one,
        in natural units; None where the search could not begin or go on.
    refused : int
        Number of trials from which the search stepped back.
    last_reason : str
        A sentence on the last of them.
    """

    scene: Scene
    numbers: dict[str, float]
    at_bounds: dict[str, str]
    undetermined: tuple[dict[str, float], ...]
    columns: tuple[str, ...]
    times: np.ndarray
    wanted: np.ndarray
    residuals: np.ndarray
    residuals_before: np.ndarray
    reached: bool
    converged: bool
    starts: tuple[float | None, ...]
    refused: int
    last_reason: str

    def to_record(self) -> dict[str, Any]:
        """Return the attributes by name as numbers, lists and text, for JSON, with the scene's tables.

        Returns
        -------
        dict
            Residuals that are NaN are None.
        """
        return {
            **vars(self),
            "scene": self.scene.to_dict(),
            "undetermined": list(self.undetermined),
            "columns": list(self.columns),
            "times": self.times.tolist(),
            "wanted": with_none(self.wanted),
            "residuals": with_none(self.residuals),
            "residuals_before": with_none(self.residuals_before),
            "starts": list(self.starts),
        }
