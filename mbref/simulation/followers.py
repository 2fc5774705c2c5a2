"""Followers: scenes that differ from that of a run in numbers alone, run one after another in its memory.

All of them are set up at once, in arrays whose first axis counts them.  A follower must give the answers on
which the run's choice of rows and columns rests, begin on no singular position and end without anything
unusual, as the run itself; every other scene is left to a run of its own.  The results are those of runs of
their own, to the bit, or but for rounding by code that takes the numbers in which the scenes differ.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mbref.equations.active_coordinates import without_rounding
from mbref.equations.initial_state import LARGE, Start
from mbref.equations.joint_reactions import Balance
from mbref.equations.model import Model, motion_of
from mbref.equations.packing import Packs, row_of
from mbref.equations.reduction import Reduction
from mbref.equations.static_constraints import at_rest
from mbref.kernels.copying import Bytes, copy_rows, rows_from, table_of
from mbref.kernels.layout import Counts, Memory
from mbref.kernels.named_memory import packed
from mbref.motion import Motion
from mbref.scene import Scene
from mbref.simulation.control import STEPS_PER_CALL, largest_violation
from mbref.simulation.evaluations import Evaluations, Rows, numbers_of
from mbref.simulation.outcome import OUTCOMES, cost_of, facts_of, reactions_of, report_of
from mbref.simulation.ranks import Ranks, all_ranks
from mbref.simulation.run import NEARLY, Run
from mbref.simulation.singular_start import begins_at_rest, begins_in_motion
from mbref.simulation.stepping import DONE, advance_to_end
from mbref.specialised import Untraceable, Varied


def may_lead(run: Run) -> bool:
    """Whether a run that has ended was so ordinary that others may follow it."""
    counts = run.memory.equations.system.counts
    ordinary = run.reduction is not None and run.model.m <= LARGE and run.specialised is None
    short = counts.steps <= STEPS_PER_CALL and not counts.crossings
    completed = run.memory.loop.clock.sample == run.times.size and not run.limits.branches
    return bool(ordinary and short and completed and run.ranks.least >= NEARLY)


class Followed(NamedTuple):
    """Runs that followed one: s completed ones, at k samples.

    ``places`` (s) among the scenes, poses (s, k, nb, …) as a Motion names them, coordinates (s, k, nb, 7),
    multipliers (s, k, m), ``layout.Counts`` (s, 6), and the seconds of stepping (s) and construction.
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
                    crossings=(),
                    cost=cost_of(self.seconds[k], self.built, self.counts[k].tolist()),
                ),
            )


def follow(run: Run, scenes: Sequence[Scene], by_code: bool = False) -> Followed:
    """The scenes that followed a run that may lead them; its memory is theirs from now on.

    ``by_code``: on machine code that takes the numbers in which they differ, where they can have it.
    """
    began = time.process_time()
    group = _group(run, scenes)
    ended = Runs(run, group, by_code)
    places = ended.run()
    messages = [report_of(group.starts[k], group.ranks[k]) for k in places]
    return ended.followed(places, messages, time.process_time() - began)


class Group(NamedTuple):
    """Scenes (s) of one shape, their coordinates (s, 7 nb) and velocities (s, 6 nb) at the start, consistent
    starts by place, ranks there, and the places of those that fit to follow."""

    packs: Packs
    q: np.ndarray
    v: np.ndarray
    starts: dict[int, Start]
    ranks: list[Ranks]
    fit: list[int]


def _group(run: Run, scenes: Sequence[Scene]) -> Group:
    """The scenes, of which those fit that give the run's answers and start as regularly."""
    packs, evidence = Packs(scenes), _reduction(run).evidence
    evaluations = Evaluations(run.model, packs)
    starts, q, v = _starts(run, packs, evaluations)
    part, places, velocities = evidence.states(q, v)
    durations = np.array([scene.duration for scene in scenes])
    terms = evaluations.terms(np.arange(len(q)), durations[:, None] * part, places, velocities)
    agree = evidence.which_agree(run.model, q, v, packs.mass, terms)
    symbolic, tolerance = run.part.factor.symbolic, run.limits.rank_tolerance
    ranks = all_ranks(run.model, terms.jacobian[:, 0], packs.data.metric_root, symbolic, tolerance)
    alike = [rank.rank == run.ranks.rank and rank.least >= NEARLY for rank in ranks]
    return Group(packs, q, v, starts, ranks, [k for k in starts if agree[k] and alike[k]])


def _reduction(run: Run) -> Reduction:
    """The reduction of a run that may lead others, which has one."""
    assert run.reduction is not None
    return run.reduction


class Runs:
    """Runs of a group of scenes in the memory of one run."""

    def __init__(self, run: Run, group: Group, by_code: bool):
        self._run, self._group = run, group
        self._rank = self._begin()
        self._memory, values = (self._coded() if by_code else None) or (run.memory_of_kernels, [])
        self._packed, count, memory = packed(self._memory), len(group.q), self._memory
        self._begins = Rows([*self._numbers(), *values], Bytes(memory))
        self._samples = [np.empty((count, *each.shape)) for each in memory.loop.samples]
        self._counts = np.empty((count, len(Counts._fields)), dtype=np.int64)
        sources: list[Any] = [*memory.loop.samples, memory.equations.system.counts]
        self._ends = table_of(rows_from(*each) for each in zip(sources, self._rows(), strict=True))
        self._seconds = np.zeros(count)

    def _begin(self) -> int:
        """Have memory as the run begins; the independent rows there, -1 where it begins extraordinarily."""
        run = self._run
        run.begin_again()
        run.enter_state()
        extraordinary = begins_at_rest(run) or begins_in_motion(run)
        rank = int(run.memory.watch.generic_rank)
        run.begin_again()
        return -1 if extraordinary else rank

    def _coded(self) -> tuple[Memory, list[tuple[Any, ...]]] | None:
        """Memory with code of all scenes that fit, and the numbers that it takes; None where it has none."""
        run, (packs, q, v, starts, _, fit) = self._run, self._group
        if not fit:
            return None
        data = row_of(run.reduced(packs.data, axis=1, all_move=True), fit)
        varied = Varied(data, packs.mass[fit], packs.inverse_root[fit], q[fit], v[fit])
        model = Model(packs.scenes[fit[0]], packs, fit[0])
        start = replace(starts[fit[0]], q=q[fit[0]], v=v[fit[0]])
        try:
            memory = run.with_code(model, start, varied)
        except Untraceable:
            return None
        numbers = np.zeros((len(q), varied.numbers.shape[1]))
        numbers[fit] = varied.numbers
        return memory, [(memory.code.numbers, numbers)]

    def _numbers(self) -> list[tuple[Any, ...]]:
        """All numbers in which the runs differ."""
        run, packs, memory = self._run, self._group.packs, self._memory
        length, rounding = packs.length, run.method.settings(0.0).rounding
        return [
            *numbers_of(memory.equations, run.reduced(packs.data, axis=1), packs),
            (memory.state.coordinates, self._group.q),
            (memory.state.velocities, self._group.v),
            (memory.control, largest_violation(run.limits, length), "violation"),
            (memory.equations.system.settings, rounding * np.minimum(1.0, length), "rounding"),
        ]

    def _rows(self) -> list[np.ndarray]:
        """Arrays that take samples and counts."""
        return [*self._samples, self._counts]

    def run(self) -> list[int]:
        """Run the scenes that fit; the places of those that completed without a singular position."""
        memory, completed = self._memory, []
        clock: Any = memory.loop.clock
        enter = self._run.method.stabilisation.enter.callable
        for k in self._group.fit:
            self._begins.copy(k)
            clock.y_size = enter(clock.time, memory.loop.y, self._packed.argument)
            if memory.watch.generic_rank != self._rank:
                continue
            began = time.process_time()
            status = advance_to_end(self._packed.argument)
            self._seconds[k] = time.process_time() - began
            if status == DONE:
                copy_rows(self._ends, k)
                completed.append(k)
        return completed

    def followed(self, places: list[int], messages: list[str], seconds: float) -> Followed:
        """The runs at these places, which all took so many seconds of CPU time."""
        packs, nb = self._group.packs, self._run.model.nb
        shape = len(places), self._run.times.size, nb
        q, v, a, multipliers = (each[places] for each in self._samples)
        q, v, a = q.reshape(*shape, 7), v.reshape(*shape, 6), a.reshape(*shape, 6)
        principal = packs.principal[places][:, None] if packs.turns_frames else None
        stepping = self._seconds[places]
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
            facts=facts_of(self._run),
        )


def _starts(
    run: Run, packs: Packs, evaluations: Evaluations
) -> tuple[dict[int, Start], np.ndarray, np.ndarray]:
    """The consistent starts as ``Run`` finds them, by place where there is one; and the coordinates
    (s, 7 nb) and velocities (s, 6 nb) of all."""
    q, v, held, found = packs.start(), np.zeros_like(packs.mass), _reduction(run).held, {}
    for k, start in enumerate(evaluations.starts()):
        if isinstance(start, Start):
            found[k] = at_rest(without_rounding(start, float(packs.length[k])), held)
            q[k], v[k] = found[k].q, found[k].v
    return found, q, v
