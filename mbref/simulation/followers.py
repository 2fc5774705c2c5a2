"""Followers: scenes that differ from that of a run in numbers alone, run one after another in its memory.

All of them are set up at once, in arrays whose first axis counts them.  A follower must give the answers on
which the run's choice of rows and columns rests, begin on no singular position, and complete in one call of
the run's stepper, as the run itself; every other scene is left to a run of its own.  The results are those of
runs of their own, to the bit.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from mbref.equations.initial_state import LARGE
from mbref.equations.joint_reactions import Balance
from mbref.equations.model import motion_of
from mbref.kernels.copying import Bytes, copy_rows, rows_from, table_of
from mbref.kernels.layout import Counts
from mbref.motion import Motion
from mbref.scene import Scene
from mbref.simulation.comparison import may_leave
from mbref.simulation.crossings import Crossings
from mbref.simulation.evaluations import Rows
from mbref.simulation.group import Group, group_of
from mbref.simulation.outcome import OUTCOMES, cost_of, facts_of, reactions_of, report_of
from mbref.simulation.run import NEARLY, Run
from mbref.simulation.singular_start import begins_at_rest, begins_in_motion
from mbref.simulation.stepping import DONE
from mbref.trajectory import Crossing


def may_lead(run: Run) -> bool:
    """Whether a run that has ended was so ordinary that others may follow it."""
    ordinary = run.reduction is not None and run.model.m <= LARGE
    completed = run.memory.loop.clock.sample == run.times.size and not run.limits.branches
    return bool(ordinary and completed and run.stepper.was_short and run.ranks.least >= NEARLY)


class Followed(NamedTuple):
    """Runs that followed one: s completed ones, at k samples.

    ``places`` (s) among the scenes, poses (s, k, nb, …) as a Motion names them, coordinates (s, k, nb, 7),
    multipliers (s, k, m), ``layout.Counts`` (s, 6), the seconds of stepping (s) and construction, and the
    message and the singular positions passed of each.
    """

    places: list[int]
    times: np.ndarray
    poses: dict[str, np.ndarray]
    coordinates: np.ndarray
    multipliers: np.ndarray
    counts: np.ndarray
    seconds: list[float]
    built: float
    messages: list[str]
    crossings: list[Sequence[Crossing]]
    facts: dict[str, Any]

    def motions(self, scenes: Sequence[Scene]) -> Iterator[tuple[int, Motion]]:
        """The place and the motion of each; the scenes are those that were to follow."""
        for k, place in enumerate(self.places):
            poses = {name: array[k] for name, array in self.poses.items()}
            balance = Balance(scenes[place], self.times, self.coordinates[k], self.multipliers[k])
            yield (
                place,
                Motion(
                    **{**self.facts, "scene": scenes[place].name},
                    mechanism=scenes[place],
                    times=self.times,
                    **poses,
                    **reactions_of(balance),
                    outcome=OUTCOMES[DONE],
                    t_end=float(self.times[-1]),
                    message=self.messages[k],
                    crossings=self.crossings[k],
                    cost=cost_of(self.seconds[k], self.built, self.counts[k].tolist()),
                ),
            )


def follow(run: Run, scenes: Sequence[Scene]) -> Followed:
    """The scenes that followed a run that may lead them; its memory is theirs from now on."""
    began = time.process_time()
    group = group_of(run, scenes)
    ended = Runs(run, group)
    places = ended.run()
    return ended.followed(places, time.process_time() - began)


class Runs:
    """Runs of a group of scenes in the memory of one run."""

    def __init__(self, run: Run, group: Group):
        self._run, self._group = run, group
        self._rank = self._begin()
        count, memory = len(group.q), run.memory
        self._crossings: dict[int, Sequence[Crossing]] = {}
        numbers = [*group.numbers(run, memory), *run.stepper.numbers(group.packs.length)]
        self._begins = Rows(numbers, Bytes(run.stepper.memory))
        self._samples = [np.empty((count, *each.shape)) for each in memory.loop.samples]
        self._counts = np.empty((count, len(Counts._fields)), dtype=np.int64)
        sources: list[Any] = [*memory.loop.samples, memory.equations.system.counts]
        self._ends = table_of(rows_from(*each) for each in zip(sources, self._rows(), strict=True))
        self._seconds = np.zeros(count)

    def _begin(self) -> int:
        """Have memory as the run begins; the independent rows there, -1 where it begins extraordinarily."""
        run = self._run
        run.begin_again()
        run.stepper.enter()
        extraordinary = begins_at_rest(run) or begins_in_motion(run)
        rank = int(run.memory.watch.generic_rank)
        run.begin_again()
        return -1 if extraordinary else rank

    def _rows(self) -> list[np.ndarray]:
        """Arrays that take samples and counts."""
        return [*self._samples, self._counts]

    def run(self) -> list[int]:
        """Run the scenes that fit; the places of those that completed in one call."""
        run, stepper, completed = self._run, self._run.stepper, []
        for k in self._group.fit:
            self._begins.copy(k)
            run.crossings = []
            if not stepper.takes(lambda place=k: self._group.model(place), self._group.starts[k]):
                continue
            if run.memory.watch.generic_rank != self._rank:
                continue
            status, self._seconds[k] = stepper.advance_once()
            if status == DONE and not may_leave(run):
                copy_rows(self._ends, k)
                completed.append(k)
                if run.crossings:
                    self._crossings[k] = Crossings(self._group.model(k), run.crossings)
        return completed

    def followed(self, places: list[int], seconds: float) -> Followed:
        """The runs at these places, which all took so many seconds of CPU time."""
        packs, nb = self._group.packs, self._run.model.nb
        shape = len(places), self._run.times.size, nb
        q, v, a, multipliers = (each[places] for each in self._samples)
        q, v, a = q.reshape(*shape, 7), v.reshape(*shape, 6), a.reshape(*shape, 6)
        principal = packs.principal[places][:, None] if packs.turns_frames else None
        stepping, crossings = self._seconds[places], [self._crossings.get(k, ()) for k in places]
        starts = ((self._group.starts[k], self._group.ranks[k]) for k in places)
        messages = [report_of(*start, len(c)) for start, c in zip(starts, crossings, strict=True)]
        return Followed(
            places=places,
            times=self._run.times,
            poses=motion_of(q, v, a, principal, len(self._run.scene.body)),
            coordinates=q,
            multipliers=multipliers,
            counts=self._counts[places],
            seconds=stepping.tolist(),
            built=(seconds - float(stepping.sum())) / max(1, len(places)),
            messages=messages,
            crossings=crossings,
            facts=facts_of(self._run),
        )
