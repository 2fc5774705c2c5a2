"""Random mechanisms with all parts that do work: armatures, couplings of two and more coordinates, drivers,
loads over time, periodic tables, springs of many turns, point masses and massless links."""

from collections.abc import Iterator

import numpy as np

from crosscheck.conformance.mechanisms.geared import geared_mechanism
from crosscheck.conformance.mechanisms.parts import triple
from crosscheck.conformance.mechanisms.random_mechanisms import null_space
from crosscheck.conformance.mechanisms.random_scenes import REGULAR, with_dampers, with_loads_of_joints
from crosscheck.judge.gauss_principle import goes_on, rank, rank_of, singular_values
from mbref.scene import Body, Coupling, Driver, Joint, Revolute, Scene, Sine, TorsionSpring, Translational

Rng = np.random.Generator
MOST_DRIVERS = 3
DURATION = 0.1  # s; the period of tables, whose rows are at its thirds
TRIES = 10  # number of sums of coordinates that are tried
TURNS = 30.0  # rad; largest natural angle of a torsion spring
NOTHING = (0.0, 0.0, 0.0)
AT_REST = {"velocity": None, "angular_velocity": None}


def powered_mechanism(seed: int) -> Scene:
    """Return a mechanism with closed loops, armatures of hinges and slides, and loads of all types, of which
    some follow periodic tables. It has a coupling, a sum of three or four coordinates, and up to three
    drivers, where its freedoms allow them; of two mechanisms one has a point mass on a massless link and a
    slide with armature, and one the ground as a body. The result depends on the seed only."""
    rng = np.random.default_rng([seed, 11])
    scene = with_dampers(with_loads_of_joints(geared_mechanism(seed), seed, switched=False), seed)
    if seed % 2:
        scene = _with_gimbal(scene, rng)
    scene = scene.with_(
        name=f"powered_{seed}",
        body=tuple(body.model_copy(update=AT_REST) for body in scene.body),
        gravity=triple(9.81 * rng.normal(size=3)),
        duration=DURATION,
        ground="body" if seed % 4 < 2 else "frame",
        load=tuple(_periodic(_wound(load, rng), rng) for load in scene.load),
    )
    scene = _summed(scene, rng)
    for joint in _likely(scene, rng):
        if len(scene.driver) < MOST_DRIVERS:
            scene = _driven(scene, joint, rng)
    free = null_space(scene)
    twists = (free @ (free.T @ rng.normal(size=len(free)))).reshape(-1, 6)
    return scene.with_(
        body=tuple(
            body.model_copy(update={"velocity": triple(x[:3]), "angular_velocity": triple(x[3:])})
            for body, x in zip(scene.body, twists, strict=True)
        )
    )


def _with_gimbal(scene: Scene, rng: Rng) -> Scene:
    """Return the scene with a point mass that hangs on a massless link, and with a motor's slide."""
    place = triple(np.array(scene.body[0].position) + rng.uniform(-0.5, 0.5, 3))
    hanging = triple(np.add(place, (0.1, 0.2, -0.4)))
    bodies = (
        Body(name="link", mass=0.0, inertia=NOTHING, position=place),
        Body(name="bob", mass=0.7, inertia=NOTHING, position=hanging),
        Body(name="carriage", mass=1.3, inertia=(0.02, 0.03, 0.04), position=place),
    )
    rail = {"bodies": (scene.body[0].name, "carriage"), "anchor": place}
    joints = (
        Translational(name="rail", **rail, axis=triple(rng.normal(size=3)), armature=0.6),
        Revolute(name="roll", bodies=("carriage", "link"), anchor=place, axis=(1.0, 0.0, 0.0), armature=0.03),
        Revolute(name="pitch", bodies=("link", "bob"), anchor=place, axis=(0.0, 1.0, 0.0)),
    )
    return scene.with_(body=(*scene.body, *bodies), joint=(*scene.joint, *joints))


def _wound(load, rng: Rng):
    """Return the load; a torsion spring is soft and its natural angle is several turns away."""
    if not isinstance(load, TorsionSpring):
        return load
    angle, stiffness = rng.uniform(-TURNS, TURNS), rng.uniform(0.01, 0.2)
    return load.model_copy(update={"natural_angle": float(angle), "stiffness": float(stiffness)})


def _periodic(load, rng: Rng):
    """Return the load; half of the loads over time follow a periodic table from before the start."""
    if not getattr(load, "factor", None) or rng.random() < 0.5:
        return load
    times, (a, b, c) = DURATION * (np.arange(4) / 3 - 8 / 3), rng.uniform(-1.0, 1.0, 3)
    table = tuple(zip(times.tolist(), (a, b, c, a), strict=True))
    factor = load.factor.model_copy(update={"table": table, "periodic": True})
    return load.model_copy(update={"factor": factor})


def _summed(scene: Scene, rng: Rng) -> Scene:
    """Return the scene with a coupling that sums 3 or 4 coordinates; without it if no motion remains."""
    ends = [(joint.name, kind) for joint in scene.joint for kind in joint.facts.coordinates]
    for _ in range(TRIES if len(ends) > 2 else 0):
        joints, kinds = zip(*rng.permutation(ends)[: rng.integers(3, 5)].tolist(), strict=True)
        ratios = rng.choice([-1.0, 1.0], len(joints)) * rng.uniform(0.3, 3.0, len(joints))
        sum_ = Coupling(name="sum", joints=joints, ratios=tuple(ratios.tolist()), coordinates=kinds)
        found = scene.with_(coupling=(*scene.coupling, sum_))
        if null_space(found).size and _moves(found, scene):
            return found
    return scene


def _moves(scene: Scene, less: Scene) -> bool:
    """Return whether another coupling's or driver's row leaves a motion and is independent of others."""
    values, before = singular_values(scene), rank(less)
    return rank_of(values) == before + 1 and values[before] > REGULAR and goes_on(scene)


def _likely(scene: Scene, rng: Rng) -> Iterator[Joint]:
    """Yield joints that may be driven, in random order; half of the time the coupled joints first."""
    joints = [joint for joint in scene.joint if joint.facts.driven and rng.random() < 0.4]
    coupled = {name for coupling in scene.coupling for name in coupling.joints if rng.random() < 0.5}
    order = rng.permutation(len(joints)).tolist()
    yield from sorted((joints[k] for k in order), key=lambda joint: joint.name not in coupled)


def _driven(scene: Scene, joint: Joint, rng: Rng) -> Scene:
    """Return the scene with a driver of the joint that begins at rest; without one if no motion remains."""
    amplitude, frequency, phase, square = rng.uniform((-0.1, 3.0, -3.0, -2.0), (0.1, 40.0, 3.0, 2.0)).tolist()
    wave = Sine(amplitude=amplitude, frequency=frequency, phase=phase)
    start = -amplitude * np.sin(phase), -amplitude * frequency * np.cos(phase)
    driver = Driver(joint=joint.name, polynomial=(*map(float, start), square), sine=wave)
    found = scene.with_(driver=(*scene.driver, driver))
    return found if _moves(found, scene) else scene
