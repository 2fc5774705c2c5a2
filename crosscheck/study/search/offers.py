"""Settings that the engines offer for scenes, and the runs at all of them.

An engine may run a scene to find its settings, so each pair of engine and scene is asked once.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import NamedTuple

import numpy as np

from crosscheck.engine import Cannot, Owner, Setting, engine
from crosscheck.judge.start import started
from crosscheck.processes.child import ChildFailed
from crosscheck.processes.interrupts import calls_ended
from crosscheck.processes.pool import READY_SECONDS, capabilities
from crosscheck.study.grid import TIME_LIMIT, Case, shown_name
from mbref.formats import OriginalRun
from mbref.scene import Scene

SAMPLES = 101  # sample times of a default case, both ends included

Offer = tuple[Setting, ...] | Cannot  # the settings of an engine for a scene, or its refusal

_found: dict[tuple[str, Scene], Offer] = {}
_of_files: dict[Scene, tuple[OriginalRun, ...]] = {}  # scenes read from files, with one duration


def remember(scene: Scene, originals: Sequence[OriginalRun]) -> None:
    """Offer runs of the file that a scene was read from among the settings of their engines."""
    _of_files[_any_duration(scene)] = tuple(originals)


def of_file(engine_name: str, scene: Scene) -> tuple[Setting, ...]:
    """Return the settings by which an engine runs the file that a scene was read from."""
    runs = _of_files.get(_any_duration(scene), ()) if _of_files else ()
    return tuple(Setting(run.family, run.options) for run in runs if run.engine == engine_name)


def _any_duration(scene: Scene) -> Scene:
    return scene.with_(duration=1.0)


def scout(engines: Sequence[str], scenes: Sequence[Scene], advance: Callable[[str], None]) -> None:
    """Ask each engine for its settings for each scene, in one child process for each core; ``advance``
    receives each finished pair.

    An engine is asked for further scenes after its first answer, before which it may compile for a minute.
    An engine that crashes or hangs on a scene counts as refusing it, with the reason.
    """
    left = {name: [scene for scene in scenes if (name, scene) not in _found] for name in engines}
    first = [(name, theirs.pop(0)) for name, theirs in left.items() if theirs]
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        asked = {threads.submit(_asked, pair): pair for pair in first}
        with calls_ended(asked):
            while asked:
                for future in wait(asked, return_when=FIRST_COMPLETED).done:
                    name, scene = pair = asked.pop(future)
                    _found[pair] = future.result()
                    advance(f"{shown_name(name)} {scene.name}")
                    more = [(name, other) for other in left.pop(name, ())]
                    asked |= {threads.submit(_asked, pair): pair for pair in more}


def offer(engine_name: str, scene: Scene) -> Offer:
    """Return the settings that ``scout`` found, or ask the engine in this process. Settings that run the
    scene's own file come first, also if the engine refuses the scene."""
    if (engine_name, scene) not in _found:
        _found[engine_name, scene] = _offered(engine_name, scene)
    found, own = _found[engine_name, scene], of_file(engine_name, scene)
    return (*own, *(() if isinstance(found, Cannot) else found)) if own else found


def settings(engine_name: str, scene: Scene) -> tuple[Setting, ...]:
    """Return an engine's settings for a scene, coarse to fine in each family; no settings if the engine
    cannot run the scene."""
    found = offer(engine_name, scene)
    return () if isinstance(found, Cannot) else found


def unasked(engines: Sequence[str], scenes: Sequence[Scene]) -> int:
    """Return the number of pairs (engine, scene) that ``scout`` has not asked yet."""
    return sum((name, scene) not in _found for scene in scenes for name in engines)


class Unable(NamedTuple):
    """An engine that cannot run a scene, and its refusal."""

    scene: Scene
    engine: str
    cannot: Cannot


def default_cases(
    scene: Scene,
    engines: Sequence[str],
    families: Sequence[str] | None = None,
    times: np.ndarray | None = None,
    time_limit: float = TIME_LIMIT,
) -> tuple[list[Case], list[Unable]]:
    """Return the settings of every engine for a scene as cases, and the engines that cannot run it.

    Parameters
    ----------
    scene : Scene
        The mechanism.
    engines : sequence of str
        Names of engines.
    families : sequence of str, optional
        Families of settings. Default: all.
    times : ndarray, shape (k,), optional
        Sample times, s. Default: 101 equidistant ones over the scene's duration, both ends included.
    time_limit : float
        Largest CPU time of a run, s.

    Returns
    -------
    tuple of (list of Case, list of Unable)
        The runs, and the refusals.

    Raises
    ------
    LookupError
        If an engine is unknown; the message lists the known ones.
    """
    scene = started(scene)
    times = np.linspace(0.0, scene.duration, SAMPLES) if times is None else times
    cases, unable = [], []
    for name in engines:
        found = offer(name, scene)
        if isinstance(found, Cannot):
            unable.append(Unable(scene, name, found))
            continue
        wanted = [s for s in found if families is None or s.family in families]
        cases += [Case(scene, times, name, setting, time_limit) for setting in wanted]
    return cases, unable


def _offered(engine_name: str, scene: Scene) -> Offer:
    simulator = engine(engine_name)
    return simulator.cannot(scene) or tuple(simulator.settings(scene))


def _asked(pair: tuple[str, Scene]) -> Offer:
    try:
        _, cannot, found = capabilities(*pair, READY_SECONDS)
    except ChildFailed as failure:
        return Cannot(Owner.ADAPTER, f"its settings are unknown: {failure}")
    return cannot or tuple(found)
