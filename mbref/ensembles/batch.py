"""Batches: scenes that differ from a lead scene in numbers only, simulated in its memory by `taylor`,
one after another.

All scenes are prepared at once, in arrays whose first axis is the scene. A scene of a batch must have the
rank and the active rows and columns of the lead scene, and complete in one call of the stepper. It must not
start at a singular position or have contradicting drivers. All other scenes are simulated by single runs.
The results agree to the bit with runs of single scenes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from mbref.ensembles.candidates import Candidates, candidates_of
from mbref.equations.evaluated_together import Parameters
from mbref.equations.initial_state import LARGE
from mbref.equations.joint_reactions import lazy_reactions
from mbref.equations.model import motion_of
from mbref.equations.offsets import counted_angles
from mbref.equations.structure import Structure
from mbref.kernels.layout import OperationCounts
from mbref.kernels.memory_pool import SavedNumbers
from mbref.motions.crossing import Crossing
from mbref.motions.motion import Motion
from mbref.scene import Scene
from mbref.simulation.outcome import OUTCOMES, cost_of, facts_of, lazy_crossings, report_of
from mbref.stepping.leaving import begins_at_rest, begins_in_motion
from mbref.stepping.loop import DONE
from mbref.stepping.run import NEARLY, Run
from mbref.taylor.stepper import SeriesStepper


def may_lead(run: Run) -> bool:
    """Return whether a completed run by `taylor` may lead a batch: it started regularly, and one call of the
    stepper completed it."""
    is_small = run.reduction is not None and run.model.m <= LARGE and run.ranks.least >= NEARLY
    completed = run.memory.loop.clock.sample == run.times.size and _stepper(run).was_short
    return bool(is_small and completed and not (begins_at_rest(run) or begins_in_motion(run)))


def _stepper(run: Run) -> SeriesStepper:
    """Return the stepper of a run by `taylor`."""
    assert isinstance(run.stepper, SeriesStepper)
    return run.stepper


class BatchResult(NamedTuple):
    """The s completed runs of a batch, each with k samples.

    Fields are ``places`` (s), the indices of the scenes; poses (s, k, nb, …) with the names of a Motion;
    coordinates (s, k, nb, 7); multipliers (s, k, m); angles of joints (s, k, a); ``layout.Counts`` (s, 6);
    the seconds of stepping (s) and construction; and the message and the passed singular positions of each
    run.
    """

    places: list[int]
    times: np.ndarray
    poses: dict[str, np.ndarray]
    coordinates: np.ndarray
    multipliers: np.ndarray
    angles: np.ndarray
    counts: np.ndarray
    seconds: list[float]
    built: float
    messages: list[str]
    crossings: list[Sequence[Crossing]]
    facts: dict[str, Any]
    structure: Structure

    def motions(self, scenes: Sequence[Scene]) -> Iterator[tuple[int, Motion]]:
        """Return index and motion of each run; ``scenes`` are all scenes of the batch."""
        for k, place in enumerate(self.places):
            poses = {name: array[k] for name, array in self.poses.items()}
            yield (
                place,
                Motion(
                    **{**self.facts, "scene": scenes[place].name},
                    mechanism=scenes[place],
                    times=self.times,
                    **poses,
                    **lazy_reactions(
                        scenes[place], self.times, self.coordinates[k], self.multipliers[k], self.angles[k]
                    ),
                    angles=counted_angles(scenes[place], self.structure, self.angles[k]),
                    outcome=OUTCOMES[DONE],
                    t_end=float(self.times[-1]),
                    message=self.messages[k],
                    crossings=self.crossings[k],
                    cost=cost_of(self.seconds[k], self.built, self.counts[k].tolist()),
                ),
            )


def run_batch(run: Run, scenes: Sequence[Scene]) -> BatchResult:
    """Simulate scenes in the memory of a run that may lead them; afterwards results of that run must not be
    read."""
    began = time.process_time()
    batch = Batch(run, candidates_of(run, scenes))
    places = batch.run()
    return batch.result(places, time.process_time() - began)


class Batch:
    """Runs of scenes in the memory of one run, which is reset to its start."""

    def __init__(self, run: Run, candidates: Candidates):
        self._run, self._candidates, self._stepper = run, candidates, _stepper(run)
        run.begin_again()
        self._stepper.begin_again()
        count, memory = len(candidates.q), run.memory
        self._crossings: dict[int, Sequence[Crossing]] = {}
        of_stepper, self._fit = self._stepper.parameters(candidates.packs, candidates.q, candidates.fit)
        parameters = [*candidates.parameters(run, memory), *of_stepper]
        self._parameters = Parameters(parameters, SavedNumbers(self._stepper.taylor))
        self._samples = [np.empty((count, *each.shape)) for each in memory.loop.samples]
        self._counts = np.empty((count, len(OperationCounts._fields)), dtype=np.int64)
        self._seconds = np.zeros(count)

    def _keep(self, place: int) -> None:
        """Store samples and counts of the scene with the given index."""
        memory = self._run.memory
        for kept, samples in zip(self._samples, memory.loop.samples, strict=True):
            kept[place] = samples
        self._counts[place] = tuple(memory.equations.system.counts)

    def run(self) -> list[int]:
        """Run the scenes of equal structure; returns the indices of those that completed in one call."""
        run, completed = self._run, []
        for k in self._fit:
            self._parameters.write(k)
            run.crossings = []
            status, self._seconds[k] = self._stepper.advance_once()
            if status == DONE:
                self._keep(k)
                completed.append(k)
                if run.crossings:
                    self._crossings[k] = lazy_crossings(self._candidates.packs.scenes[k], run.crossings)
        return completed

    def result(self, places: list[int], seconds: float) -> BatchResult:
        """Return the runs with these indices, which together took the given CPU seconds."""
        packs, nb = self._candidates.packs, self._run.model.nb
        shape = len(places), self._run.times.size, nb
        q, v, a, multipliers, angles = (each[places] for each in self._samples)
        q, v, a = q.reshape(*shape, 7), v.reshape(*shape, 6), a.reshape(*shape, 6)
        principal = packs.principal[places][:, None] if packs.turns_frames else None
        stepping, crossings = self._seconds[places], [self._crossings.get(k, ()) for k in places]
        starts = ((self._candidates.starts[k], self._candidates.ranks[k]) for k in places)
        messages = [report_of(*start, len(c)) for start, c in zip(starts, crossings, strict=True)]
        return BatchResult(
            places=places,
            times=self._run.times,
            poses=motion_of(q, v, a, principal, len(self._run.scene.body)),
            coordinates=q,
            multipliers=multipliers,
            angles=angles,
            structure=self._run.model.structure,
            counts=self._counts[places],
            seconds=stepping.tolist(),
            built=(seconds - float(stepping.sum())) / max(1, len(places)),
            messages=messages,
            crossings=crossings,
            facts=facts_of(self._run),
        )
