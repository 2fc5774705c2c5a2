"""Runs that a command line requests: scenes, engines and settings."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from crosscheck.cli.options import LOOSEST
from crosscheck.cli.request import MOST_STATES
from crosscheck.cli.scene_request import Notice, RequestError
from crosscheck.engine import Setting, engine
from crosscheck.study.grid import MOST_SECONDS, Case, shown_name
from crosscheck.study.search.offers import default_cases, of_file, scout, settings
from crosscheck.study.search.selection import of_few_families
from mbref.command_line import each_once
from mbref.scene import Scene
from mbref.scene.fields import meant


class Choice(NamedTuple):
    """Selection of settings: ``families`` of settings (None: all) or one ``setting``, at the tolerance
    ``rtol`` (None: the sweep over tolerances). ``is_quick`` selects a few families of settings."""

    families: Sequence[str] | None = None
    setting: Setting | None = None
    rtol: float | None = None
    is_quick: bool = True

    @property
    def is_named(self) -> bool:
        """Return whether the user named families or a setting."""
        return self.families is not None or self.setting is not None


def choice(
    engines: Sequence[str], families: Sequence[str], options: Sequence[tuple[str, Any]] | None,
    rtol: float | None, is_quick: bool,
) -> Choice:  # fmt: skip
    """Return the selection of settings that a command line makes. Raises RequestError for options of a
    setting without the name of one engine and one family, and for a tolerance beyond its ends."""
    if rtol is not None and not 0 < rtol <= LOOSEST:
        raise RequestError(f"--rtol: must be positive and at most {LOOSEST:g}, got {rtol:g}")
    if options is None:
        return Choice(families or None, None, rtol, is_quick)
    if len(engines) != 1 or len(families) != 1:
        raise RequestError("--option: needs one --engine and one --setting to which the option belongs")
    return Choice(families, Setting(families[0], each_once("--option", options)), rtol, is_quick)


def plan(
    scenes: Sequence[Scene], engines: Sequence[str], chosen: Choice, times: Sequence[np.ndarray],
    time_limit: float, notice: Notice,
) -> list[Case]:  # fmt: skip
    """Return the runs of every scene in every engine that can simulate it, with the selected settings.
    ``times`` has one array (k,) for each scene. An engine that cannot run a scene is left out with a
    ``notice``. Raises RequestError for families that no engine has, with the engines' reasons if no run is
    left, and for more than MOST_STATES states."""
    if not 0 < time_limit <= MOST_SECONDS:
        raise RequestError(
            f"--time-limit: must be positive and at most {MOST_SECONDS:g} s, got {time_limit:g}"
        )
    cases = _planned(scenes, engines, chosen, times, time_limit, notice)
    states = sum(len(case.times) * len(case.scene.body) for case in cases)
    if states > MOST_STATES:
        raise RequestError(
            f"--samples: {len(cases)} runs would keep {states} states of bodies, at most {MOST_STATES} are "
            "allowed: ask for fewer samples, engines (--engine) or settings (--setting)"
        )
    return cases


def _planned(
    scenes: Sequence[Scene], engines: Sequence[str], chosen: Choice, times: Sequence[np.ndarray],
    time_limit: float, notice: Notice,
) -> list[Case]:  # fmt: skip
    if chosen.setting is not None:
        return _single(scenes, engines[0], chosen.setting, times, time_limit)
    cases = _able(scenes, engines, times, time_limit, notice)
    if chosen.families is not None:
        cases = _named(cases, chosen.families, notice)
    if chosen.rtol is not None:
        return _at_tolerance(cases, chosen.rtol)
    return of_few_families(cases, chosen.families or ()) if chosen.is_quick else cases


def _single(
    scenes: Sequence[Scene], name: str, setting: Setting, times: Sequence[np.ndarray], time_limit: float
) -> list[Case]:
    """Return one run of each scene with the given setting; raises RequestError for scenes that the engine
    refuses."""
    gaps = {s.name: engine(name).cannot(s) for s in scenes if not of_file(name, s)}
    if faults := [f"{name} cannot run {scene}: {gap}" for scene, gap in gaps.items() if gap]:
        raise RequestError(*faults)
    scout([name], scenes, lambda _: None)
    whole = [_with_file(scene, name, setting) for scene in scenes]
    faults = [fault for scene in scenes for fault in _strange_options(scene, name, setting)]
    if not faults:
        pairs = zip(scenes, whole, strict=True)
        faults = [fault for scene, each in pairs for fault in _missing_options(scene, name, each)]
    if faults:
        raise RequestError(*dict.fromkeys(faults))
    return [Case(s, when, name, each, time_limit) for s, when, each in zip(scenes, times, whole, strict=True)]


def _with_file(scene: Scene, name: str, setting: Setting) -> Setting:
    """Return the setting, with the options of the scene's original file if the setting runs the model of that
    file."""
    own = next((s for s in of_file(name, scene) if s.family == setting.family), None)
    return setting if own is None else Setting(setting.family, {**own.options, **setting.options})


def _strange_options(scene: Scene, name: str, setting: Setting) -> list[str]:
    """Return a sentence for each option that neither the settings of the family nor the engine knows; no
    sentence if the engine's sweep does not contain the family."""
    sweep = settings(name, scene)
    own = [offered.options for offered in sweep if offered.family == setting.family]
    swept = {option for offered in sweep for option in offered.options}
    general = [option for option in engine(name).options if option not in swept]
    known = list(dict.fromkeys([*(option for options in own for option in options), *general]))
    return [
        f"--option: {name} {setting.family} has no option {option!r}; it has: {', '.join(known)}"
        + meant(option, known)
        for option in setting.options
        if own and option not in known
    ]


def _missing_options(scene: Scene, name: str, setting: Setting) -> list[str]:
    """Return a sentence on the options that all settings of the family have and this setting lacks, with an
    example; no sentence if the setting lacks none."""
    own = [offered.options for offered in settings(name, scene) if offered.family == setting.family]
    shared = [option for option in own[0] if all(option in each for each in own)] if own else []
    missing = [o for o in shared if o not in setting.options and o not in engine(name).with_default]
    example = " ".join(f"--option {option}={json.dumps(own[-1][option])}" for option in missing)
    what = f"--option: {name} {setting.family} also needs {' and '.join(missing)}, for example {example}"
    return [what] if missing else []


def _able(
    scenes: Sequence[Scene], engines: Sequence[str], times: Sequence[np.ndarray], time_limit: float,
    notice: Notice,
) -> list[Case]:  # fmt: skip
    """Return every setting of every engine that can run a scene; raises RequestError if no engine can."""
    cases, reasons = [], []
    for scene, when in zip(scenes, times, strict=True):
        able, unable = default_cases(scene, engines, None, when, time_limit)
        cases += able
        reasons += [f"{shown_name(u.engine)} cannot run {scene.name}: {u.cannot}" for u in unable]
    if not cases:
        raise RequestError(*reasons)
    for reason in reasons:
        notice(reason)
    return cases


def _named(cases: Sequence[Case], families: Sequence[str], notice: Notice) -> list[Case]:
    """Return the cases of the named families; an engine without any of them is left out with a ``notice``."""
    chosen = _of_families(cases, families)
    for name in dict.fromkeys(case.engine for case in cases):
        if all(case.engine != name for case in chosen):
            notice(f"{shown_name(name)} has no setting {' or '.join(families)} here and is left out")
    return chosen


def _of_families(cases: Sequence[Case], families: Sequence[str]) -> list[Case]:
    """Return the cases of the named families. A family that an engine accepts but does not list takes the
    options of the engine's first family. Raises RequestError for a family that no engine has."""
    offered = dict.fromkeys(case.setting.family for case in cases)
    beyond = {family: _having(family, cases) for family in dict.fromkeys(families) if family not in offered}
    if faults := [_unknown_family(family, offered) for family, having in beyond.items() if not having]:
        raise RequestError(*faults)
    added = [
        case._replace(setting=Setting(family, case.setting.options))
        for family, having in beyond.items()
        for case in _of_first_family(cases, having)
    ]
    return [case for case in cases if case.setting.family in families] + added


def _having(family: str, cases: Sequence[Case]) -> list[str]:
    """Return the names of the engines among the cases that accept the family."""
    return [name for name in dict.fromkeys(case.engine for case in cases) if engine(name).has_family(family)]


def _of_first_family(cases: Sequence[Case], engines: Sequence[str]) -> list[Case]:
    """Return for each engine the cases of the first family in its sweep."""
    first = {name: next(c.setting.family for c in cases if c.engine == name) for name in engines}
    return [case for case in cases if first.get(case.engine) == case.setting.family]


def _unknown_family(name: str, offered: Iterable[str]) -> str:
    known = [*offered]
    listed = ", ".join(map(repr, known))  # names such as 'taylor, compiled' have commas
    return f"unknown method or setting {name!r}; known: {listed}{meant(name, known)}"


def _at_tolerance(cases: Sequence[Case], rtol: float) -> list[Case]:
    """Return one run at the tolerance for each family that has a tolerance; other families keep their
    sweep."""
    chosen: dict[tuple[str, str, str], Case] = {}
    for case in cases:
        options = dict(case.setting.options)
        if "rtol" in options:
            options["rtol"] = rtol
        setting = Setting(case.setting.family, options)
        chosen.setdefault((case.scene.name, case.engine, str(setting)), case._replace(setting=setting))
    return list(chosen.values())
