"""Equations of many scenes at once / with stand-ins for scenes, and numbers worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from mbref.kernels.scene_layout import Loads, Primitives
from mbref.taylor import batch_equations
from mbref.taylor.numbers import ManyScenes


class Part(NamedTuple):
    """Two arrays of the equations."""

    weight: np.ndarray
    lane: np.ndarray


class Polynomials(NamedTuple):
    """Tables of the equations."""

    rows: Part


def memory(weight: Any = (1.0, 2.0), lane: Any = (3, 4)) -> Any:
    part = Part(np.array(weight), np.array(lane))
    solver = SimpleNamespace(linear=np.array([[5.0, 6.0]]), place=np.array([7]))
    return SimpleNamespace(
        polynomials=Polynomials(part), pose_maps=Part(np.array([8.0]), np.array([9])), solver=solver
    )


@pytest.fixture
def batch(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Call the function for scenes 0 and 2 of three, whose first weights are 1 and 10."""
    asked: dict[str, Any] = {}
    packs = SimpleNamespace(scenes=["a", "b", "c"], length=np.array([1.0, 9.0, 1.2]))
    q = np.arange(21.0).reshape(3, 7)
    q[:, 3:] = 1.0, 0.0, 0.0, 0.0
    target = memory()

    def coordinates(models: Any, pose: Any, moving: Any, driven: Any, of: ManyScenes) -> Any:
        asked["natural"] = (models, pose, moving, driven)
        return of

    def equations(of: ManyScenes) -> Any:
        weight = of.together(asked.get("weights", np.array([[1.0, 2.0], [10.0, 2.0]])))
        part = Part(weight, np.array(asked.get("lane", (3, 4))))
        if asked.get("disagrees"):
            of.agree[1] = False
        return SimpleNamespace(
            polynomials=lambda models: asked.setdefault("models", models) and Polynomials(part),
            pose_maps=Part(np.array([8.0]), np.array([9])),
            tableau=(np.array([[5.0, asked.get("linear", 6.0)]]), np.array([7])),
        )

    monkeypatch.setattr(
        batch_equations, "Models", lambda *given: asked.setdefault("given", given) and "models"
    )
    monkeypatch.setattr(batch_equations, "NaturalCoordinates", coordinates)
    monkeypatch.setattr(batch_equations, "Geometry", equations)

    def call(places: Any = (0, 2), **changes: Any) -> Any:
        asked.update(changes)
        if "length" in changes:
            packs.length[2] = changes["length"]
        found = batch_equations.equations_of_all(packs, q, places, "moving", True, target)  # type: ignore[arg-type]
        return found, asked, target, packs

    return call


def test_numbers_that_differ_between_scenes_of_a_batch(batch):
    """Rows of all three scenes, of which the second one is not in the batch."""
    (varied, alike), asked, target, packs = batch()
    [(array, rows)] = varied
    assert array is target.polynomials.rows.weight and rows.tolist() == [[1.0, 2.0], [0.0, 0.0], [10.0, 2.0]]
    assert alike == [0, 2] and asked["models"] == "models"
    given, places, of = asked["given"]
    assert given is packs and places == (0, 2) and of.agree.size == 2
    models, pose, moving, driven = asked["natural"]
    assert (models, moving, driven) == ("models", "moving", True)
    assert [number.values.tolist() for number in pose.centres[0]] == [[0.0, 14.0], [1.0, 15.0], [2.0, 16.0]]
    assert pose.axes.tolist() == [np.eye(3).tolist()]


def test_an_array_that_all_scenes_share_is_varied_where_memory_has_another(batch):
    (varied, alike), _, target, _ = batch(weights=np.array([[1.0, 2.0], [1.0, 2.0]]), linear=60.0)
    [(array, rows)] = varied
    assert array is target.solver.linear and alike == [0, 2]
    assert rows.tolist() == [[[5.0, 60.0]], [[0.0, 0.0]], [[5.0, 60.0]]]


def test_scenes_of_another_structure_or_unit_of_length_are_left_out(batch):
    """1.2 m and 1 m have the same unit, 1.5 m has another one."""
    assert batch(disagrees=True)[0][1] == [0]
    assert batch(disagrees=False, length=1.5)[0][1] == [0]
    assert batch(length=1.2, lane=(4, 3))[0] == ([], [])
    assert batch(lane=(3, 4), weights=np.zeros((2, 3)))[0] == ([], [])
    assert batch(places=())[0] == ([], [])


def test_a_joint_of_many_scenes():
    """Directions and anchors that differ are numbers of a batch, others are floats."""
    joints = [
        SimpleNamespace(
            facts="facts",
            bodies=("a", "b"),
            directions=((1, 0, k), (0, 1, 0)),
            anchor_pair=((0, k, 2), (3, 4, 5)),
        )
        for k in (6, 7)
    ]
    of = ManyScenes(2)
    found = batch_equations._joint(joints, of)
    assert (found.facts, found.bodies) == ("facts", ("a", "b"))
    (first, second), (here, there) = found.directions, found.anchor_pair
    assert first[2].values.tolist() == [6.0, 7.0] and second.tolist() == [0.0, 1.0, 0.0]
    assert here[1].values.tolist() == [6.0, 7.0] and there.tolist() == [3.0, 4.0, 5.0]
    assert isinstance(found.directions, tuple) and isinstance(found.anchor_pair, tuple)


class Data(NamedTuple):
    """Primitives and loads of scenes."""

    primitives: Primitives
    loads: Loads


def test_numbers_of_loads_and_of_primitives():
    """Forces keep an axis of scenes; other numbers are joined."""
    primitives = Primitives(*(np.array([[1.0, k], [1.0, 2.0 * k]]) for k in range(len(Primitives._fields))))
    loads = Loads(*(np.array([[3.0], [4.0]]) for _ in Loads._fields))
    found = batch_equations._numbers(Data(primitives, loads), ManyScenes(2))  # type: ignore[arg-type]
    assert found.loads.force is loads.force and found.loads.natural[0].values.tolist() == [3.0, 4.0]
    assert found.primitives[0].tolist() == [1.0, 0.0] and found.primitives[3][1].values.tolist() == [3.0, 6.0]


def test_models_of_many_scenes(monkeypatch):
    model = SimpleNamespace(nb=2, index="index", length=1.5, bodies="bodies")
    asked: list[Any] = []
    monkeypatch.setattr(batch_equations, "Model", lambda *given: asked.append(given) or model)
    monkeypatch.setattr(batch_equations, "_joint", lambda joints, of: (*joints, of))
    monkeypatch.setattr(batch_equations, "row_of", lambda data, places: (data, places))
    monkeypatch.setattr(batch_equations, "_numbers", lambda data, of: (*data, of))
    packs: Any = SimpleNamespace(
        scenes=["a", "b", "c"],
        joints=[["J0", "K0"], ["J1", "K1"], ["J2", "K2"]],
        to_local=np.array([[1.0], [2.0], [3.0]]),
        data="data",
    )
    of = ManyScenes(2)
    found = batch_equations.Models(packs, [2, 1], of)
    assert asked == [("c", packs, 2)] and found.joints == [("J2", "J1", of), ("K2", "K1", of)]
    assert (found.nb, found.index, found.length, found.bodies) == (2, "index", 1.5, "bodies")
    assert found.data == ("data", [2, 1], of) and found.to_local[0].values.tolist() == [3.0, 2.0]
    with pytest.raises(ValueError, match="zip"):
        batch_equations.Models(
            SimpleNamespace(**{**vars(packs), "joints": [["J"], ["J", "K"], []]}), [0, 1], of
        )  # type: ignore[arg-type]
