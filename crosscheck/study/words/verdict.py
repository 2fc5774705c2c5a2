"""The verdict in words: which engines are right, how fast they are, and where each fails, computed from
records."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from crosscheck.study.grades import Grade, Judged, grade
from crosscheck.study.grid import Record
from crosscheck.study.record_view import error, error_text
from crosscheck.study.words.file import as_in_file, free_falls
from crosscheck.study.words.speed import fast, title
from crosscheck.study.words.text import (
    agree,
    at_most,
    is_or_are,
    its_or_their,
    listed,
    uncapitalised,
)
from crosscheck.study.words.truth import names, stands_still, truth, up_to

TIMED_OUT = "TIMED_OUT"


class Verdict(NamedTuple):
    """Sentences of a verdict; ``headline`` is the shortest one."""

    headline: str
    right: str
    fast: str
    breaks: str
    truth: str
    file: str = ""

    def labelled(self) -> dict[str, str]:
        """Return the sentences below the headline, each with its question."""
        own = {"How wrong the file is": self.file} if self.file else {}
        answers = {**own, "Who is right": self.right, "How fast": self.fast, "Where each breaks": self.breaks}
        return {**answers, "How the truth is known": self.truth}


def verdict(groups: Sequence[Judged], difference: str | None = None) -> Verdict:
    """Return the verdict on one or several scenes.

    Times are not compared if there is no truth and the engines' mechanisms have a ``difference``.
    """
    times = f"Times are not compared, the engines simulate different mechanisms: {difference}."
    return Verdict(
        headline=" ".join([headline(groups), *stands_still(groups), *free_falls(groups)]),
        right=right(groups),
        fast=times if difference else fast(groups),
        breaks=breaks(groups),
        truth=truth(groups),
        file=as_in_file(groups),
    )


def headline(groups: Sequence[Judged]) -> str:
    """Return one line: engines that are right at their best settings and at their defaults, and how much of
    the motions is known."""
    reported = [group for group in groups if group.is_judged]
    others = not_judged(groups)
    if not reported and others:
        return f"{others}."
    if not reported:
        these = "this motion" if len(groups) == 1 else "these motions"
        return f"There is no reference for {these}: the engines are compared with each other."
    at_best = _worst(reported, Judged.best)
    good = [name for name, found in at_best.items() if found is Grade.RIGHT]
    first = (
        f"{'Both' if len(good) == 2 else f'All {len(good)}'} engines are right at their best settings"
        if len(good) == len(at_best) > 1
        else f"{listed(map(title, good))} {is_or_are(good)} right at {its_or_their(good)} best settings"
        if good
        else f"No engine is right{_everywhere(groups)} at any setting that was run"
    )
    far = up_to(reported)
    if far:
        first = f"{far}, {uncapitalised(first)}"
    end = f"; {others}" if others else ""
    return f"{first}{_where_known(groups, reported, good)}; {_defaults_in_short(reported)}{end}."


def not_judged(groups: Sequence[Judged]) -> str:
    """Return a clause on the engines whose mechanism differs from a scene; empty if all engines simulate the
    scene."""
    found = list(dict.fromkeys(name for group in groups for name in group.differences))
    if not found:
        return ""
    scenes = [group for group in groups if group.differences]
    where = "" if len(groups) == 1 else f" on {names(scenes)}"
    names_of = listed(map(title, found))
    return f"{names_of} {is_or_are(found)} not judged{where}: the adapter or the scene differs"


def _reasons(groups: Sequence[Judged]) -> list[str]:
    """Return a sentence on each engine that is not judged."""
    return [
        f"{title(name)} is not judged{'' if len(groups) == 1 else f' on {group.scene.name}'}, because the "
        f"adapter or the scene differs: {difference}."
        for group in groups
        for name, difference in group.differences.items()
    ]


def right(groups: Sequence[Judged]) -> str:
    """Return sentences on the errors at the best settings; without a truth, on the differences between
    engines."""
    reported = [group for group in groups if group.is_judged]
    if not reported:
        alike = [group for group in groups if not group.differences]
        return " ".join([*map(_agreement, alike), *_reasons(groups)])
    errors: dict[str, list[float]] = {}
    for group in reported:
        for name, record in group.best().items():
            errors.setdefault(name, []).append(
                error(record) if grade(record) is not Grade.FAILED else math.inf
            )
    worst = {name: max(found) for name, found in errors.items()}
    sure = max(group.truth["bound"] for group in reported)
    good = [name for name, e in worst.items() if math.isfinite(e) and _of(reported, name) is Grade.RIGHT]
    sentences = []
    if good:
        most = at_most(max(worst[name] for name in good), sure)
        where = _on(reported, good) if len(reported) == len(groups) else f" on {names(reported)}"
        far = " as far as it is known" if any(group.truth["reason"] for group in reported) else ""
        sentences = [f"{listed(map(title, good))} {agree(good)} with the truth to {most}{where}{far}."]
    sentences += [_less_than_right(reported, name) for name in worst if name not in good]
    return " ".join([*sentences, *_reasons(groups)])


def breaks(groups: Sequence[Judged]) -> str:
    """Return sentences on defaults that fail, are wrong or inaccurate, with the scenes."""
    failed = _where(groups, Grade.FAILED)
    sentences = [_failed(groups, name, scenes) for name, scenes in _merged(failed).items()]
    for bad in (Grade.WRONG, Grade.INACCURATE):
        sentences += [_off(name, scenes, groups, bad) for name, scenes in _where(groups, bad).items()]
    if not sentences:
        sentences = [_no_bad_defaults(groups)]
    return " ".join(sentences) + _other_failures(groups)


def _no_bad_defaults(groups: Sequence[Judged]) -> str:
    """Return the sentence on the defaults if none is known to fail, to be wrong or inaccurate."""
    found = _worst(groups, Judged.defaults)
    if not found:
        return "No run used a library's default settings."
    unjudged = [name for name, verdict in found.items() if verdict is Grade.UNJUDGED]
    if unjudged:
        owners = listed(map(title, unjudged))
        return f"The defaults of {owners} complete; without a truth it is unknown whether they are right."
    return f"The defaults of {listed(map(title, found))} are right."


def _agreement(group: Judged) -> str:
    """Return sentences on the two engines that agree best, and on the distance of all others from them."""
    apart = group.agreement()
    if not apart:
        return f"{group.scene.name}: no two engines completed the motion, so nothing can be compared."
    (a, b), least = min(apart.items(), key=lambda item: item[1])
    others = [n for n in group.engines() if n not in (a, b) and any(n in pair for pair in apart)]
    far = [f"{title(n)} {min(d for pair, d in apart.items() if n in pair):.1e}" for n in others]
    ends = f"; the nearest of them from the others: {', '.join(far)}" if far else ""
    return f"The finest runs of {title(a)} and {title(b)} agree to {least:.1e}{ends}."


def _less_than_right(groups: Sequence[Judged], name: str) -> str:
    """Return the sentence on an engine that is not right on all scenes: its worst scene."""
    found = {g.scene.name: g.best()[name] for g in groups if name in g.best()}
    graded = {scene: grade(record) for scene, record in found.items()}
    lost = [scene for scene, verdict in graded.items() if verdict is Grade.FAILED]
    if lost:
        ends = [f"{'' if len(groups) == 1 else f' on {scene}'}: {_end(found[scene])}" for scene in lost]
        return f"{title(name)} completes no run{','.join(ends)}."
    scene = max(found, key=lambda s: error(found[s]))
    place = "" if len(groups) == 1 else f" on {scene}"
    best = f"at best{_of_those_that_end(groups, scene, name)}"
    return f"{title(name)} is {graded[scene]} {best}{place}: off by {error_text(found[scene])}."


def _of_those_that_end(groups: Sequence[Judged], scene: str, name: str) -> str:
    """Return a clause on the time limit if it ended settings that might be better than the best completed
    setting."""
    records = next(g.records for g in groups if g.scene.name == scene)
    limits = {r["time_limit"] for r in records if r["engine"] == name and r["outcome"] == TIMED_OUT}
    return f" of the settings that end within {max(limits):g} s" if limits else ""


def _where(groups: Sequence[Judged], bad: Grade) -> dict[str, list[Judged]]:
    """Return for each grade the scenes on which an engine's defaults have the grade."""
    found: dict[str, list[Judged]] = {}
    for group in groups:
        for name, record in group.defaults().items():
            if grade(record) is bad:
                found.setdefault(name, []).append(group)
    return found


def _merged(found: Mapping[str, list[Judged]]) -> dict[tuple[str, ...], list[Judged]]:
    """Return one sentence for all engines whose defaults fail in an equal way on equal scenes."""
    scenes = {name: tuple(g.scene.name for g in groups) for name, groups in found.items()}
    return {
        tuple(n for n in found if scenes[n] == key): found[next(n for n in found if scenes[n] == key)]
        for key in dict.fromkeys(scenes.values())
    }


def _failed(groups: Sequence[Judged], names: Sequence[str], scenes: Sequence[Judged]) -> str:
    ends = {f"{max(g.defaults()[n]['t_end'], 0):.3g}" for g in scenes for n in names}
    outcomes = {g.defaults()[n]["outcome"] for g in scenes for n in names}
    when = f"end at t = {next(iter(ends))} s" if len(ends) == 1 else "do not complete"
    when = "do not end within the time limit" if outcomes == {TIMED_OUT} else when
    rows = [g.redundant for g in scenes]
    cause = ""
    if all(rows) and outcomes != {TIMED_OUT}:
        cause = (
            ", where constraints are redundant"
            if len(rows) > 1 or rows[0] > 1
            else ", where a constraint is redundant"
        )
    where = _place(scenes, groups)
    return f"The defaults of {listed(map(title, names))} {when}{where}{cause}."


def _off(name: str, scenes: Sequence[Judged], groups: Sequence[Judged], bad: Grade) -> str:
    """Return the sentence on an engine whose defaults have a grade by their error: wrong or inaccurate."""
    errors = [error(group.defaults()[name]) for group in scenes]
    off = f"{errors[0]:.2g}" if len(errors) == 1 else f"{min(errors):.2g} to {max(errors):.2g}"
    where = _place(scenes, groups)
    if bad is Grade.WRONG:
        return f"{title(name)}'s defaults complete{where}, but with an error of {off} at best."
    return f"{title(name)}'s defaults are inaccurate{where}, with an error of {off} at best."


def _other_failures(groups: Sequence[Judged]) -> str:
    """Return a sentence that counts failed and wrong runs at settings other than the defaults."""
    runs = [r for group in groups for r in group.comparable if r["family"] != "defaults"]
    bad = {verdict: [r for r in runs if grade(r) is verdict] for verdict in (Grade.FAILED, Grade.WRONG)}
    verbs = {Grade.FAILED: "", Grade.WRONG: f"{is_or_are(bad[Grade.WRONG])} "}
    reported = [f"{len(found)} {verbs[verdict]}{verdict}" for verdict, found in bad.items() if found]
    return f" Of {len(runs)} runs at other settings, {listed(reported)}." if reported else ""


def _defaults_in_short(groups: Sequence[Judged]) -> str:
    at_defaults = _worst(groups, Judged.defaults)
    good = [name for name, found in at_defaults.items() if found is Grade.RIGHT]
    if not at_defaults:
        return "no library has defaults for it"
    if len(at_defaults) == 1:
        only = f"with its library's defaults {title(*at_defaults)} is"
        return f"{only}, too" if good else f"{only} not"
    shown = listed(map(title, at_defaults))
    if not good:
        none = (
            f"neither {' nor '.join(map(title, at_defaults))}"
            if len(at_defaults) == 2
            else f"none of {shown}"
        )
        return f"with their libraries' defaults {none} is"
    if len(good) == len(at_defaults):
        return f"so are the libraries' defaults of {shown}"
    return f"with the libraries' defaults of {shown} only {listed(map(title, good))} {is_or_are(good)}"


def _worst(groups: Sequence[Judged], records: Callable[[Judged], Mapping[str, Record]]) -> dict[str, Grade]:
    """Return the worst grade of each engine over the scenes of which it has records."""
    order = list(Grade)
    found: dict[str, Grade] = {}
    for group in groups:
        for name, record in records(group).items():
            found[name] = max(found.get(name, Grade.RIGHT), grade(record), key=order.index)
    return found


def _of(groups: Sequence[Judged], name: str) -> Grade:
    return _worst(groups, Judged.best)[name]


def _end(record: Record) -> str:
    if record["outcome"] == TIMED_OUT:
        return f"no result within {record['time_limit']:g} s (--time-limit)"
    return f"{record['outcome'].lower().replace('_', ' ')} at t = {max(record['t_end'], 0):.3g} s"


def _place(scenes: Sequence[Judged], groups: Sequence[Judged]) -> str:
    """Return the text ``on …`` with the names of the scenes; empty if the comparison has one scene only."""
    if len(groups) == 1:
        return ""
    return f" on {names(scenes)}" if len(scenes) < len(groups) else _on(groups)


def _on(groups: Sequence[Judged], engines: Sequence[str] = ()) -> str:
    """Return the text ``on all 5 scenes``, or the scenes that the named engines can run; empty for one
    scene."""
    count = len(groups)
    if any(name not in group.engines() for name in engines for group in groups):
        return " on the scenes they can run" if len(engines) > 1 else " on the scenes it can run"
    return "" if count == 1 else " on both scenes" if count == 2 else f" on all {count} scenes"


def _where_known(groups: Sequence[Judged], reported: Sequence[Judged], good: Sequence[str]) -> str:
    """Return the clause that names the scenes to which a headline applies."""
    if len(reported) < len(groups):
        return f" on {names(reported)}, whose {'motion is' if len(reported) == 1 else 'motions are'} known"
    return _on(groups, good) if good else ""


def _everywhere(groups: Sequence[Judged]) -> str:
    return "" if len(groups) == 1 else " on every scene"
