"""The truth of a scene without a closed form: its reference, computed at the first request for poses."""

from __future__ import annotations

from threading import Lock

import numpy as np

from crosscheck.judge.reference.reference import NoReference, Reference, reference
from crosscheck.judge.truth.picard import NoSolution
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene

SAMPLES = 101  # samples over the duration from which the accuracy is computed before poses are requested


class ReferenceTruth:
    """Truth of any scene, computed within CPU seconds; several threads may call at once."""

    name = "reference"

    def __init__(self, scene: Scene, seconds: float):
        self._scene, self._seconds, self._asked = scene, seconds, Lock()
        self._accuracy: float | None = None

    @property
    def accuracy(self) -> float:
        """Largest bound on the error of the poses returned so far, or of the scene's whole duration.

        Raises NoSolution if the scene has no reference.
        """
        if self._accuracy is None:
            self.poses(np.linspace(0.0, self._scene.duration, SAMPLES))
        return self._accuracy or 0.0

    def poses(self, times: np.ndarray) -> Trajectory:
        """Return the trajectory at times (k,) ≥ 0; raises NoSolution, with reason and time, if the reference
        ends before the last time."""
        times = np.asarray(times, dtype=float)
        with self._asked:
            found = reference(self._scene, times.tolist(), self._seconds)
        if isinstance(found, NoReference):
            reason = f"no reference after t = {found.until:.6g} s: {found.reason}"
            raise NoSolution(reason, found.until)
        self._accuracy = max(self._accuracy or 0.0, float(found.bound.max(initial=0.0)))
        return trajectory(self._scene, found.at(times))


def trajectory(scene: Scene, samples: Reference) -> Trajectory:
    """Return a reference as a Trajectory of engine "truth"."""
    return Trajectory(
        scene=scene.name,
        engine="truth",
        version="",
        method="reference",
        settings={"bound": float(samples.bound.max(initial=0.0)), "events": samples.events.tolist()},
        times=samples.times,
        bodies=tuple(body.name for body in scene.body),
        position=samples.position,
        orientation=samples.orientation,
        velocity=samples.velocity,
        angular_velocity=samples.angular_velocity,
        acceleration=samples.acceleration,
        angular_acceleration=samples.angular_acceleration,
        t_end=float(samples.times.max(initial=0.0)),
    )
