"""Searches of the suite / random mechanisms, hints and smaller scenes on paper: what is asked, in order."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import deep, explained, findings, hint, runners, suite
from crosscheck.conformance.deep import AGREEMENT, Plan, Tally
from crosscheck.conformance.suite import FAIL, PASS, REFUSAL, RUN, Conformance, Verdict
from crosscheck.conformance.trial import Bench, Specimen
from crosscheck.processes.child import ChildFailed
from mbref.scene import Body, Moment, Revolute, Scene
from mbref.trajectory import Outcome

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", body=(BLOCK,), duration=0.5)


def verdict(check: str, status: str = PASS, measured: float | None = None) -> dict[str, Any]:
    return suite.record_of(Verdict(check, "s", status, measured, 1.0))


# --- random mechanisms --------------------------------------------------------------------------------------
@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A search on paper for two checks: seeds that were asked, what was asked of them and what is kept."""
    seen: dict[str, Any] = {"asked": [], "kept": [], "shown": [], "known": {}, "status": lambda seed: PASS}

    def record(plan: Plan, seed: int, wanted: list[str]) -> dict[str, Any]:
        seen["asked"].append((seed, list(wanted)))
        return {"version": f"v{seed}", "verdicts": [verdict(check, seen["status"](seed)) for check in wanted]}

    monkeypatch.setattr(deep, "KINDS", ((None, (RUN, "closure")), (None, ("closure", AGREEMENT))))
    monkeypatch.setattr(deep, "_record", record)
    monkeypatch.setattr(deep, "opened", lambda path: dict(seen["known"]))
    monkeypatch.setattr(deep, "append", lambda path, record: seen["kept"].append((path, record)))
    return seen


def test_seeds_are_asked_until_every_check_is_decided(searched):
    plan = Plan("e", 2, 5, "f")
    tally = deep.examined(plan, "path", searched["shown"].append)
    assert searched["asked"] == [(5, [RUN, "closure"]), (6, [RUN, "closure"])]
    assert searched["shown"] == ["seed 5", "seed 6"] and tally.seeds == 2 and tally.version == "v6"
    (path, first), _ = searched["kept"]
    assert path == "path" and first["key"] == "e f 5" and first["version"] == "v5"
    assert first["asked"] == [deep.check_of(RUN), deep.check_of("closure")] and len(first["verdicts"]) == 2
    assert tally.conforms and tally.decided("closure") == 2


def test_three_times_as_many_seeds_at_most(searched):
    searched["status"] = lambda seed: "outside"
    tally = deep.examined(Plan("e", 2), None)
    assert [seed for seed, _ in searched["asked"]] == [0, 1, 2, 3, 4, 5] and tally.seeds == 6
    assert not tally.conforms and deep.examined(Plan("e", 0), None).seeds == 0


def test_stored_verdicts_are_kept_and_missing_ones_added(searched):
    before = {
        "version": "v",
        "verdicts": [verdict("closure", PASS, 0.5)],
        "asked": [deep.check_of("closure")],
    }
    searched["known"] = {"e  0": before}
    tally = deep.examined(Plan("e", 1), "path")
    assert searched["asked"] == [(0, [RUN])]
    [(_, kept)] = searched["kept"]
    assert [v["property"] for v in kept["verdicts"]] == ["closure", RUN]
    assert kept["asked"] == [deep.check_of("closure"), deep.check_of(RUN)] and tally.worst == {
        "closure": (0.5, "s")
    }
    searched["known"] = {"e  0": kept}
    deep.examined(Plan("e", 1), "path")
    assert len(searched["asked"]) == len(searched["kept"]) == 1, "nothing is missing"


def test_checks_that_a_plan_has():
    """Agreement is asked if engines are named; a check that several kinds of mechanisms serve counts once."""
    alone, beside = Tally(Plan("e", 1)).open(), Tally(Plan("e", 1, beside=("x",))).open()
    assert (
        AGREEMENT not in alone and set(beside) - set(alone) == {AGREEMENT} and len(set(beside)) == len(beside)
    )
    tally = Tally(Plan("e", 2), counts={"closure": Counter({PASS: 1, FAIL: 1}), "truth": Counter({PASS: 1})})
    assert "closure" not in tally.open() and "truth" in tally.open()


def test_counts_as_a_document():
    plan = Plan("e", 2, 3, "f")
    tally = Tally(plan, "1.2", 4, {"closure": Counter({PASS: 2})}, {"closure": (0.5, "s")}, [{"scene": "t"}])
    found = tally.to_record()
    checks = found.pop("cards")
    assert checks == {
        "closure": {
            "card": "closure/1",
            "about": suite.abouts()["closure"],
            PASS: 2,
            "worst": (0.5, "s"),
        }
    }
    assert found == {
        "engine": "e",
        "version": "1.2",
        "family": "f",
        "mechanisms": 2,
        "first_seed": 3,
        "seeds": 4,
        "violations": [{"scene": "t"}],
    }
    assert Tally(plan, counts={"truth": Counter()}).to_record()["cards"]["truth"]["worst"] == (0.0, "")
    assert deep.about(AGREEMENT) == deep.ABOUT and deep.about(RUN) == suite.FIRST[RUN]


@pytest.mark.parametrize(
    ("measured", "allowed", "worst"),
    [(0.5, 1.0, {"c": (0.5, "s")}), (0.0, 1.0, {}), (0.5, 0.0, {}), (None, None, {})],
)
def test_the_largest_share_of_a_limit(measured, allowed, worst):
    tally = Tally(Plan("e", 1))
    passed = suite.record_of(Verdict("c", "s", PASS, measured, allowed))
    tally.add({"version": "1", "verdicts": [passed]})
    assert tally.worst == worst and tally.counts["c"] == Counter({PASS: 1}) and not tally.violations


@pytest.mark.parametrize(("apart", "status"), [(0.75, PASS), (0.76, FAIL)])
def test_agreement_at_its_limit(monkeypatch, apart, status):
    """The sum of the resolutions, 0.25 and 0.5."""
    other = SimpleNamespace(cannot=None, motion="m", resolution=0.5)
    monkeypatch.setattr(deep, "engine", lambda name: f"engine {name}")
    monkeypatch.setattr(deep, "InProcess", lambda engine, name: (engine, name))
    monkeypatch.setattr(
        deep, "set_up", lambda runner, specimen, family: asked.append((runner, family)) or other
    )
    monkeypatch.setattr(deep, "difference", lambda scene, first, second: apart)
    asked: list[Any] = []
    bench = SimpleNamespace(scene=SCENE, specimen=None, motion="n", resolution=0.25)
    found = deep.agreement(bench, "x=g")
    assert (found.status, found.measured, found.allowed) == (status, apart, 0.75)
    assert asked == [(("engine x", "x"), "g")] and (found.property, found.scene) == (AGREEMENT, "s")
    other.cannot = "no loop"
    found = deep.agreement(bench, "x=g")
    assert (found.property, found.scene, found.status) == (AGREEMENT, "s", "cannot")
    assert found.reason == "x=g: no loop"

    def broken(*of: Any) -> float:
        raise deep.Broken("no end")

    other.cannot = None
    monkeypatch.setattr(deep, "difference", broken)
    found = deep.agreement(bench, "x=g")
    assert (found.property, found.scene, found.status, found.reason) == (AGREEMENT, "s", FAIL, "x=g: no end")


def test_verdicts_of_one_seed(monkeypatch):
    """Checks that one kind of mechanism decides are not asked of the next one."""
    asked: list[Any] = []
    draws = [lambda seed, name=name: SCENE.with_(name=f"{name} {seed}") for name in ("loop", "free", "none")]
    monkeypatch.setattr(
        deep, "KINDS", tuple(zip(draws, ((RUN, "closure"), ("closure", "energy"), ("energy",)), strict=True))
    )
    monkeypatch.setattr(deep, "engine", lambda name: f"engine {name}")
    monkeypatch.setattr(deep, "InProcess", lambda engine, name: (engine, name))

    def set_up(runner: Any, specimen: Specimen, family: str) -> Any:
        asked.append((runner, specimen, family))
        if specimen.scene.name.startswith("none"):
            return Verdict(REFUSAL, "none", FAIL)
        return Bench(None, specimen, f"of {specimen.scene.name}", None, [])

    def verdicts(plan: Plan, bench: Bench, checks: list[str]) -> list[Verdict]:
        is_first = bench.scene.name.startswith("loop")
        return [
            Verdict(c, bench.scene.name, "outside" if c == "closure" and is_first else PASS) for c in checks
        ]

    monkeypatch.setattr(deep.suite, "asked", set_up)
    monkeypatch.setattr(deep, "_verdicts", verdicts)
    found = deep._record(Plan("e", 1, family="f"), 7, [RUN, "closure", "energy"])
    assert [(v["property"], v["scene"], v["status"]) for v in found["verdicts"]] == [
        (RUN, "loop 7", PASS),
        ("closure", "loop 7", "outside"),
        ("closure", "free 7", PASS),
        ("energy", "free 7", PASS),
    ]
    assert found["version"] == "of free 7" and len(asked) == 2, "the third kind has nothing to decide"
    runner, specimen, family = asked[0]
    assert runner == ("engine e", "e") and family == "f"
    assert specimen == Specimen(SCENE.with_(name="loop 7"), None, True, reference_time=0.0)
    only = deep._record(Plan("e", 1), 7, ["energy"])
    assert [v["scene"] for v in only["verdicts"]] == ["free 7"]
    monkeypatch.setattr(deep, "KINDS", deep.KINDS[2:])
    failed = deep._record(Plan("e", 1), 7, ["energy"])
    assert [v["property"] for v in failed["verdicts"]] == [REFUSAL] and failed["version"] == ""


# --- the suite ----------------------------------------------------------------------------------------------
def test_the_suite_on_all_scenes(monkeypatch):
    """The undetermined motion comes first; versions are named once, and failures give a hint."""
    shown: list[str] = []
    specimens = [Specimen(SCENE.with_(name=name)) for name in ("one", "two", "three")]

    def asked(runner: Any, specimen: Specimen, family: str) -> Any:
        if specimen.scene.name == "three":
            return Verdict(REFUSAL, "three", FAIL)
        return Bench(None, specimen, {"two": "2"}.get(specimen.scene.name, "1"), None, [])

    monkeypatch.setattr(suite, "asked", asked)
    monkeypatch.setattr(suite, "examine", lambda bench: iter([Verdict("closure", bench.scene.name, FAIL)]))
    monkeypatch.setattr(suite, "hint", lambda runner, failures, family: (len(failures), family))
    found = suite.held_against(SimpleNamespace(name="e"), specimens, shown.append, "f")
    assert (found.engine, found.version, found.family, found.hint) == ("e", "1, 2", "f", (2, "f"))
    first = suite.undetermined().name
    assert [(v.property, v.scene) for v in found.verdicts] == [
        ("closure", first),
        ("closure", "one"),
        ("closure", "two"),
        (REFUSAL, "three"),
    ]
    assert sorted(shown) == sorted([first, "one", "two", "three"])
    assert suite.held_against(SimpleNamespace(name="e"), specimens).family == ""


@pytest.mark.parametrize(("is_here", "count"), [(True, 1), (False, 7)])
def test_runs_in_this_process_follow_each_other(monkeypatch, is_here, count):
    threads: list[int] = []
    real = suite.ThreadPoolExecutor
    monkeypatch.setattr(suite, "ThreadPoolExecutor", lambda number: threads.append(number) or real(1))
    monkeypatch.setattr(suite.os, "cpu_count", lambda: 7)
    monkeypatch.setattr(suite, "asked", lambda *of: Verdict(REFUSAL, "s", PASS))
    runner = suite.InProcess(SimpleNamespace(name="e")) if is_here else SimpleNamespace(name="e")
    suite.held_against(runner, [])
    assert threads == [count]


def test_runners_of_an_engine(monkeypatch):
    monkeypatch.setattr(suite, "engine", lambda name: f"engine {name}")
    assert suite.runner("e", 7.0) == suite.Isolated("e", 7.0)
    assert suite.runner("e", 7.0, True) == suite.InProcess("engine e", "e", 7.0)


def test_an_engine_that_crashes_when_it_is_asked(monkeypatch):
    def lost(runner: Any, specimen: Any, family: str) -> Any:
        raise ChildFailed(Outcome.CRASHED, f"lost {family}")

    monkeypatch.setattr(suite, "set_up", lost)
    assert suite.asked(None, Specimen(SCENE), "f") == Verdict(REFUSAL, "s", FAIL, reason="lost f")


def test_checks_by_name(monkeypatch):
    monkeypatch.setattr(suite, "refusal", lambda bench: ("refusal", bench))
    monkeypatch.setattr(suite, "first_run", lambda bench: ("run", bench))
    monkeypatch.setattr(suite, "judged", lambda check, bench: (check, bench))
    for check in (REFUSAL, RUN, "closure"):
        assert suite.verdict_on(check, "b") == (check, "b")


def test_columns_of_the_table():
    table = next(iter(suite.tables(Conformance("e", "1", [Verdict("closure", "s", PASS, 0.5, 1.0)]))))
    assert [column.justify for column in table.columns] == ["left", *["right"] * 4, "left"]
    assert [column.header for column in table.columns][:5] == ["scene", "✓", "✗", "–", "○"]
    nearest = [Verdict("a", "s", PASS, 0.0, 1.0), Verdict("b", "s", PASS, 0.5, 0.0), Verdict("c", "s", PASS)]
    assert suite._worst(nearest).plain == "a at 0 % of its limit"
    assert suite._worst(nearest[1:]).plain == ""


# --- hints --------------------------------------------------------------------------------------------------
def test_a_scene_without_a_motion_gives_no_hint(monkeypatch):
    failures = {"lost": ChildFailed(Outcome.CRASHED, "lost"), "broken": hint.Broken("no end"), "good": None}

    def explanations(bench: str) -> Any:
        if failures[bench]:
            raise failures[bench]
        return {("loads", "no load")}

    monkeypatch.setattr(hint, "set_up", lambda runner, specimen, family: specimen.scene.name)
    monkeypatch.setattr(hint, "explanations", explanations)
    for name, count in (("lost", 0), ("broken", 0), ("good", 1)):
        failure = hint.Failure(Specimen(SCENE.with_(name=name)), "truth")
        assert list(hint._looked_at(None, failure, "f")) == [(failure, {("loads", "no load")})] * count


def test_weights_of_central_differences():
    """The derivative of tᵏ at 0 is exact up to order 8: 2 Σ w j equals 1, and 2 Σ w j³, j⁵, j⁷ vanish."""
    weights, steps = np.array(hint.WEIGHTS), np.arange(1.0, 5.0)
    assert 2 * weights @ steps == pytest.approx(1.0, rel=1e-14)
    for power in (3, 5, 7):
        assert 2 * weights @ steps**power == pytest.approx(0.0, abs=1e-10)


def test_velocities_of_neighbouring_samples(monkeypatch):
    """Two bodies; angular velocities times the length of 3 m; samples 0.25 s apart."""
    monkeypatch.setattr(hint, "scene_length", lambda scene: 3.0)
    velocity, spin = np.arange(12.0).reshape(2, 2, 3), 10 + np.arange(12.0).reshape(2, 2, 3)
    motion = SimpleNamespace(velocity=velocity, angular_velocity=spin, times=np.array([0.5, 0.75]))
    rates, step = hint._rates(SCENE, SimpleNamespace(close=motion))
    assert (
        step == 0.25
        and rates[1, 0].tolist() == [6.0, 7.0, 8.0, 48.0, 51.0, 54.0]
        and rates.shape == (2, 2, 6)
    )


def test_terms_at_the_middle_sample(monkeypatch):
    """The engine's own motion, at the sample between its neighbours."""
    asked: list[Any] = []
    bench = SimpleNamespace(scene=SCENE, close="close")
    monkeypatch.setattr(hint, "_differences", lambda *of: asked.append(of) or np.array([1.0]))
    monkeypatch.setattr(hint, "terms_at", lambda *of: asked.append(of) or np.array([3.0]))
    monkeypatch.setattr(
        hint, "variants", lambda *of: asked.append(of) or [("loads", "none", np.array([1.0]))]
    )
    monkeypatch.setattr(hint, "accelerations", lambda scene, terms: terms if scene is SCENE else None)
    monkeypatch.setattr(hint, "_least", lambda scene: 0.0)
    monkeypatch.setattr(hint, "_rounded", lambda bench: 0.0)
    assert hint.explanations(bench) == {("loads", "none")}
    assert asked == [(SCENE, bench), (SCENE, "close", 4), (SCENE, "close", 4)]


# --- smaller scenes -----------------------------------------------------------------------------------------
def test_a_check_that_fails_on_a_scene(monkeypatch):
    asked: list[Any] = []
    bench = SimpleNamespace(cannot=None)
    monkeypatch.setattr(
        findings, "set_up", lambda runner, specimen: asked.append((runner, specimen)) or bench
    )
    status = [FAIL, PASS]
    monkeypatch.setattr(
        findings.suite, "verdict_on", lambda check, bench: Verdict(check, "s", status[len(asked) - 1])
    )
    fails = findings.violates("runner", "closure")
    assert fails(SCENE) is True and fails(SCENE) is False
    assert asked == [("runner", Specimen(SCENE, None, True))] * 2
    bench.cannot = "no loop"
    assert fails(SCENE) is False, "an engine that refuses a scene fails no check there"


def pair() -> Scene:
    hinge = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    load = Moment(body="b", moment=(1.0, 0.0, 0.0))
    other = BLOCK.model_copy(update={"name": "c"})
    return SCENE.with_(body=(BLOCK, other), joint=(hinge,), load=(load,), gravity=(0.0, -9.0, 0.0))


@pytest.mark.parametrize("tries", [0, 1, 2, 7])
def test_a_number_of_smaller_scenes_is_tried(tries):
    tried: list[Scene] = []
    assert findings.shrunk(pair(), lambda scene: tried.append(scene) or False, tries) == pair()
    assert len(tried) == min(tries, len(list(findings._smaller(pair()))))


def test_the_last_try_may_succeed():
    tried: list[Scene] = []
    smaller = list(findings._smaller(pair()))
    found = findings.shrunk(pair(), lambda scene: tried.append(scene) or len(tried) == 2, 2)
    assert found == smaller[1] and len(tried) == 2
    assert findings.TRIES == 60


def test_numbers_are_rounded_to_one_digit_then_to_two():
    exact = BLOCK.model_copy(
        update={"mass": 1.234, "inertia": (1.111, 1.222, 1.333), "velocity": (0.155, 0.0, 0.0)}
    )
    _, _, _, one, two = findings._simpler(SCENE.with_(body=(exact,)))
    for simpler, mass, inertia, speed in (
        (one, 1.2, (1.1, 1.2, 1.3), 0.2),
        (two, 1.23, (1.11, 1.22, 1.33), 0.15),
    ):
        [body] = simpler().body
        assert (
            body.mass == mass
            and body.inertia == inertia
            and body.velocity[0] == pytest.approx(speed, abs=0.006)
        )
        assert body.position == (0.0, 0.0, 0.0) and body.angular_velocity is None


# --- known violations ---------------------------------------------------------------------------------------
def test_explanations_by_engine_check_and_scene(monkeypatch, tmp_path):
    (tmp_path / "explained.toml").write_text(
        '[[violation]]\nengine = "e"\nchecks = ["a", "b"]\nscenes = ["s", "t"]\ncause = "c"\nremedy = "r"\n'
    )
    (tmp_path / "proved_by.toml").write_text('[[defect]]\nabout = "x"\nscene = "s"\ncheck = "a"\n')
    monkeypatch.setattr(explained, "FOLDER", Path(tmp_path))
    found = explained.explanations.__wrapped__()
    assert found == {("e", check, scene): ("c", "r") for check in "ab" for scene in "st"}
    assert explained.proofs.__wrapped__() == (explained.Proof("x", "s", "a"),)
    (tmp_path / "explained.toml").write_text("")
    assert explained.explanations.__wrapped__() == {}


# --- runners ------------------------------------------------------------------------------------------------
def test_a_runner_in_child_processes(monkeypatch):
    asked: list[Any] = []
    for name in ("ask", "observe", "run_isolated"):
        monkeypatch.setattr(runners, name, lambda *of, name=name: asked.append((name, *of)) or f"{name} done")
    monkeypatch.setattr(
        runners, "engine", lambda name: SimpleNamespace(rounding=0.25 if name == "e" else None)
    )
    made = runners.Isolated("e", 7.0)
    assert made.rounding == 0.25
    assert (
        made.offers(SCENE, "f") == made.refuses(SCENE, "f") == "ask done" and made.offers(SCENE) == "ask done"
    )
    assert made.observe(SCENE, "times", "setting") == "observe done"
    assert made.in_turn([(SCENE, "one"), (SCENE, "two")], "times") == ["run_isolated done"] * 2
    assert asked == [
        ("ask", "e", runners.serve.offered, (SCENE, "f"), 7.0),
        ("ask", "e", runners.serve.refused, (SCENE, "f"), 7.0),
        ("ask", "e", runners.serve.offered, (SCENE, ""), 7.0),
        ("observe", "e", SCENE, "times", "setting", 7.0),
        ("run_isolated", "e", SCENE, "times", "one", 7.0),
        ("run_isolated", "e", SCENE, "times", "two", 7.0),
    ]


def test_questions_to_an_engine_in_this_process(monkeypatch):
    monkeypatch.setattr(
        runners, "serve", SimpleNamespace(offers_of=lambda *of: ("offers", *of), refusal_of=lambda *of: of)
    )
    simulator = SimpleNamespace(name="own", rounding=0.5)
    made = runners.InProcess(simulator)
    assert made.offers(SCENE, "f") == ("offers", simulator, SCENE, "f") and made.name == "own"
    assert made.offers(SCENE) == ("offers", simulator, SCENE, "") and made.rounding == 0.5
    assert made.refuses(SCENE, "f") == (simulator, SCENE, "f")


@pytest.mark.parametrize(
    ("seconds", "is_main", "is_timed"),
    [(2.0, True, True), (np.inf, True, False), (2.0, False, False)],
)
def test_a_timer_of_cpu_time(monkeypatch, seconds, is_main, is_timed):
    """It ends with the block, also after a failure, and the handler before it is put back."""
    calls: list[Any] = []
    system = SimpleNamespace(
        SIGPROF="prof",
        ITIMER_PROF="timer",
        signal=lambda *of: calls.append(of) or "before",
        setitimer=lambda *of: calls.append(of),
    )
    threads = SimpleNamespace(
        current_thread=lambda: "main" if is_main else "other", main_thread=lambda: "main"
    )
    monkeypatch.setattr(runners, "signal", system)
    monkeypatch.setattr(runners, "threading", threads)
    with pytest.raises(ValueError), runners._within(seconds):
        calls.append("run")
        raise ValueError
    if not is_timed:
        assert calls == ["run"]
        return
    (name, end), *others = calls
    assert others == [("timer", 2.0), "run", ("timer", 0.0), ("prof", "before")] and name == "prof"
    with pytest.raises(runners._OutOfTime):
        end("prof", None)
    del system.setitimer
    calls.clear()
    with runners._within(seconds):
        pass
    assert calls == [], "a system without timers"


# --- names in verdicts --------------------------------------------------------------------------------------
OUTCOMES = {
    PASS: suite.Finding(0.5, 1.0, "r"),
    FAIL: suite.Broken("no end"),
    "outside": suite.Outside("no joint"),
    "cannot": "no loop",
}


@pytest.mark.parametrize("status", [*OUTCOMES, "unknown"])
def test_a_verdict_names_its_check_and_its_scene(monkeypatch, status):
    def check(bench: Any) -> Any:
        found = OUTCOMES.get(status, suite.NoExact("too slow"))
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr(suite, "PROPERTIES", {"closure": SimpleNamespace(check=check, version=1, about="")})
    found = suite.judged("closure", SimpleNamespace(scene=SCENE))
    assert (found.property, found.scene) == ("closure", "s")
    assert found.status == ("outside" if status == "unknown" else status)


@pytest.mark.parametrize(
    ("cannot", "settings", "impossible", "status"),
    [
        ("no loop", ["a"], False, "cannot"),
        ("no loop", ["a"], True, PASS),
        (None, ["a"], True, FAIL),
        (None, [], False, FAIL),
        (None, ["a"], False, PASS),
    ],
)
def test_a_refusal_names_its_check_and_its_scene(monkeypatch, cannot, settings, impossible, status):
    monkeypatch.setattr(suite, "is_undetermined", lambda scene: impossible)
    found = suite.refusal(SimpleNamespace(scene=SCENE, cannot=cannot, settings=settings))
    assert (found.property, found.scene, found.status) == (REFUSAL, "s", status)


def test_a_sentence_on_a_verdict():
    assert suite._sentence(Verdict("closure", "s", FAIL, 0.25, 0.125, "r")).plain == (
        "fail: s, closure: 0.25, allowed 0.125 (r)"
    )
    assert suite._sentence(Verdict("closure", "s", FAIL, 0.25, 0.125)).plain == (
        "fail: s, closure: 0.25, allowed 0.125"
    )
    assert suite._sentence(Verdict("closure", "s", "cannot", reason="r")).plain == "cannot: s, closure: r"


@pytest.mark.parametrize(
    ("verdicts", "conforms"),
    [
        ([Verdict(REFUSAL, "s", PASS)], False),
        ([Verdict(REFUSAL, "s", PASS), Verdict("truth", "s", "outside")], False),
        ([Verdict(REFUSAL, "s", PASS), Verdict("closure", "s", PASS)], True),
        ([Verdict("closure", "s", PASS), Verdict("truth", "s", FAIL)], False),
        ([Verdict("closure", "s", PASS), Verdict("truth", "s", "cannot")], True),
    ],
)
def test_an_engine_conforms_by_a_passed_check_of_a_run(verdicts, conforms):
    assert Conformance("e", "1", verdicts).conforms is conforms


@pytest.mark.parametrize(("status", "count"), [(PASS, 1), (FAIL, 1), ("cannot", 0), ("outside", 0)])
def test_scenes_that_were_run(status, count):
    said = suite._summary(
        Conformance("e", "1", [Verdict(RUN, "s", status), Verdict("closure", "t", PASS)])
    ).plain
    assert f"; {count} of 2 scenes run" in said and ("is not shown" in said) is (count == 0)
