"""Runs of MuJoCo through the intervals of joints and couplings: equalities that ``eq_active`` switches.

MuJoCo has no equations of impacts: a soft equality that becomes active pulls velocities together over time.
So the adapter changes the joint velocities at once, v⁺ = v⁻ - M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁺ (J v⁻ - ν), with the mass
matrix M of MuJoCo and the rows J of its active equalities.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.engines.mujoco.model import COUPLING, SWITCHED
from crosscheck.engines.mujoco.simulation import Simulation
from crosscheck.engines.shared.driver_motion import motion
from crosscheck.engines.shared.sampling import Sample, run_through
from crosscheck.judge.constraints import initial_twists
from crosscheck.judge.pieces import at_start, events, holds
from mbref import rotations
from mbref.motions.event import Event
from mbref.motions.trajectory import Trajectory
from mbref.scene import Coupling, Joint, Scene, intermittent

SERVED = ("defaults", "stock", "tuned", "stiff")  # families in fixed steps that serve scenes with intervals
TYPES = ("fixed", "spherical")  # joints that an equality of MuJoCo, weld or connect, can switch
RANK = 1e-9  # singular value / largest one below which a row of the equalities counts as redundant


def refusal(scene: Scene) -> Cannot | None:
    """Return the refusal of the first part with intervals that no equality of MuJoCo can switch."""
    for joint in scene.joint:
        if joint.active is not None and joint.type not in TYPES:
            what = f"joint {joint.name!r} of type {joint.type!r} has intervals"
            return Cannot(Owner.ADAPTER, f"{what}; MuJoCo switches {' and '.join(TYPES)} joints")
    given = [p.name for p in _sometimes(scene) if p.engages == "given_pose"]
    if given:
        return Cannot(
            Owner.ADAPTER, f"{given[0]!r} engages at a given pose, which the adapter does not check"
        )
    return None


def served(scene: Scene, settings: Sequence[Setting]) -> list[Setting]:
    """Return the settings that can run a scene: all of them without intervals."""
    return [each for each in settings if not any(intermittent(scene)) or each.family in SERVED]


def _sometimes(scene: Scene) -> list[Joint | Coupling]:
    """Return the joints and couplings with intervals."""
    return [part for part in (*scene.joint, *scene.coupling) if part.active is not None]


class SwitchedRun:
    """A run whose equalities are switched at the events of its scene."""

    def __init__(self, scene: Scene, setting: Setting):
        v, w = initial_twists(at_start(scene))
        bodies = [
            body.model_copy(update={"velocity": tuple(v[b]), "angular_velocity": tuple(w[b])})
            for b, body in enumerate(scene.body)
        ]
        always = scene.with_(
            body=bodies,
            joint=[joint for joint in scene.joint if joint.active is None],
            coupling=[coupling for coupling in scene.coupling if coupling.active is None],
        )
        self.scene, self.parts = scene, _sometimes(scene)
        self.run = Simulation(always, setting, self.parts)
        self.found: list[Event] = []

    def trajectory(self, times: np.ndarray, start: float, labels: dict[str, Any]) -> Trajectory:
        """Return the run at sample times (k,); its construction began at ``start`` (s of CPU time)."""
        built = time.process_time() - start
        with self.run.installed(), np.errstate(all="ignore"):
            whole = run_through(
                self.scene, times, self._advance, self.run.sample, self.run.counts, built, labels
            )
        return replace(whole, reactions=None, events=tuple(self.found))

    def _advance(self, t0: float, t1: float) -> None:
        """Move the data from t0 to t1 (s), through the events up to t1."""
        for event in events(self.scene, t1):
            if event > t0:
                self.run.advance(t0, event)
                self._switch(event)
                t0 = event
        if t0 < t1:
            self.run.advance(t0, t1)

    def _switch(self, t: float) -> None:
        """Activate and release the equalities of an event at t (s), and change the velocities."""
        run, before = self.run, self.run.sample(t)
        engaged = [p for p in self.parts if holds(p, t) and t in [first for first, _ in p.active or ()]]
        released = [p for p in self.parts if t in [last for _, last in p.active or ()]]
        for part in engaged:
            self._meet(part)
        for part in (*engaged, *released):
            run.data.eq_active[_equality(run, part)] = part in engaged
        run.mujoco.mj_forward(run.model, run.data)
        energy = self._energy()
        if engaged:
            self._jump(t)
        energies = energy, self._energy()
        self.found.append(_event(t, engaged, released, before, run.sample(t), energies))

    def _meet(self, part: Joint | Coupling) -> None:
        """Let an equality hold the pose of this moment."""
        model, data = self.run.model, self.run.data
        if isinstance(part, Coupling):
            equality = _equality(self.run, part)
            second, first = (
                data.qpos[model.jnt_qposadr[j]] - model.qpos0[model.jnt_qposadr[j]]
                for j in (model.eq_obj1id[equality], model.eq_obj2id[equality])
            )
            model.eq_data[equality, 0] = second - part.gear_ratio * first
            return
        one, other = (model.site(f"{SWITCHED}{part.name}.{i}").id for i in (0, 1))
        body = model.site_bodyid[other]
        axes = data.xmat[body].reshape(3, 3)
        model.site_pos[other] = axes.T @ (data.site_xpos[one] - data.xpos[body])
        model.site_quat[other] = rotations.from_matrix(axes.T @ data.site_xmat[one].reshape(3, 3))
        model.site_sameframe[other] = 0  # otherwise MuJoCo takes the frame of the body

    def _jump(self, t: float) -> None:
        """Change the joint velocities by the least change in the metric of M that the equalities demand."""
        run, data = self.run, self.run.data
        rows = data.efc_J.reshape(-1, run.model.nv)
        wanted = np.zeros(len(rows))
        for row, driver in run.driven():
            wanted[row] = motion(driver, t, t)[1]
        factor = np.linalg.cholesky(self._mass())
        scaled = np.linalg.solve(factor, rows.T)
        step = np.linalg.lstsq(scaled.T, wanted - rows @ data.qvel, rcond=RANK)[0]
        data.qvel[:] += np.linalg.solve(factor.T, step)

    def _mass(self) -> np.ndarray:
        mass = np.zeros((self.run.model.nv, self.run.model.nv))
        self.run.mujoco.mj_fullM(self.run.model, self.run.data, mass)
        return mass

    def _energy(self) -> float:
        """Return the kinetic energy, J."""
        rates = self.run.data.qvel
        return float(rates @ self._mass() @ rates) / 2


def _equality(run: Simulation, part: Joint | Coupling) -> int:
    """Return the number of a part's equality."""
    prefix = COUPLING if isinstance(part, Coupling) else SWITCHED
    return int(run.model.equality(prefix + part.name).id)


def _event(
    t: float,
    engaged: Sequence[Joint | Coupling],
    released: Sequence[Joint | Coupling],
    before: Sample,
    after: Sample,
    energies: tuple[float, float],
) -> Event:
    """Return an event, whose impulses are not known by joint."""
    return Event(
        time=t,
        engaged=tuple(part.name for part in engaged),
        released=tuple(part.name for part in released),
        position=before.position,
        orientation=before.orientation,
        velocity=before.velocity,
        angular_velocity=before.angular_velocity,
        velocity_after=after.velocity,
        angular_velocity_after=after.angular_velocity,
        angles={},
        impulses={},
        open={},
        energy_before=energies[0],
        energy_after=energies[1],
    )
