"""Causes of a difference that need no further simulation: units, signs, quaternions, turns, times and
interpolation, and the geometric ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from crosscheck.judge.deadline import ask
from crosscheck.recorded.columns import KNOWN_UNITS, SI, VECTORS, kind_of
from crosscheck.recorded.explanations import Cause, Columns, Difference, Stated, vector_names
from crosscheck.recorded.geometric_causes import axes, body_components, frames, points
from mbref import rotations

WORDS = {
    "in": "inches",
    "ft": "feet",
    "deg": "degrees",
    "rev": "revolutions",
    "deg/s": "degrees/s",
    "rpm": "revolutions a minute",
    "deg/s²": "degrees/s²",
}
# scopes of units: a whole table in mm has velocities in mm/s
FAMILIES = {
    "all lengths and their rates": ("m", "m/s", "m/s²"),
    "all angles and their rates": ("rad", "rad/s", "rad/s²"),
}
# fractions of the duration: shifts in time from which the best is refined
SHIFTS = np.linspace(-0.1, 0.1, 41)
FASTER = 0.1  # largest relative error of a clock that is tried
NEAR = 1e-3  # rad; rounding by which a wrapped angle may exceed its interval
REFINED = 3  # intervals in which a fitted number is refined, each a thousandth of the former
LISTED = 4  # exchanged columns that are named; of more, their bodies and joints are named
LEAST_VARIATION = 0.1  # of a recorded column / variation that another unit gives it
INSIDE = 0.8  # least fraction of the samples at which a shifted motion is known


def simple(difference: Difference) -> Iterator[Cause]:
    """Return (sentence, number of fitted parameters, predicted columns) for explanations that need no further
    simulation."""
    for family in FAMILIES_OF_CAUSES:
        for cause in family(difference):
            yield Cause(*cause, family.__name__)


def _scopes(d: Difference) -> Iterator[tuple[str, list[str]]]:
    """Return named sets of columns: of a quantity, of a quantity of a body, and single columns; each set
    once."""
    seen: set[tuple[str, ...]] = set()
    names = list(d.recorded)
    scopes = [(f"all columns of {k}", [n for n in names if kind_of(n) == k]) for k in map(kind_of, names)]
    scopes += [(title, [n for n in names if SI[kind_of(n)] in units]) for title, units in FAMILIES.items()]
    owners = dict.fromkeys(n.rpartition("." + kind_of(n))[0] for n in names)
    scopes += [(f"all columns of {o}", [n for n in names if o and n.startswith(f"{o}.")]) for o in owners]
    for body in d.bodies:
        for kind in VECTORS:
            scopes.append((f"{body}.{kind}", [n for n in names if n.startswith(f"{body}.{kind}.")]))
    for title, columns in [*scopes, *((n, [n]) for n in names)]:
        if columns and tuple(columns) not in seen:
            seen.add(tuple(columns))
            yield title if len(columns) > 1 else columns[0], columns


def _units(d: Difference) -> Iterator[Stated]:
    """Return columns in another unit, or of opposite sign."""
    for title, columns in _scopes(d):
        yield f"{title}: of opposite sign (factor -1)", 1, {n: -d.exact[n] for n in columns}
        units = {SI[kind_of(n)] for n in columns}
        first = min(units, key=len)
        if len(units) > 1 and title not in FAMILIES:
            continue
        for other, factor in KNOWN_UNITS[first].items():
            unit = WORDS.get(other, other)
            if factor != 1.0:
                for by, says in (
                    (1 / factor, f"in {unit}, not {first}"),
                    (factor, f"in {first}, read as {unit}"),
                ):
                    scaled = {n: d.exact[n] * by for n in columns}
                    if _is_visible(d, scaled):
                        yield f"{title}: {says} (factor {by:.6g})", 1, scaled


def _is_visible(d: Difference, scaled: Columns) -> bool:
    """Return whether a number exceeds the rounding of its cell, and the recorded column varies as well: zeros
    and constants are no motion in another unit."""
    return any(
        (np.abs(column) > d.allowed.get(name, 0.0)).any()
        and np.ptp(d.recorded[name]) >= LEAST_VARIATION * np.ptp(column)
        for name, column in scaled.items()
    )


def _factors(d: Difference) -> Iterator[Stated]:
    for title, columns in _scopes(d):
        top = sum(float(d.recorded[n] @ d.exact[n]) for n in columns)
        below = sum(float(d.exact[n] @ d.exact[n]) for n in columns)
        if below:
            factor = top / below
            scaled = {n: factor * d.exact[n] for n in columns}
            if _is_visible(d, scaled):
                yield f"{title}: a factor of {factor:.9g}", 2, scaled


def _offsets(d: Difference) -> Iterator[Stated]:
    for title, columns in _scopes(d):
        moved = {n: float(np.mean(d.recorded[n] - d.exact[n])) for n in columns}
        listed = ", ".join(f"{v:.6g}" for v in moved.values())
        yield (
            f"{title}: an offset of {listed}",
            1 + len(columns),
            {n: d.exact[n] + v for n, v in moved.items()},
        )


def _turns(d: Difference) -> Iterator[Stated]:
    """Return angles that differ by full turns."""
    angles = [n for n in d.recorded if kind_of(n) == "angle"]
    for columns in [angles, *([n] for n in angles)] if len(angles) > 1 else [angles]:
        turns = {n: np.round((d.recorded[n] - d.exact[n]) / (2 * np.pi)) for n in columns}
        if not any(t.any() for t in turns.values()):
            continue
        title = ", ".join(n for n in columns if turns[n].any())
        low, high = (f([f(d.recorded[n]) for n in columns if turns[n].any()]) for f in (np.min, np.max))
        says = "full turns are counted otherwise"
        for begin, end, interval in ((-np.pi, np.pi, "-π and π"), (0.0, 2 * np.pi, "0 and 2 π")):
            if begin - NEAR <= low and high <= end + NEAR:
                says = f"full turns are not counted (angles between {interval})"
        yield f"{title}: {says}", 1, {n: d.exact[n] + 2 * np.pi * turns[n] for n in columns}


def _shifts(d: Difference) -> Iterator[Stated]:
    """Return all columns, or all velocities, shifted by a time, at samples that the exact motion then has."""
    size = float(d.times[-1] - d.times[0])
    rates = [n for n in d.recorded if SI[kind_of(n)] in ("m/s", "rad/s")]
    for title, names in (("all columns", list(d.recorded)), ("all velocities and rates", rates)):

        def later(shift: float, names: list[str] = names) -> Columns | None:
            found = _at(d, d.times - shift)
            return found and {n: found[n] for n in names}

        if names and size > 0 and (shift := _best(d, later, size * SHIFTS)) and (columns := later(shift)):
            word = "later" if shift > 0 else "earlier"
            yield f"{title}: {word} by {abs(shift):.6g} s", 2, columns


def _clocks(d: Difference) -> Iterator[Stated]:
    """Return the motion at times that a clock shows which goes fast or slow."""

    def faster(rate: float) -> Columns | None:
        return _at(d, d.times / (1 + rate))

    rates = FASTER * np.linspace(-1, 1, 41)
    if len(d.times) > 1 and (rate := _best(d, faster, rates)) and (columns := faster(rate)):
        word = "fast" if rate > 0 else "slow"
        yield f"all columns: the clock of the table is {word} by {abs(rate):.6g} of the time", 2, columns


def _best(d: Difference, predict: Callable[[float], Columns | None], tried: np.ndarray) -> float | None:
    """Return the number for which the predicted columns leave least; the best of some numbers is refined."""
    from scipy.optimize import minimize_scalar

    nothing = 10 * d.size({})  # more than any prediction that is worth a refinement leaves

    def size(number: float) -> float:
        ask()
        columns = predict(number)
        return nothing if columns is None else d.size(columns)

    best, step = float(tried[int(np.argmin([size(x) for x in tried]))]), float(tried[1] - tried[0])
    for _ in range(
        REFINED
    ):  # the least size of a smooth square is found to its rounding in several intervals
        found = minimize_scalar(
            size, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-6 * step}
        )
        best, step = (float(found.x) if found.fun <= size(best) else best), 1e-3 * step
    return best if size(best) < nothing else None


def _at(d: Difference, times: np.ndarray) -> Columns | None:
    """Return the exact columns at other times (k,), where they are known; None if many are not."""
    inside = (times >= d.begin) & (times <= d.end)
    if inside.sum() < INSIDE * len(times):
        return None
    known = np.clip(times, d.begin, d.end)
    return {n: np.where(inside, d.later[n](known), d.recorded[n]) for n in d.recorded}


def _quaternions(d: Difference) -> Iterator[Stated]:
    turning = {b: q for b in d.bodies if (q := d.vector(b, "orientation", d.exact)) is not None}
    changes: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "quaternions in the order x, y, z, w": lambda q: q[:, [1, 2, 3, 0]],
        "quaternions in the order w, x, y, z, read as x, y, z, w": lambda q: q[:, [3, 0, 1, 2]],
        "quaternions of the opposite rotation, world to body": rotations.conjugate,
        "rotation vectors, not quaternions (w is the angle)": lambda q: _rotation_vectors(q, 1.0),
        "rotation vectors, not quaternions (w is 0)": lambda q: _rotation_vectors(q, 0.0),
    }
    scopes = [("all columns of orientation", list(turning)), *((f"{b}.orientation", [b]) for b in turning)]
    for title, bodies in scopes[: len(scopes) if len(turning) > 1 else 1]:
        for meaning, change in changes.items():
            columns: dict[str, np.ndarray] = {}
            for body in bodies:
                columns |= dict(zip(vector_names(body, "orientation"), change(turning[body]).T, strict=True))
            if columns:
                yield f"{title}: {meaning}", 1, columns


def _rotation_vectors(q: np.ndarray, first: float) -> np.ndarray:
    """Return rotation vectors (k, 3) of quaternions (k, 4), rad, behind ``first`` times their length."""
    q = np.where(q[:, :1] < 0, -q, q)
    size = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(size, q[:, :1])
    vectors = q[:, 1:] * np.where(size > 0, angle / np.where(size > 0, size, 1.0), 2.0)
    return np.hstack([first * angle, vectors])


def _exchanges(d: Difference) -> Iterator[Stated]:
    """Return columns that hold other columns of the exact motion, also of another quantity, body or joint."""
    off = [n for n in d.recorded if not d.is_small(n, d.squares[n])]
    names = [*off, *(n for n in d.recorded if n not in off)]
    held: dict[str, str] = {}
    for name in off:
        ask()
        held[name] = min(
            (n for n in names if n != name), key=lambda n: d.left(name, d.exact[n]), default=name
        )
        if not d.is_small(name, d.left(name, d.exact[held[name]])):
            return
    if not held or all(_of_one_vector(*pair) for pair in held.items()):
        return  # ``axes`` says which components are exchanged
    if all(np.ptp(d.exact[n]) <= np.max(d.allowed.get(n, 0.0)) for n in held.values()):
        return  # constants do not show where they come from
    title, other = ", ".join(held), ", ".join(held.values())
    says = f"hold{'s' * (len(held) == 1)} {other} of the exact motion"
    if len(held) == 2 and set(held) == set(held.values()):
        title, says = " and ".join(held), "are exchanged"
    elif len(held) > LISTED:
        title, says = _parts(held), _parts(held.values())
        title, says = f"columns of {title}", f"hold columns of {says} of the exact motion"
    yield f"{title} {says}", 2, {n: d.exact[m] for n, m in held.items()}


def _of_one_vector(first: str, second: str) -> bool:
    return kind_of(first) in VECTORS and first.rpartition(".")[0] == second.rpartition(".")[0]


def _parts(columns: Iterable[str]) -> str:
    """Return the bodies, joints and loads of columns, in the order of the columns."""
    return ", ".join(dict.fromkeys(n.partition(f".{kind_of(n)}")[0] for n in columns))


def _interpolations(d: Difference) -> Iterator[Stated]:
    """Return all columns interpolated from every m-th row of the table, linearly or by the previous value."""
    times, exact = d.every or (d.times, d.exact)
    rows = np.searchsorted(times, d.times)
    for m in range(2, max(2, min(50, len(times) // 3))):
        ask()
        nodes = np.arange(0, len(times), m)
        if nodes[-1] != len(times) - 1:
            nodes = np.append(nodes, len(times) - 1)
        spacing = times[m] - times[0]
        lines = {n: np.interp(d.times, times[nodes], exact[n][nodes]) for n in d.recorded}
        yield f"all columns: straight lines between samples {spacing:.6g} s apart", 2, lines
        before = nodes[np.searchsorted(nodes, rows, side="right") - 1]
        steps = {n: exact[n][before] for n in d.recorded}
        yield f"all columns: each value is repeated for {spacing:.6g} s", 2, steps


FAMILIES_OF_CAUSES = (
    _quaternions,
    _turns,
    _units,
    _factors,
    _offsets,
    _shifts,
    _clocks,
    body_components,
    frames,
    points,
    _interpolations,
    axes,
    _exchanges,
)
