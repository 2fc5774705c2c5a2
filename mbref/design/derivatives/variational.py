"""The variational equations along a run: changes of the states at its samples by numbers of the scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mbref.design.derivatives.followed import Followed, places_in
from mbref.design.derivatives.numbers_of_scene import SceneNumber
from mbref.design.derivatives.panels import rates_in_panels
from mbref.design.derivatives.states import Direction, States
from mbref.design.derivatives.tangents import (
    MOST_ENTRIES,
    TangentRows,
    Tangents,
    tangents_at,
    with_accelerations,
)
from mbref.equations.model import Model
from mbref.input_error import InputError

StartChange = tuple[np.ndarray, np.ndarray]  # changes x and v (n,) of the start by a number, SI units


class Changes(NamedTuple):
    """States at the samples with accelerations, and the direction in which each number changes them."""

    states: States
    along: list[Direction]


class VariationalEquations:
    """The variational equations of a followed run of a model by numbers of its scene."""

    def __init__(self, model: Model, run: Followed, numbers: Sequence[SceneNumber]):
        self.model, self.run, self.numbers, self.rule = model, run, numbers, run.rule
        self.freedoms = len(run.partitions[0].independent) if run.partitions else 0

    def changes(self, starts: Sequence[StartChange]) -> Changes:
        """Return the changes of the samples' states by all starts: of the numbers first, in their order."""
        run, model, count = self.run, self.model, len(starts)
        samples, has_panels = len(run.states.times), len(run.edges) > 1
        y = np.zeros((samples, 2 * self.freedoms, count))
        if self.freedoms and samples:
            x, v = (
                np.array([start[k] / model.units for start in starts]).reshape(count, -1) for k in range(2)
            )
            at_start = run.partitions[(run.by_panel if has_panels else run.by_sample)[0]].independent
            first = np.concatenate([x[:, at_start], v[:, at_start]], axis=1).T
            if has_panels:
                self._integrate(first, places_in(run.edges, run.states.times), y)
            else:
                y[:] = first
        sizes = (model.n, model.n, model.n, model.m)
        a, multipliers = np.zeros((samples, model.n)), np.zeros((samples, model.m))
        changed = [np.zeros((samples, size, count)) for size in sizes]
        for part, own, found in self._tangents(run.states, run.by_sample):
            a[part], multipliers[part] = own.a, own.multipliers
            for whole, each in zip(changed, self._total(found, y[part]), strict=True):
                whole[part] = each
        units = model.units[:, None]
        si = changed[0] * units, changed[1] * units, changed[2], changed[3]
        reached = run.states._replace(a=a, multipliers=multipliers)
        return Changes(reached, [Direction(*(each[..., k] for each in si)) for k in range(count)])

    def _total(self, found: Tangents, y: np.ndarray) -> list[np.ndarray]:
        """Return changes x, v, a, λ (k, ·, starts) for y (k, 2 f, starts), with the numbers' own parts."""
        d, total = 2 * self.freedoms, []
        for each in found[:4]:
            whole = each[..., :d] @ y
            whole[..., : len(self.numbers)] += each[..., d:]
            total.append(whole)
        return total

    def _tangents(self, states: States, used: np.ndarray) -> Iterator[tuple[np.ndarray, States, Tangents]]:
        """Yield the indices of states whose tangents are computed together, these states with accelerations,
        and their tangents by the partitions with indices ``used`` (k,)."""
        model, columns = self.model, 2 * self.freedoms + len(self.numbers)
        entries = model.entry_columns.size + (3 * model.m + 4 * model.n) * (columns + 1)
        size = max(1, MOST_ENTRIES // max(1, entries))
        for index, partition in enumerate(self.run.partitions):
            places = np.flatnonzero(used == index)
            for part in (places[k : k + size] for k in range(0, places.size, size)):
                rows = TangentRows(model, own := states.at(part), partition)
                own = with_accelerations(own, rows)
                found = tangents_at(model, own, rows, self.numbers)
                for number, is_open in zip(self.numbers, found.open, strict=True):
                    if is_open:
                        raise InputError(
                            f"{number.label}: the joints cannot stay closed if this number changes"
                        )
                yield part, own, found

    def _integrate(self, y: np.ndarray, place: np.ndarray, at_samples: np.ndarray) -> None:
        """Integrate y (2 f, starts) over all panels; write it at the samples (k, 2 f, starts) in panels
        ``place`` (k,)."""
        run, rule, d = self.run, self.rule, 2 * self.freedoms
        lengths, count, numbers = np.diff(run.edges), len(rule.points), len(self.numbers)
        system = self._system(d).reshape(len(lengths), count, d, -1)
        handed = self._handed_over(d)
        for j, (length, own) in enumerate(
            zip(lengths.tolist(), rates_in_panels(lengths, system, rule), strict=True)
        ):
            rates = own[..., :d] @ y
            rates[..., :numbers] += own[..., d:]
            for k in np.flatnonzero(place == j):
                share = (run.states.times[k] - run.edges[j]) / length
                at_samples[k] = y + length * np.tensordot(rule.integrals_to(share), rates, 1)
            y = y + length * np.tensordot(rule.weights, rates, 1)
            if j in handed:
                matrix, rest = handed[j]
                y = matrix @ y
                y[:, :numbers] += rest

    def _system(self, d: int) -> np.ndarray:
        """Return A and b (panels N, 2 f, 2 f + numbers) at all points of the panels."""
        used = np.repeat(self.run.by_panel, len(self.rule.points))
        found = np.empty((len(used), d, d + len(self.numbers)))
        for part, own, each in self._tangents(self.run.points, used):
            at = self.run.partitions[used[part[0]]].independent
            rate = each.v.copy()
            by_body = each.x.reshape(len(own.times), self.model.nb, 6, -1)[:, :, 3:]
            spin = own.v.reshape(-1, self.model.nb, 6)[:, :, 3:, None]
            rate.reshape(*by_body.shape[:2], 6, -1)[:, :, 3:] -= _cross(spin, by_body)
            second = each.a[:, at] / self.model.units[at, None]
            found[part] = np.concatenate([rate[:, at], second], axis=1)
        return found

    def _handed_over(self, d: int) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Return by panel the linear map from y at its end to the y of the next panel, which has another
        partition."""
        used = self.run.by_panel
        places = np.flatnonzero(used[1:] != used[:-1])
        found = {}
        for part, _, each in self._tangents(self.run.ends.at(places), used[places]):
            for i, j in enumerate(places[part].tolist()):
                at = self.run.partitions[used[j + 1]].independent
                rows = np.concatenate([each.x[i][at], each.v[i][at]])
                found[j] = rows[:, :d], rows[:, d:]
        return found


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return cross products of vectors along the third axis."""
    (x, y, z), (u, v, w) = np.moveaxis(a, 2, 0), np.moveaxis(b, 2, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=2)
