"""Random mechanisms for the checks: closed loops with all types of loads and drivers, floating mechanisms,
rotors.

Some checks need a special kind of mechanism: the check of momentum a floating mechanism, the check of a
driver's constant moment a rotor, and the check of refusals a mechanism without masses.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from crosscheck.conformance.changes.copies import replaced
from crosscheck.conformance.mechanisms.features import massless
from crosscheck.conformance.mechanisms.moving import consistent
from crosscheck.conformance.mechanisms.parts import triple
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.constraints import closure_rates, initial_poses, initial_twists
from crosscheck.judge.gauss_principle import goes_on, rank, rank_of, singular_values
from mbref.scene import (
    GROUND,
    Body,
    Driver,
    Factor,
    Fixed,
    Force,
    Joint,
    JointForce,
    JointTorque,
    Load,
    PointDamper,
    Revolute,
    RotationalDamper,
    Scene,
    Sine,
    SlideSpring,
    TorsionSpring,
)
from mbref.scene.joints import ANGLE, DISPLACEMENT

DURATION = 0.05  # s; in this time bodies of half a metre turn by about 0.1 rad
# smallest singular value of the normalised constraint rows and driver row; below it the driver hardly moves
# its joint
REGULAR = 1e-3
EVERY = 5  # each fifth mechanism has loads of joints, and loads over time
FRAME = "frame"  # name of the body that replaces the ground
NUDGE = 0.1  # m or rad: amplitude of a driver's wave


def mechanism(seed: int) -> Scene:
    """Return a closed-loop mechanism with gravity in a random direction.

    Mechanisms of odd seeds have a torsion spring and a driver if a joint accepts them. Mechanisms of even
    seeds have neither driver nor damping. Mechanisms of the seeds 4, 9, 14, … have loads of joints, and loads
    over time.
    """
    rng = np.random.default_rng([seed, 1])
    scene = random_mechanism(seed)
    gravity = rng.normal(size=3)
    scene = scene.with_(
        name=f"drawn_{seed}",
        gravity=triple(9.81 * gravity / np.linalg.norm(gravity)),
        duration=DURATION,
        load=(*scene.load, *_torsion(scene, rng)),
    )
    if seed % EVERY == EVERY - 1:
        scene = with_loads_of_joints(scene, seed)
    return _driven(scene, rng) if seed % 2 else _undamped(scene)


def with_loads_of_joints(scene: Scene, seed: int, switched: bool = False) -> Scene:
    """Return the scene with a spring, a damper and an actuator for each joint coordinate that takes loads.

    Functions of time multiply the actuators' forces and torques, and all forces and moments of the scene: a
    polynomial and a sine; where they are ``switched``, also a table of values, from a start to a stop.
    """
    rng = np.random.default_rng([seed, 4])
    loads = [
        load.model_copy(update={"factor": _factor(rng, switched)})
        if "factor" in type(load).model_fields
        else load
        for load in scene.load
    ]
    for joint in scene.joint:
        sprung = {load.type for load in scene.load if getattr(load, "joint", "") == joint.name}
        if ANGLE in joint.facts.loaded:
            stiffness, damping, rest, torque = rng.uniform(
                (1.0, 0.0, -1.0, -1.0), (9.0, 0.2, 1.0, 1.0)
            ).tolist()
            if "torsion_spring" not in sprung:
                loads.append(
                    TorsionSpring(joint=joint.name, stiffness=stiffness, damping=damping, natural_angle=rest)
                )
            loads.append(JointTorque(joint=joint.name, torque=torque, factor=_factor(rng, switched)))
        if DISPLACEMENT in joint.facts.loaded:
            stiffness, damping, rest, force = rng.uniform(
                (9.0, 0.0, -0.3, -5.0), (60.0, 2.0, 0.3, 5.0)
            ).tolist()
            loads.append(
                SlideSpring(joint=joint.name, stiffness=stiffness, damping=damping, natural_displacement=rest)
            )
            loads.append(JointForce(joint=joint.name, force=force, factor=_factor(rng, switched)))
    return scene.with_(load=tuple(loads))


def with_dampers(scene: Scene, seed: int) -> Scene:
    """Return the scene with a damper of the rotation between two bodies, and one of a point of a body."""
    rng = np.random.default_rng([seed, 5])
    first, second = rng.permutation([body.name for body in scene.body])[:2].tolist()
    turning, moving = rng.uniform((0.05, 0.5), (0.2, 2.0)).tolist()
    point = triple(rng.uniform(-1.0, 1.0, 3))
    dampers = (
        RotationalDamper(bodies=(first, second), damping=turning),
        PointDamper(bodies=(GROUND, second), point=point, damping=moving),
    )
    return scene.with_(load=(*scene.load, *dampers))


def _factor(rng: np.random.Generator, switched: bool) -> Factor:
    """Return a random function of time that changes by about 1 within DURATION."""
    amplitude, frequency, phase, first, slope = rng.uniform(
        (0.2, 20.0, -3.0, 0.5, -20.0), (1.0, 80.0, 3.0, 1.5, 20.0)
    ).tolist()
    line, wave = (first, slope), Sine(amplitude=amplitude, frequency=frequency, phase=phase)
    if not switched:
        return Factor(polynomial=line, sine=wave)
    times = DURATION * np.array([0.0, 0.3, 0.5, 0.8, 1.1])
    table = tuple(zip(times.tolist(), rng.uniform(-1.0, 1.0, times.size).tolist(), strict=True))
    start, stop = (DURATION * rng.uniform((0.1, 0.6), (0.4, 0.9))).tolist()
    return Factor(polynomial=line, sine=wave, table=table, start=start, stop=stop)


def floating(seed: int) -> Scene:
    """Return the mechanism in flight: a body replaces the ground, and there is no damping, driver or force at
    a point.

    A force at a point would change the angular momentum.
    """
    rng = np.random.default_rng([seed, 2])
    scene = _undamped(random_mechanism(seed)).with_(duration=DURATION)
    frame = Body(name=FRAME, mass=4.0, inertia=(0.3, 0.4, 0.5), position=(0.1, -0.2, 0.05))
    joints = tuple(replaced(joint, bodies=[_freed(name) for name in joint.bodies]) for joint in scene.joint)
    loads = tuple(load for load in scene.load if not isinstance(load, Force))
    flying = scene.with_(name=f"floating_{seed}", body=(frame, *scene.body), joint=joints, load=loads)
    moving = consistent(flying, rng.normal(size=(len(flying.body), 6)))
    return moving if goes_on(moving) else consistent(flying, np.zeros((len(flying.body), 6)))


def rotor(seed: int) -> Scene:
    """Return one to four welded bodies on a vertical hinge at constant angular acceleration: the driver's
    moment is constant."""
    rng = np.random.default_rng([seed, 3])
    base = random_mechanism(seed)
    axis = rng.normal(size=3)
    names = [GROUND, *(body.name for body in base.body[: rng.integers(1, 5)])]
    hinge = Revolute(
        name="hinge", bodies=(GROUND, names[1]), anchor=triple(rng.normal(size=3)), axis=triple(axis)
    )
    welds = [
        Fixed(name=f"weld {b}", bodies=(a, b), anchor=triple(rng.normal(size=3)))
        for a, b in pairwise(names[1:])
    ]
    still = [replaced(body, velocity=None, angular_velocity=None) for body in base.body[: len(names) - 1]]
    driver = Driver(joint="hinge", polynomial=(0.0, *rng.uniform(-3, 3, 2).tolist()))
    gravity = 9.81 * axis / np.linalg.norm(axis)
    return Scene(
        name=f"rotor_{seed}",
        gravity=triple(gravity),
        duration=DURATION,
        body=tuple(still),
        joint=(hinge, *welds),
        driver=(driver,),
    )


def without_masses(seed: int) -> Scene:
    """Return the mechanism without masses and drivers, whose motion is undetermined."""
    return massless(random_mechanism(seed))


def _freed(name: str) -> str:
    return FRAME if name == GROUND else name


def _undamped(scene: Scene) -> Scene:
    return scene.with_(load=tuple(_still(load) for load in scene.load))


def _still(load: Load) -> Load:
    return replaced(load, damping=0.0) if hasattr(load, "damping") else load


def _torsion(scene: Scene, rng: np.random.Generator) -> Iterator[TorsionSpring]:
    """Return a torsion spring about a joint that accepts one, for two of three mechanisms."""
    joints = [joint.name for joint in scene.joint if "angle" in joint.facts.loaded]
    if joints and rng.random() < 2 / 3:
        joint = str(rng.choice(joints))
        stiffness, damping, angle = rng.uniform((1.0, 0.0, -1.0), (9.0, 0.2, 1.0)).tolist()
        yield TorsionSpring(joint=joint, stiffness=stiffness, damping=damping, natural_angle=angle)


def _driven(scene: Scene, rng: np.random.Generator) -> Scene:
    """Return the scene with a driver that starts at the joint's own rate; without a driver if no motion would
    remain."""
    before = rank(scene)
    joints = [joint for joint in scene.joint if joint.facts.driven]
    for joint in rng.permutation(np.array(joints, dtype=object)):
        driven = scene.with_(driver=(_driver(scene, joint, rng),))
        values = singular_values(driven)
        if rank_of(values) == before + 1 and values[before] > REGULAR and goes_on(driven):
            return driven
    return scene


def _driver(scene: Scene, joint: Joint, rng: np.random.Generator) -> Driver:
    still = scene.with_(driver=(Driver(joint=joint.name, polynomial=(0.0,)),))
    rows = closure_rates(still, 0.0, *initial_poses(scene), *initial_twists(scene))
    amplitude, frequency, phase = NUDGE * rng.uniform(-1, 1), rng.uniform(3, 20), rng.uniform(-3, 3)
    rate = float(rows[joint.name][-1]) - amplitude * frequency * np.cos(phase)
    wave = Sine(amplitude=amplitude, frequency=frequency, phase=phase)
    polynomial = (-amplitude * float(np.sin(phase)), float(rate), float(rng.uniform(-1, 1)))
    return Driver(joint=joint.name, polynomial=polynomial, sine=wave)
