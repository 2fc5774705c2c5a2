"""Mechanisms of the conformance suite / a name or a seed means the same mechanism in every version.

Verdicts and findings are stored with the name or the seed of their mechanism, and bounds were measured on it.
``models/mechanisms_of_the_suite.json`` has a digest of each mechanism, numbers to nine digits;
``python -m tests.crosscheck.test_mechanisms_of_the_suite`` writes it.  Renew it only if mechanisms are to
change, and then all stored verdicts, too.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.conformance import random_scenes
from crosscheck.conformance.awkward_mechanisms import AWKWARD, awkward
from crosscheck.conformance.closed_forms import CLOSED_FORMS
from crosscheck.conformance.features import feature_scenes, massless_link, undetermined
from crosscheck.conformance.geared_forms import GEARED
from crosscheck.conformance.geared_mechanisms import geared_mechanism
from crosscheck.conformance.hard_mechanisms import HARD
from crosscheck.conformance.moving import dead_end, moving_probes
from crosscheck.conformance.planar import planar_loops
from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.small_motions.mechanisms import MECHANISMS
from crosscheck.study import stability
from mbref.scene import Scene

STORED = Path(__file__).parent / "models" / "mechanisms_of_the_suite.json"
MAKERS: dict[str, Callable[[], Any]] = {
    **{f"awkward {name}": partial(awkward, name, 1) for name in AWKWARD},
    **{f"hard {name}": make for name, make in HARD.items()},
    **{f"closed form {make.__name__}": lambda make=make: make()[0] for make in CLOSED_FORMS},
    **{f"geared form {make.__name__}": lambda make=make: make()[0] for make in GEARED},
    "dead end": dead_end,
    "massless link": massless_link,
    "undetermined": undetermined,
    "first rungs of ladders": lambda: {ladder.name: ladder.rungs[0][1] for ladder in stability.ladders()},
    **{f"drawn {seed}": partial(random_scenes.mechanism, seed) for seed in range(1, 6)},
    "floating 1": partial(random_scenes.floating, 1),
    "rotor 1": partial(random_scenes.rotor, 1),
    "without masses 1": partial(random_scenes.without_masses, 1),
    **{f"random {seed}": partial(random_mechanism, seed) for seed in (1, 2, 5)},
    **{f"geared {seed}": partial(geared_mechanism, seed) for seed in (1, 2)},
    **{f"small motions of {m.name}": m.make for m in MECHANISMS},
    "closed loops": lambda: {difficulty.heading: difficulty.make() for difficulty in DIFFICULTIES},
    "moving probes": moving_probes,
    "planar loops": planar_loops,
    "features": feature_scenes,
}


def plain(value: Any) -> Any:
    """Numbers as texts of nine digits, so that rounding does not matter; below 1e-12 they are zero."""
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return f"{0.0 if abs(value) < 1e-12 else value:.9g}" if type(value) in (int, float) else value


def digest(found: Scene | dict[str, Scene]) -> str:
    scenes = found.values() if isinstance(found, dict) else [found]
    text = json.dumps([plain(scene.to_dict()) for scene in scenes], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


@pytest.mark.parametrize("name", MAKERS)
def test_mechanism_of_a_name_or_seed(name):
    assert digest(MAKERS[name]()) == json.loads(STORED.read_text())[name]


def test_digest_sees_a_number_and_no_rounding():
    scene = HARD["planes"]()
    other = scene.with_(gravity=tuple(g * (1 + 1e-12) for g in scene.gravity))
    assert digest(other) == digest(scene) != digest(scene.with_(duration=1.1))


if __name__ == "__main__":
    STORED.write_text(json.dumps({name: digest(make()) for name, make in MAKERS.items()}, indent=0) + "\n")
