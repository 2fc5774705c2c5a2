"""Studies and ensembles whose processes are killed: no record is lost, none is written twice."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import kills

WHOLE = (200, 20)  # runs, kills
FEW = {"parents": (30, 2), "children": (6, 1), "workers": (6, 1)}
MOST_REPEATED = 3  # runs under way when a parent is killed: two in threads, and one that is being written


@pytest.mark.parametrize(
    ("kind", "runs", "times"),
    [*((k, *few) for k, few in FEW.items()), *(pytest.param(k, *WHOLE, marks=pytest.mark.slow) for k in FEW)],
)
def test_killed_processes_lose_no_record_and_repeat_no_finished_run(
    kind: str, runs: int, times: int, tmp_path: Path
):
    """Processes of a study or ensemble get SIGKILL at random moments; each record is then there once.

    ``kind`` is the killed process: a study's parent, an engine's child process, an ensemble's worker.
    """
    found = kills.KINDS[kind](runs, times, tmp_path)
    assert found.is_sound and found.kills == times, f"{kind}: {found}"
    assert found.made <= runs + MOST_REPEATED * times, f"{kind}: {found}: finished runs were repeated"
