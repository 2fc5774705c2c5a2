"""Random mechanisms of many turns: torsion springs of large natural angles, gears, torques over time."""

import numpy as np

from mbref import rotations
from mbref import scene as kinds

SPEED = 30.0  # rad/s; largest speed of a joint at the start
NATURAL = 60.0  # rad; largest natural angle of a torsion spring


def spinning_mechanism(seed: int) -> kinds.Scene:
    """Return a tree of two to four bodies whose velocities agree with its joints, or two geared wheels."""
    rng = np.random.default_rng([seed, 7])
    bodies: list[kinds.Body] = []
    joints: list[kinds.Joint] = []
    for k in range(int(rng.integers(2, 5))):
        parent = None if k < 2 else bodies[int(rng.integers(k))]
        body, joint = _added(rng, f"b{k}", parent)
        bodies.append(body)
        joints.append(joint)
    gears = [kinds.Coupling(name="gears", joints=("J0", "J1"), ratio=1.0, coordinates=("angle", "angle"))]
    geared = rng.random() < 0.4
    if geared:  # equal speeds of both joints, as the ratio of one demands
        spin = rng.uniform(-SPEED, SPEED)
        (bodies[0], joints[0]), (bodies[1], joints[1]) = (_added(rng, f"b{k}", None, spin) for k in range(2))
        bodies[2:], joints[2:] = [], []
    loads = [_load(rng, joint) for joint in joints if rng.random() < 0.7 and joint.facts.loaded]
    parts = {"body": bodies, "joint": joints, "coupling": gears if geared else [], "load": loads}
    gravity = tuple(rng.uniform(-3.0, 3.0, 3))
    return kinds.Scene(name=f"spinning_{seed}", gravity=gravity, duration=4.0, **parts)


def _added(rng, name, parent, spin=None):
    """Return a body at a joint to the ground or to a parent, with velocities that the joint allows."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    places = np.zeros((2, 3)) if parent is None else np.array([parent.position, parent.velocity])
    carried = np.zeros(3) if parent is None else np.array(parent.angular_velocity)
    anchor = places[0] + rng.uniform(-0.3, 0.3, 3)
    arm = rng.uniform(-0.2, 0.2, 3)
    kind = (kinds.Revolute, kinds.Cylindrical, kinds.Planar)[int(rng.choice(3, p=[0.6, 0.25, 0.15]))]
    relative = axis * (rng.uniform(-SPEED, SPEED) if spin is None else spin)
    velocity = places[1] + np.cross(carried, anchor - places[0]) + np.cross(carried + relative, arm)
    body = kinds.Body(
        name=name,
        mass=rng.uniform(0.5, 2.0),
        inertia=tuple(rng.uniform(0.08, 0.12, 3)),
        position=tuple(anchor + arm),
        orientation=tuple(rotations.unit(rng.normal(size=4))),
        velocity=tuple(velocity),
        angular_velocity=tuple(carried + relative),
    )
    ends = (kinds.GROUND if parent is None else parent.name, name)
    return body, kind(name=name.replace("b", "J"), bodies=ends, anchor=tuple(anchor), axis=tuple(axis))


def _load(rng: np.random.Generator, joint: kinds.Joint) -> kinds.TorsionSpring | kinds.JointTorque:
    if rng.random() < 0.6:
        natural = rng.uniform(-NATURAL, NATURAL)
        stiffness = rng.uniform(0.005, 0.1)
        given = {"stiffness": stiffness, "damping": rng.uniform(0.0, 0.01), "natural_angle": natural}
        return kinds.TorsionSpring(joint=joint.name, **given)
    wave = {"amplitude": 1.0, "frequency": rng.uniform(0.5, 6.0), "phase": rng.uniform(0.0, 6.0)}
    return kinds.JointTorque(joint=joint.name, torque=rng.uniform(-3.0, 3.0), factor={"sine": wave})
