"""Records of small motions: the judge's steady poses of a scene, and the errors of engines about each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import engine
from crosscheck.engines.mbref import search
from crosscheck.judge.small_motions.equilibria import STARTS, Steady, steady_poses
from crosscheck.processes import pool
from crosscheck.processes.child import ChildFailed
from crosscheck.small_motions.compare import Result, distance, error, of_engine
from crosscheck.small_motions.mechanisms import MECHANISMS
from mbref.records import looked_at
from mbref.scene import Scene

FILE = Path(__file__).parent / "records.jsonl.xz"
SAME = 1e-6  # largest distance of a pose that an engine's search found / length, or rad
REGULAR = (
    1e-3  # part of the largest eigenvalue by which exact ones may differ from the judge's to be of a pose
)
DIGITS = 13  # of stored eigenvalues
SECONDS = 300.0  # s of CPU time of an engine about a pose, imports and compilation included
Record = dict[str, Any]


def measured(
    scene: Scene,
    engines: Sequence[str],
    known: Sequence[tuple[complex, ...]] = (),
    starts: int = STARTS,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Record]:
    """Return a record for each steady pose of a scene; with ``known`` eigenvalues only for their poses.

    Raises SceneError if the scene has no small motions.
    """
    progress("the judge's search")
    poses = steady_poses(scene, starts)
    exact = [_nearest(each.eigenvalues, known) for each in poses]
    kept = [(each, of) for each, of in zip(poses, exact, strict=True) if of is not None or not known]
    progress("mbref's search")
    own = search(scene)
    return [
        {"key": f"{scene.name} {k}"} | _record(scene, each, of, own, _results(scene, each, engines, progress))
        for k, (each, of) in enumerate(kept, 1)
    ]


def _nearest(found: np.ndarray, known: Sequence[tuple[complex, ...]]) -> np.ndarray | None:
    """Return the exact eigenvalues that are the judge's, up to ``REGULAR``; None if there are none."""
    each = min(known, key=lambda exact: error(found, np.array(exact)), default=None)
    if each is None or error(found, np.array(each)) > REGULAR:
        return None
    return np.array(each)


def _results(
    scene: Scene, steady: Steady, engines: Sequence[str], progress: Callable[[str], None]
) -> list[Result]:
    results: list[Result] = []
    for name in engines:
        progress(name)
        try:
            results += pool.apart(_results_of, (name, scene, steady), SECONDS)
        except ChildFailed as failure:
            results.append(Result(name, "", "", None, str(failure)))
    return results


def _results_of(name: str, scene: Scene, steady: Steady) -> list[Result]:
    """Return an engine's results about a pose; called in a child, which captures what the engine prints."""
    return list(of_engine(engine(name), scene, steady))


def _record(
    scene: Scene,
    steady: Steady,
    exact: np.ndarray | None,
    own: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    results: Sequence[Result],
) -> Record:
    """Return the record of a steady pose; ``own`` are the poses and eigenvalues of mbref's search."""
    reference = steady.eigenvalues if exact is None else exact
    apart = [distance(scene, steady, *pose) for *pose, _ in own]
    nearest = int(np.argmin(apart)) if apart and min(apart) < SAME else None
    return {
        "scene": scene.name,
        "stability": steady.stability,
        "rate": steady.balance.motion.rate,
        "eigenvalues": [[float(f"{x:.{DIGITS}g}") for x in (s.real, s.imag)] for s in steady.eigenvalues],
        "uncertainty": steady.uncertainty,
        "error": None if exact is None else error(steady.eigenvalues, exact),
        "mbref_distance": None if nearest is None else apart[nearest],
        "mbref_error": None if nearest is None else error(own[nearest][2], reference),
        "results": [_result(each, reference) for each in results],
    }


def _result(each: Result, reference: np.ndarray) -> Record:
    found = None if each.eigenvalues is None else error(each.eigenvalues, reference)
    known = {"engine": each.engine, "version": each.version, "way": each.way, "reason": each.reason}
    return known | {"error": found}


def of_mechanisms(
    engines: Sequence[str], progress: Callable[[str], None] = lambda text: None
) -> list[Record]:
    """Return the records of all mechanisms with closed forms."""
    return [
        record
        for mechanism in MECHANISMS
        for record in measured(
            mechanism.make(),
            engines,
            mechanism.known(),
            progress=lambda text, name=mechanism.name: progress(f"{name}: {text}"),  # type: ignore[misc]
        )
    ]


def merged(new: Sequence[Record], old: Sequence[Record]) -> list[Record]:
    """Return new records with the stored results of the engines that were not measured again."""
    return [record | {"results": [*_others(record, old), *record["results"]]} for record in new]


def _others(record: Record, old: Sequence[Record]) -> list[Record]:
    """Return stored results of other engines about the pose of a record."""
    again = {each["engine"] for each in record["results"]}
    same = (stored for stored in old if all(stored[key] == record[key] for key in ("scene", "eigenvalues")))
    return [each for each in next(same, {"results": []})["results"] if each["engine"] not in again]


def read(path: Path = FILE) -> list[Record]:
    """Return the stored records."""
    return list(looked_at(path).values())
