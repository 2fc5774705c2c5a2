"""A run whose states are known at Gauss points of panels of time, in which its velocities are resolved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbref.design.derivatives.panels import Gauss, tails
from mbref.design.derivatives.states import States
from mbref.design.derivatives.tangents import TangentRows, independent_displacements
from mbref.equations.model import Model
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
WEAK = 0.1  # smallest singular value of the chosen rows of a basis, below which a panel is bisected


@dataclass(frozen=True)
class Followed:
    """A run up to ``undecided_from`` (s), where its first singular position is, or infinity.

    ``first`` (1,) is the state at t = 0, ``states`` (k,) are at the samples before that time. ``edges``
    (panels + 1,) are times, ``points`` and ``ends`` the states at Gauss points (panels N,) and ends (panels,)
    of the panels, ``chosen`` (panels, f) the independent displacements.
    """

    motion: Motion
    undecided_from: float
    rule: Gauss
    first: States
    states: States
    edges: np.ndarray
    points: States
    ends: States
    chosen: np.ndarray

    @staticmethod
    def of(
        scene: Scene, model: Model, method: Method, limits: Limits, samples: np.ndarray, rule: Gauss
    ) -> Followed:
        """Return the run of a scene by a method with its states at samples (k,), s, and in panels.

        Raises InputError if the scene has no state at t = 0, or if panels stay too coarse.
        """
        motion, states = _run(scene, method, limits, np.union1d(samples, 0.0))
        if not states.times.size:
            raise InputError(f"{scene.name}: {motion.message}")
        undecided = min((crossing.time for crossing in motion.crossings or ()), default=np.inf)
        if len(set(TangentRows(model, states.at([0, -1])).ranks)) > 1:
            undecided = 0.0  # the motion starts at a singular position
        reached = samples[(samples < undecided) & (samples <= states.times[-1])]
        last = float(reached.max(initial=0.0))
        freedoms = model.n - TangentRows(model, states.at(slice(0, 1))).rank
        edges = _first_edges(model, last, motion.cost.steps) if freedoms else np.zeros(1)
        rough = np.ones(len(edges) - 1, dtype=bool)
        while len(edges) <= MOST_PANELS:
            points = (edges[:-1, None] + np.diff(edges)[:, None] * rule.points).ravel()
            _, states = _run(scene, method, limits, np.unique([*points, *edges, *reached]))
            inner = _at(states, points)
            rough, chosen = _rough(model, inner, len(edges) - 1, freedoms, rule)
            if not rough.any():
                break
            edges = np.sort(np.concatenate([edges, (edges[:-1] + edges[1:])[rough] / 2]))
        if rough.any():
            t = edges[int(np.argmax(rough))]
            raise InputError(f"{scene.name}: the motion near t = {t:.6g} s changes too fast for derivatives")
        if samples[0] > 0.0:
            motion = _run(scene, method, limits, samples)[0]
        first, ends = _at(states, np.zeros(1)), _at(states, edges[1:])
        return Followed(motion, undecided, rule, first, _at(states, reached), edges, inner, ends, chosen)


def _at(states: States, times: np.ndarray) -> States:
    """Return the states at some of their times."""
    return states.at(np.searchsorted(states.times, times))


def _run(scene: Scene, method: Method, limits: Limits, times: np.ndarray) -> tuple[Motion, States]:
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


def _rough(
    model: Model, points: States, panels: int, freedoms: int, rule: Gauss
) -> tuple[np.ndarray, np.ndarray]:
    """Return which panels (panels,) are too long, and the independent displacements (panels, f) of each."""
    rough, chosen = np.zeros(panels, dtype=bool), np.zeros((panels, freedoms), dtype=int)
    if not panels:
        return rough, chosen
    v = (points.v / model.units).reshape(panels, len(rule.points), model.n)
    rough = tails(v, rule) > RESOLVED * np.abs(v).max()
    if rough.any():
        return rough, chosen
    for j in range(panels):
        own = slice(j * len(rule.points), (j + 1) * len(rule.points))
        free = TangentRows(model, points.at(own)).free
        if free.shape[2] != freedoms:
            raise InputError(f"the motion passes a singular position near t = {points.times[own][0]:.6g} s")
        chosen[j] = independent_displacements(free[len(free) // 2])
        at = free[:, chosen[j]]
        rough[j] = np.linalg.svd(at, compute_uv=False).min(initial=1.0) < WEAK
        if not rough[j]:
            basis = (free @ np.linalg.inv(at)).reshape(1, len(free), -1)
            rough[j] = tails(basis, rule)[0] > RESOLVED_BASIS * np.abs(basis).max()
    return rough, chosen
