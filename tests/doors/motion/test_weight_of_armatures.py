"""Reflected inertia resists acceleration and has no weight: motions, equilibria, steady motions."""

import numba
import numpy as np
import pytest

from mbref import Limits, Scene, equilibria, simulate
from mbref.formulations import FORMULATIONS
from mbref.stabilisation import STABILISATIONS
from tests.helpers import parts

MASS, ARMATURE = 0.8, 1.7
TIMES = np.linspace(0.0, 0.6, 4)
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.0, -0.8))
GRAVITIES = ((-3.0, 0.0, 0.0), (0.0, 2.5, 0.0), (4.0, -1.0, 2.0))
DRIVEN_ONLY = "mpi-gs-literal"
METHODS = (
    "taylor",
    *(f"{name}+projection" for name in FORMULATIONS if name != DRIVEN_ONLY),
    *(f"alf-dual+{name}/rk4[step=0.01]" for name in STABILISATIONS),
)
STEPS = 1e-12  # m: a few thousand roundings of a fall of a metre, in a run of exact series
FIXED = 10 * STEPS  # m: fixed steps and iterations, which are exact for falls, round more often


def slide(gravity=GRAVITIES[2], axis=AXES[2], **changes) -> Scene:
    """A carriage with a motor's reflected mass on a guide."""
    body = {"name": "carriage", "mass": MASS, "inertia": [0.01, 0.02, 0.03], "position": [0.4, -0.1, 0.2]}
    guide = parts.slide("G", "ground", "carriage", (0.4, -0.1, 0.2), axis, armature=ARMATURE)
    return Scene(**{"name": "slide", "gravity": gravity, "body": [body], "joint": [guide], **changes})


def fallen(scene: Scene) -> np.ndarray:
    """Return the displacement s = ½ m (g·a) / (m + I) t² along the guide a: from (m + I) s'' = m (g·a)."""
    pull = MASS * np.dot(scene.gravity, scene.joint[0].axis)
    return pull / (MASS + ARMATURE) * TIMES**2 / 2


@pytest.mark.parametrize("method", METHODS)
def test_armature_of_a_slide_resists_its_fall_and_has_no_weight_by_every_method(method):
    """The displacement is s = ½ m (g·a) / (m + I) t², of a mass m with armature I on a guide a."""
    motion = simulate(slide(), method, TIMES)
    assert motion.outcome.name == "COMPLETED", motion.message
    assert motion.joint("G").displacement == pytest.approx(fallen(slide()), rel=0, abs=FIXED)


@pytest.mark.parametrize("ground", ["frame", "body"])
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("gravity", GRAVITIES)
def test_armature_of_a_slide_has_no_weight_in_any_direction_of_guide_and_gravity(gravity, axis, ground):
    """The displacement is s = ½ m (g·a) / (m + I) t², also in code that is generated for a guide."""
    scene = slide(gravity, axis, ground=ground)
    is_generated = (gravity, axis) == (GRAVITIES[2], AXES[2]) and not numba.config.DISABLE_JIT
    for code in ("generic", "generated")[: 1 + is_generated]:
        found = simulate(scene, "taylor", TIMES, Limits(code=code)).joint("G").displacement
        assert found == pytest.approx(fallen(scene), rel=0, abs=STEPS), code


def test_equilibrium_of_a_slide_on_a_spring_has_the_weight_of_its_mass_alone():
    """The slide rests at m (g·a) / k, to 1e-10 m, and vibrates with √(k / (m + I)) rad/s, to 1e-8."""
    stiffness = 50.0
    spring = {"type": "slide_spring", "joint": "G", "stiffness": stiffness}
    scene = slide(load=[spring])
    (found,) = equilibria(scene, starts=1)
    moved = np.subtract(found.scene.body[0].position, scene.body[0].position) @ AXES[2]
    assert moved == pytest.approx(MASS * np.dot(scene.gravity, AXES[2]) / stiffness, abs=1e-10)
    assert np.abs(found.eigenvalues) == pytest.approx(np.sqrt(stiffness / (MASS + ARMATURE)), rel=1e-8)


CARRIAGE, START, STIFFNESS, RATE = 0.6, 0.25, 30.0, 4.0  # kg, m, N/m, rad/s


def table(of_motor: float, of_slide: float) -> Scene:
    """Return a turntable of a motor with a carriage on a radial guide, which a spring holds."""
    bodies = [
        {"name": "table", "mass": 2.0, "inertia": [0.1, 0.1, 0.2], "position": [0.0, 0.0, 0.0]},
        {"name": "carriage", "mass": CARRIAGE, "inertia": [0.01] * 3, "position": [START, 0.0, 0.0]},
    ]
    joints = [
        parts.hinge("H", "ground", "table", (0.0, 0.0, 0.0), parts.Z, armature=of_motor),
        parts.slide("S", "table", "carriage", (START, 0.0, 0.0), parts.X, armature=of_slide),
    ]
    given = {"body": bodies, "joint": joints, "driver": [{"joint": "H", "polynomial": [0.0, RATE]}]}
    load = [{"type": "slide_spring", "joint": "S", "stiffness": STIFFNESS}]
    return Scene(name="turntable", gravity=(0.0, 0.0, -9.81), load=load, **given)


@pytest.mark.parametrize("armatures", [(0.0, 0.0), (0.7, 0.0), (0.0, 1.3), (0.7, 1.3)])
def test_armature_changes_the_frequency_of_a_carriage_on_a_turntable_and_not_its_place(armatures):
    """The carriage rests at r + x with m ω² (r + x) = k x, which gives r k / (k - m ω²), and vibrates at
    √((k - m ω²) / (m + I)) rad/s with the armature I of its guide. The search finds the place to 1e-9 and the
    frequency to 1e-7. The equilibrium's scene still has the armatures."""
    (found,) = equilibria(table(*armatures), starts=2)
    place = START * STIFFNESS / (STIFFNESS - CARRIAGE * RATE**2)
    assert np.linalg.norm(found.scene.body[1].position) == pytest.approx(place, rel=1e-9)
    frequency = np.sqrt((STIFFNESS - CARRIAGE * RATE**2) / (CARRIAGE + armatures[1]))
    assert np.abs(found.eigenvalues) == pytest.approx(frequency, rel=1e-7)
    assert tuple(joint.armature for joint in found.scene.joint) == armatures
