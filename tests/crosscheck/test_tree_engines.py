"""MuJoCo / Pinocchio / joint equations / energy, on scenes with every joint, driver and load."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from crosscheck.engine import Setting, engine
from crosscheck.judge import constraints
from mbref import rotations
from mbref.scene import (
    Body,
    Cylindrical,
    Distance,
    Driver,
    Fixed,
    Force,
    Moment,
    Revolute,
    Scene,
    Sine,
    Spherical,
    Spring,
    TorsionSpring,
    Translational,
    Universal,
)
from mbref.trajectory import Outcome, Trajectory
from tests.crosscheck.measured import MARGIN
from tests.crosscheck.tree_scenes import BODIES, INERTIA, JOINTS, driven, every_joint, ring

pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")

POSES, RATES, NEWTON = (  # errors measured, in m and rad, in m/s and rad/s, of the forces of inertia
    {"mujoco": 3e-11, "forward": 3e-11, "pinocchio": 1.2e-13},
    {"mujoco": 2.8e-9, "forward": 2e-10, "pinocchio": 7.2e-13},
    {"mujoco": 1.3e-9, "pinocchio": 5.1e-14},
)
ALIKE = 1e-8  # largest difference measured between the reactions of both
FINE = {
    "pinocchio": Setting("tuned", {"rtol": 1e-11, "min_step": 1e-4}),
    "mujoco": Setting("tuned", {"step": 2e-4, "beta": 100.0, "hard": 1e-8}),
    "forward": Setting("forward", {"rtol": 1e-10, "min_step": 1e-4, "beta": 100.0, "hard": 1e-7}),
}
X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


def solo(name: str, **parts) -> Scene:
    """One body with a full inertia matrix, turned, 0.3 m from the origin."""
    q = rotations.from_vector((0.4, -0.2, 0.7))
    bob = Body(name="bob", mass=1.5, inertia=INERTIA, position=(0.3, 0.0, 0.1), orientation=q)
    return Scene(name=name, body=(bob.model_copy(update=parts.pop("start", {})),), duration=0.4, **parts)


def on_ground(kind: type, swapped: bool = False, **places) -> tuple:
    pair = ("bob", "ground") if swapped else ("ground", "bob")
    return (kind(name="J", bodies=pair, **({"anchor": O} | places)),)


def pendulums() -> dict[str, Scene]:
    """Single bodies, one feature each."""
    down, spin = (0.5, -9.81, 2.0), {"angular_velocity": (3.0, -2.0, 5.0)}
    sine = Sine(amplitude=0.4, frequency=8.0)
    pull = Force(body="bob", point=(0.5, 0.2, 0.1), force=(2.0, 3.0, -1.0))
    tie = Spring(
        bodies=("bob", "ground"),
        points=((0.4, 0.1, 0.1), (0.0, 0.8, 0.0)),
        stiffness=60.0,
        damping=0.8,
        natural_length=0.3,
    )
    twist = TorsionSpring(joint="J", stiffness=5.0, damping=0.05, natural_angle=0.7)
    return {
        "universal under gravity": solo("u", gravity=down, joint=on_ground(Universal, axes=(X, Y))),
        "universal to the ground": solo("v", gravity=down, joint=on_ground(Universal, True, axes=(X, Y))),
        "spherical": solo("s", gravity=down, joint=on_ground(Spherical), start=spin),
        "distance": solo(
            "d",
            gravity=down,
            joint=(Distance(name="J", bodies=("bob", "ground"), anchors=((0.3, 0.0, 0.2), (0.0, 0.5, 0.0))),),
        ),
        "free and spinning": solo("f", gravity=down, start=spin | {"velocity": (1.0, 2.0, 3.0)}),
        "fixed": solo("x", gravity=down, joint=on_ground(Fixed)),
        "spring": solo("k", load=(tie,), joint=on_ground(Revolute, axis=Z)),
        "spring on a free body": solo("l", load=(tie,)),
        "torsion spring": solo("t", load=(twist,), joint=on_ground(Revolute, axis=(1.0, 1.0, 0.0))),
        "torsion spring to the ground": solo("w", load=(twist,), joint=on_ground(Cylindrical, True, axis=Z)),
        "force at a point": solo("p", load=(pull,), joint=on_ground(Spherical)),
        "moment on a free body": solo("m", load=(Moment(body="bob", moment=(0.2, -0.1, 0.3)),)),
        "sine on a cylindrical": solo(
            "c",
            gravity=(0.0, 0.0, -9.81),
            joint=on_ground(Cylindrical, axis=Z),
            driver=(Driver(joint="J", polynomial=(0.0, 2.0, 1.0), sine=sine),),
        ),
        "sine on a translational": solo(
            "a",
            joint=on_ground(Translational, True, axis=(1.0, 2.0, 0.0)),
            driver=(Driver(joint="J", sine=sine),),
        ),
    }


def chain_scenes() -> dict[str, Scene]:
    """Every joint kind between many bodies, and loops cut at joints of every kind."""
    backwards = every_joint(name="backwards", body=tuple(reversed(BODIES)), joint=tuple(reversed(JOINTS)))
    rings = {f"ring {kind}": ring(kind) for kind in ("revolute", "cylindrical", "universal", "spherical")}
    return {"every joint": every_joint(), "driven": driven(), "backwards": backwards, **rings}


ALL = {**pendulums(), **chain_scenes()}


@functools.cache
def trajectory(name: str, setting: str, samples: int = 9) -> Trajectory:
    scene = ALL[name]
    runner = engine("mujoco" if setting == "forward" else setting)
    return runner.run(scene, np.linspace(0, scene.duration, samples), FINE[setting])


def assert_completed(*runs: Trajectory) -> None:
    for run in runs:
        assert run.outcome is Outcome.COMPLETED, (
            f"{run.engine} {run.method}: {run.outcome.label} {run.message}"
        )


def differences(a: Trajectory, b: Trajectory) -> dict[str, float]:
    gaps = {"rotation": rotations.angle_between(a.orientation, b.orientation).max()}
    for field in ("position", "velocity", "angular_velocity"):
        gaps[field] = abs(getattr(a, field) - getattr(b, field)).max()
    return gaps


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("setting", ["mujoco", "forward"])
def test_mujoco_and_pinocchio_move_alike(name: str, setting: str) -> None:
    one, other = trajectory(name, setting), trajectory(name, "pinocchio")
    assert_completed(one, other)
    for field, gap in differences(one, other).items():
        allowed = MARGIN * (POSES if field in ("position", "rotation") else RATES)[setting]
        assert gap < allowed, f"{name}: {field} of MuJoCo ({setting}) and Pinocchio differ by {gap:.2e}"


@pytest.mark.parametrize("name", ALL)
def test_mujoco_and_pinocchio_feel_the_same_reactions(name: str) -> None:
    one, other = trajectory(name, "mujoco"), trajectory(name, "pinocchio")
    scale = 1 + max((abs(r).max() for r in other.reactions.values()), default=0) if other.reactions else 1
    assert (one.reactions or {}).keys() == {j.name for j in ALL[name].joint}, f"{name}: {one.reactions}"
    for joint, reaction in (one.reactions or {}).items():
        gap = abs(reaction - other.reactions[joint]).max()
        assert gap < MARGIN * ALIKE * scale, (
            f"{name}: reactions at {joint} differ by {gap:.2e} N or N m of {scale:.3g}"
        )


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("setting", FINE)
def test_bodies_of_tree_engines_obey_the_joint_equations(name: str, setting: str) -> None:
    run, scene = trajectory(name, setting), ALL[name]
    levels = {
        "position": constraints.closure(scene, run.times, run.position, run.orientation),
        "velocity": constraints.closure_rates(
            scene, run.times, run.position, run.orientation, run.velocity, run.angular_velocity
        ),
    }
    for level, residuals in levels.items():
        for joint, rows in residuals.items():
            worst = abs(rows).max(initial=0)
            allowed = MARGIN * (POSES if level == "position" else RATES)[setting]
            assert worst < allowed, f"{name}, {setting}: {level} residual {worst:.2e} at {joint}"


@pytest.mark.parametrize("name", [n for n in ALL if not ALL[n].driver])
def test_reactions_do_no_work_and_balance_the_accelerations(name: str) -> None:
    """d'Alembert: what inertia, weight and loads leave over is Jᵀλ of the independent joint equations."""
    scene, run = ALL[name], trajectory(name, "pinocchio")
    for k, t in enumerate(run.times):
        rows, _ = constraints.jacobian(scene, t, run.position[k], run.orientation[k])
        free = null_space(rows, 6 * len(scene.body))
        left = free.T @ (inertial_wrenches(scene, run, k) - applied_wrenches(scene, run, k)).ravel()
        scale = 1 + abs(inertial_wrenches(scene, run, k)).max()
        assert abs(left).max(initial=0) < MARGIN * NEWTON["pinocchio"] * scale, (
            f"{name}: {abs(left).max():.2e} left of {scale:.3g} at {t}"
        )


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("setting", ["mujoco", "pinocchio"])
def test_reported_reactions_obey_newton_and_euler(name: str, setting: str) -> None:
    """A body's inertial wrench is that of its loads, its weight and the reactions at its joints."""
    scene, run = ALL[name], trajectory(name, setting)
    for k, t in enumerate(run.times):
        left = inertial_wrenches(scene, run, k) - applied_wrenches(scene, run, k)
        scale = 1 + abs(inertial_wrenches(scene, run, k)).max() + abs(left).max()
        gap = abs(left - reaction_wrenches(scene, run, k)).max()
        assert gap < MARGIN * NEWTON[setting] * scale, (
            f"{name}, {setting}: {gap:.2e} of {scale:.3g} left at {t}"
        )


def reaction_wrenches(scene: Scene, run: Trajectory, k: int) -> np.ndarray:
    """(nb, 6): the reported reactions about the centres of mass, opposite on a joint's first body."""
    wrenches = np.zeros((len(scene.body) + 1, 6))
    for joint in scene.joint:
        force, moment = run.reactions[joint.name][k, :3], run.reactions[joint.name][k, 3:]
        first, second = map(scene.body_index, joint.bodies)
        anchor = np.array(joint.anchor_pair[1])
        if second >= 0:
            body = scene.body[second]
            back = rotations.rotate(rotations.conjugate(body.orientation), anchor - body.position)
            anchor = run.position[k, second] + rotations.rotate(run.orientation[k, second], back)
        for b, sign in ((first, -1.0), (second, 1.0)):
            arm = anchor - (run.position[k, b] if b >= 0 else 0.0)
            wrenches[b] += sign * np.concatenate([force, moment + np.cross(arm, force)])
    return wrenches[:-1]


def null_space(rows: np.ndarray, n: int) -> np.ndarray:
    if not len(rows):
        return np.eye(n)
    _, s, vt = np.linalg.svd(rows)
    return vt[int(np.sum(s > 1e-9 * s[0])) :].T


def inertial_wrenches(scene: Scene, run: Trajectory, k: int) -> np.ndarray:
    """(nb, 6): m a, and the rate of the angular momentum, about the centres of mass."""
    wrenches = np.zeros((len(scene.body), 6))
    for b, body in enumerate(scene.body):
        turned, spin = rotations.to_matrix(run.orientation[k, b]), run.angular_velocity[k, b]
        inertia = np.diag(body.inertia) if np.ndim(body.inertia) == 1 else np.array(body.inertia)
        inertia = turned @ inertia @ turned.T
        wrenches[b, :3] = body.mass * run.acceleration[k, b]
        wrenches[b, 3:] = inertia @ run.angular_acceleration[k, b] + np.cross(spin, inertia @ spin)
    return wrenches


def applied_wrenches(scene: Scene, run: Trajectory, k: int) -> np.ndarray:
    """(nb, 6): weights and loads about the centres of mass; the last row, the ground's, is dropped."""
    wrenches = np.zeros((len(scene.body) + 1, 6))
    for b, body in enumerate(scene.body):
        wrenches[b, :3] = body.mass * np.array(scene.gravity)

    def place(name: str, point) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
        b = scene.body_index(name)
        if b < 0:
            return b, np.array(point), np.array(point), np.zeros(3)
        body = scene.body[b]
        local = rotations.rotate(rotations.conjugate(body.orientation), np.subtract(point, body.position))
        arm = rotations.rotate(run.orientation[k, b], local)
        return (
            b,
            arm,
            run.position[k, b] + arm,
            run.velocity[k, b] + np.cross(run.angular_velocity[k, b], arm),
        )

    def push(b: int, arm: np.ndarray, force: np.ndarray) -> None:
        wrenches[b] += [*force, *np.cross(arm, force)]

    for load in scene.load:
        if isinstance(load, Moment):
            wrenches[scene.body_index(load.body), 3:] += load.moment
        elif isinstance(load, Force):
            b, arm, _, _ = place(load.body, load.point)
            push(b, arm, np.array(load.force))
        elif isinstance(load, Spring):
            (a, arm_a, p, u), (b, arm_b, q, v) = map(place, load.bodies, load.points)
            length = np.linalg.norm(q - p)
            along = (q - p) / length
            tension = load.stiffness * (length - load.natural_length) + load.damping * along @ (v - u)
            push(a, arm_a, tension * along)
            push(b, arm_b, -tension * along)
        else:
            torsion(scene, run, k, load, wrenches)
    return wrenches[:-1]


def torsion(scene: Scene, run: Trajectory, k: int, load: TorsionSpring, wrenches: np.ndarray) -> None:
    joint = next(j for j in scene.joint if j.name == load.joint)
    poses = (run.times, run.position, run.orientation, run.angular_velocity)
    angle = constraints.joint_coordinates(scene, *poses)[load.joint][k, 0]
    first, second = map(scene.body_index, joint.bodies)
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    if first >= 0:
        back = rotations.rotate(rotations.conjugate(scene.body[first].orientation), axis)
        axis = rotations.rotate(run.orientation[k, first], back)
    spins = np.vstack([run.angular_velocity[k], np.zeros(3)])
    moment = -(
        load.stiffness * (angle - load.natural_angle) + load.damping * axis @ (spins[second] - spins[first])
    )
    wrenches[second, 3:] += moment * axis
    wrenches[first, 3:] -= moment * axis


@pytest.mark.parametrize(
    "name", ["every joint", "spherical", "ring universal", "free and spinning", "distance"]
)
def test_accelerations_are_the_slopes_of_the_velocities(name: str) -> None:
    scene, h = ALL[name], 1e-4
    times = np.array([0.1 - h, 0.1, 0.1 + h])
    run = engine("pinocchio").run(scene, times, FINE["pinocchio"])
    for rate, slope in (("velocity", "acceleration"), ("angular_velocity", "angular_acceleration")):
        values = getattr(run, rate)
        gap = abs((values[2] - values[0]) / (2 * h) - getattr(run, slope)[1]).max()
        scale = 1 + abs(getattr(run, slope)).max()
        assert gap < 2e-5 * scale, f"{name}: {slope} off by {gap:.2e} of {scale:.3g} from the slope of {rate}"
