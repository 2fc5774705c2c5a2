"""Eigenvalues of engines about the judge's steady poses, by own functions and by their accelerations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from crosscheck.engine import Engine
from crosscheck.judge.arithmetic import doubles
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.model_identity import gate_times
from crosscheck.judge.small_motions.equations import STEP, Balance, in_doubles, ordered
from crosscheck.judge.small_motions.equilibria import Steady
from crosscheck.judge.small_motions.posed import posed
from crosscheck.linearising import Linearising
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

# increment of differences of an engine's accelerations, rad or lengths, where the judge's is STEP; its fourth
# power is 1.6e-11
H = 2e-3
CENTRAL = ((1, 2 / 3), (2, -1 / 12))  # weights of central differences of order 4
ACCELERATIONS = "accelerations"


class Result(NamedTuple):
    """Eigenvalues (1/s) of an engine by its own function or by differences; or the reason for none."""

    engine: str
    version: str
    way: str
    eigenvalues: np.ndarray | None
    reason: str = ""


def error(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest error of eigenvalues / the largest exact one, paired for the least sum of errors.

    More eigenvalues than exact ones, as of soft constraints, are left out. The error is infinite for fewer,
    and where one is not finite.
    """
    if len(found) < len(exact) or not np.isfinite(found).all():
        return float("inf")
    gaps = np.abs(np.asarray(found)[:, None] - np.asarray(exact)[None])
    pairs = linear_sum_assignment(gaps)
    return float(gaps[pairs].max(initial=0.0) / (np.abs(exact).max(initial=0.0) or 1.0))


def of_engine(engine: Engine, scene: Scene, steady: Steady) -> Iterator[Result]:
    """Yield the results of an engine about a steady pose: its own linearisation, then its accelerations."""
    there = at_pose(steady.balance, steady.state)
    refusal = engine.cannot(there)
    if refusal is not None:
        yield Result(engine.name, engine.version(), "", None, refusal.reason)
        return
    if isinstance(engine, Linearising) and not steady.balance.motion.rate:
        own = engine.own_eigenvalues(there).astype(complex)
        yield Result(engine.name, engine.version(), engine.linearises_by, ordered(own))
    yield by_accelerations(engine, steady)


def by_accelerations(engine: Engine, steady: Steady) -> Result:
    """Return the eigenvalues by central differences of the engine's accelerations at displaced states.

    With u = Nᵀ δq the motion is u'' = A u + B u' to first order.
    """
    source = (engine.name, engine.version(), ACCELERATIONS)
    settings = engine.best_settings(steady.balance.scene)
    if not settings:
        return Result(*source, None, "no setting serves the mechanism")
    run = _Accelerations(engine, settings[-1], steady)
    freedoms = steady.small.basis.shape[1]
    try:
        by_place = [run.derivative(direction, 0 * direction) for direction in np.eye(freedoms)]
        by_rate = [run.derivative(0 * direction, direction) for direction in np.eye(freedoms)]
    except ValueError as reason:
        return Result(*source, None, str(reason))
    lower = np.hstack([np.transpose(by_place), np.transpose(by_rate)])
    matrix = np.vstack([np.eye(freedoms, 2 * freedoms, freedoms), lower])
    return Result(*source, ordered(np.linalg.eigvals(matrix).astype(complex)))


class _Accelerations:
    """Accelerations of an engine in the judge's coordinates of small motions."""

    def __init__(self, engine: Engine, setting: object, steady: Steady):
        self.engine, self.setting, self.increment = engine, setting, H * steady.small.step / STEP
        self.balance, self.state = in_doubles(steady.balance), doubles(steady.state)
        basis = steady.small.basis
        self.basis = basis / np.linalg.norm(basis / self.balance.sizes[:, None], axis=0)
        self.back = np.linalg.pinv(self.basis / self.balance.sizes[:, None]) / self.balance.sizes

    def derivative(self, place: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return the derivative (f,) of u'' along a displacement and a rate (f,)."""
        h = self.increment
        parts = [
            w * (self._at(k * h * place, k * h * rate) - self._at(-k * h * place, -k * h * rate))
            for k, w in CENTRAL
        ]
        return np.asarray(np.sum(parts, axis=0) / h)

    def _at(self, place: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Return u'' (f,) at a displaced state. Raises ValueError if the engine reports no accelerations."""
        balance, begin = self.balance, self.balance.equations.ends[2]
        rates = self.state[begin:] + self.basis @ rate
        y = balance.closed(balance.moved(self.state, (self.basis @ place)[None])[0])
        y[begin:] = rates
        for _ in range(2):
            y[begin:] = balance.equations.nearer(balance.now, y[None])[0, begin:]
        scene = at_pose(balance, y)
        run = self.engine.run(scene, gate_times(scene), self.setting)  # type: ignore[arg-type]
        return np.asarray(self.back @ _joint_accelerations(balance, y, run))


def _joint_accelerations(balance: Balance, y: np.ndarray, run: Trajectory) -> np.ndarray:
    """Return the accelerations (nv,) of joint coordinates that a run has at its first sample."""
    if run.acceleration is None or run.angular_acceleration is None or not len(run.times):
        raise ValueError(run.message or "reports no accelerations")
    placed = balance.at(y[None]).placed
    drift = np.hstack([placed.drift[0, :-1], placed.spin_drift[0, :-1]])
    theirs = np.hstack([run.acceleration[0], run.angular_acceleration[0]])
    columns = np.swapaxes(placed.columns[0, :-1], 1, 2).reshape(-1, balance.equations.nv)
    found: np.ndarray = np.linalg.lstsq(columns, (theirs - drift).ravel(), rcond=None)[0]
    return found


def at_pose(balance: Balance, y: np.ndarray) -> Scene:
    """Return the scene with its bodies at a state of the judge's equations."""
    at = balance.at(y[None])
    twists = np.hstack([doubles(at.placed.velocity[0, :-1]), doubles(at.placed.spin[0, :-1])])
    values = doubles(at.coordinates.value[0])
    acting = zip(balance.equations.loads.along, balance.equations.loads.acting, strict=True)
    coordinates = {(load.coordinate, load.joint): float(values[k]) for load, k in acting}
    return posed(balance.scene, *balance.poses(y), twists, coordinates)


def distance(scene: Scene, steady: Steady, position: np.ndarray, orientation: np.ndarray) -> float:
    """Return the largest distance (lengths of the mechanism, or rad) of a body from the judge's pose."""
    moved = float(np.abs(position - steady.position).max()) / scene_length(scene)
    return max(moved, float(rotations.angle_between(orientation, steady.orientation).max()))
