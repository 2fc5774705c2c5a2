"""Counts of the built-in scenes against those the paper states."""

import pytest

from mbref.scenes import SCENES

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


@pytest.mark.parametrize("name", PAPER)
def test_ground_as_frame_saves_six_coordinates_and_rows(name):
    scene = SCENES[name]()
    frame, body = scene.counts(), scene.with_(ground="body").counts()
    assert (body.coordinates - frame.coordinates, body.rows - frame.rows) == (6, 6)
    assert (frame.redundant, frame.degrees_of_freedom) == (body.redundant, body.degrees_of_freedom)


def test_rank_drops_at_the_singular_position():
    assert SCENES["four_bar"]().counts().rank == 18
    assert SCENES["four_bar_straight"]().counts().rank == 17
