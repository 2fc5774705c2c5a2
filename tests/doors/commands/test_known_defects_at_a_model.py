"""Known defects of engines at a user's mechanism: said where short runs show them, and nowhere else."""

import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

import crosscheck.findings
from crosscheck.cli.commands import main
from crosscheck.conformance.mechanisms.invariant import moved_away
from crosscheck.engine import Setting, engine, installed
from crosscheck.findings.at_model import defects
from crosscheck.findings.finding import Finding, When, findings
from crosscheck.invariants.experiments import four_bar
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.helpers.falling_engine import STONE
from tests.helpers.parts import hinge, joint

CHAINS = Path(__file__).parents[3] / "examples" / "four_chains.xml"
ENGINE = "tests.helpers.falling_engine:ENGINE"


def said(options: Mapping[str, Any], remedy: Mapping[str, Any], **conditions: Any) -> list[str]:
    """Return the sentences on an engine with a setting, whose finding has a remedy and conditions."""
    when = When("falls too fast", "set factor = 1", ["plain"], 1e-3, options=remedy, **conditions)
    words = dict.fromkeys(("package", "version", "does", "right", "cause"), "a")
    found = Finding(name="too-fast", engine=ENGINE, when=when, **words)
    shown = defects(STONE, [ENGINE], lambda name: [Setting("plain", options)], [found])
    return [one.sentence for one in shown]


def test_defect_is_reported_where_its_remedy_mends_the_accelerations():
    """The stone falls with 1.5 g: off by 0.5 of the right acceleration; with the factor 1 it falls with g."""
    (sentence,) = said({"factor": 1.5}, {"factor": 1.0}, versions=["1.0"])
    assert "1.0 falls too fast and is wrong there: set factor = 1" in sentence
    assert "off by 0.5 of the largest, otherwise by 0" in sentence


def test_defect_is_a_drift_of_the_energy_where_the_motion_keeps_it():
    """The stone falls from rest for a time t by f g. It gains m f² g² t² / 2 and loses m f g² t² / 2. With
    f = 1.5 the gain is (f - 1) / f, a third, of the largest energy; with the remedy f = 1 it is nothing."""
    (sentence,) = said({"factor": 1.5}, {"factor": 1.0}, keeps="energy", seconds=0.2)
    assert "the energy is off by 0.33 of its size after 0.2 s, otherwise off by" in sentence
    assert said({"factor": 0.5}, {"factor": 1.0}, keeps="energy", seconds=0.2) == []  # it loses energy
    assert said({"factor": 1.5}, {"factor": 1.0}, keeps="energy", seconds=0.2, settings={"factor": 2.0}) == []


@pytest.mark.parametrize(
    ("options", "remedy", "conditions"),
    [
        ({"factor": 1.0}, {"factor": 1.0}, {}),
        ({"factor": 1.0}, {"factor": 1.5}, {}),
        ({"factor": 1.5}, {"factor": 1.0}, {"versions": ["1.1"]}),
        ({"factor": 1.5}, {"factor": 1.0}, {"loops": 1}),
        ({"factor": 1.5}, {"factor": 1.0}, {"joints": ["revolute"]}),
    ],
    ids=["remedy changes nothing", "remedy makes it wrong", "other version", "no loop", "no hinge"],
)
def test_no_defect_is_reported_without_improvement_or_where_its_conditions_fail(options, remedy, conditions):
    """Factors multiply gravity: 1 is right. The engine is version 1.0; the stone has no loops or joints."""
    assert said(options, remedy, **conditions) == []


WITH = {one.name: one for one in findings() if one.when}


def of_findings(name: str) -> Scene:
    """Return a four-bar whose file is stored beside the findings."""
    return Scene.from_file(resources.files(crosscheck.findings) / f"{name}.toml")


def welded() -> Scene:
    """Return an arm on a hinge; two hinges on one axis and a ball joint hold a tip to the arm."""
    arm = {"name": "arm", "mass": 1.0, "inertia": [0.05, 0.06, 0.07], "position": (0.3, 0.1, 0.2)}
    tip, axis = arm | {"name": "tip", "position": (0.8, 0.3, 0.1)}, (0.6, 0.48, 0.64)
    joints = [
        hinge("hinge0", "ground", "arm", (0.0, 0.0, 0.0)),
        hinge("hinge1", "arm", "tip", (0.5, 0.0, 0.0), axis),
        hinge("hinge2", "arm", "tip", (0.5 + 0.3 * 0.6, 0.3 * 0.48, 0.3 * 0.64), axis),
        joint("ball", "spherical", "arm", "tip", (0.7, 0.3, 0.1)),
    ]
    return Scene(name="welded", gravity=(0.0, -9.81, 0.0), body=[arm, tip], joint=joints)


def three_links() -> Scene:
    """Return a loop of a crank and two links on ball joints, which falls from rest."""
    places = ((0.4, 0.1, 0.2), (1.4, 0.1, 0.2), (1.4, 0.6, 0.7))
    link = {"mass": 1.0, "inertia": [0.05, 0.06, 0.07]}
    links = [{"name": f"link{k}", "position": place, **link} for k, place in enumerate(places)]
    pairs = ("link0", "link1"), ("link1", "link2"), ("link2", "ground")
    balls = dict(zip(pairs, ((1, 0, 0), (1, 0.5, 0.5), (1.5, 0.7, 0.8)), strict=True))
    joints = [hinge("A", "ground", "link0", (0.0, 0.0, 0.0))]
    joints += [joint("-".join(pair), "spherical", *pair, at) for pair, at in balls.items()]
    return Scene(name="links", gravity=(0.0, 0.0, -9.81), body=links, joint=joints)


HALF = """<body name="{0}" pos="{1} 0 0"><freejoint name="{0}"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.02 0.02"/></body>"""
PAIR = f"""<mujoco model="pair">
  <option gravity="0 0 0" timestep="1e-3"/>
  <worldbody>{HALF.format("a", -0.25)}{HALF.format("b", 0.25)}</worldbody>
  <equality><connect name="C" body1="a" body2="b" anchor="0.25 0 0"/></equality>
  <keyframe>
    <key qpos="-0.25 0 0 1 0 0 0 0.25 0 0 1 0 0 0" qvel="0 -5 0 0 0 {{spin}} 0 {{other}} 0 0 0 {{spin}}"/>
  </keyframe>
</mujoco>"""
CRANK = """<mujoco model="crank">
  <option timestep="1e-4" integrator="{integrator}"><flag refsafe="disable"/></option>
  <default><geom contype="0" conaffinity="0" size="0.02"/></default>
  <worldbody>
    <body name="crank"><joint name="A" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0"/>
      <body name="rod" pos="0.3 0 0">
        <joint name="B" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.4 0 0"/></body></body>
    <body name="slider" pos="0.7 0 0"><joint name="D" type="slide" axis="1 0 0"/><geom size="0.05"/></body>
  </worldbody>
  <equality>
    <connect name="C" body1="slider" body2="rod" anchor="0 0 0" solref="-1e6 -2e3" solimp="0.9999 0.9999"/>
  </equality>
  <keyframe><key qpos="0 0 0" qvel="30 -52.5 0"/></keyframe>
</mujoco>"""
CAM = """<mujoco model="cam">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="cam"><joint name="cam" type="slide"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
    <body name="follower"><joint name="follower" type="slide" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  </worldbody>
  <equality><joint joint1="follower" joint2="cam" polycoef="0 0 1 0 0"/></equality>
  <keyframe><key qpos="0 0" qvel="{} 0"/></keyframe>
</mujoco>"""
LARGE = """<mujoco model="large">
  <option timestep="{2}" integrator="RK4" solver="CG"/>
  <worldbody>
    <body name="a"><joint name="A" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 {0}" size="{1}"/>
      <body name="b" pos="0 0 {0}"><joint name="B" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 {0} 0 {1}" size="{1}"/></body></body>
    <body name="c" pos="{0} 0 0"><joint name="D" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 {0}" size="{1}"/></body>
  </worldbody>
  <default><geom contype="0" conaffinity="0"/></default>
  <equality><connect body1="c" body2="b" anchor="0 0 {0}" solref="{3} 1" solimp="0.9999 0.9999"/></equality>
  <keyframe><key qpos="0.5 -0.5 0.5"/></keyframe>
</mujoco>"""


# a mechanism that meets the conditions of a finding and has it, and one that meets them without having it
MODELS: dict[str, tuple[Scene | Path | str, Scene | str]] = {
    "dart-hinge-closure-turned": (of_findings("hinged_four_bar_turned"), of_findings("ball_four_bar")),
    "dart-hinge-closure-bennett": (of_findings("bennett"), of_findings("ball_four_bar")),
    "mjx-connect-without-velocity-term": (four_bar(), SCENES["heavy_top"]()),
    "mjx-rk4-second-order-on-balls": (SCENES["heavy_top"](), four_bar()),
    "newton-featherstone-loop-joint": (of_findings("short_four_bar"), SCENES["heavy_top"]()),
    "newton-semi-implicit-soft-joints": (of_findings("short_four_bar"), SCENES["heavy_top"]()),
    "newton-xpbd-finer-steps": (of_findings("short_four_bar"), SCENES["heavy_top"]()),
    "mujoco-sparse-jacobian-of-loops": (CHAINS, four_bar()),
    "mujoco-connect-angular-momentum": (PAIR.format(spin=20, other=5), PAIR.format(spin=0, other=-5)),
    "mujoco-implicit-feeds-energy": (CRANK.format(integrator="implicit"), CRANK.format(integrator="RK4")),
    "mujoco-polynomial-joint-equality": (CAM.format(1), CAM.format(0)),
    "mujoco-cg-depends-on-size": (LARGE.format(1000, 10, 0.01, 0.02), LARGE.format(1, 0.01, 1e-3, 2e-3)),
    "pinocchio-lcaba-distance": (moved_away(four_bar(), 100.0), four_bar()),
    "pinocchio-lcaba-typical-mu": (three_links(), four_bar()),
    "pinocchio-pgs-converged-too-early": (welded(), three_links()),
}


def test_each_finding_with_conditions_has_a_mechanism_in_these_tests():
    """A finding whose file says at which scenes it applies is tried below on the mechanisms of MODELS."""
    assert WITH.keys() == MODELS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_finding_is_named_at_a_mechanism_that_has_it_and_not_at_another_one(name, tmp_path, capsys):
    """MODELS has both mechanisms, text is MJCF with a keyframe. A finding counts if its conditions name the
    installed version, or none."""
    asked, when = WITH[name].engine, WITH[name].when
    if not installed(asked):
        pytest.skip(f"{asked} is not installed")
    applies = not when.versions or engine(asked).version() in when.versions
    for model, has_it in zip(MODELS[name], (applies, False), strict=True):
        path = model if isinstance(model, Path) else tmp_path / "scene.toml"
        if isinstance(model, Scene):
            model.save(path)
        elif isinstance(model, str):
            (path := tmp_path / "model.xml").write_text(model, encoding="utf-8")
        pose = ["--keyframe", "0"] if isinstance(model, str) else []
        status = main(["diagnose", str(path), "--engine", asked, "--json", *pose])
        (found,) = json.loads(capsys.readouterr().out)["engines"]
        named = [one["finding"] for one in found["defects"]]
        assert (name in named) == has_it and status == bool(named or found["disagreements"]), found
