"""End stops as limits of MuJoCo's joints, whose damping gives the restitution.

A limit with solref = (-ω², -2 ζ ω) accelerates its penetration r as r'' = -2 ζ ω r' - ω² r, while its force
pushes. A joint that meets it at a speed v leaves it after a time 2 θ / (ω sin θ) at the speed e v:

e = exp(-2 θ cot θ),   cos θ = ζ

For ζ > 1 the functions are hyperbolic, and e falls to 0 for infinite damping only.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.engines.mujoco.families import STIFFEST
from crosscheck.engines.mujoco.simulation import Simulation
from crosscheck.engines.shared.sampling import Sample, run_through, step_count
from crosscheck.engines.shared.switched import event_between
from mbref.motions.event import Event
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene, intermittent
from mbref.scene.joints import ANGLE

SERVED = "tuned"  # family whose regulariser is negligible, so that limits have their restitution
FINER = 0.1  # factor on its steps, as a contact lasts up to 32 of them, π / PER_STEP
PER_STEP = 0.1  # ω times the time step, in which RK4 has errors of the restitution near 1e-3
MOST_DAMPING = 5.0  # ζ, at which 2 ζ ω times the time step is 1
CRITICAL = 1e-6  # 1 - ζ, below which critical damping has its own formula


class _Limit(NamedTuple):
    """An end stop: its name, the numbers of its velocity and coordinate, its end (rad or m), and the sign of
    the coordinate minus the end in the range."""

    name: str
    velocity: int
    coordinate: int
    end: float
    sign: float

    def gap(self, qpos: np.ndarray) -> float:
        """Return the gap (rad or m) to the end, negative in a contact."""
        return self.sign * (float(qpos[self.coordinate]) - self.end)


def restitution(damping: float) -> float:
    """Return the restitution of a limit with a damping ratio ζ."""
    if abs(1.0 - damping) < CRITICAL:
        return float(np.exp(-2.0))
    if damping < 1.0:
        return float(np.exp(-2 * np.arccos(damping) * damping / np.sqrt(1 - damping**2)))
    return float(np.exp(-2 * np.arccosh(damping) * damping / np.sqrt(damping**2 - 1)))


def damping_ratio(wanted: float) -> float:
    """Return the damping ratio ζ of a limit with a restitution."""
    return float(brentq(lambda damping: restitution(damping) - wanted, 0.0, MOST_DAMPING))


def refusal(scene: Scene) -> Cannot | None:
    """Return the refusal of the first end stop that a limit of MuJoCo cannot be."""
    least = restitution(MOST_DAMPING)
    for joint in scene.joint:
        if joint.end_stop and joint.end_stop.restitution < least:
            what = f"joint {joint.name!r} has an end stop with a restitution below {least:.2g}"
            return Cannot(Owner.ENGINE, f"{what}; MuJoCo's limits rebound more, at dampings that are stable")
    others = [path for path in intermittent(scene) if not path.endswith(".stop")]
    if others and any(joint.end_stop for joint in scene.joint):
        return Cannot(Owner.ADAPTER, f"{others[0]} is beside an end stop, and the adapter maps one of them")
    return None


def served(settings: Sequence[Setting]) -> list[Setting]:
    """Return the settings that serve scenes with end stops, with finer steps."""
    return [
        replace(each, options={**each.options, "step": FINER * each.options["step"]})
        for each in settings
        if each.family == SERVED
    ]


class StoppedRun:
    """A run of MuJoCo with limits, which records each contact as an event."""

    def __init__(self, scene: Scene, setting: Setting):
        self.scene, self.run = scene, Simulation(scene, setting)
        self._limits = list(self._set_limits())
        self._met: dict[str, tuple[float, Sample, float, dict[str, float]]] = {}  # before each contact: time,
        # state, energy and angles
        self._found: list[Event] = []

    def _set_limits(self) -> Iterator[_Limit]:
        """Set the softness of the limits, and yield them."""
        model, tree = self.run.model, self.run.compiled.tree
        for joint in self.scene.joint:
            stop = joint.end_stop
            if stop is None:
                continue
            velocity = tree.coordinate(self.scene, joint.name)
            number = int(model.dof_jntid[velocity])
            rate = PER_STEP / self.run.nominal
            damping = damping_ratio(stop.restitution)
            model.jnt_solref[number] = -(rate**2), -2 * damping * rate
            model.jnt_solimp[number] = STIFFEST
            for end, sign in (("lower", 1.0), ("upper", -1.0)):
                if (value := getattr(stop, end)) is not None:
                    place = int(model.jnt_qposadr[number])
                    yield _Limit(f"{joint.name}.{end}", velocity, place, value, sign)

    def trajectory(self, times: np.ndarray, start: float, labels: dict[str, Any]) -> Trajectory:
        """Return the run at sample times (k,); its construction began at ``start`` (s of CPU time).

        Each contact that ends is an event; its velocities are those before and after the contact.
        """
        built, run = time.process_time() - start, self.run
        whole = run_through(self.scene, times, self._advance, run.sample, run.counts, built, labels)
        return replace(whole, reactions=None, events=tuple(self._found))

    def _advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1 (s), step by step."""
        data = self.run.data
        steps = np.linspace(t0, t1, step_count(t0, t1, self.run.nominal) + 1).tolist()
        for begin, end in pairwise(steps):
            before = data.qpos.copy(), data.qvel.copy()
            self.run.advance(begin, end)
            for limit in self._limits:
                self._look(limit, begin, before)

    def _look(self, limit: _Limit, begin: float, before: tuple[np.ndarray, np.ndarray]) -> None:
        """Record the begin or the end of a contact in the last step, from its begin (s) and state."""
        data = self.run.data
        gap = limit.gap(data.qpos)
        if limit.name in self._met:
            if gap >= 0.0:
                self._found.append(self._event(limit, *self._met.pop(limit.name)))
        elif gap < 0.0:
            now = data.qpos.copy(), data.qvel.copy()
            data.qpos[:], data.qvel[:] = before
            closing = -limit.sign * float(data.qvel[limit.velocity])
            met = begin + max(limit.gap(data.qpos), 0.0) / closing if closing > 0.0 else begin
            self._met[limit.name] = met, self.run.sample(begin), self._energy(), self._angles()
            data.qpos[:], data.qvel[:] = now

    def _event(
        self, limit: _Limit, met: float, before: Sample, energy: float, angles: dict[str, float]
    ) -> Event:
        """Return the event of a contact that ends now and was met at a time (s) in the state ``before``."""
        after = self.run.sample(float(self.run.data.time))
        energies = energy, self._energy()
        return event_between(met, before, after, energies, angles=angles, stops=(limit.name,))

    def _angles(self) -> dict[str, float]:
        """Return the angles (rad) of the joints with stops, which MuJoCo counts with full turns."""
        turning = [j.name for j in self.scene.joint if j.end_stop and j.facts.driven == ANGLE]
        qpos = self.run.data.qpos
        return {
            limit.name.rpartition(".")[0]: float(qpos[limit.coordinate])
            for limit in self._limits
            if limit.name.rpartition(".")[0] in turning
        }

    def _energy(self) -> float:
        """Return the kinetic energy, J."""
        model, data = self.run.model, self.run.data
        mass = np.zeros((model.nv, model.nv))
        self.run.mujoco.mj_fullM(model, data, mass)
        return float(data.qvel @ mass @ data.qvel) / 2
