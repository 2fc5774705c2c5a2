"""Scripts that prove findings: their number counts, and none outlives the command that runs it."""

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from crosscheck.findings.finding import Finding, Status
from tests.helpers.processes import PATIENCE, is_gone

TEXTS: dict[str, Any] = dict.fromkeys(("name", "engine", "version", "does", "right", "cause"), "a")
PARENT = """
from crosscheck.findings.finding import Finding
Finding(**{texts!r}, package="numpy", script={script!r}).recheck()
"""
SLEEPER = "import os, pathlib, time; pathlib.Path({path!r}).write_text(str(os.getpid())); time.sleep(600)"


@pytest.mark.parametrize(
    ("script", "status"),
    [
        ("print('of 0.5, the error is', 2.5)", Status.PRESENT),
        ("print(7.0); print(0.5)", Status.GONE),
        ("print(float('nan'))", Status.PRESENT),
    ],
    ids=["above the limit", "below it", "not a number"],
)
def test_engine_has_the_error_if_the_last_number_of_its_proof_exceeds_the_limit(script: str, status: Status):
    """The limit is 1. The error is present if the last printed number is larger or NaN, otherwise gone."""
    assert Finding(**TEXTS, package="numpy", script=script, wrong_above=1.0).recheck().status is status


@pytest.mark.parametrize(
    ("script", "says"),
    [
        ("print('none')", "the script gave no number: none"),
        ("raise ValueError('no such joint')", "no such joint"),
        ("import os; os._exit(3)", "ended with exit status 3"),
    ],
    ids=["no number", "error", "exit status"],
)
def test_proof_without_a_number_is_unclear_and_the_answer_has_the_reason(script: str, says: str):
    """The script prints a word, raises an error, or ends Python with status 3."""
    answer = Finding(**TEXTS, package="numpy", script=script, wrong_above=1.0).recheck()
    assert answer.status is Status.UNCLEAR and says in answer.words


def test_script_of_a_proof_ends_when_the_command_that_runs_it_is_killed(tmp_path: Path):
    """The script writes its process number and sleeps 600 s. SIGKILL ends its parent, and then the script."""
    number, end = tmp_path / "number", time.monotonic() + PATIENCE
    program = PARENT.format(texts=TEXTS, script=SLEEPER.format(path=str(number)))
    with subprocess.Popen([sys.executable, "-c", program]) as parent:
        while not (number.exists() and number.read_text()) and time.monotonic() < end:
            time.sleep(0.05)
        parent.kill()
    assert is_gone(int(number.read_text()))
