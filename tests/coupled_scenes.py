"""Scenes with couplings and armatures, of which some have closed forms."""

from __future__ import annotations

from mbref.scene import Scene

G = 9.81


def gear_pair(**changes) -> Scene:
    """Two wheels on the ground, the second turned by the first, driven by a moment; off their centres."""
    return Scene(
        **{
            "name": "gear_pair",
            "duration": 3.0,
            "body": [
                {"name": "pinion", "mass": 1.0, "inertia": [0.02, 0.02, 0.03], "position": [0.0, 0.0, 0.0]},
                {"name": "wheel", "mass": 3.0, "inertia": [0.1, 0.1, 0.2], "position": [0.4, 0.1, 0.0]},
            ],
            "joint": [
                {
                    "name": "A",
                    "type": "revolute",
                    "bodies": ["ground", "pinion"],
                    "anchor": [0.0, 0.0, 0.0],
                    "axis": [0.0, 0.0, 1.0],
                },
                {
                    "name": "B",
                    "type": "revolute",
                    "bodies": ["ground", "wheel"],
                    "anchor": [0.4, 0.1, 0.0],
                    "axis": [0.0, 0.0, 1.0],
                },
            ],
            "coupling": [{"name": "teeth", "joints": ["A", "B"], "ratio": -0.5}],
            "load": [{"type": "moment", "body": "pinion", "moment": [0.0, 0.0, 2.0]}],
            **changes,
        }
    )


def rack() -> Scene:
    """A rack that falls and turns its pinion."""
    return Scene(
        name="rack",
        gravity=(0.0, -G, 0.0),
        duration=2.0,
        body=[
            {"name": "pinion", "mass": 2.0, "inertia": [0.1, 0.1, 0.2], "position": [0.0, 0.0, 0.0]},
            {"name": "rack", "mass": 1.5, "inertia": [0.1, 0.1, 0.1], "position": [0.05, 0.2, 0.0]},
        ],
        joint=[
            {
                "name": "A",
                "type": "revolute",
                "bodies": ["ground", "pinion"],
                "anchor": [0.0, 0.0, 0.0],
                "axis": [0.0, 0.0, 1.0],
            },
            {
                "name": "B",
                "type": "translational",
                "bodies": ["ground", "rack"],
                "anchor": [0.05, 0.0, 0.0],
                "axis": [0.0, 1.0, 0.0],
            },
        ],
        coupling=[{"name": "teeth", "joints": ["A", "B"], "ratio": 0.05}],
    )


def screw() -> Scene:
    """A nut that its weight turns down a screw, both coordinates of one joint."""
    return Scene(
        name="screw",
        gravity=(0.0, 0.0, -G),
        duration=2.0,
        body=[{"name": "nut", "mass": 2.0, "inertia": [0.01, 0.01, 0.02], "position": [0.0, 0.0, 0.0]}],
        joint=[
            {
                "name": "S",
                "type": "cylindrical",
                "bodies": ["ground", "nut"],
                "anchor": [0.0, 0.0, 0.0],
                "axis": [0.0, 0.0, 1.0],
            }
        ],
        coupling=[{"name": "thread", "joints": ["S", "S"], "ratio": 0.01}],
    )


def pendulum(armature: float = 0.3) -> Scene:
    """A pendulum on the shaft of a motor, from rest beside."""
    return Scene(
        name="armature_pendulum",
        gravity=(0.0, -G, 0.0),
        duration=3.0,
        body=[{"name": "rod", "mass": 1.2, "inertia": [0.01, 0.02, 0.03], "position": [0.5, 0.0, 0.0]}],
        joint=[
            {
                "name": "A",
                "type": "revolute",
                "bodies": ["ground", "rod"],
                "anchor": [0.0, 0.0, 0.0],
                "axis": [0.0, 0.0, 1.0],
                "armature": armature,
            }
        ],
    )


def slide_with_motor() -> Scene:
    """A slide on an incline, with a reflected mass."""
    return Scene(
        name="slide_with_motor",
        gravity=(0.0, -G, 0.0),
        duration=1.0,
        body=[{"name": "cart", "mass": 2.0, "inertia": [0.1, 0.1, 0.1], "position": [0.0, 0.3, 0.0]}],
        joint=[
            {
                "name": "A",
                "type": "translational",
                "bodies": ["ground", "cart"],
                "anchor": [0.0, 0.3, 0.0],
                "axis": [0.8, -0.6, 0.0],
                "armature": 1.5,
            }
        ],
    )


def planetary() -> Scene:
    """A planet on an arm, both with armatures; the gears share the arm."""
    return Scene(
        name="planetary",
        gravity=(0.0, -G, 0.0),
        duration=1.0,
        body=[
            {"name": "arm", "mass": 1.0, "inertia": [0.1, 0.1, 0.1], "position": [0.5, 0.0, 0.0]},
            {"name": "planet", "mass": 0.7, "inertia": [0.1, 0.1, 0.1], "position": [1.1, 0.0, 0.0]},
        ],
        joint=[
            {
                "name": "A",
                "type": "revolute",
                "bodies": ["ground", "arm"],
                "anchor": [0.0, 0.0, 0.0],
                "axis": [0.0, 0.0, 1.0],
                "armature": 0.05,
            },
            {
                "name": "B",
                "type": "revolute",
                "bodies": ["arm", "planet"],
                "anchor": [1.0, 0.0, 0.0],
                "axis": [0.0, 0.0, 1.0],
                "armature": 0.02,
            },
        ],
        coupling=[{"name": "mesh", "joints": ["A", "B"], "ratio": 3.0}],
    )


def spatial_chain() -> Scene:
    """A chain with skew axes: an angle coupled with an angle, and a displacement with a displacement."""
    return Scene(
        name="spatial_chain",
        gravity=(0.0, 0.0, -G),
        duration=1.0,
        body=[
            {
                "name": "a",
                "mass": 1.0,
                "inertia": [0.1, 0.12, 0.14],
                "position": [0.5, 0.0, 0.0],
                "angular_velocity": [0.0, 0.0, 2.0],
            },
            {"name": "b", "mass": 0.7, "inertia": [0.05, 0.06, 0.07], "position": [1.2, 0.1, 0.0]},
            {"name": "c", "mass": 0.4, "inertia": [0.02, 0.03, 0.04], "position": [1.7, 0.1, 0.2]},
        ],
        joint=[
            {
                "name": "A",
                "type": "revolute",
                "bodies": ["ground", "a"],
                "anchor": [0.0, 0.0, 0.0],
                "axis": [0.0, 0.0, 1.0],
                "armature": 0.05,
            },
            {
                "name": "B",
                "type": "cylindrical",
                "bodies": ["a", "b"],
                "anchor": [1.0, 0.0, 0.0],
                "axis": [0.0, 1.0, 1.0],
                "armature": 0.02,
            },
            {
                "name": "C",
                "type": "translational",
                "bodies": ["b", "c"],
                "anchor": [1.5, 0.1, 0.1],
                "axis": [1.0, 0.0, 0.5],
                "armature": 0.3,
            },
        ],
        coupling=[
            {"name": "mesh", "joints": ["A", "B"], "ratio": 0.7},
            {"name": "cable", "joints": ["B", "C"], "ratio": 0.2, "coordinates": ["displacement"] * 2},
        ],
    )


def coupled_loops() -> Scene:
    """Two four-bar linkages whose cranks are geared, with one freedom."""
    left, right = _four_bar("left", 0.0), _four_bar("right", 3.0)
    return Scene(
        name="coupled_loops",
        gravity=(0.0, -G, 0.0),
        duration=1.0,
        body=[*left[0], *right[0]],
        joint=[*left[1], *right[1]],
        coupling=[{"name": "gears", "joints": ["left A", "right A"], "ratio": -1.5}],
    )


def _four_bar(name: str, x: float) -> tuple[list[dict], list[dict]]:
    """Bodies and joints of a four-bar linkage without redundant rows."""
    places = {"A": (x, 0.0), "B": (x, 0.3), "C": (x + 0.9, 0.8), "D": (x + 0.8, 0.0)}
    links = {"crank": "AB", "coupler": "BC", "rocker": "DC"}
    bodies = []
    for link, (p, q) in links.items():
        (px, py), (qx, qy) = places[p], places[q]
        length = ((qx - px) ** 2 + (qy - py) ** 2) ** 0.5
        centre, moment = [(px + qx) / 2, (py + qy) / 2, 0.0], length**3 / 12
        bodies.append({"name": f"{name} {link}", "mass": length, "inertia": [moment] * 3, "position": centre})
    (px, py), (qx, qy) = places["B"], places["C"]
    axes = [[0.0, 0.0, 1.0], [py - qy, qx - px, 0.0]]
    kinds = {
        "A": ("revolute", "ground", f"{name} crank", {"axis": [0.0, 0.0, 1.0]}),
        "B": (
            "universal",
            f"{name} crank",
            f"{name} coupler",
            {"axes": axes},
        ),
        "C": ("spherical", f"{name} coupler", f"{name} rocker", {}),
        "D": ("revolute", "ground", f"{name} rocker", {"axis": [0.0, 0.0, 1.0]}),
    }
    joints = [
        {"name": f"{name} {k}", "type": kind, "bodies": [one, other], "anchor": [*places[k], 0.0], **more}
        for k, (kind, one, other, more) in kinds.items()
    ]
    return bodies, joints


EVERY = (gear_pair, rack, screw, pendulum, slide_with_motor, planetary, spatial_chain, coupled_loops)
