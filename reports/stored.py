"""Reads the stored contents of a report's folder (scenes, records, times, truths and motions), without any
run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import engine_names
from crosscheck.judge.model_identity import gate_times
from crosscheck.study.grid import Record
from crosscheck.study.record_shape import Picture, Timing, Truth, Verdicts, WholeRun, checked
from crosscheck.study.record_view import of_scenes, with_time
from crosscheck.study.store import read, read_scenes, unpacked
from crosscheck.study.truths import key as truth_key
from mbref.records import RecordsError, json_content
from mbref.scene import Scene

from .runs import SceneRuns, by_scene

# shape of the records of each file
SHAPES: dict[str, type[Picture] | type[Truth]] = {
    "records": WholeRun,
    "truths": Truth,
    "motions": Picture,
    "branches": Picture,
}


def groups(folder: Path) -> list[SceneRuns]:
    """Return the runs of a folder by scene; raises FileNotFoundError if it has no scenes or records."""
    with unpacked(folder) as place:
        if not (place / "records.jsonl").exists() or not (place / "scenes").is_dir():
            raise FileNotFoundError(f"{folder}: has no records.jsonl and scenes/ of a report")
        return _groups(place)


def _groups(folder: Path) -> list[SceneRuns]:
    scenes = read_scenes(folder)
    named = {scene.name: scene for scene in scenes}
    times = read(folder / "timings.jsonl", Timing)
    stored = [_of_known_scenes(folder / f"{name}.jsonl", shape, named) for name, shape in SHAPES.items()]
    records, *more = (of_scenes(list(found.values()), scenes) for found in stored)
    lost = {r["scene"] for r in stored[0].values()} - {r["scene"] for r in records}
    if lost:
        raise RecordsError(
            f"{folder}/records.jsonl: records of {', '.join(sorted(lost))} are of another mechanism than the "
            "file in scenes/, or end at another time; make the report again"
        )
    gates = [r for r in records if _is_gate(named[r["scene"]], r)]
    runs = [with_time(r, times) for r in records if not any(r is gate for gate in gates)]
    runs, more[0] = _of_latest_truths(named, runs, more[0])
    return by_scene(_ordered(runs), named, gates, *more)


def _of_latest_truths(
    named: dict[str, Scene], runs: list[Record], truths: list[Record]
) -> tuple[list[Record], list[Record]]:
    """Return for each scene its latest truth at sample times of runs, and the runs at these times; all of a
    scene without such a truth. A folder can have runs at other times, such as of another depth."""
    keys = {(run["scene"], str(_when(run))): run for run in runs}
    found = {place: truth_key(named[place[0]], _sampled(run)) for place, run in keys.items()}
    latest = {truth["scene"]: truth for truth in truths if truth["key"] in found.values()}
    kept = [
        run
        for run in runs
        if run["scene"] not in latest or found[run["scene"], str(_when(run))] == latest[run["scene"]]["key"]
    ]
    return kept, [truth for truth in truths if latest.get(truth["scene"], truth) is truth]


def _when(run: Record) -> list[Any]:
    return [run["asked"].get(name) for name in ("end", "samples", "times")]


def _sampled(run: Record) -> np.ndarray:
    """Return the requested sample times (k,), s."""
    end, samples, times = _when(run)
    return np.linspace(0.0, end or 0.0, samples or 0) if times is None else np.array(times)


def _of_known_scenes(
    path: Path, shape: type[Picture] | type[Truth], named: dict[str, Scene]
) -> dict[str, Record]:
    """Return the records of a file by key; raises RecordsError if a record's scene has no file, or
    lacks its bodies."""
    found = read(path, shape)
    present = {record["key"] for record in of_scenes(list(found.values()), list(named.values()))}
    for key, record in found.items():
        scene, truth = named.get(record["scene"]), record.get("motion")
        states = (truth or record).get("bodies")
        if scene is None:
            fault = f"scene: no file of scenes/ has the name {record['scene']!r}"
        elif record["key"] in present and (states or truth) and not _fits(states, scene):
            fault = "bodies: are not the bodies of the scene"
        else:
            if states and record["key"] in present:
                (truth or record)["bodies"] = {body.name: states[body.name] for body in scene.body}
            continue
        raise RecordsError(f"{path}: record {key[:12]!r}: {fault}; restore it")
    return found


def _fits(states: dict[str, Any] | None, scene: Scene) -> bool:
    """Return whether a motion has states of all bodies of a scene."""
    return set(states or ()) == {body.name for body in scene.body}


def verified(folder: Path) -> list[Record]:
    """Return the verdicts that `crosscheck verify ENGINE --json` wrote to ``folder``/conformance/*.json,
    crosscheck's own engines first."""
    order = list(engine_names())
    with unpacked(folder) as place:
        paths = sorted((place / "conformance").glob("*.json"))
        found = [record for path in paths for record in checked(path, [json_content(path)], Verdicts)]
    return sorted(found, key=lambda f: order.index(f["engine"]) if f["engine"] in order else len(order))


def _is_gate(scene: Scene, record: Record) -> bool:
    return np.array_equal(record["asked"].get("times", ()), gate_times(scene))


def _ordered(records: Sequence[Record]) -> list[Record]:
    """Return the records by engine, crosscheck's own first, and from coarse to fine in each family."""
    engines = list(dict.fromkeys([*engine_names(), *(r["engine"] for r in records)]))

    def place(record: Record) -> tuple[int, str, list[float]]:
        options = record["asked"]["options"].values()
        coarseness = [-float(value) for value in options if isinstance(value, int | float)]
        return engines.index(record["engine"]), record["family"], coarseness

    return sorted(records, key=place)
