"""The stored findings / their page, proofs of every kind, and installations without the engine."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from crosscheck.cli.commands import main
from crosscheck.cli.findings import chosen
from crosscheck.cli.request import RequestError
from crosscheck.findings.document import page
from crosscheck.findings.finding import FOLDER, Finding, Status, findings
from mbref.scene import Scene

DOCUMENT = Path(__file__).parents[2] / "docs" / "findings.md"


def test_document_and_generated_page() -> None:
    assert DOCUMENT.read_text() == page(), (
        "docs/findings.md is stale: python -m crosscheck.findings.document docs/findings.md renews it"
    )


def test_every_finding_has_words_and_one_proof_unless_it_ends_the_process() -> None:
    names = [found.name for found in findings()]
    assert len(names) == len(set(names)), names
    for found in findings():
        assert bool(found.script) + bool(found.scene) == (0 if found.crashes else 1), found.name
        assert found.does.endswith(".") and found.right and found.cause, found.name
        assert found.crashes or found.measured > found.wrong_above, f"{found.name} is no violation"
        if found.scene:
            Scene.from_file(FOLDER / found.scene)


def scripted(script: str, **changes: object) -> Finding:
    fields = {
        "name": "n",
        "engine": "e",
        "package": "numpy",
        "version": "1",
        "does": "d",
        "right": "r",
        "cause": "c",
        "unit": "m",
        "wrong_above": 0.5,
        "script": script,
    }
    return Finding(**{**fields, **changes})


def test_answers_of_scripts() -> None:
    answers = {
        "print(0.75)": Status.PRESENT,
        "print('noise', 0.25)": Status.GONE,
        "print(float('nan'))": Status.PRESENT,
        "raise SystemExit('no number here')": Status.UNCLEAR,
    }
    for script, status in answers.items():
        answer = scripted(script).recheck()
        assert answer.status is status and answer.version == np.__version__, (script, answer)
    assert "no number here" in scripted("raise SystemExit('no number here')").recheck().words
    ending = scripted("", crashes=True).recheck()
    assert ending.status is Status.UNCLEAR and "no proof is stored" in ending.words, ending
    absent = scripted("print(1.0)", package="no-such-package").recheck()
    assert absent.status is Status.ABSENT and "pip install no-such-package" in absent.words, absent


def test_an_unknown_finding_is_refused() -> None:
    with pytest.raises(RequestError, match="dart-hinge-closure-turned"):
        chosen(["dart-hinge-closure-turnd"])


def proofs() -> list[object]:
    """Return all findings; a finding is slow if its engine compiles code first or takes small steps."""
    slow = ("mjx", "warp", "newton", "dart-hinge-closure-fine-step", "dart-hinge-closure-turned")
    return [
        pytest.param(found.name, marks=pytest.mark.slow if {found.engine, found.name} & {*slow} else ())
        for found in findings()
    ]


@pytest.mark.parametrize("name", proofs())
def test_a_finding_and_the_installed_version(name: str) -> None:
    """At the version of the record the proof gives the record's number; later ones may be right."""
    (found,) = chosen([name])
    answer = found.recheck()
    if answer.status is Status.ABSENT:
        pytest.skip(f"{found.engine} is not installed")
    if answer.version == found.version and not found.crashes:
        assert answer.status is Status.PRESENT, answer
        if answer.measured is not None:
            assert answer.measured == pytest.approx(found.measured, rel=0.05), answer


def test_the_command_prints_status(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["findings", "dart-hinge-closure-turned", *(["--recheck"] if find_spec("dartpy") else [])]) == 0
    )
    said = capsys.readouterr().out
    assert "dart" in said and (not find_spec("dartpy") or "present" in said), said
