"""Own limits, strict expected failures, baseline, time budget and JUnit files of the conformance suite."""

import json
import math
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from crosscheck.cli import main
from crosscheck.conformance import suite
from crosscheck.conformance.junit import junit
from crosscheck.conformance.mechanisms.specimens import specimens
from crosscheck.conformance.own_limits import OwnLimits, read_baseline, read_limits
from crosscheck.conformance.runners import InProcess
from mbref.records import RecordsError
from mbref.scene import SceneError
from tests.helpers.low_order_engines import low_order, midpoint

[FALL] = [replace(each, related=False) for each in specimens() if each.scene.name == "free_fall"]
SCENES = ("free_fall", "pendulum")
HEAVY = "gravity acts twice"


def verify(fault: str = "", limits: OwnLimits | None = None, budget: float = 60.0) -> suite.Conformance:
    """Return the verdicts on an engine of order 2, perhaps with a fault, on a free fall."""
    judged = (limits or OwnLimits()).judged
    return suite.held_against(InProcess(low_order(midpoint, fault)), [FALL], None, "", judged, budget)


@pytest.fixture(scope="module")
def right() -> suite.Conformance:
    return verify()


@pytest.fixture(scope="module")
def wrong() -> suite.Conformance:
    return verify(HEAVY)


def failed(found: suite.Conformance) -> list[suite.Verdict]:
    return [verdict for verdict in found.verdicts if verdict.status == suite.FAIL]


def written(tmp_path, text: str) -> OwnLimits:
    (tmp_path / "limits.toml").write_text(text)
    return read_limits(tmp_path / "limits.toml", SCENES)


def expecting(checks, tmp_path) -> OwnLimits:
    entries = (f'[[expected]]\ncheck = "{check}"\nreason = "heavy"\n' for check in checks)
    return written(tmp_path, "".join(entries))


def test_expected_failures_do_not_count(right, wrong, tmp_path):
    """An engine with twice the gravity fails checks of a free fall, which the file of limits expects."""
    assert right.conforms and not wrong.conforms
    limits = expecting({verdict.property for verdict in failed(wrong)}, tmp_path)
    assert verify(HEAVY, limits).conforms


def test_checks_that_pass_although_they_are_expected_to_fail_fail_with_the_remedy(right, wrong, tmp_path):
    """The engine without the planted fault passes the checks that the file expects to fail."""
    limits = expecting({verdict.property for verdict in failed(wrong)}, tmp_path)
    strict = [limits.judged(verdict) for verdict in right.verdicts]
    assert {v.property for v in strict if v.status == suite.FAIL} == {v.property for v in failed(wrong)}
    assert all("remove it from the file" in v.reason for v in strict if v.status == suite.FAIL)


def test_own_limit_replaces_the_limit_of_a_check_on_its_scenes(right, wrong, tmp_path):
    """A limit of twice the measured value passes, one of half of it fails; a limit for another scene changes
    nothing. A table [limits] has limits for all scenes."""
    verdict = next(v for v in failed(wrong) if v.measured)
    cases = ("free_fall", 2, "pass"), ("free_fall", 0.5, "fail"), ("pendulum", 2, "fail")
    for scene, factor, status in cases:
        entry = f'[[limit]]\ncheck = "{verdict.property}"\nscenes = ["{scene}"]\n'
        limits = written(tmp_path, f"{entry}allowed = {factor * verdict.measured!r}")
        assert limits.judged(verdict).status == status
    limits = written(tmp_path, f"[limits]\n{verdict.property} = {2 * verdict.measured!r}")
    assert limits.judged(verdict).allowed == 2 * verdict.measured


def test_failure_no_worse_than_in_the_baseline_does_not_count(right, wrong, tmp_path):
    """The record of the faulty engine excuses its failures, also values up to twice as large (1.9), but no
    larger ones (2.1). The record of the right engine, in which all checks pass, excuses none."""
    for name, found in (("wrong", wrong), ("right", right)):
        (tmp_path / f"{name}.json").write_text(json.dumps(found.to_record()))
    before = OwnLimits(baseline=read_baseline(tmp_path / "wrong.json"))
    assert {before.judged(v).status for v in failed(wrong)} == {suite.EXPECTED}
    for factor, status in ((1.9, suite.EXPECTED), (2.1, suite.FAIL)):
        scaled = [replace(v, measured=factor * v.measured) for v in failed(wrong) if v.measured]
        judged = [before.judged(v) for v in scaled]
        assert {v.status for v in judged} == {status}
    assert all("the baseline has" in v.reason for v in judged)
    passed = OwnLimits(baseline=read_baseline(tmp_path / "right.json"))
    judged = [passed.judged(v) for v in failed(wrong)]
    assert {v.status for v in judged} == {suite.FAIL}
    assert all("passes in the baseline" in v.reason for v in judged)


def saved(found: suite.Conformance, folder) -> OwnLimits:
    """Return the limits by a file of the verdicts as the baseline."""
    (folder / "before.json").write_text(json.dumps(found.to_record()))
    return OwnLimits(baseline=read_baseline(folder / "before.json"))


@pytest.mark.parametrize(("status", "reason"), [("cannot", "no licence"), ("outside", "gives no reactions")])
def test_a_check_that_passes_in_the_baseline_has_to_run_and_pass(right, status, reason, tmp_path):
    """An engine refuses a scene that it ran before, or gives fewer numbers than before: it is worse. A truth
    that could not be computed says nothing on the engine."""
    before = saved(right, tmp_path)
    passed = next(v for v in right.verdicts if v.status == "pass")
    judged = before.judged(replace(passed, status=status, measured=None, reason=reason))
    assert judged.status == "fail" and judged.reason == f"{reason}; it passes in the baseline"
    reason = "its exact motion is not known: the CPU time has passed"
    unknown = replace(passed, status="outside", reason=reason)
    assert before.judged(unknown) == unknown


def test_a_failure_that_is_not_finite_is_no_worse_than_itself_in_the_baseline(wrong, tmp_path):
    """JSON has no infinite numbers: the file has null. A failure that the baseline lacks still counts."""
    lost = [replace(failed(wrong)[0], measured=value) for value in (math.inf, math.nan)]
    for verdict in lost:
        before = saved(replace(wrong, verdicts=[verdict]), tmp_path)
        assert before.judged(verdict).status == "expected"
        assert before.judged(failed(wrong)[1]).status == "fail"


@pytest.mark.parametrize(
    ("verdicts", "said"),
    [
        (None, "is not a file that crosscheck verify --json printed"),
        ([{"measured": "1"}], "verdicts.0.measured: "),
        ([{"status": "pass"}, {"status": "fail"}], "has two"),
    ],
    ids=["another form", "text for a number", "contradicting verdicts"],
)
def test_damaged_baseline_is_refused_with_its_fault(wrong, verdicts, said, tmp_path):
    """The first verdict of the record is changed, or is there twice; None stands for an empty record."""
    whole = wrong.to_record()
    changed = [whole["verdicts"][0] | change for change in verdicts or ()]
    damaged = {} if verdicts is None else whole | {"verdicts": changed}
    (tmp_path / "damaged.json").write_text(json.dumps(damaged))
    with pytest.raises(RecordsError, match=said):
        read_baseline(tmp_path / "damaged.json")


def test_scenes_after_the_time_budget_are_named_and_show_no_conformance():
    """The budget is 0 s, so that the free fall, the only scene, is left out."""
    found = verify(budget=0.0)
    assert "free_fall" in found.left_out and not found.verdicts and not found.conforms
    assert "left out by the time budget" in str([*suite.tables(found)][-1])


def test_junit_file_has_the_checks_that_ran_with_numbers_and_no_other_case(wrong, tmp_path):
    """Cases are checks that failed, failed as expected, or passed; checks that do not apply are none. One of
    the failures is expected, and counts as skipped."""
    some = failed(wrong)[0].property
    limits = expecting([some], tmp_path)
    found = replace(wrong, verdicts=[limits.judged(v) for v in wrong.verdicts])
    suite_ = ElementTree.fromstring(junit(found).partition("\n")[2]).find("testsuite")
    ran = [v for v in found.verdicts if v.status in ("pass", "fail", "expected")]
    cases = suite_.findall("testcase")
    assert [(c.get("classname"), c.get("name")) for c in cases] == [(v.scene, v.property) for v in ran]
    assert suite_.get("failures") == str(len(failed(found))) and suite_.get("skipped") == "1"
    failure = suite_.find("testcase/failure")
    assert "allowed" in failure.get("message") and failure.text == found.hint != ""


def test_junit_file_of_an_engine_that_runs_no_scene_has_a_failure(right):
    """The command ends with status 1: a test server has to show a failure too."""
    refusal = suite.Verdict("refusal", "free_fall", "cannot", reason="no licence")
    for verdicts in ([], [refusal]):
        found = replace(right, verdicts=verdicts)
        made = ElementTree.fromstring(junit(found).partition("\n")[2]).find("testsuite")
        assert not found.conforms and made.get("failures") == made.get("tests") == "1"
        assert "runs no scene" in made.find("testcase/failure").get("message")


def test_junit_file_is_xml_whatever_an_engine_says(wrong):
    """XML has no control characters, which an engine's message may have: they are written as escapes."""
    said = replace(failed(wrong)[0], reason="code \x1b[31m \x00 <b> & end", measured=None)
    made = ElementTree.fromstring(junit(replace(wrong, verdicts=[said])).partition("\n")[2])
    assert r"code \x1b[31m \x00 <b> & end" in made.find("testsuite/testcase/failure").get("message")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[limits]\nclosur = 1.0", "unknown check 'closur'; .* mean 'closure'"),
        ("[[limit]]\ncheck = []\nallowed = 1", r"unknown check \[\]"),
        ("[limits]\nclosure = -1.0", "allowed of check 'closure' must be a positive number"),
        ('[[limit]]\ncheck = "closure"\nscenes = ["fre_fall"]\nallowed = 1', "mean 'free_fall'"),
        ('[[expected]]\ncheck = "closure"', "reason of check 'closure' is required"),
        ('[[expect]]\ncheck = "closure"', "expect: is not a known table; did you mean 'expected'"),
        ('[[limit]]\ncheck = "closure"\nalowed = 1', "alowed is not a known field; did you mean 'allowed'"),
    ],
)
def test_faulty_file_of_limits_is_refused_with_the_entry(text, says, tmp_path):
    with pytest.raises(SceneError, match=says):
        written(tmp_path, text)


def test_command_verify_reads_limits_and_writes_junit(tmp_path, capsys):
    """A check that passes although it is expected to fail ends the command with status 1, without a hint."""
    entry = '[[expected]]\ncheck = "truth"\nscenes = ["free_fall"]\nreason = "slow"'
    (tmp_path / "limits.toml").write_text(entry)
    files = ["--limits", str(tmp_path / "limits.toml"), "--junit", str(tmp_path / "verify.xml")]
    assert main(["verify", "mujoco", "--scene", "free_fall", "--in-process", *files]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert "remove it from the file of limits" in shown and "hint" not in shown
    assert "expected to fail (slow)" in (tmp_path / "verify.xml").read_text()
