"""Scripts that prove findings: the last number that they print decides whether the error is present."""

from typing import Any

import pytest

from crosscheck.findings.finding import Finding, Status

TEXTS: dict[str, Any] = dict.fromkeys(("name", "engine", "version", "does", "right", "cause"), "a")


@pytest.mark.parametrize(
    ("script", "status", "says"),
    [
        ("print('of 0.5, the error is', 2.5)", Status.PRESENT, ""),
        ("print(7.0); print(0.5)", Status.GONE, ""),
        ("print(float('nan'))", Status.PRESENT, ""),
        ("print('none')", Status.UNCLEAR, "the script gave no number: none"),
        ("raise ValueError('no such joint')", Status.UNCLEAR, "no such joint"),
        ("import os; os._exit(3)", Status.UNCLEAR, "ended with exit status 3"),
    ],
    ids=["above the limit", "below it", "not a number", "no number", "error", "exit status"],
)
def test_status_of_a_finding_follows_from_the_last_number_of_its_proof(script: str, status: Status, says):
    """The limit is 1. The error is present if the last printed number is larger or NaN, otherwise gone, and
    unclear, with the reason, if there is none."""
    answer = Finding(**TEXTS, package="numpy", script=script, wrong_above=1.0).recheck()
    assert answer.status is status and says in answer.words
