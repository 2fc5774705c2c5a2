"""Candidates: scenes of equal structure that may be simulated in the memory of one run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from mbref.equations.active_coordinates import without_rounding
from mbref.equations.driver_conflicts import conflict_of_drivers
from mbref.equations.evaluated_together import Evaluations, parameters_of
from mbref.equations.initial_state import Start
from mbref.equations.offsets import assembled
from mbref.equations.packing import Packs
from mbref.kernels.layout import Memory
from mbref.scene import Scene
from mbref.stepping.control import largest_violation
from mbref.stepping.ranks import Ranks, all_ranks
from mbref.stepping.run import NEARLY, Run


class Candidates(NamedTuple):
    """Scenes of equal structure, s in number, and their starts.

    Fields are coordinates (s, 7 nb) and velocities (s, 6 nb) at the start, consistent starts by scene index,
    their ranks, and the indices of the scenes whose rank, active rows and columns equal the run's.
    """

    packs: Packs
    q: np.ndarray
    v: np.ndarray
    starts: dict[int, Start]
    ranks: list[Ranks]
    fit: list[int]

    def parameters(self, run: Run, memory: Memory) -> list[tuple[Any, ...]]:
        """Return the arrays of a run's memory in which the scenes differ, each with the values of all
        scenes."""
        length, rounding = self.packs.length, run.method.settings(0.0).rounding
        return [
            *parameters_of(memory.equations, run.reduced(self.packs.data), self.packs),
            (memory.state.coordinates, self.q),
            (memory.state.velocities, self.v),
            (memory.control, largest_violation(run.limits, length), "violation"),
            (memory.equations.system.settings, rounding * np.minimum(1.0, length), "rounding"),
        ]


def candidates_of(run: Run, scenes: Sequence[Scene]) -> Candidates:
    """Return the candidates for a batch of a lead run. A scene may join the batch if its structure equals the
    structure of the run, its start is regular and its drivers do not contradict each other."""
    assert run.reduction is not None
    packs, decisions = Packs([*map(assembled, scenes)]), run.reduction.decisions
    evaluations = Evaluations(run.model, packs)
    starts, q, v = _starts(run, packs, evaluations)
    part, places, velocities = decisions.states(q, v)
    durations = np.array([scene.duration for scene in scenes])
    terms = evaluations.terms(np.arange(len(q)), durations[:, None] * part, places, velocities)
    agree = decisions.which_agree(run.model, q, v, terms)
    symbolic, tolerance = run.memory.factor.symbolic, run.limits.rank_tolerance
    ranks = all_ranks(run.model, terms.blocks[:, 0], packs.data.metric_root, symbolic, tolerance)
    alike = [rank.rank == run.ranks.rank and rank.least >= NEARLY for rank in ranks]
    end = float(run.times[-1])
    fit = [k for k in starts if agree[k] and alike[k] and conflict_of_drivers(packs.scenes[k], end) is None]
    return Candidates(packs, q, v, starts, ranks, fit)


def _starts(
    run: Run, packs: Packs, evaluations: Evaluations
) -> tuple[dict[int, Start], np.ndarray, np.ndarray]:
    """Return the consistent starts by scene index, and coordinates (s, 7 nb) and velocities (s, 6 nb) of all
    scenes, in which roundings of zero are zero, as in ``Run``."""
    q, v = packs.start(), np.zeros_like(packs.mass)
    found = {k: start for k, start in enumerate(evaluations.starts()) if isinstance(start, Start)}
    if found:
        places, starts = [*found], found.values()
        at, rates, given = (np.array([getattr(s, name) for s in starts]) for name in ("q", "v", "given"))
        q[places], v[places] = without_rounding(at, rates, given, packs.length[places])
    return found, q, v
