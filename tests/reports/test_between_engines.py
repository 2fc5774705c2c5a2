"""Sections on accelerations, reactions and support / records with known differences put in."""

from __future__ import annotations

import numpy as np

from crosscheck.engine import Setting
from crosscheck.judge.gauss_principle import gauss
from crosscheck.study.grid import Case, run_case
from mbref.scenes import SCENES
from reports.blocks import Block, Table, Text
from reports.runs import SceneRuns, by_scene
from reports.sections import accelerations, crossings, reactions, support


def runs_of(name: str) -> SceneRuns:
    """One run, and a copy of it as another engine's whose reactions and accelerations are 1 % larger."""
    scene = SCENES[name]().with_(duration=0.01)
    setting = Setting("tuned", {"rtol": 1e-8, "min_step": 1e-5})
    first = run_case(Case(scene, np.linspace(0, 0.01, 3), "pinocchio", setting))
    second = {**first, "engine": "mujoco"}
    second["reactions"] = {j: (1.01 * np.array(w)).tolist() for j, w in first["reactions"].items()}
    second["bodies"] = {
        b: {**v, "acceleration": (1.01 * np.array(v["acceleration"])).tolist()}
        for b, v in first["bodies"].items()
    }
    (group,) = by_scene([first, second], {name: scene})
    return group


def cells(blocks: list[Block], table: int = 0) -> list[list[str]]:
    return [list(row) for row in [b for b in blocks if isinstance(b, Table)][table].rows]


def test_reaction_table_and_differences_put_in():
    group = runs_of("spatial_slider_crank_gravity")
    rows = cells(reactions.render(group))
    assert [row[0] for row in rows] == [*(j.name for j in group.scene.joint), "on a body"], rows
    assert max(float(row[3]) for row in rows[:-1]) == 1e-2, f"1 % put in, shown {rows}"
    assert {row[1] for row in rows} == {"0"}, f"no redundancy, open dimensions {rows}"


def test_choices_shown_where_joints_are_redundant():
    group = runs_of("planar_slider_crank_gravity")
    blocks = reactions.render(group)
    tables = [block for block in blocks if isinstance(block, Table)]
    assert len(tables) == 2 and "choice" in tables[1].caption, [t.caption for t in tables]
    assert list(tables[1].header) == ["Joint", "pinocchio", "mujoco"], tables[1].header
    times = group.runs[0].record["times"]
    assert f"at t = {times[len(times) // 2]:.3g} s" in tables[1].caption, tables[1].caption


def test_acceleration_table_and_differences_put_in():
    group = runs_of("planar_slider_crank_gravity")
    shown = {row[0]: row[2] for row in cells(accelerations.render(group))}
    exact = gauss(group.scene)
    linear = np.linalg.norm(exact[: len(group.scene.body)], axis=1).max()
    expected = 0.01 * linear / np.linalg.norm(exact, axis=1).max()
    assert shown["pinocchio"] == "< 1e-11", shown
    assert abs(float(shown["mujoco"]) / expected - 1) < 0.05, f"put in {expected:.2e}, shown {shown}"


def test_support_section_and_engines_of_the_records():
    (table,) = [b for b in support.render([runs_of("planar_slider_crank_gravity")]) if isinstance(b, Table)]
    assert list(table.header) == ["Feature", "pinocchio", "mujoco"], table.header
    assert ("revolute joint", "✓", "✓") in table.rows, table.rows[:3]


def test_singular_positions_passed_with_branches_and_reactions_left_open():
    scene = SCENES["four_bar"]().with_(duration=0.05)
    flat = 0.01258650902880526  # s, of the driven rhombus
    record = run_case(Case(scene, np.array([0.0, flat, 0.05]), "mbref", Setting("alf-dual+projection", {})))
    (group,) = by_scene([record], {scene.name: scene})
    blocks = crossings.render(group)
    assert [row[:2] for row in cells(blocks)] == [["1", "0.012586509"], ["2", "0.037759527"]]
    assert [row[3] for row in cells(blocks)] == ["1", "1"], "the smooth branch is taken"
    (text,) = [block.text for block in blocks if isinstance(block, Text)]
    assert "reactions of A, B, C, D at t = 0.0125865 s" in text


def test_no_table_of_singular_positions_where_none_is_passed():
    assert not crossings.render(runs_of("spatial_slider_crank_gravity"))
