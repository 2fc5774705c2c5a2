"""Which scenes a truth recognises, and that it moves with them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crosscheck.truth import truth_for
from mbref import rotations
from mbref.scene import Body, Driver, Revolute, Scene, Spherical, Translational
from mbref.scenes import SCENES
from mbref.scenes.planar_slider_crank import planar_slider_crank
from tests.crosscheck.truth_scenes import ALL, Z, free, pendulum, turned_scene

FAMILY = {name: name for name in ("planar_slider_crank", "spatial_slider_crank")} | {
    "four_bar": "parallelogram",
    "five_bar": "parallelogram",
}


@pytest.mark.parametrize("name", SCENES)
def test_built_in_scene_has_a_truth_of_its_family(name):
    truth = truth_for(SCENES[name]())
    family = next(FAMILY[prefix] for prefix in FAMILY if name.startswith(prefix))
    assert truth is not None and truth.name == family, f"{name}: {truth and truth.name}, expected {family}"


VECTOR = st.tuples(*[st.floats(-1.5, 1.5)] * 3)


@given(vector=VECTOR, name=st.sampled_from(sorted(ALL)))
def test_truth_of_a_rotated_scene_is_the_rotated_truth(vector, name):
    scene, q = ALL[name], rotations.from_vector(np.array(vector))
    times = np.linspace(0, min(scene.duration, 0.5), 7)
    plain, turned = truth_for(scene).poses(times), truth_for(turned_scene(scene, q))
    assert turned is not None, f"{name} turned by {vector} is not recognised"
    got = turned.poses(times)
    off = np.abs(got.position - rotations.rotate(q, plain.position)).max()
    angle = rotations.angle_between(got.orientation, rotations.multiply(q, plain.orientation)).max()
    size = max(1.0, *np.abs(truth_for(scene)._coordinate(times)[0])) if scene.joint else 10.0
    assert max(off, angle) < 1e-13 * size * 5, f"{name} turned by {vector}: off by {off} m, {angle} rad"


@given(a=st.floats(0.1, 1.0), ratio=st.floats(1.05, 4.0))
def test_slider_crank_of_any_lengths_is_recognised(a, ratio):
    scene = planar_slider_crank(a, a * ratio)
    motion = truth_for(scene).poses(np.linspace(0, 0.05, 9))
    crank = 2 * motion.position[:, 0]
    x = crank[:, 0] + np.sqrt((a * ratio) ** 2 - crank[:, 1] ** 2)
    assert np.abs(motion.position[:, 2, 0] - x).max() < 1e-13 * a * ratio * 10


def moved_anchor(scene, joint, anchor):
    joints = [j.model_copy(update={"anchor": anchor}) if j.name == joint else j for j in scene.joint]
    return scene.with_(joint=tuple(joints))


STRANGERS = {
    "pivot of the rocker moved": moved_anchor(SCENES["four_bar"](), "D", (0.51, 0.0, 0.0)),
    "crank longer than the rod": planar_slider_crank(0.5, 0.4),
    "slider's line not in the crank's plane": SCENES["planar_slider_crank"]().with_(
        joint=(*SCENES["planar_slider_crank"]().joint[:3], Translational(
            name="D", bodies=("ground", "slider"), anchor=(0.7088, 0, 0), axis=(1, 0, 0.1)))),
    "two freedoms": pendulum().with_(
        body=(pendulum().body[0], pendulum().body[0].model_copy(update={"name": "other"})),
        joint=(pendulum().joint[0], Revolute(
            name="p", bodies=("ground", "other"), anchor=(0, 0, 0), axis=Z))),
    "spherical pendulum": pendulum(joint=(
        Spherical(name="ball", bodies=("ground", "bar"), anchor=(0, 0, 0)),)),
    "no mass, no driver": Scene(name="s", body=(Body(name="bar", position=(1, 0, 0)),), joint=(
        Revolute(name="pivot", bodies=("ground", "bar"), anchor=(0, 0, 0), axis=Z),)),
    "slender free rod": free(body=(free().body[0].model_copy(update={"inertia": (0.0, 0.3, 0.3)}),)),
    "two drivers": SCENES["four_bar"]().with_(driver=(
        *SCENES["four_bar"]().driver, Driver(joint="D", polynomial=(0.0, -124.8)))),
}  # fmt: skip


@pytest.mark.parametrize("why", STRANGERS)
def test_a_scene_of_no_family_has_no_truth(why):
    truth = truth_for(STRANGERS[why])
    assert truth is None, f"{why}: taken for {truth.name}"
