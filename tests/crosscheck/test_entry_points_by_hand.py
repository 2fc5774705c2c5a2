"""Ways into crosscheck / stand-ins: `python -m crosscheck`, public names, the suite under pytest."""

from __future__ import annotations

import importlib
import sys
from types import SimpleNamespace
from typing import Any

import pytest

import crosscheck
from crosscheck.cli import commands
from crosscheck.conformance import pytest_plugin, random_mechanisms, suite, trial
from crosscheck.conformance import test_engine as of_an_engine
from crosscheck.conformance.suite import Verdict
from mbref.scenes import SCENES


def test_module_runs_the_command_line_and_ends_with_its_status(monkeypatch):
    monkeypatch.setattr(commands, "main", lambda: 7)
    monkeypatch.delitem(sys.modules, "crosscheck.__main__", raising=False)
    with pytest.raises(SystemExit) as ended:
        from crosscheck import __main__
    assert ended.value.code == 7, __main__


def test_public_names_are_found_at_first_access():
    for name in crosscheck.__all__:
        module, attribute = crosscheck._PLACE_OF[name]
        assert getattr(crosscheck, name) is getattr(importlib.import_module(module), attribute), name
    assert {*crosscheck.__all__} == {*crosscheck._PLACE_OF} <= {*dir(crosscheck)} and "__all__" in dir(
        crosscheck
    )
    assert dir(crosscheck) == sorted(dir(crosscheck))
    with pytest.raises(AttributeError, match="module 'crosscheck' has no attribute 'nothing'"):
        crosscheck.nothing  # noqa: B018


def test_verdicts_pass_fail_or_skip_a_test():
    of_an_engine.test_check(Verdict("closure", "s", "pass", 1.0, 2.0))
    with pytest.raises(AssertionError, match=r"^s: closure/\d+ 0.5, allowed 0.25 it drifts\n"):
        of_an_engine.test_check(Verdict("closure", "s", "fail", 0.5, 0.25, "it drifts"))
    with pytest.raises(AssertionError, match=r"^s: other/1 it ends\n"):
        of_an_engine.test_check(Verdict("other", "s", "fail", reason="it ends"))
    for status in ("cannot", "outside"):
        with pytest.raises(pytest.skip.Exception, match=f"^{status}: no mass$"):
            of_an_engine.test_check(Verdict("closure", "s", status, reason="no mass"))


def test_options_of_the_suite_under_pytest():
    options: dict[str, dict[str, Any]] = {}
    group = SimpleNamespace(addoption=lambda name, **kinds: options.update({name: kinds}))
    pytest_plugin.pytest_addoption(SimpleNamespace(getgroup=lambda *_: group))
    assert list(options) == [
        *("--engine", "--depth", "--mechanisms", "--mechanism-seed"),
        *("--in-process", "--time-limit", "--findings", "--resume"),
    ]
    defaults = {name: kinds.get("default") for name, kinds in options.items() if "default" in kinds}
    assert defaults == {"--depth": "quick", "--mechanisms": 0, "--mechanism-seed": 0, "--time-limit": 60.0}
    assert options["--depth"]["choices"] == ("quick", "deep")


class Config:
    """A configuration of pytest with options, and a cache in memory."""

    def __init__(self, **options: Any) -> None:
        known = {"engine": "mbref", "depth": "quick", "mechanisms": 0, "mechanism_seed": 0, "time_limit": 9.0}
        known |= {"in_process": True, "findings": None, "resume": False}
        self.options, self.kept, self.has_cache = known | options, {}, True
        self.cache = SimpleNamespace(get=self.kept.get, set=self.kept.__setitem__)
        self.pluginmanager = SimpleNamespace(
            hasplugin=lambda name: self.has_cache and name == "cacheprovider"
        )
        self.stash = pytest.Stash()

    def getoption(self, name: str) -> Any:
        return self.options[name]


def test_header_has_engine_depth_and_seed():
    assert pytest_plugin.pytest_report_header(Config(engine=None)) == []
    [line] = pytest_plugin.pytest_report_header(Config(depth="deep", mechanisms=3, mechanism_seed=5))
    assert line == "crosscheck: engine mbref, deep, 3 random mechanisms from seed 5"
    pytest_plugin.pytest_configure(none := Config(engine=None))
    assert none.stash[pytest_plugin.SESSION] is None


@pytest.fixture
def session(monkeypatch):
    """Sessions on two specimens; a bench is the name of its scene."""

    def specimens(deep: bool = False) -> list[Any]:
        return [trial.Specimen(scene("a"), None, deep), trial.Specimen(scene("b"))]

    def scene(name: str) -> Any:
        return SCENES["heavy_top"]().model_copy(update={"name": name})

    made: list[Any] = []
    monkeypatch.setattr(trial, "specimens", specimens)
    monkeypatch.setattr(random_mechanisms, "random_mechanism", lambda seed: scene(f"random {seed}"))
    monkeypatch.setattr(suite, "runner", lambda *given: given)
    monkeypatch.setattr(suite, "checks_of", lambda specimen: [f"check of {specimen.scene.name}"])

    def set_up(runner: Any, specimen: Any) -> Any:
        made.append((runner, specimen.scene.name))
        return SimpleNamespace(
            scene=specimen.scene.name, cannot="no loop" if specimen.scene.name == "b" else None
        )

    def verdict_on(check: str, bench: Any) -> Verdict:
        made.append(check)
        return Verdict(check, bench.scene, "fail" if "fails" in check else "pass")

    monkeypatch.setattr(trial, "set_up", set_up)
    monkeypatch.setattr(suite, "verdict_on", verdict_on)

    def session(**options: Any) -> pytest_plugin.Session:
        found = pytest_plugin.Session(Config(**options))
        found.made = made
        return found

    return session


def test_specimens_and_checks_of_a_session(session):
    quick = session()
    assert quick.runner == ("mbref", 9.0, True)
    undetermined, *names = quick.specimens
    assert names == ["a", "b"] and {s.reference_time for s in quick.specimens.values()} == {0.0}
    refusal = suite.REFUSAL
    assert quick.checks() == [
        (undetermined, refusal),
        ("a", refusal),
        ("a", "check of a"),
        ("b", refusal),
        ("b", "check of b"),
    ]
    deep = session(depth="deep", mechanisms=2, mechanism_seed=7)
    drawn = [name for name in deep.specimens if name not in (undetermined, "a", "b")]
    assert drawn == ["random 7", "random 8"]
    assert deep.specimens["a"].reference_time > 0.0, "references are computed"
    assert deep.specimens["a"] == trial.Specimen(deep.specimens["a"].scene, None, True)


def test_verdicts_of_a_session_are_kept_and_reused_if_asked(session):
    first = session()
    assert first.verdict("a", "check of a").status == "pass"
    assert first.made == [(first.runner, "a"), "check of a"]
    assert first.verdict("a", "other that fails").status == "fail"
    assert first.made[2:] == ["other that fails"], "one bench a scene"
    key = "mbref a check of a/1"
    assert first.config.kept[pytest_plugin.KEPT] == {key: "pass", "mbref a other that fails/1": "fail"}
    refused = first.verdict("b", "check of b")
    assert (refused.status, refused.reason) == ("cannot", "no loop") and list(first.benches) == ["b"]
    assert first.verdict("b", suite.REFUSAL).status == "pass", "the refusal itself is judged"
    first.made.clear()
    first.config.options["resume"] = True
    again = first.verdict("a", "check of a")
    assert (again.status, again.reason, first.made) == ("pass", "in an earlier run", [])
    assert first.verdict("a", "other that fails").status == "fail" and first.made
    bare = session()
    bare.config.has_cache = False
    uncached = pytest_plugin.Session(bare.config)
    assert uncached.cache is None and uncached.verdict("a", "check of a").status == "pass"
    assert pytest_plugin.KEPT not in bare.config.kept


def test_a_test_for_each_check(session):
    made: list[Any] = []
    config = Config(engine=None)
    config.stash[pytest_plugin.SESSION] = SimpleNamespace(checks=lambda: [("a", "x"), ("b", "y")])
    called = SimpleNamespace(
        fixturenames=["crosscheck_case"],
        config=config,
        parametrize=lambda *given, ids: made.append((*given, ids)),
    )
    pytest_plugin.pytest_generate_tests(called)
    assert made == [("crosscheck_case", [("a", "x"), ("b", "y")], ["a: x", "b: y"])]
    called.fixturenames = ["other"]
    pytest_plugin.pytest_generate_tests(called)
    assert len(made) == 1
    called.fixturenames, config.stash[pytest_plugin.SESSION] = ["crosscheck_case"], None
    pytest_plugin.pytest_generate_tests(called)
    assert made[1] == ("crosscheck_case", [], [])
