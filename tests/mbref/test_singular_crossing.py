"""Leaps over singular positions: a landing that the projection has to move far is no success."""

import numpy as np
import pytest

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import closed_form
from mbref.scene import Body, Revolute, Scene
from mbref.scenes.four_bar import four_bar_gravity
from mbref.simulation.simulate import Limits, simulate


@pytest.mark.parametrize("code", ["generic", "specialised"])
@pytest.mark.parametrize("inertia", [1e-10, 1e-8, 1e-6])
def test_a_bead_on_an_arm_is_never_off_its_circle(inertia, code):
    """Its constraint Jacobian is nowhere singular, but the pivots in the metric of M fall by the inertia."""
    bead = Body(name="bead", mass=1.0, inertia=(inertia,) * 3, position=(1.0, 0.0, 0.0))
    arm = Revolute(name="J", bodies=("ground", "bead"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    scene = Scene(name="bead", gravity=(0.0, 0.0, -9.81), body=(bead,), joint=(arm,))
    run = simulate(scene, "alf-dual+projection", np.linspace(0.0, 1.0, 11), Limits(code=code))
    if run.outcome.name == "COMPLETED":
        radius = np.linalg.norm(run.position[:, 0], axis=1)
        assert np.abs(radius - 1.0).max() < 1e-6, "COMPLETED off the circle"


@pytest.mark.parametrize("code", ["generic", "specialised"])
def test_a_rhombus_that_turns_back_before_it_is_flat_does_not_complete_wrong(code):
    scene = four_bar_gravity(-1e-5).with_(duration=4.0)
    run = simulate(scene, "alf-dual+projection", np.linspace(0.0, 4.0, 9), Limits(code=code))
    if run.outcome.name == "COMPLETED":
        error = measure(scene, run, closed_form(scene))["error"]
        assert error < 1e-6, f"COMPLETED with an error of {error:.1e}"
