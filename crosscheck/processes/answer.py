"""Validation of an engine's result: a Trajectory of the requested bodies at the requested times.

The child process validates, so that a malformed result becomes the outcome of its run. A child returns only
Python's and numpy's own types.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from crosscheck.engine import Engine, Setting
from crosscheck.judge.events import at_samples
from crosscheck.judge.metrics import in_scene_order
from crosscheck.refusals import shortened
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene

WIDTHS = {"position": 3, "orientation": 4, "velocity": 3, "angular_velocity": 3}
OPTIONAL = {"acceleration": 3, "angular_acceleration": 3}
UNIT_TOLERANCE = 1e-3  # largest deviation of a quaternion from unit length


class MalformedAnswer(Exception):
    """The engine did not return a valid trajectory of the run; the message is the reason."""


def well_formed(answer: Any, scene: Scene, times: np.ndarray) -> Trajectory:
    """Return the engine's result of ``run(scene, times, …)`` as a Trajectory of plain numbers, with the
    bodies in the scene's order.

    Raises MalformedAnswer if it is no Trajectory, has other bodies, other or too few samples, arrays of
    another shape or fields of another type, belongs to another scene, or has no version.
    """
    if not isinstance(answer, Trajectory):
        raise MalformedAnswer(f"the engine returned {type(answer).__name__}, not a Trajectory")
    if not isinstance(answer.outcome, Outcome):
        raise MalformedAnswer(f"outcome: is {answer.outcome!r}, not an Outcome")
    names = tuple(body.name for body in scene.body)
    if not isinstance(answer.bodies, tuple | list) or sorted(map(str, answer.bodies)) != sorted(names):
        raise MalformedAnswer(f"bodies: are {answer.bodies!r}, but the scene has {names!r}")
    reached = _times(answer, times)
    if answer.scene != scene.name:
        raise MalformedAnswer(f"scene: is {answer.scene!r}, not {scene.name!r}")
    if not str(answer.version).strip():
        raise MalformedAnswer("version: is empty")
    plain: dict[str, Any] = {
        name: _array(name, getattr(answer, name), (reached.size, len(names), width))
        for name, width in (WIDTHS | OPTIONAL).items()
        if name in WIDTHS or getattr(answer, name) is not None
    }
    if np.any(np.abs(np.linalg.norm(plain["orientation"], axis=-1) - 1) > UNIT_TOLERANCE):
        raise MalformedAnswer("orientation: has a quaternion that is not of unit length")
    texts: dict[str, Any] = {name: str(getattr(answer, name)) for name in ("version", "method")}
    found = replace(
        answer,
        **plain,
        **texts,
        message=shortened(answer.message),
        times=reached,
        bodies=tuple(answer.bodies),
        settings=_settings(answer.settings),
        cost=_cost(answer),
        t_end=_number("t_end", answer.t_end),
        reactions=_reactions(answer.reactions, scene, reached.size),
    )
    return _finite(in_scene_order(scene, found))


def _finite(run: Trajectory) -> Trajectory:
    """Return a run that completed with numbers that are not finite as a failed one, with the samples before
    them; return any other run as it is."""
    samples = np.concatenate([getattr(run, name) for name in WIDTHS], axis=2)
    is_finite = np.isfinite(samples).all(axis=(1, 2))
    if run.outcome is not Outcome.COMPLETED or is_finite.all():
        return run
    k = int(is_finite.argmin())
    body = run.bodies[int(np.isfinite(samples[k]).all(axis=1).argmin())]
    message = f"the engine completed, but the motion of {body} is not finite at {run.times[k]:.6g} s"
    t_end = float(run.times[max(k - 1, 0)])
    return replace(at_samples(run, np.arange(k)), outcome=Outcome.NOT_FINITE, message=message, t_end=t_end)


def answered(simulator: Engine, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
    """Return the engine's run, checked by `well_formed`, with engine, version and options; raises
    MalformedAnswer."""
    answer = well_formed(simulator.run(scene, times, setting), scene, times)
    named = {"engine": simulator.name, "version": str(simulator.version())}
    for name, own in named.items():
        if getattr(answer, name) != own:
            raise MalformedAnswer(f"{name}: is {getattr(answer, name)!r}, not {own!r}")
    for option, value in _settings(setting.options).items():
        if answer.settings.get(option) != value:
            raise MalformedAnswer(f"settings: {option} is {answer.settings.get(option)!r}, not {value!r}")
    return answer


def _times(answer: Trajectory, times: np.ndarray) -> np.ndarray:
    """Return the reached times (k,): the first of the requested times, or all of them if the run
    completed."""
    reached = _array("times", answer.times, None)
    if not np.array_equal(reached, times[: reached.size]):
        raise MalformedAnswer("times: are not the first of the requested times")
    if answer.outcome is Outcome.COMPLETED and reached.size < times.size:
        raise MalformedAnswer(f"times: completed with {reached.size} of {times.size} samples")
    return reached


def _array(name: str, value: Any, shape: tuple[int, ...] | None) -> np.ndarray:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise MalformedAnswer(f"{name}: is {type(value).__name__}, not an array of numbers") from None
    if shape is not None and array.shape != shape:
        raise MalformedAnswer(f"{name}: has shape {array.shape}, not {shape}")
    return array


def _number(name: str, value: Any) -> float:
    return float(_array(name, value, ()))


def _reactions(value: Any, scene: Scene, reached: int) -> dict[str, np.ndarray] | None:
    if value is None:
        return None
    if not isinstance(value, Mapping) or not set(value) <= {joint.name for joint in scene.joint}:
        raise MalformedAnswer("reactions: name joints that the scene does not have")
    return {name: _array(f"reactions[{name}]", load, (reached, 6)) for name, load in value.items()}


def _settings(value: Any) -> dict[str, Any]:
    """Return the settings as JSON reads them, with numpy's numbers replaced by Python's."""
    try:
        return json.loads(json.dumps(dict(value), default=lambda number: number.item()))
    except (TypeError, ValueError, AttributeError):
        raise MalformedAnswer("settings: must be a dictionary of plain values") from None


def _cost(answer: Trajectory) -> Cost:
    value: Any = answer.cost
    if not isinstance(value, Cost):
        raise MalformedAnswer(f"cost: is {type(value).__name__}, not a Cost")
    numbers = {
        field.name: _number(f"cost.{field.name}", getattr(value, field.name)) for field in fields(Cost)
    }
    if not all(math.isfinite(number) for number in numbers.values()):
        raise MalformedAnswer("cost: is not finite")
    if min(numbers.values()) < 0:
        raise MalformedAnswer("cost: is negative")
    plain: dict[str, Any] = {n: x if n.endswith("seconds") else int(x) for n, x in numbers.items()}
    return Cost(**plain)
