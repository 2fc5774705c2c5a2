"""References on disk: one file for each scene, whose name is a hash of all data that determine the motion;
files are checked when read."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import json
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from mbref.scene import Scene

JUDGE = Path(__file__).parents[1]
SOURCES = (
    *(
        path
        for path in sorted((JUDGE / "reference").glob("*.py"))
        if path.stem not in ("certify", "isostatic")
    ),
    JUDGE / "arithmetic.py",
    JUDGE / "constraints.py",
    JUDGE / "driver_rows.py",
    JUDGE / "joint_residuals.py",
    JUDGE / "joint_coordinates.py",
    JUDGE / "impacts.py",
    JUDGE / "pieces.py",
    JUDGE / "stops.py",
    JUDGE / "time_functions.py",
)
DIGEST = hashlib.sha256().digest_size


def load(scene: Scene) -> dict[str, np.ndarray]:
    """Return the stored arrays of a scene; empty if no complete file exists."""
    try:
        content = _path(scene).read_bytes()
    except OSError:
        return {}
    body = content[DIGEST:]
    if hashlib.sha256(body).digest() != content[:DIGEST]:
        return {}
    with contextlib.suppress(ValueError, zipfile.BadZipFile), np.load(io.BytesIO(body)) as arrays:
        return dict(arrays)
    return {}


def save(scene: Scene, arrays: dict[str, np.ndarray]) -> None:
    """Store the arrays of a scene; a reader sees the old file or the new file, never a part."""
    body, path = io.BytesIO(), _path(scene)
    # without this annotation an array named ``allow_pickle`` would be taken as an option of savez
    named: dict[str, Any] = {**arrays}
    np.savez(body, **named)
    with contextlib.suppress(OSError):  # without a writable cache the result is not stored
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(hashlib.sha256(body.getvalue()).digest() + body.getvalue())
        os.replace(file.name, path)


def canonical(scene: Scene) -> str:
    """Return all fields of a scene that determine its motion, as JSON: all except name and duration."""
    return json.dumps({**scene.to_dict(), "name": "", "duration": 0.0}, sort_keys=True)


def mechanism(scene: Scene) -> str:
    """Return a short hash of all fields of a scene that determine its motion."""
    return hashlib.sha256(canonical(scene).encode()).hexdigest()[:16]


def _path(scene: Scene) -> Path:
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mbref" / "references"
    return root / hashlib.sha256((version() + canonical(scene)).encode()).hexdigest()


@functools.cache
def version() -> str:
    """Return a hash of the code that computes references."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in SOURCES)).hexdigest()
