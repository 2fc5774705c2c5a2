"""Limits and turns of small functions of mbref / numbers at the limit itself, worked out by hand."""

from __future__ import annotations

import argparse
import contextlib
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import rotations, scene_fields
from mbref.cli import ensemble as command
from mbref.ensembles import ensemble, processes
from mbref.equations import branches, diagnosis
from mbref.equations.packing import Packs
from mbref.scene import Body, Revolute, Scene
from mbref.trajectory import Outcome

BLOCK = Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))


# --- rotations --------------------------------------------------------------------------------------------
def test_rotation_vectors_of_several_quaternions():
    """Turns of 0.8 rad about x, of -0.5 rad about y (with w < 0), of half a turn about z, and none."""
    half, quarter = math.sin(0.4), math.sin(0.25)
    quaternions = [
        [math.cos(0.4), half, 0.0, 0.0],
        [-math.cos(0.25), 0.0, quarter, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0, 0.0],
    ]
    vectors = [[0.8, 0.0, 0.0], [0.0, -0.5, 0.0], [0.0, 0.0, math.pi], [0.0] * 3, [0.0] * 3]
    assert rotations.to_vector(np.array(quaternions)) == pytest.approx(np.array(vectors))
    tiny = rotations.to_vector(np.array([[1.0, 1e-200, 0.0, 0.0]]))
    assert tiny == pytest.approx(np.array([[2e-200, 0.0, 0.0]]), rel=1e-12, abs=0.0)


def test_quaternions_of_half_turns_point_along_the_axis():
    """A half turn about z, by its matrix; of two quaternions that of w ≥ 0 is given."""
    assert rotations.from_matrix(np.diag([-1.0, -1.0, 1.0])).tolist() == [0.0, 0.0, 0.0, 1.0]
    turned = rotations.from_vector(np.array([[0.0, 0.0, 3.5], [0.2, 0.0, 0.0], [0.0, -2.0, 0.0]]))
    again = rotations.from_matrix(rotations.to_matrix(turned))
    assert again == pytest.approx(np.where(turned[:, :1] < 0.0, -turned, turned)) and again.shape == (3, 4)


def test_angles_between_orientations_of_several_samples():
    one = rotations.from_vector(np.array([[0.3, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, -0.5]]))
    assert rotations.angle_between(one, np.array([1.0, 0.0, 0.0, 0.0])) == pytest.approx([0.3, 0.4, 0.5])
    assert rotations.unit([3.0, 4.0]).tolist() == [0.6, 0.8] and rotations.unit([0.0, 0.0]).tolist() == [0, 0]
    product = rotations.cross(np.array([[1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 0], [0, 0, 1]]))
    assert product.tolist() == [[0, 0, 1], [1, 0, 0]] and product.dtype == float


# --- scenes -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("apart", "is_length"), [(1.5e-14, True), (0.5e-14, False)])
def test_points_nearer_than_rounding_give_no_length(apart, is_length):
    """An anchor at 1 m, a few 1e-15 m from the centre of mass."""
    hinge = Revolute(name="A", bodies=("ground", "b"), anchor=(1.0 + apart, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    found = Packs([Scene(name="s", body=(BLOCK,), joint=(hinge,))])
    assert found.length.tolist() == [1.0 + apart - 1.0 if is_length else 1.0]
    assert scene_fields.LARGEST == 1e40 and scene_fields.SMALLEST == 1e-40


def test_frames_and_masses_of_two_bodies():
    """The fixed frame stands at the origin, and is not turned; it has no mass of its own."""
    turned = BLOCK.model_copy(update={"name": "c", "mass": 5.0, "inertia": (2.0, 3.0, 4.0)})
    turned = turned.model_copy(update={"orientation": (0.6, 0.8, 0.0, 0.0), "position": (0.0, 7.0, 0.0)})
    found = Packs([Scene(name="s", body=(BLOCK, turned))])
    assert found.mass.tolist() == [[2.0] * 3 + [1.0] * 3 + [5.0] * 3 + [2.0, 3.0, 4.0]]
    world = np.array([[1.0, 2.0, 3.0]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, -0.28, 0.96], [0.0, -0.96, -0.28]])
    assert found.to_local[0, 2].tolist() == np.eye(3).tolist()
    assert found.to_local[0, 1] == pytest.approx(about_x)
    assert found.points(np.array([2]), world).tolist() == [world.tolist()], "from the origin"
    assert found.start()[0].tolist() == [1, 0, 0, 1, 0, 0, 0, 0, 7, 0, 0.6, 0.8, 0, 0]


# --- branches and ranks -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("u", "v", "given", "expected"),
    [
        ([0.8, 0.61], [0.8 / 0.61], [True], [0.8 / 0.61]),
        ([0.8, 0.6], [2.0], [True], [2.0]),
        ([0.8, -0.61], [1.0], [True], None),
        ([3.0, 4.0, 0.0], [6.0, 9.0], [False, True], [6.75, 9.0]),
        ([3.0, 4.0, 0.0], [7.5, 2.0], [True, False], [3.0, 4.0]),
        ([3.0, 4.0, 0.0], [6.0, -1.0], [True, True], None),
        ([0.6, 0.8, 0.0], [9.0, 9.0], [False, False], [0.6, 0.8]),
        ([0.8, 0.36, 0.48, 0.0], [2.0, 5.0, 5.0], [True, False, False], [2.0, 0.9, 1.2]),
    ],
)
def test_directions_scaled_to_given_velocities(monkeypatch, u, v, given, expected):
    """With SAME = 0.6: the rate of time scales a direction if it is more than 0.6 of its length, given
    entries if their square is more than 0.36; velocities may be off by 0.6 of the largest."""
    monkeypatch.setattr(branches, "SAME", 0.6)
    found = branches._as_given(np.array(u), np.array(v), np.array(given))
    assert (found is None) if expected is None else found == pytest.approx(np.array(expected))


def test_the_rank_of_large_scenes_is_found_in_another_way(monkeypatch):
    model: Any = SimpleNamespace(m=7)
    start: Any = SimpleNamespace(q="q")
    monkeypatch.setattr(diagnosis, "_redundancy", lambda *given: SimpleNamespace(rank=5))
    monkeypatch.setattr(diagnosis, "scaled_jacobian", lambda *given: np.diag([2.0, 1.0, 1e-11]))
    for large, rank in ((6, 5), (7, 2)):
        monkeypatch.setattr(diagnosis, "LARGE", large)
        assert diagnosis.rank_at_start(model, start) == rank
    values = np.array([4.0, 2.0, 1.0])
    assert [diagnosis._count_above(values, t) for t in (0.25, 0.2, 0.5)] == [2, 3, 1]
    assert diagnosis._count_above(np.zeros(0), 0.1) == 0


# --- variants ---------------------------------------------------------------------------------------------
def test_progress_of_an_ensemble(monkeypatch, capsys):
    """Three variants, of which the second one fails; the bar counts the runs that have ended."""
    asked: list[Any] = []

    @contextlib.contextmanager
    def bar(*given: Any):
        asked.append(given)
        yield asked.append

    def ended(outcome: Outcome) -> Any:
        return SimpleNamespace(outcome=outcome, message="why")

    runs = [(2, ended(Outcome.COMPLETED)), (1, ended(Outcome.STEP_FAILED)), (0, ended(Outcome.COMPLETED))]
    scene = Scene(name="s", body=(BLOCK,))
    shown: list[Any] = []
    monkeypatch.setattr(command, "progress_bar", bar)
    monkeypatch.setattr(command, "find_scene", lambda name: scene)
    monkeypatch.setattr(command, "warn", lambda given: None)
    monkeypatch.setattr(command, "sample_times", lambda options, given: np.array([0.0, 2.0]))
    monkeypatch.setattr(command, "limits_of", lambda options: "limits")
    monkeypatch.setattr(command, "_show_spread", lambda *given: shown.append(given))
    monkeypatch.setattr(processes, "processes", lambda workers: contextlib.nullcontext(f"{workers} workers"))
    monkeypatch.setattr(ensemble, "ensemble", lambda *given: asked.append(given[1:]) or iter(runs))
    options = argparse.Namespace(
        scene="s", vary=["body[b].mass=1:2"], count=3, seed=4, workers=2, method="m", out=None, json=False
    )
    assert command._ensemble(options) == 1
    bar_asked, (times, *others), *counts = asked
    assert bar_asked == ("simulating", 3) and counts == [1, 2, 3]
    assert times.tolist() == [0.0, 2.0] and others == ["m", "limits", "2 workers", None]
    assert capsys.readouterr().err == "STEP_FAILED: 1, the first of them variant 1: why\n"
    [(given, end, completed, rate, _)] = shown
    assert given is scene and end == 2.0 and completed == [runs[2][1], runs[0][1]] and rate > 0.0
