"""Many scenes by one method in one process: scenes of equal structure are simulated in batches."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mbref.ensembles.batch import BatchResult, may_lead, run_batch
from mbref.equations.parts import shape_of
from mbref.method import Method
from mbref.motions.motion import Motion
from mbref.scene import Scene
from mbref.simulation.runs import DROPS
from mbref.simulation.simulate import checked_run, finish_run, simulate
from mbref.stepping import preparation
from mbref.stepping.limits import Limits
from mbref.stepping.run import Run
from mbref.taylor.preparation import prepare_series

FEW = 0.5  # fraction of a batch that must complete; otherwise single runs follow instead of further batches


@dataclass
class Ended:
    """Runs of several scenes, by index, and the exceptions of scenes that cannot be simulated.

    ``batches`` contain the indices of their scenes, and the completed runs.
    """

    alone: dict[int, Motion] = field(default_factory=dict)
    batches: list[tuple[list[int], BatchResult]] = field(default_factory=list)
    errors: dict[int, Exception] = field(default_factory=dict)
    seconds: float = 0.0  # s of CPU time

    @property
    def error(self) -> Exception | None:
        """The exception of the first scene that cannot be simulated."""
        return self.errors[min(self.errors)] if self.errors else None

    def motions(self, scenes: Sequence[Scene]) -> Iterator[tuple[int, Motion]]:
        """Yield index and motion of every run."""
        yield from self.alone.items()
        for places, batch in self.batches:
            for k, motion in batch.motions([scenes[place] for place in places]):
                yield places[k], motion


def simulate_all(
    scenes: Sequence[Scene], method: Method | str, times: np.ndarray, limits: Limits
) -> list[Motion]:
    """Return the motions of the scenes. Each motion equals the result of ``simulate`` for the scene. Raises
    the errors of ``simulate``."""
    scenes = [scene.reaching(times[-1]) for scene in scenes]
    ended = run_all(scenes, method, times, limits)
    if ended.error:
        raise ended.error
    found = dict(ended.motions(scenes))
    return [found[place] for place in range(len(scenes))]


def run_all(scenes: Sequence[Scene], method: Method | str, times: np.ndarray, limits: Limits) -> Ended:
    """Simulate the scenes."""
    method = Method.parse(method) if isinstance(method, str) else method
    preparation.prepare(method)  # before the clock, by which an ensemble chooses how many runs go together
    if method.is_series:
        for scene in scenes:
            prepare_series(scene)
    began = time.thread_time()
    runs = _Runs(scenes, method, times, limits)
    for places in _by_shape(scenes):
        if _can_lead(method, limits):
            runs.in_batches(places)
        else:
            runs.alone(places)
    runs.ended.seconds = time.thread_time() - began
    return runs.ended


def _by_shape(scenes: Sequence[Scene]) -> Sequence[list[int]]:
    """Return the indices of scenes of equal structure, in groups."""
    groups: dict[object, list[int]] = {}
    for place, scene in enumerate(scenes):
        groups.setdefault(shape_of(scene), []).append(place)
    return list(groups.values())


def _can_lead(method: Method, limits: Limits) -> bool:
    """Return whether runs of a method may lead batches: runs by `taylor` along smooth branches."""
    return method.is_series and limits.rank_tolerance <= DROPS and not limits.branches


class _Runs:
    """Runs of scenes: first a single run for each structure, then a batch if that run may lead one."""

    def __init__(self, scenes: Sequence[Scene], method: Method, times: np.ndarray, limits: Limits):
        self.ended, self._scenes, self._arguments = Ended(), scenes, (method, times, limits)

    def alone(self, places: Iterable[int]) -> None:
        """Run the scenes with these indices one by one."""
        for place in places:
            try:
                self.ended.alone[place] = simulate(self._scenes[place], *self._arguments)
            except Exception as error:  # reported after the successful runs
                self.ended.errors[place] = error

    def in_batches(self, places: list[int]) -> None:
        """Run scenes of equal structure with these indices."""
        while places:
            try:
                run = checked_run(self._scenes[places[0]], *self._arguments)
                self.ended.alone[places[0]] = finish_run(run)
            except Exception as error:
                self.ended.errors[places[0]] = error
                places = places[1:]
                continue
            places = self._led(run, places[1:])
            run.release()

    def _led(self, run: Run, places: list[int]) -> list[int]:
        """Run the batch of a lead run; returns the indices of the scenes that remain."""
        if not places or not may_lead(run):
            return places
        try:
            batch = run_batch(run, [self._scenes[place] for place in places])
        except np.linalg.LinAlgError:  # the numbers of one scene can make a matrix singular
            self.alone(places)
            return []
        self.ended.batches.append((places, batch))
        completed = set(batch.places)
        left = [place for k, place in enumerate(places) if k not in completed]
        if len(left) <= FEW * len(places):
            return left
        self.alone(left)
        return []
