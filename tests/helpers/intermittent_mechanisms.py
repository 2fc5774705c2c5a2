"""Mechanisms whose joints and couplings hold in intervals of time: two with closed forms, and random ones."""

from typing import Any

import numpy as np

import mbref
from crosscheck.conformance.mechanisms.geared import geared_mechanism
from crosscheck.conformance.mechanisms.random_scenes import mechanism
from mbref.scene import Scene
from tests.helpers.parts import block, hinge, joint, slide

DURATION = 0.3  # s, of random mechanisms
CHANGES = (0.07, 0.13, 0.2, 0.26)  # s; times at which their constraints can begin or cease to hold
SHARE = 0.6  # fraction of the joints without drivers, couplings and armatures that have intervals


def carts(**latch: Any) -> Scene:
    """Carts of 1 kg at 2 m/s and 3 kg at -1 m/s that latch from 0.1 s to 0.3 s, or as given."""
    return Scene(
        name="carts",
        duration=0.5,
        body=[
            block("one", (0.0, 0.0, 0.0), 1.0, velocity=[2.0, 0.0, 0.0]),
            block("two", (1.0, 0.0, 0.0), 3.0, velocity=[-1.0, 0.0, 0.0]),
        ],
        joint=[
            slide("A", "ground", "one", (0.0, 0.0, 0.0)),
            slide("B", "ground", "two", (1.0, 0.0, 0.0)),
            joint("L", "fixed", "one", "two", active=[[0.1, 0.3]]) | latch,
        ],
    )


def rotors() -> Scene:
    """Rotors of 0.1 kg m² at 6 rad/s and 0.3 kg m², an armature of 0.2 kg m², a clutch from 0.2 s on."""
    spins, straight = {"angular_velocity": [0.0, 0.0, 6.0]}, {"orientation": [1.0, 0.0, 0.0, 0.0]}
    rotor, load = ({**straight, "inertia": [size] * 3} for size in (0.1, 0.3))
    return Scene(
        name="rotors",
        duration=0.4,
        body=[block("a", (0.0, 0.0, 0.0), **rotor, **spins), block("b", (0.0, 0.0, 1.0), **load)],
        joint=[
            hinge("A", "ground", "a", (0.0, 0.0, 0.0), armature=0.2),
            hinge("B", "ground", "b", (0.0, 0.0, 1.0)),
        ],
        coupling=[{"name": "clutch", "joints": ["A", "B"], "ratio": 0.5, "active": [[0.2, 1.0]]}],
    )


def intermittent_mechanism(seed: int) -> Scene:
    """Return a mechanism with closed loops, of which joints and couplings come and go; it depends on the seed
    only. Universal joints always hold: their axes may be parallel where they would begin to hold."""
    rng = np.random.default_rng([seed, 5])
    scene = geared_mechanism(seed) if seed % 3 == 1 else mechanism(seed)
    busy = {name for coupling in scene.coupling for name in coupling.joints}
    busy |= {driver.joint for driver in scene.driver}
    busy |= {joint.name for joint in scene.joint if joint.reflected_inertia or joint.type == "universal"}
    free = [joint.name for joint in scene.joint if joint.name not in busy]
    chosen = {name for name in free if rng.random() < SHARE} or set(free[:1])
    parts = {
        "joint": [j.model_copy(update=_intervals(rng) if j.name in chosen else {}) for j in scene.joint],
        "coupling": [each.model_copy(update=_intervals(rng)) for each in scene.coupling],
        "load": [load for load in scene.load if getattr(load, "joint", None) not in chosen],
    }
    return scene.with_(name=f"intermittent_{seed}", duration=DURATION, **parts)


def _intervals(rng: np.random.Generator) -> dict[str, Any]:
    """Return one or two intervals between some of CHANGES, the start and a time after the end."""
    times = sorted(rng.choice([0.0, *CHANGES, 1.0], 2 if rng.random() < 0.6 else 4, replace=False).tolist())
    return {"active": tuple(zip(times[::2], times[1::2], strict=True))}


def conditional_mechanism(seed: int) -> Scene:
    """Return a random mechanism: a joint begins to hold where the coordinate of another joint has been at
    0.1 s, and a joint without redundancy breaks by its force of 0.05 s. It depends on the seed only."""
    rng = np.random.default_rng([seed, 6])
    scene = mechanism(seed)
    busy = {driver.joint for driver in scene.driver} | {getattr(load, "joint", None) for load in scene.load}
    busy |= {joint.name for joint in scene.joint if joint.reflected_inertia or joint.type == "universal"}
    names = [joint.name for joint in scene.joint if joint.name not in busy]
    latch, weak = [*rng.permutation(names), None, None][:2]
    others = [joint for joint in scene.joint if joint.name not in (latch, weak)]
    watched = [joint.name for joint in others if joint.facts.coordinates]
    opened = scene.with_(joint=[joint for joint in scene.joint if joint.name != latch])
    free = mbref.simulate(opened, times=[0.0, 0.05, 0.1])
    changes: dict[str | None, dict[str, Any]] = {}
    if watched and len(free.times) == 3:
        name = str(rng.choice(watched))
        kind = scene.joint_named(name).facts.main
        value = getattr(free.joint(name), kind)[2]
        changes[latch] = {"when": {"joint": name, "coordinate": kind, "reaches": float(value)}}
        forces = np.linalg.norm(free.joint(weak).force, axis=1) if weak else np.zeros(3)
        if abs(forces[1] - forces[0]) > 1e-3 * forces[1] and not free.joint(weak).open.any():
            changes[weak] = {"release": {"force": float(forces[1])}}
    joints = [{**each.model_dump(), **changes.get(each.name, {})} for each in scene.joint]
    return scene.with_(name=f"conditional_{seed}", duration=DURATION, joint=joints)
