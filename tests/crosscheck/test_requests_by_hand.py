"""Requests of command lines and verdicts of the suite / stand-in engines, each answer worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.table import Table
from rich.text import Text

from crosscheck.cli import request
from crosscheck.cli.request import Choice, RequestError
from crosscheck.conformance import suite
from crosscheck.conformance.suite import CANNOT, FAIL, OUTSIDE, PASS, Conformance, Verdict
from crosscheck.conformance.trial import Broken, Finding, NoExact, Outside
from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.processes.pool import ChildFailed
from crosscheck.study.grid import Case
from mbref.scenes import SCENES
from mbref.trajectory import Outcome

SCENE, TIMES = SCENES["four_bar"](), np.array([0.0, 0.1])
MISSING = ("c", "d")
FAMILIES = {"a": ("x", "y"), "b": ("x", "z")}


class Stand:
    """An engine of two families; its package may be missing, and it may refuse scenes."""

    with_default = ()

    def __init__(self, name: str) -> None:
        self.name, self.package, self.options = name, f"package-{name}", {"size": "a size"}

    def version(self) -> str:
        if self.name in MISSING:
            raise ImportError
        return "1"

    def cannot(self, scene: Any) -> Cannot | None:
        return Cannot(Owner.MODEL, "no hinge") if self.name == "b" else None

    def has_family(self, name: str) -> bool:
        return self.name == "a" and name.startswith("own")


def stand(name: str) -> Stand:
    if name not in "abcd":
        raise LookupError(f"unknown engine {name!r}")
    return Stand(name)


def cases(*engines: str) -> list[Case]:
    return [
        Case(SCENE, TIMES, name, Setting(family, {"rtol": r} if family != "z" else {"step": r}), 5.0)
        for name in engines
        for family in FAMILIES[name]
        for r in (1e-3, 1e-6)
    ]


@pytest.fixture(autouse=True)
def _stand_ins(monkeypatch):
    monkeypatch.setattr(request, "engine", stand)
    monkeypatch.setattr(request, "all_engines", lambda: ["a", "b"])
    monkeypatch.setattr(request, "default_engines", lambda: ["b"])
    monkeypatch.setattr(request, "shown_name", str.upper)


def test_engines_by_name():
    notices: list[str] = []
    assert request.find_engines(None, notices.append) == ["b"]
    assert request.find_engines(["all", "a"], notices.append) == ["a", "b"] and not notices
    assert request.find_engines(["c", "a", "d"], notices.append) == ["a"]
    assert notices == [
        f"{name}: the package package-{name} is not installed: pip install package-{name}" for name in MISSING
    ]
    with pytest.raises(RequestError) as caught:
        request.find_engines(["c", "d"], notices.append)
    assert list(caught.value.faults) == notices
    with pytest.raises(RequestError, match="unknown engine 'e'"):
        request.find_engines(["a", "e"], notices.append)


def test_an_engine_that_does_not_load(monkeypatch):
    for error, says in (
        (ImportError("no module"), "engine 'a' cannot be loaded: no module"),
        (ZeroDivisionError("by zero"), "engine 'a' cannot be loaded: ZeroDivisionError: by zero ("),
    ):

        def fails(name: str, error: Exception = error) -> None:
            raise error

        monkeypatch.setattr(request, "engine", fails)
        assert request._unknown_engine("a").startswith(says)


def chosen(
    monkeypatch, choice: Choice, *engines: str, refused: tuple[str, ...] = ()
) -> list[tuple[str, ...]]:
    unable = [SimpleNamespace(engine=name, cannot="no hinge") for name in refused]
    monkeypatch.setattr(request, "default_cases", lambda *_: (cases(*engines), unable))
    notices: list[str] = []
    found = request.plan([SCENE], engines, choice, [TIMES], 5.0, notices.append)
    return [(c.engine, c.setting.family, *map(str, c.setting.options.values())) for c in found], notices


def test_plans_of_families_and_tolerances(monkeypatch):
    every, notices = chosen(monkeypatch, Choice(is_quick=False), "a", "b", refused=("c",))
    assert len(every) == 8 and notices == ["C cannot run four_bar: no hinge"]
    named, notices = chosen(monkeypatch, Choice(["y"], is_quick=False), "a", "b")
    assert named == [("a", "y", "0.001"), ("a", "y", "1e-06")]
    assert notices == ["B has no setting y here and is left out"]
    tight, _ = chosen(monkeypatch, Choice(None, None, 1e-9), "a", "b")
    assert tight == [
        ("a", "x", "1e-09"),
        ("a", "y", "1e-09"),
        ("b", "x", "1e-09"),
        ("b", "z", "0.001"),
        ("b", "z", "1e-06"),
    ], "a family without a tolerance keeps its sweep"
    own, _ = chosen(monkeypatch, Choice(["own+method"], is_quick=False), "a", "b")
    assert own == [("a", "own+method", "0.001"), ("a", "own+method", "1e-06")], "options of the first family"
    for choice, says in (
        (Choice(["w"]), "unknown method or setting 'w'; known: 'x', 'y', 'z'"),
        (Choice(None, None, 0.0), "--rtol: must be positive, got 0"),
        (Choice(None, None, float("inf")), "--rtol: must be positive, got inf"),
    ):
        with pytest.raises(RequestError, match=says):
            chosen(monkeypatch, choice, "a", "b")
    with pytest.raises(RequestError, match="C cannot run four_bar: no hinge"):
        chosen(monkeypatch, Choice(), refused=("c",))
    with pytest.raises(RequestError, match="--time-limit: must be positive, got 0"):
        request.plan([SCENE], ["a"], Choice(), [TIMES], 0.0, print)


def test_one_setting_with_its_options(monkeypatch):
    monkeypatch.setattr(request, "of_file", lambda name, scene: [])
    monkeypatch.setattr(request, "scout", lambda *_: None)
    monkeypatch.setattr(request, "settings", lambda name, scene: [c.setting for c in cases(name)])
    notices: list[str] = []

    def single(engine: str, family: str, **options: float) -> list[Case]:
        setting = Setting(family, options)
        return request.plan([SCENE], [engine], Choice(None, setting), [TIMES], 7.0, notices.append)

    [case] = single("a", "x", rtol=0.5, size=3.0)
    assert (case.engine, case.setting, case.time_limit) == (
        "a",
        Setting("x", {"rtol": 0.5, "size": 3.0}),
        7.0,
    )
    with pytest.raises(
        RequestError, match=r"a x has no option 'rtoll'; it has: rtol, size; did you mean 'rtol'"
    ):
        single("a", "x", rtoll=0.5)
    with pytest.raises(RequestError, match=r"^--option: a x also needs rtol, for example --option rtol="):
        single("a", "x", size=3.0)
    with pytest.raises(RequestError, match=r"b cannot run four_bar: .*no hinge"):
        single("b", "x", rtol=0.5)
    assert len(single("a", "unlisted", anything=1.0)) == 1, "a family that the sweep does not have"
    of_file = Setting("as in file", {"file": "m.xml", "step": 0.1})
    monkeypatch.setattr(request, "of_file", lambda name, scene: [of_file])
    [case] = single("b", "as in file", step=0.5)
    assert case.setting.options == {"file": "m.xml", "step": 0.5}, (
        "an engine runs the file it refuses as a scene"
    )


def test_specimens_by_name_and_from_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr(request, "left_out", lambda engine: {"planar four-bar"} if engine else set())
    SCENE.save(tmp_path / "mine.toml")
    path = str(tmp_path / "mine.toml")
    first, second = request.find_specimens(["heavy top", path, "heavy top"], 3.0)
    assert (first.scene.name, second.scene.name) == ("heavy top", "four_bar")
    assert first.reference_time == second.reference_time == 3.0 and second.related and second.exact is None
    with pytest.raises(RequestError, match=r"unknown scene of the suite 'heavy tip'; known: .*did you mean"):
        request.find_specimens(["heavy tip"], 3.0)
    names = [s.scene.name for s in request.find_specimens(None, 3.0)]
    assert len(names) == len(set(names)) > 40


def bench(**more: Any) -> SimpleNamespace:
    made = {"scene": SCENE, "cannot": None, "settings": ["s"], "motion": SimpleNamespace(t_end=0.25)}
    return SimpleNamespace(**{**made, **more})


def test_refusals_and_first_runs(monkeypatch):
    gap = Cannot(Owner.MODEL, "no hinge")
    refused = suite.refusal(bench(cannot=gap))
    assert (refused.status, refused.reason) == (CANNOT, str(gap)) and suite.refusal(bench()).status == PASS
    empty = suite.refusal(bench(settings=[]))
    assert (empty.status, empty.reason) == (FAIL, "it offers no setting")
    monkeypatch.setattr(suite, "is_undetermined", lambda scene: True)
    assert suite.refusal(bench(cannot=gap)).status == PASS
    assert suite.refusal(bench()).reason == "cannot() does not refuse a motion without masses"
    assert suite.first_run(bench()) == Verdict("run", "four_bar", PASS, reason="reached 0.25 s")


class Ending:
    """A bench whose run does not complete."""

    scene, cannot, settings = SCENE, None, ("s",)

    @property
    def motion(self) -> Any:
        raise Broken("it ended early")


def test_a_run_that_does_not_complete_ends_the_examination():
    assert suite.first_run(Ending()) == Verdict("run", "four_bar", FAIL, reason="it ended early")
    ending = Ending()
    ending.specimen = SimpleNamespace(scene=SCENE, dead_end=False, related=False)
    assert [v.property for v in suite.examine(ending)] == ["refusal", "run"]
    assert suite.checks_of(ending.specimen)[0] == "run"
    ending.specimen.dead_end = True
    assert suite.checks_of(ending.specimen) == ["dead end"]
    refusing = bench(cannot=Cannot(Owner.MODEL, "no hinge"), specimen=ending.specimen)
    assert [v.property for v in suite.examine(refusing)] == ["refusal"]


@pytest.mark.parametrize(
    ("result", "status", "reason"),
    [
        (Finding(1.0, 1.0, "r"), PASS, "r"),
        (Finding(1.1, 1.0, ""), FAIL, ""),
        (Outside("no joint"), OUTSIDE, "no joint"),
        (Broken("bad motion"), FAIL, "bad motion"),
        (ChildFailed(Outcome.CRASHED, "it crashed"), FAIL, "it crashed"),
        (NoExact("too slow"), OUTSIDE, "its exact motion is not known: too slow"),
        (Cannot(Owner.MODEL, "no slide"), CANNOT, str(Cannot(Owner.MODEL, "no slide"))),
    ],
)
def test_verdict_of_a_check(monkeypatch, result, status, reason):
    def check(bench: Any) -> Any:
        if isinstance(result, Exception):
            raise result
        return result

    monkeypatch.setattr(suite, "PROPERTIES", {"unit": SimpleNamespace(check=check, version=1, about="")})
    found = suite.judged("unit", bench())
    assert (found.status, found.reason) == (status, reason)
    if isinstance(result, Finding):
        assert (found.measured, found.allowed) == (result.measured, result.allowed)


VERDICTS = (
    Verdict("refusal", "one", PASS),
    Verdict("run", "one", PASS),
    Verdict("unit", "one", PASS, 2e-13, 1e-12),
    Verdict("closure", "one", PASS, 5e-7, 1e-6),
    Verdict("truth", "one", OUTSIDE, reason="no truth"),
    Verdict("refusal", "two", CANNOT, reason="no hinge"),
    Verdict("run", "three", FAIL, reason="it ended"),
    Verdict("unit", "three", FAIL, 3e-12, 1e-12, "long"),
    Verdict("truth", "three", OUTSIDE, reason="no truth"),
)


def test_table_of_verdicts():
    table, *texts = suite.tables(Conformance("e", "1.0", VERDICTS, "fast", "hint: look"))
    assert isinstance(table, Table) and table.title.startswith(
        "e 1.0 fast: checks that ✓ pass, ✗ fail, – cannot"
    )
    rows = list(zip(*([str(cell) for cell in column.cells] for column in table.columns), strict=True))
    assert rows == [
        ("one", "4", "", "", "1", "closure at 50 % of its limit"),
        ("two", "", "", "1", "", ""),
        ("three", "", "2", "", "1", "run, unit"),
    ]
    lines = [text.plain for text in texts if isinstance(text, Text)]
    assert lines[0] == "cannot: two, refusal: no hinge"
    assert lines[1] == "outside: truth: no truth (one, three)"
    checks = [line.split(":")[0] for line in lines[2:7]]
    assert checks == ["refusal/1", "run/1", "unit/1", "closure/1", "truth/2"]
    assert lines[-4:] == [
        "fail: three, run: it ended",
        "fail: three, unit: 3e-12, allowed 1e-12 (long)",
        "hint: look",
        "e: 4 pass, 2 fail, 1 cannot, 2 outside; 2 of 3 scenes run",
    ]
    refusing = suite._summary(Conformance("e", "1.0", VERDICTS[5:6])).plain
    assert refusing.endswith("0 of 1 scenes run; an engine that runs no scene is not shown to conform")


def test_an_engine_conforms_if_a_run_passes_and_nothing_fails():
    def conforms(*verdicts: Verdict) -> bool:
        return Conformance("e", "1", verdicts).conforms

    assert conforms(*VERDICTS[:6]) and not conforms(*VERDICTS)
    assert not conforms(VERDICTS[0], VERDICTS[5]) and not conforms()
    record = Conformance("e", "1", (Verdict("truth", "one", FAIL, float("inf"), 1.0),)).to_record()
    [verdict] = record["verdicts"]
    assert verdict["card"] == "truth/2" and verdict["measured"] is None and record["conforms"] is False
    first = suite._failures(
        [SimpleNamespace(scene=SimpleNamespace(name=n)) for n in ("one", "three")], VERDICTS
    )
    assert [(f.specimen.scene.name, f.check) for f in first] == [("three", "unit")]
