"""Sentences on how and up to which time the true motions are known, and on the bounds of their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from crosscheck.judge.tolerances import FLOOR
from crosscheck.study.grades import Judged
from crosscheck.study.words.text import listed
from mbref.scene import Scene


def truth(groups: Sequence[Judged]) -> str:
    """Return sentences on the kinds of truth, the bounds on their errors, and their cost."""
    parts = []
    closed = [g for g in groups if g.truth["kind"] not in ("", "reference")]
    if closed:
        bounds = {g.truth["bound"] for g in closed}
        better = " or better" if len(bounds) > 1 else ""
        parts.append(
            f"The exact motion of {names(closed)} is known in closed form or by a reduced "
            f"equation, to {max(bounds):.0e}{better}."
        )
        parts += [
            f"The motion of {g.scene.name} is known{_until(g.scene, g.truth)}."
            for g in closed
            if g.truth["reason"]
        ]
    parts += [_reference(group) for group in groups if group not in closed]
    parts += [
        f"The drivers of {g.scene.name} come to a dead position at t = {g.truth['dead']:.4g} s, beyond which "
        f"no motion exists: engines are compared up to t = {g.scene.duration:.4g} s."
        for g in groups
        if "dead" in g.truth
    ]
    return " ".join(parts)


def unknown(scene: Scene, known: Mapping[str, Any]) -> str:
    """Return the time from which on the true motion of a scene is unknown, with the reason; empty if the
    motion is known to its end."""
    if not known["kind"]:
        return f"There is no reference for {scene.name}: {known['reason']}."
    return f"The motion of {scene.name} is known{_until(scene, known)}." if known["reason"] else ""


def _reference(group: Judged) -> str:
    known, name = group.truth, group.scene.name
    if not known["kind"]:
        return unknown(group.scene, known)
    ways = (
        "two formulations that share no code agree" if known["both"] else "two runs of one formulation agree"
    )
    return (
        f"The reference of {name} is known to {known['bound']:.0e}{_until(group.scene, known)}: {ways}; "
        f"it took {known['seconds']:.1f} s of CPU time."
    )


def _until(scene: Scene, known: Mapping[str, Any]) -> str:
    """Return the time up to which a truth is known, with the reason for its end; empty if the truth is known
    to the end of the motion."""
    if not known["reason"]:
        return ""
    end = f"{known['until']:.4g} s of {scene.duration:.4g} s"
    return f" up to t = {end} ({known['reason']}), and errors are of this part"


def up_to(groups: Sequence[Judged]) -> str:
    """Return the beginning of a sentence on the time up to which the motions exist or are known; empty if all
    motions are known to their ends."""
    ends = [group.truth["until"] for group in groups if group.truth["reason"]]
    if ends:
        return f"Up to t = {min(ends):.4g} s, as far as the motion is known"
    dead = [group for group in groups if "dead" in group.truth]
    if len(groups) == len(dead) == 1:
        at = f"t = {dead[0].truth['dead']:.4g} s"
        return f"Up to t = {dead[0].scene.duration:.4g} s, before the dead position of the drivers at {at}"
    return ""


def stands_still(groups: Sequence[Judged]) -> list[str]:
    """Return a sentence on the scenes whose bodies stay where they are, within the errors of right runs."""
    still = [g for g in groups if "moved" in g.truth and g.truth["moved"] <= max(FLOOR, g.truth["bound"])]
    if not still:
        return []
    most = max(FLOOR, *(g.truth["bound"] for g in still))
    return [
        f"No body of {names(still)} moves by more than {most:.0e} of the length, or rad, so that an engine "
        "that moves nothing is right as well."
    ]


def names(groups: Sequence[Judged]) -> str:
    """Return the names of the scenes as a list in words."""
    return listed(group.scene.name for group in groups)
