"""sensitivities: derivatives of outputs of a motion with respect to numbers of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbref.design.derivatives.columns import Columns, differentiable
from mbref.design.derivatives.followed import Followed
from mbref.design.derivatives.numbers_of_scene import (
    AccurateStencils,
    SceneNumber,
    is_of_point,
    scene_numbers,
)
from mbref.design.derivatives.panels import Precision, gauss
from mbref.design.derivatives.paths_of_numbers import unit_of_number
from mbref.design.derivatives.result import Sensitivities
from mbref.design.derivatives.start_numbers import StartNumber, is_of_start, start_number
from mbref.design.derivatives.states import States, joined, refuse_abrupt_springs
from mbref.design.derivatives.tangents import TangentRows, partition_of
from mbref.design.derivatives.variational import Changes, VariationalEquations
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.input_error import InputError
from mbref.method import SERIES_METHOD, Method, default_method
from mbref.motions.motion import Motion
from mbref.motions.outputs import UNIT_OF, quantity_of
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene, intermittent, refuse_rolling, refuse_turned
from mbref.scene.paths import located_at
from mbref.scenes import find_scene
from mbref.simulation.simulate import SAMPLES, checked_times
from mbref.stepping.limits import FINEST, Limits

# of a solution, and of a more accurate one. A step h (lengths of the shortest spring, or shares of a number)
# has a truncation of about 600 h⁸ and a rounding of 2e-16/h
FIRST_PRECISION, SECOND_PRECISION = Precision(16, 0.02), Precision(20, 0.01)
RTOL = 1e-12  # default relative tolerance of the runs
FINER = 0.1  # tolerance of the more accurate run / tolerance
ORDER = 24  # order of the series of the more accurate run
DIFFERENCE_ROUNDING = 2e-14  # error of a difference of order 8 / largest derivative over the samples
MOST_ROWS = 1500  # constraint rows, whose singular values take seconds


def sensitivities(
    scene: Scene | str | Path,
    of: Sequence[str],
    to: Sequence[str],
    times: Sequence[float] | np.ndarray | None = None,
    limits: Limits | None = None,
) -> Sensitivities:
    """Return derivatives of outputs of a motion with respect to numbers of the scene.

    They follow from the variational equations of the motion. All other numbers of the scene stay as they are:
    loops stay closed because an anchor is one point of the world at t = 0, fixed in both bodies.

    Parameters
    ----------
    scene : Scene, str or path
        A Scene, the name of a built-in one, or a .toml file.
    of : sequence of str
        Outputs: columns of ``Motion.columns`` or their beginnings, such as ``"rod.position"``.
    to : sequence of str
        Numbers: paths of the scene such as ``"body[rod].mass"``, ``"joint[B].anchor.x"``, ``"gravity.y"``
        and ``"load[0].stiffness"``; at the start ``"joint[A].angle(0)"``, ``displacement(0)``, ``rate(0)``
        and ``displacement_rate(0)``.
    times : sequence of float or ndarray, shape (k,), optional
        Increasing sample times, s. Default: 101 from 0 to the scene's duration.
    limits : Limits, optional
        Tolerances of the runs. Default: a relative tolerance of 1e-12.

    Returns
    -------
    Sensitivities
        Derivatives, with estimated errors.

    Raises
    ------
    SceneError
        If the scene cannot be simulated, has no number at a path, or starts where the ends of a spring meet
        and its force has no direction.
    InputError
        If an output has no derivative, if the motion does not depend smoothly on a number, if a number moves
        the time of a switch or opens a loop, or if constraints have intervals or end stops.
    """
    request = DerivativeRequest(find_scene(scene), of, to, times)
    limits = limits or Limits(rtol=RTOL)
    first = request.solved(request.method, limits, FIRST_PRECISION)
    finer = replace(limits, rtol=max(FINEST, FINER * limits.rtol), atol=None)
    by = Method.parse(f"{SERIES_METHOD}[order={ORDER}]") if request.method.is_series else request.method
    second = request.solved(by, finer, SECOND_PRECISION, first.run)
    found, finest = request.derivatives([first, second])
    request.model.release()
    return compared(found, finest, request)


def motion_and_derivatives(
    scene: Scene,
    of: Sequence[str],
    to: Sequence[str],
    times: np.ndarray,
    limits: Limits,
    accurate: AccurateStencils | None = None,
) -> tuple[Motion, list[str], np.ndarray]:
    """Return the motion at times (k,), s, the outputs' names, and their derivatives (k, outputs, numbers) up
    to a singular position, without an estimate of their errors. ``accurate`` are stencils of numbers that are
    tried first, see ``scene_numbers``. Raises the errors of ``sensitivities``."""
    request = DerivativeRequest(scene, of, to, times, accurate)
    solution = request.solved(request.method, limits, FIRST_PRECISION)
    (found,) = request.derivatives([solution])
    request.model.release()
    return solution.run.motion, found.outputs, found.values


def _refuse(scene: Scene, of: Sequence[str] | None, to: Sequence[str] | None) -> None:
    """Raise InputError for scenes without derivatives, and for an empty list of outputs or numbers."""
    if path := next(intermittent(scene), ""):
        raise InputError(f"{path}: motions with intervals, conditions and stops have no derivatives here")
    if of is not None:
        _refuse_no_list("of", of)
    if to is not None:
        refuse_repeats(scene, "to", to)


def _refuse_no_list(name: str, given: Sequence[str]) -> None:
    if isinstance(given, str) or not len(given):
        raise InputError(f"{name}: needs a list of one name at least, got {given!r}")


def refuse_repeats(scene: Scene, name: str, labels: Sequence[str]) -> None:
    """Raise InputError unless labels are a list, and for a number of the scene that is given twice."""
    _refuse_no_list(name, labels)
    fields = dict(scene)
    found: dict[tuple[str | int, ...], str] = {}
    for label in labels:
        place = (label,) if is_of_start(label) else located_at(fields, label)[1]
        if place in found:
            raise InputError(f"{name}: {found[place]} and {label} are one number; give it once")
        found[place] = label


class Derivatives(NamedTuple):
    """Time (s) of the first singular position, names of the outputs, derivatives (k, outputs, numbers) at the
    samples reached of a run, and the rounding of their differences."""

    undecided_from: float
    outputs: list[str]
    values: np.ndarray
    rounding: np.ndarray


class Solution(NamedTuple):
    """A run, the step of differences of outputs, and the changes of its samples by numbers with labels."""

    run: Followed
    step: float
    found: Changes
    labels: list[str]


class DerivativeRequest:
    """A scene's motion at samples (k,), s, its outputs, and the numbers by which it is differentiated."""

    def __init__(
        self,
        scene: Scene,
        of: Sequence[str] | None,
        labels: Sequence[str] | None,
        times: Sequence[float] | np.ndarray | None,
        accurate: AccurateStencils | None = None,
    ):
        self.accurate = accurate
        self.samples = checked_times(np.linspace(0.0, scene.duration, SAMPLES) if times is None else times)
        if self.samples[-1] > scene.duration:
            scene = scene.with_(duration=float(self.samples[-1]))
        _refuse(scene, of, labels)
        self.scene, self.of, self.labels = scene, of or (), tuple(labels or ())
        refuse_rolling(scene, "derivatives")
        refuse_turned(scene, "derivatives")
        self.model = Model(assembled(scene))
        if self.model.m > MOST_ROWS:
            count = f"{scene.name}: {self.model.m} constraint rows"
            raise InputError(f"{count}; derivatives are for up to {MOST_ROWS}")
        self.method = Method.parse(default_method(scene))
        self.motion: Motion | None = None  # of the first solution
        self.units = [unit_of_number(scene, label) for label in self.labels]

    @cached_property
    def numbers(self) -> list[SceneNumber]:
        """The numbers that are fields of the scene."""
        fields = [label for label in self.labels if not is_of_start(label)]
        return scene_numbers(self.scene, fields, self.model, self.accurate)

    @property
    def has_points(self) -> bool:
        """Whether a number is a coordinate of a point."""
        return any(map(is_of_point, self.labels))

    @cached_property
    def outputs(self) -> list[str]:
        """The columns of the motion that are differentiated."""
        assert self.motion is not None
        return differentiable(self.motion, self.of)

    def solved(
        self, method: Method, limits: Limits, precision: Precision, before: Followed | None = None
    ) -> Solution:
        """Return a run by a method and its changes by the numbers; it has the panels of a run ``before``."""
        model, step = self.model, precision.step
        run = Followed.of(self.scene, model, method, limits, self.samples, gauss(precision.points), before)
        if before is None and run.undecided_from > 0.0:  # a second run has the same start
            basis = TangentRows(model, run.first, partition_of(model, run.first)).basis[0]
            refuse_abrupt_springs(model, run.first, basis, self.has_points)
        self.motion = self.motion or run.motion
        started = [label for label in self.labels if is_of_start(label)]
        of_start = [start_number(label, self.motion, model, run.first, step) for label in started]
        every: list[SceneNumber | StartNumber] = [*self.numbers, *of_start]
        starts = [(number.x, number.v) for number in every]
        found = VariationalEquations(model, run, self.numbers).changes(starts)
        return Solution(run, step, found, [number.label for number in every])

    def derivatives(self, solutions: Sequence[Solution]) -> list[Derivatives]:
        """Return the derivatives of the outputs of each solution; all are computed in common arrays."""
        model, labels, numbers = self.model, solutions[0].labels, {n.label: n for n in self.numbers}
        states, count = joined([each.found.states for each in solutions]), len(labels)
        sizes = [len(each.found.states.times) for each in solutions]
        steps = np.repeat([each.step for each in solutions], sizes)
        along = [joined(each) for each in zip(*(s.found.along for s in solutions), strict=True)]
        assert self.motion is not None
        columns = Columns(self.motion, self.outputs, np.tile(steps, count))
        both = columns.along(model, joined([states] * count), joined(along))
        values, rounding = (part.reshape(count, sum(sizes), len(self.outputs)) for part in both)
        for k, number in enumerate(map(numbers.get, labels)):
            if number is not None:
                own, rounded = columns.by_number(number, states, model)
                values[k] += own
                rounding[k] += rounded
        signs = self._signs(self.outputs, states, sizes)[..., None]
        order = [labels.index(label) for label in self.labels]
        parts = [
            np.split(part[order].transpose(1, 2, 0), np.cumsum(sizes)[:-1]) for part in (values, rounding)
        ]
        parts.insert(0, np.split(signs, np.cumsum(sizes)[:-1]))
        return [
            Derivatives(solution.run.undecided_from, self.outputs, sign * value, rounded)
            for solution, sign, value, rounded in zip(solutions, *parts, strict=True)
        ]

    def _signs(self, names: Sequence[str], states: States, sizes: Sequence[int]) -> np.ndarray:
        """Return -1 for columns (k, outputs) of quaternions that have the other sign in the first motion. The
        states are of solutions with some first samples each, whose numbers are ``sizes``."""
        assert self.motion is not None
        k, model = states.times.size, self.model
        if not k:  # the motion meets a singular position before the first sample
            return np.ones((0, len(names)))
        arrays = states.q.reshape(k, -1, 7), states.v.reshape(k, -1, 6), states.a.reshape(k, -1, 6)
        own = model.motion(*arrays)["orientation"]
        first = np.concatenate([self.motion.orientation[:size] for size in sizes])
        signs = np.where((own * first).sum(axis=2) < 0.0, -1.0, 1.0)
        bodies = {f"{name}.orientation": b for b, name in enumerate(self.motion.bodies)}
        places = [bodies.get(name.rpartition(".")[0]) for name in names]
        columns = [np.ones(k) if place is None else signs[:, place] for place in places]
        return np.array(columns).T.reshape(k, len(names))

    def errors(self, values: np.ndarray) -> np.ndarray:
        """Return the errors (k, o, p) that differences of the scene's arrays and of states leave in
        derivatives."""
        relative = {number.label: number.error for number in self.numbers}
        share = np.array([DIFFERENCE_ROUNDING + relative.get(label, 0.0) for label in self.labels])
        return np.asarray(share * np.abs(values).max(axis=0, initial=0.0, keepdims=True))


def compared(first: Derivatives, second: Derivatives, request: DerivativeRequest) -> Sensitivities:
    """Return the more accurate derivatives, with the difference of both as their error."""
    count, samples = min(len(first.values), len(second.values)), request.samples
    values = np.full((samples.size, *second.values.shape[1:]), np.nan)
    errors = values.copy()
    values[:count] = second.values[:count]
    difference = np.abs(first.values[:count] - values[:count])
    errors[:count] = difference + second.rounding[:count] + request.errors(values[:count])
    motion, t = request.motion, min(first.undecided_from, second.undecided_from)
    assert motion is not None
    outcome, message = motion.outcome, motion.message
    if count < motion.times.size:
        outcome = Outcome.UNDECIDED
        message = f"derivatives end at the singular position at t = {t:.6g} s, where the motion may branch"
    units = tuple(
        tuple(f"({UNIT_OF[quantity_of(output)] or 1})/({unit or 'SI'})" for unit in request.units)
        for output in second.outputs
    )
    return Sensitivities(
        samples, tuple(second.outputs), request.labels, units, values, errors, outcome, message, motion
    )
