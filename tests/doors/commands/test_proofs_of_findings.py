"""Scripts that prove findings: their number counts, and none outlives the command that runs it."""

from __future__ import annotations

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
from tests.doors.commands.test_proofs_of_findings import TEXTS
Finding(**TEXTS, package="numpy", script={script!r}).recheck()
"""
SLEEPER = "import os, pathlib, time; pathlib.Path({path!r}).write_text(str(os.getpid())); time.sleep(600)"
PATIENCE = 60.0  # s of waiting, on a loaded machine


def proof(script: str) -> Finding:
    return Finding(**TEXTS, package="numpy", script=script, wrong_above=1.0)


@pytest.mark.parametrize(
    ("script", "status", "says"),
    [
        ("print('error', 2.5)", Status.PRESENT, ""),
        ("print(0.5)", Status.GONE, ""),
        ("print(float('nan'))", Status.PRESENT, "nan"),
        ("print('none')", Status.UNCLEAR, "the script gave no number: none"),
        ("raise ValueError('no such joint')", Status.UNCLEAR, "no such joint"),
        ("import os; os._exit(3)", Status.UNCLEAR, "ended with exit status 3"),
    ],
)
def test_the_last_printed_number_of_a_script_decides(script: str, status: Status, says: str):
    answer = proof(script).recheck()
    assert answer.status is status and says in answer.words


def wait_for(what: Any) -> Any:
    """Return the first true result of a function within PATIENCE."""
    end = time.monotonic() + PATIENCE
    while not (found := what()) and time.monotonic() < end:
        time.sleep(0.05)
    return found


def test_killed_command_leaves_no_script(tmp_path: Path):
    """The script writes its process number and sleeps; SIGKILL ends its parent, after which it ends, too."""
    told = tmp_path / "number"
    script = SLEEPER.format(path=str(told))
    parent = subprocess.Popen([sys.executable, "-c", PARENT.format(script=script)], cwd=os.getcwd())
    number = int(wait_for(lambda: told.exists() and told.read_text()))
    parent.send_signal(signal.SIGKILL)
    parent.wait()

    def has_ended() -> bool:
        try:
            return psutil.Process(number).status() == psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return True

    assert wait_for(has_ended)
