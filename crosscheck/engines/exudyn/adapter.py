"""Exudyn: rigid bodies with Euler parameters, implicit solvers with Lagrange multipliers, and static analysis
of driven mechanisms."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engine import Alternatives, Cannot, Engine, Owner, Setting
from crosscheck.engines.exudyn.dynamic import Motion, integrate, step_count
from crosscheck.engines.exudyn.extrapolation import RICHARDSON, extrapolate
from crosscheck.engines.exudyn.joints import SUPPORTS
from crosscheck.engines.exudyn.model import build
from crosscheck.engines.exudyn.reactions import reactions
from crosscheck.engines.exudyn.settings_code import Written
from crosscheck.engines.exudyn.static import drive
from crosscheck.engines.shared.driver_motion import fastest_rate
from crosscheck.engines.shared.fixed_steps import unended_piece
from crosscheck.judge.constraints import initial_poses, jacobian
from crosscheck.judge.tolerances import RANK
from crosscheck.linearising import Linearising
from crosscheck.setting import unknown_family
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import GROUND, Driver, PointDamper, Scene

STEPS = (100, 400, 1600, 6400, 25600)  # numbers of steps over a scene's duration
TUNED_STEPS = (0.4, 0.15, 0.05, 0.015, 0.006)  # rad turned per step
MOST_TUNED = 25600  # steps over a scene's duration
STATIC_STEPS = (100, 400, 1600)
SHORTEST = 5e-6  # s; for shorter steps the full-pivoting solver loses rows of the scaled Newton matrix
SPECTRAL_RADIUS = 0.9
SCOUT = (250, 2000)  # numbers of steps of the coarse run that measures the scene's fastest rate
SCOUT_SAMPLES = 26
CHOSEN = "chosen"
FAMILIES = {
    "defaults": "SolveDynamic with its default settings",
    "tuned": "three trapezoidal runs extrapolated to h = 0, restarted after singular positions",
    "trapezoidal": "the trapezoidal rule with index-2 constraints",
    "alpha": "generalised alpha",
    "static": "static analysis of a fully driven mechanism, pose by pose",
    CHOSEN: "the linear solver and the index of the options, fixed steps, tight Newton tolerances",
}
OPTIONS = {
    "step": "largest time step, s",
    "solver": "type of the linear solver; EigenDense ignores redundant rows",
    "index": "2 by the trapezoidal rule, or 3 by generalised alpha",
}


def _way(index: int, solver: str) -> dict[str, Setting]:
    """Return the way of a linear solver; all but EigenDense fail and say so where rows are redundant."""
    return {f"index {index}, {solver}": Setting(CHOSEN, {"step": 2e-4, "solver": solver, "index": index})}


ALTERNATIVES = (
    Alternatives(_way(2, "EigenDense") | _way(2, "EXUdense") | _way(2, "EigenSparse"), 1e-5),
    Alternatives(_way(3, "EigenDense") | _way(3, "EXUdense") | _way(3, "EigenSparse"), 1e-5),
    Alternatives(_way(2, "EigenDense") | _way(3, "EigenDense"), 0.05),  # measured: 0.02, of the step
)


class Exudyn(Linearising, Engine):
    """The Exudyn engine; its one option ``step`` (s) is the largest time step."""

    name = "exudyn"
    linearises_by = "ComputeODE2Eigenvalues"
    package = "exudyn"
    supports = SUPPORTS
    families, options, integrated_here = FAMILIES, OPTIONS, ("tuned",)
    defaults_of = ("exudyn.SimulationSettings()",)
    alternatives = ALTERNATIVES

    def prepare(self, families: Sequence[str]) -> None:
        _exudyn()

    def refuses(self, scene: Scene) -> Cannot | None:
        if not scene.has_mass() and not _fully_driven(scene):
            return Cannot(
                Owner.MODEL, "without masses only a mechanism whose whole motion is driven can be analysed"
            )
        for k, load in enumerate(scene.load):
            if isinstance(load, PointDamper) and load.bodies[0] != GROUND:
                why = f"load[{k}] damps a point as seen from the moving body {load.bodies[0]!r}"
                return Cannot(Owner.ENGINE, f"{why}; Exudyn's connector leaves out the body's rotation")
        return unended_piece(scene)

    def serves(self, scene: Scene, family: str) -> bool:
        return scene.has_mass() if family in ("tuned", CHOSEN) else super().serves(scene, family)

    def settings_of(self, scene: Scene, family: str) -> Sequence[Setting]:
        """Return the settings of a family; of `chosen` the first of the alternatives."""
        if family == CHOSEN:
            return [next(iter(ALTERNATIVES[0].ways.values()))]
        return super().settings_of(scene, family)

    def settings(self, scene: Scene) -> Sequence[Setting]:
        found = []
        if scene.has_mass():
            found += _sweep("defaults", scene, STEPS, SHORTEST)
            found += [Setting("tuned", {"step": step}) for step in self._tuned_steps(scene)]
            found += _sweep("trapezoidal", scene, STEPS, SHORTEST)
            found += _sweep("alpha", scene, STEPS, SHORTEST)
        if _fully_driven(scene):
            found += _sweep("static", scene, STATIC_STEPS, 0.0)
        return found

    def _tuned_steps(self, scene: Scene) -> list[float]:
        """Return steps (s) of the extrapolated family, chosen by the angle that a body turns in one step."""
        rate = fastest_rate(scene, lambda step: self._coarse(scene, step), SCOUT)
        shortest = max(SHORTEST * max(RICHARDSON), scene.duration / MOST_TUNED)
        return sorted({max(float(f"{angle / rate:.2g}"), shortest) for angle in TUNED_STEPS}, reverse=True)

    def _coarse(self, scene: Scene, step: float) -> Trajectory:
        times = np.linspace(0, scene.duration, SCOUT_SAMPLES)
        return self.run(scene, times, Setting("alpha", {"step": step}))

    def own_code(self, scene: Scene, setting: Setting) -> str:
        """Return the statements that set up SolveDynamic, for ``settings = exu.SimulationSettings()``."""
        if setting.family not in DYNAMIC:
            return ""
        from mbref import counts

        statements: list[str] = []
        exu, settings = Written("exu", statements), Written("settings", statements)
        integration = settings.timeIntegration
        integration.endTime = scene.duration
        integration.numberOfSteps = step_count(scene.duration, float(setting.options["step"]))
        kind = DYNAMIC[setting.family](exu, settings, bool(counts(scene).redundant or scene.driver))
        return "; ".join([*statements, f"mbs.SolveDynamic(settings, solverType={kind!r})"])

    def own_eigenvalues(self, scene: Scene) -> np.ndarray:
        """Return the eigenvalues of mass, damping and stiffness projected into the null space of the
        constraints' Jacobian."""
        exu = _exudyn()
        with _warnings(exu):
            system = build(exu, scene, forces=True).mbs
            found, _ = system.ComputeODE2Eigenvalues(computeComplexEigenvalues=True, useAbsoluteValues=False)
        return np.asarray(found)

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        if setting.family not in self.families:
            raise unknown_family(self.name, setting.family)
        exu = _exudyn()
        times, step = np.array(times, dtype=float), float(setting.options["step"])
        with _warnings(exu) as warnings:
            if setting.family == "static":
                motion = drive(exu, scene, times, step)
            elif setting.family == "tuned":
                motion = extrapolate(exu, scene, times, step, _trapezoidal)
            else:
                configure = DYNAMIC.get(setting.family) or partial(_chosen, setting.options)
                motion = integrate(exu, scene, times, step, configure)
        message = "; ".join([motion.message, *warnings] if motion.message else warnings)
        return self._trajectory(scene, setting, replace(motion, message=message))

    def _trajectory(self, scene: Scene, setting: Setting, motion: Motion) -> Trajectory:
        q, rates = motion.coordinates[:2]
        turned = q[..., 3:] + [1.0, 0.0, 0.0, 0.0]
        turn = _normalised(turned)
        start, orientation = initial_poses(scene)
        forces = None if any(_accelerates(driver) for driver in scene.driver) else motion.forces
        seconds = None if forces is None else motion.coordinates[2]
        return Trajectory(
            scene.name,
            self.name,
            self.version(),
            setting.family,
            dict(setting.options),
            motion.times,
            tuple(body.name for body in scene.body),
            position=start + q[..., :3],
            orientation=rotations.multiply(turn, orientation),
            velocity=rates[..., :3],
            angular_velocity=_angular(turned, rates[..., 3:]),
            acceleration=None if seconds is None else seconds[..., :3],
            angular_acceleration=None if seconds is None else _angular(turned, seconds[..., 3:]),
            reactions=None if forces is None else reactions(scene, q[..., :3], turn, forces),
            outcome=motion.outcome,
            message=motion.message,
            cost=motion.cost,
            t_end=motion.t_end,
        )


def _exudyn() -> Any:
    """Return the exudyn module and its item classes; no user file is read, nothing is printed."""
    os.environ["EXUDYN_NO_USER_SETTINGS"] = "1"
    import exudyn
    import exudyn.itemInterface

    exudyn.special.userInterface.SuppressAll(True)
    exudyn.config.printToConsole = False
    return exudyn


@contextlib.contextmanager
def _warnings(exu: Any) -> Iterator[list[str]]:
    """Collect the distinct warnings that Exudyn prints while the ``with`` block runs."""
    found: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        printed = Path(folder) / "printed"
        exu.SetWriteToFile(str(printed), flagWriteToFile=True, flagAppend=False, flagFlushAlways=True)
        try:
            yield found
        finally:
            exu.SetWriteToFile("", False)
            lines = printed.read_text().splitlines() if printed.exists() else []
            found += dict.fromkeys(line.strip() for line in lines if line.startswith("WARNING:"))


def _defaults(exu: Any, settings: Any, singular: bool) -> Any:
    """Configure the solver with the library's defaults."""
    return exu.DynamicSolverType.GeneralizedAlpha


def _trapezoidal(exu: Any, settings: Any, singular: bool) -> Any:
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.absoluteTolerance = 1e-12
    _plain(exu, settings, singular)
    return exu.DynamicSolverType.TrapezoidalIndex2


def _alpha(exu: Any, settings: Any, singular: bool) -> Any:
    """Configure the generalised-α solver with looser Newton tolerances; with the default tolerances the
    solver fails at singular positions."""
    settings.timeIntegration.newton.relativeTolerance = 1e-6
    settings.timeIntegration.newton.absoluteTolerance = 1e-8
    settings.timeIntegration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    _plain(exu, settings, singular)
    return exu.DynamicSolverType.GeneralizedAlpha


def _chosen(options: Mapping[str, Any], exu: Any, settings: Any, singular: bool) -> Any:
    """Configure the linear solver and the index that the options name."""
    kind = _trapezoidal(exu, settings, singular)
    settings.linearSolver.solverType = getattr(exu.LinearSolverType, options["solver"])
    settings.linearSolver.ignoreSingularJacobian = options["solver"] == "EigenDense"
    if options["index"] == 2:
        return kind
    settings.timeIntegration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    return exu.DynamicSolverType.GeneralizedAlpha


DYNAMIC = {"defaults": _defaults, "trapezoidal": _trapezoidal, "alpha": _alpha}


def _plain(exu: Any, settings: Any, singular: bool) -> None:
    """Configure fixed steps, and full pivoting that ignores zero pivots if the constraints are redundant."""
    settings.timeIntegration.adaptiveStep = False
    if singular:
        settings.linearSolver.solverType = exu.LinearSolverType.EigenDense
        settings.linearSolver.ignoreSingularJacobian = True


def _sweep(family: str, scene: Scene, counts: Sequence[int], shortest: float) -> list[Setting]:
    steps = [scene.duration / n for n in counts]
    return [Setting(family, {"step": step}) for step in steps if step >= shortest]


def _fully_driven(scene: Scene) -> bool:
    """Return whether joints and drivers leave no degree of freedom in the assembled configuration."""
    if not scene.driver:
        return False
    matrix, _ = jacobian(scene, 0.0, *initial_poses(scene))
    return np.linalg.matrix_rank(matrix, tol=None, rtol=RANK) == matrix.shape[1]


def _accelerates(driver: Driver) -> bool:
    """Return whether a driver's rate changes; Exudyn's initial accelerations ignore a driver's
    acceleration."""
    return any(driver.polynomial[2:]) or bool(driver.sine and driver.sine.amplitude)


def _normalised(p: np.ndarray) -> np.ndarray:
    return p / np.linalg.norm(p, axis=-1, keepdims=True)


def _angular(p: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return the world angular velocity (…, 3) from Euler parameters and their rates, or the acceleration
    from second rates."""
    product = rotations.multiply(rates, rotations.conjugate(p))
    return 2 * product[..., 1:] / np.sum(p * p, axis=-1, keepdims=True)


ENGINE = Exudyn()
