"""mbref as an engine: a family is a method and whose code it runs, its accuracy the tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.engine import Cannot, Engine, Setting, Why
from mbref.scene import Scene
from mbref.trajectory import Trajectory

METHODS = (
    "alf-dual+projection, own code",
    "alf-dual+projection",
    "alf-dual+projection, sparse",
    "lm2+projection, own code",
    "mpi-svd+partitioning",
    "mpi-svd+projection",
    "mpi-svd+none",
    "mpi-qr+projection",
    "lm2+projection",
)
OWN_CODE = ", own code"  # machine code of the scene, made before the clock runs
SPARSE = ", sparse"  # the sparse factor that large scenes have by default
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
        return [
            Setting(family, {"rtol": rtol})
            for family in METHODS
            if self._serves(family, scene)
            for rtol in TOLERANCES
        ]

    def _serves(self, family: str, scene: Scene) -> bool:
        from mbref.simulate import why_no_code

        method = _method(family)
        if family.endswith(OWN_CODE):
            return not why_no_code(scene, method)
        return scene.counts().redundant == 0 or method.formulation.handles_redundancy

    def prepare(self, families: Sequence[str]) -> None:
        from mbref.simulate import prepare
        from mbref.sparse.chart import CHARTS

        for family in families:
            method = _method(family)
            if family.endswith(SPARSE):
                method = replace(method, stabilisation=CHARTS[method.stabilisation.name])
            prepare(method)

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        from mbref.simulate import Limits, simulate

        how = {"code": "specialised" if setting.family.endswith(OWN_CODE) else "generic"}
        if setting.family.endswith(SPARSE):
            how["sparse_above"] = 0
        return simulate(scene, _method(setting.family), times, Limits(**how, **setting.options))


def _method(family: str):
    from mbref.method import Method

    return Method.parse(family.removesuffix(OWN_CODE).removesuffix(SPARSE))


ENGINE = Mbref()
