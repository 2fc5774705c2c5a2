"""Explanations of a difference from the exact motion, each tested by the difference that remains after a
fit."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from crosscheck.recorded.columns import VECTORS, kind_of
from mbref import rotations

Columns = Mapping[str, np.ndarray]
EXACTLY = 1e-6  # fraction of the difference: a smaller remainder counts as zero
# explanations whose fits are within this factor of the best count as equal, and the simplest comes first
ALIKE = 20.0
SHOWN = 3
FACTORS = {
    1e3: "in mm, not m",
    1e2: "in cm, not m",
    1e-3: "in km, not m",
    180 / np.pi: "in degrees, not rad",
    np.pi / 180: "in rad, read as degrees",
    1 / (2 * np.pi): "in revolutions, not rad",
    30 / np.pi: "in revolutions a minute, not rad/s",
    -1.0: "of opposite sign",
}
# fractions of the duration: shifts in time from which the best is refined
SHIFTS = np.linspace(-0.1, 0.1, 41)


@dataclass(frozen=True)
class Explanation:
    """An explanation: a sentence, the fraction (0 to 1) of the difference that remains, and the number of
    fitted parameters."""

    sentence: str
    remains: float
    complexity: int


@dataclass(frozen=True)
class Difference:
    """Recorded and exact columns (k,) at times (k,), with the scale of each, and exact columns at any
    time."""

    times: np.ndarray
    recorded: Columns
    exact: Columns
    scale: Mapping[str, float]
    later: Callable[[np.ndarray], Columns]
    begin: float = 0.0  # s; first time at which ``later`` is known

    def size(self, predicted: Columns) -> float:
        """Return the root mean square of recorded minus predicted columns, each relative to its scale."""
        signed = with_signs(self.recorded, {**self.exact, **predicted})
        parts = [
            np.mean(((self.recorded[name] - signed[name]) / self.scale[name]) ** 2) for name in self.recorded
        ]
        return float(np.sqrt(np.mean(parts)))

    @property
    def bodies(self) -> list[str]:
        """Return the bodies that have columns."""
        found = [n.rpartition(".")[0].rpartition(".")[0] for n in self.recorded if kind_of(n) in VECTORS]
        return list(dict.fromkeys(found))

    def vector(self, body: str, kind: str, of: Columns) -> np.ndarray | None:
        """Return the components (k, 3 or 4) of a body's quantity; None if a column is missing."""
        names = vector_names(body, kind)
        return np.array([of[n] for n in names]).T if all(n in self.recorded for n in names) else None


def vector_names(body: str, kind: str) -> list[str]:
    """Return the names of the columns of a body's quantity."""
    return [f"{body}.{kind}.{axis}" for axis in VECTORS[kind]]


def with_signs(recorded: Columns, predicted: Columns) -> Columns:
    """Return predicted columns in which each quaternion has the sign nearer to the recorded one; the sign has
    no meaning."""
    found = dict(predicted)
    for body in {n[: -len(".orientation.w")] for n in recorded if n.endswith(".orientation.w")}:
        names = vector_names(body, "orientation")
        if all(n in recorded for n in names):
            sign = np.sign(sum(recorded[n] * predicted[n] for n in names))
            found.update({n: np.where(sign < 0, -1.0, 1.0) * predicted[n] for n in names})
    return found


def ranked(
    difference: Difference, causes: Iterable[tuple[str, int, Columns]], noise: float
) -> list[Explanation]:
    """Return the best of some causes: first the simplest of those that fit nearly equally well, then all
    others by fit.

    A cause is a sentence, the number of fitted parameters and the columns that it predicts. ``noise`` is the
    size of a difference that means nothing.
    """
    before = difference.size({})
    found = [
        Explanation(sentence, difference.size(columns) / before, complexity)
        for sentence, complexity, columns in causes
    ]
    found = [e for e in found if e.remains < 0.5]
    if not found:
        return []
    alike = max(ALIKE * min(e.remains for e in found), EXACTLY, 3 * noise / before)
    return sorted(
        found, key=lambda e: (e.remains > alike, e.complexity if e.remains <= alike else 0, e.remains)
    )[:SHOWN]


def simple(difference: Difference) -> Iterator[tuple[str, int, Columns]]:
    """Return (sentence, number of fitted parameters, predicted columns) for explanations that need no further
    simulation."""
    for family in (_factors, _offsets, _shifts, _axes, _quaternions, _frames, _points, _interpolations):
        yield from family(difference)


def _scopes(d: Difference) -> Iterator[tuple[str, list[str]]]:
    """Return named sets of columns: of a quantity, of a quantity of a body, and single columns; each set
    once."""
    seen: set[tuple[str, ...]] = set()
    names = list(d.recorded)
    scopes = [(f"all columns of {k}", [n for n in names if kind_of(n) == k]) for k in map(kind_of, names)]
    for body in d.bodies:
        for kind in VECTORS:
            scopes.append((f"{body}.{kind}", [n for n in names if n.startswith(f"{body}.{kind}.")]))
    for title, columns in [*scopes, *((n, [n]) for n in names)]:
        if columns and tuple(columns) not in seen:
            seen.add(tuple(columns))
            yield title if len(columns) > 1 else columns[0], columns


def _factors(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    for title, columns in _scopes(d):
        for factor, meaning in FACTORS.items():
            yield f"{title}: {meaning} (factor {factor:.6g})", 1, {n: factor * d.exact[n] for n in columns}
        top = sum(float(d.recorded[n] @ d.exact[n]) for n in columns)
        below = sum(float(d.exact[n] @ d.exact[n]) for n in columns)
        if below:
            factor = top / below
            yield f"{title}: a factor of {factor:.9g}", 3, {n: factor * d.exact[n] for n in columns}


def _offsets(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    for title, columns in _scopes(d):
        moved = {n: float(np.mean(d.recorded[n] - d.exact[n])) for n in columns}
        listed = ", ".join(f"{v:.6g}" for v in moved.values())
        yield (
            f"{title}: an offset of {listed}",
            2 + len(columns),
            {n: d.exact[n] + v for n, v in moved.items()},
        )


def _shifts(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    """Return all columns shifted by a time, at the samples that the exact motion then has."""
    from scipy.optimize import minimize_scalar

    end = float(d.times[-1])

    def size(shift: float) -> float:
        return d.size(_later(d, shift))

    best = end * SHIFTS[int(np.argmin([size(end * s) for s in SHIFTS]))]
    step = end * (SHIFTS[1] - SHIFTS[0])
    found = minimize_scalar(
        size, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-12}
    )
    shift = float(found.x)
    yield f"all columns: later by {shift:.6g} s", 1, _later(d, shift)


def _later(d: Difference, shift: float) -> Columns:
    inside = (d.times - shift >= d.begin) & (d.times - shift <= d.times[-1])
    moved = d.later(np.clip(d.times - shift, d.begin, d.times[-1]))
    return {n: np.where(inside, moved[n], d.recorded[n]) for n in d.recorded}


def _axes(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    """Return columns with components exchanged or reversed: of one quantity of a body, of a body, or of all
    bodies."""
    vectors = [
        (b, k)
        for b in d.bodies
        for k in VECTORS
        if k != "orientation" and d.vector(b, k, d.exact) is not None
    ]
    scopes = [("all bodies", vectors)] + [(b, [v for v in vectors if v[0] == b]) for b in d.bodies]
    scopes += [(f"all columns of {k}", [v for v in vectors if v[1] == k]) for k in VECTORS]
    scopes += [(f"{b}.{k}", [(b, k)]) for b, k in vectors]
    for title, chosen in scopes:
        for order in itertools.permutations(range(3)) if chosen else ():
            for signs in itertools.product((1, -1), repeat=3):
                if order == (0, 1, 2) and signs.count(-1) != 2:
                    continue  # single components and equal signs are covered by the factors
                read = ", ".join(
                    f"{'-' if s < 0 else ''}{'xyz'[o]}" for s, o in zip(signs, order, strict=True)
                )
                columns: dict[str, np.ndarray] = {}
                for body, kind in chosen:
                    exact = d.vector(body, kind, d.exact)
                    names = vector_names(body, kind)
                    if exact is not None:
                        columns |= {n: s * exact[:, o] for n, s, o in zip(names, signs, order, strict=True)}
                yield f"{title}: x, y, z hold {read} of the exact motion", 2 + signs.count(-1), columns


def _quaternions(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    turning = {b: q for b in d.bodies if (q := d.vector(b, "orientation", d.exact)) is not None}
    changes: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "quaternions in the order x, y, z, w": lambda q: q[:, [1, 2, 3, 0]],
        "quaternions in the order w, x, y, z, read as x, y, z, w": lambda q: q[:, [3, 0, 1, 2]],
        "quaternions of the opposite rotation, world to body": rotations.conjugate,
    }
    for meaning, change in changes.items():
        columns: dict[str, np.ndarray] = {}
        for body, q in turning.items():
            columns |= dict(zip(vector_names(body, "orientation"), change(q).T, strict=True))
        if columns:
            yield f"all columns of orientation: {meaning}", 1, columns


def _frames(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    """Return the columns for another world frame: the rotation and translation that fit the positions
    best."""
    pairs = [(d.vector(b, "position", d.recorded), d.vector(b, "position", d.exact)) for b in d.bodies]
    known = [(r, e) for r, e in pairs if r is not None and e is not None]
    if not known:
        return
    recorded, exact = (np.vstack(side) for side in zip(*known, strict=True))
    middle = recorded.mean(axis=0), exact.mean(axis=0)
    u, _, vt = np.linalg.svd((recorded - middle[0]).T @ (exact - middle[1]))
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    move, q = middle[0] - turn @ middle[1], rotations.from_matrix(turn)
    angle = np.degrees(2 * np.arctan2(np.linalg.norm(q[1:]), abs(q[0])))
    columns: dict[str, np.ndarray] = {}
    for body in d.bodies:
        for kind in VECTORS:
            vector = d.vector(body, kind, d.exact)
            if vector is not None:
                moved = rotations.multiply(q, vector) if kind == "orientation" else vector @ turn.T
                moved = moved + move if kind == "position" else moved
                columns |= dict(zip(vector_names(body, kind), moved.T, strict=True))
    where = ", ".join(f"{x:.6g}" for x in move)
    yield f"all bodies: another world frame, turned by {angle:.6g} degrees, origin at ({where}) m", 6, columns


def _points(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    """Return the columns for another body-fixed point than the centre of mass, and for other body axes, of
    every body."""
    for body in d.bodies:
        yield from _other_axes(d, body)
        q, p, r = d.vector(body, "orientation", d.exact), None, None
        p, r = (d.vector(body, "position", of) for of in (d.exact, d.recorded))
        if p is None or r is None:
            continue
        q = np.array([d.later(d.times)[n] for n in vector_names(body, "orientation")]).T if q is None else q
        arm = np.mean(rotations.rotate(rotations.conjugate(q), r - p), axis=0)
        columns = dict(zip(vector_names(body, "position"), (p + rotations.rotate(q, arm)).T, strict=True))
        v, w = (d.vector(body, kind, d.exact) for kind in ("velocity", "angular_velocity"))
        if v is not None and w is not None:
            moved = v + np.cross(w, rotations.rotate(q, arm))
            columns |= dict(zip(vector_names(body, "velocity"), moved.T, strict=True))
        where = ", ".join(f"{x:.6g}" for x in arm)
        yield f"{body}: a point at ({where}) m in the body's frame, not the centre of mass", 4, columns


def _other_axes(d: Difference, body: str) -> Iterator[tuple[str, int, Columns]]:
    exact, recorded = (d.vector(body, "orientation", of) for of in (d.exact, d.recorded))
    if exact is None or recorded is None:
        return
    turned = rotations.multiply(rotations.conjugate(exact), recorded)
    turned = turned * np.where(turned @ turned[0] < 0, -1.0, 1.0)[:, None]
    mean = turned.mean(axis=0)
    if (size := float(np.linalg.norm(mean))) > 0:
        columns = dict(
            zip(vector_names(body, "orientation"), rotations.multiply(exact, mean / size).T, strict=True)
        )
        yield f"{body}: other body axes, turned by a constant rotation", 4, columns


def _interpolations(d: Difference) -> Iterator[tuple[str, int, Columns]]:
    """Return all columns interpolated from every m-th sample, linearly or by the previous value."""
    for m in range(2, max(2, min(50, len(d.times) // 3))):
        nodes = np.arange(0, len(d.times), m)
        if nodes[-1] != len(d.times) - 1:
            nodes = np.append(nodes, len(d.times) - 1)
        spacing = d.times[m] - d.times[0]
        lines = {n: np.interp(d.times, d.times[nodes], d.exact[n][nodes]) for n in d.recorded}
        yield f"all columns: straight lines between samples {spacing:.6g} s apart", 2, lines
        before = nodes[np.searchsorted(nodes, np.arange(len(d.times)), side="right") - 1]
        steps = {n: d.exact[n][before] for n in d.recorded}
        yield f"all columns: each value is repeated for {spacing:.6g} s", 2, steps
