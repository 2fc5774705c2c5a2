"""The variational equations along a run: changes of the states at its samples by numbers of the scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mbref.design.derivatives.followed import Followed
from mbref.design.derivatives.numbers_of_scene import SceneNumber
from mbref.design.derivatives.panels import CollocationPanel
from mbref.design.derivatives.states import Direction, States
from mbref.design.derivatives.tangents import (
    TangentRows,
    Tangents,
    independent_displacements,
    tangents_at,
    with_accelerations,
)
from mbref.equations.model import Model
from mbref.input_error import InputError

MOST_ENTRIES = 4_000_000  # entries of Φ_q at states whose tangents are computed together: 32 MB

StartChange = tuple[np.ndarray, np.ndarray]  # changes x and v (n,) of the start by a number, SI units


class Changes(NamedTuple):
    """States at the samples with accelerations, and the direction in which each number changes them."""

    states: States
    along: list[Direction]


class VariationalEquations:
    """The variational equations of a followed run of a model by numbers of its scene."""

    def __init__(self, model: Model, run: Followed, numbers: Sequence[SceneNumber], step: float):
        self.model, self.run, self.numbers, self.rule, self.step = model, run, numbers, run.rule, step
        self.freedoms = run.chosen.shape[1]

    def changes(self, starts: Sequence[StartChange]) -> Changes:
        """Return the changes of the samples' states by all starts: of the numbers first, in their order."""
        run, units, count = self.run, self.model.units, len(starts)
        panels = len(run.edges) - 1
        place = np.searchsorted(run.edges, run.states.times, side="right") - 1
        place = np.clip(place, 0, max(0, panels - 1))
        chosen = run.chosen[place] if panels else self._chosen_at_rest()
        y = np.zeros((len(place), 2 * self.freedoms, count))
        if self.freedoms and len(place):
            x, v = (np.array([start[k] / units for start in starts]).reshape(count, -1) for k in range(2))
            at_start = (run.chosen if panels else chosen)[0]
            first = np.concatenate([x[:, at_start], v[:, at_start]], axis=1).T
            if panels:
                self._integrate(first, place, y)
            else:
                y[:] = first
        states, parts = [], []
        for part, own, found in self._tangents(run.states, chosen):
            states.append(own)
            parts.append(self._total(found, y[part]))
        joined = (
            [np.concatenate(each) for each in zip(*parts, strict=True)] if parts else self._nothing(count)
        )
        reached = States(*map(np.concatenate, zip(*states, strict=True))) if states else run.states
        si = joined[0] * units[:, None], joined[1] * units[:, None], joined[2], joined[3]
        return Changes(reached, [Direction(*(each[..., k] for each in si)) for k in range(count)])

    def _nothing(self, count: int) -> list[np.ndarray]:
        return [np.zeros((0, size, count)) for size in (self.model.n,) * 3 + (self.model.m,)]

    def _chosen_at_rest(self) -> np.ndarray:
        """Return the independent displacements (k, f) of samples in no panel, which are at t = 0."""
        count = self.run.states.times.size
        if not count or not self.freedoms:
            return np.zeros((count, self.freedoms), dtype=int)
        free = TangentRows(self.model, self.run.first).free[0]
        return independent_displacements(free)[None]

    def _total(self, found: Tangents, y: np.ndarray) -> list[np.ndarray]:
        """Return changes x, v, a, λ (k, ·, starts) for y (k, 2 f, starts), with the numbers' own parts."""
        d, total = 2 * self.freedoms, []
        for each in found[:4]:
            whole = each[..., :d] @ y
            whole[..., : len(self.numbers)] += each[..., d:]
            total.append(whole)
        return total

    def _tangents(self, states: States, chosen: np.ndarray) -> Iterator[tuple[slice, States, Tangents]]:
        """Yield tangents of parts of the states (k,), with the states' accelerations."""
        model = self.model
        size = max(1, MOST_ENTRIES // max(1, model.m * model.n))
        for first in range(0, states.times.size, size):
            part = slice(first, min(first + size, states.times.size))
            own = states.at(part)
            rows = TangentRows(model, own)
            own = with_accelerations(model, own, rows)
            found = tangents_at(model, own, rows, chosen[part], self.numbers, self.step)
            for number, is_open in zip(self.numbers, found.open, strict=True):
                if is_open:
                    raise InputError(f"{number.label}: the joints cannot stay closed if this number changes")
            yield part, own, found

    def _integrate(self, y: np.ndarray, place: np.ndarray, at_samples: np.ndarray) -> None:
        """Integrate y (2 f, starts) over all panels; write it at the samples (k, 2 f, starts) in panels
        ``place`` (k,)."""
        run, rule, d = self.run, self.rule, 2 * self.freedoms
        lengths, count = np.diff(run.edges), len(rule.points)
        system = self._system(d)
        handed = self._handed_over(d)
        for j, length in enumerate(lengths.tolist()):
            own = system[j * count : (j + 1) * count]
            rhs = np.zeros((count, d, y.shape[1]))
            rhs[..., : len(self.numbers)] = own[..., d:]
            rates = CollocationPanel(length, own[..., :d], rhs).rates(y, rule)
            for k in np.flatnonzero(place == j):
                share = (run.states.times[k] - run.edges[j]) / length
                at_samples[k] = y + length * np.tensordot(rule.integrals_to(share), rates, 1)
            y = y + length * np.tensordot(rule.weights, rates, 1)
            if j in handed:
                matrix, rest = handed[j]
                y = matrix @ y
                y[:, : len(self.numbers)] += rest

    def _system(self, d: int) -> np.ndarray:
        """Return A and b (panels N, 2 f, 2 f + numbers) at all points of the panels."""
        chosen = np.repeat(self.run.chosen, len(self.rule.points), axis=0)
        found = np.empty((len(chosen), d, d + len(self.numbers)))
        for part, own, each in self._tangents(self.run.points, chosen):
            rate, at = each.v.copy(), chosen[part][..., None]
            by_body = each.x.reshape(len(own.times), self.model.nb, 6, -1)[:, :, 3:]
            spin = np.broadcast_to(own.v.reshape(-1, self.model.nb, 6)[:, :, 3:, None], by_body.shape)
            turned = np.cross(spin, by_body, axis=2)
            rate.reshape(*by_body.shape[:2], 6, -1)[:, :, 3:] -= turned
            second = each.a / self.model.units[:, None]
            found[part] = np.concatenate([np.take_along_axis(z, at, axis=1) for z in (rate, second)], axis=1)
        return found

    def _handed_over(self, d: int) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Return by panel the linear map from y at its end to the y of the next panel, which has other
        independent displacements."""
        chosen = self.run.chosen
        places = np.flatnonzero((chosen[1:] != chosen[:-1]).any(axis=1))
        found = {}
        for part, _, each in self._tangents(self.run.ends.at(places), chosen[places]):
            for i, j in enumerate(places[part].tolist()):
                rows = np.concatenate([each.x[i][chosen[j + 1]], each.v[i][chosen[j + 1]]])
                found[j] = rows[:, :d], rows[:, d:]
        return found
