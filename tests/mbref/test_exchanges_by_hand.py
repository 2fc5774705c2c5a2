"""Parts of mbref.design.exchange / rows and dependences worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.design import exchange
from mbref.design.exchange import REMOVED, Weaker
from mbref.scene import (
    JOINT_TYPES,
    Body,
    Coupling,
    Driver,
    Revolute,
    Scene,
    SlideSpring,
    TorsionSpring,
    Translational,
)

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
FIRST, SECOND = [1.0, 0.0], [0.0, 1.0]


def losing(*lost: list[float]) -> Weaker:
    """A weaker type that lacks these components of the dependences."""
    return Weaker(np.zeros((0, 6)), np.array(lost))


@pytest.mark.parametrize(
    ("lost", "keeps"),
    [
        ([FIRST, SECOND], True),
        ([FIRST, [2.0, 0.0]], False),
        ([FIRST, [0.0, 1e-6]], False),
        ([FIRST, [0.0, math.nextafter(1e-6, 1.0)]], True),
        ([FIRST, SECOND, [1.0, 1.0]], False),
    ],
)
def test_lost_rows_that_keep_the_rank(lost, keeps):
    assert exchange._keep_rank(np.array(lost)) == keeps


def test_the_smallest_exchanges():
    """Two dependences: one joint that loses both is enough; otherwise two joints that lose one each."""
    choices = {
        "A": {"x": losing(FIRST), REMOVED: losing(FIRST, SECOND)},
        "B": {"y": losing(SECOND)},
        "C": {"z": losing([2.0, 0.0])},
    }
    pairs = [{"A": "x", "B": "y"}, {"B": "y", "C": "z"}]
    assert list(exchange._of_size(choices, 2, 1)) == [{"A": REMOVED}]
    assert list(exchange._of_size(choices, 2, 2)) == pairs
    assert exchange._smallest(choices, 2, 6) == [{"A": REMOVED}]
    kept = {**choices, "A": {"x": losing(FIRST)}}
    assert exchange._smallest(kept, 2, 6) == pairs and exchange._smallest(kept, 2, 1) == pairs[:1]
    assert exchange._smallest({"A": {"x": losing(FIRST)}, "B": {}}, 2, 6) == []
    assert exchange._smallest({"A": {"x": losing(FIRST)}, "C": choices["C"]}, 2, 6) == []


def test_at_most_four_joints_are_exchanged_at_once():
    axes = np.eye(5)
    choices = {f"J{k}": {"w": Weaker(np.zeros((0, 6)), axes[k : k + 1])} for k in range(5)}
    assert exchange._smallest(choices, 5, 6) == []
    assert exchange._joint_by_joint(choices, 5) == {f"J{k}": "w" for k in range(5)}
    four = {f"J{k}": {"w": Weaker(np.zeros((0, 6)), axes[k : k + 1, :4])} for k in range(4)}
    assert exchange._smallest(four, 4, 6) == [{f"J{k}": "w" for k in range(4)}]


@pytest.mark.parametrize(
    ("choices", "found"),
    [
        ({"A": {"x": losing(FIRST)}, "B": {"y": losing(SECOND)}}, {"A": "x", "B": "y"}),
        ({"A": {"x": losing(FIRST)}, "B": {"y": losing(FIRST, SECOND)}}, {"B": "y"}),
        ({"B": {REMOVED: losing(SECOND)}, "A": {"x": losing(FIRST)}}, {"B": REMOVED, "A": "x"}),
        ({"A": {REMOVED: losing(FIRST, SECOND)}, "B": {"y": losing(SECOND)}}, None),
        ({"A": {"x": losing(FIRST), "y": losing(SECOND)}}, None),
        ({"A": {"x": losing(FIRST)}, "C": {"z": losing([3.0, 0.0])}, "B": {"y": losing(SECOND)}}, "AB"),
        ({}, None),
    ],
)
def test_exchanges_joint_by_joint(choices, found):
    """The type that loses most comes first, removal last; a joint is exchanged once."""
    expected = {"A": "x", "B": "y"} if found == "AB" else found
    made = exchange._joint_by_joint(choices, 2)
    assert made == expected and list(made or ()) == list(expected or ())


def test_cures_have_independent_rows_of_equal_rank():
    rows = {"A": np.array([FIRST, FIRST]), "B": np.array([SECOND])}
    choices = {
        "A": {
            "x": Weaker(np.array([FIRST]), np.zeros((1, 1))),
            "none": Weaker(np.zeros((0, 2)), np.zeros((2, 1))),
        }
    }
    assert exchange._is_cure(rows, choices, {"A": "x"})
    assert not exchange._is_cure(rows, choices, {"A": "none"}), "a rank is lost"
    assert not exchange._is_cure(rows, choices, {}), "three rows of rank two"


def test_dependences_of_rows_and_the_rows_that_a_weaker_type_lacks():
    rows = {"A": np.array([FIRST, FIRST]), "B": np.array([SECOND])}
    found, number = exchange._dependences(rows)
    assert number == 1 and list(found) == ["A", "B"]
    assert found["A"][0] == pytest.approx(-found["A"][1]) and abs(found["A"]) == pytest.approx(
        np.full((2, 1), math.sqrt(0.5))
    )
    assert found["B"] == pytest.approx(np.zeros((1, 1)), abs=1e-15)
    dependences = np.array([[0.5, 2.0, 1.0], [0.25, -1.0, 3.0]])
    lost = exchange._weaker(np.array([[0.0, 2.0]]), np.diag([4.0, 1.0]), dependences)
    assert lost.rows.tolist() == [[0.0, 2.0]] and abs(lost.lost) == pytest.approx(abs(dependences[:1]))
    nothing = exchange._weaker(np.zeros((0, 2)), np.eye(2), dependences)
    assert nothing.lost.shape == (2, 3)
    assert abs(np.linalg.det(nothing.lost[:, :2])) == pytest.approx(1.0), "0.5 · -1 - 2 · 0.25"


def hinge(name: str, **fields: Any) -> Revolute:
    return Revolute(name=name, bodies=("ground", f"b{name}"), anchor=(0.0, 0.0, 0.0), axis=Z, **fields)


def test_types_that_bear_what_acts_on_a_joint():
    """A driver, an armature and a coupling without coordinates need the driven coordinate of the type."""
    slide = Translational(name="S", bodies=("ground", "bS"), anchor=(0.0, 0.0, 0.0), axis=X)
    joints = (*map(hinge, "PDLCEFG"), hinge("M", armature=0.5), slide)
    scene = Scene(
        name="types",
        body=tuple(Body(name=f"b{joint.name}", position=(1.0, 0.0, 0.0)) for joint in joints),
        joint=joints,
        driver=(Driver(joint="D", polynomial=(0.0, 1.0)),),
        load=(TorsionSpring(joint="L", stiffness=1.0), SlideSpring(joint="S", stiffness=1.0)),
        coupling=(
            Coupling(name="c", joints=("C", "E"), ratio=2.0),
            Coupling(name="f", joints=("F", "G"), ratio=2.0, coordinates=("angle", "angle")),
        ),
    )
    turning = ["revolute", "cylindrical"]
    assert exchange._bearing(scene, "P") == list(JOINT_TYPES)
    for name in "DLCEM":
        assert exchange._bearing(scene, name) == turning, name
    assert exchange._bearing(scene, "F") == exchange._bearing(scene, "G") == [*turning, "planar"]
    assert exchange._bearing(scene, "S") == ["translational", "cylindrical"]


class Chain:
    """A scene of joints by name and type; without drivers and loads, or at another pose, it has that mark."""

    def __init__(self, joints: dict[str, str], mark: str = "scene") -> None:
        self.joint, self.mark = [SimpleNamespace(name=n, type=t) for n, t in joints.items()], mark
        self.given: dict[str, Any] = {}

    def assembled(self) -> Chain:
        return self

    def joint_named(self, name: str) -> Any:
        return next(joint for joint in self.joint if joint.name == name)

    def with_(self, **given: Any) -> Chain:
        made = Chain({}, f"{self.mark} without {' '.join(key for key in given if not given[key])}")
        made.given, made.joint = given, list(given.get("joint", self.joint))
        return made


@pytest.mark.parametrize(
    ("kept", "every", "by_joint", "found"),
    [
        ([{"A": "x"}], [{"A": "x"}, {"A": REMOVED}], {"C": "z"}, [{"A": "x"}, {"A": REMOVED}]),
        ([], [{"A": "x"}], {"C": "z"}, [{"C": "z"}]),
        ([], [], None, []),
        ([{"A": "bad"}, {"C": "z"}], [], None, [{"C": "z"}]),
    ],
)
def test_exchanges_of_a_scene(monkeypatch, kept, every, by_joint, found):
    """Joints whose rows have a weight of more than 1e-6 take part; sets without removals come first."""
    scene = Chain({"A": "revolute", "B": "fixed", "C": "planar"})
    dependences = {"A": np.array([[0.0], [1.0]]), "B": np.array([[1e-6]]), "C": np.array([[2e-6], [0.0]])}
    choices = {"A": {"x": 1, REMOVED: 2}, "C": {"z": 3}}
    asked: list[Any] = []

    def chosen(of: Any, model: Any, rows: Any, names: Any) -> Any:
        asked.append((of.mark, model.scene.mark, rows, list(names)))
        return choices

    def smallest(of: Any, number: int, most: int) -> list[Any]:
        assert (number, most) == (7, 5)
        return kept if REMOVED not in of["A"] else every

    monkeypatch.setattr(exchange, "Model", lambda of: SimpleNamespace(scene=of, m=1))
    monkeypatch.setattr(exchange, "without_armatures", lambda of: of)
    monkeypatch.setattr(exchange, "general_pose", lambda model: f"pose of {model.scene.mark}")
    monkeypatch.setattr(exchange, "placed", lambda model, q: Chain({"A": "", "B": "", "C": ""}, f"at {q}"))
    monkeypatch.setattr(exchange, "_rows", lambda model: {"rows": model.scene.mark})
    monkeypatch.setattr(exchange, "_dependences", lambda rows: (dependences, 7))
    monkeypatch.setattr(exchange, "_choices", chosen)
    monkeypatch.setattr(exchange, "_smallest", smallest)
    monkeypatch.setattr(exchange, "_joint_by_joint", lambda of, number: by_joint)
    monkeypatch.setattr(exchange, "_is_cure", lambda rows, of, made: made != {"A": "bad"} and of == choices)
    assert exchange.exchanges(scene, 5) == found  # type: ignore[arg-type]
    place = "at pose of scene without driver load"
    assert asked == [("scene", place, {"rows": place}, ["A", "C"])]


def test_choices_of_weaker_types(monkeypatch):
    """A bears all types and may be removed, B only some; a type whose rows change the rank is left out."""
    scene = Chain({"A": "translational", "B": "revolute", "D": "distance"})
    at_pose = SimpleNamespace(
        scene=Chain({"A": "translational", "B": "revolute", "D": "distance"}, "at pose")
    )
    bearing = {"A": list(JOINT_TYPES), "B": ["cylindrical", "spherical"], "D": list(JOINT_TYPES)[1:]}
    rows = {name: np.full((2, 3), float(k)) for k, name in enumerate("ABD")}
    names = {name: np.full((2, 1), float(k)) for k, name in enumerate("ABD")}
    seen: dict[str, Any] = {}

    def rows_of(model: Any) -> dict[str, Any]:
        kinds = {joint.name: joint.type for joint in model.scene.joint}
        assert model.scene.mark == "at pose without coupling"
        seen[",".join(kinds.values())] = kinds
        return {name: f"{name} {kind}" for name, kind in kinds.items()}

    def weaker(of: Any, own: Any, dependences: Any) -> Weaker:
        text: Any = of if isinstance(of, str) else f"removed {of.shape}"
        keeps = text != "A planar"
        return Weaker(text, np.array([own[0, 0], dependences[0, 0], keeps]))

    monkeypatch.setattr(exchange, "_bearing", lambda of, name: bearing[name] if of is scene else None)
    monkeypatch.setattr(exchange, "Model", lambda of: SimpleNamespace(scene=of))
    monkeypatch.setattr(exchange, "_rows", rows_of)
    monkeypatch.setattr(exchange, "_weaker", weaker)
    monkeypatch.setattr(exchange, "_keep_rank", lambda lost: bool(lost[2]))
    monkeypatch.setattr(exchange, "_as", lambda joint, kind: SimpleNamespace(name=joint.name, type=kind))
    found = exchange._choices(scene, at_pose, rows, names)  # type: ignore[arg-type]
    listed = {name: {kind: one.rows for kind, one in kinds.items()} for name, kinds in found.items()}
    assert listed == {
        "A": {"cylindrical": "A cylindrical", "inline": "A inline", REMOVED: "removed (0, 3)"},
        "B": {"cylindrical": "B cylindrical", "spherical": "B spherical"},
        "D": {},
    }
    assert [list(kinds) for kinds in found.values()] == [list(kinds) for kinds in listed.values()]
    assert found["B"]["spherical"].lost.tolist() == [1.0, 1.0, 1.0]
    assert found["A"][REMOVED].lost.tolist() == [0.0, 0.0, 1.0]
    assert "cylindrical,cylindrical,distance" in seen and "translational,spherical,distance" in seen


@pytest.mark.parametrize(
    ("kind", "axis", "across"),
    [("universal", (0.0, 3.0, 4.0), (0.0, 4.0, -3.0)), ("universal", (2.0, 0.0, 1.0), (-1.0, 0.0, 2.0))],
)
def test_a_joint_as_a_universal_joint(kind, axis, across):
    """The second axis is across the first and the coordinate axis that is farthest from it."""
    joint = Revolute(name="A", bodies=("a", "b"), anchor=(1.0, 2.0, 3.0), axis=axis)
    made: Any = exchange._as(joint, kind)
    assert made.type == kind and made.axes == (axis, across) and made.anchor == (1.0, 2.0, 3.0)
    ball = JOINT_TYPES["spherical"].at("B", ("a", "b"), anchor=(1.0, 0.0, 0.0))
    assert exchange._as(ball, "inline").directions == ((0.0, 0.0, 1.0),)
