"""Explanations of a difference by another scene: changed gravity, damping of a joint, or mass of a body."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.recorded.columns import values
from crosscheck.recorded.explanations import Columns, Difference, with_signs
from mbref.scene import Scene, SceneError, TorsionSpring

ITERATIONS = 5
# fraction of the difference that remains after a linear fit; a change with a larger remainder is not fitted
# further
PROMISING = 0.7
RTOL = 1e-9
KNOWN_GRAVITY = {9.80665: "9.80665", 9.81: "9.81", 9.8: "9.8", 10.0: "10"}


@dataclass(frozen=True)
class Change:
    """A change of one number of a scene: ``of(value)`` returns the changed scene, ``small`` is a first value,
    the value 0 changes nothing."""

    of: Callable[[float], Scene]
    small: float
    says: Callable[[float], str]


def changed(scene: Scene, difference: Difference, seconds: float) -> Iterator[tuple[str, int, Columns]]:
    """Return (sentence, number of fitted parameters, predicted columns) of the changes tried within CPU
    seconds."""
    began = time.thread_time()
    for change in changes(scene):
        if time.thread_time() - began > seconds:
            return
        found = _fitted(change, difference)
        if found is not None:
            yield change.says(found[0]), 2, found[1]


def changes(scene: Scene) -> Iterator[Change]:
    """Return the possible changes: gravity, damping of every hinge, mass of every body."""
    size = float(np.linalg.norm(scene.gravity))
    if size:
        yield Change(
            lambda x: scene.with_(gravity=tuple((1 + x) * g for g in scene.gravity)),
            1e-3,
            lambda x: f"gravity of {_gravity((1 + x) * size)} m/s², not {size:.6g}",
        )
    if not scene.has_mass():
        return
    weight = sum(body.mass or 0.0 for body in scene.body)
    unit = 1e-3 * weight * scene_length(scene) ** 2 / scene.duration
    for joint in scene.joint:
        if "angle" in joint.facts.loaded:
            yield _damping(scene, joint.name, unit)
    for body in scene.body:
        yield _mass(scene, body.name)


def _gravity(value: float) -> str:
    return next((text for known, text in KNOWN_GRAVITY.items() if abs(value - known) < 1e-6), f"{value:.7g}")


def _damping(scene: Scene, joint: str, unit: float) -> Change:
    def damped(x: float) -> Scene:
        return scene.with_(load=[*scene.load, TorsionSpring(joint=joint, stiffness=0.0, damping=max(x, 0.0))])

    return Change(damped, unit, lambda x: f"damping of {max(x, 0.0):.6g} N m s/rad in joint {joint!r}")


def _mass(scene: Scene, body: str) -> Change:
    def heavier(x: float) -> Scene:
        changed = [b if b.name != body else _scaled(b, max(1 + x, 1e-3)) for b in scene.body]
        return scene.with_(body=changed)

    def says(x: float) -> str:
        if 1 + x < 0.02:
            return f"body {body!r} has no mass"
        return f"mass and inertia of body {body!r} times {1 + x:.6g}"

    return Change(heavier, -0.05, says)


def _scaled(body, factor: float):  # type: ignore[no-untyped-def]
    inertia = (np.array(body.inertia) * factor).tolist()
    return type(body)(**{**body.model_dump(), "mass": body.mass * factor, "inertia": inertia})


def _fitted(change: Change, d: Difference) -> tuple[float, Columns] | None:
    """Return the number and the columns that fit best, by the secant method; None if the change does not
    reduce the difference."""
    value, columns = change.small, _moved(change, change.small, d)
    exact = _stacked(d, d.exact)
    wanted = _stacked(d, d.recorded) - exact
    for _ in range(ITERATIONS):
        if columns is None:
            return None
        slope = (_stacked(d, columns) - exact) / value
        if not slope @ slope > 0:
            return None
        left = _stacked(d, d.recorded) - _stacked(d, columns)
        if np.linalg.norm(wanted - slope * (slope @ wanted) / (slope @ slope)) > PROMISING * np.linalg.norm(
            wanted
        ):
            return value, columns
        step = float(slope @ left / (slope @ slope))
        if abs(step) <= 1e-10 * abs(value):
            break
        value = value + step
        if not (np.isfinite(value) and value):
            return None
        columns = _moved(change, value, d)
    return None if columns is None else (value, columns)


def _moved(change: Change, value: float, d: Difference) -> Columns | None:
    """Return the columns of the changed scene; None if it cannot be simulated."""
    try:
        scene = change.of(value)
        motion = gauss_motion(scene, tuple(d.times.tolist()), RTOL)
    except (SceneError, RuntimeError):
        return None
    return with_signs(d.recorded, values(scene, motion))


def _stacked(d: Difference, columns: Columns) -> np.ndarray:
    signed = with_signs(d.recorded, columns)
    return np.concatenate([signed[name] / d.scale[name] for name in d.recorded])
