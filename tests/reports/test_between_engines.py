"""Sections on accelerations, reactions and support, of records with known differences put in."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.judge.gauss_principle import gauss
from crosscheck.study import pictures
from crosscheck.study.grid import Case, run_case
from mbref.scenes import SCENES
from reports.blocks import Block, Moving, Table, Text
from reports.runs import SceneRuns, by_scene
from reports.sections import accelerations, crossings, reactions, support
from tests.reports.drawn import BACKGROUND, bars


@cache
def runs_of(name: str) -> SceneRuns:
    """One run as an engine's, and as another engine's whose reactions and accelerations are 1 % larger."""
    scene = SCENES[name]().with_(duration=0.01)
    run = run_case(Case(scene, np.linspace(0, 0.01, 3), "mbref", Setting("taylor", {"rtol": 1e-9})))
    first = {**run, "engine": "pinocchio"}
    second = {**first, "engine": "mujoco"}
    second["reactions"] = {j: (1.01 * np.array(w)).tolist() for j, w in first["reactions"].items()}
    larger = {name: 1.01 * np.array(body["acceleration"]) for name, body in first["bodies"].items()}
    second["bodies"] = {n: {**b, "acceleration": larger[n].tolist()} for n, b in first["bodies"].items()}
    (group,) = by_scene([first, second], {name: scene})
    return group


def cells(blocks: list[Block], table: int = 0) -> list[list[str]]:
    return [list(row) for row in [b for b in blocks if isinstance(b, Table)][table].rows]


def test_undetermined_components_are_listed_for_each_engine():
    """The five-bar has redundant rows. The second table has, for each engine, the components that they leave
    to its choice at the middle sample. Some are larger than 1 N, so they are not rounding."""
    group = runs_of("five_bar")
    blocks = reactions.render(group)
    tables = [block for block in blocks if isinstance(block, Table)]
    assert len(tables) == 2 and "choice" in tables[1].caption, [t.caption for t in tables]
    assert list(tables[1].header) == ["Joint", "pinocchio", "mujoco"], tables[1].header
    times = group.runs[0].record["times"]
    assert f"at t = {times[len(times) // 2]:.3g} s" in tables[1].caption, tables[1].caption
    shares = [[float(cell) for cell in row[1:]] for row in tables[1].rows]
    assert max(map(max, shares)) > 1, shares


def test_undetermined_components_of_rounding_size_are_called_zero():
    """The planar slider-crank has redundant rows whose components vanish by symmetry."""
    blocks = reactions.render(runs_of("planar_slider_crank_gravity"))
    assert len([block for block in blocks if isinstance(block, Table)]) == 1
    assert [b.text for b in blocks if isinstance(b, Text)] == [
        "At t = 0.005 s the components that redundancy leaves undetermined are 0 in every engine."
    ]


def test_accelerations_table_shows_the_difference_put_in():
    """MuJoCo's accelerations of centres are 1 % too large. The table shows this, in two digits, relative to
    the largest of Gauss's principle, angular accelerations included."""
    group = runs_of("planar_slider_crank_gravity")
    shown = {engine: accelerations for engine, _, accelerations, *_ in cells(accelerations.render(group))}
    exact = gauss(group.scene)
    linear = np.linalg.norm(exact[: len(group.scene.body)], axis=1).max()
    expected = 0.01 * linear / np.linalg.norm(exact, axis=1).max()
    assert shown["pinocchio"] == "< 1e-11", shown
    assert shown["mujoco"] == f"{expected:.1e}", f"put in {expected:.2e}, shown {shown}"


def test_support_section_has_a_column_for_each_engine_of_the_records():
    """Both engines declare revolute joints."""
    (table,) = [b for b in support.render([runs_of("planar_slider_crank_gravity")]) if isinstance(b, Table)]
    assert list(table.header) == ["Feature", "pinocchio", "mujoco"], table.header
    assert ("revolute joint", "✓", "✓") in table.rows, table.rows[:3]


def test_singular_positions_are_listed_with_time_branch_and_undetermined_reactions():
    """The rhombus, driven at 124.8 rad/s from π / 2, is flat at t = π / 2 / 124.8 s and three times that;
    mbref takes branch 1 there. At the first one reactions of all four joints are undetermined."""
    scene = SCENES["four_bar"]().with_(duration=0.05)
    flat = np.pi / 2 / 124.8
    record = run_case(Case(scene, np.array([0.0, flat, 0.05]), "mbref", Setting("taylor", {})))
    (group,) = by_scene([record], {scene.name: scene})
    blocks = crossings.render(group)
    listed = [(number, time, branch) for number, time, _, branch in cells(blocks)]
    assert listed == [("1", f"{flat:.8g}", "1"), ("2", f"{3 * flat:.8g}", "1")]
    assert not any(isinstance(block, Moving) for block in blocks), "a motion that was not stored is shown"
    (text,) = [block.text for block in blocks if isinstance(block, Text)]
    assert "reactions of A, B, C, D at t = 0.0125865 s" in text


@pytest.fixture(scope="module")
def parted() -> SceneRuns:
    """The driven rhombus with its motions on both branches where they part."""
    scene = SCENES["four_bar"]().with_(duration=0.05)
    case = Case(scene, np.linspace(0.0, 0.05, 3), "mbref", Setting("taylor", {"rtol": 1e-9}))
    record = run_case(case)
    (group,) = by_scene([record], {scene.name: scene}, branches=pictures.branches([(case, record)], None))
    return group


def test_both_branches_of_the_rhombus_move_side_by_side(parted):
    """Both panels show the smooth branch in the background, and their own branch in colour. The branches have
    equal poses at the start, and other poses of the coupler at the end. A line of 14 px marks the crossing,
    in the moving and in the still picture."""
    (block,) = [b for b in crossings.render(parted) if isinstance(b, Moving)]
    assert [title for title, _ in block.panels] == ["Branch 1, smooth", "Branch 2"]
    assert "position 2 at t = 0.03776 s: 2 branches. In colour" in block.caption
    assert "--branches --crossing 2" in block.caption
    smooth, fold = (svg for _, svg in block.panels)
    (behind, ahead), (also_behind, apart) = ((bars(svg, BACKGROUND), bars(svg)) for svg in (smooth, fold))
    assert len(behind) == len(apart) == 3
    for first, same, second, other in zip(behind, ahead, also_behind, apart, strict=True):
        assert (first == same).all() and (first == second).all()
        assert (first[0] == other[0]).all()
    assert (behind[1][-1] != apart[1][-1]).any()
    assert "<title>four_bar: Branch 2</title>" in fold and "<script" not in fold
    assert smooth.count("v14") == fold.count("v14") == 2


def test_branch_that_ended_early_says_so_and_stands_still(parted):
    """Branch 2 is changed to end (STEP_FAILED) with 40 samples. It has as many frames as branch 1, which are
    equal from the 40th on."""
    count, (first, second) = 40, sorted(parted.branches, key=lambda r: r["asked"]["options"]["branches"])
    bodies = {n: {k: v[:count] for k, v in body.items()} for n, body in second["bodies"].items()}
    times = second["times"][:count]
    early = {**second, "outcome": "STEP_FAILED", "t_end": times[-1], "times": times, "bodies": bodies}
    blocks = crossings.render(replace(parted, branches=[first, early]))
    (block,) = [each for each in blocks if isinstance(each, Moving)]
    assert block.panels[1][0] == f"Branch 2; ended at t = {early['t_end']:.4g} s: STEP_FAILED"
    _, coupler, _ = bars(block.panels[1][1])
    assert len(coupler) == len(first["times"]) > count + 1
    assert (coupler[count - 1] == coupler[-1]).all() and (coupler[count - 2] != coupler[count - 1]).any()


def test_scene_without_singular_positions_has_no_table_of_them():
    """The spatial slider-crank passes none in 0.01 s; the section is empty."""
    assert not crossings.render(runs_of("spatial_slider_crank_gravity"))
