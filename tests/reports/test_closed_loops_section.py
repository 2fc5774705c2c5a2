"""The section on closed loops against cells, rows, styles and commands worked out by hand."""

import pytest

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from reports.blocks import Fold, HeatMap, Listing, Table
from reports.sections import closed_loops
from tests.helpers.stored_runs import FIRST, SECOND, measured, refused


@pytest.fixture(scope="module")
def section() -> list:
    """On the first mechanism mbref is right, MuJoCo wrong by default, Exudyn ends early and Pinocchio
    refuses; Pinocchio has a run of the second mechanism."""
    return closed_loops.render(
        [
            measured(1e-12, "taylor", "mbref"),
            measured(1e-7),
            measured(0.5, "defaults"),
            measured(None, "defaults", "exudyn", outcome="NOT_CONVERGED"),
            refused("pinocchio"),
            measured(3e-5, engine="pinocchio", scene=SECOND.scene),
        ]
    )


def maps(section: list) -> tuple[HeatMap, HeatMap]:
    best, defaults = (block for block in section if isinstance(block, HeatMap))
    return best, defaults


def test_best_cells_show_error_refusal_and_early_end(section):
    """✓ right and ≈ inaccurate have the style "kept"; – refused, ! ended early, ○ not run."""
    best, _ = maps(section)
    first = {name: (row[0].text, row[0].kind) for name, row in best.rows.items()}
    shown = ("✓ 1e-12", "kept"), ("≈ 1e-07", "kept"), ("–", ""), ("! ended", "ended")
    assert first == dict(zip(("mbref", "mujoco", "pinocchio", "exudyn"), shown, strict=True))
    assert list(best.columns) == [column.heading for column in DIFFICULTIES]
    assert [cell.text for cell in best.rows["mbref"][1:]] == ["○"] * (len(DIFFICULTIES) - 1)
    assert best.rows["pinocchio"][1].text == "≈ 3e-05"


def test_default_rows_are_the_engines_with_a_run_of_defaults(section):
    """mbref has no defaults, Pinocchio a refusal and a tuned run. A wrong run has the style "false"."""
    _, defaults = maps(section)
    shown = {name: row[0].text for name, row in defaults.rows.items()}
    assert shown == {"mujoco": "✗ 0.5", "exudyn": "! ended"}
    assert defaults.rows["mujoco"][0].kind == "false"


def test_each_engine_s_runs_are_listed_with_one_command_a_mechanism(section):
    """MuJoCo's best of two runs has the command. Exudyn failed with the message of a singular Jacobian.
    Pinocchio refused, without a command, and ran the second mechanism."""
    folds = {block.summary: block.blocks for block in section if isinstance(block, Fold)}
    table, text, commands = folds["mujoco 4.0.0"]
    assert isinstance(table, Table)
    assert [row[:2] for row in table.rows] == [(FIRST.heading, "≈ 1e-07"), (FIRST.heading, "✗ 0.5")]
    assert table.rows[0][2].startswith("tuned (step 0.001): largest error 1e-07, 0.5 s")
    assert text.text.startswith("Commands of the best runs")
    assert isinstance(commands, Listing) and len(commands.text.splitlines()) == 1
    assert commands.text.startswith(f"crosscheck run {FIRST.place()} --engine mujoco --setting tuned")
    assert "the Jacobian is singular" in folds["exudyn 4.0.0"][0].rows[0][2]
    table, _, commands = folds["pinocchio 4.0.0"]
    rows = table.rows
    assert rows[0][2] == "refused: no hinge (missing in the engine)" and len(rows) == 2
    assert len(commands.text.splitlines()) == 1, "a refusal has a command"
