"""Symbols of joints, of the ground and of loads, each at its position on the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from mbref import rotations
from mbref.motions.drawing import svg
from mbref.motions.drawing.shapes import attack, rim
from mbref.motions.drawing.svg import GREY, INK, PAPER
from mbref.motions.drawing.timeline import Timeline
from mbref.motions.drawing.view import Page
from mbref.motions.joint_motion import position_of, positions_of, turned_since_start
from mbref.motions.trajectory import Trajectory
from mbref.rotations import Vector3
from mbref.scene import GROUND, Coupling, Driver, Joint, Load, RollingLine, RollingWheel, Scene

UP = np.array([0.0, 0.0, 1.0])  # direction of the symbol of a point damper
ACTION = "#b3261e"  # colour of loads and drivers
STUB = 20.0  # px; half the length of an axis drawn at a joint
ARROW = 52.0  # px; length of an arrow
PATCH = 34.0  # px; half the length of a plane or line drawn at a joint
IN_PLACE = np.zeros((1, 3))  # m; displacement of points that only move with their body
FACING = 0.7  # cosine of the angle to the line of sight above which an axis is drawn as a point


class Stage(NamedTuple):
    """Scene, motion, page and timeline of a drawing; without a timeline the first sample is drawn."""

    scene: Scene
    motion: Trajectory
    page: Page
    timeline: Timeline | None

    def place(self, body: str, point: Vector3) -> np.ndarray:
        """Return the pixels (k, 2) of a point (world, t = 0) of a body."""
        return self.page.pixels(position_of(self.scene, self.motion, body, point))

    def points(self, body: str, points: np.ndarray, moved: np.ndarray = IN_PLACE) -> np.ndarray:
        """Return the pixels (k, n, 2) of points (n, 3, world, t = 0) of a body, moved by vectors (k, 3)."""
        return self.page.pixels(positions_of(self.scene, self.motion, body, points.tolist()) + moved[:, None])

    def along(self, body: str, point: Vector3, axis: np.ndarray, px: float) -> np.ndarray:
        """Return the pixels (k, 2, 2) of the ends of an axis through a point, each at most ``px`` away."""
        half = axis * px / self.page.scale
        return self.points(body, np.array([np.array(point) - half, np.array(point) + half]))

    def line(self, points: np.ndarray, look: str, closed: bool = False) -> str:
        """Return a moving line, or an outline, through pixels (k, n, 2); it is not filled by default."""
        return svg.line(points, look if "fill" in look else f'{look} fill="none"', self.timeline, closed)

    def sign(self, body: str, point: Vector3, content: str) -> str:
        """Return content drawn about the origin, carried along a point (world, t = 0) of a body."""
        return svg.follow(self.place(body, point), content, self.timeline)


def ground_mark(stage: Stage, joint: Joint) -> Iterator[str]:
    """Return a hatched triangle below a joint to the ground, or a dashed guide for a sliding joint; nothing
    for a joint that constrains nothing."""
    if not joint.facts.rows or joint.facts.velocity_rows:
        return
    side = joint.bodies.index(GROUND)
    point = joint.anchor_pair[side]
    if joint.facts.free_translations == 1 and joint.directions:
        look = f'stroke="{GREY}" stroke-dasharray="6 5" fill="none"'
        yield svg.line(_guide(stage, joint, side), look, None)
        return
    x, y = stage.place(GROUND, point)[0]
    hatch = "".join(f"M{x + dx:.1f} {y + 16:.1f}l-5 6" for dx in (-9, -3, 3, 9))
    yield f'<path d="M{x:.1f} {y:.1f}l-10 16h20z" fill="{PAPER}" stroke="{INK}" stroke-width="1.6"/>'
    yield f'<path d="M{x - 13:.1f} {y + 16:.1f}h26{hatch}" stroke="{INK}" stroke-width="1.3" fill="none"/>'


def _guide(stage: Stage, joint: Joint, side: int) -> np.ndarray:
    """Return the pixels (1, 2, 2) of the line along which a joint to the ground slides. The line is a little
    longer than the travel."""
    axis, point = rotations.unit(joint.directions[0]), np.array(joint.anchor_pair[side])
    moving = position_of(stage.scene, stage.motion, joint.bodies[1 - side], joint.anchor_pair[1 - side])
    travel, over = (moving - point) @ axis, 42 / stage.page.scale
    ends = point + axis * np.array([[travel.min() - over], [travel.max() + over]])
    return stage.page.pixels(ends)[None]


def joint_mark(stage: Stage, joint: Joint) -> Iterator[str]:
    """Return the symbol of a joint's type, moving with its second body, and its axes unless they point to the
    reader."""
    names, (first, second) = joint.bodies, joint.anchor_pair
    if joint.type == "distance":
        ends = np.stack([stage.place(names[0], first), stage.place(names[1], second)], axis=1)
        yield stage.line(ends, f'stroke="{INK}" stroke-width="2" stroke-dasharray="9 3 2 3"')
    if joint.type == "inline":
        ends = stage.along(names[0], first, rotations.unit(joint.directions[0]), 34.0)
        yield stage.line(ends, f'stroke="{GREY}" stroke-width="2" stroke-dasharray="6 5"')
    sliding = joint.facts.free_translations == 1 and joint.type != "inline" and bool(joint.directions)
    for k, axis in enumerate(map(rotations.unit, joint.directions)):
        body, point = (names[k], joint.anchor_pair[k]) if len(joint.directions) > 1 else (names[1], second)
        if sliding:
            yield from _sleeve(stage, body, point, axis)
        elif abs(axis @ stage.page.view.axes[2]) < 1 - 1e-9 and joint.type not in HIDDEN_AXES:
            ends = stage.along(body, point, axis, STUB)
            yield stage.line(ends, f'stroke="{INK}" stroke-width="1.2" stroke-dasharray="7 2 1 2"')
    if isinstance(joint, RollingWheel):
        yield from _wheel(stage, joint)
    if joint.type == "planar":
        yield from _plane(stage, names[0], first, rotations.unit(joint.directions[0]))
    yield stage.sign(names[1], second, SIGNS[joint.type])


def _sleeve(stage: Stage, body: str, point: Vector3, axis: np.ndarray) -> Iterator[str]:
    ends = stage.along(body, point, axis, 15.0)
    inner = ends + (ends.mean(axis=1, keepdims=True) - ends) * 0.11
    yield stage.line(ends, f'fill="none" stroke-linecap="butt" stroke="{INK}" stroke-width="15"')
    yield stage.line(inner, f'fill="none" stroke-linecap="butt" stroke="{PAPER}" stroke-width="11.6"')


def _wheel(stage: Stage, joint: RollingWheel) -> Iterator[str]:
    """Return the plane or the line on which a wheel rolls, its rim, and a spoke."""
    names, (contact, centre), points = joint.bodies, joint.anchor_pair, rim(joint)
    below = _lowest_points(stage, joint) - position_of(stage.scene, stage.motion, names[0], contact)
    if isinstance(joint, RollingLine):
        half = np.array(joint.without_slip[0]) * PATCH / stage.page.scale
        ends = stage.points(names[0], np.array([contact - half, contact + half]), below)
        yield stage.line(ends, f'stroke="{GREY}" stroke-width="2"')
    else:
        yield from _plane(stage, names[0], contact, rotations.unit(joint.normal), below)
    look = f'stroke="{INK}" stroke-width="1.6"'
    yield stage.line(stage.points(names[1], points), look, closed=True)
    yield stage.line(stage.points(names[1], np.array([centre, contact])), look)


def _lowest_points(stage: Stage, joint: RollingWheel) -> np.ndarray:
    """Return the positions (k, 3) of the lowest point of a wheel's rim."""
    normal, axis = (
        rotations.rotate(turned_since_start(stage.scene, stage.motion, body), rotations.unit(direction)[None])
        for body, direction in zip(joint.bodies, joint.directions, strict=True)
    )
    up = normal - np.sum(normal * axis, axis=1, keepdims=True) * axis
    centre = position_of(stage.scene, stage.motion, joint.bodies[1], joint.anchor)
    return np.asarray(centre - joint.radius * up / np.linalg.norm(up, axis=1, keepdims=True))


def _plane(
    stage: Stage, body: str, point: Vector3, normal: np.ndarray, moved: np.ndarray = IN_PLACE
) -> Iterator[str]:
    across = np.cross(normal, np.eye(3)[np.argmin(abs(normal))])
    across /= np.linalg.norm(across)
    other, half = np.cross(normal, across), PATCH / stage.page.scale
    corners = np.array(point) + half * np.array(
        [across + other, across - other, -across - other, other - across]
    )
    look = f'stroke="{GREY}" fill="{GREY}" fill-opacity="0.15"'
    yield stage.line(stage.points(body, corners, moved), look, closed=True)


def _ball(fill: str, radius: float = 5.5) -> str:
    return f'<circle r="{radius:g}" fill="{fill}" stroke="{INK}" stroke-width="1.8"/>'


# types of joints whose axes are not drawn as a dashed line
HIDDEN_AXES = ("planar", "inline", "free", "rolling", "rolling_line")
SIGNS = {
    "fixed": f'<rect x="-5.5" y="-5.5" width="11" height="11" fill="{INK}"/>',
    "revolute": _ball(PAPER),
    "universal": _ball(PAPER, 6.5) + f'<path d="M-4 -4L4 4M-4 4L4 -4" stroke="{INK}"/>',
    "spherical": _ball(INK),
    "translational": "",
    "cylindrical": _ball(PAPER, 4),
    "planar": _ball(GREY, 4),
    "inline": _ball(INK, 3.5),
    "free": _ball(ACTION, 3.5),
    "rolling": _ball(PAPER, 3.5),
    "rolling_line": _ball(PAPER, 3.5),
    "distance": _ball(PAPER, 3.5),
}


def coupling_mark(stage: Stage, coupling: Coupling) -> str:
    """Return a dotted line along the joints, which moves with them; a spiral for a joint coupled with
    itself."""
    joints = [stage.scene.joint_named(name) for name in coupling.joints]
    ends = [stage.place(joint.bodies[1], joint.anchor_pair[1]) for joint in joints]
    if len(set(coupling.joints)) == 1:
        return svg.follow(ends[0], _spiral(INK), stage.timeline)
    look = f'stroke="{INK}" stroke-width="1.6" stroke-dasharray="1 5" stroke-linecap="round"'
    return stage.line(np.stack(ends, axis=1), look)


def driver_mark(stage: Stage, driver: Driver) -> str:
    """Return a curved arrow about, or an arrow along, the axis of a driven joint, in the direction of its
    initial motion."""
    joint = stage.scene.joint_named(driver.joint)
    main, point = driver.turn[0] if driver.turn else driver, joint.anchor_pair[1]
    axis = rotations.unit(driver.turn[0].axis if driver.turn else joint.directions[0])
    rate = main.polynomial[1] if len(main.polynomial) > 1 else 0.0
    sense = -1.0 if rate < 0 else 1.0
    if joint.facts.driven != "displacement":
        sign = _turning(stage, axis * sense, 15.0)
    else:
        sign = _arrow_from_origin(stage, axis * sense)
    return stage.sign(joint.bodies[1], point, sign)


def load_mark(stage: Stage, load: Load) -> str:
    """Symbol of a load: a straight arrow, a curved arrow, a zigzag, or a spiral at its joint."""
    if load.type == "force":
        return stage.sign(load.body, load.point, _arrow_from_origin(stage, rotations.unit(load.force)))
    if load.type == "moment":
        body = stage.scene.body[stage.scene.body_index(load.body)]
        return stage.sign(load.body, body.position, _turning(stage, rotations.unit(load.moment), 20.0))
    if load.type == "spring":
        first, second = (stage.place(*end) for end in attack(load))
        return stage.line(_zigzag(first, second), f'stroke="{ACTION}" stroke-width="1.6"')
    if load.type == "point_damper":
        return stage.sign(load.bodies[1], load.point, _short_zigzag(stage, UP))
    if load.type == "rotational_damper":
        carrier = next(name for name in load.bodies[::-1] if name != GROUND)
        return stage.sign(carrier, stage.scene.body[stage.scene.body_index(carrier)].position, _spiral())
    joint = stage.scene.joint_named(load.joint)
    axis = rotations.unit(joint.directions[0])
    sense = axis * np.copysign(1.0, load.action.amount)
    signs: dict[str, Callable[[], str]] = {
        "torsion_spring": _spiral,
        "slide_spring": lambda: _short_zigzag(stage, axis),
        "joint_torque": lambda: _turning(stage, sense, 15.0),
        "joint_force": lambda: _arrow_from_origin(stage, sense),
    }
    return stage.sign(joint.bodies[1], joint.anchor_pair[1], signs[load.type]())


def _short_zigzag(stage: Stage, axis: np.ndarray) -> str:
    """Return a zigzag for a spring along an axis from the origin."""
    end = ARROW * stage.page.directions(axis)
    zigzag = _zigzag(np.zeros((1, 2)), end[None], 8)
    return svg.line(zigzag, f'stroke="{ACTION}" stroke-width="1.6" fill="none"', None)


def _arrow_from_origin(stage: Stage, direction: np.ndarray) -> str:
    return svg.arrow(np.zeros(2), ARROW * stage.page.directions(direction), ACTION)


def _turning(stage: Stage, axis: np.ndarray, radius: float) -> str:
    """Return a curved arrow if the axis points to the reader, otherwise the axis as an arrow with two
    heads."""
    facing = float(axis @ stage.page.view.axes[2])
    if abs(facing) > FACING or not axis.any():
        return svg.turn(radius, facing, ACTION)
    end = ARROW * stage.page.directions(axis)
    return svg.arrow(np.zeros(2), 0.8 * end, ACTION) + svg.arrow(0.6 * end, end, ACTION)


def _zigzag(first: np.ndarray, second: np.ndarray, turns: int = 12) -> np.ndarray:
    """Return the pixels (k, turns + 2, 2) of a spring between its ends (k, 2)."""
    along = second - first
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    share = np.linspace(0.15, 0.85, turns)
    sway = 7.0 * np.where(np.arange(turns) % 2, 1.0, -1.0)
    sway[[0, -1]] = 0.0
    inner = first[:, None] + share[:, None] * along[:, None] + sway[:, None] * across[:, None]
    return np.concatenate([first[:, None], inner, second[:, None]], axis=1)


def _spiral(colour: str = ACTION) -> str:
    angle, radius = np.linspace(0, 4.5 * np.pi, 60), np.linspace(8, 17, 60)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return svg.line(points[None], f'stroke="{colour}" stroke-width="1.5" fill="none"', None)
