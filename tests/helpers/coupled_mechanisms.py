"""Mechanisms with couplings and armatures, of which some have closed forms."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mbref.scene import Scene
from tests.helpers.parts import Entry, X, Y, Z, hinge, joint, slide

G = 9.81
ORIGIN = (0.0, 0.0, 0.0)


def body(name: str, mass: float, inertia: list[float], place: tuple[float, ...], **fields: Any) -> Entry:
    """Return a body whose axes are the world's."""
    return {"name": name, "mass": mass, "inertia": inertia, "position": list(place), **fields}


def coupling(name: str, first: str, second: str, ratio: float, **fields: Any) -> Entry:
    """Return a coupling of two joints."""
    return {"name": name, "joints": [first, second], "ratio": ratio, **fields}


def gear_pair(**changes: Any) -> Scene:
    """Return two wheels on the ground, off their centres; a moment turns the first one."""
    scene = {
        "name": "gear_pair",
        "duration": 3.0,
        "body": [
            body("pinion", 1.0, [0.02, 0.02, 0.03], ORIGIN),
            body("wheel", 3.0, [0.1, 0.1, 0.2], (0.4, 0.1, 0.0)),
        ],
        "joint": [hinge("A", "ground", "pinion", ORIGIN), hinge("B", "ground", "wheel", (0.4, 0.1, 0.0))],
        "coupling": [coupling("teeth", "A", "B", -0.5)],
        "load": [{"type": "moment", "body": "pinion", "moment": [0.0, 0.0, 2.0]}],
    }
    return Scene(**{**scene, **changes})


def shifted(make: Callable[[], Scene], name: str, offset: float) -> Scene:
    """Return a scene with the offset (m or rad) of one of its couplings."""
    return make().with_(f"coupling[{name}].offset", offset)


def rack() -> Scene:
    """Return a rack that falls and turns its pinion."""
    wheel, beam = body("pinion", 2.0, [0.1, 0.1, 0.2], ORIGIN), body("rack", 1.5, [0.1] * 3, (0.05, 0.2, 0.0))
    joints = [hinge("A", "ground", "pinion", ORIGIN), slide("B", "ground", "rack", (0.05, 0.0, 0.0), Y)]
    parts = {"body": [wheel, beam], "joint": joints, "coupling": [coupling("teeth", "A", "B", 0.05)]}
    return Scene(name="rack", gravity=(0.0, -G, 0.0), duration=2.0, **parts)


def screw() -> Scene:
    """Return a nut that its weight turns down a screw; the coupling relates both coordinates of one joint."""
    nut = body("nut", 2.0, [0.01, 0.01, 0.02], ORIGIN)
    thread = joint("S", "cylindrical", "ground", "nut", ORIGIN, axis=list(Z))
    parts = {"body": [nut], "joint": [thread], "coupling": [coupling("thread", "S", "S", 0.01)]}
    return Scene(name="screw", gravity=(0.0, 0.0, -G), duration=2.0, **parts)


def pendulum(armature: float = 0.3) -> Scene:
    """Return a pendulum on the shaft of a motor, released at the height of its hinge."""
    bodies = [body("rod", 1.2, [0.01, 0.02, 0.03], (0.5, 0.0, 0.0))]
    joints = [hinge("A", "ground", "rod", ORIGIN, armature=armature)]
    return Scene(name="armature_pendulum", gravity=(0.0, -G, 0.0), duration=3.0, body=bodies, joint=joints)


def slide_with_motor() -> Scene:
    """Return a slide on an incline, with a reflected mass."""
    bodies = [body("cart", 2.0, [0.1, 0.1, 0.1], (0.0, 0.3, 0.0))]
    joints = [slide("A", "ground", "cart", (0.0, 0.3, 0.0), (0.8, -0.6, 0.0), armature=1.5)]
    return Scene(name="slide_with_motor", gravity=(0.0, -G, 0.0), duration=1.0, body=bodies, joint=joints)


def planetary() -> Scene:
    """Return a planet on an arm, both with armatures; the gears share the arm."""
    arm = body("arm", 1.0, [0.1] * 3, (0.5, 0.0, 0.0))
    planet = body("planet", 0.7, [0.1] * 3, (1.1, 0.0, 0.0))
    hinges = hinge("A", "ground", "arm", ORIGIN, armature=0.05), hinge("B", "arm", "planet", X, armature=0.02)
    parts = {"body": [arm, planet], "joint": hinges, "coupling": [coupling("mesh", "A", "B", 3.0)]}
    return Scene(name="planetary", gravity=(0.0, -G, 0.0), duration=1.0, **parts)


def spatial_chain() -> Scene:
    """Return a chain with skew axes: two angles are coupled, and two displacements."""
    bodies = [
        body("a", 1.0, [0.1, 0.12, 0.14], (0.5, 0.0, 0.0), angular_velocity=[0.0, 0.0, 2.0]),
        body("b", 0.7, [0.05, 0.06, 0.07], (1.2, 0.1, 0.0)),
        body("c", 0.4, [0.02, 0.03, 0.04], (1.7, 0.1, 0.2)),
    ]
    joints = [
        hinge("A", "ground", "a", ORIGIN, armature=0.05),
        joint("B", "cylindrical", "a", "b", X, axis=[0.0, 1.0, 1.0], armature=0.02),
        slide("C", "b", "c", (1.5, 0.1, 0.1), (1.0, 0.0, 0.5), armature=0.3),
    ]
    cable = coupling("cable", "B", "C", 0.2, coordinates=["displacement"] * 2)
    parts = {"body": bodies, "joint": joints, "coupling": [coupling("mesh", "A", "B", 0.7), cable]}
    return Scene(name="spatial_chain", gravity=(0.0, 0.0, -G), duration=1.0, **parts)


def coupled_loops() -> Scene:
    """Return two four-bar linkages whose cranks are geared, with one freedom."""
    left, right = four_bar("left", 0.0), four_bar("right", 3.0)
    parts = {"body": [*left[0], *right[0]], "joint": [*left[1], *right[1]]}
    gears = coupling("gears", "left A", "right A", -1.5)
    return Scene(name="coupled_loops", gravity=(0.0, -G, 0.0), duration=1.0, coupling=[gears], **parts)


def four_bar(name: str, x: float) -> tuple[list[Entry], list[Entry]]:
    """Return bodies and joints of a four-bar linkage without redundant rows."""
    a, b, c, d = (x, 0.0, 0.0), (x, 0.3, 0.0), (x + 0.9, 0.8, 0.0), (x + 0.8, 0.0, 0.0)
    crank, coupler, rocker = (f"{name} {link}" for link in ("crank", "coupler", "rocker"))
    bodies = []
    for link, p, q in ((crank, a, b), (coupler, b, c), (rocker, d, c)):
        length = float(np.linalg.norm(np.subtract(q, p)))
        centre = (np.add(p, q) / 2).tolist()
        bodies.append(body(link, length, [length**3 / 12] * 3, centre))
    axes = [list(Z), [b[1] - c[1], c[0] - b[0], 0.0]]
    joints = [
        hinge(f"{name} A", "ground", crank, a),
        joint(f"{name} B", "universal", crank, coupler, b, axes=axes),
        joint(f"{name} C", "spherical", coupler, rocker, c),
        hinge(f"{name} D", "ground", rocker, d),
    ]
    return bodies, joints


EVERY = (gear_pair, rack, screw, pendulum, slide_with_motor, planetary, spatial_chain, coupled_loops)
