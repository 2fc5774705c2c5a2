"""OndselSolver: kinematics and inverse dynamics of driven scenes, in the coordinates and joints of the paper.

Positions, velocities, accelerations and reactions follow from the drivers pose by pose, by Newton's method;
redundant constraints are removed by the solver.  The one option ``step`` (s) is the largest step from pose to
pose; the step decides which of several assemblies is found, not how accurate the assembly is.  Equally spaced
samples are computed in one analysis; where the spacing changes, a new analysis starts from the last pose.
With a cylindrical or planar joint between moving bodies OndselSolver's accelerations do not satisfy the
joint's own equations, by 1e-3 and 0.3 of their size; accelerations and reactions are then left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from crosscheck.engine import Cannot, Engine, Owner, Setting
from crosscheck.engines.ondsel.model import ACCURATE_ON_GROUND, SUPPORTS, Assembly, Table, is_reversed, table
from crosscheck.engines.shared.fixed_steps import simulated
from crosscheck.engines.shared.sampling import Counts, Failed, Sample, step_count
from crosscheck.judge.constraints import initial_poses, jacobian
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import GROUND, Distance, Joint, Scene

FAMILY = "kinematics"
FAMILIES = {FAMILY: "kinematics and inverse dynamics of a driven mechanism, pose by pose"}
STEPS = (100, 400, 1600)  # numbers of steps over a scene's duration
BRYANT = ("Bryantx", "Bryanty", "Bryantz")
LOCKED = 1e-3  # cosine of the second angle below which the first and third angle lose digits
EVEN = 1e-9  # relative difference below which sample intervals count as equal


class Ondsel(Engine):
    """OndselSolver (PyPI ``pyondsel``)."""

    name = "ondsel"
    package = "pyondsel"
    modules = ("pyondsel.solve_raw",)
    supports = SUPPORTS
    families, options = FAMILIES, {"step": "largest step from pose to pose, s"}

    def cannot(self, scene: Scene) -> Cannot | None:
        """Refuse distance joints, which OndselSolver lacks, and then scenes that any engine may refuse."""
        if any(isinstance(joint, Distance) for joint in scene.joint):
            return Cannot(Owner.ENGINE, "OndselSolver does not implement its joint of constant distance")
        return super().cannot(scene)

    def refuses(self, scene: Scene) -> Cannot | None:
        """Refuse scenes whose motion is not prescribed completely: the solver offers no forward dynamics."""
        rows, _ = jacobian(scene, 0.0, *initial_poses(scene))
        if not scene.driver or np.linalg.matrix_rank(rows, rtol=RANK) < rows.shape[1]:
            reason = (
                "OndselSolver offers no forward dynamics, and the drivers do not prescribe the whole motion"
            )
            return Cannot(Owner.ENGINE, reason)
        return None

    def settings(self, scene: Scene) -> Sequence[Setting]:
        """Return settings by the number of steps over the scene's duration."""
        return [Setting(FAMILY, {"step": scene.duration / n}) for n in STEPS]

    def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Trajectory:
        """Simulate a scene; raises ValueError for an unknown family."""
        trajectory = simulated(
            self, scene, times, setting, lambda: _OndselSimulation(scene, times, setting.options["step"])
        )
        if any(joint.type in ACCURATE_ON_GROUND and GROUND not in joint.bodies for joint in scene.joint):
            return replace(trajectory, acceleration=None, angular_acceleration=None, reactions=None)
        return trajectory


class _OndselSimulation:
    """One simulation: the samples computed so far, and the pose at which the next analysis starts."""

    def __init__(self, scene: Scene, times: np.ndarray, step: float):
        from pyondsel.solve_raw import solve_asmt_raw

        self.solve, self.scene, self.step = solve_asmt_raw, scene, step
        self.times = np.array(times, dtype=float)
        self.assemblies = [Assembly(scene), Assembly(scene, tilted=True)]
        self.counts = Counts()
        self.samples: dict[float, Sample] = {}
        self.pose = initial_poses(scene)
        self.hindered = False  # True after a failed analysis; then each sample is computed alone

    def advance(self, t0: float, t1: float) -> None:
        """Compute the sample at t1, and later samples with equal spacing; raises Failed."""
        if t1 in self.samples:
            return
        later = self.times[self.times >= t1]
        even = abs(np.diff(later, prepend=t0) - (t1 - t0)) <= EVEN * (t1 - t0)
        many = later[: int(np.argmin(even)) if not even.all() else len(later)]
        if self.hindered:
            many = many[:1]
        try:
            self._analyse(t0, many)
        except Failed:
            if len(many) == 1:
                raise
            self.hindered = True
            self._analyse(t0, many[:1])

    def _analyse(self, t0: float, targets: np.ndarray, keep_start: bool = False) -> None:
        """Compute samples at ``targets``, equally spaced from t0, at which the pose is known."""
        each = step_count(t0, float(targets[0]), self.step)
        frames = each * len(targets)
        taken = [0] if keep_start else list(range(each, frames + 1, each))
        samples = self._samples(t0, float(targets[-1]), frames, taken)
        self.samples |= dict(zip([t0] if keep_start else map(float, targets), samples, strict=True))
        if not keep_start:
            self.pose = (samples[-1].position, samples[-1].orientation)

    def _samples(self, t0: float, t1: float, frames: int, taken: Sequence[int]) -> list[Sample]:
        """Return the frames ``taken`` of an analysis, in a world frame in which the solver's angles determine
        all orientations."""
        names = [f"b{k}" for k in range(len(self.scene.body))]
        for assembly in self.assemblies:
            text = assembly.text(t0, t1, frames, *self.pose)
            try:
                answer = table(self.solve(text), frames)
            except (RuntimeError, ValueError) as error:
                message = f"no pose after {t0:.6g} s: {error}"
                raise Failed(Outcome.NOT_CONVERGED, t0, message) from None
            self.counts.steps += frames
            middle = [answer.three(name, *BRYANT)[taken, 1] for name in names]
            if np.abs(np.cos(middle)).min() > LOCKED:
                return [_Reader(assembly, answer, frame).sample() for frame in taken]
        raise Failed(Outcome.NOT_FINITE, t0, f"angles after {t0:.6g} s do not determine the orientations")

    def sample(self, t: float) -> Sample:
        """Return the sample computed at t; at 0, the sample of the first step."""
        if t not in self.samples:
            self._analyse(t, np.array([t + self.step]), keep_start=True)
        return self.samples[float(t)]


class _Reader:
    """One frame of a result, in the scene's world."""

    def __init__(self, assembly: Assembly, answer: Table, frame: int):
        self.assembly, self.scene = assembly, assembly.scene
        self.answer, self.frame = answer, frame
        self.back = rotations.conjugate(assembly.world)

    def sample(self) -> Sample:
        """Return the bodies' motion and the joints' reactions."""
        turned = _bryant(self._raw(BRYANT))
        body = rotations.multiply(turned, rotations.conjugate(self.assembly.principal))
        position, orientation = self._vectors("X", "Y", "Z"), rotations.multiply(self.back, body)
        return Sample(
            position=position,
            orientation=orientation,
            velocity=self._vectors("VX", "VY", "VZ"),
            angular_velocity=self._vectors("OmegaX", "OmegaY", "OmegaZ"),
            acceleration=self._vectors("AX", "AY", "AZ"),
            angular_acceleration=self._vectors("AlphaX", "AlphaY", "AlphaZ"),
            reactions=self._reactions(position, orientation),
        )

    def _raw(self, labels: Sequence[str]) -> np.ndarray:
        names = [f"b{k}" for k in range(len(self.scene.body))]
        return np.array([self.answer.three(name, *labels)[self.frame] for name in names])

    def _vectors(self, *labels: str) -> np.ndarray:
        return rotations.rotate(self.back, self._raw(labels))

    def _reactions(self, position: np.ndarray, orientation: np.ndarray) -> dict[str, np.ndarray]:
        """Return force and moment (6,) on each joint's second body at the anchor on that body; the driver's
        force is included.

        The result is empty for a scene without masses, and for a scene with loads, which the solver does not
        receive.
        """
        if self.scene.load or not self.scene.has_mass():
            return {}
        found = {}
        for k, joint in enumerate(self.scene.joint):
            force, moment = (
                rotations.rotate(
                    self.back, sum(self.answer.three(f"{s}{k}", *three)[self.frame] for s in "jd")
                )
                for three in (("FXonI", "FYonI", "FZonI"), ("TXonI", "TYonI", "TZonI"))
            )
            first, second = self._anchors(joint, position, orientation)
            if is_reversed(joint):
                found[joint.name] = np.concatenate([force, moment])
            else:
                found[joint.name] = -np.concatenate([force, moment + np.cross(first - second, force)])
        return found

    def _anchors(self, joint: Joint, position: np.ndarray, orientation: np.ndarray) -> list[np.ndarray]:
        """Return the anchors (3,) of a joint on its two bodies, world."""
        places = []
        for name, point, _ in self.assembly.ends(joint):
            b = self.scene.body_index(name)
            principal = rotations.multiply(orientation[b], self.assembly.principal[b])
            places.append(point if name == GROUND else position[b] + rotations.rotate(principal, point))
        return places


def _bryant(angles: np.ndarray) -> np.ndarray:
    """Return quaternions (…, 4) of successive rotations (…, 3) about body-fixed x, y and z."""
    x, y, z = (rotations.from_vector(angles[..., n, None] * np.eye(3)[n]) for n in range(3))
    return rotations.multiply(rotations.multiply(x, y), z)


ENGINE = Ondsel()
