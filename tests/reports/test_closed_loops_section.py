"""The section on closed loops / cells, rows, depths of colour and commands worked out by hand."""

from __future__ import annotations

import pytest

from crosscheck.closed_loops import records
from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.study.store import REFUSED
from reports.blocks import Fold, HeatMap, Listing, Table
from reports.sections import closed_loops

FIRST, SECOND = DIFFICULTIES[:2]


def run(engine: str, error: float, family: str = "tuned", scene: str = FIRST.scene, **more: object) -> dict:
    return {
        "key": f"{engine} {family} {error} {scene}",
        "scene": scene,
        "engine": engine,
        "version": f"{engine} 1",
        "family": family,
        "asked": {"engine": engine, "options": {"step": 1e-3}, "end": 1.0, "samples": 21},
        "time_limit": records.TIME_LIMIT,
        "outcome": "COMPLETED",
        "message": "",
        "t_end": 1.0,
        "metrics": {"error": error},
        "cost": {"seconds": 0.5},
        **more,
    }


def refusal(engine: str, scene: str = FIRST.scene) -> dict:
    found = {"outcome": REFUSED, "message": "no hinge", "owner": "missing in the engine"}
    return {**run(engine, 0.0, scene=scene), **found, "metrics": {}}


@pytest.fixture(scope="module")
def section() -> list:
    """On the first mechanism mbref is right, MuJoCo wrong by default, Exudyn ends early and Pinocchio
    refuses; Pinocchio has a run of the second mechanism."""
    ended = {"outcome": "NOT_CONVERGED", "t_end": 0.25, "message": "no step", "metrics": {}}
    return closed_loops.render(
        [
            run("mbref", 1e-12, "taylor"),
            run("mujoco", 1e-7),
            run("mujoco", 0.5, "defaults"),
            run("exudyn", 0.0, "defaults", **ended),
            refusal("pinocchio"),
            run("pinocchio", 3e-5, scene=SECOND.scene),
        ]
    )


def maps(section: list) -> tuple[HeatMap, HeatMap]:
    best, defaults = (block for block in section if isinstance(block, HeatMap))
    return best, defaults


def test_best_cells_show_error_refusal_and_early_end(section):
    """✓ right, ≈ inaccurate, – refused, ! ended early, ○ not run."""
    best, _ = maps(section)
    first = {name: (row[0].text, row[0].kind) for name, row in best.rows.items()}
    assert first == {
        "mbref": ("✓ 1e-12", "kept"),
        "mujoco": ("≈ 1e-07", "kept"),
        "pinocchio": ("–", ""),
        "exudyn": ("! ended", "ended"),
    }
    assert list(best.columns) == [column.heading for column in DIFFICULTIES]
    assert [cell.text for cell in best.rows["mbref"][1:]] == ["○"] * (len(DIFFICULTIES) - 1)
    assert best.rows["pinocchio"][1].text == "≈ 3e-05"


def test_default_rows_are_the_engines_with_a_run_of_defaults(section):
    """mbref has no defaults, and Pinocchio refuses one scene and has a tuned run of another."""
    _, defaults = maps(section)
    assert {name: row[0].text for name, row in defaults.rows.items()} == {
        "mujoco": "✗ 0.5",
        "exudyn": "! ended",
    }
    assert defaults.rows["mujoco"][0].kind == "false"


def test_each_engine_s_runs_are_listed_with_one_command_a_mechanism(section):
    folds = {block.summary: block.blocks for block in section if isinstance(block, Fold)}
    table, text, commands = folds["mujoco mujoco 1"]
    assert isinstance(table, Table)
    assert [row[:2] for row in table.rows] == [(FIRST.heading, "≈ 1e-07"), (FIRST.heading, "✗ 0.5")]
    assert table.rows[0][2].startswith("tuned (step 0.001): largest error 1e-07, 0.5 s")
    assert text.text.startswith("Commands of the best runs")
    assert isinstance(commands, Listing) and "--engine mujoco" in commands.text
    assert len(commands.text.splitlines()) == 1 and "tuned" in commands.text
    table, _, commands = folds["pinocchio pinocchio 1"]
    rows = table.rows
    assert rows[0][2] == "refused: no hinge (missing in the engine)" and len(rows) == 2
    assert len(commands.text.splitlines()) == 1, "a refusal has a command"
