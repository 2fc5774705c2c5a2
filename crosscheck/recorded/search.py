"""The search for the cause of a difference, within a limit of CPU time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from crosscheck.judge.deadline import TimeIsUp, within
from crosscheck.recorded.changed_scenes import changed
from crosscheck.recorded.column_errors import Compared
from crosscheck.recorded.explanations import CELLS, Cause, Difference, Explanation, accepted, joined, simplest
from crosscheck.recorded.leaps import leaps
from crosscheck.recorded.pairs_of_explanations import pairs
from crosscheck.recorded.simple_causes import simple
from mbref.scene import Scene

SECONDS = 20.0  # CPU seconds of a search
FITTED = 2  # parameters of a changed scene: the kind of change and its number
SAMPLES = 400  # samples of a table that are searched; more add no information about a cause


@dataclass(frozen=True)
class Search:
    """Explanation of a difference, the number of equally simple explanations, and whether the search ended
    before its limit of time."""

    explanations: tuple[Explanation, ...] = ()
    alike: int = 0
    is_complete: bool = True


def search(
    scene: Scene, compared: Compared, later: Mapping[str, Callable[[np.ndarray], np.ndarray]], end: float
) -> Search:
    """Return the simplest change that explains a table, within SECONDS of CPU time.

    Simple causes come first. Changed scenes are tried too, unless a cause without a fitted number explains
    the table. Pairs of simple causes are tried last. ``later`` are the exact columns from 0 to ``end`` (s).
    """
    found: list[tuple[Explanation, Cause]] = []
    difference = _difference(compared, later, end, leaps(scene, compared.times))
    if difference.is_absurd or difference.cells < CELLS:
        return Search()
    is_complete = True
    try:
        with within(SECONDS):
            for one in accepted(difference, _causes(scene, difference, found)):
                found.append(one)
    except TimeIsUp:
        is_complete = False
    different = [explanation for explanation, _ in simplest(difference, found)]
    return Search(joined(different), len(different), is_complete)


def _causes(scene: Scene, difference: Difference, found: list[tuple[Explanation, Cause]]) -> Iterator[Cause]:
    """Return the causes to be tried; ``found`` grows by those that explain the difference."""
    yield from simple(difference)
    if difference.cells < FITTED * CELLS:
        return
    if not any(e.complexity == 1 for e, _ in found):
        yield from changed(scene, difference)
    if not found:
        yield from pairs(difference, simple(difference))


def _difference(
    compared: Compared,
    later: Mapping[str, Callable[[np.ndarray], np.ndarray]],
    end: float,
    at_leaps: Collection[int],
) -> Difference:
    """Return the difference at SAMPLES samples or fewer, without those at leaps, which have two sides."""
    smooth = np.setdiff1d(np.arange(len(compared.times)), [*at_leaps])
    rows = smooth[np.unique(np.linspace(0, len(smooth) - 1, min(len(smooth), SAMPLES)).astype(int))]
    recorded, exact = ({n: c[rows] for n, c in of.items()} for of in (compared.recorded, compared.exact))
    return Difference(
        compared.times[rows],
        recorded,
        exact,
        compared.scale,
        later,
        end=end,
        allowed={n: np.maximum(compared.allowed(n), compared.rounding[n])[rows] for n in recorded},
        every=(compared.times, compared.exact),
    )
