"""Files of a motion: one JSON object with scene and trajectory, and tables of its columns."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mbref.files import replaced, write
from mbref.input_error import InputError
from mbref.motions.error_estimate import ErrorEstimate
from mbref.motions.trajectory import Trajectory
from mbref.records import BROKEN, json_content, strict_json
from mbref.scene import Scene, SceneError


def write_json(path: str | Path, scene: Scene, record: Mapping[str, Any]) -> None:
    """Write scene and record of a motion; raises InputError unless the path ends in ``.json``."""
    if Path(path).suffix.lower() != ".json":
        raise InputError(f"{path}: a motion is saved as .json; for a picture use animate or plot")
    whole = {"scene": scene.to_dict(), "record": record}
    write(path, strict_json(whole) + "\n")


def read_json(path: str | Path) -> tuple[Scene, Trajectory, ErrorEstimate | None]:
    """Return what ``write_json`` wrote; raises InputError for another file, OSError."""
    try:
        whole = json_content(path)
        scene, record = Scene(**whole["scene"]), whole["record"]
        trajectory, estimate = Trajectory.from_record(scene.name, record), record.get("error_estimate")
        if trajectory.bodies != tuple(body.name for body in scene.body):
            raise ValueError("has states of other bodies")
        if not {*(trajectory.angles or ())} <= {joint.name for joint in scene.joint}:
            raise ValueError("has angles of other joints")
        return scene, trajectory, ErrorEstimate.from_record(trajectory.times, estimate) if estimate else None
    except (*BROKEN, SceneError):
        raise InputError(f"{path}: is not a file that Motion.save wrote") from None


def write_csv(path: str | Path, columns: Mapping[str, np.ndarray], decimal_comma: bool = False) -> None:
    """Write columns (k,) with all digits, below a line with their names.

    With decimal commas ``;`` stands between numbers, and a byte order mark lets spreadsheets read UTF-8.
    """
    encoding = "utf-8-sig" if decimal_comma else "utf-8"
    with replaced(path) as fresh, open(fresh, "w", encoding=encoding, newline="") as file:
        writer = csv.writer(file, delimiter=";" if decimal_comma else ",")
        writer.writerow(columns)
        for row in zip(*(column.tolist() for column in columns.values()), strict=True):
            writer.writerow([repr(x).replace(".", ",") for x in row] if decimal_comma else row)


def dataframe(columns: Mapping[str, np.ndarray]) -> Any:
    """Return columns (k,) as a pandas DataFrame, indexed by time; raises ImportError without pandas."""
    try:
        import pandas
    except ImportError:
        raise ImportError("to_dataframe needs pandas: pip install pandas; columns() does not") from None
    return pandas.DataFrame(columns).set_index(next(iter(columns)))
