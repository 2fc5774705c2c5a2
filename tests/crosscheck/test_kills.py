"""Studies and ensembles whose processes are killed: no record is lost, none is written twice."""

import pytest

from tests import kills

WHOLE = (200, 20)  # runs, kills
FEW = {"parents": (30, 2), "children": (6, 1), "workers": (6, 1)}
MOST_REPEATED = 3  # runs not yet stored when a process is killed: two under way, one being written


@pytest.mark.parametrize(
    ("kind", "runs", "times"),
    [*((k, *few) for k, few in FEW.items()), *(pytest.param(k, *WHOLE, marks=pytest.mark.slow) for k in FEW)],
)
def test_killed_processes_lose_no_record_and_repeat_no_stored_run(kind, runs, times, tmp_path):
    """A study's parent, an engine's child process or an ensemble's worker gets SIGKILL ``times`` times at
    random moments; each record is then there once. A kill makes at most one record CRASHED, and at most three
    runs that were not yet stored (MOST_REPEATED) are repeated."""
    found = kills.KINDS[kind](runs, times, tmp_path)
    assert found.kills == times and found.found == found.wanted and not found.twice, f"{kind}: {found}"
    assert found.crashed <= times, f"{kind}: {found}"
    assert found.made <= runs + MOST_REPEATED * times, f"{kind}: {found}: stored runs were repeated"
