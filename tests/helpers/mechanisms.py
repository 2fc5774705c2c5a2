"""Mechanisms of which verdicts are stored: makers of random ones by a seed, and others by a name."""

from collections.abc import Callable
from functools import partial

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.conformance.mechanisms import random_scenes
from crosscheck.conformance.mechanisms.awkward import AWKWARD, awkward
from crosscheck.conformance.mechanisms.closed_forms import CLOSED_FORMS, GEARED
from crosscheck.conformance.mechanisms.features import feature_scenes, massless_link, undetermined
from crosscheck.conformance.mechanisms.geared import geared_mechanism
from crosscheck.conformance.mechanisms.hard import HARD
from crosscheck.conformance.mechanisms.moving import dead_end, moving_probes
from crosscheck.conformance.mechanisms.planar import planar_loops
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.small_motions.mechanisms import MECHANISMS
from crosscheck.study import stability
from mbref.scene import Scene


def loaded(seed: int) -> Scene:
    """Return a random mechanism with loads of joints that are switched."""
    return random_scenes.with_loads_of_joints(random_mechanism(seed), seed, switched=True)


# makers of mechanisms from a seed
RANDOM: dict[str, Callable[[int], Scene]] = {
    "random": random_mechanism,
    "mechanism": random_scenes.mechanism,
    "loaded": loaded,
    "floating": random_scenes.floating,
    "rotor": random_scenes.rotor,
    "without masses": random_scenes.without_masses,
    "geared": geared_mechanism,
    **{name: partial(awkward, name) for name in AWKWARD},
}


def named() -> dict[str, list[Scene]]:
    """Return the mechanisms that are not random, by kind."""
    return {
        "hard": [make() for make in HARD.values()],
        "closed forms": [make()[0] for make in (*CLOSED_FORMS, *GEARED)],
        "ends": [dead_end(), massless_link(), undetermined()],
        "first rungs of ladders": [ladder.rungs[0][1] for ladder in stability.ladders()],
        "small motions": [mechanism.make() for mechanism in MECHANISMS],
        "closed loops": [difficulty.make() for difficulty in DIFFICULTIES],
        "moving probes": list(moving_probes().values()),
        "planar loops": list(planar_loops().values()),
        "features": list(feature_scenes().values()),
    }
