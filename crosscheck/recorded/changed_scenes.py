"""Causes of a difference in the scene: another gravity, load, armature, mass or time of switching."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.judge.constraints import scene_length
from crosscheck.judge.deadline import ask
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.truth import NoSolution, closed_form
from crosscheck.recorded.columns import kind_of, values
from crosscheck.recorded.explanations import Cause, Columns, Difference, with_signs
from mbref.scene import Factor, JointLoad, Scene, SceneError, SlideSpring, TorsionSpring
from mbref.scene.joints import ANGLE

ITERATIONS = 5
# fraction of the difference that remains after a linear fit; a change with a larger remainder is not fitted
# further
PROMISING = 0.7
RTOL = 1e-9
SMALL = 1e-3  # first relative change of a number
LEAPING = ("acceleration", "angular_acceleration", "force", "moment", "torque", "power")
GONE = 0.02  # fraction of a number below which it counts as left out
KNOWN_GRAVITY = {9.80665: "9.80665", 9.81: "9.81", 9.8: "9.8", 10.0: "10"}
NUMBERS = {  # field of a load → its name in a sentence
    "force": "force",
    "moment": "moment",
    "torque": "torque",
    "stiffness": "stiffness",
    "damping": "damping",
    "natural_length": "natural length",
    "natural_angle": "natural angle",
    "natural_displacement": "natural displacement",
}


@dataclass(frozen=True)
class Change:
    """A change of one number of a scene: ``of(value)`` returns the changed scene, ``small`` is a first value,
    the value 0 changes nothing. ``without`` is the value that leaves the number out, if the scene can."""

    of: Callable[[float], Scene]
    small: float
    says: Callable[[float], str]
    without: float | None = None


def changed(scene: Scene, difference: Difference) -> Iterator[Cause]:
    """Return the causes that changed scenes are, with the number that fits best; asks for the deadline."""
    same = _simulated(scene, difference)
    if same is None:
        return
    # what the integration leaves is the same in a slightly changed scene
    shift = {n: difference.exact[n] - with_signs(difference.exact, same)[n] for n in difference.recorded}
    for number, change in enumerate(changes(scene)):
        name, moved = f"change {number}", _Moved(change, difference, shift)
        for value in () if change.without is None else (change.without,):
            if (columns := moved.columns(value)) is not None:
                yield Cause(change.says(value), 2, columns, name)
        found = _fitted(change.small, moved, difference)
        if found is not None:
            yield Cause(change.says(found[0]), 2, found[1], name)


def changes(scene: Scene) -> Iterator[Change]:
    """Return the possible changes: gravity, numbers of loads, times of switching, armatures, damping of every
    joint, mass of every body."""
    size = float(np.linalg.norm(scene.gravity))
    if not scene.has_mass():
        return
    if size:
        yield Change(
            lambda x: scene.with_(gravity=tuple((1 + x) * g for g in scene.gravity)),
            SMALL,
            lambda x: f"gravity of {_gravity((1 + x) * size)} m/s², not {size:.6g}",
            -1.0,
        )
    for place in range(len(scene.load)):
        yield from _of_load(scene, place)
    for joint in scene.joint:
        if joint.reflected_inertia:
            yield _scaled(scene, "joint", joint, ("armature",), f"armature of joint {joint.name!r}")
    weight = sum(body.mass or 0.0 for body in scene.body)
    for joint in scene.joint:
        for kind in joint.facts.loaded:
            if not any(isinstance(load, JointLoad) and load.joint == joint.name for load in scene.load):
                unit = 1e-3 * weight / scene.duration * (scene_length(scene) ** 2 if kind == ANGLE else 1.0)
                yield _damping(scene, joint.name, kind == ANGLE, unit)
    for body in scene.body:
        if body.mass:
            yield _scaled(scene, "body", body, ("mass", "inertia"), f"mass and inertia of body {body.name!r}")


def _gravity(value: float) -> str:
    return next((text for known, text in KNOWN_GRAVITY.items() if abs(value - known) < 1e-6), f"{value:.7g}")


def _of_load(scene: Scene, place: int) -> Iterator[Change]:
    load = scene.load[place]
    for field, name in NUMBERS.items():
        if np.any(getattr(load, field, 0.0)):
            yield _scaled(scene, "load", load, (field,), f"{name} of load({place})")
    function = load.over_time
    if function is None:
        return
    if function.start:
        yield _later(scene, place, function, ("start",), "on")
    if function.stop is not None:
        yield _later(scene, place, function, ("stop",), "off")
    if (function.start and function.stop is not None) or function.table:
        yield _later(scene, place, function, ("start", "stop", "table"), "on and off")


def _later(scene: Scene, place: int, function: Factor, fields: tuple[str, ...], word: str) -> Change:
    """Return the change by which times of a load's factor are later by x times the scene's duration."""

    def of(x: float) -> Scene:
        shift, late = x * scene.duration, {}
        for name in fields:
            value = getattr(function, name)
            if name == "table" and value:
                late[name] = [(t + shift, size) for t, size in value]
            elif value:
                late[name] = value + shift
        return _replaced(scene, "load", scene.load[place], {"factor": _with(function, late)})

    return Change(
        of, SMALL, lambda x: f"load({place}) is switched {word} later by {x * scene.duration:.6g} s"
    )


def _scaled(scene: Scene, kind: str, part: Any, fields: tuple[str, ...], name: str) -> Change:
    """Return the change of fields of a part to 1 + x times their values."""

    def of(x: float) -> Scene:
        factor = max(1 + x, 0.0) if kind != "load" else 1 + x
        if kind == "body":
            factor = max(factor, SMALL)
        numbers = {f: (factor * np.array(getattr(part, f))).tolist() for f in fields}
        return _replaced(scene, kind, part, numbers)

    def says(x: float) -> str:
        if 1 + x < GONE and kind == "body":
            return f"body {part.name!r} has no mass"
        if abs(1 + x) < GONE:
            return f"without the {name}"
        value = getattr(part, fields[0])
        if np.ndim(value) or kind == "body":
            return f"{name} times {1 + x:.5g}"
        return f"{name} of {(1 + x) * value:.6g}, not {value:.6g}"

    return Change(of, SMALL, says, None if kind == "body" else -1.0)


def _damping(scene: Scene, joint: str, turns: bool, unit: float) -> Change:
    make: Any = TorsionSpring if turns else SlideSpring
    units = "N m s/rad" if turns else "N s/m"
    return Change(
        lambda x: scene.with_(load=[*scene.load, make(joint=joint, stiffness=0.0, damping=x)]),
        unit,
        lambda x: f"damping of {x:.6g} {units} in joint {joint!r}",
    )


def _replaced(scene: Scene, kind: str, part: Any, numbers: dict[str, Any]) -> Scene:
    parts = [_with(p, numbers) if p is part else p for p in getattr(scene, kind)]
    return scene.with_(**{kind: parts})


def _with(part: Any, numbers: dict[str, Any]) -> Any:
    return type(part)(**{**part.model_dump(), **numbers})


@dataclass(frozen=True)
class _Moved:
    """The columns of changed scenes, plus ``shift``: the error of the integration of the unchanged scene."""

    change: Change
    difference: Difference
    shift: Columns

    def columns(self, value: float) -> Columns | None:
        """Return the columns of the scene changed by a value; None if it cannot be simulated."""
        try:
            scene = self.change.of(value)
        except (SceneError, ValueError):
            return None
        found = _simulated(scene, self.difference)
        if found is None:
            return None
        return with_signs(self.difference.recorded, {n: found[n] + self.shift[n] for n in self.shift})


def _simulated(scene: Scene, d: Difference) -> Columns | None:
    """Return the table's columns of a scene; None if it cannot be simulated or a column is not finite."""
    ask()
    try:
        family = closed_form(scene)
        motion = family.poses(d.times) if family else gauss_motion(scene, tuple(d.times.tolist()), RTOL)
        columns = values(scene, motion, d.recorded)
    except (SceneError, RuntimeError, NoSolution, np.linalg.LinAlgError):
        return None
    found = {n: columns[n] for n in d.recorded if n in columns}
    is_known = len(found) == len(d.recorded) and all(np.isfinite(c).all() for c in found.values())
    return with_signs(d.exact, found) if is_known else None


def _fitted(value: float, moved: _Moved, d: Difference) -> tuple[float, Columns] | None:
    """Return the number and the columns that fit best, by the secant method; None if the change does not
    reduce the difference."""
    columns, exact = moved.columns(value), _stacked(d, d.exact)
    wanted = _stacked(d, d.recorded) - exact
    for _ in range(ITERATIONS):
        if columns is None:
            return None
        slope = (_stacked(d, columns) - exact) / value
        if not slope @ slope > 0:
            return None
        left = _stacked(d, d.recorded) - _stacked(d, columns)
        rest = wanted - slope * (slope @ wanted) / (slope @ slope)
        if np.linalg.norm(rest) > PROMISING * np.linalg.norm(wanted):
            return value, columns
        step = float(slope @ left / (slope @ slope))
        if abs(step) <= 1e-10 * abs(value):
            break
        value = value + step
        if not (np.isfinite(value) and value):
            return None
        columns = moved.columns(value)
    return None if columns is None else (value, columns)


def _stacked(d: Difference, columns: Columns) -> np.ndarray:
    """Return the columns one after another, relative to their scales; if there are others, without columns
    that leap where a load is switched."""
    signed = with_signs(d.recorded, columns)
    smooth = [name for name in d.recorded if kind_of(name) not in LEAPING] or list(d.recorded)
    return np.concatenate([signed[name] / d.scale[name] for name in smooth])
