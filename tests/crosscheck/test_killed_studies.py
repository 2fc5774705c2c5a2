"""A study that is killed again and again: no record is lost, none is written twice."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PROGRAM = """
import sys
sys.path[:0] = [{root!r}, {here!r}]
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from crosscheck.engine import Setting
from crosscheck.study.grid import Case, run_here, study
from mbref.scene import Body, Scene

block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
scene = Scene(name={log!r}, body=(block,))
times = np.array([0.0, 0.1, 0.3])
settings = [Setting(str(k), {{"sleep": 0.005}}) for k in range({runs})]
cases = [Case(scene, times, "fake_engines:RECORDER", setting) for setting in settings]
study(cases, ThreadPoolExecutor(2), {path!r}, run=run_here)
"""


@pytest.mark.parametrize(("runs", "times"), [(60, 4), pytest.param(200, 20, marks=pytest.mark.slow)])
def test_kills_of_a_study_lose_nothing(runs: int, times: int, tmp_path: Path):
    path, log = tmp_path / "records.jsonl", tmp_path / "log"
    program = PROGRAM.format(
        root=str(HERE.parents[1]), here=str(HERE), runs=runs, path=str(path), log=str(log)
    )
    draw = random.Random(3)
    kills, whole = 0, 0
    for _ in range(times):
        study = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
        goal = whole + draw.randint(1, 9)  # lines, after which the study is killed at once
        while study.poll() is None and (path.read_bytes().count(b"\n") if path.exists() else 0) < goal:
            time.sleep(draw.uniform(0.0, 0.002))
        if study.poll() is None:
            os.kill(study.pid, signal.SIGKILL)
            kills += 1
        study.wait()
        now = path.read_bytes().count(b"\n")
        assert now >= whole, "a record was lost"
        whole = now
    subprocess.run([sys.executable, "-c", program], check=True)
    keys = [json.loads(line)["key"] for line in path.read_text().splitlines()]
    assert len(keys) == len(set(keys)) == runs, "a record was lost, or written twice"
    assert kills == times, f"only {kills} of the studies were killed before their end"
    ran = len(log.read_text().splitlines())
    assert ran <= runs + 3 * times, f"{ran} runs for {runs} records: more than those under way were repeated"
