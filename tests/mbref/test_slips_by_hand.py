"""Probable mistakes in scenes, mbref.scene_slips / axes and links of four bodies worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import scene_slips

ZERO = (0.0, 0.0, 0.0)
X, Y, Z, TILTED = (1.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.0, 1.0)
LOOP = ("ground a", "a b", "b c", "c ground", "d ground")


def scene(axes: Any, pairs: Any = LOOP, heights: Any = (0.0, 0.0, 0.0, 0.0, 0.0), kinds: Any = ()) -> Any:
    """Hinges A, B, … between bodies, 1 m apart along x, with anchors at these heights (m)."""
    joints = [
        SimpleNamespace(
            name="ABCDE"[k],
            type=kinds[k] if kinds else "revolute",
            directions=(axis,),
            bodies=tuple(pairs[k].split()),
            anchor_pair=((float(k), 0.0, heights[k]),) * 2,
        )
        for k, axis in enumerate(axes)
    ]
    named = {joint.name: joint for joint in joints}
    return SimpleNamespace(
        joint=joints,
        body=[SimpleNamespace(name="a", position=(0.5, 0.0, 0.0))],
        joint_named=named.__getitem__,
    )


@pytest.mark.parametrize(
    ("made", "named"),
    [
        (scene([Z, Z, Z, X]), "D"),
        (scene([X, Z, Z, Z]), "A"),
        (scene([Z, Z, Z, Z, X]), ""),
        (scene([Z, Z, Z, Z, X], (*LOOP[:4], "c ground")), "E"),
        (scene([Z, Z, X, X]), ""),
        (scene([Z, Z, Z, Z]), ""),
        (scene([Z, Z, Z, X, TILTED]), ""),
        (scene([X, Y, Z, Z, Z]), ""),
        (scene([Z, Z, Z, X], heights=(0.0, 0.0, 0.0, 1e-3)), ""),
        (scene([Z, Z, Z, X, Y], (*LOOP[:4], "c ground")), "D E"),
        (scene([Z, Z, Z, X], kinds=("revolute", "revolute", "revolute", "inline")), ""),
        (scene([Z, X], ("ground a", "a ground")), ""),
        (scene([Z, Z, X], ("ground a", "a b", "b c")), ""),
        (scene([]), ""),
    ],
)
def test_hinges_whose_axes_lie_in_the_plane(made, named):
    """Most hinges of a flat mechanism are across its plane; a hinge outside of loops may lie in it."""
    says = "lies in the plane of the mechanism; other axes are across it"
    assert list(scene_slips._axes(made)) == [f"joint[{name}].axis: {says}" for name in named.split()]


def test_joints_in_loops():
    made = scene([Z] * 5, ("ground a", "a b", "b ground", "b c", "d e"))
    assert [scene_slips._is_in_loop(made, name) for name in "ABCDE"] == [True, True, True, False, False]


def test_cosines_and_planes_at_their_limits():
    assert not scene_slips._is_zero(1e-6) and scene_slips._is_zero(math.nextafter(1e-6, 0.0))
    assert not scene_slips._is_one(1 - 1e-6) and scene_slips._is_one(math.nextafter(1 - 1e-6, 2.0))
    assert scene_slips._unit((0.0, 3.0, 4.0)) == pytest.approx([0.0, 0.6, 0.8])
    for height, flat in ((1e-6, True), (math.nextafter(1e-6, 1.0), False)):
        assert scene_slips._is_flat(scene([Z, Z], heights=(0.0, height)), np.array([0.0, 0.0, 1.0])) == flat
    for height, flat in ((2e-6, True), (math.nextafter(2e-6, 1.0), False)):
        longer = scene([Z, Z, Z], heights=(0.0, height, 0.0))
        assert scene_slips._is_flat(longer, np.array([0.0, 0.0, 1.0])) == flat, "2 m long"
    assert scene_slips._size(scene([Z, Z, Z], heights=(0.0, 5.0, 1.0))) == 5.0


def driver(joint: str, polynomial: Any = (0.0,), **sine: float) -> Any:
    values = lambda times: np.polynomial.polynomial.polyval(times, np.array(polynomial))  # noqa: E731
    made = SimpleNamespace(**{"amplitude": 1.0, "phase": 0.0, **sine}) if sine else None
    return SimpleNamespace(joint=joint, polynomial=polynomial, sine=made, values=values)


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("angle", driver("A", (0.0, 90.0)), "polynomial: 90 rad/s is 14.3 turns a second; is it in degrees?"),
        ("angle", driver("A", (0.0, -180.0)), "polynomial: -180 rad/s is -28.6 turns a second"),
        ("angle", driver("A", (0.0, 91.0)), ""),
        ("angle", driver("A", (90.0,)), ""),
        ("angle", driver("A", (0.0, 0.0)), ""),
        ("displacement", driver("A", (0.0, 90.0)), ""),
        ("angle", driver("A", phase=6.3), "sine.phase: 6.3 rad is more than a turn; is it in degrees?"),
        ("displacement", driver("A", phase=-6.3), "sine.phase: -6.3 rad is more than a turn"),
        ("angle", driver("A", phase=2 * math.pi), ""),
        ("angle", driver("A", amplitude=-7.0), "sine.amplitude: -7 rad is more than a turn"),
        ("angle", driver("A", amplitude=2 * math.pi), ""),
        ("displacement", driver("A", amplitude=7.0), ""),
    ],
)
def test_angles_of_drivers(kind, given, says):
    facts = SimpleNamespace(facts=SimpleNamespace(driven=kind))
    made: Any = SimpleNamespace(load=[], driver=[given], joint_named=lambda name: facts)
    found = list(scene_slips._angles(made))
    assert len(found) == bool(says) and all(each.startswith(f"driver[A].{says}") for each in found)


def test_angles_of_springs():
    loads = [
        SimpleNamespace(type="torsion_spring", natural_angle=angle)
        for angle in (0.5, -7.0, 2 * math.pi, math.nextafter(2 * math.pi, 7.0))
    ]
    made: Any = SimpleNamespace(load=[SimpleNamespace(type="force"), *loads], driver=[])
    says = "rad is more than a turn; is it in degrees?"
    assert list(scene_slips._angles(made)) == [
        f"load[2].natural_angle: -7 {says}",
        f"load[4].natural_angle: 6.28319 {says}",
    ]


@pytest.mark.parametrize(
    ("kind", "polynomial", "says"),
    [
        ("angle", (0.0, 50.0), ""),
        ("angle", (0.0, -50.5), "turns the joint by 101 rad, 16.1 turns, within 2 s; is it in degrees?"),
        ("angle", (0.0, 400.0, -200.0), "turns the joint by 200 rad, 31.8 turns, within 2 s"),
        ("displacement", (0.0, 60.0), ""),
    ],
)
def test_drivers_that_turn_many_times(kind, polynomial, says):
    """The third driver turns forth by 200 rad and back within the 2 s; 100 rad are the limit."""
    facts = SimpleNamespace(facts=SimpleNamespace(driven=kind))
    made: Any = SimpleNamespace(
        duration=2.0, driver=[driver("A", polynomial)], joint_named=lambda name: facts
    )
    found = list(scene_slips._far_drivers(made))
    assert len(found) == bool(says) and all(
        each.startswith(f"driver[A].polynomial: {says}") for each in found
    )


def test_scenes_without_joints_and_strong_gravity():
    bodies = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
    alone: Any = SimpleNamespace(joint=(), body=bodies)
    assert list(scene_slips._no_joints(alone)) == ["joint: there is none, so nothing connects a, b"]
    alone.joint = (1,)
    assert list(scene_slips._no_joints(alone)) == []
    heavy: Any = SimpleNamespace(gravity=(60.0, 0.0, 80.0))
    assert list(scene_slips._gravity(heavy)) == []
    heavy.gravity = (0.0, -981.0, 0.0)
    says = "gravity: 981 m/s² is 100 times the earth's; is it in mm/s²?"
    assert list(scene_slips._gravity(heavy)) == [says]


def test_gravity_above_the_limit():
    heavy: Any = SimpleNamespace(gravity=(0.0, 0.0, math.nextafter(100.0, 200.0)))
    assert len(list(scene_slips._gravity(heavy))) == 1


def test_values_of_drivers_are_computed_at_101_times():
    seen: list[np.ndarray] = []
    facts = SimpleNamespace(facts=SimpleNamespace(driven="angle"))
    given = SimpleNamespace(joint="A", values=lambda times: seen.append(times) or np.zeros(1))
    made: Any = SimpleNamespace(duration=2.0, driver=[given], joint_named=lambda name: facts)
    assert list(scene_slips._far_drivers(made)) == []
    assert seen[0] == pytest.approx(0.02 * np.arange(101))


def test_distances_between_the_joints_of_bodies():
    """Body b has three joints, c only one; the joints of a distance have two anchors."""
    places = {
        "A": ("ground a", ZERO, ZERO),
        "B": ("a b", (3.0, 0.0, 0.0), (3.0, 0.0, 0.0)),
        "C": ("b ground", (3.0, 4.0, 0.0), (6.0, 8.0, 0.0)),
        "D": ("b c", (3.0, 0.0, 12.0), (3.0, 0.0, 1.0)),
    }
    joints = [
        SimpleNamespace(name=name, bodies=tuple(pair.split()), anchor_pair=ends)
        for name, (pair, *ends) in places.items()
    ]
    made: Any = SimpleNamespace(joint=joints, body=[SimpleNamespace(name=name) for name in "abc"])
    assert scene_slips.link_lengths(made) == {
        "a": {"A–B": 3.0},
        "b": {"B–C": 4.0, "B–D": 12.0, "C–D": pytest.approx(math.hypot(4.0, 12.0))},
        "ground": {"A–C": 10.0},
    }


@pytest.mark.parametrize(
    ("mass", "inertia", "said"),
    [
        (2.0, (0.0, 7200.0, 7200.0), False),
        (2.0, (0.0, 7201.0, 7201.0), True),
        (2.0, ((7201.0, 0.0, 0.0), (0.0, 7201.0, 9.0), (0.0, 9.0, 0.0)), True),
        (2.0, ((7200.0, 0.0, 0.0), (0.0, 7200.0, 9.0), (0.0, 9.0, 0.0)), False),
        (0.0, (0.0, 7201.0, 7201.0), False),
        (None, (0.0, 7201.0, 7201.0), False),
        (2.0, None, False),
    ],
)
def test_inertias_of_a_mechanism_of_two_metres(mass, inertia, said):
    """√(14400 / 2 / 2) m is 30 times 2 m, the largest radius of gyration that is no mistake."""
    body = SimpleNamespace(name="a", mass=mass, inertia=inertia, position=(0.0, 0.5, 2.0))
    joint = SimpleNamespace(anchor_pair=(ZERO, (1.0, 0.0, 0.0)))
    made: Any = SimpleNamespace(body=[body], joint=[joint])
    says = "body[a].inertia: suits a body 60 m across, the mechanism measures 2 m; is it in kg m²?"
    assert list(scene_slips._inertias(made)) == [says] * said
    body.position, joint.anchor_pair = ZERO, (ZERO, ZERO)
    assert list(scene_slips._inertias(made)) == []


def test_a_mechanism_that_is_as_small_as_rounding_has_no_size(monkeypatch):
    """Points at 1 m and 2 m, of which half of 2 m counts as rounding."""
    monkeypatch.setattr(scene_slips, "COINCIDENT", 0.5)
    body = SimpleNamespace(name="a", mass=1.0, inertia=(1e6, 1e6, 1e6), position=(1.0, 0.0, 0.0))
    made: Any = SimpleNamespace(body=[body], joint=[SimpleNamespace(anchor_pair=((2.0, 0.0, 0.0),) * 2)])
    assert list(scene_slips._inertias(made)) == []
    body.position = (0.75, 0.0, 0.0)
    assert len(list(scene_slips._inertias(made))) == 1
