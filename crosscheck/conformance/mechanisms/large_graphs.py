"""Random mechanisms of up to 200 bodies from seeds: forests, bodies with many joints, loops that share links,
loops between trees, several components, redundant closures, massless links.

Joints hold at the initial poses by construction, velocities by projection. Engines are judged on them by
accelerations at the start, which take milliseconds.
"""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np

from crosscheck.conformance.changes.copies import replaced
from crosscheck.conformance.mechanisms.parts import triple
from crosscheck.judge.connected_parts import factored, parts
from crosscheck.judge.constraints import inertia_matrices, initial_poses, jacobian
from crosscheck.judge.gauss_principle import bias
from mbref import rotations
from mbref.scene import GROUND, JOINT_TYPES, Body, Force, Joint, Moment, Revolute, Scene

FEWEST, MOST = 10, 200  # bodies; their logarithm is uniformly distributed
DURATION = 1e-3  # s: a few steps
REACH = 0.5  # m; distance of a body from the body that carries it
TREE = {"revolute": 0.5, "spherical": 0.15, "universal": 0.1, "translational": 0.1, "cylindrical": 0.1,
        "fixed": 0.05}  # fmt: skip
CLOSING = {"spherical": 0.6, "revolute": 0.2, "distance": 0.1, "cylindrical": 0.05, "universal": 0.05}
PLANAR = 0.4  # fraction of the trees whose axes are parallel, so that their loops are redundant
FLOATING = 0.2  # fraction of the trees without a joint to the ground
COAXIAL = 0.2  # fraction of the loops that are a second hinge on the axis of another hinge
AWAY = 0.2  # fraction of the other loops that connect two trees
NEAR = 8  # a loop connects a body with the nearest one of so many
CLEAR = 1e-5  # least pivot of a mechanism's rows over the largest; nearer to singular, rounding decides
CONTINUES = 1e-9  # residual of the acceleration equations below which a velocity belongs to a motion
DRAWS = 100
WITH_MASSLESS = 10  # of so many seeds, one has massless parts
SOME = 40  # most bodies of a mechanism with massless parts, whose accelerations need all singular values
MASSLESS = 0.15  # fraction of its bodies that are tried as massless ones
DETERMINED = 1e-6  # least kinetic energy of a free motion over the largest one, for unit velocities


@cache
def large_graph(seed: int, fewest: int = FEWEST, most: int = MOST) -> Scene:
    """Return a mechanism with gravity, forces and moments, and velocities that its joints allow.

    ``fewest`` (at least 3) and ``most`` are numbers of bodies.
    Raises RuntimeError if every draw of the seed is next to a singular position.
    """
    rng = np.random.default_rng([seed, 5])
    name = f"graph_{seed}" if (fewest, most) == (FEWEST, MOST) else f"graph_{seed}_of_{fewest}_to_{most}"
    for _ in range(DRAWS):
        if scene := _Drawing(rng, fewest, most).scene(name):
            return scene
    raise RuntimeError(f"seed {seed}: {DRAWS} draws are next to singular positions")


def graph_of_suite(seed: int) -> Scene:
    """Return the large mechanism of a seed: by `massless_graph` for every tenth seed, else `large_graph`."""
    return massless_graph(seed) if seed % WITH_MASSLESS == WITH_MASSLESS - 1 else large_graph(seed)


@cache
def massless_graph(seed: int) -> Scene:
    """Return a mechanism of `large_graph` with 10 to 40 bodies, of which some between joints are massless.

    The bodies with mass determine every motion.
    """
    scene = large_graph(seed, FEWEST, SOME)
    jointed = Counter(name for joint in scene.joint for name in joint.bodies)
    loaded = {load.body for load in scene.load if isinstance(load, Moment | Force)}
    free = [body.name for body in scene.body if jointed[body.name] > 1 and body.name not in loaded]
    most = max(1, round(MASSLESS * len(scene.body)))
    for name in np.random.default_rng([seed, 6]).permutation(free)[:most]:
        lighter = scene.with_(
            body=tuple(replaced(b, mass=0.0, inertia=(0, 0, 0)) if b.name == name else b for b in scene.body)
        )
        scene = lighter if _is_determined(lighter) else scene
    return scene.with_(name=f"massless_{scene.name}")


def _is_determined(scene: Scene) -> bool:
    """Return whether the bodies with mass have kinetic energy in each motion that the joints allow."""
    pose = initial_poses(scene)
    turn = rotations.to_matrix(pose[1])
    metric = np.zeros((len(turn), 6, 6))
    metric[:, :3, :3] = np.array([body.mass for body in scene.body])[:, None, None] * np.eye(3)
    metric[:, 3:, 3:] = turn @ inertia_matrices(scene) @ np.swapaxes(turn, 1, 2)
    rows = jacobian(scene, 0.0, *pose)[0]
    for part in parts(rows):
        held = factored(rows[np.ix_(part.rows, part.columns)])
        moves = np.linalg.qr(held.basis, mode="complete")[0][:, held.rank :]
        within = metric[part.columns[::6] // 6]
        energy = moves.T @ np.einsum("bij,bjk->bik", within, moves.reshape(len(within), 6, -1)).reshape(
            moves.shape
        )
        found = np.linalg.eigvalsh(energy) if len(energy) else np.ones(1)
        if found[0] < DETERMINED * found[-1]:
            return False
    return True


class _Drawing:
    """State of the drawing of one mechanism."""

    def __init__(self, rng: np.random.Generator, fewest: int, most: int):
        self.rng = rng
        count = round(fewest * (most / fewest) ** rng.random())
        trees = int(rng.integers(1, 2 + min(4, count // 6)))
        self.tree = np.sort(rng.integers(0, trees, count))  # tree of each body
        self.axes = [self.direction() if rng.random() < PLANAR else None for _ in range(trees)]
        self.place = np.zeros((count, 3))
        self.joints: list[Joint] = []
        for body in range(count):
            self.grow(body)
        for _ in range(int(rng.integers(1, 2 + count // 3))):
            self.close()
        self.bodies = tuple(self.body(k) for k in range(count))

    def grow(self, body: int) -> None:
        """Place a body and join it to an earlier body of its tree, or to the ground."""
        rng, tree = self.rng, self.tree[body]
        earlier = np.flatnonzero(self.tree[:body] == tree)
        start = 3.0 * tree * np.eye(3)[0]
        if not len(earlier):
            self.place[body] = start + rng.uniform(-1, 1, 3)
            if rng.random() >= FLOATING:
                self.join(GROUND, body, TREE)
            return
        # half of the bodies continue a chain; others sit on any body, or on a hub with many joints
        on = int(rng.choice([earlier[-1], earlier[-1], rng.choice(earlier), earlier[len(earlier) // 3]]))
        self.place[body] = self.place[on] + REACH * self.direction()
        self.join(_name(on), body, TREE)

    def close(self) -> None:
        """Add a joint that closes a loop: a hinge on the axis of another hinge, or between near bodies."""
        rng = self.rng
        hinges = [joint for joint in self.joints if isinstance(joint, Revolute)]
        if hinges and rng.random() < COAXIAL:
            hinge = hinges[rng.integers(len(hinges))]
            anchor = triple(np.array(hinge.anchor) + rng.uniform(0.2, 0.6) * np.array(hinge.axis))
            self.joints.append(
                Revolute(name=f"J{len(self.joints)}", bodies=hinge.bodies, anchor=anchor, axis=hinge.axis)
            )
            return
        first = int(rng.integers(len(self.place)))
        own = (self.tree == self.tree[first]) != (rng.random() < AWAY)
        others = np.setdiff1d(np.flatnonzero(own), [first])
        if not len(others):
            return
        some = rng.choice(others, min(NEAR, len(others)), replace=False)
        nearest = int(some[np.linalg.norm(self.place[some] - self.place[first], axis=1).argmin()])
        self.join(_name(nearest), first, CLOSING)

    def join(self, on: str, body: int, weights: dict[str, float]) -> None:
        """Add a joint of random type about half-way between two bodies."""
        rng = self.rng
        kind = str(rng.choice(list(weights), p=list(weights.values())))
        there = self.place[int(on[1:])] if on != GROUND else self.place[body] + REACH * self.direction()
        middle = (there + self.place[body]) / 2 + rng.uniform(-0.1, 0.1, 3)
        shared, across = self.axes[self.tree[body]], self.direction()
        along = self.direction() if shared is None else shared
        across = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
        turns = JOINT_TYPES[kind].facts.free_rotations > 0
        joint = JOINT_TYPES[kind].at(
            f"J{len(self.joints)}",
            (on, _name(body)),
            anchor=triple(middle),
            anchors=(triple(middle), triple(middle + rng.uniform(0.3, 0.8) * across)),
            axis=triple(along if turns else across),
            axes=(triple(along), triple(across)),
        )
        self.joints.append(joint)

    def body(self, k: int) -> Body:
        """Return a body with a full inertia matrix."""
        moments = self.rng.uniform(0.01, 0.04, 3)
        turn = rotations.to_matrix(rotations.from_vector(self.rng.normal(size=3)))
        inertia = turn @ np.diag(moments.sum() - moments) @ turn.T
        return Body(
            name=_name(k),
            mass=float(self.rng.uniform(0.5, 3.0)),
            inertia=((inertia + inertia.T) / 2).tolist(),
            position=triple(self.place[k]),
            orientation=tuple(rotations.from_vector(self.rng.normal(size=3)).tolist()),
        )

    def scene(self, name: str) -> Scene | None:
        """Return the mechanism in motion; None next to a singular position. It is at rest where no motion
        continues the velocities."""
        rng = self.rng
        pushed = [self.bodies[k] for k in rng.choice(len(self.bodies), 3, replace=False)]
        still = Scene(
            name=name,
            gravity=triple(9.81 * self.direction()),
            duration=DURATION,
            body=self.bodies,
            joint=tuple(self.joints),
            load=(
                Moment(body=pushed[0].name, moment=triple(rng.normal(size=3))),
                Force(body=pushed[1].name, point=pushed[1].position, force=triple(rng.normal(size=3))),
                Force(body=pushed[2].name, point=pushed[2].position, force=triple(rng.normal(size=3))),
            ),
        )
        rows = jacobian(still, 0.0, *initial_poses(still))[0]
        factors = [(part, factored(rows[np.ix_(part.rows, part.columns)])) for part in parts(rows)]
        if min(held.clearance for _, held in factors) < CLEAR:
            return None
        twists = np.asarray(rng.normal(size=rows.shape[1]))
        for part, held in factors:
            twists[part.columns] -= held.basis @ (held.basis.T @ twists[part.columns])
        moving = _with_twists(still, twists.reshape(-1, 6))
        coasting = bias(moving)
        for part, held in factors:
            block = rows[np.ix_(part.rows, part.columns)]
            left = block @ held.solved(coasting[part.rows]) - coasting[part.rows]
            if np.linalg.norm(left) > CONTINUES * max(1.0, float(np.linalg.norm(coasting[part.rows]))):
                twists[part.columns] = 0.0
        return _with_twists(still, twists.reshape(-1, 6))

    def direction(self) -> np.ndarray:
        v = self.rng.normal(size=3)
        return v / np.linalg.norm(v)


def _name(body: int) -> str:
    return f"b{body}"


def _with_twists(scene: Scene, twists: np.ndarray) -> Scene:
    return scene.with_(
        body=tuple(
            replaced(body, velocity=x[:3], angular_velocity=x[3:])
            for body, x in zip(scene.body, twists, strict=True)
        )
    )
