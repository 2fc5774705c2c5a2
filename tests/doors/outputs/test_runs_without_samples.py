"""Runs that reach no sample: their outcome is printed, their tables and files are empty, and they have no
metrics."""

import csv
import json
import math

import pytest

import crosscheck
import mbref
from crosscheck.conformance.mechanisms.specimens import specimens
from crosscheck.judge.openings import opening
from crosscheck.processes.pool import end_idle
from mbref import Motion
from mbref.cli import main
from mbref.motions.trajectory import Outcome, Trajectory
from tests.fuzz.mutations import EVERYTHING
from tests.helpers.geared_arms import arms

# redundant rows, which this method cannot solve; the shorter the motion, the sooner its advice is found
STUCK = ["planar_slider_crank", "--method", "lm1", "--duration", "0.01", "--samples", "3"]


def failed(scene: mbref.Scene) -> Trajectory:
    """Return the result of an engine that gives no sample of a scene."""
    return Trajectory.failed(
        scene=scene.name, engine="other", version="1", method="m", settings={},
        bodies=tuple(body.name for body in scene.body), outcome=Outcome.CRASHED, message="ended",
    )  # fmt: skip


@pytest.fixture(scope="module")
def stuck() -> Motion:
    """Return a run that ends before its first sample."""
    return mbref.simulate("planar_slider_crank", method="lm1", times=[0.0, 0.01])


@pytest.mark.parametrize("columns", [[], ["--columns", "slider.position", "energy"]])
@pytest.mark.parametrize("estimate", ["auto", "no"])
def test_run_that_reaches_no_sample_prints_its_outcome_and_cause(columns, estimate, capsys):
    """Redundant rows make the leading matrix of lm1 singular at the start."""
    assert main(["run", *STUCK, *columns, "--estimate", estimate]) == 1
    said = capsys.readouterr().out
    assert "SINGULAR_MATRIX at t = 0 s" in said and "the leading matrix is singular" in said


def test_files_of_a_run_without_samples_have_all_headers_and_no_rows(tmp_path, capsys):
    """The table of headers alone can be read by programs that expect its columns; so can the run's file."""
    table, whole = tmp_path / "m.csv", tmp_path / "m.json"
    assert main(["run", *STUCK, "--out", str(table)]) == 1
    rows = list(csv.reader(table.read_text().splitlines()))
    assert len(rows) == 1 and {"time", "slider.position.x", "energy"} <= set(rows[0])
    assert main(["run", *STUCK, "--out", str(whole)]) == 1
    again = Motion.load(whole)
    assert again.outcome is Outcome.SINGULAR_MATRIX and set(again.columns()) >= set(rows[0])


@pytest.mark.parametrize("columns", [[], ["--columns", "energy"]])
def test_json_of_a_run_without_samples_has_its_outcome_and_no_times(columns, capsys):
    """The run of STUCK ends at the start with a singular matrix."""
    assert main(["run", *STUCK, "--json", *columns]) == 1
    (record,) = json.loads(capsys.readouterr().out)["records"]
    assert (record["outcome"], record["times"]) == ("SINGULAR_MATRIX", [])


def test_plot_of_a_run_without_samples_is_drawn_and_its_animation_is_refused(tmp_path, capsys):
    """Axes without curves are a plot with status 1, the run's; a picture of a mechanism needs a pose."""
    assert main(["plot", *STUCK, "--out", str(tmp_path / "p.svg")]) == 1
    assert main(["animate", *STUCK, "--out", str(tmp_path / "a.svg")]) == 2
    assert "no sample to draw: the leading matrix is singular" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["p.svg"]


def test_every_array_of_a_motion_without_samples_is_empty(stuck, tmp_path):
    """Columns, energies, reactions and joint coordinates have no row; the table is a line of headers."""
    stuck.to_csv(tmp_path / "m.csv")
    assert (tmp_path / "m.csv").read_text().count("\n") == 1
    columns = stuck.columns()
    assert columns and all(values.shape == (0,) for values in columns.values())
    assert stuck.violation.position.shape == stuck.energy.shape == stuck.largest_reaction.shape == (0,)
    assert {found.shape for found in stuck.determined_reactions.values()} == {(0, 6)}
    assert stuck.reaction_maxima() == {} and stuck.joint("A").angle.shape == (0,)
    assert len(stuck.to_dataframe()) == 0


def test_motion_of_another_engine_without_samples_has_empty_columns_of_all_parts():
    """The scene has five bodies, six types of joints and four loads, of which the last two are springs."""
    scene = mbref.Scene(**EVERYTHING)
    columns = Motion.of(scene, failed(scene)).columns()
    assert all(values.shape == (0,) for values in columns.values())
    bodies = {f"{body.name}.position.x" for body in scene.body}
    parts = {"c.angle", "t.displacement", *(f"load({k}).power" for k in range(4)), "load(3).energy", "energy"}
    assert bodies | parts <= set(columns)


def test_run_without_samples_has_no_metric_and_an_infinite_opening():
    """On each mechanism of the conformance suite; gap (m) and angle (rad) are infinite."""
    for scene in (each.scene for each in specimens()):
        run = failed(scene)
        assert set(crosscheck.measure(scene, run).values()) == {None}, scene.name
        assert opening(scene, run) == (math.inf, math.inf, ()), scene.name


def test_comparison_reports_an_engine_that_crashes_before_its_first_sample():
    """Each run raises an error, and has a row, a sentence and a record, in JSON without NaN."""
    scene = arms(1.0, coupled=True).with_(duration=0.1)
    found = crosscheck.compare(scene, "tests.helpers.still_engines:FAILING", samples=3, reference_time=1.0)
    end_idle()
    assert [row["outcome"] for row in found.rows] == ["CRASHED"] and found.rows[0]["error"] is None
    assert "still completes no run" in found.verdict.right and "crashed" in str(found)
    assert json.loads(json.dumps(found.document(), allow_nan=False))["records"][0]["times"] == []
