"""One run of IDA on a scene's equations: selection of rows, start and restart, stepping, and samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import qr

from crosscheck.engines.shared.constraint_equations import Frames
from crosscheck.engines.shared.driver_motion import stated_rate
from crosscheck.engines.shared.sampling import Counts, Failed, Sample
from crosscheck.engines.sundials.equations import Equations, pure
from crosscheck.judge.constraints import initial_poses, initial_twists, scene_length
from crosscheck.judge.tolerances import RANK
from mbref import rotations
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene

INCREMENT = 1e-7  # increment of difference quotients / scale of the component
WORSE = 1e-2  # replace the chosen rows if their least pivot falls below this fraction of the best choice's
# fraction of the length, or rad: a row that was left out and is violated by a larger residual was not
# redundant
LOST = 1e-2
LOOSE = 1e2  # tolerance of ∫μ / its scale; large, because ∫μ is not used and would limit the steps
LEAST_STEP = 1e-12  # shortest step / duration
MAX_STEPS = 10**6
ENDINGS = {  # IDA's return flags → sentence
    -1: Outcome.STEP_FAILED,
    -3: Outcome.STEP_FAILED,
    -4: Outcome.NOT_CONVERGED,
    -5: Outcome.SINGULAR_MATRIX,
    -6: Outcome.SINGULAR_MATRIX,
    -7: Outcome.SINGULAR_MATRIX,
}


class Run:
    """One simulation; ``ida`` is the class of the solver, ``linear`` the name of its linear solver."""

    def __init__(self, ida: Any, scene: Scene, rtol: float, linear: str = "dense"):
        self.ida, self.scene, self.rtol, self.linear = ida, scene, rtol, linear
        self.equations = Equations(scene)
        self.length = scene_length(scene)
        self.counts = Counts()
        self.rank = 0
        self.y = self._start()
        self._choose(0.0)
        self._initialise(0.0)

    def _start(self) -> np.ndarray:
        """Set the poses and velocities of the scene, with zero multipliers."""
        r, p = initial_poses(self.scene)
        v, w = initial_twists(self.scene)
        twist = np.hstack([v, rotations.rotate(rotations.conjugate(p), w)])
        return np.concatenate([r.ravel(), p.ravel(), twist.ravel(), np.zeros(self.equations.springs)])

    def _choose(self, t: float) -> bool:
        """Choose better rows than the present rows; returns whether the choice changed.

        The number of rows is the rank at the start, because redundant rows seem independent if the pose does
        not satisfy the joints exactly.
        """
        e = self.equations
        scale = np.tile(np.repeat([1.0, 1 / self.length], 3), e.nb)
        j = e.constraints.jacobian(t, e.state(self.y).frames()) * scale
        if not len(j):
            return False
        size = np.linalg.norm(j, axis=1, keepdims=True)
        j = j / size
        pivots, order = _pivots(j)
        self.rank = self.rank or int(np.sum(pivots > RANK * pivots[0]))
        last = self.rank - 1
        if len(e.rows) == self.rank and _pivots(j[e.rows])[0][last] > WORSE * pivots[last]:
            return False
        e.rows = np.sort(order[: self.rank])
        return True

    def _initialise(self, t: float) -> None:
        """Start or restart IDA near the present motion, with consistent accelerations and multipliers."""
        e = self.equations
        start = e.projected(t, self.y)
        s = e.state(start)
        acceleration, multipliers = e.accelerations(t, s)
        m = len(e.rows)
        turned = rotations.multiply(s.p, pure(s.omega)) / 2
        yp = np.concatenate(
            [
                s.v.ravel(),
                turned.ravel(),
                acceleration,
                e.forces.turning(s.frames()),
                multipliers,
                np.zeros(m),
            ]
        )
        self.y = np.concatenate([start, np.zeros(2 * m)])
        scale = self._scale(multipliers)
        width = len(self.y) - 1 if self.linear == "band" else None
        self.steps = INCREMENT * scale[: e.motion]
        self.solver = self.ida(
            self._residual,
            jacfn=self._matrix,
            linsolver=self.linear,
            lband=width,
            uband=width,
            rtol=self.rtol,
            atol=self.rtol * scale,
            max_num_steps=MAX_STEPS,
            max_step=self.scene.duration,
            min_step=LEAST_STEP * self.scene.duration,
        )
        self.solver.init_step(t, self.y, yp)
        self.evaluated = 0

    def _scale(self, multipliers: np.ndarray) -> np.ndarray:
        """Return the sizes (size,) of the components: absolute tolerances are ``rtol`` times the sizes."""
        e, rate = self.equations, stated_rate(self.scene)
        force = max(np.abs(multipliers).max(initial=0.0), np.abs(e.forces.mass).max() * rate**2 * self.length)
        twist = np.repeat([self.length * rate, rate], 3)
        parts = [
            np.full(3 * e.nb, self.length),
            np.ones(4 * e.nb),
            np.tile(twist, e.nb),
            np.ones(e.springs),
            np.full(len(e.rows), force / rate),
            np.full(len(e.rows), LOOSE * self.length),
        ]
        return np.concatenate(parts)

    def _residual(self, t: float, y: np.ndarray, yp: np.ndarray, res: np.ndarray) -> None:
        res[:] = self.equations.residual(t, y, yp)

    def _matrix(
        self, t: float, y: np.ndarray, yp: np.ndarray, res: np.ndarray, cj: float, out: np.ndarray
    ) -> None:
        steps = np.maximum(self.steps, INCREMENT * np.abs(y[: self.equations.motion]))
        out[:] = self.equations.matrix(t, y, yp, cj, steps)

    def advance(self, t0: float, t1: float) -> None:
        """Move the state from t0 to t1; raises Failed."""
        reached = t0
        while reached < t1:
            result = self.solver.step(t1, method="onestep")
            self._check(result)
            self.counts.steps += 1
            reached = float(result.t)
        if reached > t1:
            result = self.solver.step(t1)
            self._check(result)
        self.counts.rhs += result.nfev - self.evaluated
        self.evaluated = result.nfev
        self.y = np.array(result.y)
        self._nothing_lost(t1)
        if self._choose(t1):
            self._initialise(t1)

    def _check(self, result: Any) -> None:
        if not result.success:
            outcome = ENDINGS.get(result.status, Outcome.STEP_FAILED)
            raise Failed(outcome, float(result.t), f"IDA at {float(result.t):.6g} s: {result.message}")

    def _nothing_lost(self, t: float) -> None:
        e = self.equations
        phi = np.abs(e.constraints.levels(t, e.state(self.y).frames())[0])
        if phi.max(initial=0.0) > LOST * max(1.0, self.length):
            name = self.scene.joint[e.constraints.joint[int(phi.argmax())]].name
            raise Failed(Outcome.VIOLATION, t, f"joint {name!r} is off by {phi.max():.3g} at {t:.6g} s")

    def sample(self, t: float) -> Sample:
        """Return poses, velocities, accelerations and reactions."""
        e = self.equations
        s = e.state(self.y)
        f = s.frames()
        a = f.a[: e.nb]
        acceleration, multipliers = e.accelerations(t, s)
        rates = acceleration.reshape(-1, 6)
        return Sample(
            position=s.r,
            orientation=s.p / np.linalg.norm(s.p, axis=1, keepdims=True),
            velocity=s.v,
            angular_velocity=(a @ s.omega[..., None])[..., 0],
            acceleration=rates[:, :3],
            angular_acceleration=(a @ rates[:, 3:, None])[..., 0],
            reactions=self._reactions(t, f, multipliers) if self.scene.has_mass() else {},
        )

    def _reactions(self, t: float, f: Frames, multipliers: np.ndarray) -> dict[str, np.ndarray]:
        """Return force and moment (6,) on each joint's second body at the anchor on it, world axes.

        Rows that are left out transmit no force.
        """
        e, c = self.equations, self.equations.constraints
        forces = np.zeros(len(c.joint))
        forces[e.rows] = multipliers
        blocks = c.jacobian(t, f).reshape(-1, e.nb, 6) * forces[:, None, None]
        found = {}
        for k, joint in enumerate(self.scene.joint):
            first, second = (self.scene.body_index(name) for name in joint.bodies)
            body, sign = (second, 1.0) if second >= 0 else (first, -1.0)
            wrench = sign * blocks[c.joint == k, body].sum(axis=0)
            anchor = self._anchor(f, k)
            moment = f.a[body] @ wrench[3:] + np.cross(f.r[body, :, 0] - anchor, wrench[:3])
            found[joint.name] = np.concatenate([wrench[:3], moment])
        return found

    def _anchor(self, f: Frames, k: int) -> np.ndarray:
        """Return joint k's anchor (3,) on its second body, world."""
        group, row = next(
            (g, int(np.flatnonzero(g.joint == k)[0]))
            for g in self.equations.constraints.groups
            if k in g.joint
        )
        body = group.j[row]
        return (f.r[body] + f.a[body] @ group.sj[row])[:, 0]


def _pivots(j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sizes of the pivots of a QR decomposition of rows (m, n), decreasing, and the order of the
    rows."""
    r, order = qr(j.T, mode="r", pivoting=True)
    return np.abs(np.diag(r)), order
