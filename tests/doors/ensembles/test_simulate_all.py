"""Runs of ensembles equal single runs in all numbers (``results``), to the bit, also if they fail."""

import pickle
from itertools import permutations
from typing import NamedTuple

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from mbref.ensembles.simulate_all import run_all, simulate_all
from mbref.motions.crossing import Crossing
from mbref.motions.motion import Motion
from mbref.scene import Body, Force, Revolute, Scene, SceneError, Spring, Translational
from mbref.scene.paths import replaced_at
from mbref.scene.variation import Variation, variants
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.coupled_mechanisms import gear_pair

CRANK, SPATIAL = SCENES["planar_slider_crank"](), SCENES["spatial_slider_crank"]()
X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def results(run: Motion) -> list:
    """Return outcome, message, end time, counts and the bytes of all arrays of a run."""
    arrays = [getattr(run, key) for key in ("position", "orientation", "velocity", "angular_velocity")]
    arrays += [run.acceleration, run.angular_acceleration]
    for table in (run.reactions, run.open_reactions):
        arrays += [table[name] for name in sorted(table)]
    cost = [run.cost.steps, run.cost.rhs, run.cost.factorisations, run.cost.newton]
    return [run.outcome.name, run.message, run.t_end, cost, *(array.tobytes() for array in arrays)]


def crank_with(force: tuple[float, float, float], **changes) -> Scene:
    """The planar slider-crank with a force on its rod; a force across the plane bends it out of the plane."""
    place = CRANK.body[1].position
    further = Force(body=CRANK.body[1].name, point=place, force=force)
    return CRANK.with_(load=(*CRANK.load, further), **changes)


def rail(across: float, inertia: float = 0.02) -> Scene:
    """A slide on an arm, pulled by a spring to a point at the height ``across`` (m) over their plane and by a
    force of as many N across it: both tend to turn arm and slide out of the plane."""
    middle, above = (0.3, 0.0, 0.0), (0.3, 0.5, across)
    bodies = (
        Body(name="arm", mass=1.0, inertia=(0.01, 0.02, 0.02), position=(0.1, 0.0, 0.0)),
        Body(name="slide", mass=1.0, inertia=(inertia, inertia, inertia), position=middle),
    )
    pin = Revolute(name="pin", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=Z)
    guide = Translational(name="guide", bodies=("arm", "slide"), anchor=middle, axis=X)
    pull = Spring(bodies=("ground", "slide"), points=(above, middle), stiffness=20.0, natural_length=0.3)
    push = Force(body="slide", point=middle, force=(0.0, 0.0, across))
    return Scene(name="rail", duration=0.5, body=bodies, joint=(pin, guide), load=(pull, push))


NUMBERS_DECIDE = {
    "a force out of the plane": [crank_with((0.0, 1.0, 0.0)), crank_with((0.0, 1.0, 0.5))],
    "gravity out of the plane": [CRANK.with_(gravity=(0.0, g, h)) for g, h in ((-9.8, 0.0), (-9.8, 1.0))],
    "motion at the start": [
        SPATIAL.with_(body=tuple(b.model_copy(update={"angular_velocity": None}) for b in SPATIAL.body)),
        SPATIAL.with_("body[crank].angular_velocity", (0.0, 3.0, 0.0)),
    ],
    "a spring out of the plane": [rail(0.0), rail(0.2)],
    "no moment of inertia": [rail(0.2), rail(0.2, inertia=0.0)],
}


METHOD, TIMES = "taylor", np.linspace(0.0, 0.05, 4)
LIMITS = Limits(rtol=1e-6)
DRIVEN = SCENES["spatial_slider_crank_driven"]()
LENGTH = Variation("joint[B].anchor[0]", 0.304, 1e-3, normal=True)
MASS = Variation("body[crank].mass", 0.5, 2.0)


class Compared(NamedTuple):
    runs: list[Motion]  # simulated together
    differing: list[int]  # places of runs that differ in a bit, or in the scene object, from single runs


def compared(scenes: list[Scene], times=TIMES, limits=LIMITS, method=METHOD) -> Compared:
    """Return runs of scenes together, compared with single runs."""
    runs, differing = simulate_all(scenes, method, times, limits), []
    for place, (scene, run) in enumerate(zip(scenes, runs, strict=True)):
        alone = simulate(scene, method, times, limits)
        if results(run) != results(alone) or run.mechanism is not scene:
            differing.append(place)
    return Compared(runs, differing)


def in_batches(scenes: list[Scene], times=TIMES, limits=LIMITS, method=METHOD) -> int:
    """Return the number of runs computed in one batch with a first run; others are computed one by one."""
    ended = run_all(scenes, method, times, limits)
    return sum(len(followed.places) for _, followed in ended.batches)


def number_at(scene: Scene, path: str) -> float:
    """Return the number of a scene at a path."""
    found: list[float] = []
    fields = {name: getattr(scene, name) for name in Scene.model_fields}
    replaced_at(fields, path, lambda value: found.append(value) or value)
    return found[0]


def bytes_of(crossing: Crossing) -> list:
    """Return all fields of a crossing, its numbers as bytes."""
    return [np.asarray(v).tobytes() if key != "sentence" else v for key, v in vars(crossing).items()]


@pytest.mark.parametrize(
    "name", ["planar_slider_crank", "spatial_slider_crank", "heavy_top", "flyball_governor"]
)
def test_variants_of_masses_and_gravity_together_equal_single_runs(name):
    """Eleven of twelve variants are in a batch with the first one; all positions differ."""
    body = SCENES[name]().body[0].name
    varied = [Variation(f"body[{body}].mass", 0.5, 2.0), Variation("gravity[1]", -10.0, 10.0)]
    scenes = list(variants(SCENES[name](), varied, 12))
    runs, differing = compared(scenes)
    assert not differing
    assert in_batches(scenes) == len(scenes) - 1
    assert len({run.position.tobytes() for run in runs}) == 12, "the variants are to differ"


PUSH = Force(body="rod", point=(0.4, 0.1, 0.0), force=(1.0, 2.0, 0.0))
PLACES = [
    (SCENES["planar_slider_crank"](), "joint[B].anchor[0]"),
    (DRIVEN, "joint[B].anchor[0]"),
    (SCENES["four_bar_gravity"](), "body[coupler].position[0]"),
    (SCENES["planar_slider_crank_gravity"](), "joint[C].anchor[0]"),
    (SCENES["planar_slider_crank_gravity"]().with_(load=(PUSH,)), "load[0].point[0]"),
    (gear_pair(), "coupling[0].ratio"),
]


@pytest.mark.parametrize(
    ("scene", "path"), [pytest.param(*case, id=f"{case[0].name} {case[1]}") for case in PLACES]
)
def test_variants_of_a_place_or_ratio_together_equal_single_runs(scene, path):
    """PLACES are numbers on which lengths, moments or couplings depend. Seven of eight variants are in a
    batch with the first, though each has a number of its own there."""
    mean = number_at(scene, path)
    scenes = list(variants(scene, [Variation(path, mean, 1e-5 * abs(mean), normal=True)], 8))
    assert not compared(scenes, np.linspace(0.0, 0.01, 3), method="taylor").differing
    assert in_batches(scenes, np.linspace(0.0, 0.01, 3), method="taylor") == len(scenes) - 1


def test_variants_with_and_without_crossings_together_equal_single_runs():
    """Gravity of up to 400 m/s² along the guide stops some cranks before crank and rod are in line."""
    scenes = list(variants(SCENES["planar_slider_crank_equal"](), [Variation("gravity[0]", -400, 400)], 10))
    runs, differing = compared(scenes, np.linspace(0.0, 0.1, 5), method="taylor")
    assert not differing
    passed = [len(run.crossings) for run in runs]
    assert 0 in passed and max(passed) > 0, passed


def test_variants_that_all_cross_singular_positions_are_computed_in_one_batch():
    """Five of six variants are in a batch with the first; masses vary, then also places of centres."""
    times = np.linspace(0.0, 0.1, 5)
    mass, centre = Variation("body[coupler].mass", 0.45, 0.55), Variation("body[bar].position[0]", 0.2, 0.3)
    for varied in ([mass], [mass, centre]):
        scenes = list(variants(SCENES["five_bar"](), varied, 6))
        runs, differing = compared(scenes, times, method="taylor")
        assert not differing
        assert in_batches(scenes, times, method="taylor") == 5
        for scene, run in zip(scenes, runs, strict=True):
            alone = simulate(scene, "taylor", times, LIMITS).crossings
            assert alone and list(map(bytes_of, run.crossings)) == list(map(bytes_of, alone))


def test_variants_that_fail_or_complete_together_equal_single_runs():
    """The limit of steps is the median of the single runs' steps, so that some variants fail."""
    scenes = list(variants(CRANK, [MASS, LENGTH], 12))
    steps = [simulate(scene, METHOD, TIMES, LIMITS).cost.steps for scene in scenes]
    runs, differing = compared(scenes, limits=Limits(rtol=1e-6, most_steps=int(np.median(steps))))
    assert not differing
    assert {run.outcome.name for run in runs} == {"COMPLETED", "STEP_FAILED"}


def test_random_mechanisms_in_random_order_together_equal_single_runs():
    """Three variants of each of eight mechanisms: several batches, and their runs in another order."""
    scenes = []
    for seed in range(8):
        scene = random_mechanism(seed)
        place = scene.body[0].position[0]
        scenes += variants(scene, [Variation("body[0].position[0]", place, place + 0.1)], 3)
    order = np.random.default_rng(0).permutation(len(scenes))
    assert not compared([scenes[k] for k in order], np.linspace(0.0, 0.02, 3)).differing


@pytest.mark.parametrize("scenes", NUMBERS_DECIDE.values(), ids=NUMBERS_DECIDE.keys())
def test_scenes_of_one_shape_with_different_independent_rows_together_equal_single_runs(scenes):
    """Numbers of these scenes decide which rows are independent or at rest, as a force across the plane does
    of a planar mechanism; each scene is there twice, in each order."""
    for order in permutations(range(len(scenes))):
        assert not compared([scenes[k] for k in order * 2]).differing


def test_variants_of_springs_and_full_inertias_together_equal_single_runs():
    """The rod's inertia has principal moments in six variants, and products in six. Of six with principal
    moments one runs alone first, and five in its batch."""
    points = ((0.3, 0.2, 0.0), CRANK.body[1].position)
    spring = Spring(bodies=("ground", "rod"), points=points, stiffness=50.0, natural_length=0.1)
    sprung = CRANK.with_(load=(*CRANK.load, spring))
    turned = sprung.with_("body[rod].inertia", ((1e-3, 0.0, 2e-4), (0.0, 5e-3, 0.0), (2e-4, 0.0, 5e-3)))
    varied = [Variation("load[1].stiffness", 10.0, 90.0), LENGTH]
    scenes = list(variants(sprung, varied, 6))
    assert not compared([*scenes, *variants(turned, varied, 6)]).differing
    assert in_batches(scenes) == 5


@pytest.mark.parametrize(
    "method", ["mpi-svd+baumgarte", "taylor", "mpi-qr+projection", "lm2+projection/rk4[step=1e-4]"]
)
def test_variants_by_methods_of_each_kind_together_equal_single_runs(method):
    """``compared`` runs three variants in a batch and alone; none differs in a bit."""
    scenes = list(variants(CRANK, [MASS, LENGTH], 3))
    assert not compared(scenes, np.linspace(0.0, 0.01, 3), method=method).differing


def test_run_of_an_ensemble_is_equal_after_pickling():
    """The run was computed in a batch, as the second of four; all its numbers (``results``) are equal."""
    run, *_ = simulate_all(list(variants(CRANK, [MASS], 4)), METHOD, TIMES, LIMITS)[1:]
    sent = pickle.loads(pickle.dumps(run))
    assert results(sent) == results(run)


def test_ensemble_raises_the_faults_of_its_first_faulty_scene():
    """Scene 1 gives the rod, and scene 3 the crank, a rate about an axis in the plane, which their joints
    forbid. The faults are those that a single run of scene 1 has."""
    scenes = list(variants(CRANK, [MASS], 4))
    for place, body in ((1, "rod"), (3, "crank")):
        scenes[place] = scenes[place].with_(f"body[{body}].angular_velocity", (5.0, 0.0, 0.0))
    alone = []
    for place in (1, 3):
        with pytest.raises(SceneError) as caught:
            simulate(scenes[place], METHOD, TIMES, LIMITS)
        alone.append(caught.value.faults)
    with pytest.raises(SceneError) as together:
        simulate_all(scenes, METHOD, TIMES, LIMITS)
    assert together.value.faults == alone[0] != alone[1]
