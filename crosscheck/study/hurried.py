"""Runs without waiting for hopeless settings: after a run that ran out of time, finer settings of its family
are not started."""

from __future__ import annotations

from crosscheck.processes.pool import run_estimated
from crosscheck.processes.serve import failed
from crosscheck.study.grid import Case, Record, record_of
from mbref.trajectory import Outcome, Trajectory

NOT_STARTED = "not started: a coarser setting of the family reached the time limit"


class Hurried:
    """Replacement of ``run_case`` for cases that come coarse to fine in each family."""

    def __init__(self) -> None:
        self._slow: set[tuple[str, str, str]] = set()

    def __call__(self, case: Case) -> Record:
        """Return the record of a case; TIMED_OUT without a run if a coarser setting ran out of time."""
        return record_of(case, self.trajectory(case))

    def trajectory(self, case: Case) -> Trajectory:
        """Return the trajectory of a case; TIMED_OUT without a run if a coarser setting ran out of time."""
        family = case.scene.name, case.engine, case.setting.family
        if family in self._slow:
            return failed(case.engine, "", case.scene, case.setting, Outcome.TIMED_OUT, NOT_STARTED)
        run = run_estimated(case.engine, case.scene, case.times, case.setting, case.time_limit)
        if run.outcome is Outcome.TIMED_OUT:
            self._slow.add(family)
        return run
