"""The stabilised equations of motion of a scene as a residual of index 1, and its iteration matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engines.shared.constraint_equations import Constraints, Frames, frames
from crosscheck.engines.shared.generalised_forces import Forces
from mbref import rotations
from mbref.scene import Scene

CORRECTIONS = 10  # Newton iterations for consistent poses
CLOSED = 1e-14  # m and rad; residual at which Newton's method ends


@dataclass(frozen=True)
class State:
    """Parts (…, ·) of a state: positions, Euler parameters, v and ω' by body, and torsion angles."""

    r: np.ndarray
    p: np.ndarray
    v: np.ndarray
    omega: np.ndarray
    angles: np.ndarray

    def frames(self) -> Frames:
        return frames(self.r, self.p, self.v, self.omega)


class Equations:
    """Residual F(t, y, y') of a scene with the constraint rows ``rows`` (m,).

    y contains r, p, V = (v, ω') and the angles of torsion springs, then the integrals of λ and of μ.
    """

    def __init__(self, scene: Scene):
        self.constraints, self.forces = Constraints(scene), Forces(scene)
        self.nb = len(scene.body)
        self.springs = len(self.forces.twists)
        self.rows = np.arange(len(self.constraints.joint))
        n = 13 * self.nb
        self.at_r, self.at_p = slice(0, 3 * self.nb), slice(3 * self.nb, 7 * self.nb)
        self.at_v, self.at_angles = slice(7 * self.nb, n), slice(n, n + self.springs)
        self.motion = n + self.springs  # number of components that are not multipliers

    @property
    def at_lambda(self) -> slice:
        return slice(self.motion, self.motion + len(self.rows))

    @property
    def at_mu(self) -> slice:
        return slice(self.motion + len(self.rows), self.size)

    @property
    def size(self) -> int:
        """Return the number of components of y."""
        return self.motion + 2 * len(self.rows)

    def state(self, y: np.ndarray) -> State:
        """Return the parts of y (…, size)."""
        lead = y.shape[:-1]
        twist = y[..., self.at_v].reshape(*lead, self.nb, 6)
        return State(
            y[..., self.at_r].reshape(*lead, self.nb, 3),
            y[..., self.at_p].reshape(*lead, self.nb, 4),
            twist[..., :3],
            twist[..., 3:],
            y[..., self.at_angles],
        )

    def residual(self, t: float, y: np.ndarray, yp: np.ndarray) -> np.ndarray:
        """Return F (…, size) at y (…, size) and y' (size,)."""
        s = self.state(y)
        f = s.frames()
        phi, rate, _ = self.constraints.levels(t, f)[..., self.rows]
        jacobian = self.constraints.jacobian(t, f)[..., self.rows, :]
        moved = (y[..., self.at_v] + yp[self.at_mu] @ jacobian).reshape(*s.r.shape[:-1], 6)
        turned = rotations.multiply(s.p, pure(moved[..., 3:])) / 2
        acting = self.forces(f, s.omega, s.angles) + yp[self.at_lambda] @ jacobian
        flat = (*y.shape[:-1], -1)
        return np.concatenate(
            [
                yp[self.at_r] - moved[..., :3].reshape(flat),
                yp[self.at_p] - turned.reshape(flat),
                self.forces.mass @ yp[self.at_v] - acting,
                yp[self.at_angles] - self.forces.turning(f),
                phi,
                rate,
            ],
            axis=-1,
        )

    def matrix(self, t: float, y: np.ndarray, yp: np.ndarray, cj: float, steps: np.ndarray) -> np.ndarray:
        """Return ∂F/∂y + cj ∂F/∂y' (size, size): difference quotients for the motion, exact entries for
        multipliers."""
        moved = np.repeat(y[None], self.motion + 1, axis=0)
        moved[np.arange(self.motion), np.arange(self.motion)] += steps
        values = self.residual(t, moved, yp)
        matrix = np.zeros((self.size, self.size))
        matrix[:, : self.motion] = ((values[:-1] - values[-1]) / steps[:, None]).T
        s = self.state(y)
        j = self.constraints.jacobian(t, s.frames())[self.rows]
        diagonal = np.arange(self.motion)
        by_rate = np.zeros_like(matrix)
        by_rate[diagonal, diagonal] = 1.0
        by_rate[self.at_v, self.at_v] = self.forces.mass
        by_rate[self.at_v, self.at_lambda] = -j.T
        twists = j.reshape(len(j), self.nb, 6)
        by_rate[self.at_r, self.at_mu] = -twists[..., :3].reshape(len(j), 3 * self.nb).T
        turned = rotations.multiply(s.p, pure(twists[..., 3:])) / 2
        by_rate[self.at_p, self.at_mu] = -turned.reshape(len(j), 4 * self.nb).T
        return matrix + cj * by_rate

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the motion (motion,) nearest to y with Φ = 0, by Newton's method, and Φ' = 0."""
        s = self.state(y)
        r, p = s.r, s.p / np.linalg.norm(s.p, axis=-1, keepdims=True)
        for _ in range(CORRECTIONS):
            f = frames(r, p, s.v, s.omega)
            phi, rate, _ = self.constraints.levels(t, f)[:, self.rows]
            jacobian = self.constraints.jacobian(t, f)[self.rows]
            if np.abs(phi).max(initial=0.0) < CLOSED:
                break
            step = -np.linalg.lstsq(jacobian, phi)[0].reshape(-1, 6)
            r, p = r + step[:, :3], rotations.multiply(p, rotations.from_vector(step[:, 3:]))
        twist = y[self.at_v] - np.linalg.lstsq(jacobian, rate)[0]
        return np.concatenate([r.ravel(), p.ravel(), twist, s.angles])

    def accelerations(self, t: float, s: State) -> tuple[np.ndarray, np.ndarray]:
        """Return V' (6 nb,) and λ (m,) at a state."""
        f = s.frames()
        j, gamma = self.constraints.jacobian(t, f)[self.rows], -self.constraints.levels(t, f)[2, self.rows]
        m = len(self.rows)
        matrix = np.block([[self.forces.mass, -j.T], [j, np.zeros((m, m))]])
        solved = np.linalg.solve(matrix, np.concatenate([self.forces(f, s.omega, s.angles), gamma]))
        return solved[: 6 * self.nb], solved[6 * self.nb :]


def pure(vector: np.ndarray) -> np.ndarray:
    """Return quaternions (…, 4) with zero real part."""
    return np.concatenate([np.zeros((*vector.shape[:-1], 1)), vector], axis=-1)
