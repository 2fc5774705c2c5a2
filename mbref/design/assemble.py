"""Assembly: closes the loops of a mechanism from approximate positions and given lengths of its links."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mbref import rotations
from mbref.equations.gaps import is_closed
from mbref.equations.initial_state import solve_positions
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.equations.packing import Packs
from mbref.equations.parts import FRAME
from mbref.equations.placed import placed_with_springs
from mbref.rotations import Vector3
from mbref.scene import GROUND, Scene, SceneError, refuse_rolling

SHARES = 20  # parts into which a large change is divided, so that the loops stay on their branch
MOST_LINK_STEPS = 50  # largest number of Gauss–Newton steps for the points of a link


@dataclass(frozen=True)
class Assembled:
    """Scene with closed loops; displacement of every joint (m) and body (m, rad); lengths of links before and
    after."""

    scene: Scene
    joints: dict[str, float]
    bodies: dict[str, tuple[float, float]]
    lengths: dict[str, tuple[float, float]]


class _Reshaped(Packs):
    """A scene in which some body-fixed points (world, t = 0) are moved, by body and point."""

    def __init__(self, scene: Scene, elsewhere: Mapping[tuple[str, Vector3], np.ndarray]):
        self._elsewhere = elsewhere
        super().__init__([scene])

    def points(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        return super().points(bodies, self._moved(bodies, points.reshape(-1, 3)).reshape(points.shape))

    def in_bodies(self, vectors: np.ndarray) -> np.ndarray:
        points, vectors = self.structure.vector_is_point, vectors.copy()
        vectors[0, points] = self._moved(self.structure.vector_body[points], vectors[0, points])
        return super().in_bodies(vectors)

    def _moved(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the moved points (k, 3) of bodies (k,)."""
        names = [body.name for body in self.bodies]
        names.append(FRAME if GROUND in names else GROUND)
        pairs = zip(bodies.tolist(), points.tolist(), strict=True)
        moved = [self._elsewhere.get((names[b], (x, y, z)), np.array([x, y, z])) for b, (x, y, z) in pairs]
        return np.array(moved).reshape(points.shape)


def assemble(scene: Scene, lengths: Mapping[tuple[str, str], float]) -> Assembled:
    """Return the scene with given distances (m) between pairs of joints on a link and with closed loops.

    The points of a link move as little as possible to get its lengths. After that the bodies move, by the
    least mass-weighted displacement, until every joint is satisfied. Masses, inertias and velocities are
    unchanged, and so are the poses at which springs of joints are relaxed, and polynomials of couplings:
    their numbers count from the new poses. Raises SceneError for joints that share no link, or if the loops
    cannot be closed with these lengths.
    """
    scene = assembled(scene)
    refuse_rolling(scene, "assemblies with given lengths")
    pairs = {pair: _common_link(scene, *pair) for pair in lengths}
    shifts = _point_displacements(scene, lengths, pairs)
    q = Model(scene).start()
    for share in np.linspace(0.0, 1.0, SHARES + 1)[1:]:
        elsewhere = {key: np.array(key[1]) + share * shift for key, shift in shifts.items()}
        model = Model(scene, _Reshaped(scene, elsewhere))
        q, phi = solve_positions(model, 0.0, q)
        if not is_closed(model, model.terms(0.0, q)):
            worst = int(np.argmax(np.abs(phi)))
            raise SceneError(
                [
                    f"joint[{model.row_joint[worst]}]: the loops cannot be closed with these lengths; at "
                    f"{100 * share:.0f} % of the changes {abs(phi[worst]):.3g} remains open"
                ]
            )
    return _differences(scene, placed_with_springs(model, q), pairs)


def _common_link(scene: Scene, first: str, second: str) -> str:
    """Return the link that two joints share."""
    known = {joint.name for joint in scene.joint}
    for name in (first, second):
        if name not in known:
            raise SceneError(
                [f"length {first}-{second}: no joint {name!r}; joints: {', '.join(sorted(known))}"]
            )
    both = [b for b in scene.joint_named(first).bodies if b in scene.joint_named(second).bodies]
    if not both:
        raise SceneError([f"length {first}-{second}: the joints {first!r} and {second!r} share no link"])
    return next((b for b in both if b != GROUND), GROUND)


def _anchor_on(scene: Scene, joint: str, body: str) -> Vector3:
    found = scene.joint_named(joint)
    return found.anchor_pair[found.bodies.index(body)]


def _point_displacements(
    scene: Scene, lengths: Mapping[tuple[str, str], float], pairs: Mapping[tuple[str, str], str]
) -> dict[tuple[str, Vector3], np.ndarray]:
    """Return the displacements (3,) of the points of each link that give it its lengths, with the least sum
    of squares."""
    found: dict[tuple[str, Vector3], np.ndarray] = {}
    for body in set(pairs.values()):
        own = {pair: lengths[pair] for pair, b in pairs.items() if b == body}
        points = list(dict.fromkeys(_anchor_on(scene, joint, body) for pair in own for joint in pair))
        ends = [tuple(points.index(_anchor_on(scene, joint, body)) for joint in pair) for pair in own]
        moved = _points_at_distances(body, np.array(points), ends, list(own.values()))
        found |= {(body, point): new - np.array(point) for point, new in zip(points, moved, strict=True)}
    return found


def _points_at_distances(
    body: str, points: np.ndarray, ends: list[tuple[int, ...]], lengths: list[float]
) -> np.ndarray:
    """Return points (n, 3) near the given ones with given distances: Gauss–Newton steps of least norm."""
    x, wanted = points.copy(), np.array(lengths)
    for _ in range(MOST_LINK_STEPS):
        apart = np.array([x[b] - x[a] for a, b in ends])
        now = np.linalg.norm(apart, axis=1)
        if np.abs(now - wanted).max() <= 1e-14 * wanted.max():
            return x
        if now.min() == 0:
            break
        rows = np.zeros((len(ends), *x.shape))
        for row, (a, b), d in zip(rows, ends, apart / now[:, None], strict=True):
            row[b] += d
            row[a] -= d
        x += (np.linalg.pinv(rows.reshape(len(ends), -1)) @ (wanted - now)).reshape(x.shape)
    if np.abs(now - wanted).max() > 1e-12 * wanted.max():
        raise SceneError([f"body[{body}]: no link has these lengths between its joints"])
    return x


def _distance(scene: Scene, first: str, second: str, body: str) -> float:
    return math.dist(_anchor_on(scene, first, body), _anchor_on(scene, second, body))


def _differences(old: Scene, new: Scene, pairs: Mapping[tuple[str, str], str]) -> Assembled:
    """Return the differences of the new scene from the old one."""
    joints = {
        a.name: max(map(math.dist, a.anchor_pair, b.anchor_pair))
        for a, b in zip(old.joint, new.joint, strict=True)
    }
    bodies = {
        a.name: (
            math.dist(a.position, b.position),
            float(rotations.angle_between(np.array(a.orientation), np.array(b.orientation))),
        )
        for a, b in zip(old.body, new.body, strict=True)
    }
    lengths = {
        f"{first}–{second}": (_distance(old, first, second, body), _distance(new, first, second, body))
        for (first, second), body in pairs.items()
    }
    return Assembled(new, joints, bodies, lengths)
