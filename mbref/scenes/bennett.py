"""Bennett's linkage: four hinges on skew axes, the only overconstrained spatial four-bar.

G. T. Bennett, Engineering 76, 1903.  Opposite links have the same length and twist, sin α / a = sin β / b,
and the hinges' angles obey tan(θ₁/2) tan(θ₂/2) = sin((β + α)/2) / sin((β - α)/2).  Three rows are redundant.
Sizes and inertias are chosen here: links of 1 kg per metre, 0.3 m and 0.5 m, gravity along -z.
"""

from __future__ import annotations

import math

import numpy as np

from mbref import rotations
from mbref.scene import Body, Revolute, Scene
from mbref.scenes.links import DENSITY, rod_inertia, triple

SHORT, LONG, TWIST = 0.3, 0.5, math.radians(30)  # m, m, rad of the short links
OPENING = 1.0  # rad, the first hinge's angle


def bennett() -> Scene:
    """Return the linkage at rest at an opening of 1 rad; the first link is the ground."""
    twist = math.asin(LONG * math.sin(TWIST) / SHORT)
    ratio = math.sin((twist + TWIST) / 2) / math.sin((twist - TWIST) / 2)
    second = 2 * math.atan(ratio / math.tan(OPENING / 2))
    angles = (OPENING, second, -OPENING, -second)
    sizes = ((SHORT, TWIST), (LONG, twist)) * 2
    place, frame = np.zeros(3), np.eye(3)
    hinges, links = [], []
    for angle, (length, turn) in zip(angles, sizes, strict=True):
        hinges.append((place, frame[:, 2]))
        frame = frame @ _about(2, angle)
        links.append((place + length / 2 * frame[:, 0], frame, length))
        place, frame = place + length * frame[:, 0], frame @ _about(0, turn)
    bodies = [_link(f"link{n}", *link) for n, link in enumerate(links[1:], start=1)]
    chain = ["ground", *(body.name for body in bodies), "ground"]
    order = (*hinges[1:], hinges[0])
    joints = [
        Revolute(name=f"R{n + 1}", bodies=(chain[n], chain[n + 1]), anchor=triple(point), axis=triple(axis))
        for n, (point, axis) in enumerate(order)
    ]
    return Scene(
        name="bennett", gravity=(0.0, 0.0, -9.81), duration=1.0, body=tuple(bodies), joint=tuple(joints)
    )


def _link(name: str, middle: np.ndarray, frame: np.ndarray, length: float) -> Body:
    mass = DENSITY * length
    return Body(
        name=name,
        mass=mass,
        inertia=rod_inertia(mass, length),
        position=triple(middle),
        orientation=tuple(rotations.from_matrix(frame).tolist()),
    )


def _about(axis: int, angle: float) -> np.ndarray:
    return rotations.to_matrix(rotations.from_vector(angle * np.eye(3)[axis]))
