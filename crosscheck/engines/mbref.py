"""mbref as an engine: a family is a method, its accuracy the tolerance or the fixed step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting, Why
from mbref.scene import Scene
from mbref.trajectory import Trajectory

METHODS = (
    "alf-dual+projection",
    "mpi-svd+partitioning",
    "mpi-svd+projection",
    "mpi-svd+none",
    "mpi-qr+projection",
    "lm2+projection",
)
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)


class Mbref(Engine):
    """The reference implementation; ``settings`` sweeps the relative tolerance of each method."""

    name = "mbref"
    package = "mbref"

    def version(self) -> str:
        from mbref import __version__

        return __version__

    def cannot(self, scene: Scene) -> Cannot | None:
        if not scene.has_mass() and scene.counts().degrees_of_freedom > 0:
            return Cannot(Why.NEVER, "bodies without mass move only where every freedom is driven")
        return None

    def settings(self, scene: Scene) -> Sequence[Setting]:
        from mbref.method import Method

        redundant = scene.counts().redundant > 0
        return [
            Setting(method, {"rtol": rtol})
            for method in METHODS
            if not redundant or Method.parse(method).formulation.handles_redundancy
            for rtol in TOLERANCES
        ]

    def prepare(self, families: Sequence[str]) -> None:
        from mbref.method import Method
        from mbref.simulate import prepare

        for family in families:
            prepare(Method.parse(family))

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        from mbref.simulate import Limits, simulate

        return simulate(scene, setting.family, times, Limits(**setting.options))


ENGINE = Mbref()
