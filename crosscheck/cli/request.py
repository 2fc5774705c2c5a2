"""Validation of a command line's request before anything runs: scenes, engines and sample times."""

from __future__ import annotations

import dataclasses
import math
import traceback
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from crosscheck.cli.scene_request import Notice, RequestError
from crosscheck.conformance.mechanisms.features import undetermined
from crosscheck.conformance.mechanisms.planar import left_out, planar_specimens
from crosscheck.conformance.mechanisms.specimens import Specimen, specimens
from crosscheck.engine import ALL, BUILT_IN, all_engines, default_engines, engine
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.pieces import events
from crosscheck.study.grid import shown_name
from mbref.command_line import MOST_DURATION
from mbref.scene import Scene, intervals
from mbref.scene.fields import meant

if TYPE_CHECKING:
    from crosscheck.conformance.own_limits import OwnLimits

SAMPLES = 101
MOST_STATES = 5_000_000  # states of a body that all runs of a command keep: they need about 1 kB each


def find_engines(names: Sequence[str] | None, notice: Notice) -> list[str]:
    """Return the named engines, every installed engine for "all", or the default engines. An engine whose
    package is missing is left out with a ``notice``. Raises RequestError for an unknown name, and if no
    engine is left."""
    named = [name for given in names or () for name in (all_engines() if given == ALL else [given])]
    wanted = list(dict.fromkeys(named or default_engines()))
    faults = [fault for name in wanted if (fault := _unknown_engine(name))]
    if faults:
        raise RequestError(*faults)
    missing = {name: reason for name in wanted if (reason := missing_package(name))}
    if len(missing) == len(wanted):
        raise RequestError(*missing.values())
    for reason in missing.values():
        notice(reason)
    found = [name for name in wanted if name not in missing]
    if faults := [*_equal_names(found)]:
        raise RequestError(*faults)
    return found


def _equal_names(names: Sequence[str]) -> Iterator[str]:
    """Yield a fault for each engine whose records would have the name of another engine."""
    shown: dict[str, str] = {}
    for name in names:
        if (first := shown.setdefault(shown_name(name), name)) != name:
            yield (
                f"engines {first!r} and {name!r} both have the name {shown_name(name)!r}: "
                "give the attribute `name` of one another value"
            )


def find_engine(name: str, notice: Notice) -> str:
    """Return the name of one installed engine. Raises RequestError as ``find_engines``, and for "all"."""
    if name == ALL:
        raise RequestError(f"ENGINE: must be one engine, got {ALL!r}")
    return find_engines([name], notice)[0]


def find_specimens(names: Sequence[str] | None, reference_time: float, name: str = "") -> list[Specimen]:
    """Return the scenes of the conformance suite with these names, or all of them, each with its truth.
    ``reference_time`` is the CPU time (s) of a reference. Planar loops are added if the engine called
    ``name`` refuses spatial ones. Every check is made on the scene of a ``.toml`` file. Raises RequestError
    for an unknown name, SceneError for a faulty file."""
    suite = [*specimens(), *planar_specimens()]
    known = {s.scene.name: dataclasses.replace(s, reference_time=reference_time) for s in suite}
    given = {
        name: Specimen(Scene.from_file(name), None, True, reference_time=reference_time)
        for name in names or ()
        if name.endswith(".toml")
    }
    if unknown := [name for name in names or () if name not in known and name not in given]:
        said = f"; known: {', '.join(known)}"
        raise RequestError(*(f"unknown scene of the suite {n!r}{said}{meant(n, known)}" for n in unknown))
    others = left_out(engine(name) if name else None)
    chosen = names or [scene for scene in known if scene not in others]
    return [{**known, **given}[scene] for scene in dict.fromkeys(chosen)]


def find_limits(limits: str | None, baseline: str | None, files: Sequence[str]) -> OwnLimits:
    """Return the limits of an engine's author in the named files; ``files`` are further scenes. Raises
    SceneError for a faulty file."""
    from crosscheck.conformance.own_limits import OwnLimits, read_baseline, read_limits

    known = [undetermined().name, *(s.scene.name for s in (*specimens(), *planar_specimens()))]
    known += [Scene.from_file(name).name for name in files if name.endswith(".toml")]
    found = read_limits(limits, known) if limits else OwnLimits()
    return dataclasses.replace(found, baseline=read_baseline(baseline)) if baseline else found


def _unknown_engine(name: str) -> str | None:
    """Return the fault of an engine name that leads to no engine; ``module:attribute`` is allowed, too."""
    try:
        engine(name)
    except LookupError as error:
        return str(error.args[0])
    except (ImportError, AttributeError, ValueError) as error:
        return f"engine {name!r} cannot be loaded: {error}"
    except Exception as error:  # the import of an adapter can raise any exception
        last = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {error} ({last.filename}, line {last.lineno})"
        return f"engine {name!r} cannot be loaded: {said}"
    return None


def missing_package(name: str) -> str | None:
    """Return the sentence on how to install a missing engine, or None if it is installed."""
    try:
        engine(name).version()
    except ImportError:
        package = engine(name).package
        what = "'mbref[engines]'" if name in BUILT_IN else package
        return f"{name}: the package {package} is not installed: pip install {what}"
    return None


def lasting(scene: Scene, times: Sequence[float] | None, duration: float | None) -> Scene:
    """Return the scene with the requested end time, for which engines then choose their settings. Without a
    ``duration`` (s) the last of the ``times`` is the end. Raises RequestError if the end is not positive,
    later than MOST_DURATION, or earlier than a sample time."""
    if times is not None:
        _check_times(times)
    end = duration if duration is not None else times[-1] if times else scene.duration
    if not 0 < end <= MOST_DURATION:
        option = "--times: the end" if times and duration is None else "--duration:"
        raise RequestError(f"{option} must be positive and at most {MOST_DURATION:g} s, got {end:g}")
    if times and times[-1] > end:
        raise RequestError(f"--times: must end by --duration {end:g}, got {times[-1]:g}")
    return scene if end == scene.duration else scene.with_(duration=end)


def sample_times(scene: Scene, times: Sequence[float] | None, samples: int) -> np.ndarray:
    """Return the given sample times (k,) in s, or ``samples`` equally spaced ones over the scene's duration.
    Raises RequestError if they are not finite, negative or not increasing, or too many for the scene."""
    if times is not None:
        _check_times(times)
        return np.array(times)
    most = max(MOST_STATES // len(scene.body), 2)
    if not 2 <= samples <= most:
        bodies = f"the {len(scene.body)} bodies of {scene.name}"
        raise RequestError(f"--samples: at least 2 and at most {most} for {bodies}, got {samples}")
    return intervals.samples_at(np.linspace(0.0, scene.duration, samples), events(scene, np.inf))


def check_gap(gap: float | None, scene: Scene) -> None:
    """Raise RequestError for a closure gap (m) that exceeds the length of the mechanism."""
    most = scene_length(scene)
    if gap is not None and gap > most:
        raise RequestError(f"--closure: must be at most the mechanism's length, {most:.3g} m, got {gap:g} m")


def _check_times(times: Sequence[float]) -> None:
    for before, after in zip((-math.inf, *times), times, strict=False):
        if not (math.isfinite(after) and after >= 0):
            raise RequestError(f"--times: must be finite and not negative, got {after:g}")
        if after <= before:
            raise RequestError(f"--times: must increase, got {after:g} after {before:g}")
    if times[-1] == 0:
        raise RequestError("--times: must have a time after 0")
