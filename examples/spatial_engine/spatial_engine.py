"""A complete engine in one file: spatial mechanisms, Lagrange multipliers, SciPy's Runge–Kutta of order 8.

Every body has its position and quaternion, velocity and angular velocity (world) as state; a joint is a
mate of two frames, one on each body, whose third axes lie along the joint's axis.
"""

import time
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.engine import Cannot, Engine, Owner, Setting, Supports
from crosscheck.judge.constraints import inertia_matrices, initial_twists
from mbref import Cost, Outcome, Trajectory, rotations
from mbref.rotations import cross

# axes of the first frame that displacement keeps off, and pairs of axes kept at right angles
ALL, HINGE = (0, 1, 2), ((0, 2), (1, 2))
RIGHT = ((0, 1), (1, 2), (2, 0))
HELD = {
    "fixed": ALL,
    "revolute": ALL,
    "universal": ALL,
    "spherical": ALL,
    "translational": (0, 1),
    "cylindrical": (0, 1),
    "planar": (2,),
    "distance": (),
}
SQUARE = {
    "fixed": RIGHT,
    "translational": RIGHT,
    "universal": ((2, 2),),
    "revolute": HINGE,
    "cylindrical": HINGE,
    "planar": HINGE,
}
LOADS = ("force", "moment", "spring", "torsion_spring")
UNMET = 1e-8  # residual of the joints' rows, relative; 3e-11 in regular positions
RANK = 1e-11  # pivots of redundant rows are rounding, 1e-15


class Spatial(Engine):
    """Maximal coordinates, accelerations and multipliers by least squares, no stabilisation."""

    name = "spatial"
    package = "spatial-engine"
    supports = Supports(tuple(HELD), ("angle", "displacement"), LOADS, massless_links=True)

    def version(self):
        return "0.1"

    def refuses(self, scene):
        if not scene.has_mass() or any(np.linalg.eigvalsh(i)[0] <= 0 for i in inertia_matrices(scene)):
            return Cannot(Owner.MODEL, "every body needs a mass and three moments of inertia")
        return None

    def settings(self, scene):
        return [Setting("dop853", {"rtol": r}) for r in (1e-5, 1e-7, 1e-9)]

    def run(self, scene, times, setting):
        model, began = Mechanism(scene), time.process_time()
        rtol, span = setting.options["rtol"], (0.0, float(times[-1]))
        start, holds = model.start, model.holds
        done = solve_ivp(model.rates, span, start, "DOP853", times, events=holds, rtol=rtol, atol=rtol)
        states = [model.unpack(y) for y in done.y.T]
        solved = [model.solve(t, state) for t, state in zip(done.t, states, strict=True)]
        cost = Cost(time.process_time() - began, steps=done.nfev // 12, rhs=done.nfev)
        place, turn, velocity, spin = (np.array(part)[:, :-1] for part in list(zip(*states, strict=True))[:4])
        rates = np.array([rate for rate, _ in solved])
        return Trajectory(
            scene.name,
            self.name,
            self.version(),
            setting.family,
            dict(setting.options),
            done.t,
            tuple(body.name for body in scene.body),
            place,
            rotations.from_matrix(turn),
            velocity,
            spin,
            rates[..., :3],
            rates[..., 3:],
            model.reactions(states, [push for _, push in solved]),
            Outcome.COMPLETED if done.status == 0 else Outcome.STEP_FAILED,
            float(done.t[-1]),
            done.message,
            cost,
        )


class State(NamedTuple):
    """World positions, rotations, velocities, spins, the ground's last; angles of torsion springs."""

    place: np.ndarray
    turn: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    angles: np.ndarray


class Mate(NamedTuple):
    """Two bodies, the frames' origins and axes (columns) on them, the kind and the driver."""

    bodies: tuple
    points: list
    frames: list
    kind: str
    driver: object


class Mechanism:
    """The equations of a scene."""

    def __init__(self, scene):
        self.scene, self.count = scene, len(scene.body)
        quaternions = np.array([body.orientation for body in scene.body])
        place = np.array([body.position for body in scene.body])
        self.start = np.concatenate(
            [place.ravel(), quaternions.ravel(), np.ravel(initial_twists(scene)), np.zeros(len(scene.load))]
        )
        self.first = self.unpack(self.start)
        self.mass, self.inertia = np.array([body.mass for body in scene.body]), inertia_matrices(scene)
        self.mates = {joint.name: self.mate(joint) for joint in scene.joint}
        self.ends = [self.attached(load) for load in scene.load]

    def local(self, name, point):
        b = self.scene.body_index(name)
        return b, (np.array(point) - self.first.place[b]) @ self.first.turn[b]

    def mate(self, joint):
        anchors = joint.anchors if joint.type == "distance" else (joint.anchor,) * 2
        axes = joint.axes if joint.type == "universal" else (getattr(joint, "axis", (0.0, 0.0, 1.0)),) * 2
        bodies, points = zip(*map(self.local, joint.bodies, anchors), strict=True)
        frames = [self.first.turn[b].T @ frame(axis) for b, axis in zip(bodies, axes, strict=True)]
        drivers = [driver for driver in self.scene.driver if driver.joint == joint.name]
        return Mate(bodies, points, frames, joint.type, drivers[0] if drivers else None)

    def attached(self, load):
        if load.type == "spring":
            return [self.local(*end) for end in zip(load.bodies, load.points, strict=True)]
        return [self.local(load.body, load.point)] if load.type == "force" else []

    def unpack(self, y):
        n = self.count
        place, quaternions = y[: 3 * n].reshape(n, 3), y[3 * n : 7 * n].reshape(n, 4)
        velocity, spin = y[7 * n : 13 * n].reshape(2, n, 3)
        turn = rotations.to_matrix(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
        moving = [np.concatenate([part, ORIGIN]) for part in (place, velocity, spin)]
        return State(moving[0], np.concatenate([turn, EYE]), *moving[1:], y[13 * n :])

    def rates(self, t, y):
        n, state = self.count, self.unpack(y)
        accelerations, _ = self.solve(t, state)
        spin = np.concatenate([np.zeros((n, 1)), state.spin[:n]], axis=1)
        turning = 0.5 * rotations.multiply(spin, y[3 * n : 7 * n].reshape(n, 4))
        twists = [self.about(x, state)[1] if x.type == "torsion_spring" else 0.0 for x in self.scene.load]
        parts = state.velocity[:n], turning, accelerations[:, :3], accelerations[:, 3:], twists
        return np.concatenate([np.ravel(part) for part in parts])

    def holds(self, t, y):
        """Falls below zero where no acceleration keeps the joints, as at a dead position of a driver."""
        self.solve(t, self.unpack(y))
        return UNMET - self.unmet

    holds.terminal = True

    def solve(self, t, state):
        """M a = f + J' push, J a = gamma: accelerations (n, 6) and pushes by joint."""
        n = self.count
        inverse, force = np.zeros((6 * n, 6 * n)), np.hstack(self.loads(state))
        for b in range(n):
            inverse[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = np.eye(3) / self.mass[b]
            inertia = state.turn[b] @ self.inertia[b] @ state.turn[b].T
            inverse[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = np.linalg.inv(inertia)
        free = inverse @ force.ravel()
        rows, gammas = [np.zeros((0, 6 * n))], [np.zeros(0)]
        for mate in self.mates.values():
            own, gamma = self.rows(mate, t, state)
            full = np.zeros((len(own), n + 1, 6))
            full[:, mate.bodies[0]], full[:, mate.bodies[1]] = own[:, :6], own[:, 6:]
            rows.append(full[:, :n].reshape(len(own), -1))
            gammas.append(gamma)
        jacobian, gamma = np.concatenate(rows), np.concatenate(gammas)
        flexible = jacobian @ inverse @ jacobian.T
        unit = 1 / np.sqrt(np.diag(flexible))  # rows of lengths and of angles, in any unit, count alike
        flexible, missing = flexible * unit * unit[:, None], unit * (gamma - jacobian @ free)
        push = np.linalg.lstsq(flexible, missing, rcond=RANK)[0] if len(gamma) else gamma
        self.unmet = np.abs(flexible @ push - missing).max(initial=0.0) / np.abs(missing).max(initial=1.0)
        push = unit * push
        ends = np.cumsum([len(gamma) for gamma in gammas[1:]])
        return (free + inverse @ jacobian.T @ push).reshape(n, 6), np.split(push, ends[:-1])

    def rows(self, mate, t, state):
        """Rows (m, 12) on the accelerations of both bodies, and what they must give (m,)."""
        place, turn, velocity, spin, _ = state
        (i, j), (a, b) = mate.bodies, [turn[k] @ p for k, p in zip(mate.bodies, mate.points, strict=True)]
        first, second = [(turn[k] @ f).T for k, f in zip(mate.bodies, mate.frames, strict=True)]
        wi, wj = spin[i], spin[j]
        apart = place[j] + b - place[i] - a
        parting = velocity[j] + cross(wj, b) - velocity[i] - cross(wi, a)
        coasting = cross(wj, cross(wj, b)) - cross(wi, cross(wi, a))
        if mate.kind == "distance":
            row = np.concatenate([-apart, -cross(a, apart), apart, cross(b, apart)])
            return row[None], np.array([-apart @ coasting - parting @ parting])
        slides = mate.kind == "translational"
        along = first[[*HELD[mate.kind], *([2] if mate.driver and slides else [])]]
        moved = cross(wi, along)
        rows = [np.hstack([-along, -cross(a + apart, along), along, cross(b, along)])]
        gammas = [-along @ coasting - 2 * moved @ parting - cross(wi, moved) @ apart]
        if mate.kind in SQUARE:
            ours, theirs = map(list, zip(*SQUARE[mate.kind], strict=True))
            u, w = first[ours], second[theirs]
            normal, zero = cross(u, w), np.zeros_like(u)
            rows.append(np.hstack([zero, normal, zero, -normal]))
            gammas.append(-(cross(cross(wi, u), w) + cross(u, cross(wj, w))) @ (wi - wj))
        if mate.driver and slides:
            gammas[0][-1] += driven(mate.driver, t)
        elif mate.driver:
            rows.append(np.concatenate([0 * wi, -first[2], 0 * wi, first[2]])[None])
            gammas.append([driven(mate.driver, t) - cross(wi, first[2]) @ (wj - wi)])
        return np.concatenate(rows), np.concatenate(gammas)

    def loads(self, state):
        """Forces and moments about the centres (n, 3), world, gravity and gyroscopic moments included."""
        n, (place, turn, velocity, spin, angles) = self.count, state
        force, moment = np.zeros((n + 1, 3)), np.zeros((n + 1, 3))
        force[:n] = self.mass[:, None] * np.array(self.scene.gravity)
        for b in range(n):
            moment[b] -= cross(spin[b], turn[b] @ self.inertia[b] @ turn[b].T @ spin[b])
        for load, ends, angle in zip(self.scene.load, self.ends, angles, strict=True):
            arms = [turn[b] @ point for b, point in ends]
            if load.type == "moment":
                moment[self.scene.body_index(load.body)] += load.moment
            elif load.type == "force":
                pulls = [np.array(load.force)]
            elif load.type == "torsion_spring":
                (i, j), (axis, rate) = self.mates[load.joint].bodies, self.about(load, state)
                resistance = load.stiffness * (angle - load.natural_angle) + load.damping * rate
                moment[i] += resistance * axis
                moment[j] -= resistance * axis
            else:
                (i, j), (a, b) = (end[0] for end in ends), arms
                apart = place[j] + b - place[i] - a
                length = np.linalg.norm(apart)
                rate = apart @ (velocity[j] + cross(spin[j], b) - velocity[i] - cross(spin[i], a)) / length
                pull = load.stiffness * (length - load.natural_length) + load.damping * rate
                pulls = [pull * apart / length, -pull * apart / length]
            for (b, _), arm, pull in zip(ends, arms, pulls if ends else (), strict=True):
                force[b] += pull
                moment[b] += cross(arm, pull)
        return force[:n], moment[:n]

    def about(self, load, state):
        """The axis (world) of a torsion spring and the rate of its angle."""
        i, j = self.mates[load.joint].bodies
        axis = state.turn[i] @ self.mates[load.joint].frames[0][:, 2]
        return axis, axis @ (state.spin[j] - state.spin[i])

    def reactions(self, states, pushes):
        """Force and moment (k, 6), world, on the second body of every joint at the anchor on it."""
        found = {name: np.zeros((len(states), 6)) for name in self.mates}
        for k, (state, push) in enumerate(zip(states, pushes, strict=True)):
            for (name, mate), own in zip(self.mates.items(), push, strict=bool(self.mates)):
                wrench = own @ self.rows(mate, 0.0, state)[0][:, 6:]
                arm = state.turn[mate.bodies[1]] @ mate.points[1]
                found[name][k] = np.concatenate([wrench[:3], wrench[3:] - cross(arm, wrench[:3])])
        return found


ORIGIN, EYE = np.zeros((1, 3)), np.eye(3)[None]


def frame(axis):
    """Rotation matrix whose third column is along an axis."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = cross(z, np.eye(3)[np.argmin(abs(z))])
    x = x / np.linalg.norm(x)
    return np.column_stack([x, cross(z, x), z])


def driven(driver, t):
    """Second derivative of a driver's value."""
    value, wave = np.polynomial.Polynomial(driver.polynomial).deriv(2)(t), driver.sine
    if wave:
        value -= wave.amplitude * wave.frequency**2 * np.sin(wave.frequency * t + wave.phase)
    return value


ENGINE = Spatial()
