"""synthesise: numbers of a scene whose motion follows points or has least outputs, by exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from mbref.design.derivatives.free_numbers import FreeNumbers
from mbref.design.derivatives.tables import NumberTable
from mbref.design.derivatives.undetermined import SingularDirections
from mbref.design.synthesis.goals import Goal, followed_points, least_outputs
from mbref.design.synthesis.problem import SynthesisProblem
from mbref.design.synthesis.result import SynthesisResult
from mbref.design.synthesis.trust_region import SearchEnd, least_residuals, residual_size
from mbref.input_error import InputError
from mbref.scene import Scene, SceneError
from mbref.scenes import find_scene
from mbref.stepping.limits import Limits

RTOL_OF_TRIALS = 1e-11  # relative tolerance of the runs
ALL_REACHED = 1e-9  # largest residual (lengths of the mechanism or rad) that is rounding
AT_BOUND = 1e-9  # distance from a bound / size of the number that is rounding
DRAWN_PER_START = 20  # random numbers whose motion is computed for each start; the best ones begin a search
RANDOM_SPREAD = 0.3  # largest change of a number without bounds in a random start, sizes of the number
NO_EFFECT = 1e-10  # change of the residuals by a number of its size that is rounding


def synthesise(
    scene: Scene | str | Path,
    let: Sequence[str],
    follow: NumberTable | None = None,
    least: Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    peak: bool = False,
    times: Sequence[float] | np.ndarray | None = None,
    starts: int = 4,
    seed: int = 0,
    limits: Limits | None = None,
    progress: Callable[[float], None] | None = None,
) -> SynthesisResult:
    """Return the scene whose motion comes nearest to given points, or has the least outputs.

    The numbers ``let`` change, all others stay. Loops are closed, because an anchor is one point of the world
    at t = 0, fixed in both bodies; a trial whose motion ends early or meets a singular position is stepped
    back from. Residuals are relative to the mechanism's length, 1 rad, and so on. The search is local, by
    ``sensitivities`` and SciPy; it is repeated from random numbers, and the best result is returned.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    let : sequence of str
        Numbers that may change: paths of the scene such as ``"joint[B].anchor.x"``.
    follow : mapping of str to ndarray, shape (k,), or path, optional
        Columns of ``Motion.columns`` with their wanted values, SI units, NaN or empty where any is good; or a
        .csv file with a line of their names. With ``time`` (s) they are wanted at these times. Without, each
        point is reached at some time up to the scene's duration, in their order.
    least : sequence of str, optional
        In place of ``follow``: outputs that become as small as possible at ``times``, such as
        ``"driver(A).torque"``.
    bounds : mapping of str to (float, float), optional
        Lower and upper bound of numbers, SI units. Default: 0 below for masses, stiffnesses and alike.
    peak : bool
        Whether the largest residual is minimised, instead of the mean square.
    times : sequence of float or ndarray, shape (k,), optional
        Increasing times for ``least``, s. Default: 101 from 0 to the scene's duration.
    starts : int
        Number of starts: the scene's own numbers, and random ones within the bounds, or up to 0.3 lengths of
        the mechanism (of other numbers, of their values) away.
    seed : int
        Seed of the random starts.
    limits : Limits, optional
        Tolerances of the runs. Default: a relative tolerance of 1e-11.
    progress : callable, optional
        Called with the number of starts done, with fractions.

    Returns
    -------
    SynthesisResult
        The scene, its residuals, active bounds, and combinations that the goal does not determine.

    Raises
    ------
    SceneError
        If the scene has no number at a path.
    InputError
        If there is no goal or two; for an unknown column, a bound of no number, a number outside its bounds;
        if no start has a motion to the last time; and for the reasons of ``sensitivities``.
    """
    scene = find_scene(scene)
    if (follow is None) == (least is None):
        raise InputError("give a goal: points to follow, or outputs that become least")
    if starts < 1:
        raise InputError(f"starts: must be at least 1, got {starts}")
    numbers = FreeNumbers(scene, "let", let)
    goal = least_outputs(scene, least or (), times) if follow is None else followed_points(scene, follow)
    problem = SynthesisProblem(numbers, goal, limits or Limits(rtol=RTOL_OF_TRIALS), peak)
    box = problem.bounds(*_bounds(numbers, bounds or {}))
    search = _Search(problem, box, seed, progress or (lambda _: None))
    return search.result(search.best(starts))


def _bounds(numbers: FreeNumbers, given: Mapping[str, tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper bounds (p,) over the numbers' sizes."""
    lower, upper = numbers.lowest.copy(), np.full(len(numbers.labels), np.inf)
    for label, (least, most) in given.items():
        if label not in numbers.labels:
            raise InputError(f"bounds: {label} is none of the numbers that may change")
        k = numbers.labels.index(label)
        if not least < most:
            raise InputError(f"bounds: {label} needs a lower bound below the upper one, got {least}, {most}")
        if not least <= (own := float(numbers.start[k])) <= most:
            raise InputError(f"bounds: {label} is {own:g} in the scene, outside of {least:g} to {most:g}")
        lower[k], upper[k] = max(least, lower[k]), most
    return lower / numbers.sizes, upper / numbers.sizes


class _Search:
    """Searches from the scene's own numbers and from random ones; ``box`` are bounds of the variables."""

    def __init__(
        self,
        problem: SynthesisProblem,
        box: tuple[np.ndarray, np.ndarray],
        seed: int,
        progress: Callable[[float], None],
    ):
        self.problem, self.box, self.seed, self.progress = problem, box, seed, progress
        self.own = problem.with_times(problem.numbers.start / problem.numbers.sizes)
        self.sizes: list[float | None] = []

    def best(self, starts: int) -> SearchEnd:
        """Return the search with the least residuals; none follows one whose residuals are rounding."""
        best: SearchEnd | None = None
        for k, z in enumerate(self._starts(starts)):
            found = self._from(k, z)
            self.sizes.append(self._size(found) if found else None)
            if found and (best is None or self._size(found) < self._size(best)):
                best = found
            if best and self._is_reached(best):
                break
        if best is None:
            raise InputError(f"no start reaches the goal's last time: {self.problem.last_reason}")
        return best

    def _size(self, found: SearchEnd) -> float:
        return residual_size(found.residuals, self.problem.peak)

    def _from(self, k: int, z: np.ndarray | None) -> SearchEnd | None:
        """Return the search from the start with an index, None where it cannot begin or go on; raises the
        errors of the first derivatives, which hold for all starts."""
        problem = self.problem
        if z is None or np.isnan(problem.residuals(z)).any():
            return None

        def progress(share: float) -> None:
            self.progress(k + share)

        try:
            found = least_residuals(problem.residuals, problem.jacobian, z, self.box, problem.peak, progress)
        except (InputError, SceneError) as fault:
            if not problem.has_derivatives:
                raise
            problem.last_reason = str(fault)
            return None
        if (np.diff(problem.times_at(found.z)) < 0.0).any():
            problem.last_reason = "the points were reached in another order"
            return None
        return found

    def _starts(self, count: int) -> Iterator[np.ndarray | None]:
        """Yield the scene's own numbers, then the random ones with the least residuals; None if too few have
        a motion."""
        yield self.own
        if count == 1:
            return
        drawn = []
        for k in range(DRAWN_PER_START * (count - 1)):
            z = self.problem.with_times(self._drawn(k))
            if z is not None and np.isfinite(r := self.problem.residuals(z)).all():
                drawn.append((residual_size(r, self.problem.peak), k, z))
        best = [z for _, _, z in sorted(drawn, key=lambda each: each[:2])[: count - 1]]
        yield from [*best, *[None] * (count - 1 - len(best))]

    def _drawn(self, k: int) -> np.ndarray:
        """Return random numbers (p,), which do not depend on the order of the numbers."""
        numbers, (lower, upper) = self.problem.numbers, self.box
        own = numbers.start / numbers.sizes
        random, z = np.random.default_rng([self.seed, k]), own.copy()
        for j in sorted(range(len(own)), key=numbers.labels.__getitem__):
            least = lower[j] if np.isfinite(lower[j]) else own[j] - RANDOM_SPREAD
            most = upper[j] if np.isfinite(upper[j]) else own[j] + RANDOM_SPREAD
            z[j] = random.uniform(least, most)
        return z

    def _is_reached(self, found: SearchEnd) -> bool:
        scale = 1.0 if self.problem.peak else np.sqrt(len(found.residuals))
        return bool(np.abs(found.residuals).max() * scale <= ALL_REACHED)

    def result(self, found: SearchEnd) -> SynthesisResult:
        """Return the scene of a search, with all that is known of it."""
        problem, z = self.problem, found.z
        lower, upper = (np.abs(z - bound) <= AT_BOUND for bound in self.box)
        names, inside = np.array(problem.names), ~(lower | upper)
        labels, jacobian = problem.numbers.labels, problem.jacobian(z)
        changes = np.linalg.norm(jacobian, axis=0) / (np.sqrt(len(jacobian)) if problem.peak else 1.0)
        jacobian[:, : len(labels)] *= problem.numbers.relative(z[: len(labels)], changes[: len(labels)])
        return SynthesisResult(
            scene=problem.scene_at(z),
            numbers=problem.numbers.values(z[: len(labels)]),
            at_bounds={
                name: "lower" if low else "upper"
                for name, low, high in zip(labels, lower.tolist(), upper.tolist(), strict=False)
                if low or high
            },
            undetermined=SingularDirections.of(jacobian[:, inside], NO_EFFECT).undetermined(
                names[inside].tolist()
            ),
            columns=problem.goal.columns,
            times=problem.times_at(z),
            wanted=problem.goal.wanted,
            residuals=self._off(z, problem.goal),
            residuals_before=self._off(self.own, problem.goal),
            reached=self._is_reached(found),
            converged=found.converged,
            starts=tuple(self.sizes),
            refused=problem.refused,
            last_reason=problem.last_reason,
        )

    def _off(self, z: np.ndarray | None, goal: Goal) -> np.ndarray:
        """Return the differences (k, c) from the goal, NaN if there is no motion."""
        found = None if z is None else self.problem.values_at(z)
        return np.full(goal.wanted.shape, np.nan) if found is None else self.problem.off(found)
