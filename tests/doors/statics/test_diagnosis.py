"""Diagnosis of mechanisms: counts that the judge finds, at every size, and links that spin idly."""

from pathlib import Path

import numpy as np
import pytest

import mbref
from crosscheck.conformance.changes.units import in_other_units
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from crosscheck.judge.mobility import mobility
from crosscheck.judge.truth import closed_form
from mbref import Scene, diagnose, exchanges, find_scene
from mbref.cli.commands import main
from mbref.scenes.four_bar import four_bar_gravity
from tests.helpers.statics import ball_linkage, hinge, parallelogram, rod

SIZES = (1e-6, 1e-3, 1e3, 1e6)


def diagnosis_of(scene: Scene) -> tuple:
    found = diagnose(scene)
    return found.counts, found.redundant_by_joint, found.unique_reactions, found.determined_reactions


@pytest.mark.parametrize("seed", [pytest.param(k, marks=[pytest.mark.slow] * (k > 7)) for k in range(80)])
def test_rows_redundancy_and_freedoms_equal_the_judges_in_every_unit_of_length(seed):
    """The judge's `mobility` finds ranks by singular values. In other units the diagnosis is equal, with the
    joints of redundant rows and the reactions that are determined."""
    scene = random_mechanism(seed)
    truth, expected = mobility(scene), diagnosis_of(scene)
    counts = expected[0]
    assert (counts.rows, counts.redundant, counts.degrees_of_freedom) == tuple(truth)
    for size in SIZES:
        assert diagnosis_of(in_other_units(scene, size, 1.0)) == expected


@pytest.mark.parametrize("name", ["planar_slider_crank", "bennett", "sarrus", "four_bar_chain"])
def test_smallest_singular_value_of_built_in_scenes_does_not_depend_on_size(name):
    """The value has no unit, as rows are relative to the mechanism's length. Rounding is below 1e-8 of it."""
    scene = find_scene(name)
    value = diagnose(scene).smallest_singular_value
    for size in SIZES:
        scaled = diagnose(in_other_units(scene, size, 1.0))
        assert scaled.smallest_singular_value == pytest.approx(value, rel=1e-8)


@pytest.mark.parametrize("size", [1e-6, 0.01, 1e6])
def test_diagnose_prints_at_every_size_that_a_linkage_stays_away_from_singularity(size, tmp_path, capsys):
    """A parallelogram of links of 1 m times the size rests without gravity, its crank at 53 degrees: far from
    its flat, singular positions. Lines with "singular" are the same at every size."""
    shown = []
    for factor in (1.0, size):
        scene = in_other_units(parallelogram(sine=0.8, cosine=0.6), factor, 1.0).with_(duration=0.05)
        path = str(tmp_path / f"{factor}.toml")
        scene.with_(gravity=(0.0, 0.0, 0.0)).save(path)
        assert main(["diagnose", path]) == 0
        shown.append([line for line in capsys.readouterr().out.splitlines() if "singular" in line])
    assert shown[0] == shown[1] != [] and not any("nearly" in line for line in shown[1])


def printed(scene: Scene, folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return what ``mbref diagnose --start`` prints, with single blanks."""
    scene.save(folder / "scene.toml")
    assert main(["diagnose", str(folder / "scene.toml"), "--start"]) == 0
    return " ".join(capsys.readouterr().out.split())


def test_diagnosis_lists_the_three_crossings_of_a_swinging_rhombus():
    """A rhombus is flat, and so singular, where its crank is level. Released at 0.3 rad, the crank swings
    down through 0 to -π, turns back at -π - 0.3 rad and is at -π again within 1 s. The closed form has its
    height y at the samples, which changes sign three times, and at the crossings, where it is zero."""
    scene = four_bar_gravity(0.3)
    crossings, exact = mbref.along_motion(scene).crossings, closed_form(scene)
    assert [each.sentence for each in crossings] == ["2 branches"] * 3
    height = exact.poses(np.linspace(0.0, 1.0, 201)).position[:, 0, 1]  # m, of the crank
    assert np.count_nonzero(np.diff(np.sign(height))) == 3
    level = exact.poses([each.time for each in crossings]).position[:, 0, 1]
    assert np.abs(level).max() < 1e-9  # m; rtol of the motion


def test_each_exchange_of_a_hinge_ends_the_redundancy_and_keeps_the_freedom_by_the_judge():
    """The judge's `mobility` counts rows, redundant rows and freedoms. Four parallel hinges have 20 rows for
    18 coordinates of three links and leave one freedom: 20 - (18 - 1) = 3 rows are redundant. An exchange
    ends the redundancy if none is left, and the freedom is still one."""
    scene = parallelogram(sine=0.8, cosine=0.6)
    found = exchanges(scene)
    assert tuple(mobility(scene)) == (20, 3, 1) and {"A": "inline"} in found
    for exchange in found:
        dumped = [joint.model_dump(exclude={"armature", "stop"}) for joint in scene.joint]
        joints = [{**each, "type": exchange.get(each["name"], each["type"])} for each in dumped]
        assert mobility(scene.with_(joint=joints))[1:] == (0, 1), exchange


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
def test_rod_between_two_ball_joints_is_named_as_spinning_idly_about_its_axis(size, tmp_path, capsys):
    """The linkage has two freedoms: one of its motion and the spin of the coupler."""
    shown = printed(in_other_units(ball_linkage(), size, 1.0), tmp_path, capsys)
    assert "degrees of freedom 2" in shown
    assert "coupler can spin about its own axis and moves nothing else" in shown


def test_welded_halves_of_a_rod_between_two_ball_joints_are_named_together(tmp_path, capsys):
    """The coupler is a rod of two halves, welded in its middle."""
    scene = ball_linkage()
    place = scene.body[1].position
    weld = {"name": "W", "type": "fixed", "bodies": ["coupler", "half"], "anchor": list(place)}
    other = scene.joint_named("C").model_copy(update={"bodies": ("half", "rocker")})
    joints = [other if joint.name == "C" else joint for joint in scene.joint]
    scene = scene.with_(body=(*scene.body, rod("half", place)), joint=(*joints, weld))
    shown = printed(scene, tmp_path, capsys)
    assert "coupler and half can spin about their own axis and move nothing else" in shown


@pytest.mark.parametrize(
    ("kind", "says"),
    [("translational", "can slide between its joints"), ("cylindrical", "can move alone in 2 ways")],
)
def test_sleeve_between_two_parallel_guides_is_named_with_its_ways_to_move(kind, says, tmp_path, capsys):
    """The sleeve is on a guide of the ground, and the lever on a guide of the sleeve, along the same line.
    The lever's hinge is perpendicular to it, so that the guides hold the lever: the sleeve moves alone, by
    sliding, and by turning where the guides are cylindrical."""
    guide = {"type": kind, "axis": [1.0, 0.0, 0.0]}
    joints = [
        {"name": "G", "bodies": ["ground", "sleeve"], "anchor": [0.0, 0.0, 0.0], **guide},
        {"name": "L", "bodies": ["sleeve", "lever"], "anchor": [0.4, 0.0, 0.0], **guide},
        hinge("A", ("ground", "lever"), (1.0, 0.0, 0.0)),
    ]
    bodies = [rod("sleeve", (0.2, 0.0, 0.0)), rod("lever", (1.0, 0.3, 0.0))]
    shown = printed(Scene(name="sleeve", body=bodies, joint=joints), tmp_path, capsys)
    assert f"sleeve {says}" in shown and "moves nothing else" in shown


RODS = [rod("upper", (0.5, 0.0, 0.0)), rod("lower", (1.5, 0.0, 0.0))]
PINS = [hinge("A", ("ground", "upper")), hinge("B", ("upper", "lower"), (1.0, 0.0, 0.0))]
CHAIN = Scene(name="chain", body=RODS, joint=PINS)

SPRUNG = CHAIN.with_(
    joint=[
        *CHAIN.joint,
        {"name": "F", "type": "free", "bodies": ["ground", "lower"], "anchor": [2, 0, 0], "axis": [1, 0, 0]},
    ],
    load=[{"type": "slide_spring", "joint": "F", "stiffness": 10.0}],
)


@pytest.mark.parametrize(
    "scene",
    [ball_linkage(("universal", "spherical")), parallelogram(sine=0.8, cosine=0.6), CHAIN, SPRUNG],
    ids=["rod held by a universal joint", "parallelogram", "last link of a chain", "spring along a line"],
)
def test_no_idle_freedom_is_named_where_no_rod_spins(scene, tmp_path, capsys):
    """A universal joint holds the rod. Links of a parallelogram move only together. The last link of a chain
    moves nothing else, but does not spin; nor does one whose end has a free joint, for a spring."""
    assert mbref.idle_freedoms(scene) == []
    assert "else" not in printed(scene, tmp_path, capsys)  # "moves nothing else", "move nothing else"
