"""Variants of a scene: copies in which some numbers are random, for tolerance studies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mbref.input_error import InputError
from mbref.scene.paths import replaced_at
from mbref.scene.scene import Scene
from mbref.scene.validation import SceneError

INTERVAL, DEVIATION = ":", "+-"


@dataclass(frozen=True)
class Variation:
    """A number of a scene and its distribution.

    Attributes
    ----------
    path : str
        Path of the number, as in messages: ``body[0].mass``, ``joint[B].anchor[0]``, ``gravity[1]``.
    low, high : float
        Limits of the uniform distribution; mean and standard deviation if ``normal``.
    normal : bool
        Whether the distribution is normal.
    """

    path: str
    low: float
    high: float
    normal: bool = False

    @staticmethod
    def parse(text: str) -> Variation:
        """Return the variation that a text describes.

        Parameters
        ----------
        text : str
            ``PATH=LOW:HIGH`` or ``PATH=MEAN+-DEVIATION``, in SI units.

        Raises
        ------
        InputError
            If the text has another form, or limits that are not finite or not in order.
        """
        path, equals, spread = text.partition("=")
        normal = DEVIATION in spread
        numbers = spread.split(DEVIATION if normal else INTERVAL)
        try:
            low, high = map(float, numbers)
        except ValueError:
            raise InputError(f"{text!r} is not PATH=LOW:HIGH or PATH=MEAN+-DEVIATION") from None
        if not (equals and np.isfinite([low, high]).all() and (high >= 0 if normal else high >= low)):
            raise InputError(f"{text!r} must have LOW <= HIGH, or a DEVIATION that is not negative")
        return Variation(path.strip(), low, high, normal)

    def draw(self, random: np.random.Generator) -> float:
        """Return one random value.

        Parameters
        ----------
        random : numpy.random.Generator
            Source of random numbers.

        Returns
        -------
        float
            The value, SI units.
        """
        return float(
            random.normal(self.low, self.high) if self.normal else random.uniform(self.low, self.high)
        )


def variants(scene: Scene, variations: Sequence[Variation], count: int, seed: int = 0) -> Iterator[Scene]:
    """Yield copies of a scene with independent random numbers.

    Variant k depends on ``seed`` and k only.

    Parameters
    ----------
    scene : Scene
        The scene to vary.
    variations : sequence of Variation
        The numbers that vary.
    count : int
        Number of copies.
    seed : int
        Seed of the random numbers.

    Yields
    ------
    Scene
        Variants 0 to ``count`` - 1, in order.

    Raises
    ------
    SceneError
        If a path leads to no number of the scene, two paths lead to one number, or a variant is not a valid
        scene.
    """
    _refuse_repeated(scene, [variation.path for variation in variations])
    for k in range(count):
        data = dict(scene)
        random = np.random.default_rng([seed, k])
        for variation in variations:
            data = replaced_at(data, variation.path, partial(_drawn, variation, random))
        yield _valid(data, k)


def _refuse_repeated(scene: Scene, paths: Sequence[str]) -> None:
    """Raise SceneError for two paths to one number; the last one alone would vary it."""
    data, mark = dict(scene), object()
    marked: list[tuple[str, dict[str, Any]]] = []
    for path in paths:
        found = replaced_at(data, path, lambda _: mark)
        for earlier, other in marked:
            if found == other:
                raise SceneError([f"{path}: varies the same number as {earlier}; give it once"])
        marked.append((path, found))


def _drawn(variation: Variation, random: np.random.Generator, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SceneError([f"{variation.path}: the scene has no number at this path"])
    return variation.draw(random)


def _valid(data: dict[str, Any], k: int) -> Scene:
    try:
        return Scene(**data)
    except SceneError as error:
        raise SceneError([f"variant {k}: {fault}" for fault in error.faults]) from None
