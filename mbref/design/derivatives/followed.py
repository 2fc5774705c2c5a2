"""A run whose states are known at Gauss points of panels of time, in which its velocities are resolved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbref.design.derivatives.panels import Gauss, tails
from mbref.design.derivatives.states import States
from mbref.design.derivatives.tangents import (
    MOST_ENTRIES,
    TangentRows,
    partition_of,
    tangent_ranks,
)
from mbref.equations.model import Model
from mbref.equations.row_factors import RowPartition
from mbref.input_error import InputError
from mbref.method import Method
from mbref.motions.motion import Motion
from mbref.scene import Scene
from mbref.simulation.simulate import checked_run, finish_run
from mbref.stepping.limits import Limits

# Legendre coefficient of a velocity / largest velocity; an integral loses its product with another tail
RESOLVED = 1e-10
RESOLVED_BASIS = 1e-8  # the same of displacements by the independent ones
STEPS_OF_PANEL = 4  # steps of the run for each of the first panels, of which those too long are bisected
MOST_PANELS = 20_000  # a limit of memory and time
# largest displacement by an independent one; norm of an inverse, and smallest pivot, each / that where its
# partition was chosen
LARGEST_BASIS, LARGEST_INVERSE, SMALLEST_PIVOT = 5.0, 10.0, 0.01


@dataclass(frozen=True)
class Followed:
    """A run up to ``undecided_from`` (s), where its first singular position is, or infinity.

    ``first`` (1,) is the state at t = 0, ``states`` (k,) are at the samples before that time. ``edges``
    (panels + 1,) are times, ``points`` and ``ends`` the states at Gauss points (panels N,) and ends (panels,)
    of the panels. ``by_panel`` (panels,) and ``by_sample`` (k,) are indices of ``partitions``.
    """

    motion: Motion
    undecided_from: float
    rule: Gauss
    first: States
    states: States
    edges: np.ndarray
    points: States
    ends: States
    partitions: list[RowPartition]
    by_panel: np.ndarray
    by_sample: np.ndarray

    @staticmethod
    def of(
        scene: Scene,
        model: Model,
        method: Method,
        limits: Limits,
        samples: np.ndarray,
        rule: Gauss,
        before: Followed | None = None,
    ) -> Followed:
        """Return the run of a scene by a method with its states at samples (k,), s, and in panels.

        A run ``before`` gives its panels. Raises InputError if the scene has no state at t = 0,
        or if panels stay too coarse.
        """
        edges = before.edges if before else np.zeros(1)
        motion, states = states_of_run(scene, method, limits, _all_times(edges, rule, samples))
        if not states.times.size:
            raise InputError(f"{scene.name}: {motion.message}")
        undecided = min((crossing.time for crossing in motion.crossings or ()), default=np.inf)
        ranks = tangent_ranks(model, states.at([0, -1]))
        if ranks[0] != ranks[1]:
            undecided = 0.0  # the motion starts at a singular position
        reached = samples[(samples < undecided) & (samples <= states.times[-1])]
        last, freedoms = float(reached.max(initial=0.0)), model.n - ranks[0]
        if edges[-1] != last:
            edges = _first_edges(model, last, motion.cost.steps) if freedoms else np.zeros(1)
        while len(edges) <= MOST_PANELS:
            times = _all_times(edges, rule, reached)
            if not np.isin(times, states.times).all():
                _, states = states_of_run(scene, method, limits, times)
            inner = _at(states, _points(edges, rule))
            if before and edges is before.edges:
                partitions, by_panel = before.partitions, before.by_panel
                break
            rough = _are_unresolved(model, inner, rule)
            if not rough.any():
                partitions, by_panel, rough = _partitions(model, inner, freedoms, rule)
            if not rough.any():
                break
            edges = np.sort(np.concatenate([edges, (edges[:-1] + edges[1:])[rough] / 2]))
        else:
            t = edges[int(np.argmax(rough))]
            raise InputError(f"{scene.name}: the motion near t = {t:.6g} s changes too fast for derivatives")
        if samples[0] > 0.0 and not before:
            motion = states_of_run(scene, method, limits, samples)[0]
        first, ends, own = _at(states, np.zeros(1)), _at(states, edges[1:]), _at(states, reached)
        if len(edges) > 1:
            by_sample = by_panel[places_in(edges, reached)]
        else:
            partitions, by_sample, _ = _partitions(model, own, freedoms)
        return Followed(
            motion, undecided, rule, first, own, edges, inner, ends, partitions, by_panel, by_sample
        )


def places_in(edges: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the indices (k,) of the panels in which times (k,) are."""
    return np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(edges) - 2)


def _all_times(edges: np.ndarray, rule: Gauss, samples: np.ndarray) -> np.ndarray:
    """Return the edges of panels, the times of their Gauss points, and samples, s."""
    return np.unique([*edges, *_points(edges, rule), *samples])


def _points(edges: np.ndarray, rule: Gauss) -> np.ndarray:
    """Return the times (panels N,) of the Gauss points of panels."""
    return (edges[:-1, None] + np.diff(edges)[:, None] * rule.points).ravel()


def _at(states: States, times: np.ndarray) -> States:
    """Return the states at some of their times."""
    return states.at(np.searchsorted(states.times, times))


def states_of_run(scene: Scene, method: Method, limits: Limits, times: np.ndarray) -> tuple[Motion, States]:
    """Return a run of a scene, and its states at the times that it reached."""
    run = checked_run(scene, method, times, limits)
    motion = finish_run(run)
    q, v, a, multipliers, angles = (sample[: motion.times.size].copy() for sample in run.memory.loop.samples)
    run.release()
    return motion, States(motion.times, q, v, angles, a, multipliers)


def _first_edges(model: Model, last: float, steps: int) -> np.ndarray:
    """Return the edges of as many panels up to a time (s) as the run had steps; functions change pieces at
    edges only."""
    if last == 0.0:
        return np.zeros(1)
    begins = model.data.functions.begin
    inside = begins[(begins > 0.0) & (begins < last)]
    return np.union1d(np.linspace(0.0, last, max(1, steps // STEPS_OF_PANEL) + 1), inside)


def _are_unresolved(model: Model, points: States, rule: Gauss) -> np.ndarray:
    """Return which panels (panels,) are too long for the velocities at their points."""
    v = (points.v / model.units).reshape(-1, len(rule.points), model.n)
    return np.asarray(tails(v, rule) > RESOLVED * np.abs(v).max(initial=0.0))


def _partitions(
    model: Model, states: States, freedoms: int, rule: Gauss | None = None
) -> tuple[list[RowPartition], np.ndarray, np.ndarray]:
    """Return partitions, the index (panels,) of the one that each panel uses, and which panels are too long
    for one. ``states`` (panels N,) are at the points of the rule, or without a rule one of each panel."""
    points = len(rule.points) if rule else 1
    count = len(states.times) // points
    found: list[RowPartition] = []
    used, rough = np.full(count, -1), np.zeros(count, dtype=bool)
    size = max(1, MOST_ENTRIES // max(1, points * (model.entry_columns.size + model.n * (freedoms + 1))))
    while (left := np.flatnonzero((used < 0) & ~rough)).size:
        middle = states.at([left[0] * points + points // 2])
        partition = partition_of(model, middle)
        if len(partition.independent) != freedoms:
            raise InputError(f"the motion passes a singular position near t = {middle.times[0]:.6g} s")
        chosen = TangentRows(model, middle, partition)
        for panels in (left[k : k + size] for k in range(0, left.size, size)):
            at = (panels[:, None] * points + np.arange(points)).ravel()
            rows = TangentRows(model, states.at(at), partition)
            fits = rows.inverse_sizes <= LARGEST_INVERSE * chosen.inverse_sizes
            fits &= (rows.pivots >= SMALLEST_PIVOT * chosen.pivots).all(axis=1)
            fits &= np.abs(rows.basis).max(axis=(1, 2), initial=0.0) <= LARGEST_BASIS
            fits = fits.reshape(-1, points).all(axis=1)
            used[panels[fits]] = len(found)
            if rule and freedoms:
                basis = rows.basis.reshape(len(panels), points, -1)
                ends = tails(basis, rule) > RESOLVED_BASIS * np.abs(basis).max(axis=(1, 2))
                rough[panels[fits]] |= ends[fits]
        if used[left[0]] < 0:
            used[left[0]], rough[left[0]] = len(found), rule is not None
        found.append(partition)
    return found, used, rough
