"""The suite as pytest tests: ``pytest --pyargs crosscheck.conformance --engine NAME``.

Every check on every scene is a pytest test. The modules of the suite are imported only if the option
``--engine`` is given, so that other test runs import nothing.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from crosscheck.conformance.own_limits import OwnLimits
    from crosscheck.conformance.suite import Verdict
    from crosscheck.conformance.trial import Bench

KEPT = "crosscheck/verdicts"  # key of the stored verdicts in pytest's cache


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the command-line options of the suite."""
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
    group.addoption("--limits", metavar="FILE", help="own limits and expected failures, as of verify")
    group.addoption("--baseline", metavar="FILE", help="what verify --json printed: no worse does not fail")
    group.addoption(
        "--findings", metavar="DIR", help="folder in which failing scenes are stored, reduced to small ones"
    )
    group.addoption(
        "--resume", action="store_true", help="reuse passed checks of earlier runs from pytest's cache"
    )


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Return the line with engine, depth and seed, by which a run can be repeated."""
    if not config.getoption("engine"):
        return []
    seed, count = config.getoption("mechanism_seed"), config.getoption("mechanisms")
    return [
        f"crosscheck: engine {config.getoption('engine')}, {config.getoption('depth')}, "
        f"{count} random mechanisms from seed {seed}"
    ]


class Session:
    """The benches of a test run; a bench is made at first access."""

    def __init__(self, config: pytest.Config):
        from crosscheck.conformance.mechanisms.features import undetermined
        from crosscheck.conformance.mechanisms.large_graphs import large_graph
        from crosscheck.conformance.mechanisms.planar import is_planar, planar_specimens
        from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
        from crosscheck.conformance.mechanisms.specimens import Specimen, specimens
        from crosscheck.conformance.suite import runner
        from crosscheck.engine import engine

        self.config, self.name = config, config.getoption("engine")
        _check(self.name)
        limit = config.getoption("time_limit")
        self.runner = runner(self.name, limit, config.getoption("in_process"))
        deep, first = config.getoption("depth") == "deep", config.getoption("mechanism_seed")
        seeds = range(first, first + config.getoption("mechanisms"))
        drawn = [Specimen(random_mechanism(seed), None, deep) for seed in seeds]
        drawn += [Specimen(large_graph(seed), large=True) for seed in seeds]
        planar = planar_specimens() if is_planar(engine(self.name)) else []
        known = [Specimen(undetermined()), *specimens(deep), *planar, *drawn]
        if not deep:  # replace references, which take 20 s each, by Gauss's principle
            known = [replace(specimen, reference_time=0.0) for specimen in known]
        self.specimens = {specimen.scene.name: specimen for specimen in known}
        self.limits = _limits(config, self.specimens)
        self.benches: dict[str, Bench] = {}
        self.cache = config.cache if config.pluginmanager.hasplugin("cacheprovider") else None
        self.known = self.cache.get(KEPT, {}) if self.cache else {}

    def checks(self) -> list[tuple[str, str]]:
        """Return (scene, check) of every test."""
        from crosscheck.conformance.suite import REFUSAL, checks_of

        undetermined = next(iter(self.specimens))
        cases = [(undetermined, REFUSAL)]
        for name, specimen in list(self.specimens.items())[1:]:
            cases += [(name, check) for check in (REFUSAL, *checks_of(specimen))]
        return cases

    def bench(self, scene: str) -> Bench:
        """Return the bench of a scene; raises ChildFailed if the engine crashes while it is asked for its
        settings."""
        from crosscheck.conformance.trial import set_up

        if scene not in self.benches:
            self.benches = {scene: set_up(self.runner, self.specimens[scene])}  # keep only the latest bench
        return self.benches[scene]

    def verdict(self, scene: str, check: str) -> Verdict:
        """Return the verdict, or the stored verdict of an earlier run if the options request it."""
        from crosscheck.conformance.suite import CANNOT, PASS, REFUSAL, Verdict, verdict_on

        key = f"{self.name} {scene} {Verdict(check, scene, PASS).check()}"
        if self.config.getoption("resume") and self.known.get(key) == PASS:
            return Verdict(check, scene, PASS, reason="in an earlier run")
        bench = self.bench(scene)
        if bench.cannot and check != REFUSAL:
            return Verdict(check, scene, CANNOT, reason=str(bench.cannot))
        found = self.limits.judged(verdict_on(check, bench))
        self.known[key] = found.status
        if self.cache:
            self.cache.set(KEPT, self.known)
        return found


def _limits(config: pytest.Config, scenes: Collection[str]) -> OwnLimits:
    """Return the limits of the engine's author; raises pytest.UsageError for a faulty file."""
    from crosscheck.conformance.own_limits import OwnLimits, read_baseline, read_limits
    from mbref.records import RecordsError
    from mbref.scene import SceneError

    limits, baseline = config.getoption("limits"), config.getoption("baseline")
    try:
        found = read_limits(limits, scenes) if limits else OwnLimits()
        return replace(found, baseline=read_baseline(baseline)) if baseline else found
    except (SceneError, RecordsError, OSError) as error:
        raise pytest.UsageError(str(error)) from error


def _check(name: str) -> None:
    """Raise pytest.UsageError before any test if the name leads to no engine.

    The working directory is added to the module search path, also for child processes.
    """
    from crosscheck.engine import engine

    try:
        engine(name)
    except (LookupError, ImportError, AttributeError, ValueError) as error:
        raise pytest.UsageError(f"--engine {name}: {error}") from error


def pytest_configure(config: pytest.Config) -> None:
    """Create the session that the other hooks use."""
    config.stash[SESSION] = Session(config) if config.getoption("engine") else None


SESSION: pytest.StashKey[Session | None] = pytest.StashKey()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Create one test for every check on every scene."""
    if "crosscheck_case" in metafunc.fixturenames:
        session = metafunc.config.stash[SESSION]
        cases: list[Any] = session.checks() if session else []
        metafunc.parametrize("crosscheck_case", cases, ids=[f"{scene}: {check}" for scene, check in cases])


@pytest.fixture
def crosscheck_verdict(crosscheck_case: tuple[str, str], request: pytest.FixtureRequest) -> Verdict:
    """Return the verdict on a check. If it fails and ``--findings`` is given, its scene is reduced and
    stored."""
    from crosscheck.conformance.findings import found
    from crosscheck.conformance.suite import FAIL

    session = request.config.stash[SESSION]
    assert session is not None
    verdict, folder = session.verdict(*crosscheck_case), request.config.getoption("findings")
    if verdict.status == FAIL and folder:
        path = found(session.bench(verdict.scene), verdict, Path(folder))
        request.node.add_report_section("call", "finding", f"kept as {path}")
    return verdict
