"""A record keeps the beginning of an engine's long text, and its length."""

import json
from pathlib import Path

import numpy as np
import pytest

from crosscheck.conformance.runners import InProcess, Isolated
from crosscheck.engine import Setting, engine
from crosscheck.processes.pool import capabilities, end_idle, run_isolated
from crosscheck.study.grid import Case, study
from tests.helpers.still_engines import LONG, resting

TIMES, SETTING = np.array([0.0, 1.0]), Setting("plain", {})
MOST = 2000  # characters; more than any message has after it is cut


@pytest.mark.parametrize("name", ["TALKATIVE", "FAILING"])
def test_record_has_the_beginning_of_a_message_of_10_megabytes(name: str, tmp_path: Path):
    """TALKATIVE gives the text as the run's message, FAILING as the text of an error. A message in a record,
    or on a line of the file, is shorter than MOST characters, and states the length of the text."""
    case = Case(resting("rest"), TIMES, f"tests.helpers.still_engines:{name}", SETTING)
    [record] = study([case], records_path=tmp_path / "records.jsonl")
    assert LONG[:500] in record["message"] and len(record["message"]) < MOST
    stored = (tmp_path / "records.jsonl").read_text()
    assert len(stored) < 4 * MOST and json.loads(stored)["message"] == record["message"]
    assert f"{len(LONG) // 1000}" in record["message"], "the length is not stated"


@pytest.mark.parametrize("name", ["TALKATIVE", "FAILING"])
def test_message_is_cut_alike_in_this_process_and_in_a_child_process(name: str):
    """Either process keeps fewer than MOST of its 10 million characters."""
    called = f"tests.helpers.still_engines:{name}"
    own = InProcess(engine(called), called).observe(resting("rest"), TIMES, SETTING).value
    assert own.message == run_isolated(called, resting("rest"), TIMES, SETTING, 60.0).message
    assert len(own.message) < MOST
    end_idle()


def test_reason_of_10_megabytes_for_a_refusal_is_cut_to_its_beginning():
    """REFUSING gives LONG, 10 million characters; both functions that ask a child cut it alike."""
    called = "tests.helpers.still_engines:REFUSING"
    _, cannot, _ = capabilities(called, resting("rest"), 60.0)
    assert cannot is not None and len(str(cannot)) < MOST and LONG[:500] in cannot.reason
    assert Isolated(called, 60.0).refuses(resting("rest"), "plain") == cannot
    end_idle()
