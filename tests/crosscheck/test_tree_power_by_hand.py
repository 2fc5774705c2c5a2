"""Forces of the reference's spanning tree / the power of all loads and the growth of the kinetic energy.

Along a path with constant rates the power of the generalised force is that of the loads, less the growth of
the kinetic energy.
"""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.judge.arithmetic import DOUBLE
from crosscheck.judge.gauss_motion import kinetic, power
from crosscheck.judge.reference.tree_equations import Instant, TreeEquations
from mbref import rotations
from mbref.scene import (
    Body,
    Factor,
    Force,
    JointForce,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SlideSpring,
    Spring,
    TorsionSpring,
    Translational,
)

H, TIME = 1e-4, 0.5  # s
LOADS = {
    "gravity": (),
    "force": (Force(body="b", point=(1.6, 0.7, 0.2), force=(3.0, -4.0, 5.0)),),
    "force over time": (
        Force(body="a", point=(0.5, 0.1, 0.3), force=(3.0, 1.0, 5.0), factor=Factor(polynomial=(1.0, 4.0))),
    ),
    "moment": (Moment(body="a", moment=(2.0, -1.0, 3.0), factor=Factor(polynomial=(0.5, 1.0))),),
    "spring": (
        Spring(bodies=("a", "b"), points=((0.4, 0.5, 0.1), (1.9, 0.2, 0.6)), stiffness=30.0, damping=2.0,
               natural_length=0.7),
    ),
    "spring to the ground": (
        Spring(bodies=("b", "ground"), points=((1.2, 0.5, 0.6), (3.0, 2.0, 1.0)), stiffness=9.0, damping=0.5,
               natural_length=0.0),
    ),
    "torsion spring": (TorsionSpring(joint="A", stiffness=7.0, damping=0.6, natural_angle=0.1),),
    "slide spring": (SlideSpring(joint="B", stiffness=8.0, damping=0.9, natural_displacement=0.2),),
    "joint torque": (JointTorque(joint="A", torque=2.5, factor=Factor(polynomial=(0.0, 3.0))),),
    "joint force": (JointForce(joint="B", force=-1.5),),
}  # fmt: skip


def scene(name: str) -> Scene:
    return Scene(
        name="s",
        gravity=(1.0, -9.0, 2.0),
        body=(
            Body(name="a", mass=2.0, inertia=(1.0, 2.0, 2.5), position=(0.6, 0.2, -0.1)),
            Body(
                name="b",
                mass=1.5,
                inertia=((0.5, 0.1, 0.02), (0.1, 0.4, 0.03), (0.02, 0.03, 0.3)),
                position=(1.5, 0.9, 0.4),
                orientation=(0.8, 0.0, 0.36, 0.48),
            ),
        ),
        joint=(
            Revolute(name="A", bodies=("ground", "a"), anchor=(0.1, 0.0, 0.2), axis=(0.0, 0.6, 0.8)),
            Translational(name="B", bodies=("a", "b"), anchor=(1.0, 0.5, 0.1), axis=(0.6, 0.0, 0.8)),
        ),
        load=LOADS[name],
    )


@pytest.mark.parametrize("rate", [(0.7, -1.1), (1.9, 0.0), (0.0, 2.3)])
@pytest.mark.parametrize("name", LOADS)
def test_the_power_of_loads(name, rate):
    of = scene(name)
    equations = TreeEquations(of, DOUBLE)
    assert [link.joint.name for link in equations.tree.links] == ["A", "B"] and equations.nv == 2
    place, pace = np.array([0.4, 0.3]), np.array(rate)
    y = np.zeros((3, int(equations.ends[-1])))
    y[:, :2] = place + H * np.array([[-1.0], [0.0], [1.0]]) * pace
    y[:, -2:] = pace
    at = equations.at(np.full(3, TIME), y)
    mass, force = equations.loads.terms(at.placed, at.coordinates, at.rate, np.full(3, TIME), 0.0)
    energy = np.einsum("ki,kij,kj->k", at.rate, mass, at.rate) / 2
    state = (
        at.placed.position[1, :2],
        np.array([quaternion(equations, at, b) for b in range(2)]),
        at.placed.velocity[1, :2],
        at.placed.spin[1, :2],
        np.array([place[0]] if name in ("torsion spring", "joint torque") else []),
    )
    assert kinetic(of, state) == pytest.approx(energy[1])
    growth = (energy[2] - energy[0]) / (2 * H)
    assert pace @ force[1] == pytest.approx(power(of, TIME, state) - growth, abs=1e-6)
    again = equations.loads.mass_matrix(at.placed, at.coordinates)
    assert again == pytest.approx(mass, abs=1e-14)


def quaternion(equations: TreeEquations, at: Instant, b: int) -> np.ndarray:
    given = np.array(equations.scene.body[b].orientation)
    return rotations.multiply(at.placed.turn[1, b], given)
