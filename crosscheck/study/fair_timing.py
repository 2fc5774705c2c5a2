"""Fair comparison of speed: a check that all engines simulate the same mechanism, and interleaved timing."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from statistics import median

import numpy as np

from crosscheck.engine import Setting, engine
from crosscheck.judge.events import at_samples
from crosscheck.judge.model_identity import along, differences, gate_times
from crosscheck.judge.reference.reference import SECONDS
from crosscheck.judge.truth import NoSolution, truth_for
from crosscheck.processes.pool import FAR_BEHIND, ChildFailed, time_interleaved
from crosscheck.setting import best_family
from crosscheck.study.grades import Grade, grade
from crosscheck.study.grid import Case, Record
from crosscheck.study.progress import counted
from crosscheck.study.record_view import is_completed
from crosscheck.study.search.least_errors import least_errors
from crosscheck.study.search.offers import settings
from crosscheck.study.words.speed import COMPILED
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

SHORT = 5.0  # s; a shorter timing shows no progress


def identity_cases(scene: Scene, engines: Sequence[str], time_limit: float) -> list[Case]:
    """Return short runs by which `model_difference` checks that all engines simulate the scene: each at
    the finest setting of its best family, without compiled families, whose compilation may take a minute."""
    best = {name: best_family(_called_from_python(settings(name, scene))) for name in engines}
    finest = {name: found[-1] for name, found in best.items() if found}
    return [Case(scene, gate_times(scene), name, s, time_limit) for name, s in finest.items()]


def _called_from_python(found: Sequence[Setting]) -> Sequence[Setting]:
    return [setting for setting in found if not setting.family.endswith(COMPILED)] or found


def model_difference(
    scene: Scene,
    records: Sequence[Record],
    reference_time: float = SECONDS,
    motions: Sequence[Record] = (),
) -> str | None:
    """Return a sentence on the first quantity in which the records of `identity_cases` differ; None if all
    records agree. Records are compared with the truth; without a truth, with the first record. Runs that did
    not complete are ignored.
    """
    return next(iter(model_differences(scene, records, reference_time, motions).values()), None)


def model_differences(
    scene: Scene,
    records: Sequence[Record],
    reference_time: float = SECONDS,
    motions: Sequence[Record] = (),
) -> dict[str, str]:
    """Return for each engine that differs the sentence on its first different quantity.

    An engine with a right run among ``motions`` is left out: it simulates the scene, and the difference is an
    error of the settings of its short run.
    """
    truth = truth_for(scene, reference_time)
    try:
        exact = [] if truth is None else [truth.poses(gate_times(scene))]
    except NoSolution:
        exact = []
    done = [record for record in records if is_completed(record)]
    runs = [_motion(scene, r) for r in done]
    found = differences(scene, [*exact, *runs], _roundings(done)) if exact or runs else {}
    right = {record["engine"] for record in motions if grade(record) is Grade.RIGHT}
    return {name: str(difference) for name, difference in found.items() if name not in right}


def _roundings(records: Sequence[Record]) -> dict[str, float]:
    """Return the relative rounding that each engine declares, by the engine's name in its records; engines
    that are not on this machine are left out."""
    found = {}
    for record in records:
        with contextlib.suppress(ImportError, LookupError, AttributeError):
            found[record["engine"]] = engine(record["asked"]["engine"]).rounding
    return found


def force_differences(scene: Scene, records: Sequence[Record]) -> dict[str, str]:
    """Return for each engine with wrong motions how its accelerations differ from the scene's at equal
    states.

    Engines with wrong motions but right accelerations are left out.
    """
    found = {}
    for least in least_errors(records):
        if grade(least.best) is not Grade.WRONG:
            continue
        wrong = [r for r in least.records if grade(r) is Grade.WRONG]
        differing = [along(scene, _known_part(scene, r)) for r in wrong]
        if all(differing):
            found[least.engine] = str(min(filter(None, differing), key=lambda difference: difference.by))
    return found


def _motion(scene: Scene, record: Record) -> Trajectory:
    return Trajectory.from_record(scene.name, record)


def _known_part(scene: Scene, record: Record) -> Trajectory:
    """Return a recorded motion up to the end of the truth."""
    run = _motion(scene, record)
    return at_samples(run, np.flatnonzero(run.times <= record["metrics"]["error_until"]))


def timed(
    cases: Sequence[Case], records: Sequence[Record], repeats: int, notice: Callable[[str], None]
) -> list[Record]:
    """Return the records with ``cost.seconds`` replaced by the minimum over interleaved runs; ``timing`` has
    their median and number.

    The completed runs of a scene take turns in one process, so that all runs see the same machine.  If the
    timing process of a scene fails, its records keep the seconds of their isolated runs, and a ``notice``
    reports it.
    """
    done = list(records)
    for scene in {case.scene.name: case.scene for case in cases}.values():
        places = [
            i for i, case in enumerate(cases) if case.scene.name == scene.name and is_completed(records[i])
        ]
        try:
            found = _seconds(scene, [cases[i] for i in places], repeats)
            rounds = max(map(len, found), default=repeats)
            if rounds < repeats:
                notice(f"{scene.name}: {rounds} of {repeats} repeats, because each takes long")
            if once := sum(len(seconds) < rounds for seconds in found):
                notice(
                    f"{scene.name}: {once} of {len(found)} settings take over {FAR_BEHIND:g} times as long "
                    "as the fastest, and are timed once"
                )
            for i, seconds in zip(places, found, strict=True):
                done[i] = _with_cost(records[i], seconds)
        except ChildFailed as failure:
            notice(f"{scene.name}: no interleaved timing, single runs are shown: {failure}")
    return done


def _seconds(scene: Scene, cases: Sequence[Case], repeats: int) -> list[list[float]]:
    if not cases:
        return []
    limit = (repeats + 1) * sum(case.time_limit for case in cases)
    jobs = [(case.engine, case.setting) for case in cases]
    with counted("timing", repeats + 1, SHORT) as advance:
        return time_interleaved(scene, cases[0].times, jobs, repeats, limit, partial(advance, scene.name))


def _with_cost(record: Record, seconds: Sequence[float]) -> Record:
    """Return the record with new times (s); NaN entries are repeats that did not complete. Without any number
    the record keeps its cost."""
    finite = [s for s in seconds if math.isfinite(s)]
    if not finite:
        return record
    cost = {**record["cost"], "seconds": min(finite)}
    return {**record, "cost": cost, "timing": {"median": median(finite), "repeats": len(finite)}}
