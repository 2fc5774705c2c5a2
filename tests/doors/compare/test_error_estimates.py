"""Errors that an engine estimates itself: in records of a study, within a limit of time, or not at all."""

import json

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.processes import serve
from crosscheck.study.grid import Case, run_case
from crosscheck.study.record_view import public
from mbref.scenes import SCENES
from tests.helpers.fake_engines import FAKES, Fake

SCENE = SCENES["spatial_slider_crank_gravity"]().with_(duration=0.3)
TIMES = np.linspace(0.0, 0.3, 7)
LOOSE = Setting("mpi-svd+projection", {"rtol": 1e-4})


def test_error_that_mbref_estimates_equals_the_error_against_the_truth():
    """mbref compares runs at tolerances of 1e-4 and much less; the judge's error is equal within 0.1 %."""
    record = run_case(Case(SCENE, TIMES, "mbref", LOOSE))
    found = record["error_estimate"]
    assert found["largest"] == max(found["error"]) and len(found["error"]) == len(TIMES)
    assert found["largest"] == pytest.approx(record["metrics"]["error"], rel=1e-3)
    assert json.loads(json.dumps(public(record)))["error_estimate"]["rtol"] == 1e-4


def test_an_estimate_that_needs_more_than_its_time_is_left_out_and_the_run_is_unchanged():
    """The limit of the estimate's time is 0 s. The positions are those of a run without estimate."""
    run = serve.run_estimated("mbref", SCENE, TIMES, LOOSE, 0.0)
    found = run.to_record()["error_estimate"]
    assert found["largest"] is None and "more than 0 s" in found["reason"]
    assert np.array_equal(run.position, serve.run_once("mbref", SCENE, TIMES, LOOSE).position)


def test_an_engine_without_estimates_has_none_in_its_record():
    """FAKE is an engine that estimates no errors: ``with_error_estimate`` returns its run as it is."""
    record = run_case(Case(SCENE, TIMES, f"{FAKES}:FAKE", Setting("a", {"seconds": 0.5})))
    assert "error_estimate" not in record
    run = Fake().run(SCENE, TIMES, Setting("a", {"seconds": 0.5}))
    assert Fake().with_error_estimate(run, 1.0) is run
