"""The truth of a scene of no known family: its reference, computed when poses are first asked for."""

from __future__ import annotations

from threading import Lock

import numpy as np

from crosscheck.judge.reference.reference import NoReference, Reference, reference
from crosscheck.judge.truth.picard import NoSolution
from mbref.scene import Scene
from mbref.trajectory import Trajectory

SAMPLES = 101  # samples over the duration, to state a truth's accuracy before poses are requested


class ReferenceTruth:
    """Truth of any scene, within so many CPU seconds; threads may ask at once."""

    name = "reference"

    def __init__(self, scene: Scene, seconds: float):
        self._scene, self._seconds, self._asked = scene, seconds, Lock()
        self._accuracy: float | None = None

    @property
    def accuracy(self) -> float:
        """The largest bound on the error of the poses given so far, or of the scene's whole duration; raises
        NoSolution when there is no reference."""
        if self._accuracy is None:
            self.poses(np.linspace(0.0, self._scene.duration, SAMPLES))
        return self._accuracy or 0.0

    def poses(self, times: np.ndarray) -> Trajectory:
        """Trajectory at times (k,) ≥ 0; raises NoSolution, with the reason and the time, where the reference
        ends before."""
        times = np.asarray(times, dtype=float)
        with self._asked:
            found = reference(self._scene, times.tolist(), self._seconds)
        if isinstance(found, NoReference):
            reason = f"no reference after t = {found.until:.6g} s: {found.reason}"
            raise NoSolution(reason, found.until)
        self._accuracy = max(self._accuracy or 0.0, float(found.bound.max(initial=0.0)))
        return trajectory(self._scene, found.at(times))


def trajectory(scene: Scene, samples: Reference) -> Trajectory:
    """A reference as a Trajectory of engine "truth"."""
    return Trajectory(
        scene=scene.name,
        engine="truth",
        version="",
        method="reference",
        settings={"bound": float(samples.bound.max(initial=0.0))},
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
