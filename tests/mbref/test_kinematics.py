"""Motions that drivers prescribe: masses, drivers that agree or contradict; perturbed starts."""

import numpy as np
import pytest

from mbref.equations.diagnosis import undriven_freedoms
from mbref.equations.initial_state import solve_positions
from mbref.equations.model import Model, displaced
from mbref.scene import Driver, SceneError
from mbref.scenes import SCENES
from mbref.simulation.simulate import simulate


def test_prescribed_motion_of_a_modelled_ground_without_masses():
    scene = SCENES["four_bar"]()
    bodies = tuple(body.model_copy(update={"mass": None, "inertia": None}) for body in scene.body)
    bare = scene.with_(body=bodies, ground="body", load=())
    start, later = simulate(bare, "taylor", [0.0]), simulate(bare, "taylor", [0.01])
    with_masses = simulate(scene, "taylor", [0.01])
    assert np.abs(start.position[0] - [body.position for body in scene.body]).max() < 1e-15
    assert np.abs(later.position - with_masses.position).max() < 1e-12


@pytest.mark.parametrize("rate", [-249.6, -124.8 * 1.01])
def test_drivers_that_contradict_each_other_are_named(rate):
    scene = SCENES["four_bar"]()
    drivers = (*scene.driver, Driver(joint="D", polynomial=(0.0, rate)))
    with pytest.raises(SceneError, match=r"driver\[D\]: the drivers of A and D contradict"):
        simulate(scene.with_(driver=drivers), "taylor", [0.01])


@pytest.mark.parametrize("method", ["alf-dual+projection", "taylor"])
def test_drivers_that_agree_drive_together(method):
    scene = SCENES["four_bar"]()
    both = scene.with_(driver=(*scene.driver, Driver(joint="D", polynomial=scene.driver[0].polynomial)))
    alone, together = (simulate(s, method, [0.01]) for s in (scene, both))
    assert together.outcome.name == "COMPLETED", together.message
    assert np.abs(alone.position - together.position).max() < 1e-13


def test_a_freedom_without_driver_needs_masses():
    scene = SCENES["planar_slider_crank"]()
    bare = scene.with_(body=tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in scene.body))
    with pytest.raises(SceneError, match="'crank' has no mass and inertia, which a dynamic analysis needs"):
        simulate(bare, "taylor", [0.1])


def test_a_singular_start_of_a_driven_mechanism_leaves_no_freedom():
    scene = SCENES["four_bar_straight"]()
    assert scene.counts().degrees_of_freedom == 1
    assert undriven_freedoms(scene) == 0


# at the bifurcation itself the violation is quadratic in one direction, which no Newton step corrects
@pytest.mark.parametrize("name", [n for n in SCENES if n != "four_bar_straight"])
def test_perturbed_positions_are_corrected(name):
    model = Model(SCENES[name]())
    rng = np.random.default_rng(5)
    perturbed = displaced(model.start(), 1e-3 * rng.normal(size=model.n))
    before = np.max(np.abs(model.terms(0.0, perturbed, np.zeros(model.n)).phi))
    q, violations = solve_positions(model, 0.0, perturbed)
    after = np.max(np.abs(violations))
    moved = np.max(np.abs(q - perturbed))
    assert before > 1e-5, f"{name}: the perturbation violates nothing ({before:.1e})"
    assert after < 1e-10, f"{name}: a violation of {after:.1e} is left"
    assert moved < 0.1, f"{name}: corrected by {moved:.1e}, which is not near"
