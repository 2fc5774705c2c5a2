"""The suite as pytest tests: ``pytest --pyargs crosscheck.conformance --engine NAME``.

Every card on every scene is a test.  The modules of the suite are imported when an engine is named, so that
other test runs in the same environment load nothing.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from crosscheck.conformance.suite import Verdict
    from crosscheck.conformance.trial import Bench

KEPT = "crosscheck/verdicts"  # key of earlier verdicts in pytest's cache


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of the suite."""
    group = parser.getgroup("crosscheck", "conformance of an engine")
    group.addoption("--engine", metavar="NAME", help="the engine to test, or module:attribute")
    group.addoption(
        "--depth", choices=("quick", "deep"), default="quick", help="deep: all relations on all scenes"
    )
    group.addoption("--mechanisms", type=int, default=0, metavar="N", help="random mechanisms besides")
    group.addoption(
        "--mechanism-seed",
        type=int,
        default=0,
        metavar="S",
        help="seed of the first random mechanism (default 0)",
    )
    group.addoption(
        "--in-process", action="store_true", help="run in this process: fast, but a crash ends all"
    )
    group.addoption("--time-limit", type=float, default=60.0, metavar="T", help="of a run, s (60)")
    group.addoption("--findings", metavar="DIR", help="keep what fails as small scene files there")
    group.addoption(
        "--resume", action="store_true", help="reuse passed checks of earlier runs from pytest's cache"
    )


def pytest_report_header(config: pytest.Config) -> list[str]:
    """The seed and the depth, so that a run can be repeated."""
    if not config.getoption("engine"):
        return []
    seed, count = config.getoption("mechanism_seed"), config.getoption("mechanisms")
    return [
        f"crosscheck: engine {config.getoption('engine')}, {config.getoption('depth')}, "
        f"{count} random mechanisms from seed {seed}"
    ]


class Session:
    """The benches of a test run, made when first asked for."""

    def __init__(self, config: pytest.Config):
        from crosscheck.conformance.features import undetermined
        from crosscheck.conformance.planar import is_planar, planar_specimens
        from crosscheck.conformance.random_mechanisms import random_mechanism
        from crosscheck.conformance.suite import runner
        from crosscheck.conformance.trial import Specimen, specimens
        from crosscheck.engine import engine

        self.config, self.name = config, config.getoption("engine")
        _check(self.name)
        limit = config.getoption("time_limit")
        self.runner = runner(self.name, limit, config.getoption("in_process"))
        deep, first = config.getoption("depth") == "deep", config.getoption("mechanism_seed")
        seeds = range(first, first + config.getoption("mechanisms"))
        drawn = [Specimen(random_mechanism(seed), None, deep) for seed in seeds]
        planar = planar_specimens() if is_planar(engine(self.name)) else []
        known = [Specimen(undetermined()), *specimens(deep), *planar, *drawn]
        if not deep:  # Gauss's principle in the place of references, which take 20 s for a mechanism
            known = [replace(specimen, reference_time=0.0) for specimen in known]
        self.specimens = {specimen.scene.name: specimen for specimen in known}
        self.benches: dict[str, Bench] = {}
        self.cache = config.cache if config.pluginmanager.hasplugin("cacheprovider") else None
        self.known = self.cache.get(KEPT, {}) if self.cache else {}

    def cards(self) -> list[tuple[str, str]]:
        """(scene, card) of every test."""
        from crosscheck.conformance.suite import REFUSAL, cards_of

        undetermined = next(iter(self.specimens))
        cases = [(undetermined, REFUSAL)]
        for name, specimen in list(self.specimens.items())[1:]:
            cases += [(name, card) for card in (REFUSAL, *cards_of(specimen))]
        return cases

    def bench(self, scene: str) -> Bench:
        """The bench of a scene; raises ChildFailed where the engine cannot even answer."""
        from crosscheck.conformance.trial import set_up

        if scene not in self.benches:
            self.benches = {scene: set_up(self.runner, self.specimens[scene])}  # only the last is kept
        return self.benches[scene]

    def verdict(self, scene: str, card: str) -> Verdict:
        """The verdict, taken from a run before where that is asked for."""
        from crosscheck.conformance.suite import CANNOT, PASS, REFUSAL, Verdict, verdict_on

        key = f"{self.name} {scene} {Verdict(card, scene, PASS).card()}"
        if self.config.getoption("resume") and self.known.get(key) == PASS:
            return Verdict(card, scene, PASS, reason="in an earlier run")
        bench = self.bench(scene)
        if bench.cannot and card != REFUSAL:
            return Verdict(card, scene, CANNOT, reason=str(bench.cannot))
        found = verdict_on(card, bench)
        self.known[key] = found.status
        if self.cache:
            self.cache.set(KEPT, self.known)
        return found


def _check(name: str) -> None:
    """Raise pytest.UsageError before any test if the name leads to no engine.

    A module of the working directory is found, and child processes find it as well.
    """
    from crosscheck.engine import engine

    try:
        engine(name)
    except (LookupError, ImportError, AttributeError, ValueError) as error:
        raise pytest.UsageError(f"--engine {name}: {error}") from error


def pytest_configure(config: pytest.Config) -> None:
    """Make the session's benches known to the hooks."""
    config.stash[SESSION] = Session(config) if config.getoption("engine") else None


SESSION: pytest.StashKey[Session | None] = pytest.StashKey()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test for every card on every scene."""
    if "crosscheck_card" in metafunc.fixturenames:
        session = metafunc.config.stash[SESSION]
        cases: list[Any] = session.cards() if session else []
        metafunc.parametrize("crosscheck_card", cases, ids=[f"{scene}: {card}" for scene, card in cases])


@pytest.fixture
def crosscheck_verdict(crosscheck_card: tuple[str, str], request: pytest.FixtureRequest) -> Verdict:
    """The verdict on a card; where it fails and ``--findings`` is given, its scene is made small and kept."""
    from crosscheck.conformance.findings import found
    from crosscheck.conformance.suite import FAIL

    session = request.config.stash[SESSION]
    assert session is not None
    verdict, folder = session.verdict(*crosscheck_card), request.config.getoption("findings")
    if verdict.status == FAIL and folder:
        path = found(session.bench(verdict.scene), verdict, Path(folder))
        request.node.add_report_section("call", "finding", f"kept as {path}")
    return verdict
