"""Ways of an engine at a user's model: solvers, matrices and constraint models that must agree there.

Ways are compared at the start, in accelerations and forces of the joints, which no step changes. Ways of an
engine that gives no accelerations are compared in the mean accelerations of a motion of a millisecond.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from crosscheck.alternatives.table import causes
from crosscheck.conformance.agreeing import ACCELERATION, FORCE, MEAN, Way, runs_of, way_of, worst_of
from crosscheck.conformance.runners import InProcess, Isolated, Runner
from crosscheck.conformance.trial import Broken
from crosscheck.engine import Alternatives, engine
from crosscheck.judge.model_identity import acceleration_scale
from crosscheck.judge.pieces import has_pieces
from crosscheck.processes.child import ChildFailed
from crosscheck.processes.pool import ask
from crosscheck.study.words.speed import TITLES
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene

WAY_SECONDS = 5.0  # CPU seconds for one way; slower ways are left out
ENGINE_SECONDS = (
    10.0  # CPU seconds, and seconds of waiting, for all ways of an engine; a slower one is left out
)
AT_START = (ACCELERATION, FORCE)


class Disagreement(NamedTuple):
    """Two ways of an engine that differ at a model: engine, names, relative difference, and a sentence."""

    engine: str
    ways: tuple[str, str]
    apart: float
    sentence: str


def disagreements(scene: Scene, engines: Sequence[str]) -> list[Disagreement]:
    """Return the worst pair of each group of ways that differ above their limit, of installed engines; none
    for a scene whose constraints come and go."""
    if has_pieces(scene) or not scene.has_mass() or not acceleration_scale(scene):
        return []
    return [one for name in engines for one in _of_engine(scene, name)]


def disagreements_in_process(name: str, scene: Scene) -> list[Disagreement]:
    """Return the worst pairs of an engine's groups of ways, from runs in this process."""
    return _found(InProcess(engine(name), name, WAY_SECONDS), scene)


def _of_engine(scene: Scene, name: str) -> list[Disagreement]:
    asked = engine(name)
    count = sum(len(group.ways) for group in asked.alternatives)
    if not count or asked.cannot(scene):
        return []
    try:
        limit = ENGINE_SECONDS + count * asked.compile_seconds
        return list(ask(name, disagreements_in_process, (scene,), limit))
    except ChildFailed as failure:
        if failure.outcome is Outcome.TIMED_OUT:
            return []
        return _found(Isolated(name, WAY_SECONDS), scene)  # a way has ended the process of all


def _found(runner: Runner, scene: Scene) -> list[Disagreement]:
    found = (_worst(runner, scene, group) for group in runner.alternatives)
    return [one for one in found if one]


def _worst(runner: Runner, scene: Scene, group: Alternatives) -> Disagreement | None:
    ways = {}
    for name, run in runs_of(runner, scene, group, 0.0).items():
        try:
            ways[name] = _at_start(way_of(scene, run))
        except Broken:  # it says itself that it cannot solve this
            continue
    if len(ways) < 2:
        return None
    worst, words = worst_of(scene, group.within, ways)
    if worst.size <= group.within:
        return None
    title = f"{TITLES.get(runner.name, runner.name)} {engine(runner.name).version()}"
    sentence = f"{title}: {words} (by {worst.size:.2g} of the largest){_known(runner.name, worst.ways)}"
    return Disagreement(runner.name, worst.ways, worst.size, sentence)


def _at_start(way: Way) -> Way:
    """Return a way with its accelerations and forces at the start alone; with mean accelerations if it has
    none."""
    own = {name: values[:1] for name, values in way.quantities.items() if name in AT_START}
    return way._replace(quantities=own if ACCELERATION in own else {MEAN: way.quantities[MEAN]})


def _known(name: str, ways: tuple[str, str]) -> str:
    """Return the command that shows the finding on a way, if one is known."""
    known = (each.finding for each in causes() if each.engine == name and each.way in ways)
    return next((f"; `crosscheck findings {finding}`" for finding in known if finding), "")
