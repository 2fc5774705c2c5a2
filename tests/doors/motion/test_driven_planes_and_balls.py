"""Drivers of planar joints, in the plane and about its normal: motions, forces and faults.

A block of 2 kg hangs on an arm by which a planar joint's anchor, at the origin, holds it.
"""

import numpy as np
import pytest
from scipy.integrate import simpson

import crosscheck
import mbref
from crosscheck.judge.reference.reference import reference
from mbref import Scene, SceneError
from tests.helpers.parts import hinge, joint, rod
from tests.helpers.statics import DOWN

MASS, MOMENTS, ARM, Z = 2.0, (0.02, 0.03, 0.04), np.array([0.1, 0.05, 0.02]), np.array([0.0, 0.0, 1.0])
R, W, TIMES = 0.3, 2.0, np.linspace(0.0, 1.5, 16)
BLOCK = {"name": "block", "mass": MASS, "inertia": MOMENTS, "position": ARM.tolist()}
ANGLE = {"joint": "P", "polynomial": [0.0, 0.5], "sine": {"amplitude": 0.4, "frequency": 3.0}}
CIRCLE = (
    {"name": "x", "joint": "P", "along": [1.0, 0.0, 0.0], "polynomial": [-R]}
    | {"sine": {"amplitude": R, "frequency": W, "phase": "90 deg"}},
    {"name": "y", "joint": "P", "along": [0.0, 2.0, 0.0], "sine": {"amplitude": R, "frequency": W}},
)
ROWS = ((0.0, 0.0), (0.4, 0.2), (0.9, -0.1), (1.2, 0.3), (1.5, 0.1))
METHODS = ("taylor", "lm1+projection", "alf-dual+projection", "mpi-svd+partitioning")


def plate(*drivers: dict, **fields) -> Scene:
    """Return a block on a planar joint with the ground, of normal z, with drivers."""
    plane = joint("P", "planar", "ground", "block", (0.0, 0.0, 0.0), axis=Z.tolist())
    given = {"body": [BLOCK], "joint": [plane], "driver": drivers, **fields}
    return Scene(name="plate", gravity=DOWN, duration=1.5, **given)


def tray(*drivers: dict) -> Scene:
    """Return a block on a skew planar joint with a rod that swings on a hinge, held by a damped spring."""
    bodies = [rod("rod", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 3.0), {**BLOCK, "position": [1.0, 0.05, 0.3]}]
    plane = joint("P", "planar", "rod", "block", (1.0, 0.0, 0.1), axis=[0.0, 0.6, 0.8])
    spring = {"type": "spring", "bodies": ["rod", "block"], "points": [[0.3, 0.0, 0.4], [1.0, 0.1, 0.4]]}
    spring |= {"stiffness": 200.0, "damping": 2.0, "natural_length": 0.5}
    joints = [hinge("A", "ground", "rod", (0.0, 0.0, 0.0)), plane]
    given = {"body": bodies, "joint": joints, "load": [spring], "driver": drivers}
    return Scene(name="tray", gravity=DOWN, duration=1.5, **given)


@pytest.mark.parametrize("method", METHODS)
def test_block_on_a_circle_that_turns_needs_the_forces_of_newton_and_euler(method):
    """The anchor moves on a circle of 0.3 m, the block turns by q about z: with the acceleration a of the
    centre at the arm c, F = m (a - g) at the anchor, and T = I q'' + (c × F)·z."""
    t = TIMES
    q, rate, second = t / 2 + 0.4 * np.sin(3 * t), 0.5 + 1.2 * np.cos(3 * t), -3.6 * np.sin(3 * t)
    x, y, o = R * np.cos(W * t), R * np.sin(W * t), 0 * t
    arm = np.stack([np.cos(q), np.sin(q), o]) * ARM[0] + np.stack([-np.sin(q), np.cos(q), o]) * ARM[1]
    flat, arm = arm.T, (arm + ARM[2] * Z[:, None]).T
    second_of_centre = -(W**2) * np.stack([x, y, o], 1) + second[:, None] * np.cross(Z, arm)
    force = MASS * (second_of_centre - rate[:, None] ** 2 * flat - np.array(DOWN))
    torque = MOMENTS[2] * second + np.cross(arm, force)[:, 2]
    motion = mbref.simulate(plate(ANGLE, *CIRCLE), method, t, rtol=1e-12)
    assert motion.outcome.name == "COMPLETED", motion.message
    close = 1e-12 * np.abs(force).max()
    assert np.abs(motion["block"].position - np.stack([x - R, y, o], 1) - arm).max() < 1e-12
    assert np.abs(motion.driver("x").force - force[:, 0]).max() < close
    assert np.abs(motion.driver("y").power - force[:, 1] * W * x).max() < close
    assert np.abs(motion.driver("P").torque - torque).max() < close
    assert np.abs(motion.driver("P").power - torque * rate).max() < close


@pytest.mark.parametrize(
    "drivers",
    [
        (ANGLE,),
        ({"joint": "P", "table": ROWS}, {"name": "x", "joint": "P", "along": [1, 0, 0], "table": ROWS}),
        ({**CIRCLE[1], "along": [0.0, 0.8, -0.6]},),
    ],
)
def test_driven_plane_on_a_swinging_rod_moves_as_the_references_and_balances_power(drivers):
    """The judge's two formulations and its residuals know the drivers of the skew plane."""
    scene = tray(*drivers)
    exact, times = reference(scene, TIMES), np.linspace(0.0, 1.5, 1501)
    assert exact.bound.max() < 1e-12 and exact.both.all()
    motion = mbref.simulate(scene, "taylor", TIMES)
    errors = crosscheck.measure(scene, motion, crosscheck.truth_for(scene))
    kinds = "error", "violation_position", "violation_acceleration", "reaction_error"
    assert all(not errors[kind] > 1e-9 for kind in kinds), errors
    table, columns = crosscheck.reference_table(scene, TIMES), motion.columns()
    for name in (name for name in table if name.startswith("driver")):
        assert np.abs(columns[name] - table[name]).max() < 1e-9 * np.abs(table[name]).max(), name
    columns = mbref.simulate(scene, times=times).columns()
    power = sum(values for name, values in columns.items() if name.endswith(").power"))
    work = simpson(power, x=times)
    energy = columns["energy"] - columns["load(0).energy"]
    assert work == pytest.approx(energy[-1] - energy[0], rel=1e-6)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"along": [0, 0.1, 1]}, "driver[y].along: must lie in the plane of joint 'P', perpendicular to"),
        ({"name": None}, "driver[P].joint: with along needs name, too, for a displacement of the joint"),
        ({"joint": "Q"}, "driver[y].joint: unknown joint 'Q'; known: P"),
        ({"name": "P"}, "driver[P].name: 'P' is already the name of a joint"),
    ],
)
def test_driver_across_a_plane_is_refused_with_its_field(change, fault):
    with pytest.raises(SceneError) as refusal:
        plate({**CIRCLE[1], **change})
    assert any(each.startswith(fault) for each in refusal.value.faults), refusal.value.faults
