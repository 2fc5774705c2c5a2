"""Runs of engines through the events of joints and couplings with intervals, shared by adapters.

An adapter simulates the scene with the joints and couplings that always hold. It switches all others as
constraints of the engine, and changes the joint velocities where some begin to hold.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from crosscheck.engine import Cannot, Owner, Setting
from crosscheck.engines.shared.sampling import Counts, Sample, run_through
from crosscheck.judge.constraints import initial_twists
from crosscheck.judge.pieces import at_start, events, holds
from mbref.motions.event import Event
from mbref.motions.trajectory import Trajectory
from mbref.scene import Coupling, Joint, Scene, intermittent

TYPES = ("fixed", "spherical")  # joints that engines switch: constraints of a frame, or of a point


def refusal(scene: Scene, engine: str) -> Cannot | None:
    """Return the refusal of the first part with intervals that an engine cannot switch."""
    for joint in scene.joint:
        if joint.active is not None and joint.type not in TYPES:
            what = f"joint {joint.name!r} of type {joint.type!r} has intervals"
            return Cannot(Owner.ADAPTER, f"{what}; {engine} switches {' and '.join(TYPES)} joints")
    given = [part.name for part in sometimes(scene) if part.engages == "given_pose"]
    if given:
        return Cannot(
            Owner.ADAPTER, f"{given[0]!r} engages at a given pose, which the adapter does not check"
        )
    return None


def served(scene: Scene, settings: Sequence[Setting], families: Collection[str]) -> list[Setting]:
    """Return the settings that can run a scene: of these families only, where the scene has intervals."""
    return [each for each in settings if each.family in families or not any(intermittent(scene))]


def sometimes(scene: Scene) -> list[Joint | Coupling]:
    """Return the joints and couplings with intervals."""
    return [part for part in (*scene.joint, *scene.coupling) if part.active is not None]


def always(scene: Scene) -> Scene:
    """Return the scene with the joints and couplings that always hold, and the velocities of its start."""
    v, w = initial_twists(at_start(scene))
    bodies = [
        body.model_copy(update={"velocity": tuple(v[b].tolist()), "angular_velocity": tuple(w[b].tolist())})
        for b, body in enumerate(scene.body)
    ]
    return scene.with_(
        body=bodies,
        joint=[joint for joint in scene.joint if joint.active is None],
        coupling=[coupling for coupling in scene.coupling if coupling.active is None],
    )


def event_between(
    time: float,
    before: Sample,
    after: Sample,
    energies: tuple[float, float],
    *,
    engaged: tuple[str, ...] = (),
    released: tuple[str, ...] = (),
    angles: Mapping[str, float] = MappingProxyType({}),
    stops: tuple[str, ...] = (),
) -> Event:
    """Return the event of an engine that knows no impulses by joint, from its states before and after, with
    their kinetic energies (J)."""
    return Event(
        time=time,
        engaged=engaged,
        released=released,
        position=before.position,
        orientation=before.orientation,
        velocity=before.velocity,
        angular_velocity=before.angular_velocity,
        velocity_after=after.velocity,
        angular_velocity_after=after.angular_velocity,
        angles=dict(angles),
        impulses={},
        open={},
        energy_before=energies[0],
        energy_after=energies[1],
        stops=stops,
    )


class SwitchedRun(ABC):
    """A run whose constraints are switched at the events of its scene."""

    def __init__(self, scene: Scene):
        self.scene, self.parts = scene, sometimes(scene)
        self._found: list[Event] = []

    @abstractmethod
    def advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1 (s), between events."""

    @abstractmethod
    def sample(self, t: float) -> Sample:
        """Return the state of the bodies at t (s)."""

    @abstractmethod
    def switch(self, engaged: Sequence[Joint | Coupling], released: Sequence[Joint | Coupling]) -> None:
        """Let constraints hold the pose of this moment, and others cease to hold."""

    @abstractmethod
    def jump(self, t: float) -> None:
        """Change the joint velocities at t (s) such that they obey all constraints."""

    @abstractmethod
    def energy(self) -> float:
        """Return the kinetic energy, J."""

    def trajectory(
        self, times: np.ndarray, counts: Counts, start: float, labels: dict[str, Any]
    ) -> Trajectory:
        """Return the run at sample times (k,); its construction began at ``start`` (s of CPU time)."""
        built = time.process_time() - start
        whole = run_through(self.scene, times, self._through, self.sample, counts, built, labels)
        return replace(whole, reactions=None, events=tuple(self._found))

    def _through(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1 (s), through the events up to t1."""
        for event in events(self.scene, t1):
            if event > t0:
                self.advance(t0, event)
                self._pass(event)
                t0 = event
        if t0 < t1:
            self.advance(t0, t1)

    def _pass(self, t: float) -> None:
        """Switch the constraints of an event at t (s), and change the velocities."""
        before = self.sample(t)
        engaged = [p for p in self.parts if holds(p, t) and t in [first for first, _ in p.active or ()]]
        released = [p for p in self.parts if t in [last for _, last in p.active or ()]]
        self.switch(engaged, released)
        energy = self.energy()
        if engaged:
            self.jump(t)
        after = self.sample(t)
        self._found.append(
            event_between(
                t,
                before,
                after,
                (energy, self.energy()),
                engaged=tuple(part.name for part in engaged),
                released=tuple(part.name for part in released),
            )
        )
