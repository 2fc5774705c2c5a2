"""Small scenes, one for every feature of the scene format, named after the feature."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crosscheck.judge.gauss_principle import rank
from mbref import rotations
from mbref.scene import (
    HOLONOMIC_JOINTS,
    Body,
    Driver,
    Factor,
    Force,
    Joint,
    JointForce,
    JointTorque,
    Load,
    Moment,
    PointDamper,
    Revolute,
    RotationalDamper,
    Scene,
    Sine,
    SlideSpring,
    Spring,
    TorsionSpring,
)
from mbref.scenes import SCENES

PIVOT, PLACE, LINK = (0.0, 0.0, 0.0), (0.3, -0.2, 0.1), ("ground", "body")
AXIS = (0.2, 0.1, 1.0)
INERTIA = ((0.02, 0.002, -0.001), (0.002, 0.03, 0.003), (-0.001, 0.003, 0.025))
BODY = Body(
    name="body",
    mass=1.5,
    inertia=INERTIA,
    position=PLACE,
    orientation=tuple(rotations.from_vector(np.array([0.3, -0.2, 0.5])).tolist()),
)
ACROSS = (1.0, -1.0, 0.5)  # axis of joints that block rotation but let the body fall along the axis
CROSSING = ((0.0, 0.0, 1.0), (1.0, 0.3, 0.0))  # two axes at a right angle
PLACES = {"anchor": PIVOT, "anchors": (PIVOT, (0.4, -0.1, 0.1)), "axes": CROSSING}
JOINTS: Mapping[str, Joint] = {
    name: kind.at("J", LINK, **PLACES, axis=AXIS if kind.facts.free_rotations else ACROSS)
    for name, kind in HOLONOMIC_JOINTS.items()
}
PIVOTED, TURNS = JOINTS["revolute"], JOINTS["cylindrical"]
LOADS: Mapping[str, Load] = {
    "moment": Moment(body="body", moment=(0.3, 0.2, -0.4)),
    "force": Force(body="body", point=(0.5, -0.1, 0.2), force=(1.0, -2.0, 3.0)),
    "spring": Spring(
        bodies=LINK,
        points=((0.0, 0.8, 0.0), (0.4, -0.1, 0.1)),
        stiffness=30.0,
        damping=0.5,
        natural_length=0.5,
    ),
    "rotational_damper": RotationalDamper(bodies=LINK, damping=0.4),
    "point_damper": PointDamper(bodies=LINK, point=(0.5, -0.1, 0.2), damping=3.0),
    "torsion_spring": TorsionSpring(joint="J", stiffness=4.0, damping=0.1, natural_angle=0.4),
    "slide_spring": SlideSpring(joint="J", stiffness=60.0, damping=0.8, natural_displacement=-0.1),
    "joint_torque": JointTorque(joint="J", torque=0.7),
    "joint_force": JointForce(joint="J", force=-5.0),
}
ROWS = ((0.0, 0.0), (0.03, 0.8), (0.08, -0.5), (0.15, 0.4), (0.9, 2.0), (1.6, 1.0))
FACTORS: Mapping[str, Factor] = {
    "polynomial": Factor(polynomial=(0.5, -8.0, 60.0)),
    "sine": Factor(sine=Sine(amplitude=1.5, frequency=20.0, phase=0.3)),
    "table": Factor(table=ROWS),
    "switched": Factor(start=0.02, stop=0.11),
}
POLYNOMIAL, WAVE = (0.0, 0.8, -0.5), Sine(amplitude=0.2, frequency=6.0)
DRIVERS = {
    name: Driver(joint="J", polynomial=POLYNOMIAL, sine=WAVE)
    for name, kind in HOLONOMIC_JOINTS.items()
    if kind.facts.driven
}


def feature_scenes() -> dict[str, Scene]:
    """Return a scene for each feature: types of joint, driver and load; loops; kinematics.

    No scene reaches a singular position, after which motions need not be unique.
    """
    probes = {f"{kind} joint": _probe(kind, joint) for kind, joint in JOINTS.items()}
    probes |= {
        f"{kind} driver": _probe(f"{kind}_driver", JOINTS[kind], driver=(d,)) for kind, d in DRIVERS.items()
    }
    probes |= {f"{kind} load": _probe(kind, _carrier(load), load=(load,)) for kind, load in LOADS.items()}
    every = tuple(LOADS[kind] for kind in ("moment", "force", "joint_torque", "joint_force"))
    for kind, factor in FACTORS.items():
        loads = tuple(load.model_copy(update={"factor": factor}) for load in every)
        probes[f"{kind} loads over time"] = _probe(f"{kind}_loads", TURNS, load=loads)
    follower = Driver(joint="J", table=ROWS, polynomial=(0.0, 0.4))
    return probes | {
        "driver by a table": _probe("table_driver", PIVOTED, driver=(follower,)),
        "free body": _probe("free_body"),
        "loop": _short("spatial_slider_crank_gravity", 0.1),
        "redundant loop": _short("planar_slider_crank_gravity", 0.1),
        "several loops": _short("five_bar_gravity", 0.12),
        "driven loop": _short("spatial_slider_crank_driven", 0.02),
        "kinematics without masses": massless(_short("four_bar", 0.01)),
    }


def undetermined() -> Scene:
    """Return a body without mass and driver. Its motion is undetermined, and every engine must refuse it."""
    return massless(_probe("undetermined", PIVOTED))


def massless_link() -> Scene:
    """Return a body on two crossing hinges with a link of mass 0 between them, which act as a universal
    joint."""
    link = Body(name="link", mass=0.0, inertia=(0.0, 0.0, 0.0), position=PIVOT)
    first, second = CROSSING
    hinges = (
        Revolute(name="J", bodies=("ground", "link"), anchor=PIVOT, axis=first),
        Revolute(name="K", bodies=("link", "body"), anchor=PIVOT, axis=second),
    )
    return _probe("massless_link").with_(body=(link, BODY), joint=hinges)


def is_undetermined(scene: Scene) -> bool:
    """Return whether a scene has neither masses nor drivers that determine its motion."""
    return not scene.has_mass() and rank(scene) < 6 * len(scene.body)


def massless(scene: Scene) -> Scene:
    """Return the scene without masses and inertias."""
    bare = [body.model_copy(update={"mass": None, "inertia": None}) for body in scene.body]
    return scene.with_(name=f"massless_{scene.name}", body=tuple(bare), load=())


def _carrier(load: Load) -> Joint:
    """Return the joint for the scene of a load, chosen such that the load causes motion."""
    return TURNS if load.acts_on == "joint" else JOINTS["spherical"]


def _probe(name: str, *joint: Joint, driver: tuple[Driver, ...] = (), load: tuple[Load, ...] = ()) -> Scene:
    return Scene(
        name=name,
        gravity=(0.0, -9.81, 0.0),
        duration=0.2,
        body=(BODY,),
        joint=joint,
        driver=driver,
        load=load,
    )


def _short(name: str, duration: float) -> Scene:
    return SCENES[name]().with_(duration=duration)
