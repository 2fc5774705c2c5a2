"""Bricard's linkage, overconstrained in every position: the engines / the reference. No row is redundant by
itself, and away from closed poses none is redundant at all: whoever resolves the rank of poses that are not
quite closed follows rounding."""

import functools

import numpy as np
import pytest

import mbref
from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import error_series
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.motions.trajectory import Outcome, Trajectory
from mbref.scene import Body, Revolute, Scene
from tests.crosscheck.measured import MARGIN

POINTS = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float)
AXES = "yzxyzx"
INERTIA = (1 / 600, 1.01 / 12, 1.01 / 12)  # a bar of 1 m, 0.1 m square, 1 kg
TIMES = np.linspace(0.0, 0.6, 7)
FINE = {"rtol": 1e-10, "min_step": 0.01}


def bricard() -> Scene:
    """Five bars on the edges of a cube and the ground, hinged about y, z, x, y, z, x, let go at rest."""
    names = ["ground", *(f"bar{k}" for k in range(5)), "ground"]
    unit = dict(zip("xyz", np.eye(3), strict=True))
    hinges = [
        Revolute(name=f"J{k}", bodies=(names[k], names[k + 1]), anchor=tuple(p), axis=tuple(unit[axis]))
        for k, (p, axis) in enumerate(zip(POINTS.tolist(), AXES, strict=True))
    ]
    parts = {"joint": hinges, "body": [bar(k) for k in range(5)]}
    return Scene(name="bricard", gravity=(0.0, -9.81, 0.0), duration=TIMES[-1], **parts)


def bar(k: int) -> Body:
    x = POINTS[k + 1] - POINTS[k]
    y = np.roll(x, 1)
    turn = rotations.from_matrix(np.column_stack([x, y, np.cross(x, y)]))
    middle = (POINTS[k] + POINTS[k + 1]) / 2
    return Body(name=f"bar{k}", mass=1.0, inertia=INERTIA, position=middle, orientation=turn)


@functools.cache
def exact() -> Trajectory:
    """The judge's reference, accurate to 1e-14 of the scene's length."""
    return truth_for(bricard()).poses(TIMES)


def test_bricard_s_linkage_has_one_redundant_row_and_one_freedom():
    """Six hinges have 30 rows, of rank 29, on five bodies with 30 coordinates."""
    counts = mbref.counts(bricard())
    assert (counts.rows, counts.rank, counts.degrees_of_freedom) == (30, 29, 1), counts


@pytest.mark.parametrize(
    ("name", "setting", "measured"),  # difference over the scene's length, or in rad
    [
        ("mujoco", Setting("forward", {**FINE, "beta": 10.0, "hard": 1e-7}), 5.4e-10),
        ("pinocchio", Setting("proximal", {"step": 1e-3}), 2.7e-13),
        ("pinocchio", Setting("tuned", FINE), 4.8e-11),
        ("exudyn", Setting("alpha", {"step": 1e-4}), 3e-9),
    ],
)
def test_engine_moves_bricard_s_linkage_as_the_reference(name: str, setting: Setting, measured: float):
    """Ten times the measured difference is allowed."""
    scene = bricard()
    found = engine(name).run(scene, TIMES, setting)
    assert found.outcome is Outcome.COMPLETED, found.message
    apart = error_series(scene, found, exact()).max()
    assert apart < MARGIN * measured, f"{name} {setting} and the reference differ by {apart:.1e}"
