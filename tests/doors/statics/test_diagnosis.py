"""Diagnosis of mechanisms of any size, and freedoms of single links / the judge, symmetry and counts."""

from __future__ import annotations

import pytest

from crosscheck.conformance.random_mechanisms import random_mechanism
from crosscheck.conformance.relations import in_other_units
from crosscheck.judge.mobility import mobility
from mbref import Scene, diagnose, find_scene
from mbref.cli.commands import main
from tests.helpers.statics import hinge, parallelogram, rod

SIZES = (1e-6, 1e-3, 1e3, 1e6)


def diagnosis_of(scene: Scene) -> tuple:
    found = diagnose(scene)
    return found.counts, found.redundant_by_joint, found.unique_reactions, found.determined_reactions


def ball_linkage(ends: tuple[str, str] = ("spherical", "spherical")) -> Scene:
    """A spatial four-bar: two cranks on hinges, and a coupler between two joints of given types."""
    bodies = [
        rod("crank", (0.0, 0.25, 0.0)),
        rod("coupler", (0.5, 0.5, 0.1)),
        rod("rocker", (1.0, 0.25, 0.1)),
    ]
    places = ((0.0, 0.5, 0.0), (1.0, 0.5, 0.2))
    joints = [
        hinge("A", ("ground", "crank")),
        hinge("D", ("ground", "rocker"), (1.0, 0.0, 0.0), (0.1, 0.0, 1.0)),
    ]
    for name, kind, pair, place in zip(
        "BC", ends, (("crank", "coupler"), ("coupler", "rocker")), places, strict=True
    ):
        axes = {"axes": [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]} if kind == "universal" else {}
        joints.append({"name": name, "type": kind, "bodies": list(pair), "anchor": list(place), **axes})
    return Scene(name="ball_linkage", body=bodies, joint=joints)


@pytest.mark.parametrize("seed", range(8))
def test_rank_and_redundancy_are_the_judges_at_every_size(seed):
    scene = random_mechanism(seed)
    truth, expected = mobility(scene), diagnosis_of(scene)
    counts = expected[0]
    assert (counts.rows, counts.redundant, counts.degrees_of_freedom) == tuple(truth)
    for size in SIZES:
        assert diagnosis_of(in_other_units(scene, size, 1.0)) == expected


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8, 220))
def test_rank_is_the_judges_on_many_mechanisms(seed):
    scene = random_mechanism(seed)
    counts = diagnose(scene).counts
    assert (counts.rows, counts.redundant, counts.degrees_of_freedom) == tuple(mobility(scene))
    scaled = in_other_units(scene, SIZES[seed % len(SIZES)], 1.0)
    assert diagnosis_of(scaled) == diagnosis_of(scene)


@pytest.mark.parametrize("name", ["planar_slider_crank", "bennett", "sarrus", "four_bar_chain"])
def test_singular_values_of_built_in_scenes_do_not_depend_on_size(name):
    scene = find_scene(name)
    values = diagnose(scene).smallest_singular_value
    for size in SIZES:
        scaled = diagnose(in_other_units(scene, size, 1.0))
        assert scaled.smallest_singular_value == pytest.approx(values, rel=1e-8)


@pytest.mark.parametrize("size", [1e-6, 0.01, 1e6])
def test_a_small_linkage_is_not_near_a_singular_position(size, tmp_path, capsys):
    """The parallelogram at 53 degrees, at any size."""
    shown = []
    for factor in (1.0, size):
        scene = in_other_units(parallelogram(0.8, 0.6), factor, 1.0).with_(duration=0.05)
        path = str(tmp_path / f"{factor}.toml")
        scene.with_(gravity=(0.0, 0.0, 0.0)).save(path)
        assert main(["diagnose", path]) == 0
        shown.append([line for line in capsys.readouterr().out.splitlines() if "singular" in line])
    assert shown[0] == shown[1] and not any("nearly" in line for line in shown[1])


def test_a_rod_between_balls_spins_about_itself(tmp_path, capsys):
    path = str(tmp_path / "balls.toml")
    ball_linkage().save(path)
    assert main(["diagnose", path, "--start"]) == 0
    shown = capsys.readouterr().out
    assert "degrees of freedom  2" in shown
    assert "coupler can spin about its own axis and moves nothing else" in shown


@pytest.mark.parametrize("welded", [True, False])
def test_welded_halves_spin_together_and_a_universal_joint_holds_the_rod(welded, tmp_path, capsys):
    scene = ball_linkage() if welded else ball_linkage(("universal", "spherical"))
    if welded:
        place = scene.body[1].position
        half = rod("half", place)
        weld = {"name": "W", "type": "fixed", "bodies": ["coupler", "half"], "anchor": list(place)}
        other = scene.joint_named("C").model_copy(update={"bodies": ("half", "rocker")})
        joints = [other if joint.name == "C" else joint for joint in scene.joint]
        scene = scene.with_(body=(*scene.body, half), joint=(*joints, weld))
    path = str(tmp_path / "rod.toml")
    scene.save(path)
    assert main(["diagnose", path, "--start"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert ("coupler and half can spin about their own axis and move nothing else" in shown) is welded
    assert ("idle freedom" in shown) is welded


def test_links_that_move_others_are_not_idle(tmp_path, capsys):
    """A parallelogram, and a chain whose last link moves nothing else because nothing follows it."""
    path = str(tmp_path / "other.toml")
    chain = Scene(
        name="chain",
        body=[rod("upper", (0.5, 0.0, 0.0)), rod("lower", (1.5, 0.0, 0.0))],
        joint=[hinge("A", ("ground", "upper")), hinge("B", ("upper", "lower"), (1.0, 0.0, 0.0))],
    )
    for scene in (parallelogram(0.8, 0.6), chain):
        scene.save(path)
        assert main(["diagnose", path, "--start"]) == 0
        assert "idle" not in capsys.readouterr().out


def test_mirrored_linkages_are_equally_far_from_a_singular_position():
    first, second = (diagnose(parallelogram(y, 0.6)).smallest_singular_value for y in (0.8, -0.8))
    assert first == pytest.approx(second, rel=1e-12)
