"""Variants of a scene: copies in which some of its numbers are drawn at random, for tolerance studies."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbref.scene import Scene, SceneError

INTERVAL, DEVIATION = ":", "+-"
STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[([^\]]+)\]")


@dataclass(frozen=True)
class Variation:
    """A number of a scene and how it varies: uniform from ``low`` to ``high``, or normal with mean
    ``low`` and standard deviation ``high`` where ``normal``.

    ``path`` is that of the scene's faults, an entry by its place or by its name: ``body[0].mass``,
    ``joint[B].anchor[0]``, ``gravity[1]``.
    """

    path: str
    low: float
    high: float
    normal: bool = False

    @staticmethod
    def parse(text: str) -> Variation:
        """``PATH=LOW:HIGH`` or ``PATH=MEAN+-DEVIATION``; raises ValueError."""
        path, equals, spread = text.partition("=")
        normal = DEVIATION in spread
        numbers = spread.split(DEVIATION if normal else INTERVAL)
        try:
            low, high = map(float, numbers)
        except ValueError:
            raise ValueError(f"{text!r} is not PATH=LOW:HIGH or PATH=MEAN+-DEVIATION") from None
        if not (equals and np.isfinite([low, high]).all() and (high >= 0 if normal else high >= low)):
            raise ValueError(f"{text!r} is no interval, and no mean with a deviation")
        return Variation(path.strip(), low, high, normal)

    def draw(self, random: np.random.Generator) -> float:
        """One value."""
        return float(
            random.normal(self.low, self.high) if self.normal else random.uniform(self.low, self.high)
        )


def variants(scene: Scene, variations: Sequence[Variation], count: int, seed: int = 0) -> Iterator[Scene]:
    """``count`` copies of the scene with independently drawn numbers; the k-th depends on seed and k only.

    Raises SceneError where a path leads to no number of the scene, or a variant is no valid scene.
    """
    for k in range(count):
        data = {field: getattr(scene, field) for field in Scene.model_fields}
        random = np.random.default_rng([seed, k])
        for variation in variations:
            steps = _steps(variation.path)
            data[steps[0]] = _replaced(data[steps[0]], steps[1:], variation.draw(random), variation.path)
        yield _valid(data, k)


def _valid(data: dict[str, Any], k: int) -> Scene:
    try:
        return Scene(**data)
    except SceneError as error:
        raise SceneError([f"variant {k}: {fault}" for fault in error.faults]) from None


def _steps(path: str) -> list[str]:
    """The fields and entries that a path leads through."""
    found = [name or entry for name, entry in STEP.findall(path)]
    if STEP.sub("", path) or not found or found[0] not in Scene.model_fields:
        raise SceneError([f"{path}: is not a path of a scene, such as body[0].mass or joint[B].anchor[0]"])
    return found


def _replaced(value: Any, steps: Sequence[str], number: float, path: str) -> Any:
    """The value with the number at the end of the steps replaced; tables become dictionaries."""
    if not steps:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise SceneError([f"{path}: is not a number that the scene gives"])
        return number
    step, rest = steps[0], steps[1:]
    if isinstance(value, tuple):
        place = _place(value, step, path)
        return tuple(_replaced(v, rest, number, path) if i == place else v for i, v in enumerate(value))
    if step not in getattr(type(value), "model_fields", {}):
        raise SceneError([f"{path}: the scene has no {step!r} there"])
    fields = {field: getattr(value, field) for field in type(value).model_fields}
    return {**fields, step: _replaced(fields[step], rest, number, path)}


def _place(entries: tuple[Any, ...], step: str, path: str) -> int:
    """The index that a step names: a number, or the name of the entry (a driver has its joint's)."""
    names = [getattr(entry, "name", getattr(entry, "joint", None)) for entry in entries]
    if step in names:
        return names.index(step)
    if step.isdigit() and int(step) < len(entries):
        return int(step)
    raise SceneError([f"{path}: the scene has no {step!r} there"])
