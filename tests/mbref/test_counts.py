"""Counts of the built-in scenes against those the paper states."""

import numpy as np
import pytest

from mbref.equations.diagnosis import diagnose
from mbref.scenes import SCENES, find_scene
from mbref.scenes.four_bar import four_bar

# scene: (coordinates, rows, redundant) with the ground as a body: sections 5.1 and 5.2 of the paper
PAPER = {
    "four_bar": (24, 25, 1),
    "five_bar": (30, 35, 5),
    "spatial_slider_crank": (24, 23, 0),
    "planar_slider_crank": (24, 24, 1),
    "planar_slider_crank_equal": (24, 24, 1),
}


@pytest.mark.parametrize("name", PAPER)
def test_counts_and_paper(name):
    counts = SCENES[name]().with_(ground="body").counts()
    found = (counts.coordinates, counts.rows, counts.redundant)
    assert found == PAPER[name], f"{name}: (coordinates, rows, redundant) {found}, the paper {PAPER[name]}"


@pytest.mark.parametrize("loops", [1, 2, 5])
def test_counts_of_chains_and_their_formulas(loops):
    for name, stated in (
        ("four_bar_chain", (12 * loops + 6, 13 * loops + 5, loops, 1)),
        ("slider_crank_chain", (18 * loops, 24 * loops - 6, 6 * loops - 5, 1)),
    ):
        counts = find_scene(f"{name}[{loops}]").counts()
        found = (counts.coordinates, counts.rows, counts.redundant, counts.degrees_of_freedom)
        assert found == stated, f"{name}: (coordinates, rows, redundant, freedoms) {found}, stated {stated}"


@pytest.mark.parametrize("name", PAPER)
def test_ground_as_frame_saves_six_coordinates_and_rows(name):
    scene = SCENES[name]()
    frame, body = scene.counts(), scene.with_(ground="body").counts()
    assert (body.coordinates - frame.coordinates, body.rows - frame.rows) == (6, 6)
    assert (frame.redundant, frame.degrees_of_freedom) == (body.redundant, body.degrees_of_freedom)


def test_rank_drops_at_the_singular_position():
    assert SCENES["four_bar"]().counts().rank == 18
    assert SCENES["four_bar_straight"]().counts().rank == 17


def test_redundancy_and_the_rows_that_take_part():
    found = diagnose(SCENES["planar_slider_crank"]())
    # out of the plane z, and the rotations about x and y, are held at A, B and D and z at C as well
    assert found.counts.redundant == 1
    assert set(found.redundant_by_joint) <= {"A", "B", "C", "D"}
    assert sum(found.redundant_by_joint.values()) >= 2
    assert not set(found.unique_reactions) & set(found.redundant_by_joint)


def test_unique_reactions_and_a_mechanism_without_redundancy():
    found = diagnose(SCENES["spatial_slider_crank"]())
    assert (found.redundant_by_joint, found.unique_reactions) == ({}, ("A", "B", "C", "D"))


def test_distance_to_the_singular_position_falls_with_the_angle():
    distances = [diagnose(four_bar(angle)).smallest_singular_value for angle in (1.0, 0.1, 0.01)]
    ratios = np.array(distances[1:]) / distances[:-1]
    assert np.all(np.abs(ratios - 0.1) < 0.02), f"not proportional to the angle: {distances}"
