"""The sentence at the end of a run, for each status and condition."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.kernels.layout import NOT_CONVERGED, NOT_FINITE, SINGULAR, SINGULAR_AHEAD
from mbref.simulation import outcome
from mbref.stepping.loop import (
    CREEPING,
    DONE,
    LEFT_MOTION,
    STEP_TOO_SMALL,
    TOO_MANY_STEPS,
    UNDECIDED,
    VIOLATED,
)


def ended(time: float = 0.5, **changes: object) -> Any:
    """A run that ended at a time (s)."""
    clock = SimpleNamespace(time=time, violated_row=1)
    settings, counts = SimpleNamespace(nearly_dependent=False), SimpleNamespace(crossings=2)
    system = SimpleNamespace(settings=settings, counts=counts)
    equations = SimpleNamespace(rows=SimpleNamespace(phi=np.array([0.5, -0.002])), system=system)
    control = SimpleNamespace(violation=1e-3, smallest_step=1e-12)
    method = SimpleNamespace(
        is_series=False, integrator=SimpleNamespace(name="taylor"), formulation=SimpleNamespace(name="lm1")
    )
    parts = {
        "memory": SimpleNamespace(loop=SimpleNamespace(clock=clock), equations=equations, control=control),
        "model": SimpleNamespace(row_joint=["A", "B"], closed_loops=1, start="start"),
        "limits": SimpleNamespace(most_steps=7),
        "method": method,
        "ranks": SimpleNamespace(next=0.0, least=1.0),
        "start": SimpleNamespace(report=lambda: "bodies were moved", q="q"),
        "scene": SimpleNamespace(driver=()),
    }
    return SimpleNamespace(**{**parts, **changes})


@pytest.fixture
def facts(monkeypatch):
    """Facts on which the message of a run's end depends; each test changes some of them."""
    found = {"dead": False, "rest": False, "no branch": False, "advice": "", "branches": 0}
    monkeypatch.setattr(outcome, "is_at_dead_position", lambda run: found["dead"])
    monkeypatch.setattr(outcome, "begins_at_rest", lambda run: found["rest"])
    monkeypatch.setattr(outcome, "fits_no_branch", lambda run: found["no branch"])
    monkeypatch.setattr(outcome, "advice", lambda run: found["advice"])
    monkeypatch.setattr(outcome, "remedy", lambda run, status: f"remedy of {status}")
    monkeypatch.setattr(outcome, "leaving_acceleration", lambda run: found["branches"] or None)
    monkeypatch.setattr(outcome, "tangents", lambda model, q: range(found["branches"]))
    return found


@pytest.mark.parametrize(
    ("status", "cause"),
    [
        (VIOLATED, "joint 'B' is violated by 0.002, more than 0.001, at t = 0.5 s"),
        (TOO_MANY_STEPS, "7 steps were taken without reaching the end, at t = 0.5 s"),
        (CREEPING, "steps at t = 0.5 s are too short to reach the end"),
        (STEP_TOO_SMALL, "the error estimate requires a step below 1e-12 s at t = 0.5 s"),
        (
            LEFT_MOTION,
            f"{outcome.OUTCOMES[LEFT_MOTION].sentence}, as a run by another method shows, by t = 0.5 s",
        ),
        *(
            (status, f"{outcome.OUTCOMES[status].sentence} at t = 0.5 s (lm1)")
            for status in (SINGULAR, NOT_CONVERGED, NOT_FINITE, SINGULAR_AHEAD, UNDECIDED)
        ),
    ],
)
def test_the_cause_of_an_early_end_and_its_remedy(facts, status, cause):
    assert outcome._message(ended(), status) == f"{cause}; remedy of {status}"


def test_a_series_is_named_by_its_integrator(facts):
    run = ended()
    run.method.is_series = True
    assert " (taylor); " in outcome._message(run, SINGULAR)


@pytest.mark.parametrize(
    ("status", "time", "rest", "no_branch", "says"),
    [
        (UNDECIDED, 0.0, True, True, outcome.REST_POSITION),
        (UNDECIDED, 0.0, False, True, outcome.NO_BRANCH),
        (UNDECIDED, 0.0, False, False, " (lm1); remedy of "),
        (UNDECIDED, 1e-9, True, True, " (lm1); remedy of "),
        (SINGULAR, 0.0, True, True, " (lm1); remedy of "),
    ],
)
def test_a_start_that_cannot_be_decided(facts, status, time, rest, no_branch, says):
    facts.update({"rest": rest, "no branch": no_branch})
    assert says in outcome._message(ended(time), status)


def test_drivers_at_a_dead_position(facts):
    facts["dead"] = True
    assert outcome._message(ended(), SINGULAR).startswith("the drivers come to a dead position at t = 0.5 s,")
    assert "dead position" not in outcome._message(ended(), DONE)


def test_the_report_of_a_run_that_ended_well(facts):
    assert outcome._message(ended(), DONE) == "bodies were moved; singular positions passed: 2"
    run = ended()
    run.start.report, run.memory.equations.system.counts.crossings = (lambda: ""), 0
    assert outcome._message(run, DONE) == ""
    facts.update({"rest": True, "branches": 3})
    assert outcome._message(run, DONE) == outcome.LEAVES_REST.format(3)
    facts["branches"] = 0
    assert outcome._message(run, DONE) == ""


def test_rows_that_are_dependent_to_rounding(facts):
    run = ended(ranks=SimpleNamespace(next=2 * outcome.ROUNDED, least=0.0))
    assert outcome.REDUNDANT.format(2 * outcome.ROUNDED) in outcome._message(run, SINGULAR)
    nearly = outcome.NEARLY_DEPENDENT.format(0.0)
    assert nearly in outcome._message(run, DONE), "at the end"
    run.ranks.next = outcome.ROUNDED
    assert outcome.REDUNDANT.split("{")[0] not in outcome._message(run, SINGULAR), "as large as rounding"
    run.ranks.least = outcome.NEARLY
    assert outcome.NEARLY_DEPENDENT.split("{")[0] not in outcome._message(run, DONE), (
        "not less than the limit"
    )


@pytest.mark.parametrize(
    ("time", "loops", "driver", "hints"),
    [(0.0, 1, (), 2), (0.0, 0, (), 1), (0.0, 1, ("d",), 1), (0.1, 1, (), 0)],
)
def test_a_start_with_nearly_dependent_rows(facts, time, loops, driver, hints):
    """The hint to turn the mechanism is of loops without drivers."""
    run = ended(time, scene=SimpleNamespace(driver=driver), ranks=SimpleNamespace(next=0.0, least=1e-9))
    run.memory.equations.system.settings.nearly_dependent, run.model.closed_loops = True, loops
    message = outcome._message(run, SINGULAR)
    assert (outcome.NEARLY_DEPENDENT.format(1e-9) in message) is (hints > 0)
    assert (outcome.NEAR_SINGULAR_HINT.format(outcome.NEARLY) in message) is (hints > 1)
    assert ("remedy of" in message) is (hints == 0)


def test_advice_on_rounded_numbers_comes_before_other_remedies(facts):
    facts["advice"] = "give more digits"
    for status in outcome.OUTCOMES:
        if status != DONE:
            expected = "give more digits" if status in outcome.OF_ROUNDING else f"remedy of {status}"
            assert outcome._message(ended(), status).endswith(expected), status
