"""The model-identity gate against models with one fault each."""

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judge.model_identity import gate, gate_times
from crosscheck.judge.truth import truth_for
from mbref.scene import Body
from mbref.scenes import SCENES
from tests.crosscheck.truth_scenes import ALL, CLOSED

MODELS = {name: ALL[name] for name in ("planar_slider_crank_gravity", "spatial_slider_crank_gravity",
          "four_bar_gravity", "slider_spring", "pendulum_all")}  # fmt: skip


def short_run(scene, times=None):
    return truth_for(scene).poses(gate_times(scene) if times is None else times)


def with_body(scene, index, **changes):
    bodies = list(scene.body)
    bodies[index] = Body(**{**dict(bodies[index]), **changes})
    return scene.with_(body=tuple(bodies))


@pytest.mark.parametrize("name", CLOSED)
def test_the_same_model_passes(name):
    run = short_run(SCENES[name]())
    found = gate(SCENES[name](), [run, replace(run, acceleration=None, angular_acceleration=None), run])
    assert found is None, f"{name}: {found}"


@pytest.mark.parametrize("name", MODELS)
def test_a_mass_off_by_five_percent_is_a_change_of_velocity(name):
    scene = MODELS[name]
    heavier = with_body(scene, -1, mass=scene.body[-1].mass * 1.05)
    found = gate(scene, [short_run(scene), short_run(heavier, gate_times(scene))])
    assert found is not None and found.field.startswith("change of"), f"{name}: {found}"


@pytest.mark.parametrize("name", ["planar_slider_crank", "four_bar_gravity", "pendulum_all"])
def test_an_inertia_off_by_five_percent_is_a_change_of_velocity(name):
    scene = ALL[name]
    other = with_body(scene, 0, inertia=np.array(scene.body[0].inertia) * 1.05)
    found = gate(scene, [short_run(scene), short_run(other, gate_times(scene))])
    assert found is not None and found.field.startswith("change of"), f"{name}: {found}"


def test_gravity_left_out_is_a_change_of_velocity():
    scene = MODELS["four_bar_gravity"]
    found = gate(scene, [short_run(scene), short_run(scene.with_(gravity=(0, 0, 0)), gate_times(scene))])
    assert found.field == "change of velocity" and "change of velocity: truth and truth" in str(found), found


FAULTS = {
    "initial position": {"position": 1e-6},
    "initial velocity": {"velocity": 1e-4},
    "initial angular velocity": {"angular_velocity": 1e-3},
    "initial acceleration": {"acceleration": 1.0},
    "initial angular acceleration": {"angular_acceleration": 2.0},
}


@pytest.mark.parametrize("field", FAULTS)
def test_the_first_field_that_differs_is_named(field):
    scene = MODELS["planar_slider_crank_gravity"]
    run = short_run(scene)
    ((key, size),) = FAULTS[field].items()
    shifted = getattr(run, key) + np.array([0.0, 0.0, size])
    found = gate(scene, [run, run, replace(run, engine="other", **{key: shifted})])
    assert found is not None and found.field == field, f"put in {key} + {size}, found {found}"
    assert found.engines == ("truth", "other"), found


def test_a_spin_that_changes_otherwise_is_named():
    scene = MODELS["planar_slider_crank_gravity"]
    run = short_run(scene)
    spin = run.angular_velocity.copy()
    spin[1, 2, 0] += 0.01 * np.abs(spin[1] - spin[0]).max()
    found = gate(scene, [run, replace(run, angular_velocity=spin)])
    assert found.field == "change of angular velocity", found
    assert found.by == pytest.approx(0.01, rel=1e-9), (
        f"put in one percent of the largest change, found {found}"
    )


def test_a_run_that_did_not_arrive_is_named():
    scene = MODELS["four_bar_gravity"]
    run = short_run(scene)
    found = gate(scene, [run, short_run(scene, np.zeros(1))])
    assert found is not None and found.field == "samples reached", found
    assert gate(scene, [run, short_run(scene, np.zeros(0))]).field == "samples reached"


def test_orientation_turned_is_named():
    scene = MODELS["four_bar_gravity"]
    run = short_run(scene)
    orientation = run.orientation.copy()
    orientation[0, 1] = [np.cos(1e-6), 0, 0, np.sin(1e-6)]
    found = gate(scene, [run, replace(run, orientation=orientation)])
    assert found.field == "initial orientation" and found.by == pytest.approx(2e-6, rel=1e-6), found
