"""The limit: the cost of a mechanism whose one equation of motion is derived by hand.

Free scenes: the equation of ``by_hand``, compiled, by mbref's own DOP853 and step control at the tolerances
of mbref.  For driven scenes the limit is the cost of their poses in closed form at the sample times, which a
perfect method must compute at least.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from by_hand import AS_MBREF, BY_HAND
from numba import njit

from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.engines.mbref import TOLERANCES
from crosscheck.judge.truth import PATHS
from crosscheck.judge.truth.one_dof import Path, initial_rate
from mbref import __version__, rotations
from mbref.integrators import INTEGRATORS
from mbref.integrators.dop853 import STAGES, Stages
from mbref.kernels.layout import OK, Clock, Control, OperationCounts
from mbref.kernels.named_memory import Address, Vector, allocate, packed
from mbref.kernels.records import record
from mbref.linear_algebra.vectors import copy
from mbref.motions.trajectory import Cost, Outcome, Trajectory
from mbref.scene import Scene

REPEATS = 100  # within one reading of the clock: one run is a matter of microseconds
STEPS, REJECTED, EVALUATIONS = range(3)


class Stepping(NamedTuple):
    """Numbers of the stepping loop that the integrator reads: the last steps, and the factor 1 on the
    tolerance."""

    clock: Clock


class Counting(NamedTuple):
    """Counts that the step control reads."""

    counts: OperationCounts


class Counted(NamedTuple):
    """The system, of which the step control reads the counts."""

    system: Counting


class OneDegreeOfFreedom(NamedTuple):
    """Memory of the equation and of the integrator."""

    equations: Counted
    control: Control
    loop: Stepping
    integrator: Address
    numbers: Annotated[Vector, "numbers"]
    y: Annotated[Vector, 2]
    rate: Annotated[Vector, 2]
    new: Annotated[Vector, 2]


@functools.cache
def compiled(rates: Callable) -> Callable:
    """Return ``repeat`` for an equation: mbref's DOP853 and step control, compiled together with the
    equation."""
    integrator = INTEGRATORS["dop853"]
    step, propose = (njit(**AS_MBREF)(kernel.function) for kernel in (integrator.step, integrator.propose))

    @njit(**AS_MBREF)
    def integrate(times, samples, start, memory, counts):
        """From sample to sample: y(t) into the rows of ``samples``."""
        y, rate, new, clock = memory.y, memory.rate, memory.new, memory.loop.clock
        taken = memory.equations.system.counts
        copy(start, y)
        taken.steps = 0
        t, h, suggested, ratio = 0.0, 0.0, 0.0, 0.0
        for k in range(times.shape[0]):
            while t < times[k]:
                rates(t, y, rate, memory)
                counts[EVALUATIONS] += 1
                suggested = propose(h, suggested, ratio, y, rate, memory)
                while True:
                    left = times[k] - t
                    h = left if suggested * (1.0 + 1e-9) >= left else min(suggested, 0.5 * left)
                    ratio = step(rates, t, h, y, rate, new, memory)
                    counts[EVALUATIONS] += STAGES - 1
                    if not ratio >= 0.0 or h < 1e-14 * times[-1]:
                        return -1
                    if ratio <= 1.0:
                        break
                    counts[REJECTED] += 1
                    suggested = propose(h, suggested, ratio, y, rate, memory)
                counts[STEPS] += 1
                taken.steps += 1
                clock.past_length, clock.past_ratio = clock.length, clock.ratio
                clock.length, clock.ratio = h, ratio
                copy(new, y)
                t = times[k] if h == left else t + h
            copy(y, samples[k])
        return OK

    @njit(**AS_MBREF)
    def repeat(times, samples, start, memory, counts):
        """Several times: one run is too short for one reading of the clock."""
        status = OK
        for _ in range(REPEATS):
            counts[:] = 0.0
            status = integrate(times, samples, start, memory, counts)
        return status

    return repeat


class Limit(Engine):
    """The hand-derived equation of a built-in scene."""

    name = "limit"
    package = "mbref"

    def version(self) -> str:
        return __version__

    def cannot(self, scene: Scene) -> Cannot | None:
        return (
            None
            if scene.name in BY_HAND
            else Cannot(Owner.ADAPTER, "its equation has not been derived by hand")
        )

    def settings(self, scene: Scene) -> Sequence[Setting]:
        if scene.driver:
            return [Setting("closed form", {})]
        return [Setting("equation", {"rtol": rtol}) for rtol in TOLERANCES]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        path = next(path for family in PATHS if (path := family(scene)))
        arm = np.subtract(scene.joint[1].anchor, scene.joint[0].anchor)
        theta0 = float(np.arctan2(-arm[2] if path.axis[1] else arm[1], arm[0]))
        if scene.driver:
            speed = scene.driver[0].polynomial[1]
            motion = np.column_stack([speed * times, np.full_like(times, speed)])
            cost = _closed_form(scene, theta0 + motion[:, 0], path)
        else:
            motion, cost = _integrated(scene, theta0, times, setting.options["rtol"], path)
            motion = motion - [theta0, 0.0]
        return _trajectory(scene, path, times, motion, setting, cost)


def _integrated(
    scene: Scene, theta0: float, times: np.ndarray, rtol: float, path: Path
) -> tuple[np.ndarray, Cost]:
    """(k, 2) angle and rate at the times, and the cost of the stepping."""
    by_hand, integrator = BY_HAND[scene.name], INTEGRATORS["dop853"]
    given = {
        "order": integrator.order,
        "largest_step": times[-1],
        "rtol": rtol,
        "atol": rtol,
        "closed_loops": 1.0,
    }
    control = Control(**dict.fromkeys(Control._fields, 0.0) | given)  # without any other limit
    numbers = np.array(by_hand.numbers(scene))
    memory = packed(
        allocate(
            OneDegreeOfFreedom,
            {},
            control=record(control),
            loop=allocate(Stepping, {}),
            numbers=numbers,
            equations=allocate(Counted, {}),
            integrator=packed(allocate(Stages, {"nb": 1})),
        )
    )
    start, samples, counts = (
        np.array([theta0, initial_rate(scene, path)]),
        np.zeros((len(times), 2)),
        np.zeros(3),
    )
    arguments = times, samples, start, memory.argument, counts
    repeat = compiled(by_hand.equation)
    repeat(*arguments)
    began = time.process_time()
    status = repeat(*arguments)
    seconds = (time.process_time() - began) / REPEATS
    if status != OK:
        raise ArithmeticError(f"{scene.name}: the hand-derived equation could not be integrated at {rtol:g}")
    return samples, Cost(seconds, 0.0, *(int(count) for count in counts))


def _closed_form(scene: Scene, thetas: np.ndarray, path: Path) -> Cost:
    """Return the cost of the poses, which are first compared with the path of the truth."""
    by_hand = BY_HAND[scene.name]
    numbers, poses = np.array(by_hand.numbers(scene)), np.zeros((len(thetas), 12 * len(scene.body)))
    by_hand.poses(thetas, numbers, poses)
    exact, found = path.poses(thetas - thetas[0]), poses.reshape(len(thetas), -1, 12)
    rotation = found[..., 3:].reshape(*found.shape[:2], 3, 3)
    off = max(np.abs(found[..., :3] - exact.position).max(), np.abs(rotation - exact.rotation).max())
    if not off < 1e-12:
        raise ArithmeticError(f"{scene.name}: the closed form is off by {float(off):.1e}")
    began = time.process_time()
    for _ in range(REPEATS):
        by_hand.poses(thetas, numbers, poses)
    return Cost((time.process_time() - began) / REPEATS, 0.0, len(thetas))


def _trajectory(
    scene: Scene, path: Path, times: np.ndarray, motion: np.ndarray, setting: Setting, cost: Cost
) -> Trajectory:
    """The bodies along the path at coordinates and rates ``motion`` (k, 2)."""
    pose, rate = path.poses(motion[:, 0]), motion[:, 1, None, None]
    return Trajectory(
        scene.name,
        Limit.name,
        __version__,
        setting.family,
        dict(setting.options),
        times,
        tuple(body.name for body in scene.body),
        np.asarray(pose.position, dtype=float),
        rotations.from_matrix(pose.rotation),
        np.asarray(pose.dposition * rate, dtype=float),
        np.asarray(pose.spin * rate, dtype=float),
        outcome=Outcome.COMPLETED,
        t_end=float(times[-1]),
        cost=cost,
    )


LIMIT = Limit()
