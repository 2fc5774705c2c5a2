"""Comparison of joint reactions in their unique components; how redundant joints share loads depends on the
engine.

The multipliers of redundant rows are determined up to the left null space of the Jacobian.  At a joint this
gives a subspace of wrenches. Components orthogonal to the subspace are unique and must agree between engines,
components in the subspace need not agree.  The resultant of all joints on a body is always unique.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from crosscheck.judge.constraints import (
    jacobian,
    length_rows,
    scene_length,
)
from crosscheck.judge.coupling_laws import law_value, unwound
from crosscheck.judge.joint_coordinates import COORDINATES, coordinate_jacobian, pose_coordinates
from crosscheck.judge.joint_residuals import joint_frames, with_ground
from crosscheck.judge.loads import attachment
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, Joint, Scene
from mbref.scene.joints import Coordinate

LEAST = 1e-3  # m/s²; forces that cause smaller accelerations of the masses count as zero
POSES = 64  # poses whose undetermined wrenches are kept
SAMPLES = 11  # number of compared samples, spread over the trajectory


@dataclass(frozen=True)
class Reaction:
    """Reactions of one joint in two runs.

    ``shared`` is the number of dimensions of the wrench that redundancy leaves undetermined. ``unique`` and
    ``chosen`` are the largest differences orthogonal to and in these dimensions, relative to the largest
    reaction of the first run. Moments are divided by the scene's length.
    """

    shared: int
    unique: float
    chosen: float


@dataclass(frozen=True)
class Comparison:
    """Comparison by joint, and the largest difference of the resultant of all joints on a body."""

    joints: Mapping[str, Reaction]
    resultant: float


def shared_wrenches(
    scene: Scene, t: float, position: np.ndarray, orientation: np.ndarray, rank: float = RANK
) -> dict[str, np.ndarray]:
    """Return for each joint an orthonormal basis (6, k) of the wrenches that redundancy leaves undetermined;
    k = 0 if the reaction is unique, 6 where the law of a coupling is not known. A wrench is a force and a
    moment over the scene's length, in world axes, on the second body at its anchor.

    ``position`` (nb, 3) and ``orientation`` (nb, 4) are one pose at time t (s). The pose must satisfy the
    joints so accurately that singular values below ``rank`` times the largest singular value count as zero.
    """
    pose = np.ascontiguousarray(position, dtype=float), np.ascontiguousarray(orientation, dtype=float)
    return dict(_shared(scene, float(t), pose[0].tobytes(), pose[1].tobytes(), rank))


@lru_cache(maxsize=POSES)
def _shared(
    scene: Scene, t: float, positions: bytes, orientations: bytes, rank: float
) -> dict[str, np.ndarray]:
    """Return the bases of `shared_wrenches`; all runs of a comparison have the exact motion's poses."""
    position = np.frombuffer(positions).reshape(-1, 3)
    orientation = np.frombuffer(orientations).reshape(-1, 4)
    rows, _ = jacobian(scene, t, position, orientation)
    if np.isnan(rows).any():
        return {joint.name: np.eye(6) for joint in scene.joint}
    arms, found = np.repeat([1.0, scene_length(scene)], 3), {}
    scaled_rows, _, sizes = unit_rows(scene, rows)
    u, s, _ = np.linalg.svd(scaled_rows)
    open_ = u[:, int(np.sum(s > rank * s[0])) :]
    for joint, wrenches in of_multipliers(scene, rows, position, orientation):
        scaled = wrenches / arms[:, None] / sizes
        found[joint.name] = _span(scaled @ open_, rank * np.abs(scaled).max(initial=0.0))
    return found


def unit_rows(scene: Scene, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows J (m, 6 nb) as rows of length one, which do not depend on the mechanism's size, with the
    units (6 nb,) of twists and the sizes (m,): J is sizes · rows / units.

    Angular velocities are multiplied by the scene's length.
    """
    units = np.tile(np.repeat([1.0, 1 / scene_length(scene)], 3), len(scene.body))
    sizes = np.linalg.norm(rows * units, axis=1)
    return rows * units / sizes[:, None], units, sizes


def of_multipliers(
    scene: Scene, rows: np.ndarray, position: np.ndarray, orientation: np.ndarray
) -> Iterator[tuple[Joint, np.ndarray]]:
    """Return for every joint the wrenches (6, rows) on its second body, at its anchor, of unit multipliers of
    all rows of `jacobian`.

    A coupling acts along the coordinates of its joints.
    """
    start = 0
    for joint in scene.joint:
        stop = start + len(length_rows(scene)[joint.name])
        found = np.zeros((6, len(rows)))
        found[:, start:stop] = on_second(scene, joint, rows[start:stop], position, orientation)
        start = stop
        first = len(rows) - len(scene.coupling)
        for k, coupling in enumerate(scene.coupling, first):
            for law, (other, coordinate) in zip(coupling.laws, scene.coupled(coupling), strict=True):
                if other.name == joint.name:
                    slope = _slope(scene, joint, law, coordinate, position, orientation)
                    found[:, k] += slope * along_coordinate(scene, joint, coordinate, position, orientation)
        yield joint, found


def _slope(
    scene: Scene,
    joint: Joint,
    law: tuple[float, ...],
    coordinate: Coordinate,
    position: np.ndarray,
    orientation: np.ndarray,
) -> float:
    """Return the derivative of a coupling's law at a pose, with an angle within half a turn."""
    if len(law) == 1:
        return law[0]
    frames = next(each for each in joint_frames(scene) if each.name == joint.name)
    found = pose_coordinates(frames, *with_ground(position, orientation))
    return float(law_value(law, found[COORDINATES.index(coordinate)], 1))


def along_coordinate(
    scene: Scene, joint: Joint, coordinate: Coordinate, position: np.ndarray, orientation: np.ndarray
) -> np.ndarray:
    """Return the wrench (6,) on a joint's second body of a unit force or moment along its coordinate."""
    row = coordinate_jacobian(scene, joint.name, position, orientation)[COORDINATES.index(coordinate)]
    return on_second(scene, joint, row[None], position, orientation)[:, 0]


def compare(scene: Scene, first: Trajectory, second: Trajectory) -> Comparison:
    """Compare the reactions of a reference and of a run at some samples; both have equal sample times.

    Differences are relative to the reference's largest reaction, so that implausible reactions give large
    numbers. Raises ValueError if a trajectory has no reactions or the times differ.
    """
    samples = min(len(first.times), len(second.times))
    if first.reactions is None or second.reactions is None:
        raise ValueError("a run without reactions has none to compare")
    if not samples or not np.array_equal(first.times[:samples], second.times[:samples]):
        raise ValueError("runs are compared at common sample times")
    chosen = np.unique(np.linspace(0, samples - 1, min(samples, SAMPLES)).round().astype(int))
    scale = largest_reaction(scene, first)
    tables = [_at_sample(scene, first, second, int(k), scale) for k in chosen]
    joints = {
        name: Reaction(*(max(found) for found in zip(*(table[name] for table in tables), strict=True)))
        for name in first.reactions
    }
    units = np.repeat([1.0, scene_length(scene)], 3)
    off = (resultants(scene, second, chosen) - resultants(scene, first, chosen)) / units / scale
    return Comparison(joints, float(np.abs(off).max(initial=0.0)))


def side_by_side(scene: Scene, runs: Mapping[str, Trajectory], sample: int) -> dict[str, dict[str, float]]:
    """Return for each joint with undetermined components the size (N, moments over the scene's length) of
    every run's component in these directions at a sample."""
    pose = next(iter(runs.values()))
    scene = unwound(scene, pose)[sample]
    shared = shared_wrenches(scene, pose.times[sample], pose.position[sample], pose.orientation[sample])
    units = np.repeat([1.0, scene_length(scene)], 3)
    return {
        name: {
            label: float(np.linalg.norm(basis.T @ (run.reactions[name][sample] / units)))
            for label, run in runs.items()
            if run.reactions is not None
        }
        for name, basis in shared.items()
        if basis.shape[1]
    }


def resultants(scene: Scene, run: Trajectory, samples: np.ndarray | int) -> np.ndarray:
    """Return force and moment about the centre of mass (…, nb, 6), world, of all joints on every body, at
    samples (…)."""
    position, orientation = run.position[samples], run.orientation[samples]
    total = np.zeros((*position.shape[:-1], 6))
    for joint in scene.joint:
        assert run.reactions is not None
        wrench = run.reactions[joint.name][samples]
        anchor = _anchor(scene, joint, position, orientation)
        for sign, name in zip((-1.0, 1.0), joint.bodies, strict=True):
            if name != GROUND:
                b = scene.body_index(name)
                total[..., b, :3] += sign * wrench[..., :3]
                arm = anchor - position[..., b, :]
                total[..., b, 3:] += sign * (wrench[..., 3:] + rotations.cross(arm, wrench[..., :3]))
    return total


def largest_reaction(scene: Scene, run: Trajectory) -> float:
    """Return the largest reaction of a run, N; at least the force that accelerates the masses by LEAST."""
    units = np.repeat([1.0, scene_length(scene)], 3)
    sizes = [float(np.linalg.norm(wrench / units, axis=1).max()) for wrench in (run.reactions or {}).values()]
    return max(*sizes, 0.0, LEAST * sum(body.mass or 1.0 for body in scene.body))


def _at_sample(
    scene: Scene, first: Trajectory, second: Trajectory, k: int, scale: float
) -> dict[str, tuple[int, float, float]]:
    """Return (shared, unique, chosen) by joint, at one sample."""
    assert first.reactions is not None
    assert second.reactions is not None
    units = np.repeat([1.0, scene_length(scene)], 3)
    scene = unwound(scene, first)[k]
    shared = shared_wrenches(scene, first.times[k], first.position[k], first.orientation[k])
    joints = {}
    for name, basis in shared.items():
        apart = (second.reactions[name][k] - first.reactions[name][k]) / units / scale
        inside = basis @ (basis.T @ apart)
        joints[name] = (basis.shape[1], float(np.linalg.norm(apart - inside)), float(np.linalg.norm(inside)))
    return joints


def on_second(
    scene: Scene, joint: Joint, rows: np.ndarray, position: np.ndarray, orientation: np.ndarray
) -> np.ndarray:
    """Return (6, rows): wrench on the second body at its anchor for unit multipliers of its rows (rows, 6
    nb)."""
    first, second = (scene.body_index(name) for name in joint.bodies)
    b, sign = (second, 1.0) if second >= 0 else (first, -1.0)
    wrench = sign * rows[:, 6 * b : 6 * b + 6].T
    arm = _anchor(scene, joint, position, orientation) - position[b]
    return np.vstack([wrench[:3], wrench[3:] - np.cross(arm, wrench[:3].T).T])


def _anchor(scene: Scene, joint: Joint, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Return the anchor (…, 3) on the second body, world, at poses (…, nb, ·)."""
    body, local = attachment(scene, joint.bodies[1], joint.anchor_pair[1])
    return local if body < 0 else position[..., body, :] + rotations.rotate(orientation[..., body, :], local)


def _span(vectors: np.ndarray, least: float) -> np.ndarray:
    """Return an orthonormal basis (6, k) of the span of columns (6, n); columns below 1e3 ``least`` are
    ignored."""
    u, s, _ = np.linalg.svd(vectors, full_matrices=False)
    return u[:, s > 1e3 * least]
