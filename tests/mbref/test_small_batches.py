"""Few variants over a short time, together / alone: quick enough for interpreted kernels."""

from __future__ import annotations

import numpy as np
import pytest

from mbref.ensembles.simulate_all import run_all, simulate_all
from mbref.scenes import find_scene
from mbref.scenes.four_bar import four_bar_gravity
from mbref.simulation.simulate import Limits, simulate
from mbref.variation import Variation, variants
from tests.coupled_scenes import gear_pair
from tests.loads_over_time import arm
from tests.mbref.scenes_of_one_structure import results

TIMES, LIMITS = np.array([0.0, 4e-5, 1e-4]), Limits(rtol=1e-5)
VARIED = {  # numbers that vary, and how many of four variants are simulated in the first one's memory
    "heavy_top": (["body[top].mass=10:20", "body[top].angular_velocity[1]=140:160", "gravity[2]=-9:-8"], 3),
    "spatial_slider_crank_driven": (["body[rod].mass=0.5:2", "gravity[1]=-9:9"], 3),
    "point_pendulum": (["body[mass].mass=0.5:2", "gravity[1]=-9:9"], 3),
    "rigid_slider_crank": (["body[rod].mass=0.4:0.6", "body[crank].mass=0.1:0.2"], 3),
    "flyball_governor": (["load[0].stiffness=7e5:8e5", "load[1].damping=3e4:4e4", "body[left].mass=4:6"], 3),
    "planar_slider_crank": (["load[0].moment[2]=50:99", "body[slider].mass=0.5:2"], 3),
    "spatial_slider_crank": (["load[0].moment[1]=50:99", "joint[B].anchor[0]=0.1+-1e-3"], 3),
}


def scenes_of(name: str, count: int = 4) -> list:
    scene = find_scene(name)
    return list(variants(scene, [Variation.parse(text) for text in VARIED[name][0]], count, seed=5))


def bytes_of(wrenches) -> bytes:
    return b"".join(wrenches[joint].tobytes() for joint in sorted(wrenches))


@pytest.mark.parametrize("name", VARIED)
def test_a_few_variants_agree_to_the_bit(name):
    scenes = scenes_of(name)
    together = simulate_all(scenes, "taylor", TIMES, LIMITS)
    alone = [simulate(scene, "taylor", TIMES, LIMITS) for scene in scenes]
    assert [results(run) for run in together] == [results(run) for run in alone]
    assert all(run.mechanism is scene for run, scene in zip(together, scenes, strict=True))
    assert len({run.acceleration.tobytes() + bytes_of(run.reactions) for run in alone}) == 4, "they differ"
    for one, other in zip(together, alone, strict=True):
        for joint, wrench in one.reactions.items():
            assert wrench.tobytes() == other.reactions[joint].tobytes()
        assert one.outcome is other.outcome and one.t_end == 1e-4 and one.message == other.message
        assert (one.cost.steps, one.cost.rhs) == (other.cost.steps, other.cost.rhs)
        assert one.cost.build_seconds >= 0.0
    ended = run_all(scenes, "taylor", TIMES, LIMITS)
    assert [(places, batch.places) for places, batch in ended.batches] == [([1, 2, 3], [0, 1, 2])]
    assert [*ended.alone] == [0] and not ended.errors and 0.0 < ended.seconds < 1e4


def test_scenes_of_other_structures_and_unfit_methods_are_run_alone():
    """Loads over time and couplings of angles do not join a batch; two structures lead two batches."""
    first, second = scenes_of("point_pendulum", 2), scenes_of("heavy_top", 2)
    ended = run_all([first[0], second[0], second[1], first[1]], "taylor", TIMES, LIMITS)
    assert sorted(ended.alone) == [0, 1] and [places for places, _ in ended.batches] == [[3], [2]]
    for each, method, limits in (
        (first, "lm1+none/rk4[step=0.001]", LIMITS),
        (first, "taylor", Limits(rtol=1e-5, branches={1: 1})),
        ([arm(), arm()], "taylor", LIMITS),
        ([four_bar_gravity(0.0)] * 2, "taylor", LIMITS),
    ):
        found = run_all(each, method, TIMES, limits)
        assert sum(len(batch.places) for _, batch in found.batches) == 0
        assert sorted([*found.alone, *found.errors]) == [0, 1]
    coupled = [*variants(gear_pair(), [Variation("body[0].mass", 1.0, 2.0)], 2, seed=3)]
    made = simulate_all(coupled, "taylor", TIMES, LIMITS)
    assert [results(run) for run in made] == [results(simulate(s, "taylor", TIMES, LIMITS)) for s in coupled]
