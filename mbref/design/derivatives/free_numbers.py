"""Numbers of a scene that a search changes, over their sizes."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from mbref.design.derivatives.numbers_of_scene import is_of_point, size_of_number
from mbref.design.derivatives.paths_of_numbers import number_at
from mbref.design.derivatives.sensitivities import refuse_repeats
from mbref.design.derivatives.start_numbers import is_of_start
from mbref.equations.model import Model
from mbref.equations.offsets import assembled
from mbref.input_error import InputError
from mbref.scene import Scene

NOTICEABLE = 1e-3  # change of the residuals, in units of these, with which a number differs from zero
NOT_NEGATIVE = ("mass", "stiffness", "damping", "natural_length", "armature")
MOMENT = re.compile(r"\.inertia(\[\d\]|\.[xyz]|\[(\d)\]\[\2\])$")  # principal, or on the diagonal


class FreeNumbers:
    """Numbers (p,) of a scene by their paths. ``start`` (p,) are the scene's own; ``sizes`` (p,) are their
    values, of points the mechanism's length; ``lowest`` (p,) is 0 for masses and alike, otherwise -∞."""

    def __init__(self, scene: Scene, name: str, labels: Sequence[str]):
        refuse_repeats(scene, name, labels)
        for label in labels:
            if is_of_start(label):
                raise InputError(
                    f"{name}: {label} is a number of the start and no field of the scene; it cannot change"
                )
        self.scene, self.labels = scene, tuple(labels)
        self.start = np.array([number_at(scene, label) for label in labels])
        base = Model(assembled(scene))
        pairs = zip(self.start.tolist(), labels, strict=True)
        self.sizes = np.array([size_of_number(value, label, base) for value, label in pairs])
        self.length = base.length
        self._is_of_point = np.array([is_of_point(label) for label in labels])
        base.release()
        self.lowest = np.where([_is_not_negative(label) for label in labels], 0.0, -np.inf)

    def scene_at(self, z: np.ndarray) -> Scene:
        """Return the scene with numbers z (p,), over their sizes."""
        scene = self.scene
        for label, value in zip(self.labels, (z * self.sizes).tolist(), strict=True):
            scene = scene.with_(label, value)
        return scene

    def relative(self, z: np.ndarray, changes: np.ndarray) -> np.ndarray:
        """Return factors (p,) on the sizes, with which changes of numbers z (p,) are relative to these: their
        absolute values, and 1 for points and for numbers that are as good as zero. ``changes`` (p,) are those
        of the residuals, in their units, by changes of z by 1."""
        has_size = ~self._is_of_point & (np.abs(z) * changes >= NOTICEABLE)
        return np.where(has_size, np.abs(z), 1.0)

    def values(self, z: np.ndarray) -> dict[str, float]:
        """Return the numbers by path for z (p,), over their sizes."""
        return dict(zip(self.labels, (z * self.sizes).tolist(), strict=True))


def _is_not_negative(label: str) -> bool:
    return label.rpartition(".")[2] in NOT_NEGATIVE or MOMENT.search(label) is not None
