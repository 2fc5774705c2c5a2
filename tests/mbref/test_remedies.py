"""A failed run names what bears its cause."""

import re

import numpy as np
import pytest

from mbref.scene import Body, Revolute, Scene
from mbref.scenes import SCENES
from mbref.scenes.four_bar import four_bar_gravity
from mbref.simulation.simulate import Limits, simulate

SLENDER = Scene(
    name="slender",
    gravity=(0.0, -9.81, 0.0),
    body=(Body(name="rod", position=(0.5, 0.0, 0.0), mass=1.0, inertia=(0.0, 0.1, 0.1)),),
    joint=(Revolute(name="A", bodies=("ground", "rod"), anchor=(0, 0, 0), axis=(0, 0, 1)),),
)


@pytest.mark.parametrize(
    ("scene", "method", "words"),
    [
        (
            SCENES["bricard"](),
            "lm1+none",
            r"constraint rows are redundant \(1 of 30\); use .*alf-dual.*mpi-qr",
        ),
        (SLENDER, "lm2+none", "body 'rod' lacks mass or a moment of inertia; use taylor, lm1 or alf"),
        (four_bar_gravity(0.3), "mpi-gs+none", "taylor crosses singular positions"),
        (
            SCENES["planar_slider_crank"](),
            "mpi-qr+none/rk4[step=1e-2]",
            "taylor crosses|projection corrects",
        ),
    ],
)
def test_a_failure_names_what_bears_its_cause(scene, method, words):
    run = simulate(scene, method, np.linspace(0.0, 1.5, 7), Limits(rtol=1e-6, most_steps=5_000))
    assert run.outcome.label != "COMPLETED"
    assert re.search("; .*(" + words + ")", run.message), run.message


def test_what_a_remedy_names_bears_the_cause():
    for method in ("taylor", "alf+projection", "lm1+projection"):
        assert simulate(SLENDER, method, [0.1]).outcome.label == "COMPLETED", method
