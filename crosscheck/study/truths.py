"""The truth of a scene as a record: its kind, its cost, the bound on its error, and a motion for the
animation."""

from __future__ import annotations

import hashlib
import json
import time
from typing import Any

import numpy as np

from crosscheck.judge.events import at_samples
from crosscheck.judge.metrics import error_series
from crosscheck.judge.model_identity import gate_times
from crosscheck.judge.reference.cache import mechanism
from crosscheck.judge.reference.reference import NoReference, reference
from crosscheck.judge.truth import NoSolution, Truth, closed_form
from crosscheck.judge.truth.reference_truth import trajectory
from crosscheck.study.grid import Record
from crosscheck.study.pictures import shortened
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

DENSE = 600  # number of equal parts of the duration at whose ends the true motion is evaluated
FRAMES = 90  # largest number of frames of the animated motion
TURN = 0.35  # rad; largest angle by which a body turns between two frames


def evaluated(scene: Scene, times: np.ndarray) -> np.ndarray:
    """Return the times at which the truth of a comparison with samples at times (k,) is evaluated."""
    dense = np.linspace(0.0, scene.duration, DENSE + 1)
    return np.unique(np.concatenate([times, gate_times(scene), dense]))


def truth_record(scene: Scene, times: np.ndarray, reference_time: float, dead: float | None = None) -> Record:
    """Return the record of a scene's true motion at times (k,), and at the times of animation frames.

    ``kind`` is the family of the closed form, "reference", or "" if there is no truth. ``bound`` limits the
    error. ``until`` (s) is the time up to which the motion is known, with the ``reason`` for its end, and
    ``moved`` the largest way of a body from its start until then, of the length, or rad.
    ``dead`` (s) is the time of a dead position of the drivers, before which the comparison ends.
    """
    wanted = evaluated(scene, times)
    start = time.process_time()
    found = known_at(scene, wanted, reference_time)
    found.setdefault("seconds", time.process_time() - start)
    asked = {"key": key(scene, times), "scene": scene.name, "mechanism": mechanism(scene)}
    return {**asked, "given": reference_time, **found, **({} if dead is None else {"dead": dead})}


def known_at(scene: Scene, times: np.ndarray, reference_time: float) -> Record:
    """Return the record of the truth at times (k,) without key and scene name."""
    family = closed_form(scene)
    return _of_family(scene, family, times) if family else _of_reference(scene, times, reference_time)


def key(scene: Scene, times: np.ndarray) -> str:
    """Return a hash of the scene and the times."""
    identity = ["truth", scene.to_dict(), np.asarray(times, dtype=float).tolist()]
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def shown(exact: Trajectory) -> np.ndarray:
    """Return which samples (n,) of a motion become frames.

    FRAMES cover the whole motion, or only its beginning if a body would turn by more than TURN between two
    frames.
    """
    speed = np.linalg.norm(exact.angular_velocity, axis=-1).max(axis=-1, initial=0.0)
    turned = np.concatenate([[0.0], np.cumsum(np.diff(exact.times) * (speed[1:] + speed[:-1]) / 2)])
    last = int(np.searchsorted(turned, FRAMES * TURN, side="right")) - 1
    return np.linspace(0, last, min(FRAMES, last) + 1).round().astype(int)


def _of_family(scene: Scene, family: Truth, times: np.ndarray) -> dict[str, Any]:
    reason = ""
    try:
        exact = family.poses(times)
    except NoSolution as end:
        times, reason = times[times <= end.until], str(end)
        if not times.max(initial=0.0) > 0:
            return _nothing(reason)
        exact = family.poses(times)
    return {
        "kind": family.name,
        "bound": family.accuracy,
        "reason": reason,
        "until": float(times[-1]),
        "moved": moved(scene, exact),
        "both": True,
        "motion": _motion(exact),
    }


def _of_reference(scene: Scene, times: np.ndarray, reference_time: float) -> dict[str, Any]:
    if not reference_time:
        return _nothing("no reference was requested")
    found = reference(scene, times.tolist(), reference_time)
    part = found.part if isinstance(found, NoReference) else found
    if not part.times.max(initial=0.0) > 0:
        return _nothing(getattr(found, "reason", ""))
    exact = trajectory(scene, part)
    return {
        "kind": "reference",
        "bound": float(part.bound.max()),
        "both": bool(part.both.all()),
        "reason": getattr(found, "reason", ""),
        "until": float(part.times.max()),
        "seconds": part.seconds,
        "moved": moved(scene, exact),
        "motion": _motion(exact),
    }


def moved(scene: Scene, exact: Trajectory) -> float:
    """Return the largest way of a body from its start: of the mechanism's length, or rad up to π."""
    still = at_samples(exact, np.zeros(len(exact.times), dtype=int))
    return float(error_series(scene, exact, still).max(initial=0.0))


def _nothing(reason: str) -> dict[str, Any]:
    return {"kind": "", "bound": None, "reason": reason, "until": 0.0, "both": False, "motion": None}


def _motion(exact: Trajectory) -> dict[str, Any]:
    """Return the record of the frames: times, and the bodies' poses."""
    chosen = shown(exact)
    bodies = {
        name: {"position": exact.position[chosen, b], "orientation": exact.orientation[chosen, b]}
        for b, name in enumerate(exact.bodies)
    }
    return {"times": exact.times[chosen].tolist(), "bodies": shortened(bodies)}
