"""Records of the paper's runs: made with time limits and names, reduced for figures, found by label."""

from __future__ import annotations

import json
from pathlib import Path

from crosscheck.judge.violations import violation_series
from crosscheck.paper.runs import GROWTH, PEAKS, Cases, Label, Records
from crosscheck.study.grid import Case, Record, key, run_in_turn, study
from crosscheck.study.progress import Shown
from crosscheck.study.store import in_digits, read
from mbref.files import write
from mbref.motions.trajectory import Trajectory
from mbref.records import RecordsError, json_content
from mbref.scene import Scene

DRAWN_PARTS = ("figures", "dynamic", "peaks")  # parts whose motions are plotted
PLACES = 6  # significant digits of a plotted motion
FILE = "paper.jsonl"
INDEX = "paper-runs.json"  # label → key of the record, in a file next to the records


def run(path: str | Path, chosen: Cases, progress: Shown) -> Records:
    """Return records of the cases, stored at ``path`` as their runs end; stored records are not repeated.

    Every run has a limit of CPU time, and the progress shows its label.
    """
    labels = {id(case): label for label, case in chosen.items()}

    def made(case: Case) -> Record:
        return drawable(labels[id(case)], case.scene, run_in_turn(case))

    named = progress.under_way.named(made, lambda case: str(labels[id(case)]))
    records = study(list(chosen.values()), None, path, progress, named)
    return dict(zip(chosen, records, strict=True))


def drawable(label: Label, scene: Scene, record: Record) -> Record:
    """Return the record with the motion that figures plot, in PLACES digits, and its ``violation`` (k,) of
    positions at the samples.

    The violation is computed from all digits. Records that no figure plots lose their motion.
    """
    if label.part == "digits":  # accelerations are compared digit by digit
        return record
    drawn = label.part in DRAWN_PARTS
    shown = list(record["bodies"].items())[: 1 if label == PEAKS else None]
    bodies = {
        name: {field: in_digits(values if drawn else [], PLACES) for field, values in motion.items()}
        for name, motion in shown
    }
    return record | {
        "bodies": bodies,
        "times": record["times"] if drawn or label.part == GROWTH else [],
        "violation": _violation(scene, record) if drawn or label.part == GROWTH else [],
        "reactions": {},
        "open_reactions": None,
        "angles": None,
        "crossings": None,
    }


def _violation(scene: Scene, record: Record) -> list[float]:
    values = violation_series(scene, Trajectory.from_record(scene.name, record), 0)
    return [] if values is None else in_digits(values.tolist(), PLACES)


def index(path: str | Path, chosen: Cases) -> None:
    """Write the keys of the cases by label next to their records, so that a page can be rendered from these
    files alone."""
    known = {json.dumps(label, ensure_ascii=False): key(case) for label, case in chosen.items()}
    write(Path(path).with_name(INDEX), json.dumps(known, indent=0, ensure_ascii=False) + "\n")


def indexed(folder: Path) -> Records:
    """Return the records of a folder by label; raises FileNotFoundError if the folder has no records."""
    known = read(folder / FILE)
    keys = json_content(folder / INDEX)
    try:
        return {Label(*json.loads(label)): known[k] for label, k in keys.items() if k in known}
    except (AttributeError, TypeError, ValueError):
        raise RecordsError(f"{folder / INDEX}: has no labels of the paper's runs") from None
