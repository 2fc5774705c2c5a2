"""Motions of joints that break by a component of their reaction, and of a latch at a distance between points
that turn, by the judge's formulations and by mbref, against closed forms."""

import numpy as np
import pytest

import mbref
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref import Scene
from tests.helpers.coupled_mechanisms import body
from tests.helpers.parts import Z, hinge, joint

ORIGIN, TURNED = (0.0, 0.0, 0.0), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)  # a quarter turn about x
ROUNDING = 1e-12  # m, m/s and rad/s of mechanisms of about 1 m, 1 kg and 1 s
MASS, MOMENT = 1.0, 0.1  # kg, kg m²
WAYS = {"A": natural_motion, "B": tree_motion, "mbref": None}
FORMULATIONS = pytest.mark.parametrize("formulation", WAYS.values(), ids=WAYS)


def rates(formulation, scene: Scene, times: list[float]) -> tuple[np.ndarray, ...]:
    """Return position, velocity and angular velocity (k, 3) of the only body, by a formulation of the judge,
    or by mbref for None."""
    if formulation is None:
        found = mbref.simulate(scene, "taylor", times=times, rtol=1e-13)
    else:
        found = motion_by(formulation, scene, times, EXTENDED)
    return tuple(doubles(getattr(found, name))[:, 0] for name in ("position", "velocity", "angular_velocity"))


@FORMULATIONS
@pytest.mark.parametrize(
    ("wrench", "release"),
    [
        ([4.0, 0.0, -3.0, 0.0, 0.0, 0.0], {"force": 5.0}),
        ([-5.0, 7.0, 9.0, 0.0, 0.0, 0.0], {"force": 5.0, "component": "x"}),
        ([9.0, 5.0, 0.0, 0.0, 0.0, 0.0], {"force": 5.0, "component": "-y"}),
        ([0.0, 0.0, 0.0, 3.0, -4.0, 0.0], {"moment": "5 N m"}),
        ([0.0, 0.0, 0.0, 7.0, 0.0, 5.0], {"moment": 5.0, "component": "-z"}),
    ],
    ids=["size", "x", "-y", "moment", "moment -z"],
)
def test_bracket_breaks_where_its_reaction_is_at_the_limit(formulation, wrench, release):
    """Force and moment (N, N m) times t act on a mass at its centre. The reaction is minus them: its size or
    component reaches the limit, 5 N or 5 N m, at 1 s. Then v = F/m (t² - 1)/2 and ω = M/I (t² - 1)/2."""
    force, moment = wrench[:3], wrench[3:]
    ramp = {"body": "a", "factor": {"polynomial": [0.0, 1.0]}}
    loads = [{"type": "force", "point": ORIGIN, "force": force}, {"type": "moment", "moment": moment}]
    scene = Scene(
        name="bracket",
        duration=1.5,
        body=[body("a", MASS, [MOMENT] * 3, ORIGIN)],
        joint=[joint("B", "fixed", "ground", "a", release=release)],
        load=[{**ramp, **load} for load, size in zip(loads, (force, moment), strict=True) if any(size)],
    )
    _, velocity, spin = rates(formulation, scene, [0.9, 1.5])
    gained = np.outer([0.0, (1.5**2 - 1.0) / 2], [*np.divide(force, MASS), *np.divide(moment, MOMENT)])
    assert np.abs(np.hstack([velocity, spin]) - gained).max() <= ROUNDING


@FORMULATIONS
def test_rotor_latches_where_its_point_has_a_distance_from_a_point_of_the_ground(formulation):
    """A point 1 m from the axis, at the angle t, is √(5 - 4 cos t) m from a point at 2 m on the ground. Axes
    of the body are not the world's. Welded at 0.5 s, it stays at 0.5 rad."""
    moving = {"orientation": TURNED, "velocity": [0.0, 0.5, 0.0], "angular_velocity": [0.0, 0.0, 1.0]}
    points = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    reached = {"bodies": ["rotor", "ground"], "points": points, "reaches": np.sqrt(5.0 - 4.0 * np.cos(0.5))}
    scene = Scene(
        name="rotor",
        duration=1.0,
        body=[body("rotor", MASS, [MOMENT, 0.2, 0.3], (0.5, 0.0, 0.0), **moving)],
        joint=[
            hinge("A", "ground", "rotor", ORIGIN, Z),
            joint("L", "fixed", "ground", "rotor", when=reached),
        ],
    )
    position, _, spin = rates(formulation, scene, [0.25, 1.0])
    angle = np.array([0.25, 0.5])
    place = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert np.abs(position - place).max() <= ROUNDING
    assert np.abs(spin - [[0.0, 0.0, 1.0], [0.0] * 3]).max() <= ROUNDING
