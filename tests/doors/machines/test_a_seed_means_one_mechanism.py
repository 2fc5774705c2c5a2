"""A seed or a name means one mechanism, to 12 digits, on every processor and in every version. Verdicts are
stored with the name or the seed of their mechanism. ``mechanisms.json`` has of each mechanism a checksum of
its words, and two sums of its numbers with fixed weights. Where mechanisms are to change, make it anew by
``python -m tests.doors.machines.test_a_seed_means_one_mechanism``, and then all stored verdicts, too."""

import json
import subprocess
import sys
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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
from tests.machines import KERNELS, ROOT, environment, runs_here


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


STORED = Path(__file__).with_name("mechanisms.json")
SEEDS = range(4)
ACCURACY = 1e-12  # of the sum of the sizes of all numbers
STEPS = (np.sqrt(2.0), np.sqrt(3.0))  # weights are the fractional parts of their multiples, plus 1/2


def signature(scene: Scene) -> list[float]:
    """Return a checksum of the words, two weighted sums of the numbers, and the largest size of a sum."""
    numbers: list[float] = []

    def words(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: words(part) for name, part in value.items()}
        if isinstance(value, list | tuple):
            return [words(part) for part in value]
        if type(value) not in (int, float):
            return value
        numbers.append(float(value))
        return "number"

    checksum = zlib.crc32(json.dumps(words(scene.to_dict())).encode())
    array, k = np.array(numbers), np.arange(1, len(numbers) + 1)
    sums = [float(array @ (k * step % 1.0 + 0.5)) for step in STEPS]
    return [checksum, *sums, float(1.5 * np.abs(array).sum())]


def table() -> dict[str, list[list[float]]]:
    """Return the signatures of all mechanisms, by maker and seed or by kind."""
    random = {name: [signature(make(seed)) for seed in SEEDS] for name, make in RANDOM.items()}
    return random | {name: [signature(scene) for scene in scenes] for name, scenes in named().items()}


def test_mechanisms_of_all_seeds_and_names_equal_the_stored_ones():
    """The words of their scenes agree exactly, and the weighted sums of their numbers to 12 digits."""
    found, wanted = table(), json.loads(STORED.read_text())
    assert found.keys() == wanted.keys()
    for name, signatures in found.items():
        for k, (one, other) in enumerate(zip(signatures, wanted[name], strict=True)):
            off = np.abs(np.subtract(one[1:], other[1:])).max()
            says = f"{name}, mechanism {k}: another mechanism, {off:.1e} off"
            assert one[0] == other[0] and off <= ACCURACY * other[-1], says


@pytest.mark.slow
@pytest.mark.parametrize("kernels", KERNELS)
def test_mechanisms_do_not_depend_on_the_kernels_of_openblas(kernels):
    """OpenBLAS rounds otherwise for each family of processors, which OPENBLAS_CORETYPE chooses."""
    changes = {"OPENBLAS_CORETYPE": kernels}
    if not runs_here(changes):
        pytest.skip(f"this processor does not run the kernels {kernels}")
    test = f"{__file__}::test_mechanisms_of_all_seeds_and_names_equal_the_stored_ones"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", test]
    done = subprocess.run(command, cwd=ROOT, env=environment(changes), stdout=subprocess.PIPE, check=False)
    assert done.returncode == 0, done.stdout.decode()


if __name__ == "__main__":
    lines = [f" {json.dumps(name)}: {json.dumps(rows)}" for name, rows in table().items()]
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n")
