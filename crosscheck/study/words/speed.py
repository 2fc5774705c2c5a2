"""Sentences on speed: the times in which engines reach an error, and who provides their integrators."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from crosscheck.engine import engine
from crosscheck.judge.tolerances import ERROR_LEVELS
from crosscheck.study.grades import Judged
from crosscheck.study.grid import Record
from crosscheck.study.words.text import listed, multiple, seconds, span

TITLES = {
    "mujoco": "MuJoCo",
    "pinocchio": "Pinocchio",
    "exudyn": "Exudyn",
    "simbody": "Simbody",
    "sundials": "SUNDIALS IDA",
    "ondsel": "OndselSolver",
    "casadi": "CasADi",
    "drake": "Drake",
    "dart": "DART",
    "bullet": "Bullet",
    "mjx": "MJX",
    "warp": "MuJoCo Warp",
    "newton": "Newton",
}
LEVEL = ERROR_LEVELS[1]  # largest error of the runs whose speeds are compared in words
SAID = f"{LEVEL:.0e}".replace("e-0", "e-")

COMPILED = (
    ", compiled"  # suffix in the names of settings (families) that call an engine's library without Python
)
CLOCK = " Times are CPU seconds of stepping"
ADAPTERS = ", each engine as crosscheck's Python adapter calls it."
WITHOUT_PYTHON = (
    ": families with “compiled” in their names call an engine's library without Python, all others are "
    "called by crosscheck's Python adapter."
)


def title(engine: str) -> str:
    """Return an engine's name as its authors write it."""
    return TITLES.get(engine, engine)


def engines_of(groups: Sequence[Judged]) -> list[str]:
    """Return the engines that are judged on any of the scenes."""
    return list(dict.fromkeys(name for group in groups for name in group.engines()))


def fast(groups: Sequence[Judged]) -> str:
    """Return sentences on the stepping times that reach LEVEL, as multiples of the fastest time, and on runs
    that crosscheck integrates."""
    found = {group.scene.name: group.costs(LEVEL) for group in groups}
    costs = {name: cost for name, cost in found.items() if cost}
    if not any(group.is_judged for group in groups):
        return "Without a truth no error is known, so speeds are not compared."
    others = [n for n in engines_of(groups) if not any(n in cost for cost in costs.values())]
    untimed = [n for n in others if any(n in group.cheapest(LEVEL) for group in groups)]
    if not costs and not untimed:
        return f"No engine reaches an error of {SAID}, so speeds are not compared."
    if not costs:
        each = (
            f"{listed(map(title, untimed))} {'reaches' if len(untimed) == 1 else 'reach'} an error of {SAID}"
        )
        return f"{each}, without a time of stepping, so speeds are not compared."
    never = [n for n in others if n not in untimed]
    end = f" {listed(map(title, never))} {'does' if len(never) == 1 else 'do'} not reach it." if never else ""
    end += (
        f" {listed(map(title, untimed))} {'gives' if len(untimed) == 1 else 'give'} no time."
        if untimed
        else ""
    )
    aided = {
        (n, g.scene.name) for g in groups for n, (_, r) in g.fastest(LEVEL).items() if is_integrated_here(r)
    }
    [(scene, single), *_] = costs.items()
    text = (
        _fast_on_one(single, {n for n, place in aided if place == scene})
        if len(groups) == 1
        else _fast_on_several(costs, aided, len(groups))
    )
    return text + end + _integrated(groups) + CLOCK + (WITHOUT_PYTHON if _has_compiled(groups) else ADAPTERS)


def _integrated(groups: Sequence[Judged]) -> str:
    """Return clauses on engines whose fastest runs crosscheck integrates, with the time of their own
    integrators."""
    found: dict[str, dict[str, None]] = {}
    for group in groups:
        for name, (_, record) in group.fastest(LEVEL).items():
            if is_integrated_here(record):
                found.setdefault(name, {})[record["family"]] = None
    return "".join(_by_crosscheck(groups, name, [*families]) for name, families in found.items())


def _by_crosscheck(groups: Sequence[Judged], name: str, families: Sequence[str]) -> str:
    quoted = listed(f"“{family}”" for family in families)
    text = f" {title(name)}'s fastest runs are integrated by crosscheck ({quoted})"
    runs = [r for group in groups for r in group.comparable if r["engine"] == name]
    others = dict.fromkeys(f"“{r['family']}”" for r in runs if not is_integrated_here(r))
    if not others:
        return f"{text}, as all of its runs here are."
    runs_by_own = f"the runs by its own integrators ({listed(others)})"
    own = [group.fastest(LEVEL, without=is_integrated_here).get(name) for group in groups]
    reached = [found for found in own if found is not None]
    if not reached:
        return f"{text}; {runs_by_own} do not reach {SAID}."
    if len(groups) > 1:
        return f"{text}; {runs_by_own} reach {SAID} on {len(reached)} of {len(groups)} scenes."
    [(cost, record)] = reached
    return f"{text}; its own integrator needs {seconds(cost)} (“{record['family']}”)."


def is_integrated_here(record: Record) -> bool:
    """Return whether crosscheck integrates the runs of a record's family, using the engine's
    accelerations."""
    try:
        return record["family"] in engine(record["asked"]["engine"]).integrated_here
    except LookupError:
        return False


def _has_compiled(groups: Sequence[Judged]) -> bool:
    """Return whether a family calls an engine's library without Python."""
    return any(record["family"].endswith(COMPILED) for group in groups for record in group.records)


def _fast_on_one(costs: Mapping[str, float], aided: Collection[str]) -> str:
    (first, least), *others = sorted(costs.items(), key=lambda item: item[1])
    text = f"{_whose(first, aided)} reaches an error of {SAID} in {seconds(least)} of stepping"
    if not others:
        return f"{text}."
    return (
        f"{text}; {listed(f'{title(name)} takes {multiple(cost / least)} as long' for name, cost in others)}."
    )


def _whose(name: str, aided: Collection[str]) -> str:
    """Return the engine as the subject of a sentence, with a note if crosscheck integrates the engine's
    runs."""
    return f"{title(name)}, integrated by crosscheck," if name in aided else title(name)


def _fast_on_several(
    costs: Mapping[str, Mapping[str, float]], aided: Collection[tuple[str, str]], scenes: int
) -> str:
    """Return sentences on the engine that is the fastest most often; on some of the scenes no engine may
    reach LEVEL."""
    winners = {scene: min(cost, key=lambda n: cost[n]) for scene, cost in costs.items()}
    count = {name: list(winners.values()).count(name) for name in dict.fromkeys(winners.values())}
    first = max(count, key=lambda n: count[n])
    ratios = [
        min(c for n, c in cost.items() if n != first) / cost[first]
        for scene, cost in costs.items()
        if winners[scene] == first and len(cost) > 1
    ]
    wins = [scene for scene, name in winners.items() if name == first]
    by_us = {first} if all((first, scene) in aided for scene in wins) else ()
    text = (
        f"{_whose(first, by_us)} is the fastest to an error of {SAID} on {_share(wins, len(costs), scenes)}"
    )
    if ratios:
        text += f"; the best other engine takes {span(min(ratios), max(ratios))} as long"
    others = [f"{title(n)} on {listed(s for s, w in winners.items() if w == n)}" for n in count if n != first]
    return text + (f". On all other scenes the fastest is {listed(others)}." if others else ".")


def _share(wins: Sequence[str], reached: int, scenes: int) -> str:
    """Return the words for the scenes of the fastest engine among those on which an engine reaches LEVEL."""
    if reached == 1:
        return f"{wins[0]}, the only scene on which an engine reaches it"
    every = "both" if reached == 2 else f"all {reached}"
    if reached == scenes:
        return f"{every if len(wins) == reached else f'{len(wins)} of {reached}'} scenes"
    share = every if len(wins) == reached else f"{len(wins)} of the {reached}"
    return f"{share} scenes on which an engine reaches it"
