"""Findings in other libraries: their page, their proofs, and their status at the installed version."""

import lzma
import math
import re
import zipfile
from pathlib import Path

import pytest

from crosscheck.cli.commands import main
from crosscheck.cli.findings import chosen
from crosscheck.cli.request import RequestError
from crosscheck.files.corpus import CASES
from crosscheck.files.public import FILE as PUBLIC
from crosscheck.files.records import read
from crosscheck.findings.finding import FOLDER, Finding, Status, findings
from mbref.scene import Scene

ROOT = Path(__file__).parents[3]
RECORDS = sorted({*ROOT.glob("crosscheck/*/*.xz"), *ROOT.glob("reports/*/records.zip")} - {PUBLIC})


def test_every_finding_has_sentences_and_a_violation_measured_by_one_proof() -> None:
    """A proof is a script or a scene; a finding that ends the engine's process has none. A stored number is
    a violation if it is above the finding's limit, or NaN."""
    names = [found.name for found in findings()]
    assert len(names) == len(set(names)), names
    for found in findings():
        assert bool(found.script) + bool(found.scene) == (0 if found.crashes else 1), found.name
        assert found.does.endswith(".") and found.right and found.cause, found.name
        assert found.crashes or not found.measured <= found.wrong_above, f"{found.name} is no violation"
        if found.scene:
            Scene.from_file(FOLDER / found.scene)


@pytest.mark.parametrize("path", RECORDS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_no_stored_run_ended_the_process_of_its_engine(path: Path) -> None:
    """A run that ended its process has the message "ended by SIG…"; who repeats it by its record loses the
    process. Records of public files (PUBLIC), which only name files, are left out."""
    content = lzma.decompress(path.read_bytes()) if path.suffix == ".xz" else b""
    if not content:
        with zipfile.ZipFile(path) as pack:
            content = b"".join(map(pack.read, pack.namelist()))
    assert content and b"ended by SIG" not in content


def scripted(**fields: object) -> Finding:
    """Return a finding in numpy with a script, or with other fields."""
    words = dict.fromkeys(("name", "engine", "version", "does", "right", "cause"), "a")
    return Finding(**{**words, "package": "numpy", "script": "print(1.0)", **fields})


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
    answer = scripted(script=script, wrong_above=1.0).recheck()
    assert answer.status is status and says in answer.words


def test_a_finding_without_a_proof_is_unclear_and_one_without_its_package_absent() -> None:
    """The words name the missing proof, and the command that installs the package."""
    ending = scripted(script="", crashes=True).recheck()
    assert ending.status is Status.UNCLEAR and "no proof is stored" in ending.words, ending
    absent = scripted(package="no-such-package").recheck()
    assert absent.status is Status.ABSENT and "pip install no-such-package" in absent.words, absent


def test_an_unknown_finding_is_refused_with_the_nearest_name() -> None:
    """The finding exists; its name is asked without the e of "turned"."""
    with pytest.raises(RequestError, match="dart-hinge-closure-turned"):
        chosen(["dart-hinge-closure-turnd"])


def proofs() -> list[object]:
    """Return all findings. The gate proves one of each engine whose proof starts at once; the others are
    slow, since every proof loads its engine anew."""
    names, slow = {}, ("mjx", "warp", "newton", "dart-hinge-closure-fine-step", "dart-hinge-closure-turned")
    for found in findings():
        if not {found.engine, found.name} & {*slow}:
            names.setdefault(found.engine, found.name)
    gate = set(names.values())
    return [pytest.param(f.name, marks=() if f.name in gate else pytest.mark.slow) for f in findings()]


@pytest.mark.parametrize("name", proofs())
def test_the_proof_of_a_finding_gives_its_stored_number_at_the_stored_version(name: str) -> None:
    """The stored number is met within 5 %; NaN is stored if rounding decides. Other versions may be right."""
    (found,) = chosen([name])
    answer = found.recheck()
    if answer.version != found.version or found.crashes:
        pytest.skip(f"{found.engine} {found.version} is not installed, or ends the process")
    assert answer.status is Status.PRESENT, answer
    assert math.isnan(found.measured) or answer.measured == pytest.approx(found.measured, rel=0.05), answer


def test_the_command_rechecks_a_finding_and_prints_its_status(capsys) -> None:
    """MuJoCo reads the small files of the corpus now as the stored records of its finding say."""
    assert main(["findings", "files-mujoco", "--recheck"]) == 0
    assert re.search(r"mujoco.*present.*changed: none", " ".join(capsys.readouterr().out.split()))


def test_readers_of_files_are_findings_and_our_own_import_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    """One finding counts the files of the corpus that PyBullet refuses, or changes without a message: all but
    those that the stored records call "same" or "dropped with a message", which are less than half. mbref's
    own import has no such file, and no finding."""
    assert main(["findings", "files-bullet"]) == 0
    number, count = map(int, re.findall(r"in (\d+) of (\d+)", " ".join(capsys.readouterr().out.split()))[0])
    good = ("same", "dropped with a message")
    assert number == sum(record["reader"] == "bullet" and record["status"] not in good for record in read())
    assert count / 2 < number and count == len(CASES)
    with pytest.raises(RequestError, match="unknown finding 'files-mbref'"):
        chosen(["files-mbref"])
