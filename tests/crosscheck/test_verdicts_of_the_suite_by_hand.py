"""Verdicts of the suite / a stand-in engine with a motion that is off by a known amount at each setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import deep, findings, properties, runners, suite, trial
from crosscheck.conformance.deep import AGREEMENT, Plan, Tally
from crosscheck.conformance.suite import Verdict
from crosscheck.conformance.trial import Bench, Broken, NoExact, Specimen
from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.truth import NoSolution
from crosscheck.processes.child import ChildFailed
from mbref.scene import Body, Scene, SceneError
from mbref.trajectory import Outcome, Trajectory

SCENE = Scene(
    name="block",
    duration=1.0,
    body=(Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(4.0, 0.0, 0.0)),),
)
LENGTH = scene_length(SCENE)
REFUSED = Cannot(Owner.ENGINE, "no loop")


def motion(off: float, times: np.ndarray, outcome: Outcome = Outcome.COMPLETED) -> Trajectory:
    """The block at rest, off by a number of scene lengths along z."""
    still, turn = np.zeros((len(times), 1, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1))
    place = still + np.array([4.0, 0.0, off * LENGTH])
    made = Trajectory("block", "e", "1", "m", {}, np.array(times), ("b",), place, turn, still, still)
    return replace(
        made, outcome=outcome, t_end=float(times[-1]), acceleration=still, angular_acceleration=still
    )


class Runner:
    """An engine whose settings have errors, coarse to fine; settings of an outcome do not complete."""

    def __init__(self, errors: Sequence[float | Outcome], cannot: Cannot | None = None, name: str = "e"):
        self.errors, self.cannot, self.name, self.rounding = list(errors), cannot, name, 1e-16

    def offers(self, scene: Scene, family: str = "") -> tuple[str, Cannot | None, list[Setting]]:
        return f"1.{family}", self.cannot, [Setting("f", {"k": k}) for k in range(len(self.errors))]

    def observe(self, scene: Scene, times: np.ndarray, setting: Setting) -> Any:
        found = self.errors[setting.options["k"]]
        ended = isinstance(found, Outcome)
        return SimpleNamespace(
            value=motion(0.0 if ended else found, times, found if ended else Outcome.COMPLETED)
        )

    def refuses(self, scene: Scene, family: str) -> Cannot | None:
        return REFUSED if scene.name == "refused" else None


def bench(*errors: float | Outcome, **more: Any) -> Bench:
    return trial.set_up(Runner(errors, **more), Specimen(SCENE))


# --- runs of a bench --------------------------------------------------------------------------------------
def test_runs_that_claim_to_have_completed():
    times = np.array([0.0, 1.0])
    good = motion(0.0, times)
    assert np.array_equal(trial.completed(SCENE, good, 2).position, good.position)
    with pytest.raises(Broken, match=r"^the run claims to have completed, with 2 of 3 samples$"):
        trial.completed(SCENE, good, 3)
    lost = replace(good, velocity=good.velocity + np.nan)
    with pytest.raises(
        Broken, match=r"^the run claims to have completed, with numbers that are not finite: velocit"
    ):
        trial.completed(SCENE, lost, 2)
    failed = replace(good, outcome=Outcome.STEP_FAILED, t_end=0.5)
    with pytest.raises(
        Broken, match=f"^{Outcome.STEP_FAILED.label} after 0.5 s: {Outcome.STEP_FAILED.sentence}$"
    ):
        trial.completed(SCENE, failed, 2)
    with pytest.raises(Broken, match=r" after 0\.5 s: it locks$"):
        trial.completed(SCENE, replace(failed, message="it locks"), 2)
    assert trial.difference(SCENE, good, motion(0.25, times)) == pytest.approx(0.25)
    assert trial.difference(SCENE, good, motion(np.inf, times)) == np.inf


def test_the_three_finest_settings_that_complete():
    swept = bench(9.0, 0.5, 0.25, Outcome.STEP_FAILED, 0.125).sweep
    assert [run.position[0, 0, 2] / LENGTH for run in swept] == pytest.approx([0.125, 0.25, 0.5])
    assert len(bench(0.25, Outcome.STEP_FAILED, 0.125).sweep) == 2 and len(bench(0.125).sweep) == 1
    with pytest.raises(Broken, match=r"^only the finest setting completes$"):
        _ = bench(Outcome.STEP_FAILED, 0.125).sweep
    with pytest.raises(Broken, match=r"^STEP_FAILED after 1 s: "):
        _ = bench(0.25, Outcome.STEP_FAILED).sweep
    one = trial.set_up(Runner([0.0], REFUSED), Specimen(SCENE), "family")
    assert (one.version, one.cannot, one.family) == ("1.family", REFUSED, "family")


def test_exact_motions_and_their_bounds(monkeypatch):
    """By a formula, by a truth, and by Gauss's principle where no truth is known or it ends before."""
    times = np.linspace(0.0, 1.0, 3)
    asked: list[Any] = []
    place, turn = np.zeros((3, 1, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1))
    given = trial.exact_motion(Specimen(SCENE, lambda t: (place, turn)), times)
    assert given.engine == "closed form" and given.position is place and np.isnan(given.velocity).all()
    assert trial.exact_bound(Specimen(SCENE, lambda t: (place, turn)), given) == trial.TRUTH_DRIVEN

    def gauss(scene, times, tolerance=None):
        asked.append((times, tolerance))
        return replace(motion(0.5 if tolerance else 0.25, np.array(times)), engine=trial.GAUSS)

    monkeypatch.setattr(trial, "gauss_motion", gauss)
    monkeypatch.setattr(trial, "truth_for", lambda scene, seconds: asked.append(seconds))
    specimen = Specimen(SCENE, reference_time=7.0)
    found = trial.exact_motion(specimen, times)
    assert found.engine == trial.GAUSS and asked == [7.0, ((0.0, 0.5, 1.0), None)]
    assert trial.exact_bound(specimen, found) == pytest.approx(0.1 * 0.25) and asked[-1][1] == 1e-8
    truth = SimpleNamespace(poses=lambda times: motion(0.125, times))
    monkeypatch.setattr(trial, "truth_for", lambda scene, seconds: truth)
    assert trial.exact_motion(specimen, times).position[0, 0, 2] == 0.125 * LENGTH

    def ends(times):
        raise NoSolution.ending("it locks", 0.1)

    truth.poses = ends
    assert trial.exact_motion(specimen, times).engine == trial.GAUSS

    def lost(scene, times, tolerance=None):
        raise RuntimeError("no step is short enough")

    monkeypatch.setattr(trial, "gauss_motion", lost)
    with pytest.raises(NoExact, match=r"^no step is short enough$"):
        trial.exact_motion(specimen, times)
    monkeypatch.setattr(trial, "closed_form", lambda scene: SimpleNamespace(accuracy=3e-12))
    assert trial.exact_bound(specimen, given) == 3e-12
    monkeypatch.setattr(trial, "closed_form", lambda scene: None)
    assert trial.exact_bound(specimen, given) == trial.TRUTH_DRIVEN
    assert trial.exact_bound(specimen, replace(given, settings={"bound": 2e-10})) == 2e-10


def test_engines_that_are_asked_answer_or_fail_as_a_child_process():
    with pytest.raises(ChildFailed, match=r"ValueError: no such family"), runners.answering():
        raise ValueError("no such family")
    with pytest.raises(ImportError, match="no module"), runners.answering():
        raise ImportError("no module")


# --- changed scenes ---------------------------------------------------------------------------------------
def related(monkeypatch, runner: Runner, expected: float, name: str = "moved", pushes: float = 0.0) -> Any:
    changed = SCENE.with_(name=name)
    relation = SimpleNamespace(
        change=lambda scene, run: changed, expect=lambda scene, run: motion(expected, run.times)
    )
    monkeypatch.setattr(properties, "RELATIONS", {"r": relation})
    monkeypatch.setattr(properties, "pushes_apart", lambda *_: (pushes, "forces"))
    at = trial.set_up(runner, Specimen(SCENE))
    values = {"own_accuracy": 0.25, "floors": "floors", "own_pushes": 0.5, "rank": 0}
    made = SimpleNamespace(
        scene=SCENE,
        motion=at.motion,
        settings=at.settings,
        refuses=at.refuses,
        run=at.run,
        observed=at.observed,
        **values,
    )
    return properties.related("r", made)


def test_a_changed_scene_moves_as_expected(monkeypatch):
    """Off by 0.2 of an allowed 0.25; by 0.5, where the two finest settings are 0.125 apart."""
    near = related(monkeypatch, Runner([0.1]), 0.3)
    assert (near.measured, near.allowed) == (pytest.approx(0.2), 0.25)
    far = related(monkeypatch, Runner([0.225, 0.1]), 0.6)
    assert far.measured == pytest.approx(0.5)
    assert far.allowed == pytest.approx(max(0.25, properties.OWN_ACCURACY * 0.125))
    alone = related(monkeypatch, Runner([0.1]), 0.6)
    assert alone.allowed == 0.25, "one setting has no accuracy of its own"
    pushed = related(monkeypatch, Runner([0.1]), 0.3, pushes=0.45)
    assert (pushed.measured, pushed.allowed) == (0.45, 0.5), "0.45 / 0.5 is more than 0.2 / 0.25"
    assert related(monkeypatch, Runner([0.1]), 0.3, name="refused") is REFUSED


def test_a_motion_that_makes_no_valid_scene_is_broken():
    def fault(scene, run):
        raise SceneError(["joint A: is off by 1 m"])

    with pytest.raises(Broken, match=r"^its motion makes no valid scene: joint A: is off by 1 m$"):
        properties.changed(SimpleNamespace(change=fault), bench(0.0))


# --- violations and drawn mechanisms ----------------------------------------------------------------------
def test_a_violation_is_stored_on_a_smaller_scene(monkeypatch, tmp_path):
    asked: list[Any] = []
    small = SCENE.with_(name="small")
    monkeypatch.setattr(
        findings, "violates", lambda runner, name: asked.append((runner.name, name)) or "fails"
    )
    monkeypatch.setattr(findings, "shrunk", lambda scene, fails: small if fails == "fails" else None)
    monkeypatch.setattr(
        suite,
        "verdict_on",
        lambda name, at: Verdict(name, at.scene.name, "fail", 0.5 if at.specimen.related else 0.0),
    )
    kept: list[Any] = []
    monkeypatch.setattr(findings, "keep", lambda *given: kept.append(given) or Path("kept"))
    first = Verdict("closure", "block", "fail", 0.25)
    assert findings.found(bench(0.0), first, tmp_path) == Path("kept") and asked == [("e", "closure")]
    scene, verdict, engine, folder = kept[0]
    assert (scene, engine, folder) == (small, "e", tmp_path)
    assert (verdict.scene, verdict.measured) == ("small", 0.5)
    monkeypatch.setattr(findings, "shrunk", lambda scene, fails: scene)
    findings.found(bench(0.0), first, tmp_path)
    assert kept[1][0] == SCENE and kept[1][1] == first, "the first verdict, if nothing can be left out"
    end = trial.set_up(Runner([0.0]), Specimen(SCENE, dead_end=True))
    findings.found(end, first, tmp_path)
    assert kept[2] == (SCENE, first, "e", tmp_path, "block") and len(asked) == 2, "a dead end is not reduced"


@pytest.fixture
def beside(monkeypatch) -> dict[str, Runner]:
    """Engines by name for the agreement of two engines."""
    engines: dict[str, Runner] = {}
    monkeypatch.setattr(deep, "engine", lambda name: name)
    monkeypatch.setattr(deep, "InProcess", lambda engine, name: engines[name])
    return engines


def test_agreement_with_another_engine(beside, monkeypatch):
    monkeypatch.setattr(Bench, "resolution", property(lambda self: 0.1 * len(self.settings)))
    beside |= {"near": Runner([9.0, 0.2]), "far": Runner([9.0, 0.45]), "no": Runner([0.0], REFUSED)}
    beside["ended"] = Runner([Outcome.NOT_FINITE])
    found = deep.agreement(bench(0.0), "near=family")
    assert (found.status, found.measured, found.reason) == ("pass", pytest.approx(0.2), "with near=family")
    assert found.allowed == pytest.approx(0.3), "the sum of both resolutions" and found.property == AGREEMENT
    assert deep.agreement(bench(0.0), "far").status == "fail"
    refused = deep.agreement(bench(0.0), "no")
    assert (refused.status, refused.reason) == ("cannot", f"no: {REFUSED}")
    ended = deep.agreement(bench(0.0), "ended")
    assert ended.status == "fail" and ended.reason.startswith("ended: NOT_FINITE after 1 s: ")


def test_verdicts_on_a_drawn_mechanism(monkeypatch):
    monkeypatch.setattr(
        suite,
        "first_run",
        lambda at: Verdict(suite.RUN, "block", "fail" if at.version == "1.bad" else "pass"),
    )
    monkeypatch.setattr(suite, "verdict_on", lambda check, at: Verdict(check, "block", "pass"))
    monkeypatch.setattr(deep, "agreement", lambda at, other: Verdict(AGREEMENT, other, "pass"))
    plan = Plan("e", 1, beside=("x", "y"))
    found = list(deep._verdicts(plan, bench(0.0), ["closure", AGREEMENT]))
    assert [(v.property, v.scene) for v in found] == [
        ("closure", "block"),
        (AGREEMENT, "x"),
        (AGREEMENT, "y"),
    ]
    bad = trial.set_up(Runner([0.0]), Specimen(SCENE), "bad")
    assert [v.property for v in deep._verdicts(plan, bad, ["closure", AGREEMENT])] == [suite.RUN]
    unable = trial.set_up(Runner([0.0], REFUSED), Specimen(SCENE), "bad")
    found = list(deep._verdicts(plan, unable, ["closure", suite.REFUSAL]))
    assert [(v.property, v.status) for v in found] == [("closure", "cannot"), (suite.REFUSAL, "pass")]


def verdict(check: str, status: str, scene: str = "s", measured: float | None = None) -> dict[str, Any]:
    return suite.record_of(Verdict(check, scene, status, measured, 0.5))


def test_counts_of_drawn_mechanisms():
    tally = Tally(Plan("e", 2))
    assert not tally.conforms and "closure" in tally.open() and AGREEMENT not in tally.open()
    assert AGREEMENT in Tally(Plan("e", 1, beside=("x",))).open()
    made = [
        verdict(suite.RUN, "pass"),
        verdict("closure", "pass", measured=0.25),
        verdict("truth", "outside"),
    ]
    tally.add({"version": "1", "verdicts": made})
    tally.add({"version": "2", "verdicts": [verdict("closure", "pass", "t", 0.125)]})
    assert (tally.version, tally.seeds, tally.decided("closure"), tally.decided("truth")) == ("2", 2, 2, 0)
    assert tally.worst == {"closure": (0.5, "s")} and tally.conforms and "closure" not in tally.open()
    tally.add(
        {"version": "2", "verdicts": [verdict(suite.RUN, "fail", "u"), verdict("closure", "fail", "u")]}
    )
    assert [v["property"] for v in tally.violations] == [suite.RUN] and not tally.conforms
    assert tally.decided("closure") == 2, "a failed run alone counts"
    old = verdict("closure", "fail", "w") | {"card": "closure/0"}
    tally.add({"version": "2", "verdicts": [old]})
    assert tally.decided("closure") == 2 and tally.seeds == 4


def test_checks_without_a_verdict_in_a_stored_record():
    record = {"verdicts": [verdict("closure", "pass")], "asked": [deep.check_of("truth")]}
    assert deep.unasked(record, ["closure", "truth", "energy"]) == ["energy"]
    assert deep.unasked({"verdicts": [verdict(suite.RUN, "fail")]}, ["closure"]) == []
    assert deep.unasked({"verdicts": [verdict(suite.RUN, "pass")]}, ["closure"]) == ["closure"]
