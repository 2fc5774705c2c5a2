"""Newton's and Euler's equations of each body, from joint reactions, gravity and accelerations alone."""

import numpy as np

from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene


def unbalanced(scene: Scene, run: Trajectory) -> tuple[float, float]:
    """Return the largest force and moment that no reaction explains, relative to the largest of their kind.
    The scene has no loads: m a = m g + Σ reactions, and J ω' + ω × J ω = Σ moments about the centre of mass.
    A joint's reaction acts on its second body at the anchor on that body, and reversed on its first body."""
    assert run.reactions is not None
    assert run.acceleration is not None
    assert run.angular_acceleration is not None
    names = [body.name for body in scene.body]
    force = np.zeros_like(run.position)
    moment = np.zeros_like(run.position)
    largest_force, largest_moment = 1e-300, 1e-300
    for joint in scene.joint:
        wrench = run.reactions[joint.name]
        place = anchor_on_second(scene, run, joint)
        largest_force = max(largest_force, np.abs(wrench[:, :3]).max())
        for name, sign in ((joint.bodies[1], 1.0), (joint.bodies[0], -1.0)):
            if name in names:
                b = names.index(name)
                force[:, b] += sign * wrench[:, :3]
                moved = np.cross(place - run.position[:, b], wrench[:, :3])
                moment[:, b] += sign * (wrench[:, 3:] + moved)
                largest_moment = max(largest_moment, np.abs(moved).max(), np.abs(wrench[:, 3:]).max())
    for b, body in enumerate(scene.body):
        force[:, b] += body.mass * (np.array(scene.gravity) - run.acceleration[:, b])
        turned = matrix(run.orientation[:, b])
        inertia = np.array(body.inertia, dtype=float)
        own = np.diag(inertia) if inertia.ndim == 1 else inertia
        world = turned @ own @ np.swapaxes(turned, -1, -2)
        spin = run.angular_velocity[:, b]
        demanded = np.einsum("kij,kj->ki", world, run.angular_acceleration[:, b])
        gyroscopic = np.cross(spin, np.einsum("kij,kj->ki", world, spin))
        moment[:, b] -= demanded + gyroscopic
        largest_force = max(largest_force, np.abs(body.mass * run.acceleration[:, b]).max())
        largest_moment = max(largest_moment, np.abs(gyroscopic).max(), np.abs(demanded).max())
    length = np.abs(run.position).max()
    largest_moment = max(largest_moment, length * largest_force)
    return float(np.abs(force).max() / largest_force), float(np.abs(moment).max() / largest_moment)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return rotation matrices (…, 3, 3) of unit quaternions (…, 4): v + 2 w u × v + 2 u × (u × v)."""
    w, u = quaternion[..., None, :1], quaternion[..., None, 1:]
    axes = np.eye(3)
    once = np.cross(u, axes)
    return np.swapaxes(axes + 2 * w * once + 2 * np.cross(u, once), -1, -2)


def anchor_on_second(scene: Scene, run: Trajectory, joint: object) -> np.ndarray:
    """Return the place (k, 3) of a joint's anchor on its second body, world frame."""
    name, point = joint.bodies[1], np.array(joint.anchor_pair[1])  # type: ignore[attr-defined]
    if name == "ground":
        return np.broadcast_to(point, (len(run.times), 3))
    b = [body.name for body in scene.body].index(name)
    body = scene.body[b]
    start = matrix(np.array(body.orientation))
    own = start.T @ (point - np.array(body.position))
    return run.position[:, b] + np.einsum("kij,j->ki", matrix(run.orientation[:, b]), own)
