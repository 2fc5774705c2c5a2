"""The table of closed loops: its mechanisms, the cells of records, and the committed page."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.closed_loops import records
from crosscheck.closed_loops.matrix import LEGEND, matrix, rerun, sentence, shown
from crosscheck.closed_loops.mechanisms import DIFFICULTIES, ROOT
from crosscheck.judge.truth import truth_for
from mbref.scenes import find_scene
from tests.helpers.stored_runs import FIRST, measured, refused


@pytest.mark.parametrize("column", DIFFICULTIES, ids=lambda column: column.heading)
def test_every_mechanism_of_the_table_is_found_by_its_name_and_has_a_truth(column) -> None:
    """The name is of a built-in scene or a file; the truth is a closed form or the reference."""
    scene = column.make()
    place = column.place()
    found = find_scene(str(ROOT / place) if place.endswith(".toml") else place)
    assert found.with_(duration=column.end) == scene and scene.name == column.scene
    assert truth_for(scene) is not None


def test_column_turned_has_the_four_bar_rotated_by_seven_tenths_of_a_radian() -> None:
    """The least-squares rotation (Kabsch) of the anchors and axes of "four-bar" maps all of them onto the
    column "turned", to rounding, and has the angle 0.7 rad of the column's description."""
    by_heading = {column.heading: column.make() for column in DIFFICULTIES}
    scenes = (by_heading[name] for name in ("four-bar", "turned"))
    vectors = ([[joint.anchor, joint.axis] for joint in scene.joint] for scene in scenes)
    plain, turned = (np.array(each).reshape(-1, 3) for each in vectors)
    rotation, _ = Rotation.align_vectors(turned, plain)
    assert rotation.apply(plain) == pytest.approx(turned, abs=1e-12)
    assert rotation.magnitude() == pytest.approx(0.7, rel=1e-9)


@pytest.mark.parametrize(
    ("record", "text"),
    [
        (measured(9.9e-9), "✓ 1e-08"),
        (measured(1.1e-8), "≈ 1e-08"),
        (measured(9.9e-3), "≈ 1e-02"),
        (measured(0.0101), "✗ 0.01"),
        (measured(0.9512), "✗ 0.95"),
        (measured(1e-13, metrics={"error": 1e-13, "error_bound": 2e-12}), "✓ <2e-12"),
        (measured(None, outcome="STEP_FAILED"), "! ended"),
        (measured(None, outcome="CRASHED"), "! crashed"),
        (measured(None, outcome="TIMED_OUT"), "! no end"),
        (refused(), "–"),
        (None, "○"),
    ],
)
def test_cell_shows_the_grade_and_the_error_of_a_run(record, text) -> None:
    """Right ✓ up to 1e-8, close ≈ up to 1e-2, wrong ✗ above, ! with the end of the run, – refused, ○ no
    record; a line of the legend begins with each sign. Errors up to 1e-2 have one digit and a power of ten,
    larger ones two decimals. An error below the bound of the truth's own error shows as below that bound."""
    assert shown(record) == text and text[0] in {sign[0] for sign in LEGEND}


def test_cell_has_the_run_of_least_error_and_the_run_of_the_defaults() -> None:
    """Of four runs of the first mechanism, the second has the least error, and the first is of the family
    "defaults". The mechanism "Bennett" has no runs."""
    crashed = measured(None, "other", outcome="CRASHED")
    found = [measured(1e-3, "defaults"), measured(1e-9), measured(1e-5, "euler"), crashed]
    cell = matrix(found)["mujoco"][FIRST.heading]
    assert cell.best() is found[1] and cell.defaults() is found[0]
    assert list(cell.families()) == ["defaults", "tuned", "euler", "other"]
    assert matrix(found)["mujoco"]["Bennett"].best() is None


def test_sentence_on_a_refusal_names_its_reason_and_no_command_repeats_it() -> None:
    """The cell's only record is the refusal by an engine that lacks hinges. It stands for the best run and
    for the defaults; it has no family and no command."""
    cell = matrix([refused()])["mujoco"][FIRST.heading]
    [refusal] = cell.records
    assert cell.best() is refusal and cell.defaults() is refusal and not cell.families()
    assert sentence(refusal) == "refused: no hinge (missing in the engine)"
    assert rerun(refusal) == ""


def test_runs_whose_loops_crosscheck_closes_have_a_row_of_their_own() -> None:
    """In the family `terms` Drake gives only the terms of its equations, and crosscheck closes the loops; in
    `discrete` Drake closes them. The default scene of `measured` is the one under "four-bar"."""
    by_drake, by_crosscheck = measured(1e-3, "discrete", "drake"), measured(1e-11, "terms", "drake")
    rows = matrix([by_drake, by_crosscheck])
    assert list(rows) == ["drake", "drake, terms"]
    assert rows["drake"]["four-bar"].best() is by_drake
    assert rows["drake, terms"]["four-bar"].best() is by_crosscheck


def test_new_record_replaces_the_same_run_runs_of_an_older_version_and_a_refusal() -> None:
    """The new record is a run by MuJoCo 4.0.0 on the first mechanism, or MuJoCo's refusal of it. A table has
    one version of an engine, and either runs or a refusal for a mechanism."""
    new = measured(1e-9)
    replaced = {"same run": measured(1e-9), "refusal": refused()}
    replaced |= {"older version": measured(1e-3, "defaults", version="3.0.0")}
    kept = {"other family": measured(1e-3, "defaults")}
    kept |= {"other mechanism": measured(1e-3, scene="bennett", version="3.0.0")}
    assert [name for name, old in replaced.items() if not records.supersedes(new, old)] == []
    assert [name for name, old in kept.items() if records.supersedes(new, old)] == []
    assert records.supersedes(refused(), new)
