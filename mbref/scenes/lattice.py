"""Lattice of N by M parallelograms, a benchmark of scaling: loops that share bodies, M degrees of freedom.

Every floor has N + 1 uprights of 1 m and 1 kg, with N level bars across their tops that carry the next floor.
The uprights of a floor stay parallel and the bars stay level, so that a floor has one angle.  Hinges about z,
gravity along -y, at rest with floors that lean to alternate sides. 6 M (2 N + 1) coordinates, 15 M N + 5 M
rows, 4 M N of them redundant.
"""

from __future__ import annotations

import math

from mbref.scene import Revolute, Scene
from mbref.scenes.links import about_z, link

Z = (0.0, 0.0, 1.0)
LEAN, DRIFT = 0.3, 0.05  # rad: lean of every floor, to alternate sides, and of the last floor over the first


def floor_angles(floors: int) -> list[float]:
    """Return the angles (M,) of the floors' uprights from the vertical at the start, towards +x (rad)."""
    return [LEAN * (-1) ** k + DRIFT * k / floors for k in range(floors)]


def lattice(columns: int = 2, floors: int = 2, name: str = "lattice") -> Scene:
    """Return a lattice of loops at rest."""
    bodies, joints, x, y = [], [], 0.0, 0.0

    def hinge(name: str, first: str, second: str, at: tuple[float, float]) -> None:
        joints.append(Revolute(name=name, bodies=(first, second), anchor=(*at, 0.0), axis=Z))

    for floor, angle in enumerate(floor_angles(floors)):
        lean, level = about_z(math.pi / 2 - angle), about_z(0.0)
        top_x, top_y = x + math.sin(angle), y + math.cos(angle)
        feet = [(x + i, y) for i in range(columns + 1)]
        tops = [(top_x + i, top_y) for i in range(columns + 1)]
        for i, (foot, top) in enumerate(zip(feet, tops, strict=True)):
            below = f"upright{i}_{floor - 1}" if floor else "ground"
            bodies.append(link(f"upright{i}_{floor}", (*foot, 0.0), (*top, 0.0), lean, 1.0))
            hinge(f"A{i}_{floor}", below, f"upright{i}_{floor}", foot)
        for i in range(columns):
            bodies.append(link(f"bar{i}_{floor}", (*tops[i], 0.0), (*tops[i + 1], 0.0), level, 1.0))
            hinge(f"B{i}_{floor}", f"upright{i}_{floor}", f"bar{i}_{floor}", tops[i])
            hinge(f"C{i}_{floor}", f"bar{i}_{floor}", f"upright{i + 1}_{floor}", tops[i + 1])
        x, y = top_x, top_y
    return Scene(name=name, gravity=(0.0, -9.81, 0.0), duration=0.3, body=tuple(bodies), joint=tuple(joints))
