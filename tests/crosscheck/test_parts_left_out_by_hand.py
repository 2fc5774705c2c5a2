"""Parts of a MuJoCo model that a scene cannot describe / small files: each sentence worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace

import mujoco
import pytest

from crosscheck.engines.mujoco.importing import left_out
from crosscheck.engines.mujoco.importing.left_out import (
    Part,
    checked,
    notes,
    of_model,
    refuse_others,
    stripped,
)
from mbref.scene import SceneError

GEOM = '<geom type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/>'


def model(bodies: str, more: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(f"<mujoco>{more}<worldbody>{bodies}</worldbody></mujoco>")


def body(name: str, joints: str, more: str = "") -> str:
    return f'<body name="{name}">{joints}{GEOM}{more}</body>'


def test_kinds_that_are_left_out():
    assert checked([]) == frozenset() and checked(["fluid", "motors"]) == {"fluid", "motors"}
    assert checked(["fluid", "everything"]) == frozenset(left_out.KINDS)
    with pytest.raises(
        ValueError, match=r"^--without: 'wind' is none of armature, couplings, .*, everything$"
    ):
        checked(["fluid", "wind"])


def test_parts_of_other_kinds_are_refused():
    parts = [Part("fluid", "the water"), Part("motors", "a servo"), Part("fluid", "the air")]
    refuse_others(parts, frozenset({"fluid", "motors"}))
    with pytest.raises(SceneError) as refused:
        refuse_others(parts, frozenset({"motors"}))
    ending = "it changes the motion; --without fluid leaves it out"
    assert list(refused.value.faults) == [f"the water: {ending}", f"the air: {ending}"]


def test_more_than_six_names_are_counted():
    assert left_out._listed(["a"]) == "a" and left_out._listed(list("abcdef")) == "a, b, c, d, e, f"
    assert left_out._listed(list("abcdefgh")) == "a, b, c, d, e, f and 2 more"


TENDONS = """
<tendon>
  <fixed name="rope" frictionloss="0.1" armature="0.2"><joint joint="free" coef="1"/></fixed>
  <fixed name="wire" limited="true" range="0 1"><joint joint="free" coef="1"/></fixed>
</tendon>"""


@pytest.fixture
def full() -> mujoco.MjModel:
    """A model with every part that changes the motion, but flexible bodies."""
    hinges = (
        '<joint name="free" axis="0 0 1"/><joint axis="0 1 0" armature="0.5" frictionloss="0.25"/>'
        '<joint name="stiff" axis="1 0 0" armature="2" frictionloss="3"/>'
    )
    bodies = (
        body("arm", hinges)
        + '<body name="kite" gravcomp="1"><joint name="ball" type="ball"/>'
        + GEOM
        + "</body>"
    )
    return model(bodies, '<option density="1.2" viscosity="0.5"/>' + TENDONS)


def test_parts_that_change_the_motion(full):
    nameless = "joint 1 (of body 'arm')"
    assert list(of_model(full, ())) == [
        Part("armature", f"armature of {nameless}, 'stiff'"),
        Part("friction", f"dry friction of {nameless}, 'stiff'"),
        Part("armature", "armature of tendons rope"),
        Part("friction", "friction of tendons rope"),
        Part("fluid", "the fluid around the bodies"),
        Part("gravity-compensation", "compensation of the weight of kite"),
    ]
    assert next(iter(of_model(full, [1]))).sentence == "armature of 'stiff'", "a coordinate of the scene"
    assert full.dof_armature[1] == 0.5, "the model stays as it is"
    full.opt.density, full.dof_frictionloss[:] = 0.0, 0.0
    kinds = [part.kind for part in of_model(full, [1, 2])]
    assert kinds == ["armature", "friction", "fluid", "gravity-compensation"], "of tendons, and viscosity"
    full.opt.viscosity = 0.0
    assert "fluid" not in [part.kind for part in of_model(full, ())]


def test_tendons_and_bodies_without_names_have_numbers():
    tendon = '<tendon><fixed frictionloss="1"><joint joint="j" coef="1"/></fixed></tendon>'
    found = model(f'<body><joint name="j"/>{GEOM}<body><joint frictionloss="1"/>{GEOM}</body></body>', tendon)
    assert [part.sentence for part in of_model(found, ())] == [
        "dry friction of joint 1 (of body 'body 2')",
        "friction of tendons tendon 0",
    ]
    light = model(body("a", '<joint name="j"/>', '<body gravcomp="1"/>'), "")
    assert [part.sentence for part in of_model(light, ())] == ["compensation of the weight of "]


def test_geoms_touch_others_by_their_type_or_their_affinity():
    """Two of three geoms."""
    shapes = GEOM + GEOM.replace('contype="0"', 'contype="1"')
    shapes += GEOM.replace('conaffinity="0"', 'conaffinity="1"')
    found = model(f'<body name="a"><joint name="j"/>{shapes}</body>')
    assert list(notes(mujoco, found, "")) == ["2 geoms that could touch others"]
    found.geom_contype[:] = 1
    assert list(notes(mujoco, found, "")) == ["3 geoms that could touch others"]


def test_stripped_models_have_no_such_part(full):
    stripped(full, [2])
    assert list(of_model(full, [2])) == [] and full.dof_armature.tolist() == [0.0, 0.0, 2.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(("count", "words"), [(0, []), (1, ["1 flexible body"]), (2, ["2 flexible bodies"])])
def test_flexible_bodies_are_one_part(count, words):
    assert left_out.flexible(SimpleNamespace(nflex=count)) == [
        Part("flexible-bodies", word) for word in words
    ]


def test_notes_on_parts_without_influence():
    sites = '<site name="one"/><site name="two"/><site name="held"/><site name="routed" pos="0 0 1"/>'
    bodies = body("a", '<joint name="j" limited="true" range="0 90"/>', sites)
    touching = GEOM.replace('contype="0"', 'contype="1"')
    bodies += f'<body name="b"><joint name="k"/>{touching}{touching}</body>'
    bodies += '<body name="hand" mocap="true"/><site name="ground"/>'
    more = """
<equality><connect site1="held" site2="ground"/></equality>
<tendon><spatial limited="true" range="0 9"><site site="routed"/><site site="ground"/></spatial></tendon>
<actuator><motor joint="j"/><position joint="k"/></actuator>
<sensor><jointpos joint="j"/></sensor>
<contact><pair geom1="g" geom2="h"/></contact>
<keyframe><key name="up"/><key name="down"/></keyframe>"""
    named = bodies.replace("<geom", '<geom name="g"', 1).replace("<geom type", '<geom name="h" type', 1)
    found = model(named, more)
    sentences = [
        "2 actuators (1 servo): only motors with a control value in the keyframe act",
        "1 contact pair",
        "1 motion-capture body, fixed at its pose",
        "2 geoms that could touch others",
        "1 sensor",
        "2 sites without a joint",
        "1 limit of a tendon",
        "1 limit of a joint",
        "the softness of equalities (solref, solimp): a scene's joints are exact",
    ]
    assert list(notes(mujoco, found, "up")) == sentences
    assert list(notes(mujoco, found, "")) == [
        *sentences,
        "2 keyframes: --keyframe NAME begins the motion at a keyframe",
    ]
    one = model(body("a", '<joint name="j"/>') + f"<body>{touching}</body>")
    assert list(notes(mujoco, one, "")) == [], "a single geom touches nothing"
    motor = model(body("a", '<joint name="j"/>'), '<actuator><motor joint="j"/></actuator>')
    assert list(notes(mujoco, motor, "")) == [
        "1 actuator: only motors with a control value in the keyframe act"
    ]
