"""The moving picture: what moves / the trajectories it was made of."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from synthetic import exact, record, scene

from crosscheck.cli.passage import singular_instants
from mbref.scenes import SCENES
from reports.animation import Panel, animated, panel
from reports.runs import Run

SVG = "{http://www.w3.org/2000/svg}"


def moving(picture: str) -> list[list[list[float]]]:
    """Frames of every moving body, each a list of coordinates in pixels."""
    values = [
        node.attrib["values"]
        for node in ET.fromstring(picture).iter(f"{SVG}animate")
        if node.attrib["attributeName"] == "points"
    ]
    return [[[float(x) for x in frame.replace(",", " ").split()] for frame in v.split(";")] for v in values]


def test_bodies_of_an_exact_run_lie_on_the_exact_motion():
    crank = scene("planar_slider_crank")
    motion = exact(crank)
    bodies = moving(animated(crank, motion, [Panel("a", "b", motion)], [0.01]))
    assert len(bodies) == 2 * len(crank.body), len(bodies)
    for behind, before in zip(bodies[: len(crank.body)], bodies[len(crank.body) :], strict=True):
        assert behind == before and len(behind) == len(motion.times)
    lengths = [np.hypot(x1 - x0, y1 - y0) for x0, y0, x1, y1 in bodies[0]]
    assert np.ptp(lengths) < 0.3, f"the crank changes its length, in pixels: {lengths}"


def test_a_run_that_ended_early_stays_at_its_last_sample():
    crank = scene("planar_slider_crank")
    motion, part = exact(crank), exact(crank, share=0.5)
    bodies = moving(animated(crank, motion, [Panel("a", "b", part)], []))
    early = bodies[len(crank.body)]
    assert early[len(part.times) - 1] == early[-1] != early[0]


def test_title_and_error_of_a_record():
    shown = panel(Run(record("mujoco", "defaults", 0.5, 0.1, step=0.1, margin=3)))
    assert shown.title == "mujoco defaults, step 0.1" and shown.subtitle == "largest error 5.0e-01", shown


def test_picture_has_no_script_and_escapes_its_words():
    crank = scene("planar_slider_crank")
    motion = dataclasses.replace(exact(crank))
    picture = animated(crank, motion, [Panel("<a & b>", "c", motion)], [])
    assert "<script" not in picture and "&lt;a &amp; b&gt;" in picture


@pytest.mark.parametrize(("name", "count"), [("planar_slider_crank_equal", 4), ("planar_slider_crank", 0)])
def test_singular_positions_of_a_slider_crank(name, count):
    """With equal lengths the crank passes θ = ±π/2; with unequal ones nothing is singular."""
    crank = SCENES[name]()
    found = singular_instants(crank)
    assert len(found) == count, found
