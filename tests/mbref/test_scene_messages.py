"""Messages on faulty scenes, functions of time and variations / sentences and numbers worked out by hand."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from mbref.scene import Driver, Factor, Revolute, Scene, SceneError, Sine
from mbref.scene_paths import replaced_at
from mbref.variation import Variation, variants

ROWS = [[0.0, 0.0], [0.3, 0.4], [0.6, -0.2], [1.0, 0.5]]
DRIVABLE = "revolute, translational, cylindrical"
ZERO = "c0 + amplitude·sin(phase) must be 0, motion is measured from t = 0; got "
START = "the value at t = 0 must be 0, because the motion is measured from its start; got "
DATA: dict[str, Any] = {
    "name": "rig",
    "duration": 1.0,
    "body": [
        {"name": name, "mass": 1.0, "inertia": [1.0, 1.0, 1.0], "position": [float(k), 0.0, 0.0]}
        for k, name in enumerate(("rod", "bar", "cap"), 1)
    ],
    "joint": [
        {
            "name": "A",
            "type": "revolute",
            "bodies": ["ground", "rod"],
            "anchor": [0.0, 0.0, 0.0],
            "axis": [0, 0, 1],
        },
        {
            "name": "B",
            "type": "cylindrical",
            "bodies": ["rod", "bar"],
            "anchor": [1.5, 0.0, 0.0],
            "axis": [1, 0, 0],
        },
        {"name": "C", "type": "spherical", "bodies": ["bar", "cap"], "anchor": [2.5, 0.0, 0.0]},
    ],
    "coupling": [{"name": "G", "joints": ["A", "B"], "coordinates": ["angle", "angle"], "ratio": 2.0}],
    "driver": [{"joint": "A", "polynomial": [0.0, 1.0]}],
    "load": [
        {"type": "moment", "body": "rod", "moment": [0, 0, 1]},
        {"type": "torsion_spring", "joint": "A", "stiffness": 1.0},
        {
            "type": "spring",
            "bodies": ["ground", "cap"],
            "points": [[0, 1, 0], [3, 0, 0]],
            "stiffness": 2.0,
            "natural_length": 1.0,
        },
    ],
}


def faults(*changes: tuple[str, Any]) -> list[str]:
    """Faults of the rig with values at paths such as body.0.mass; None deletes a field."""
    data = copy.deepcopy(DATA)
    for path, value in changes:
        *steps, last = [int(s) if s.isdigit() else s for s in path.split(".")]
        target = data
        for step in steps:
            target = target[step]
        if value is None:
            del target[last]
        else:
            target[last] = value
    with pytest.raises(SceneError) as caught:
        Scene(**data)
    return caught.value.faults


def test_the_rig_has_no_fault():
    assert [coupling.name for coupling in Scene(**DATA).coupling] == ["G"]


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("body.0.name", "bar", "body[1].name: 'bar' is already the name of body[0]"),
        ("joint.1.name", "A", "joint[1].name: 'A' is already the name of joint[0]"),
        ("body.2.name", "ground", "body[ground].name: 'ground' is reserved for the fixed frame"),
        ("body.0.mass", None, "body[rod].mass: is missing; give mass and inertia, or neither (kinematics)"),
        (
            "body.0.inertia",
            None,
            "body[rod].inertia: is missing; give mass and inertia, or neither (kinematics)",
        ),
        ("body.0.mass", 0.0, "body[rod].mass: is 0, but the inertia is not; a massless link has neither"),
        ("joint.0.bodies", ["rod", "rod"], "joint[A].bodies: must be two different bodies, got 'rod' twice"),
        (
            "joint.0.bodies",
            ["ground", "rood"],
            "joint[A].bodies[1]: unknown body 'rood'; known: bar, cap, ground, rod; did you mean 'rod'?",
        ),
        ("joint.0.bodies", ["rod"], "joint[A].bodies: must be two names of bodies, got ['rod']"),
        ("joint.0.anchor", [1.0], "joint[A].anchor: must be three numbers, got [1.0]"),
        ("load.0.body", "ground", "load[0].body: a load cannot act on the ground"),
        ("load.0.body", "Bar", "load[0].body: unknown body 'Bar'; known: bar, cap, rod; did you mean 'bar'?"),
        ("load.1.joint", "D", "load[1].joint: unknown joint 'D'; known: A, B, C"),
        (
            "load.1.joint",
            "C",
            "load[1].joint: 'C' is spherical; only revolute, cylindrical joints can carry a torsion_spring",
        ),
        ("load.2.bodies", ["cap", "cap"], "load[2].bodies: must be two different bodies, got 'cap' twice"),
        (
            "driver.0.joint",
            "C",
            f"driver[C].joint: 'C' is spherical; only {DRIVABLE} joints can be driven",
        ),
        ("driver.0.joint", "D", "driver[D].joint: unknown joint 'D'; known: A, B, C"),
        ("coupling.0.name", "A", "coupling[A].name: 'A' is already the name of a joint"),
        ("coupling.0.joints", ["A", "D"], "coupling[G].joints[1]: unknown joint 'D'; known: A, B, C"),
        (
            "coupling.0.joints",
            ["B", "B"],
            "coupling[G].joints: must be two different coordinates, got the angle of 'B' twice",
        ),
        (
            "coupling.0.coordinates",
            ["displacement", "angle"],
            "coupling[G].joints: 'A' is revolute, which has no displacement to be coupled",
        ),
        (
            "driver.0.polynomial",
            [0.5, 1.0],
            f"driver[A].polynomial: {ZERO}0.5",
        ),
        (
            "driver.0.polynomial",
            [0.0, "3 mm"],
            "driver[A].polynomial[1]: prescribes the angle of a revolute joint, a unit of angle, got '3 mm'",
        ),
        (
            "driver.0.sine",
            {"amplitude": "3 mm"},
            "driver[A].sine.amplitude: prescribes the angle of a revolute joint, a unit of angle, got '3 mm'",
        ),
        (
            "driver.0.sine",
            {"amplitude": 2.0, "phase": 0.5},
            f"driver[A].polynomial: {ZERO}0.958851",
        ),
        (
            "driver.0.table",
            [[0.0, 0.5], *ROWS[1:]],
            f"driver[A].polynomial: {START}0.5",
        ),
        (
            "driver.0.table",
            [[0.1, 0.0], *ROWS[1:]],
            "driver[A].table: leaves a gap: its first row is at 0.1 s, but it acts from 0 s on",
        ),
        (
            "driver.0.table",
            [*ROWS[:3], [0.99, 0.0]],
            "driver[A].table: leaves a gap: its last row is at 0.99 s, but it acts until 1 s",
        ),
        ("driver.0.table", ROWS[:3], "driver[A].table: must have at least 4 rows [time, value], got 3"),
        (
            "driver.0.table",
            [*ROWS[:2], [0.3, 0.0], ROWS[3]],
            "driver[A].table: times must increase, but row 2 is at 0.3 s and row 1 at 0.3 s",
        ),
        (
            "load.0.factor",
            {"sine": {"amplitude": "3 deg"}},
            "load[0].factor.sine.amplitude: multiplies the load, so it has no unit, got '3 deg'",
        ),
        (
            "load.0.factor",
            {"table": ROWS, "stop": 0.5, "start": 0.5},
            "load[0].factor.stop: must be later than start, 0.5 s, got 0.5",
        ),
        (
            "load.0.factor",
            {"table": [*ROWS[:3], [0.8, 0.0]], "stop": 0.9},
            "load[0].factor.table: leaves a gap: its last row is at 0.8 s, but it acts until 0.9 s",
        ),
        (
            "load.0.factor",
            {"table": [[0.2, 0.0], *ROWS[1:]], "start": 0.1},
            "load[0].factor.table: leaves a gap: its first row is at 0.2 s, but it acts from 0.1 s on",
        ),
        ("load.0.moments", [1, 2, 3], "load[0].moments: is not a known field; did you mean 'moment'?"),
        (
            "joint.0.kind",
            "x",
            "joint[A].kind: is not a known field; known: name, bodies, anchor, axis, armature, type",
        ),
        ("joint.2.type", "ball", "joint[C].type: must be one of "),
        ("duration", -1.0, "duration: must be positive, got -1.0"),
        ("body", [], "body: must not be empty"),
    ],
)
def test_a_fault_and_its_message(path, value, message):
    found = faults((path, value))
    assert any(
        fault == message or (message.endswith(" ") and fault.startswith(message)) for fault in found
    ), found


def test_a_second_driver_of_a_joint_and_faults_of_two_fields():
    second = [*DATA["driver"], {"joint": "A", "polynomial": [0.0, 2.0]}]
    assert faults(("driver", second)) == ["driver[1].joint: 'A' already has a driver"]
    both = faults(("body.0.mass", -1.0), ("duration", 0.0))
    assert sorted(fault.partition(":")[0] for fault in both) == ["body[rod].mass", "duration"]


def test_values_at_the_start_that_are_rounding():
    for start, right in ((0.9e-12, True), (1.1e-12, False)):
        data = {**DATA, "driver": [{"joint": "A", "polynomial": [start, 1.0]}]}
        if right:
            assert Scene(**data).driver[0].polynomial[0] == start
        else:
            with pytest.raises(SceneError, match="must be 0"):
                Scene(**data)


# --- functions of time ------------------------------------------------------------------------------------
def test_values_of_a_switched_function():
    """Polynomial, sine and table act from 0.25 s until before 0.75 s."""
    factor = Factor(
        polynomial=(1.0, 2.0, 3.0),
        sine=Sine(amplitude=0.5, frequency=4.0, phase=0.3),
        table=tuple(map(tuple, ROWS)),
        start=0.25,
        stop=0.75,
    )
    t = np.array([0.0, 0.24, 0.25, 0.3, 0.5, 0.74, 0.75, 2.0])
    inside = (t >= 0.25) & (t < 0.75)
    smooth = 1 + 2 * t + 3 * t**2 + 0.5 * np.sin(4 * t + 0.3) + CubicSpline(*zip(*ROWS, strict=True))(t)
    assert factor.values(t) == pytest.approx(np.where(inside, smooth, 0.0), abs=1e-12)
    assert [(piece.begin, piece.part) for piece in factor.pieces()] == [
        (0.0, 0.0),
        (0.25, 1.0),
        (0.3, 1.0),
        (0.6, 1.0),
        (0.75, 0.0),
    ]
    assert factor.pieces()[0].cubic == (0.0,) * 4 and not factor.is_constant


def test_a_driver_s_table_and_what_is_constant():
    driver = Driver(joint="A", table=tuple(map(tuple, ROWS)))
    t = np.linspace(0.0, 1.0, 11)
    assert driver.values(t) == pytest.approx(CubicSpline(*zip(*ROWS, strict=True))(t), abs=1e-13)
    assert not driver.is_constant and Driver(joint="A").is_constant
    assert Driver(joint="A", sine=Sine(amplitude=0.0)).is_constant
    assert not Driver(joint="A", sine=Sine(amplitude=0.1)).is_constant
    assert not Driver(joint="A", polynomial=(0.0, 0.0, 1.0)).is_constant
    assert Factor(polynomial=(3.0,)).is_constant and not Factor(stop=1.0).is_constant and Factor().is_constant
    assert Factor().coefficients == (1.0,) and Factor(sine=Sine(amplitude=1.0)).coefficients == (0.0,)
    assert Factor(table=tuple(map(tuple, ROWS))).coefficients == (0.0,)
    assert Factor(start=0.5).interval == (0.5, math.inf) and Driver(joint="A").interval == (
        -math.inf,
        math.inf,
    )


# --- paths and variations ---------------------------------------------------------------------------------
def test_values_at_paths_are_replaced():
    scene = Scene(**DATA)
    data = {field: getattr(scene, field) for field in Scene.model_fields}
    for path, wanted in (("body[bar].mass", 7.0), ("body[1].mass", 7.0), ("joint[B].anchor[0]", 7.0)):
        changed = Scene(**replaced_at(data, path, lambda _: 7.0))
        assert 7.0 in (changed.body[1].mass, changed.joint[1].anchor[0]), (path, wanted)
        assert changed.body[0] == scene.body[0]
    assert replaced_at(data, "gravity[2]", lambda g: g + 1.0)["gravity"] == (0.0, 0.0, scene.gravity[2] + 1.0)
    driven = replaced_at(data, "driver[A].polynomial[1]", lambda c: 5 * c)
    assert Scene(**driven).driver[0].polynomial == (0.0, 5.0)
    twice = replaced_at(driven, "driver[A].polynomial[1]", lambda c: c + 1.0)
    assert Scene(**twice).driver[0].polynomial == (0.0, 6.0)
    for path, says in (
        ("body[lid].mass", "the scene has no 'lid' there"),
        ("body[3].mass", "the scene has no '3' there"),
        ("body[bar]-mass", "is not a path"),
        ("body[bar].mas", "the scene has no 'mas' there; did you mean 'mass'"),
        ("bodies[0].mass", "is not a path of a scene"),
        ("", "is not a path of a scene"),
    ):
        with pytest.raises(SceneError, match=says):
            replaced_at(data, path, lambda value: value)


def test_variations_of_a_number():
    uniform, normal = Variation.parse(" body[0].mass =1:3"), Variation.parse("gravity[2]=-9.81+-0.5")
    assert uniform == Variation("body[0].mass", 1.0, 3.0) and normal == Variation(
        "gravity[2]", -9.81, 0.5, True
    )
    assert Variation.parse("a=2:2").high == 2.0 and Variation.parse("a=2+-0").high == 0.0
    for text in ("a=3:1", "a=1+--1", "a=1", "a=x:1", "1:2", "a=1:inf", "a=nan+-1"):
        with pytest.raises(ValueError, match=r"LOW"):
            Variation.parse(text)
    random = np.random.default_rng(4)
    drawn = np.array([uniform.draw(random) for _ in range(2000)])
    assert 1.0 <= drawn.min() < 1.01 and 2.99 < drawn.max() <= 3.0
    bell = np.array([normal.draw(random) for _ in range(2000)])
    assert bell.mean() == pytest.approx(-9.81, abs=0.05) and bell.std() == pytest.approx(0.5, rel=0.1)


def test_variants_depend_on_seed_and_place_alone():
    scene, both = (
        Scene(**DATA),
        [Variation("body[0].mass", 1.0, 3.0), Variation("gravity[2]", -9.0, 0.5, True)],
    )
    first, longer = list(variants(scene, both, 3, 5)), list(variants(scene, both, 5, 5))
    assert first == longer[:3] and len({s.body[0].mass for s in longer}) == 5
    assert [s.body[1:] for s in longer] == [scene.body[1:]] * 5
    assert next(variants(scene, both, 1, 6)) != first[0]
    random = np.random.default_rng([5, 1])
    assert first[1].body[0].mass == random.uniform(1.0, 3.0) and first[1].gravity[2] == random.normal(
        -9.0, 0.5
    )
    with pytest.raises(SceneError, match="the scene has no number at this path"):
        list(variants(scene, [Variation("body[0].name", 1.0, 2.0)], 1))
    with pytest.raises(SceneError, match=r"variant 0: body\[rod\]\.mass: must not be negative"):
        list(variants(scene, [Variation("body[0].mass", -2.0, -1.0)], 1))


def test_a_joint_of_the_rig_by_its_class():
    assert Scene(**DATA).joint[0] == Revolute(
        name="A", bodies=("ground", "rod"), anchor=(0.0,) * 3, axis=(0, 0, 1.0)
    )
