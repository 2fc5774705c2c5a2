"""Runs whose structure was run before: the same bits as those of a process that has run nothing."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np
import pytest

from crosscheck.conformance.random_mechanisms import random_mechanism
from mbref.equations import reduction
from mbref.equations.model import Model
from mbref.kernels import memory_pool
from mbref.kernels.compilation import PLAIN
from mbref.kernels.named_memory import Packed
from mbref.method import Method
from mbref.scene import Scene
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from mbref.simulation.start_run import start_run
from mbref.taylor import geometry
from mbref.variation import Variation, variants
from tests.mbref.scenes_of_one_structure import CRANK, NUMBERS_DECIDE, SPATIAL, results

TIMES = np.linspace(0.0, 0.02, 4)
METHODS = ("alf-dual+projection", "mpi-svd+baumgarte", "lm2+projection", "lm1+partitioning", "taylor")
FIVE_BAR = SCENES["five_bar"]()


@pytest.fixture(autouse=True)
def nothing_known() -> Iterator[None]:
    """Begin as a new process does."""
    forget()
    yield
    forget()


def forget() -> None:
    reduction._known.clear()
    memory_pool._kept.clear()
    geometry._known.clear()


def simulated(scene: Scene, method: str = METHODS[0]) -> list:
    return results(simulate(scene, method, TIMES, Limits(rtol=1e-7, most_steps=5000)))


def alone(scene: Scene, method: str = METHODS[0]) -> list:
    """The results of a run of which nothing is known."""
    forget()
    return simulated(scene, method)


def known(scene: Scene) -> int:
    """How many reductions are known once the scene has been run."""
    simulated(scene)
    return sum(map(len, reduction._known.values()))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", [CRANK, SPATIAL, FIVE_BAR], ids=lambda scene: scene.name)
def test_variants_in_a_row_and_alone_agree(scene, method):
    varied = [Variation("body[0].mass", 0.5, 2.0), Variation("gravity[1]", -10.0, 10.0)]
    scenes = list(variants(scene, varied, 4))
    expected = [alone(each, method) for each in scenes]
    forget()
    assert [simulated(each, method) for each in scenes * 2] == expected * 2
    assert memory_pool._kept, "no memory is kept"


def test_random_mechanisms_in_a_row_and_alone_agree():
    scenes = [random_mechanism(seed) for seed in range(10)]
    expected = [alone(scene) for scene in scenes]
    forget()
    assert [simulated(scene) for scene in scenes * 2] == expected * 2


@pytest.mark.parametrize("scenes", NUMBERS_DECIDE.values(), ids=NUMBERS_DECIDE.keys())
def test_numbers_that_decide_what_takes_part_are_asked_in_a_row(scenes):
    """In every order, each scene has its own reduction, whichever reductions are known."""
    expected = [alone(scene) for scene in scenes]
    for order in permutations(range(len(scenes))):
        forget()
        assert [simulated(scenes[k]) for k in order * 2] == [expected[k] for k in order * 2]


@pytest.mark.parametrize("name", ["a force out of the plane", "a spring out of the plane"])
def test_another_reduction_is_found_where_numbers_decide_so(name):
    one, other = NUMBERS_DECIDE[name]
    assert (known(one), known(one), known(other), known(one)) == (1, 1, 2, 2)


def test_variants_share_a_reduction():
    scenes = variants(CRANK, [Variation("joint[B].anchor[0]", 0.304, 1e-4, normal=True)], 20)
    assert {known(scene) for scene in scenes} == {1}


def test_scenes_that_differ_in_masses_and_loads_share_a_geometry():
    """And those that differ in places do not: a moment and a mass vary, then the length of the crank."""
    varied = [Variation("body[0].mass", 0.5, 2.0), Variation("load[0].moment[2]", 50.0, 150.0)]
    length = [Variation("joint[B].anchor[0]", 0.304, 1e-4, normal=True)]
    for variations, known in ((varied, 1), (length, 1 + 4)):
        scenes = list(variants(CRANK, variations, 4))
        repeated = [simulated(scene, "taylor") for scene in scenes]
        assert len(geometry._known) == known
        kept = dict(geometry._known)
        assert [alone(scene, "taylor") for scene in scenes] == repeated
        geometry._known.update(kept)


def test_scenes_that_differ_in_numbers_alone_share_a_structure():
    numbers = list(variants(CRANK, [Variation("load[0].moment[2]", 50.0, 150.0)], 3))
    structures = {Model(scene).structure for scene in numbers}
    others = CRANK.with_(load=()), CRANK.with_(joint=CRANK.joint[::-1]), FIVE_BAR, SPATIAL
    assert len(structures) == 1
    assert len(structures | {Model(scene).structure for scene in others}) == 1 + len(others)


@pytest.mark.parametrize("scene", [CRANK, SPATIAL, FIVE_BAR], ids=lambda scene: scene.name)
def test_a_repeated_run_evaluates_its_start_twice(scene, monkeypatch):
    """At rest to correct it, and beside the states at which equations are read."""
    simulated(scene)
    asked, terms = [], Model.terms
    monkeypatch.setattr(Model, "terms", lambda *given: asked.append(given) or terms(*given))
    start_run(scene, Method.parse(METHODS[0]), TIMES, Limits())
    assert len(asked) == 2


def test_memory_in_use_is_not_acquired_again():
    method, limits = Method.parse(METHODS[0]), Limits()
    one = start_run(CRANK, method, TIMES, limits)
    other = start_run(CRANK, method, TIMES, limits)
    assert one.memory is not other.memory
    one.release()
    third = start_run(CRANK, method, TIMES, limits)
    assert third.memory is one.memory and third.memory is not other.memory


@pytest.mark.skipif(PLAIN, reason="no machine code without the JIT")
def test_memory_with_generated_code_is_packed_once(monkeypatch):
    def run() -> list:
        return results(simulate(CRANK, "taylor", TIMES, Limits(code="generated")))

    first = run()
    monkeypatch.setattr(Packed, "__init__", lambda *_: pytest.fail("packed again"))
    assert run() == first


def test_a_repeated_crossing_has_the_same_bits():
    runs = [simulate(FIVE_BAR, "taylor", [0.05, 0.1]) for _ in range(3)]
    assert runs[0].crossings
    assert results(runs[0]) == results(runs[1]) == results(runs[2])


def test_what_is_kept_is_bounded():
    for count in range(2, memory_pool.MOST_KEYS + 10):
        simulate(CRANK, METHODS[0], np.linspace(0.0, 1e-4, count))
    assert len(memory_pool._kept) <= memory_pool.MOST_KEYS
