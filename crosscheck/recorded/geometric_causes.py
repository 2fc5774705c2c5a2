"""Causes of a difference in the geometry: exchanged axes, another world frame, point or body axes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from crosscheck.recorded.columns import VECTORS
from crosscheck.recorded.explanations import Columns, Difference, Stated, vector_names
from mbref import rotations


def axes(d: Difference) -> Iterator[Stated]:
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


def frames(d: Difference) -> Iterator[Stated]:
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


def body_components(d: Difference) -> Iterator[Stated]:
    """Return velocities and accelerations by their components along the axes of the body."""
    kinds = [k for k in VECTORS if k not in ("position", "orientation")]
    chosen = [[k] for k in kinds] + [list(pair) for pair in itertools.combinations(kinds, 2)] + [kinds]
    for bodies, which in itertools.product([d.bodies, *([b] for b in d.bodies)], chosen):
        if not all(any(n in d.recorded for n in vector_names(b, k)) for b in bodies for k in which):
            continue
        columns: dict[str, np.ndarray] = {}
        for body, kind in itertools.product(bodies, which):
            q, vector = (
                np.array([d.whole[n] for n in vector_names(body, k)]).T for k in ("orientation", kind)
            )
            inner = rotations.rotate(rotations.conjugate(q), vector)
            columns |= dict(zip(vector_names(body, kind), inner.T, strict=True))
        title = "all bodies" if bodies == d.bodies else bodies[0]
        what = " and ".join(k.replace("_", " ") for k in which)
        yield f"{title}: {what} along the axes of the body, not of the world", 1, columns


def points(d: Difference) -> Iterator[Stated]:
    """Return the columns for another body-fixed point than the centre of mass, and for other body axes, of
    every body."""
    for body in d.bodies:
        yield from _other_axes(d, body)
        q = np.array([d.whole[n] for n in vector_names(body, "orientation")]).T
        w = np.array([d.whole[n] for n in vector_names(body, "angular_velocity")]).T
        known = [k for k in ("position", "velocity") if d.vector(body, k, d.recorded) is not None]
        for chosen in [known, *([k] for k in known)] if len(known) > 1 else [known]:
            columns, arm = _another_point(d, body, chosen, (q, w))
            where = ", ".join(f"{x:.6g}" for x in arm)
            only = "" if "position" in chosen else ": velocities"
            if columns:
                yield (
                    f"{body}{only}: a point at ({where}) m in the body's frame, not the centre of mass",
                    4,
                    columns,
                )


def _another_point(
    d: Difference, body: str, kinds: list[str], turning: tuple[np.ndarray, np.ndarray]
) -> tuple[Columns, np.ndarray]:
    """Return positions, velocities or both of a point, and the point's arm (3,) m in the body's frame."""
    q, w = turning
    axes = np.stack([rotations.rotate(q, unit) for unit in np.eye(3)], axis=2)  # (k, 3, 3)
    rates = np.stack([np.cross(w, axes[:, :, i]) for i in range(3)], axis=2)
    left, rows = [], []
    for kind in kinds:
        exact, recorded = (d.vector(body, kind, of) for of in (d.exact, d.recorded))
        assert exact is not None
        assert recorded is not None
        size = d.scale[vector_names(body, kind)[0]]
        left.append((recorded - exact).ravel() / size)
        rows.append((axes if kind == "position" else rates).reshape(-1, 3) / size)
    if not kinds:
        return {}, np.zeros(3)
    arm = np.linalg.lstsq(np.vstack(rows), np.concatenate(left), rcond=1e-9)[0]
    columns: dict[str, np.ndarray] = {}
    for kind in kinds:
        moved = np.array([d.exact[n] for n in vector_names(body, kind)]).T
        moved = moved + (axes if kind == "position" else rates) @ arm
        columns |= dict(zip(vector_names(body, kind), moved.T, strict=True))
    return columns, arm


def _other_axes(d: Difference, body: str) -> Iterator[Stated]:
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
