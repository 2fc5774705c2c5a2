"""Sentences on a file at its own settings, and on motions that verify nothing."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.free_fall import falls_freely
from crosscheck.setting import AS_IN_FILE
from crosscheck.study.grades import Grade, Judged, grade
from crosscheck.study.grid import Record
from crosscheck.study.record_view import ended, is_completed
from crosscheck.study.search.cheapest import opened
from crosscheck.study.words.text import listed
from mbref.scene import Scene

SETTINGS = {"step": "time step {:g} s", "integrator": "{}", "solref": "solref {}", "solimp": "solimp {}"}
SHUT = 1e-12  # rad, and fraction of the scene's length; smaller openings are rounding errors
OF_ERROR = 1e-3  # gap / error of a body's position; a smaller gap is not why the bodies are off
OFF = "Contacts, limits and dry friction are off, as in the scene."


def as_in_file(groups: Sequence[Judged]) -> str:
    """Return sentences on the error of each file at its own settings, with the openings of its closures (mm
    and rad); empty if no file ran."""
    found = [(group, r) for group in groups for r in group.records if r["family"] == AS_IN_FILE]
    return " ".join([*(_one(group, r) for group, r in found), *[OFF] * bool(found)])


def _one(group: Judged, record: Record) -> str:
    scene = group.scene
    own = [text.format(record["settings"][k]) for k, text in SETTINGS.items() if k in record["settings"]]
    start = f"{scene.name} at its own settings ({', '.join(own)})"
    if not is_completed(record):
        return f"{start} is {ended(record)}: {record['message']}."
    metrics, found = record["metrics"], grade(record)
    parts = [] if found is Grade.UNJUDGED else [_bodies(metrics, scene_length(scene))]
    gap, angle, uncounted = opened(record, scene)
    if said_of_joints := _openings(gap, angle, scene_length(scene)):
        parts.append(f"its closures open by up to {said_of_joints}")
    if uncounted:
        parts.append(f"full turns of {listed(uncounted)} cannot be counted between samples")
    said = "has no known error" if found is Grade.UNJUDGED else f"is {found}"
    advice = ""
    if found in (Grade.INACCURATE, Grade.WRONG):
        command = _tuning(record, scene, gap)
        finds = "a solref and a time step" if "--closure" in command else "settings"
        advice = f" `{command}` finds {finds} that are ten times better."
    return f"{start} {said}{': ' if parts else ''}{', and '.join(parts)}.{advice}"


def _openings(gap: float, angle: float, length: float) -> str:
    """Return a gap (m) and an angle (rad) in words, without those that are rounding errors."""
    said = [f"{gap * 1e3:.2g} mm"] if SHUT * length < gap < math.inf else []
    said += [f"{angle:.2g} rad"] if SHUT < angle < math.inf else []
    return listed(said)


def _tuning(record: Record, scene: Scene, gap: float) -> str:
    """Return the command that finds settings with a tenth of the gap, or of the error if the gap is no cause
    of it."""
    settings = record["settings"]
    path = Path(settings["file"])
    shown = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    goal = ["--error", f"{record['metrics']['error'] / 10:.0e}"]
    least = max(SHUT, OF_ERROR * record["metrics"]["position_error"]) * scene_length(scene)
    if least < gap < math.inf:
        goal = ["--closure", f"{gap * 1e3 / 10:.1g}mm"]
    return shlex.join(
        ["crosscheck", "tune", "mujoco", str(shown), *shlex.split(settings.get("import", "")), *goal]
    )


def _bodies(metrics: dict[str, float], length: float) -> str:
    moved, turned = metrics["position_error"] * length, metrics["rotation_error"]
    return f"bodies are off by up to {moved * 1e3:.2g} mm and {turned:.2g} rad"


def uncounted_closures(records: Sequence[Record], scene: Scene) -> str:
    """Return a line on the couplings that leave closures of runs unknown; empty without one."""
    unknown = [r for r in records if r["times"] and r["metrics"].get("violation_position", 0.0) is None]
    names = dict.fromkeys(name for r in unknown for name in opened(r, scene).uncounted)
    said = listed([f"coupling {name!r}" for name in names])
    return f"closure –: full turns of {said} between samples cannot be counted\n" if names else ""


def free_falls(groups: Sequence[Judged]) -> list[str]:
    """Return a sentence on the scenes that only fall: such a run verifies nothing."""
    falling = [group.scene for group in groups if falls_freely(group.scene)]
    return [
        f"{scene.name} falls freely as one rigid piece, which verifies nothing but gravity: "
        f"`--hold {scene.body[0].name}` fixes a body to the ground."
        for scene in falling
    ]
