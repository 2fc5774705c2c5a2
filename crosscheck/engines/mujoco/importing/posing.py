"""The pose at which a model is read: its reference, a keyframe or given coordinates, with closed loops."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.engines.mujoco.importing import keyframes
from crosscheck.engines.mujoco.importing.chains import kind_of
from crosscheck.engines.mujoco.importing.closures import Closure
from mbref.formats import quiet
from mbref.scene import SceneError

CLOSED = 1e-12  # fraction of the model's extent, or rad; smaller gaps count as closed
ROUNDED = 1e-9  # limit like CLOSED near singular positions, where Newton's method is less accurate
ITERATIONS = 200
LONGEST = 0.2  # rad, or fraction of the model's extent: largest change of a coordinate in one iteration
FALL = 0.1  # rad, or fraction of the model's extent: change of a coordinate that leaves a straight pose
RANK = 1e-9  # singular value / largest singular value; smaller values belong to redundant rows


@dataclass(frozen=True)
class JointRow:
    """A sum of joint coordinates that is constant: Σ factors[k] · q_k = offset, measured from the reference.

    The first factor is 1. ``joints`` are MuJoCo's numbers. ``higher`` are the factors of the square and of
    higher powers of the second coordinate in the sum.
    """

    name: str
    joints: tuple[int, ...]
    offset: float
    factors: tuple[float, ...]
    higher: tuple[float, ...] = ()

    @property
    def law(self) -> np.polynomial.Polynomial:
        """Polynomial of the second coordinate that the first one follows, without the offset."""
        return -np.polynomial.Polynomial([0.0, *self.factors[1:2], *self.higher])


class Poses:
    """Poses of a model with closed loops."""

    def __init__(
        self, mujoco: Any, model: Any, closures: Sequence[Closure], rows: Sequence[JointRow], extent: float
    ):
        self.mujoco, self.model, self.data = mujoco, model, mujoco.MjData(model)
        self.closures, self.joint_rows, self.extent = closures, rows, extent
        self.scale = _scale(mujoco, model, extent)
        self.held: list[int] = []  # indices of the velocities whose coordinates the user gives

    def start(self, keyframe: str, pose: Mapping[str, float]) -> None:
        """Set the start: a keyframe or the reference, with given joint coordinates; raises SceneError."""
        model, data = self.model, self.data
        data.qpos[:] = model.qpos0
        if (k := keyframes.number_of(self.mujoco, model, keyframe)) >= 0:
            data.qpos[:], data.qvel[:] = model.key_qpos[k], model.key_qvel[k]
        for name, value in pose.items():
            j = self._joint(name)
            if kind_of(self.mujoco, model, j) not in ("hinge", "slide"):
                raise SceneError([f"--pose {name}: has several coordinates; only hinges and slides have one"])
            data.qpos[model.jnt_qposadr[j]] = value
            self.held.append(int(model.jnt_dofadr[j]))
        self.place()

    def _joint(self, name: str) -> int:
        """Return the number of a joint; raises SceneError that lists the names."""
        kind = self.mujoco.mjtObj.mjOBJ_JOINT
        number = int(self.mujoco.mj_name2id(self.model, kind, name))
        if number < 0:
            known = [str(self.mujoco.mj_id2name(self.model, kind, k) or "") for k in range(self.model.njnt)]
            near = difflib.get_close_matches(name, known)
            meant = f"; did you mean {near[0]!r}?" if near else ""
            listed = ", ".join(filter(None, known)) or "none"
            raise SceneError([f"--pose: no joint {name!r}; known: {listed}{meant}"])
        return number

    def place(self) -> None:
        """Compute positions of bodies and joints at the data's coordinates."""
        self.mujoco.mj_kinematics(self.model, self.data)
        self.mujoco.mj_comPos(self.model, self.data)

    def gaps(self) -> dict[str, float]:
        """Return by how much (m or rad) every closure and coupled coordinate is open at the pose."""
        found = {c.name: c.opening(self.data) for c in self.closures}
        return found | {row.name: abs(self._residual(row)) for row in self.joint_rows}

    def close(self, say: Callable[[str], None] = quiet) -> None:
        """Move the coordinates until all loops are closed, by the least change weighted with the masses.

        Coordinates of ``--pose`` are unchanged if the loops allow it. If no small motion closes the loops, as
        for a straight chain, the pose is first moved in the direction in which the weight accelerates it.
        ``say`` receives a sentence before each further attempt, which may take seconds. Raises SceneError
        with the least gap of all poses that were tried.
        """
        start = self.data.qpos.copy()
        least: list[tuple[float, str]] = []
        held_ones: tuple[list[int], ...] = (self.held, [])
        attempts = [(held, falls) for held in held_ones for falls in (False, True)]
        for number, (held, falls) in enumerate(attempts, start=1):
            if least:
                gap, name = min(least)
                more = f"the least gap of {name!r} is {gap:.3g} m or rad"
                say(f"closing the loops, attempt {number} of {len(attempts)}: {more}")
            self.data.qpos[:] = start
            if falls:
                self.mujoco.mj_integratePos(self.model, self.data.qpos, self._fall(), 1.0)
            self.place()
            open_by = self._newton(held)
            if open_by is None:
                return
            least.append(open_by)
        gap, name = min(least)
        raise SceneError(
            [
                f"closure {name!r}: cannot be closed from this pose; the least gap found is {gap:.3g} m "
                "or rad; begin at another pose with --pose joint=value or --keyframe NAME"
            ]
        )

    def allowed(self, velocities: np.ndarray) -> np.ndarray:
        """Return the nearest joint velocities (nv,) that the closed loops allow."""
        rows, given = self.unit_free(self.jacobian()), velocities / self.scale
        change = np.linalg.pinv(rows, rcond=RANK) @ (rows @ given) if len(rows) else 0.0
        return np.asarray(self.scale * (given - change))

    def unit_free(self, rows: np.ndarray) -> np.ndarray:
        """Return the Jacobian (rows, nv) of the residuals with lengths as fractions of the model's extent."""
        return self._scaled(rows) * self.scale

    def _fall(self) -> np.ndarray:
        """Return the direction (nv,) of the accelerations from rest without closures, of size ``FALL``."""
        mujoco, model, fallen = self.mujoco, self.model, self.mujoco.MjData(self.model)
        fallen.qpos[:] = self.data.qpos
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_fwdVelocity):
            stage(model, fallen)
        force, mass = fallen.qfrc_passive - fallen.qfrc_bias, self.mass()
        weights = np.outer(self.scale, self.scale)
        found = np.linalg.lstsq(mass * weights, force * self.scale, rcond=RANK)[0]
        found[self.held] = 0.0
        size = np.abs(found).max()
        return self.scale * found * (FALL / size if size > 0 else 0.0)

    def _newton(self, held: list[int]) -> tuple[float, str] | None:
        """Close the loops by Newton's method; return None, or the least gap (m or rad) with its name."""
        least = []
        for _ in range(ITERATIONS):
            r, rows = self._scaled(self.residuals()), self.unit_free(self.jacobian())
            if not np.abs(r).max(initial=0.0) > CLOSED:
                return None
            least.append(self._widest())
            step = self._step(r, rows, held)
            size = np.abs(step).max()
            if not size > 0.0:
                break
            step *= self.scale * min(1.0, LONGEST / size)
            self.mujoco.mj_integratePos(self.model, self.data.qpos, step, 1.0)
            self.place()
        is_closed = np.abs(self._scaled(self.residuals())).max() <= ROUNDED
        return None if is_closed else min(*least, self._widest())

    def _widest(self) -> tuple[float, str]:
        return max((gap, name) for name, gap in self.gaps().items())

    def _scaled(self, rows: np.ndarray) -> np.ndarray:
        """Return residuals or their Jacobian with lengths as fractions of the model's extent."""
        lengths = [c.are_lengths for c in self.closures]
        of_rows = [self._is_slide(row.joints[0]) for row in self.joint_rows]
        are_lengths = np.concatenate([np.zeros(0, bool), *lengths, np.array(of_rows, bool)])
        return (rows.T / np.where(are_lengths, self.extent, 1.0)).T

    def _is_slide(self, joint: int) -> bool:
        return kind_of(self.mujoco, self.model, joint) == "slide"

    def _step(self, r: np.ndarray, rows: np.ndarray, held: list[int]) -> np.ndarray:
        """Return the least change (nv,), weighted with the masses, that closes the linearised loops.

        Lengths are fractions of the model's extent, in the arguments and in the result.
        """
        free = [k for k in range(self.model.nv) if k not in held]
        mass = (self.mass() * np.outer(self.scale, self.scale))[np.ix_(free, free)]
        root = np.linalg.cholesky(mass + 1e-9 * np.trace(mass) / self.model.nv * np.eye(len(free)))
        weighted = np.linalg.solve(root, rows[:, free].T).T
        step = np.zeros(self.model.nv)
        step[free] = np.linalg.solve(root.T, -np.linalg.pinv(weighted, rcond=RANK) @ r)
        return step

    def mass(self) -> np.ndarray:
        """Return MuJoCo's mass matrix (nv, nv) at the pose."""
        self.mujoco.mj_makeM(self.model, self.data)
        found = np.zeros((self.model.nv, self.model.nv))
        self.mujoco.mj_fullM(self.model, self.data, found)
        return found

    def residuals(self) -> np.ndarray:
        """Return the residuals of all closures and coupled coordinates, m and rad."""
        parts = [c.gap(self.data) for c in self.closures] + [[self._residual(r)] for r in self.joint_rows]
        return np.concatenate([np.zeros(0), *parts])

    def jacobian(self) -> np.ndarray:
        """Return the Jacobian (rows, nv) of the residuals."""
        found = [c.rows(self.mujoco, self.model, self.data) for c in self.closures]
        return np.vstack([np.zeros((0, self.model.nv)), *found, *map(self.joint_row, self.joint_rows)])

    def joint_row(self, row: JointRow) -> np.ndarray:
        """Return the Jacobian (1, nv) of coupled coordinates."""
        found = np.zeros((1, self.model.nv))
        for joint, factor in zip(row.joints, row.factors, strict=True):
            found[0, self.model.jnt_dofadr[joint]] += factor
        if row.higher:
            leader = row.joints[1]
            found[0, self.model.jnt_dofadr[leader]] = -row.law.deriv()(self.moved(leader))
        return found

    def _residual(self, row: JointRow) -> float:
        if row.higher:
            follower, leader = map(self.moved, row.joints)
            return follower - float(row.law(leader)) - row.offset
        return sum(f * self.moved(j) for j, f in zip(row.joints, row.factors, strict=True)) - row.offset

    def moved(self, joint: int) -> float:
        """Return the coordinate of a hinge or slide, measured from the reference."""
        address = self.model.jnt_qposadr[joint]
        return float(self.data.qpos[address] - self.model.qpos0[address])


def _scale(mujoco: Any, model: Any, extent: float) -> np.ndarray:
    """Return the size (nv,) of a large change of each coordinate: the model's extent of a displacement, 1 of
    an angle."""
    found = np.ones(model.nv)
    for j in range(model.njnt):
        first = int(model.jnt_dofadr[j])
        if (kind := kind_of(mujoco, model, j)) in ("slide", "free"):
            found[first : first + (3 if kind == "free" else 1)] = extent
    return found
