"""Random mechanisms of ``random_mechanisms`` with additional armatures and a coupling."""

from __future__ import annotations

import numpy as np

from crosscheck.conformance.mechanisms.parts import triple
from crosscheck.conformance.mechanisms.random_mechanisms import CONTINUES, random_mechanism
from crosscheck.judge.constraints import initial_poses, jacobian, scene_length
from crosscheck.judge.gauss_principle import goes_on, rank_of
from mbref.scene import Coupling, Joint, Scene
from mbref.scene.joints import Coordinate

GEARED = 0.5  # probability that a joint has an armature
TRIES = 40


def geared_mechanism(seed: int) -> Scene:
    """Return a random mechanism with armatures. It also has a coupling of two joint coordinates if a degree
    of freedom remains.

    The result depends on the seed only.
    """
    scene, rng = random_mechanism(seed), np.random.default_rng([seed, 1])
    joints = [
        joint.model_copy(update={"armature": float(rng.uniform(0.02, 0.5))})
        if "armature" in type(joint).model_fields and rng.random() < GEARED
        else joint
        for joint in scene.joint
    ]
    scene = scene.with_(name=f"geared_{seed}", joint=tuple(joints))
    ends = [(joint, kind) for joint in joints for kind in joint.facts.coordinates]
    for _ in range(TRIES if len(ends) > 1 else 0):
        first, second = (ends[k] for k in rng.choice(len(ends), 2, replace=False))
        coupled = _moving(scene.with_(coupling=(_coupling(first, second, rng),)), rng)
        if coupled is not None:
            return coupled
    return scene


def _coupling(
    first: tuple[Joint, Coordinate], second: tuple[Joint, Coordinate], rng: np.random.Generator
) -> Coupling:
    ratio = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.0))
    pair, kinds = (first[0].name, second[0].name), (first[1], second[1])
    return Coupling(name="gears", joints=pair, ratio=ratio, coordinates=kinds)


def _moving(scene: Scene, rng: np.random.Generator) -> Scene | None:
    """Return the scene with random velocities that its constraints allow; None if no finite motion
    remains."""
    units = np.tile(np.repeat([1.0, 1 / scene_length(scene)], 3), len(scene.body))
    rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
    _, sizes, vt = np.linalg.svd(rows * units)
    free = vt[rank_of(sizes) :]
    if not len(free):
        return None
    # the projector is unique; a basis of the null space depends on rounding
    twists = (units * (free.T @ (free @ rng.normal(size=len(units))))).reshape(-1, 6)
    bodies = [
        body.model_copy(update={"velocity": triple(x[:3]), "angular_velocity": triple(x[3:])})
        for body, x in zip(scene.body, twists, strict=True)
    ]
    moving = scene.with_(body=tuple(bodies))
    return moving if goes_on(moving, CONTINUES) else None
