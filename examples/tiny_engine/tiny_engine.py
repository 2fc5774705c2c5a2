"""A complete engine in one short file: planar mechanisms of pins and slides, fixed steps of RK4."""

import time

import numpy as np

from crosscheck.engine import (
    GROUND,
    Cannot,
    Cost,
    Engine,
    Outcome,
    Owner,
    Setting,
    Supports,
    Trajectory,
    inertia_matrices,
    initial_twists,
    rotations,
)

PINS = ("revolute", "universal", "spherical")


class Tiny(Engine):
    """Coordinates x, y, angle of every body; pins fix a common point, slides a line and the angle."""

    name = "tiny"
    package = "tiny-engine"
    supports = Supports(joints=(*PINS, "translational"), loads=("moment",))

    def version(self):
        return "0.1"

    def refuses(self, scene):
        if not scene.has_mass():
            return Cannot(Owner.MODEL, "bodies need masses")
        if not planar(scene):
            return Cannot(Owner.MODEL, "bodies must move in the xy-plane, slides stand on the ground")
        return None

    def settings(self, scene):
        return [Setting("rk4", {"step": scene.duration / n}) for n in (100, 1000, 4000)]

    def run(self, scene, times, setting):
        plane, samples, steps, t = Plane(scene), [], 0, 0.0
        y, began = plane.start, time.process_time()
        for target in map(float, times):
            n = max(1, int(np.ceil((target - t) / setting.options["step"])))
            for _ in range(n):
                y = rk4(plane.rates, y, (target - t) / n)
            samples.append(y)
            steps, t = steps + n, target
        seconds = time.process_time() - began
        q, v = np.moveaxis(np.array(samples).reshape(len(times), 2, len(scene.body), 3), 1, 0)
        outcome = Outcome.COMPLETED if np.isfinite(samples).all() else Outcome.NOT_FINITE
        flat = [[1.0, 1.0, 0.0]]
        return Trajectory(
            scene.name,
            self.name,
            self.version(),
            setting.family,
            dict(setting.options),
            np.array(times),
            tuple(body.name for body in scene.body),
            q * flat,
            turned(q[..., 2]),
            v * flat,
            v * [[0.0, 0.0, 1.0]],
            outcome=outcome,
            t_end=t,
            cost=Cost(seconds, steps=steps, rhs=4 * steps),
        )


def turned(angle):
    """Quaternions (…, 4) of angles (…) about z."""
    return rotations.from_vector(angle[..., None] * [0.0, 0.0, 1.0])


class Plane:
    """The equations of a planar scene; a state is (x, y, angle) of all bodies, then their rates."""

    def __init__(self, scene):
        self.scene, gravity = scene, np.array(scene.gravity)
        angles = [2 * np.arctan2(body.orientation[3], body.orientation[0]) for body in scene.body]
        velocity, omega = initial_twists(scene)
        self.q0 = np.column_stack([np.array([body.position[:2] for body in scene.body]), angles])
        rates = np.column_stack([velocity[:, :2], omega[:, 2]])
        self.start = np.concatenate([self.q0.ravel(), rates.ravel()])
        moments = inertia_matrices(scene)[:, 2, 2]
        self.mass = np.column_stack([[[b.mass] * 2 for b in scene.body], moments]).ravel()
        self.force = np.array([[*(b.mass * gravity[:2]), 0.0] for b in scene.body])
        for load in scene.load:
            self.force[scene.body_index(load.body), 2] += load.moment[2]
        if scene.joint:
            self.fix()

    def fix(self):
        """Ends of joints: joint, body, sign and arm at t = 0; rows (joints, 3, nb, 3) where no arm counts,
        and those of x, y and angle that each joint keeps (joints, 2, 3)."""
        joints, nb = self.scene.joint, len(self.scene.body)
        ends = [
            (k, self.scene.body_index(name), sign)
            for k, joint in enumerate(joints)
            for sign, name in zip((-1.0, 1.0), joint.bodies, strict=True)
            if name != GROUND
        ]
        self.of, self.on, self.sign = (np.array(column) for column in zip(*ends, strict=True))
        self.arm = (np.array([joint.anchor[:2] for joint in joints])[self.of] - self.q0[self.on, :2]).T
        self.still = np.zeros((len(joints), 3, nb, 3))
        self.still[self.of, :, self.on] = self.sign[:, None, None] * np.eye(3)
        self.kept = np.array([kept(joint) for joint in joints])

    def rates(self, y):
        """M a = f + Jᵀλ, J a = γ; least squares, so that redundant rows do no harm."""
        q, v = y.reshape(2, -1, 3)
        free, root = self.force.ravel() / self.mass, np.sqrt(self.mass)
        if not self.scene.joint:
            return np.concatenate([v.ravel(), free])
        jacobian, gamma = self.rows(q, v)
        push = np.linalg.lstsq(jacobian / root, gamma - jacobian @ free, rcond=1e-10)[0]
        return np.concatenate([v.ravel(), free + push / root])

    def rows(self, q, v):
        """Rows J (2 joints, 3 nb) and γ: of a pin the point's x and y, of a slide across and angle."""
        angle, (a, b) = q[self.on, 2] - self.q0[self.on, 2], self.arm
        c, s = np.cos(angle), np.sin(angle)
        x, y = self.sign * (c * a - s * b), self.sign * (s * a + c * b)
        rows, coasting = self.still.copy(), np.zeros((len(self.still), 3))
        rows[self.of, 0, self.on, 2], rows[self.of, 1, self.on, 2] = -y, x
        np.add.at(coasting, (self.of, 0), v[self.on, 2] ** 2 * x)
        np.add.at(coasting, (self.of, 1), v[self.on, 2] ** 2 * y)
        jacobian = self.kept @ rows.reshape(len(rows), 3, -1)
        return jacobian.reshape(2 * len(rows), -1), (self.kept @ coasting[..., None]).ravel()


def kept(joint):
    """Of x, y and angle, rows (2, 3): a pin keeps x and y, a slide the way across and the angle."""
    if joint.type == "translational":
        return [[-joint.axis[1], joint.axis[0], 0.0], [0.0, 0.0, 1.0]]
    return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def rk4(f, y, h):
    k1 = f(y)
    k2 = f(y + h / 2 * k1)
    k3 = f(y + h / 2 * k2)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(y + h * k3))


def planar(scene):
    """Whether pins are along z, slides on the ground and bodies, gravity and moments in the plane."""
    axes = [j.axis for j in scene.joint if j.type == "revolute"]
    axes += [max(j.axes, key=lambda a: abs(a[2])) for j in scene.joint if j.type == "universal"]
    slides = [j for j in scene.joint if j.type == "translational"]
    across = [*(b.orientation[1:3] for b in scene.body), *(a[:2] for a in axes)]
    across += [load.moment[:2] for load in scene.load]
    off = [scene.gravity[2], *(b.position[2] for b in scene.body), *(j.axis[2] for j in slides)]
    off += [(b.velocity or (0, 0, 0))[2] for b in scene.body]
    off += [x for b in scene.body for x in (b.angular_velocity or (0, 0, 0))[:2]]
    off += [x for pair in across for x in pair]
    return np.abs(off).max() < 1e-12 and all(GROUND in j.bodies for j in slides)


ENGINE = Tiny()
