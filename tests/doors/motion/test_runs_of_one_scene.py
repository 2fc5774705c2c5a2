"""Runs of equal scenes give equal results, whatever ran before; a changed copy is another scene."""

import math

import numpy as np
import pytest

from mbref import find_scene, simulate

METHODS = ["taylor", "lm2+projection/dop853", "mpi-svd+partitioning/dop853"]
TIMES = np.linspace(0.0, 0.05, 3)


def numbers(motion):
    return motion.position, motion.velocity, motion.acceleration, motion.reactions["A"]


@pytest.mark.parametrize("name", ["spatial_slider_crank_gravity", "four_bar_gravity"])
def test_second_run_of_a_scene_is_equal_to_the_bit(name):
    """The run of a renamed copy is equal, too: a scene carries no data from its first run to the second."""
    scene = find_scene(name)
    first, again = (numbers(simulate(scene, "taylor", TIMES)) for _ in range(2))
    fresh = numbers(simulate(scene.with_(name="copy"), "taylor", TIMES))
    for one, other, new in zip(first, again, fresh, strict=True):
        assert np.array_equal(one, other)
        assert np.array_equal(one, new)


def test_methods_that_run_by_turns_on_one_scene_do_not_change_each_others_positions():
    """Alone, each method runs on a scene of its own; positions are equal to the bit."""
    scene = find_scene("spatial_slider_crank_gravity")
    alone = [simulate(scene.with_(name=method), method, TIMES).position for method in METHODS]
    turns = [[simulate(scene, method, TIMES).position for method in METHODS] for _ in range(2)]
    for found in turns:
        for one, other in zip(alone, found, strict=True):
            assert np.array_equal(one, other)


@pytest.mark.parametrize("copy", ["with_", "model_copy"])
def test_changed_copy_moves_by_its_own_numbers(copy):
    """With three times the mass a copy moves otherwise, and to the bit as a changed scene that never ran."""
    scene = find_scene("planar_slider_crank_gravity")
    before = simulate(scene, times=TIMES).position
    heavier = [body.model_copy(update={"mass": 3.0 * body.mass}) for body in scene.body[:1]]
    change = {"body": (*heavier, *scene.body[1:])}
    changed = scene.with_(**change) if copy == "with_" else scene.model_copy(update=change)
    found = simulate(changed, times=TIMES).position
    assert np.abs(found - before)[-1].max() > 1e-6  # m
    fresh = find_scene(scene.name).with_(name="copy", **change)
    assert np.array_equal(found, simulate(fresh, times=TIMES).position)


def test_scene_has_no_negative_zero():
    """Zeros of both signs are equal, so that scenes that differ in them alone are one scene."""
    given = find_scene("planar_slider_crank_gravity").with_(gravity=(-0.0, -0.0, -9.81))
    assert [math.copysign(1.0, g) for g in given.gravity] == [1.0, 1.0, -1.0]
