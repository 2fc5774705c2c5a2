"""Adapter of mbref: a family is a method, `taylor` also with generated code, at several relative
tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, get_args

import numpy as np

from crosscheck.differentiating import Differentiating, TangentDerivatives
from crosscheck.engine import Alternatives, Cannot, Engine, Owner, Setting, Supports
from crosscheck.judge.tolerances import ROUNDING
from crosscheck.refusals import FACTOR, ORIENTATION, TABLE
from crosscheck.setting import BRANCHES, FamilyParts
from mbref.motions.trajectory import Trajectory
from mbref.scene import JOINT_TYPES, LOAD_TYPES, Scene, intermittent
from mbref.scene.couplings import MOST_POWERS
from mbref.scene.joints import Coordinate

if TYPE_CHECKING:
    from mbref.method import Method

METHODS = (
    "taylor",
    "taylor, generated",
    "alf-dual+projection",
    "mpi-svd+partitioning",
    "mpi-svd+projection",
    "mpi-svd+none",
    "mpi-qr+projection",
    "lm2+projection",
)
WITH_SINGULAR_MASS = (
    "taylor",
    "lm1+projection",
    "alf+projection",
)  # families for bodies that lack a moment of inertia
GENERATED = ", generated"  # suffix: machine code for the scene, compiled before the timed run
FAMILIES = {
    "alf-dual+projection": "augmented Lagrangian in dual form, projection, DOP853; default of many bodies",
    "lm2+projection": "Lagrange multipliers eliminated by blocks, projection, DOP853",
    "lm1+projection": "Lagrange multipliers, projection, DOP853; where a body lacks a moment of inertia",
    "alf+projection": "augmented Lagrangian, projection, DOP853; where a body lacks a moment of inertia",
    "taylor": "Taylor series in natural coordinates; the default; crosses singular positions",
    "mpi-svd+partitioning": "Moore-Penrose inverse by SVD, coordinate partitioning, DOP853",
    "mpi-svd+projection": "Moore-Penrose inverse by SVD, projection, DOP853",
    "mpi-svd+none": "Moore-Penrose inverse by SVD without stabilisation, DOP853",
    "mpi-qr+projection": "Moore-Penrose inverse by QR, projection, DOP853",
    "taylor, generated": "Taylor series by machine code generated for the scene before the clock runs",
}
OPTIONS = {
    "rtol": "relative tolerance of a step",
    BRANCHES: "pairs of a singular position and the branch to take there, from 1: [[2, 2]]",
}
# formulations without stabilisation: `serves` leaves out those that need independent rows or a regular mass
# matrix. Penalties and squares of the rows' condition cost digits.
FORMULATIONS = ("alf-dual", "mpi-qr", "mpi-gs", "mpi-svd", "lm1", "lm2")
ALTERNATIVES = (
    Alternatives(
        {name: Setting(f"{name}+none", {"rtol": 1e-9}) for name in FORMULATIONS}
        | {"taylor": Setting("taylor", {"rtol": 1e-9}), "alf": Setting("alf+none", {"rtol": 1e-9})},
        1e-5,
    ),
)
DIFFERENTIATES_BY = {"state_derivatives": "the linearised equations Φ_q δa = δγ, M δa + Φ_qᵀ δλ = δg"}
SECOND_RUN = "taylor"  # the method of the second runs by which errors are estimated
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11)


class Mbref(Differentiating, Engine):
    """The reference implementation; ``settings`` has several relative tolerances for each method."""

    name = "mbref"
    with_default = ("rtol",)
    package = "mbref"
    families, options, alternatives = FAMILIES, OPTIONS, ALTERNATIVES
    differentiates_by = DIFFERENTIATES_BY
    supports = Supports(
        joints=tuple(JOINT_TYPES),
        drivers=(*get_args(Coordinate), ORIENTATION),
        loads=tuple(LOAD_TYPES),
        couplings=get_args(Coordinate),
        armatures=get_args(Coordinate),
        over_time=(TABLE, FACTOR),
        massless_links=True,
        sums=True,
        powers=MOST_POWERS,
        stops=True,
        intervals=True,
        conditions=True,
    )

    def version(self) -> str:
        from mbref import __version__

        return __version__

    def own_derivatives(
        self, scene: Scene, function: str, away: np.ndarray | None = None
    ) -> TangentDerivatives:
        from mbref.design.derivatives.at_state import state_derivatives

        found = state_derivatives(scene)
        return TangentDerivatives(found.basis, found.by_position, found.by_velocity, found.by_force)

    def own_number_derivatives(self, scene: Scene, function: str, numbers: Sequence[str]) -> np.ndarray:
        from mbref.design.derivatives.at_state import state_derivatives

        return np.asarray(state_derivatives(scene, to=list(numbers)).by_number)

    def refuses(self, scene: Scene) -> Cannot | None:
        from mbref.equations.counts import undriven_freedoms

        if not scene.has_mass() and (any(intermittent(scene)) or undriven_freedoms(scene) > 0):
            return Cannot(
                Owner.MODEL,
                "bodies without mass can be moved only where the drivers prescribe the whole motion",
            )
        return None

    def settings(self, scene: Scene) -> Sequence[Setting]:
        self.prepare(())  # in two processes; the questions below would compile kernels in one process
        return [setting for family in _methods(scene) for setting in self.settings_of(scene, family)]

    def best_settings(self, scene: Scene) -> Sequence[Setting]:
        return next(filter(None, (self.settings_of(scene, family) for family in _methods(scene))), ())

    def settings_of(self, scene: Scene, family: str) -> Sequence[Setting]:
        if not self.serves(scene, family):
            return []
        return [Setting(family, {"rtol": rtol}) for rtol in TOLERANCES]

    def serves(self, scene: Scene, family: str) -> bool:
        from mbref.equations.counts import counts, undriven_freedoms
        from mbref.method import without_series
        from mbref.motions.pieces import first_piece
        from mbref.simulation.simulate import why_no_code

        method, scene = _method(family), first_piece(scene)
        if method.is_series and without_series(scene):
            return False
        if method.formulation.needs_independent_columns and undriven_freedoms(scene) > 0:
            return False
        handles = method.is_series or method.formulation.handles_singular_mass
        if _has_singular_mass(scene) and not handles:
            return False
        if family.endswith(GENERATED):
            return not why_no_code(scene, method)
        return counts(scene).redundant == 0 or method.formulation.handles_redundancy

    def has_family(self, family: str) -> bool:
        from mbref.method import MethodError

        try:
            _method(family)
        except MethodError:
            return False
        return True

    def family_parts(self) -> FamilyParts:
        from mbref.formulations import FORMULATIONS
        from mbref.integrators import INTEGRATORS, TAYLOR
        from mbref.stabilisation import STABILISATIONS

        return {
            "formulation": {name: part.options for name, part in FORMULATIONS.items()},
            "stabilisation": {name: part.options for name, part in STABILISATIONS.items()},
            "integrator": {name: part.options for name, part in INTEGRATORS.items()},
            "series": {TAYLOR.name: TAYLOR.options},
        }

    def prepare(self, families: Sequence[str]) -> None:
        from mbref.simulation.simulate import prepare

        for family in dict.fromkeys([*families, SECOND_RUN]):
            prepare(_method(family))

    def own_code(self, scene: Scene, setting: Setting) -> str:
        """Return the call of ``mbref.simulate``; empty for generated code, which needs ``Limits``."""
        if setting.family.endswith(GENERATED) or BRANCHES in setting.options:
            return ""
        tolerance = f", rtol={setting.options['rtol']!r}" if "rtol" in setting.options else ""
        return f"mbref.simulate(scene, {setting.family!r}{tolerance})"

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        from mbref.simulation.simulate import Limits, simulate

        code = "generated" if setting.family.endswith(GENERATED) else "generic"
        return simulate(scene, _method(setting.family), times, Limits(code=code, **setting.options))

    def with_error_estimate(self, run: Trajectory, seconds: float) -> Trajectory:
        from mbref.motions.motion import Motion
        from mbref.simulation.second_run import with_error_estimate

        return with_error_estimate(run, seconds) if isinstance(run, Motion) else run


def search(scene: Scene) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return positions (nb, 3), orientations (nb, 4) and eigenvalues (1/s) of the poses that `mbref
    equilibrium` finds."""
    from mbref.design.equilibrium import equilibria

    return [
        (
            np.array([body.position for body in each.scene.body]),
            np.array([body.orientation for body in each.scene.body]),
            each.eigenvalues,
        )
        for each in equilibria(scene)
    ]


def _methods(scene: Scene) -> Sequence[str]:
    """Return the methods that can run a scene: its default method, then the default method with generated
    code, then all other methods."""
    from mbref.method import default_method

    if _has_singular_mass(scene):
        return WITH_SINGULAR_MASS
    default = default_method(scene).removesuffix("/dop853")
    return sorted(METHODS, key=lambda method: method.removesuffix(GENERATED) != default)


def _has_singular_mass(scene: Scene) -> bool:
    """Return whether a body lacks a moment of inertia: most formulations invert the mass matrix."""
    given = [np.array(body.inertia, dtype=float) for body in scene.body if body.inertia is not None]
    moments = [np.linalg.eigvalsh(np.diag(i) if i.ndim == 1 else i) for i in given]
    return any(m[0] <= ROUNDING * max(m[-1], np.finfo(float).tiny) for m in moments)


def _method(family: str) -> Method:
    from mbref.method import Method

    return Method.parse(family.removesuffix(GENERATED))


ENGINE = Mbref()
