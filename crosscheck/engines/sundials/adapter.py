"""SUNDIALS IDA on the scene's own equations in Cartesian coordinates, stabilised and of index 1.

With Euler parameters p, body-fixed ω', and the twist V = (v, ω'), the residual is

    q' = T(q) (V + Φ_qᵀ μ),   M V' = f + Φ_qᵀ λ,   Φ(q, t) = 0,   Φ_q V = ν,

the index-2 form of Gear, Gupta and Leimkuhler; λ and μ are derivatives of two further states, which reduces
the index of the equations to 1 (Gear).  Rows that are redundant at the start are left out; a QR decomposition
with pivoting selects the independent rows. If another selection becomes much better conditioned, the run
restarts with it. The run ends if a row that was left out is violated later.

The residual is computed by numpy, which takes most of the time.  The one option is ``rtol``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engine import Alternatives, Cannot, Engine, Setting, Supports
from crosscheck.engines.shared.everything import EVERYTHING
from crosscheck.engines.shared.fixed_steps import simulated
from crosscheck.engines.shared.initial_velocities import lacks_mass
from crosscheck.engines.sundials.ida import Run
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

DENSE = "dense"
SOLVERS = (DENSE, "lapackdense", "band")
WAY = {"rtol": 1e-9}
OPTIONS = {"rtol": "relative tolerance", "solver": f"IDA's linear solver: {', '.join(SOLVERS)}"}
RTOLS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
FAMILY = "ggl"
FAMILIES = {FAMILY: "IDA on the equations of Gear, Gupta and Leimkuhler, of index 1"}


class Sundials(Engine):
    """SUNDIALS IDA (PyPI ``scikit-sundae``)."""

    name = "sundials"
    package = "scikit-sundae"
    modules = ("sksundae.ida",)
    families, options = FAMILIES, OPTIONS
    alternatives = (Alternatives({name: Setting(FAMILY, {**WAY, "solver": name}) for name in SOLVERS}, 1e-6),)
    supports = Supports(
        EVERYTHING.joints, EVERYTHING.drivers, ("moment", "force", "spring", "torsion_spring")
    )

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse scenes without masses whose motion the drivers do not determine completely."""
        return lacks_mass(scene)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return the settings of the one family, by relative tolerance."""
        return [Setting(FAMILY, {"rtol": rtol}) for rtol in RTOLS]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        return simulated(self, scene, times, setting, lambda: _simulation(scene, setting))


def _simulation(scene: Scene, setting: Setting) -> Run:
    from sksundae.ida import IDA

    return Run(IDA, scene, setting.options["rtol"], setting.options.get("solver", DENSE))


ENGINE = Sundials()
