"""Scripts that prove findings: their number counts, and none outlives the command that runs it."""

from typing import Any

import pytest

from crosscheck.findings.finding import Finding, Status

TEXTS: dict[str, Any] = dict.fromkeys(("name", "engine", "version", "does", "right", "cause"), "a")


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
