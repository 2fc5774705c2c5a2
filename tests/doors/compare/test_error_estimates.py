"""Errors that an engine estimates itself: in records of a study, within a limit of time, or not at all."""

import numpy as np

from crosscheck.engine import Setting
from crosscheck.study.grid import Case, run_case
from mbref.scenes import SCENES
from tests.helpers.fake_engines import FAKES, Fake

SCENE = SCENES["spatial_slider_crank_gravity"]().with_(duration=0.3)
TIMES = np.linspace(0.0, 0.3, 7)


def test_an_engine_without_estimates_has_none_in_its_record():
    """FAKE is an engine that estimates no errors: ``with_error_estimate`` returns its run as it is."""
    record = run_case(Case(SCENE, TIMES, f"{FAKES}:FAKE", Setting("a", {"seconds": 0.5})))
    assert "error_estimate" not in record
    run = Fake().run(SCENE, TIMES, Setting("a", {"seconds": 0.5}))
    assert Fake().with_error_estimate(run, 1.0) is run
