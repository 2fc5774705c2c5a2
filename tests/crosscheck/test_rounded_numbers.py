"""Closed loops with anchors, axes and orientations of 6 or 8 digits / one reading by judge and engines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crosscheck.conformance.random_mechanisms import PRINCIPLE, compare
from crosscheck.judge.constraints import closure, initial_poses
from crosscheck.judge.gauss_principle import gauss, rank, singular_values
from mbref import rotations, simulate
from mbref.method import Method
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.rounded_numbers import advice
from mbref.simulation.simulate import Limits
from mbref.simulation.start_run import start_run
from mbref.trajectory import Outcome

TURN = rotations.from_vector(np.array([0.3, -0.7, 0.5]))
LOOPS = ("four_bar_gravity", "planar_slider_crank", "spatial_slider_crank_gravity")


def turned(name: str, digits: int | None) -> Scene:
    """A mechanism in a slanted frame, its places, axes and orientations rounded."""

    def vector(values: Any) -> list[float]:
        return shortened(rotations.to_matrix(TURN) @ np.array(values, dtype=float))

    def shortened(values: np.ndarray) -> list[float]:
        return (values if digits is None else np.round(values, digits)).tolist()

    data = find_scene(name).to_dict()
    if "gravity" in data:
        data["gravity"] = (rotations.to_matrix(TURN) @ data["gravity"]).tolist()
    for body in data["body"]:
        body["position"] = vector(body["position"])
        turn = np.array(body.get("orientation", (1.0, 0.0, 0.0, 0.0)))
        body["orientation"] = shortened(rotations.multiply(TURN, turn))
        for rate in {"velocity", "angular_velocity"} & set(body):
            body[rate] = (rotations.to_matrix(TURN) @ body[rate]).tolist()
    for load in data.get("load", ()):
        for key in {"force", "moment"} & set(load):
            load[key] = (rotations.to_matrix(TURN) @ load[key]).tolist()
    for joint in data["joint"]:
        for key in {"anchor", "axis"} & set(joint):
            joint[key] = vector(joint[key])
        for key in {"anchors", "axes"} & set(joint):
            joint[key] = [vector(values) for values in joint[key]]
    return Scene(**data)


@pytest.mark.parametrize("digits", [6, 8])
@pytest.mark.parametrize("name", LOOPS)
def test_rounded_loops_are_closed_and_as_redundant_as_before(name, digits):
    """Both bodies of a joint have the point and the axis that the file gives in the world."""
    scene, whole = turned(name, digits), turned(name, None)
    gaps = closure(scene, np.zeros(1), *(a[None] for a in initial_poses(scene)))
    assert max(np.abs(rows).max() for rows in gaps.values()) < 1e-14
    assert (scene.counts().redundant, rank(scene)) == (whole.counts().redundant, rank(whole))
    dependent = singular_values(scene)[rank(scene) :]
    assert dependent.max(initial=0.0) < 1e-13, "dependent rows are not dependent any more"


@pytest.mark.parametrize("name", LOOPS)
def test_rounding_makes_another_mechanism_by_as_much(name):
    """The accelerations differ by some roundings; two digits more are a hundredth of the difference."""
    whole = gauss(turned(name, None))
    apart = {d: np.abs(gauss(turned(name, d)) - whole).max() / np.abs(whole).max() for d in (6, 8)}
    assert 1e-8 < apart[6] < 1e-3 and 1e-10 < apart[8] < 1e-5, apart
    assert 5 < apart[6] / apart[8] < 2000, apart


@pytest.mark.parametrize("name", ["four_bar_gravity", "spatial_slider_crank_gravity"])
def test_engines_read_rounded_numbers_like_the_judge(name):
    found = compare(turned(name, 6), ("mujoco", "pinocchio"))
    assert found.errors[PRINCIPLE] < 1e-11 / found.distance
    assert found.errors["pinocchio"] < 1e-11 / found.distance
    assert found.errors["mujoco"] < 1e-7 / found.distance, "1e-6 of a rounded number would show"


def test_a_loop_that_needs_equal_lengths_and_rounded_numbers():
    """Three parallel cranks: with 7 digits they are no longer parallel, which locks them; with 9 digits the
    rank is uncertain; with 12 digits they move."""
    runs = {d: simulate(turned("five_bar_gravity", d), "taylor", [0.0, 0.01]) for d in (7, 9, 12, None)}
    outcomes = [run.outcome for run in runs.values()]
    assert outcomes == [Outcome.COMPLETED, Outcome.UNDECIDED, Outcome.COMPLETED, Outcome.COMPLETED]
    assert np.abs(np.diff(runs[7].position, axis=0)).max() < 1e-15
    assert "nearly dependent at the start" in runs[7].message, "a locked mechanism seems to hang at rest"
    assert all("nearly" not in runs[digits].message for digits in (12, None))
    assert "give the axes and points of the joints with 12 digits" in runs[9].message
    assert np.abs(np.diff(runs[12].position, axis=0)).max() > 1e-4
    assert np.abs(runs[12].position - runs[None].position).max() < 1e-10


def test_a_run_that_rounded_numbers_end_asks_for_more_digits():
    """A slider-crank, redundant in a slanted plane: 6 digits end its run, 12 digits do not."""
    run = simulate(turned("planar_slider_crank", 6))
    assert run.outcome != Outcome.COMPLETED
    assert "file's numbers seem to be rounded: give the axes and points of the joints with 12" in run.message
    assert simulate(turned("planar_slider_crank", 12)).outcome == Outcome.COMPLETED


def test_a_singular_start_is_not_taken_for_rounding():
    for name in ("four_bar_straight", "four_bar_gravity", "sarrus"):
        start = start_run(find_scene(name), Method.parse("taylor"), np.array([0.1]), Limits())
        assert advice(start) == "", name
