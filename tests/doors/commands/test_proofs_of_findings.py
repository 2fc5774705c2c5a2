"""Scripts that prove findings: their number counts, and none outlives the command that runs it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from crosscheck.findings.finding import Finding, Status

TEXTS: dict[str, Any] = dict.fromkeys(("name", "engine", "version", "does", "right", "cause"), "a")
PARENT = """
from crosscheck.findings.finding import Finding
Finding(**{texts!r}, package="numpy", script={script!r}).recheck()
"""
SLEEPER = "import os, pathlib, time; pathlib.Path({path!r}).write_text(str(os.getpid())); time.sleep(600)"
PATIENCE = 60.0  # s of waiting, on a loaded machine


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


def wait_for(what: Any) -> Any:
    """Return the first true result of a function within PATIENCE."""
    end = time.monotonic() + PATIENCE
    while not (found := what()) and time.monotonic() < end:
        time.sleep(0.05)
    return found


def test_script_of_a_proof_ends_when_the_command_that_runs_it_is_killed(tmp_path: Path):
    """The script writes its process number and sleeps 600 s. SIGKILL ends its parent; then the script's
    process ends, too, within PATIENCE and so long before its sleep is over."""
    pid_file = tmp_path / "number"
    script = SLEEPER.format(path=str(pid_file))
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT.format(texts=TEXTS, script=script)], cwd=os.getcwd()
    )
    number = int(wait_for(lambda: pid_file.exists() and pid_file.read_text()))
    parent.send_signal(signal.SIGKILL)
    parent.wait()

    def has_ended() -> bool:
        try:
            return psutil.Process(number).status() == psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return True

    assert wait_for(has_ended)
