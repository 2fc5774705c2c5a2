"""A run without samples is a result: it has no metrics, and commands report its outcome."""

import json
import math
from collections.abc import Iterator

import pytest

import crosscheck
from crosscheck.conformance.mechanisms.specimens import specimens
from crosscheck.judge.openings import opening
from crosscheck.processes.pool import end_idle
from mbref.motions.trajectory import Outcome, Trajectory
from tests.helpers.geared_arms import arms

FAILING = "tests.helpers.still_engines:FAILING"


@pytest.fixture(autouse=True)
def _own_children() -> Iterator[None]:
    """End the child processes that a test leaves idle."""
    yield
    end_idle()


def test_run_without_samples_has_no_metric_and_an_infinite_opening():
    """On each mechanism of the conformance suite; gap (m) and angle (rad) are infinite."""
    for scene in (each.scene for each in specimens()):
        run = Trajectory.failed(
            scene=scene.name, engine="by hand", version="", method="", settings={},
            bodies=tuple(body.name for body in scene.body), outcome=Outcome.TIMED_OUT, message="no result",
        )  # fmt: skip
        assert set(crosscheck.measure(scene, run).values()) == {None}, scene.name
        assert opening(scene, run) == (math.inf, math.inf, ()), scene.name


def test_comparison_reports_an_engine_that_crashes_before_its_first_sample():
    """Each run raises an error, and has a row, a sentence and a record, in JSON without NaN."""
    scene = arms(1.0, coupled=True).with_(duration=0.1)
    found = crosscheck.compare(scene, FAILING, samples=3, reference_time=1.0)
    assert [row["outcome"] for row in found.rows] == ["CRASHED"] and found.rows[0]["error"] is None
    assert "still completes no run" in found.verdict.right and "crashed" in str(found)
    assert json.loads(json.dumps(found.document(), allow_nan=False))["records"][0]["times"] == []
