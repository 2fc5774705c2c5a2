"""Catalogue of short motions: every joint, load, driver, coupling and armature, chains and loops. ``MOTIONS``
maps a name to a maker of a scene. The judge has computed the states at three times, which
``tests/doors/motion/exact_motions.json`` stores."""

from collections.abc import Callable
from functools import partial

import numpy as np

from mbref.scene import Scene
from mbref.scenes import find_scene
from tests.helpers.parts import SKEW, Entry, Point, X, Y, Z, block, hinge, joint, rod, slide, turning_about

FRACTIONS = (0.3, 0.7, 1.0)  # of the duration: sample times of a short motion
GRAVITY = [1.0, -9.0, 3.0]
MOTIONS: dict[str, Callable[[], Scene]] = {}


def motion(maker: Callable[[], Scene]) -> Callable[[], Scene]:
    """Add a maker of a scene to the catalogue under its name."""
    MOTIONS[maker.__name__.replace("_", " ")] = maker
    return maker


def made(name: str, bodies: list[Entry], joints: list[Entry], duration=0.3, **fields: object) -> Scene:
    """Return a scene with gravity in no special direction."""
    fields = {"gravity": GRAVITY, **fields}
    given = {"name": name, "duration": duration, "body": bodies, "joint": joints}
    return Scene.model_validate(given | fields)


# Each joint type carries a block on an arm that turns about a skew axis, and closes a loop on the ground.

AXES = {"axes": [list(Z), [0.8, -0.6, 0.0]]}
FIELDS: dict[str, dict[str, object]] = {
    **{kind: {} for kind in ("fixed", "spherical")},
    "universal": AXES,
    **{
        kind: {"axis": list(SKEW)}
        for kind in ("revolute", "translational", "cylindrical", "planar", "inline")
    },
    "distance": {"anchors": [[0.5, 0.1, 0.0], [0.9, 0.3, 0.4]]},
}


def arm_with(kind: str, reverse: bool = False) -> Scene:
    """Return an arm on the ground that carries a block by a joint of the type."""
    anchor = (0.0, 0.0, 0.0)
    arm = turning_about(anchor, SKEW, 3.0, block("arm", (0.4, 0.1, -0.1)))
    load = turning_about(anchor, SKEW, 3.0, block("load", (0.9, 0.3, 0.2), 0.8))
    pair = ("load", "arm") if reverse else ("arm", "load")
    given = dict(FIELDS[kind])
    if reverse and kind == "distance":
        given["anchors"] = FIELDS[kind]["anchors"][::-1]  # type: ignore[index]
    joints = [hinge("A", "ground", "arm", anchor, SKEW), joint("B", kind, *pair, (0.6, 0.2, 0.1), **given)]
    return made(f"arm with {kind}", [arm, load], joints)


def loop_with(kind: str) -> Scene:
    """Return a crank in space whose coupler moves a block, which a joint of the type holds to the ground."""
    crank = turning_about((0.0, 0.0, 0.0), Z, 4.0, rod("crank", (0.0, 0.0, 0.0), (0.3, 0.1, 0.0)))
    coupler, last = rod("coupler", (0.3, 0.1, 0.0), (0.9, 0.4, 0.3)), block("last", (1.1, 0.3, 0.4))
    joints = [
        hinge("A", "ground", "crank", (0.0, 0.0, 0.0)),
        joint("B", "universal", "crank", "coupler", (0.3, 0.1, 0.0), axes=[list(Z), [0.6, -0.8, 0.0]]),
        joint("C", "spherical", "coupler", "last", (0.9, 0.4, 0.3)),
        joint("D", kind, "last", "ground", (1.2, 0.0, 0.2), **FIELDS[kind]),
    ]
    return made(f"loop with {kind}", [crank, coupler, last], joints)


for _kind in FIELDS:
    MOTIONS[f"arm with {_kind}"] = partial(arm_with, _kind)
    MOTIONS[f"arm with {_kind}, bodies exchanged"] = partial(arm_with, _kind, reverse=True)
for _kind in ("revolute", "spherical", "translational", "cylindrical", "planar", "inline"):
    MOTIONS[f"loop with {_kind}"] = partial(loop_with, _kind)


# Loads, on a double pendulum in space.


def double_pendulum(name: str, load: list[Entry], gravity: list[float] = GRAVITY, **fields: object) -> Scene:
    """Return two blocks, the first on a skew hinge, the second on a cylindrical joint, with loads."""
    bodies = [block("a", (0.4, 0.1, -0.1)), block("b", (0.8, 0.4, 0.2), 0.7)]
    sleeve = joint("B", "cylindrical", "a", "b", (0.6, 0.2, 0.1), axis=[0.6, 0.0, 0.8])
    joints = [hinge("A", "ground", "a", (0.0, 0.0, 0.0), SKEW), sleeve]
    return made(name, bodies, joints, gravity=gravity, load=load, **fields)


def load(kind: str, **fields: object) -> Entry:
    """Return a load of a type."""
    return {"type": kind, **fields}


AB = {"bodies": ["a", "b"], "points": [[0.3, 0.5, 0.0], [0.9, 0.2, 0.5]]}
BG = {"bodies": ["b", "ground"], "points": [[0.9, 0.4, 0.3], [0.2, 0.9, 0.0]]}
WAVE = {"amplitude": 0.7, "frequency": 9.0, "phase": 0.4}
LOADS: dict[str, list[Entry]] = {
    "gravity alone": [],
    "moment": [load("moment", body="b", moment=[2.0, -3.0, 1.0])],
    "force": [load("force", body="b", point=[1.0, 0.5, 0.1], force=[3.0, 6.0, -2.0])],
    "spring with damping": [load("spring", **AB, stiffness=60.0, damping=3.0, natural_length=0.4)],
    "spring of natural length 0": [load("spring", **BG, stiffness=30.0, natural_length=0.0)],
    "torsion spring": [load("torsion_spring", joint="B", stiffness=5.0, damping=0.2, natural_angle=1.5)],
    "slide spring": [load("slide_spring", joint="B", stiffness=80.0, damping=2.0, natural_displacement=-0.1)],
    "joint torque": [load("joint_torque", joint="A", torque=4.0)],
    "joint force": [load("joint_force", joint="B", force=-7.0)],
    "force over time": [
        load("force", body="a", point=[0.5, 0.3, 0.0], force=[8.0, 0.0, 4.0])
        | {"factor": {"polynomial": [0.5, 1.0, -2.0], "sine": WAVE}}
    ],
    "moment that is switched": [
        load("moment", body="b", moment=[1.0, 5.0, -2.0], factor={"start": 0.05, "stop": 0.17})
    ],
    "torque by a table": [
        load("joint_torque", joint="A", torque=6.0)
        | {"factor": {"table": [[0.0, 0.0], [0.1, 1.0], [0.2, 0.4], [0.3, -0.5], [0.4, 0.0]]}}
    ],
    "force of a joint that begins": [
        load("joint_force", joint="B", force=9.0, factor={"polynomial": [0.0, 4.0], "start": 0.1})
    ],
}
for _name, _load in LOADS.items():
    MOTIONS[f"pendulum with {_name}"] = partial(double_pendulum, f"pendulum with {_name}", _load)


# Drivers.

DRIVERS: dict[str, list[Entry]] = {
    "angle by a polynomial": [{"joint": "A", "polynomial": [0.0, 3.0, -2.0, 1.5]}],
    "angle by a sine": [
        {
            "joint": "A",
            "polynomial": [-0.3 * np.sin(0.5)],
            "sine": {"amplitude": 0.3, "frequency": 8.0, "phase": 0.5},
        }
    ],
    "angle by a table": [
        {"joint": "A", "table": [[0.0, 0.0], [0.1, 0.2], [0.2, 0.5], [0.3, 0.4], [0.4, 0.0]]}
    ],
    "angle of the second joint": [{"joint": "B", "polynomial": [0.0, -5.0, 2.0]}],
    "point along a direction": [
        {"name": "D", "body": "b", "point": [1.0, 0.5, 0.1], "along": [3.0, 0.0, -4.0]}
        | {"polynomial": [0.0, -0.4, 1.5], "sine": {"amplitude": 0.05, "frequency": 9.0}}
    ],
    "both angles": [{"joint": "A", "polynomial": [0.0, 2.0]}, {"joint": "B", "polynomial": [0.0, 0.0, 6.0]}],
}
for _name, _driver in DRIVERS.items():
    MOTIONS[f"driven {_name}"] = partial(double_pendulum, f"driven {_name}", [], driver=_driver)


@motion
def driven_slide() -> Scene:
    """Return a cart that is driven along a slope, with a pendulum on it."""
    bodies = [block("cart", (0.0, 0.0, 0.0)), block("bob", (0.3, -0.4, 0.1), 0.6)]
    guide = slide("A", "ground", "cart", (0.0, 0.0, 0.0), (0.8, 0.6, 0.0))
    joints = [guide, hinge("B", "cart", "bob", (0.1, 0.0, 0.0))]
    driver = [{"joint": "A", "polynomial": [0.0, 0.0, 1.5], "sine": {"amplitude": 0.05, "frequency": 12.0}}]
    return made("driven slide", bodies, joints, driver=driver)


def hinged_with_a_point(first: str, z: float) -> tuple[list[Entry], list[Entry]]:
    """Return two blocks on hinges, and a free joint of the second along an axis (1, 2, z) of a first body."""
    bodies = [block("a", (0.4, 0.1, -0.1)), block("b", (0.8, 0.4, 0.2), 0.7)]
    pins = [hinge("A", "ground", "a", (0.0, 0.0, 0.0), SKEW), hinge("B", "ground", "b", (1.0, 0.0, 0.0), Y)]
    return bodies, [*pins, joint("D", "free", first, "b", (0.9, 0.5, 0.3), axis=[1.0, 2.0, z])]


@motion
def driven_between_bodies() -> Scene:
    """Return two blocks on hinges; a table drives a point of the second along an axis that the first carries,
    where a spring and a force act, too."""
    rows = [[0.0, 0.0], [0.1, 0.05], [0.2, -0.02], [0.3, -0.1], [0.4, 0.0]]
    damped = load("slide_spring", joint="D", stiffness=40.0, damping=2.0)
    along = [damped, load("joint_force", joint="D", force=3.0)]
    driver = [{"joint": "D", "table": rows}]
    return made("driven between bodies", *hinged_with_a_point("a", 2.0), driver=driver, load=along)


@motion
def coupled_point() -> Scene:
    """Return two blocks on hinges; a point of the second moves along an axis by the angle of the first."""
    coupling = [{"name": "C", "joints": ["D", "A"], "ratio": 0.4}]
    return made("coupled point", *hinged_with_a_point("ground", -2.0), coupling=coupling)


# Couplings and armatures.


@motion
def gears_with_armature() -> Scene:
    """Return two wheels that mesh; the first has the rotor of a motor."""
    bodies = [block("pinion", (0.0, 0.0, 0.1)), block("wheel", (0.5, 0.1, 0.0), 3.0)]
    motor = hinge("A", "ground", "pinion", (0.05, 0.0, 0.0), armature=0.2)
    joints = [motor, hinge("B", "ground", "wheel", (0.5, 0.0, 0.0))]
    return made("gears", bodies, joints, coupling=[{"name": "mesh", "joints": ["A", "B"], "ratio": -0.5}])


@motion
def rack_and_pinion() -> Scene:
    """Return a rack on a slope that turns its pinion."""
    bodies = [block("pinion", (0.0, 0.0, 0.1)), block("rack", (0.3, 0.2, 0.0), 2.0)]
    joints = [hinge("A", "ground", "pinion", (0.05, 0.0, 0.0)), slide("B", "ground", "rack", (0.3, 0.2, 0.0))]
    return made("rack", bodies, joints, coupling=[{"name": "teeth", "joints": ["A", "B"], "ratio": 0.12}])


@motion
def screw_with_armature() -> Scene:
    """Return a nut on a screw; its rotor counts by its angle."""
    joints = [joint("S", "cylindrical", "ground", "nut", (0.0, 0.0, 0.0), axis=list(SKEW), armature=0.1)]
    coupling = [{"name": "thread", "joints": ["S", "S"], "ratio": 0.2}]
    return made("screw", [block("nut", (0.1, 0.0, 0.2))], joints, coupling=coupling)


@motion
def planet_with_armatures() -> Scene:
    """Return an arm and a planet on it, coupled relative to the arm."""
    bodies = [block("arm", (0.4, 0.0, 0.1)), block("planet", (0.8, 0.1, 0.0), 0.6)]
    motor = hinge("A", "ground", "arm", (0.0, 0.0, 0.0), armature=0.05)
    joints = [motor, hinge("B", "arm", "planet", (0.7, 0.0, 0.0), SKEW, armature=0.03)]
    coupling = [{"name": "mesh", "joints": ["A", "B"], "ratio": 2.5}]
    return made("planet", bodies, joints, coupling=coupling)


@motion
def coupled_displacements() -> Scene:
    """Return a telescope: its second stage slides as far as its first."""
    bodies = [block("stage", (0.3, 0.0, 0.0)), block("tip", (0.8, 0.1, 0.0), 0.5)]
    joints = [
        slide("A", "ground", "stage", (0.0, 0.0, 0.0), (0.6, -0.8, 0.0)),
        joint("B", "cylindrical", "stage", "tip", (0.6, 0.0, 0.0), axis=list(SKEW)),
    ]
    coupling = [{"name": "cable", "joints": ["A", "B"], "ratio": 1.4, "coordinates": ["displacement"] * 2}]
    return made("telescope", bodies, joints, coupling=coupling)


@motion
def driven_gears() -> Scene:
    """Return a geared pair whose first wheel is driven; the second carries a pendulum."""
    wheels = block("pinion", (0.0, 0.0, 0.1)), block("wheel", (0.5, 0.1, 0.0))
    bodies = [*wheels, block("bob", (0.9, 0.0, 0.2), 0.4)]
    joints = [
        hinge("A", "ground", "pinion", (0.05, 0.0, 0.0), armature=0.02),
        hinge("B", "ground", "wheel", (0.5, 0.0, 0.0)),
        hinge("C", "wheel", "bob", (0.7, 0.0, 0.0), (0.0, 0.6, 0.8)),
    ]
    mesh = {"name": "mesh", "joints": ["A", "B"], "ratio": -2.0}
    driver = {"joint": "A", "polynomial": [0.0, 1.0, 2.0]}
    return made("driven gears", bodies, joints, coupling=[mesh], driver=[driver])


# Bodies of special kinds.


@motion
def free_bodies_and_a_spring() -> Scene:
    """Return two bodies without joints, of which one spins about no principal axis."""
    bodies = [
        block("a", (0.0, 0.0, 0.0), velocity=[1.0, 0.0, 0.0], angular_velocity=[3.0, -4.0, 2.0]),
        block("b", (0.7, 0.1, 0.2), 0.5, velocity=[0.0, 1.0, 0.5], angular_velocity=[0.0, 6.0, 1.0]),
    ]
    spring = {"type": "spring", "bodies": ["a", "b"], "points": [[0.2, 0.1, 0.0], [0.6, 0.0, 0.1]]}
    load = [{**spring, "stiffness": 50.0, "damping": 1.0, "natural_length": 0.3}]
    return made("free bodies", bodies, [], load=load)


@motion
def small_masses_on_distances() -> Scene:
    """Return three small masses held by distances: a triangle that hangs from a point."""
    places = {"a": (0.3, -0.4, 0.0), "b": (0.8, -0.5, 0.2), "c": (0.5, -1.0, 0.1)}
    bodies = [{"name": n, "mass": 0.5, "inertia": [1e-4] * 3, "position": list(p)} for n, p in places.items()]
    joints = [
        joint(f"{p}{q}", "distance", p, q, anchors=[list(places.get(p, (0.0, 0.0, 0.0))), list(places[q])])
        for p, q in (("ground", "a"), ("a", "b"), ("b", "c"), ("a", "c"))
    ]
    return made("triangle of points", bodies, joints)


@motion
def massless_link_between_slides() -> Scene:
    """Return a gantry: a massless slide carries a tool across."""
    bridge = {"name": "bridge", "mass": 0.0, "inertia": [0.0] * 3, "position": [0.0, 0.0, 0.0]}
    bodies = [bridge, block("tool", (0.1, 0.2, 0.0))]
    second = slide("B", "bridge", "tool", (0.0, 0.1, 0.0), Y)
    joints = [slide("A", "ground", "bridge", (0.0, 0.0, 0.0), X), second]
    spring = {"type": "spring", "bodies": ["ground", "tool"], "points": [[-0.3, 0.4, 0.0], [0.1, 0.2, 0.0]]}
    return made("gantry", bodies, joints, load=[{**spring, "stiffness": 60.0, "natural_length": 0.2}])


@motion
def ground_as_a_body() -> Scene:
    """Return a pendulum whose ground counts as a body."""
    joints = [hinge("A", "ground", "a", (0.0, 0.0, 0.0), SKEW)]
    return made("pendulum on a body", [block("a", (0.4, 0.1, 0.0))], joints, ground="body")


# Closed loops with redundant rows.


def closed_chain(name: str, places: list[Point], closing: str = "revolute", speed: float = 4.0) -> Scene:
    """Return a plane linkage of rods through points; its joints are hinges about z except the last one."""
    names = [f"link {i}" for i in range(1, len(places))]
    rods = [rod(n, p, q) for n, p, q in zip(names, places, places[1:], strict=False)]
    rods[0] = turning_about(places[0], Z, speed, rods[0])
    ends = ["ground", *names]
    joints = [hinge(f"J{i}", ends[i], ends[i + 1], places[i]) for i in range(len(names))]
    fields = {"axis": list(Z)} if closing in ("revolute", "cylindrical") else {}
    fields = {"axis": list(X)} if closing in ("translational", "inline") else fields
    joints.append(joint("end", closing, "ground", names[-1], places[-1], **fields))
    return made(name, rods, joints, gravity=[0.0, -9.81, 0.0])


CRANK, KNEE, TOP, PIVOT = (0.0, 0.0, 0.0), (0.15, 0.25, 0.0), (0.75, 0.6, 0.0), (0.9, 0.0, 0.0)
FOUR = [CRANK, KNEE, TOP, PIVOT]
CHAINS: dict[str, tuple[list[Point], str]] = {
    "four hinges": (FOUR, "revolute"),
    "four hinges in the air": ([(*p[:2], 0.5) for p in FOUR], "revolute"),
    "five hinges": ([CRANK, KNEE, TOP, (1.1, 0.4, 0.0), PIVOT], "revolute"),
    "slider-crank of hinges": ([CRANK, KNEE, (0.8, 0.0, 0.0)], "inline"),
    "crank on a ball": (FOUR, "spherical"),
    "crank on a cylinder": (FOUR, "cylindrical"),
}
MOTIONS |= {name: partial(closed_chain, name, *chain) for name, chain in CHAINS.items()}


@motion
def two_loops_on_one_crank() -> Scene:
    """Return a crank that moves two rockers: six links, two loops, all hinges parallel."""
    bar = closed_chain("two loops", FOUR)
    rods = rod("c", KNEE, (-0.5, 0.5, 0.0)), rod("d", (-0.5, 0.5, 0.0), (-0.6, 0.0, 0.0))
    bodies = [*bar.model_dump()["body"], *rods]
    joints = [
        *bar.model_dump()["joint"],
        hinge("K", "link 1", "c", KNEE),
        hinge("L", "c", "d", (-0.5, 0.5, 0.0)),
        hinge("M", "d", "ground", (-0.6, 0.0, 0.0)),
    ]
    return bar.with_(body=bodies, joint=joints)


@motion
def doubled_hinge() -> Scene:
    """Return a door on two hinges of one skew axis."""
    places = [(0.0, 0.0, 0.0), tuple(0.7 * np.array(SKEW))]
    joints = [hinge(f"H{i}", "ground", "door", p, SKEW) for i, p in enumerate(places)]
    return made("door", [turning_about((0.0, 0.0, 0.0), SKEW, 2.0, block("door", (0.5, -0.2, 0.3)))], joints)


# Built-in mechanisms, for a short time; the last ones pass singular positions.

SHORT = {
    "four_bar_gravity": 0.3,
    "five_bar_gravity": 0.3,
    "spatial_slider_crank": 0.05,
    "spatial_slider_crank_driven": 0.03,
    "planar_slider_crank": 0.1,
    "planar_slider_crank_gravity": 0.1,
    "andrews_squeezer": 0.01,
    "bricard": 0.2,
    "flyball_governor": 0.1,
    "rigid_slider_crank": 0.1,
    "heavy_top": 0.1,
    "bennett": 0.3,
    "sarrus": 0.1,
    "h_frame": 0.3,
    "point_pendulum": 0.3,
    "four_bar_chain[3]": 0.2,
    "slider_crank_chain[2]": 0.05,
}
CROSSED = {  # duration, s, and number of singular positions that the motion passes
    "planar_slider_crank_equal": (0.1, 1),
    "four_bar": (0.03, 1),
    "four_bar_quarter": (0.035, 2),
}


def built_in(name: str, duration: float) -> Scene:
    """Return a built-in scene with another duration."""
    return find_scene(name).with_(duration=duration)


for _name, _duration in SHORT.items():
    MOTIONS[_name] = partial(built_in, _name, _duration)
for _name, (_duration, _) in CROSSED.items():
    MOTIONS[_name] = partial(built_in, _name, _duration)


def times_of(scene: Scene) -> np.ndarray:
    """Return the sample times (3,), s, of a short motion."""
    return scene.duration * np.array(FRACTIONS)
