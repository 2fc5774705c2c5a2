"""Bodies as lines and plates between their joints, moved by a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Joint, Load, RollingWheel, Scene

RIM_POINTS = 72  # of a wheel's drawn rim
FLAT = 1e-6  # thickness / size below which a body or mechanism is planar or straight


@dataclass(frozen=True)
class Shape:
    """A body's points (n, 3) in its own frame, m, in the order in which a line joins them.

    The line of a body with three or more points that are not in line closes at its first point.
    """

    name: str
    points: np.ndarray

    @property
    def is_plate(self) -> bool:
        """True if the line encloses an area."""
        return len(self.points) > 3 and bool((self.points[0] == self.points[-1]).all())


def shapes(scene: Scene) -> list[Shape]:
    """Return the shape of every body: its joints and the points at which springs and forces act on it.

    The centre of mass is added if there is a single point.
    """
    return [Shape(body.name, _ordered(_own_points(scene, body))) for body in scene.body]


def anchors(joint: Joint) -> list[tuple[str, tuple[float, float, float]]]:
    """Return body and anchor (world, t = 0) for both sides of a joint."""
    return list(zip(joint.bodies, joint.anchor_pair, strict=True))


def rim(joint: RollingWheel) -> np.ndarray:
    """Return points (n, 3) of the rim of a wheel (world, t = 0), the lowest one first."""
    contact, centre = np.array(joint.anchor_pair)
    down = contact - centre
    across = np.cross(rotations.unit(joint.axis), down)
    turns = np.linspace(0.0, 2.0 * np.pi, RIM_POINTS, endpoint=False)[:, None]
    return np.asarray(centre + np.cos(turns) * down + np.sin(turns) * across)


def attack(load: Load) -> list[tuple[str, tuple[float, float, float]]]:
    """Return body and point (world, t = 0) for the ends of a spring, for a force or for a point damper."""
    if load.type == "spring":
        return list(zip(load.bodies, load.points, strict=True))
    if load.type == "point_damper":
        return [(load.bodies[1], load.point)]
    return [(load.body, load.point)] if load.type == "force" else []


def _own_points(scene: Scene, body: Body) -> np.ndarray:
    """Return the distinct points (n, 3) of a body in its frame; its origin is added to a single point."""
    found = [a for joint in scene.joint for name, a in anchors(joint) if name == body.name]
    found += [p for load in scene.load for name, p in attack(load) if name == body.name]
    points = np.array(found or [body.position]) - np.array(body.position)
    local = rotations.rotate(rotations.conjugate(np.array(body.orientation)), points)
    local = np.unique(local.round(12), axis=0)
    return local if len(local) > 1 else np.unique(np.concatenate([local, np.zeros((1, 3))]), axis=0)


def _ordered(points: np.ndarray) -> np.ndarray:
    """Return points in the order along their main direction; points that are not on a line give their closed
    convex hull."""
    centred = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centred)
    if len(points) < 3 or sizes[1] <= FLAT * sizes[0]:
        return points[np.argsort(centred @ axes[0])]
    from scipy.spatial import ConvexHull  # imported here, because it takes a fifth of a second

    order = ConvexHull(centred @ axes[:2].T).vertices
    return points[np.append(order, order[0])]


def at_rest(scene: Scene) -> Trajectory:
    """Return the trajectory of one sample, t = 0, at the poses of the start, with zero velocities."""
    from mbref.equations.offsets import assembled  # imported here: other pictures need no equations

    nb, start = len(scene.body), assembled(scene).body
    return Trajectory(
        scene=scene.name,
        engine="mbref",
        version="",
        method="",
        settings={},
        times=np.zeros(1),
        bodies=tuple(body.name for body in scene.body),
        position=np.array([[body.position for body in start]]),
        orientation=np.array([[body.orientation for body in start]]),
        velocity=np.zeros((1, nb, 3)),
        angular_velocity=np.zeros((1, nb, 3)),
    )
