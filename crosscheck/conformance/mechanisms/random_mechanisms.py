"""Random closed-loop mechanisms from seeds."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from crosscheck.conformance.mechanisms.parts import Triple, direction, triple
from crosscheck.judge.constraints import initial_poses, jacobian
from crosscheck.judge.gauss_principle import goes_on, rank_of
from mbref import rotations
from mbref.scene import (
    GROUND,
    JOINT_TYPES,
    Body,
    Cylindrical,
    Force,
    Joint,
    Moment,
    Revolute,
    Scene,
    Spherical,
    Spring,
)

KINDS = ("revolute", "universal", "spherical", "translational", "cylindrical", "distance", "fixed", "planar")
# probability of each joint type when a body is added to the tree
TREE = (0.34, 0.14, 0.14, 0.12, 0.12, 0.08, 0.03, 0.03)
CLOSING = (0.4, 0.15, 0.2, 0.05, 0.1, 0.08, 0.0, 0.02)  # probabilities of joint types that close a loop
PLANAR = 0.65  # fraction of the mechanisms whose axes are parallel, so that their loops are redundant
HINGED = 0.25  # fraction of the loops that are a second hinge on the axis of the first
TRIES = 60
MOST_DRAWS = 1000  # largest number of attempts to generate a mechanism; usually a few suffice
DURATION = 0.01  # s
CONTINUES = 1e-9  # relative residual of the acceleration equations below which a mobility is finite


@cache
def random_mechanism(seed: int) -> Scene:
    """Return a movable mechanism of 3 to 8 bodies and 1 to 3 loops, with loads and velocities.

    Poses satisfy the joints by construction, velocities by projection. A mechanism that is singular at its
    start, so that it has a velocity but no finite motion, is replaced by another. The result depends on the
    seed only, to 12 digits: the last ones of a projection depend on the processor.
    """
    rng = np.random.default_rng(seed)
    for _ in range(MOST_DRAWS):
        if scene := _Drawing(rng).scene(f"random_{seed}"):
            return scene
    raise RuntimeError(f"seed {seed}: no mechanism that moves in {MOST_DRAWS} draws")


class _Drawing:
    """State of the generation of one mechanism: random numbers, the axis of planar mechanisms, and the parts
    so far."""

    def __init__(self, rng: np.random.Generator):
        self.rng = rng
        self.axis = direction(self.rng)
        self.planar = rng.random() < PLANAR
        self.bodies = tuple(self.body(f"b{k}") for k in range(rng.integers(3, 9)))
        self.joints: list[Joint] = []

    def scene(self, name: str) -> Scene | None:
        """Return the mechanism; None if no loop could be closed or the mechanism is singular at its start."""
        places = {GROUND: np.zeros(3), **{body.name: np.array(body.position) for body in self.bodies}}
        names = list(places)
        for k in range(1, len(names)):
            self.joints.append(self.joint(str(self.rng.choice(names[:k])), names[k], places, TREE))
        loops = int(self.rng.integers(1, 4))
        closed = sum(self.close(names, places) for _ in range(loops))
        return self.moving(name) if closed == loops else None

    def close(self, names: Sequence[str], places: dict[str, np.ndarray]) -> bool:
        """Add a joint that closes a loop, and return whether it leaves some motion."""
        for _ in range(TRIES):
            first, second = map(str, self.rng.choice(names, 2, replace=False))
            hinges = [j for j in self.joints if isinstance(j, Revolute)]
            if hinges and self.rng.random() < HINGED:
                joint = self.second_hinge(hinges[self.rng.integers(len(hinges))])
            else:
                joint = self.joint(first, second, places, CLOSING)
            if _freedoms(Scene(name="trial", body=self.bodies, joint=(*self.joints, joint))) > 0:
                self.joints.append(joint)
                return True
        return False

    def moving(self, name: str) -> Scene | None:
        """Return the scene with random velocities and loads; None if no finite motion exists."""
        scene = Scene(
            name=name,
            gravity=(0.0, 0.0, -9.81),
            duration=DURATION,
            body=self.bodies,
            joint=tuple(self.joints),
            load=self.loads(),
        )
        free = null_space(scene)
        twists = (free @ (free.T @ self.rng.normal(size=len(free)))).reshape(-1, 6)
        moving = [
            body.model_copy(
                update={"velocity": tuple(x[:3].tolist()), "angular_velocity": tuple(x[3:].tolist())}
            )
            for body, x in zip(self.bodies, twists, strict=True)
        ]
        scene = scene.with_(body=tuple(moving))
        return scene if goes_on(scene, CONTINUES) else None

    def loads(self) -> tuple[Moment | Force | Spring, ...]:
        first, second = self.rng.choice(len(self.bodies), 2, replace=False)
        a, b = self.bodies[first], self.bodies[second]
        ends = (self.point(np.array(a.position)), self.point(np.array(b.position)))
        return (
            Moment(body=a.name, moment=triple(self.rng.normal(size=3))),
            Force(body=b.name, point=ends[1], force=triple(self.rng.normal(size=3))),
            Spring(bodies=(a.name, b.name), points=ends, stiffness=20.0, damping=0.5, natural_length=0.3),
        )

    def body(self, name: str) -> Body:
        moments = self.rng.uniform(0.01, 0.04, 3)
        turn = rotations.to_matrix(rotations.from_vector(self.rng.normal(size=3)))
        inertia = turn @ np.diag(moments.sum() - moments) @ turn.T
        return Body(
            name=name,
            mass=float(self.rng.uniform(0.5, 3.0)),
            inertia=((inertia + inertia.T) / 2).tolist(),
            position=triple(self.rng.uniform(-1, 1, 3)),
            orientation=tuple(rotations.from_vector(self.rng.normal(size=3)).tolist()),
        )

    def joint(
        self, first: str, second: str, places: dict[str, np.ndarray], weights: Sequence[float]
    ) -> Joint:
        """Return a joint of random type between two bodies, about half-way; planar mechanisms use their
        common axis."""
        kind = str(self.rng.choice(KINDS, p=weights))
        middle = self.point((places[first] + places[second]) / 2)
        along, across = self.axis if self.planar else direction(self.rng), direction(self.rng)
        across = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
        far = np.array(middle) + self.rng.uniform(0.3, 0.8) * across if kind == "distance" else across
        has_rotation = JOINT_TYPES[kind].facts.free_rotations > 0
        return JOINT_TYPES[kind].at(
            f"J{len(self.joints)}",
            (first, second),
            anchor=middle,
            anchors=(middle, triple(far)),
            axis=triple(along if has_rotation else across),
            axes=(triple(along), triple(across)),
        )

    def second_hinge(self, hinge: Revolute) -> Joint:
        """Return another joint on the axis of a revolute joint between the same bodies, whose rows are
        redundant."""
        axis = np.array(hinge.axis)
        anchor = triple(np.array(hinge.anchor) + self.rng.uniform(0.2, 0.6) * axis)
        kind: type[Joint] = Spherical
        if self.rng.random() >= 0.3:
            kind = Revolute if self.rng.random() < 0.5 else Cylindrical
        return kind.at(f"J{len(self.joints)}", hinge.bodies, anchor=anchor, axis=hinge.axis)

    def point(self, near: np.ndarray) -> Triple:
        return triple(near + self.rng.uniform(-0.3, 0.3, 3))


def null_space(scene: Scene) -> np.ndarray:
    """Return an orthonormal basis (6 nb, degrees of freedom) of the twists that the joints allow at t = 0."""
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    _, s, vt = np.linalg.svd(rows, full_matrices=True)
    return vt[rank_of(s) :].T


def _freedoms(scene: Scene) -> int:
    return null_space(scene).shape[1]
