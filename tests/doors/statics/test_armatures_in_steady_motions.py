"""Steady motions of mechanisms with motors: reflected inertia changes vibrations, not the motion."""

import numpy as np
import pytest

from mbref import Scene, equilibria
from tests.helpers.parts import X, Z, hinge, slide

MASS, START, STIFFNESS, RATE = 0.6, 0.25, 30.0, 4.0  # kg, m, N/m, rad/s


def table(of_motor: float, of_slide: float) -> Scene:
    """Return a turntable of a motor with a carriage on a radial guide, which a spring holds."""
    bodies = [
        {"name": "table", "mass": 2.0, "inertia": [0.1, 0.1, 0.2], "position": [0.0, 0.0, 0.0]},
        {"name": "carriage", "mass": MASS, "inertia": [0.01] * 3, "position": [START, 0.0, 0.0]},
    ]
    joints = [
        hinge("H", "ground", "table", (0.0, 0.0, 0.0), Z, armature=of_motor),
        slide("S", "table", "carriage", (START, 0.0, 0.0), X, armature=of_slide),
    ]
    parts = {"body": bodies, "joint": joints, "driver": [{"joint": "H", "polynomial": [0.0, RATE]}]}
    load = [{"type": "slide_spring", "joint": "S", "stiffness": STIFFNESS}]
    return Scene(name="turntable", gravity=(0.0, 0.0, -9.81), load=load, **parts)


@pytest.mark.parametrize("armatures", [(0.0, 0.0), (0.7, 0.0), (0.0, 1.3), (0.7, 1.3)])
def test_armature_changes_the_frequency_of_a_carriage_on_a_turntable_and_not_its_place(armatures):
    """The carriage rests at r + x with m ω² (r + x) = k x, which gives r k / (k - m ω²), and vibrates at
    √((k - m ω²) / (m + I)) rad/s with the armature I of its guide. The search finds the place to 1e-9 and the
    frequency to 1e-7. The equilibrium's scene still has the armatures."""
    (found,) = equilibria(table(*armatures), starts=2)
    place = START * STIFFNESS / (STIFFNESS - MASS * RATE**2)
    assert np.linalg.norm(found.scene.body[1].position) == pytest.approx(place, rel=1e-9)
    frequency = np.sqrt((STIFFNESS - MASS * RATE**2) / (MASS + armatures[1]))
    assert np.abs(found.eigenvalues) == pytest.approx(frequency, rel=1e-7)
    assert tuple(joint.armature for joint in found.scene.joint) == armatures
