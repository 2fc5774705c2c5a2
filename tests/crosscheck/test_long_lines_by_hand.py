"""Sentences of commands / one line each in a terminal of 80 columns, to be searched and copied."""

from __future__ import annotations

import argparse
from typing import Any

import pytest

from crosscheck.cli import commands, judging, running
from crosscheck.recorded.explanations import Explanation
from crosscheck.recorded.judgement import ColumnError, Judgement

LONG = "The truth of this mechanism is not known, " + "and ".join(["this sentence is long "] * 6).strip()


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")


@pytest.mark.parametrize("outcomes", [["COMPLETED"], ["COMPLETED", "NOT_CONVERGED"]])
def test_sentences_after_the_runs(monkeypatch, capsys, outcomes):
    """The exit status is 0 if each run completed; a run that is asked for twice is shown once."""
    found = [{"key": f"k{place}", "outcome": outcome} for place, outcome in enumerate(outcomes)]
    shown: list[Any] = []
    monkeypatch.setattr(commands, "cases_of", lambda arguments: [*range(len(outcomes)), 0])
    monkeypatch.setattr(commands, "studied", lambda cases, finished: finished.extend(reversed(found)))
    monkeypatch.setattr(commands, "key", lambda case: f"k{case}")
    monkeypatch.setattr(commands.tables, "print_runs", lambda console, records: shown.append(records))
    monkeypatch.setattr(commands, "missing_truths", lambda cases, records: [LONG])
    status = commands._run(argparse.Namespace(json=False))
    assert status == (running.COMPLETED if len(outcomes) == 1 else running.OTHERWISE)
    assert shown == [found] and capsys.readouterr().out == f"{LONG}\n"


def test_sentences_after_a_judgement(capsys):
    column = ColumnError("b.position.x", 1.0, 0.1, 0.5, 0.25)
    judging._show(Judgement((column,), (Explanation(LONG, 0.25, 1),), 2.0, LONG), [LONG])
    lines = capsys.readouterr().out.splitlines()
    assert lines[-3:] == [
        f"The reference ends at t = 2 s: {LONG}",
        f"{LONG}: 25 % of the difference remains",
        f"not read: {LONG}",
    ]
