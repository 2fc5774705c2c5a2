"""The stability section: counts, cells and colours worked out by hand from records with known errors."""

import math
from pathlib import Path

import pytest

from crosscheck.cli.collection import stored_ladders
from crosscheck.study import stability
from mbref.records import rewrite
from reports import __main__ as program
from reports.blocks import HeatMap, Table, Text
from reports.render import html, markdown
from reports.sections import stability as section

STORED = Path(__file__).parents[2] / "reports" / "stability"


def record(ladder, difficulty, error, outcome="COMPLETED", engine="mbref", family="taylor"):
    named = {"scene": stability.scene_name(ladder, difficulty), "engine": engine, "family": family}
    return {**named, "outcome": outcome, "metrics": {"error": error}}


def test_stability_table_counts_right_ended_and_wrong_runs(snapshot):
    """Of mbref, 1e-9 is right, UNDECIDED ended early, and 2e-6 and NaN are wrong; of MuJoCo, 5e-3 is right
    and 0.5 is wrong, by the limit for other engines. The sentences are those of the snapshot."""
    records = [
        record("gap", 1e-1, 1e-9),
        record("gap", 3e-3, 2e-6),
        record("gap", 1e-4, 3.0, "UNDECIDED"),
        record("units", 1e-6, math.nan),
        record("gap", 1e-1, 5e-3, engine="mujoco", family="projected"),
        record("gap", 3e-3, 0.5, engine="mujoco", family="projected"),
    ]
    blocks = section.render(records)
    (table,) = [b for b in blocks if isinstance(b, Table)]
    counted = ("mbref", "taylor", "1", "1", "2"), ("mujoco", "projected", "1", "0", "1")
    assert [tuple(row) for row in table.rows] == [*counted]
    assert [b.text for b in blocks if isinstance(b, Text)][:2] == snapshot


def test_sentence_says_if_no_other_method_completes_a_wrong_motion():
    """Both runs, by taylor and by mpi-svd+none, have an error of 1e-9, which is right."""
    records = [record("gap", 1e-1, 1e-9), record("gap", 1e-1, 1e-9, family="mpi-svd+none")]
    sentences = [b.text for b in section.render(records) if isinstance(b, Text)]
    assert sentences[1] == (
        "Of the others, mpi-svd+none is right most often (1 of 1 runs), and none completes a wrong motion."
    )


def test_stability_section_is_rendered_from_stored_records_and_names_their_missing_file(tmp_path, capsys):
    """The first stored record, by alf+baumgarte, is right to 9 digits."""
    assert program.main(["--section", "stability", "--render", str(tmp_path)]) == 2
    assert "stability.jsonl" in capsys.readouterr().err
    rewrite(tmp_path / stability.FILE, stored_ladders(STORED)[:1])
    assert program.main(["--section", "stability", "--render", str(tmp_path)]) == 0
    assert "| alf+baumgarte | 9 |" in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("error", "outcome", "text", "red"),
    [
        (1e-9, "COMPLETED", "9", False),
        (3e-16, "COMPLETED", "15", False),
        (2.0, "COMPLETED", "0", True),
        (1.0, "LEFT_MOTION", "m", False),
        (1.0, "SINGULAR_MATRIX", "a", False),
    ],
)
def test_stability_cell_shows_correct_digits_or_the_letter_of_the_end(error, outcome, text, red):
    """Digits are -log10 of the error, rounded down; m left its motion, a has a singular matrix. A completed
    run of a wrong motion is red on the page and bold in Markdown. The only record is of gap 0.1 m, the first
    column; the others are empty."""
    blocks = section.render([record("gap", 1e-1, error, outcome)])
    (heat,) = [b for b in blocks if isinstance(b, HeatMap)]
    cell, *others = heat.rows["taylor"]
    assert cell.text == text and (cell.kind == "false") is red
    assert {other.text for other in others} == {""} and len(others) + 1 == len(heat.columns)
    assert heat.label == "gap, m" and heat.columns[0] == "0.1"
    assert f"| taylor | {'**' * red}{text}{'**' * red} |" in markdown(blocks)
    assert "gap, m →" in html(blocks, {})
