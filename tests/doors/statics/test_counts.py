"""Counts of the built-in scenes against those that the paper, Neto & Ambrósio (2003), states."""

import numpy as np
import pytest

import mbref
from mbref.design.diagnosis import diagnose
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
def test_built_in_scenes_have_the_counts_that_the_paper_states(name):
    """PAPER has the numbers of coordinates, rows and redundant rows with the ground as a body, whose six
    coordinates six rows hold. As a frame the ground has neither."""
    counts, frame = (mbref.counts(SCENES[name]().with_(ground=ground)) for ground in ("body", "frame"))
    found = (counts.coordinates, counts.rows, counts.redundant)
    assert found == PAPER[name], f"{name}: (coordinates, rows, redundant) {found}, the paper {PAPER[name]}"
    assert (frame.coordinates + 6, frame.rows + 6, frame.redundant) == found
    assert frame.degrees_of_freedom == counts.degrees_of_freedom


@pytest.mark.parametrize("loops", [1, 2, 5, 200])
def test_chains_have_the_counts_of_their_formulas(loops):
    """N four-bars: N + 1 hinges of 5 rows below and 2 N universal joints of 4 rows above, N rows redundant. N
    slider-cranks: 18 rows each and N - 1 welds of 6 rows; 1 of each and 5 of a weld are redundant."""
    for name, stated in (
        ("four_bar_chain", (12 * loops + 6, 13 * loops + 5, loops, 1)),
        ("slider_crank_chain", (18 * loops, 24 * loops - 6, 6 * loops - 5, 1)),
    ):
        counts = mbref.counts(find_scene(f"{name}[{loops}]"))
        found = (counts.coordinates, counts.rows, counts.redundant, counts.degrees_of_freedom)
        assert found == stated, f"{name}: (coordinates, rows, redundant, freedoms) {found}, stated {stated}"


def test_diagnosis_counts_the_rows_that_share_a_redundant_force():
    """One row is redundant: a force along z on the line through the slider's pin can act in all joints. At C
    and D, on this line, it is one component; at the hinges A and B, off the line, it is a force and a moment.
    So no joint has a unique reaction."""
    found = diagnose(SCENES["planar_slider_crank"]())
    assert found.counts.redundant == 1
    assert found.redundant_by_joint == {"A": 2, "B": 2, "C": 1, "D": 1}
    assert found.unique_reactions == ()


def test_smallest_singular_value_is_proportional_to_the_angle_from_the_flat_pose():
    """The loop's gap closes by sin θ to first order, so that a tenth of the angle (rad) gives a tenth of the
    value. 1 rad is large, sin 1 = 0.84, so that the ratio may be off by 20 %."""
    values = [diagnose(four_bar(angle)).smallest_singular_value for angle in (1.0, 0.1, 0.01)]
    assert np.array(values[1:]) / values[:-1] == pytest.approx([0.1, 0.1], rel=0.2), values
