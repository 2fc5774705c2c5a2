"""Private functions that find faults of scenes and functions of time; sentences worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref import scene_function_faults as function_faults
from mbref import scene_validation as validation
from mbref.scene import Body, Revolute


@pytest.mark.parametrize(
    ("location", "path"),
    [
        ((), "scene"),
        (("gravity",), "gravity"),
        (("body", 2, "mass"), "body[2].mass"),
        (("body", 2, "position", 1), "body[2].position[1]"),
        (("joint", 0, "revolute", "axis", 1), "joint[0].axis[1]"),
        (("joint", 0, "revolute"), "joint[0]"),
        (("load", 3, "spring", "points", 0, 1), "load[3].points[0][1]"),
        (("load", 3), "load[3]"),
        (("joint", 3, 4), "joint[3][4]"),
        (("driver", 0, "sine", "phase"), "driver[0].sine.phase"),
    ],
)
def test_paths_of_locations(location, path):
    assert validation._path(location) == path


@pytest.mark.parametrize(
    ("location", "says"),
    [
        (("body", 0, "position"), "must be three numbers, got 7"),
        (("joint", 0, "revolute", "bodies"), "must be two names of bodies, got 7"),
        (("joint", 0, "distance", "anchors"), "must be two points of three numbers each, got 7"),
        (("joint", 0, "universal", "axes"), "must be two axes of three numbers each, got 7"),
        (("load", 0, "spring", "points"), "must be two points of three numbers each, got 7"),
        (("driver", 0, "table", 2), "must be a time and a value, got 7"),
        (("load", 0, "joint_force", "factor", "table", 2), "must be a time and a value, got 7"),
        (("driver", 0, "table", "bodies"), "must be two names of bodies, got 7"),
        (("joint", 0, "distance", "anchors", 1), "must be three numbers, got 7"),
        (("coupling",), "must be entries [[coupling]], got 7"),
        (("load",), "must be entries [[load]], got 7"),
        (("coupling", 0, "joints"), "must be two names of joints, got 7"),
        (("coupling", 0, "coordinates"), 'must be two of "angle" and "displacement", got 7'),
        (("driver", 0, "polynomial"), "must be numbers, such as [0.0, 6.0], got 7"),
        ((), "must be three numbers, got 7"),
    ],
)
def test_what_a_list_must_hold(location, says):
    assert validation._must_hold(location, "7") == says


def test_tables_and_quaternions_must_hold():
    table = validation._must_hold(("driver", 0, "table"), "7")
    assert table.startswith("must be rows of time and value, such as [[0.0, 0.0], [0.5, 1.0]")
    text = "must be four numbers (w, x, y, z), for an angle φ about z cos(φ/2), 0, 0, sin(φ/2), got 7"
    assert validation._must_hold(("body", 0, "orientation"), "7") == text


@pytest.mark.parametrize(
    ("location", "says"),
    [
        (("joint", 0, "revolute", "axsi"), "; did you mean 'axis'?"),
        (("joint", 0, "fixed", "q"), "; known: name, bodies, anchor, type"),
        (("body", 0, "masss"), "; did you mean 'mass'?"),
        (("body", 0, "zzz"), "; known: mass, inertia"),
        (("gravty",), "; did you mean 'gravity'?"),
        (("other", 0, "zzz"), "; known: "),
    ],
)
def test_fields_that_were_probably_meant(location, says):
    tables = {"body": ("mass", "inertia"), "": ("gravity", "body")}
    assert validation._meant_field(location, tables) == says


def fault(kind: str, location: tuple[Any, ...], given: Any = 7, **context: Any) -> dict[str, Any]:
    return {"type": kind, "loc": location, "input": given, "msg": "Input is Wrong", "ctx": context}


@pytest.mark.parametrize(
    ("found", "says"),
    [
        (fault("missing", ("body", 0, "name")), ("body[0].name", "is required")),
        (
            fault("missing", ("body", 0, "position", 2), (1, 2)),
            ("body[0].position", "must be three numbers, got (1, 2)"),
        ),
        (
            fault("missing", ("joint", 0, "revolute", "bodies", 1), ("a",)),
            ("joint[0].bodies", "must be two names of bodies, got ('a',)"),
        ),
        (fault("missing", ("name",)), ("name", "is required")),
        (fault("extra_forbidden", ("mas",)), ("mas", "is not a known field; did you mean 'mass'?")),
        (fault("greater_than", ("duration",), -1), ("duration", "must be positive, got -1")),
        (fault("greater_than_equal", ("mass",), -1), ("mass", "must not be negative, got -1")),
        (fault("finite_number", ("mass",), math.inf), ("mass", "must be finite, got inf")),
        (fault("float_type", ("mass",), "x"), ("mass", "must be a number, got 'x'")),
        (fault("string_type", ("name",)), ("name", "must be a string, got 7")),
        (fault("string_too_short", ("name",), ""), ("name", "must not be empty")),
        (fault("too_short", ("body",), ()), ("body", "must not be empty")),
        (fault("too_short", ("body",), (1,)), None),
        (fault("tuple_type", ("body",)), ("body", "must be entries [[body]], got 7")),
        (fault("too_long", ("gravity",), 8), ("gravity", "must be three numbers, got 8")),
        (fault("union_tag_not_found", ("joint", 0)), ("joint[0].type", "is required")),
        (
            fault("union_tag_invalid", ("joint", 0), tag="fixd", expected_tags="'fixed', 'planar'"),
            ("joint[0].type", "must be one of 'fixed', 'planar', got 'fixd'; did you mean 'fixed'?"),
        ),
        (
            fault("literal_error", ("ground",), expected="'frame' or 'body'"),
            ("ground", "must be 'frame' or 'body', got 7"),
        ),
        (fault("model_type", ("body", 0)), ("body[0]", "must be a table")),
        (fault("model_attributes_type", ("joint", 0)), ("joint[0]", "must be a table")),
        (fault("value_error", ("mass",), error=ValueError("is odd")), ("mass", "is odd")),
        (fault("value_error", ("mass",)), ("mass", "")),
        (fault("another", ("mass",)), ("mass", "input is Wrong, got 7")),
    ],
)
def test_faults_of_fields(found, says):
    error: Any = SimpleNamespace(errors=lambda include_url: [] if include_url else [found])
    assert list(validation.field_faults(error, {"": ("mass", "name")})) == ([says] if says else [])


@pytest.mark.parametrize(
    ("names", "place", "own"),
    [
        (["a", "b"], 1, "b"),
        (["a", "a"], 1, ""),
        (["a", "b"], 2, ""),
        (["a", ""], 1, ""),
        (["7", "b"], 0, ""),
        (["a[", "b"], 0, ""),
        (["a]", "b"], 0, ""),
        (["a" * 79, "b"], 0, "a" * 79),
        (["a" * 80, "b"], 0, ""),
    ],
)
def test_own_names(names, place, own):
    entries = [{"name": name, "joint": f"J{name}"} for name in names]
    assert validation._own_name({"body": entries}, "body", place) == own
    if own:
        assert validation._own_name({"driver": entries}, "driver", place) == f"J{own}"[:79] or len(own) == 79


def test_named_paths():
    """Names replace indices of bodies, joints, couplings and drivers only."""
    data = {
        "body": [{"name": "rod"}, Body(name="bar", position=(0.0, 0.0, 0.0))],
        "joint": ({"name": "A"},),
        "coupling": [{"name": "gear"}],
        "driver": [{"joint": "A", "name": "no"}],
        "load": [{"name": "spring"}],
    }
    faults = {
        "body[0].mass": "a",
        "body[1].mass": "b",
        "body[2].mass": "c",
        "joint[0].axis[1]": "d",
        "coupling[0].ratio": "e",
        "driver[0].polynomial": "f",
        "load[0].force": "g",
        "body[0]": "h",
        "gravity": "i",
    }
    assert list(validation.named_paths(data, faults)) == [
        "body[rod].mass: a",
        "body[bar].mass: b",
        "body[2].mass: c",
        "joint[A].axis[1]: d",
        "coupling[gear].ratio: e",
        "driver[A].polynomial: f",
        "load[0].force: g",
        "body[0]: h",
        "gravity: i",
    ]


def test_entries_and_texts():
    assert validation._entries({"a": [1, 2], "b": (3,), "c": "no"}, "a") == [1, 2]
    assert validation._entries({"b": (3,)}, "b") == [3] and validation._entries({"c": "no"}, "c") == []
    assert validation._entries({}, "d") == []
    assert validation._text({"name": "x"}, "name") == "x" and validation._text({"name": 3}, "name") == ""
    assert validation._text({}, "name") == "" and validation._text(7, "name") == ""
    assert validation._names([{"name": "x"}, {"other": "y"}]) == ["x", ""]


def test_duplicates():
    names = ["a", "b", "a", "", "", "ground", "a"]
    assert list(validation._duplicates("body", names, ("ground",))) == [
        ("body[2].name", "'a' is already the name of body[0]"),
        ("body[5].name", "'ground' is reserved for the fixed frame"),
        ("body[6].name", "'a' is already the name of body[0]"),
    ]
    assert list(validation._duplicates("joint", ["x", "ground", "y", "y"])) == [
        ("joint[3].name", "'y' is already the name of joint[2]")
    ]


def test_unknown_names():
    assert validation._unknown("body", "rodd", {"rod", "bar", ""}) == (
        "unknown body 'rodd'; known: bar, rod; did you mean 'rod'?"
    )
    assert validation._unknown("joint", "A", [""]) == "unknown joint 'A'; known: none"


@pytest.mark.parametrize(
    ("pair", "faults"),
    [
        (("a", "b"), []),
        (["a", "c"], [("p[1]", "unknown body 'c'; known: a, b")]),
        (("c", "b"), [("p[0]", "unknown body 'c'; known: a, b")]),
        (("a", "a"), [("p", "must be two different bodies, got 'a' twice")]),
        (("a", ""), []),
        (("a", 3), []),
        (("a",), []),
        (("a", "b", "c"), []),
        ("az", []),
    ],
)
def test_pairs_of_bodies(pair, faults):
    assert list(validation._pair_faults("p", pair, {"a", "b"})) == faults


@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("A", []),
        ("B", [("p", "'B' is spherical; only revolute, planar joints can turn")]),
        ("C", []),
        ("Z", [("p", "unknown joint 'Z'; known: A, B, C")]),
        ("", []),
        (3, []),
    ],
)
def test_joints_that_are_named(name, faults):
    """A joint of an unknown type is reported elsewhere."""
    types = {"A": "revolute", "B": "spherical", "C": "nonsense"}
    assert list(validation._joint_faults("p", name, types, ("revolute", "planar"), "turn")) == faults


@pytest.mark.parametrize(
    ("joint", "driver", "faults"),
    [
        ("revolute", {"polynomial": [0.0, "30 deg"]}, []),
        ("revolute", {"polynomial": ["1 mm", "30 deg", "2 m"]}, ["polynomial[0]", "polynomial[2]"]),
        ("translational", {"polynomial": [0.0, "30 deg"]}, ["polynomial[1]"]),
        ("translational", {"polynomial": [0.0, "3 mm"], "sine": {"amplitude": "1 rad"}}, ["sine.amplitude"]),
        ("revolute", {"polynomial": 3, "sine": {"amplitude": "1 rad"}}, []),
        ("spherical", {"polynomial": ["1 mm", "30 deg"]}, []),
        (None, {"polynomial": ["1 mm"]}, []),
    ],
)
def test_units_of_drivers(joint, driver, faults):
    found = dict(validation._unit_faults("d", driver, joint))
    assert list(found) == [f"d.{field}" for field in faults]
    needed = {"revolute": "angle", "translational": "length"}.get(str(joint), "")
    driven = {"revolute": "angle", "translational": "displacement"}.get(str(joint), "")
    for says in found.values():
        assert says.startswith(f"prescribes the {driven} of a {joint} joint, a unit of {needed}, got '")


@pytest.mark.parametrize(
    ("coupling", "names", "faults"),
    [
        ({}, ("A", "B"), []),
        ({"coordinates": ["angle", "displacement"]}, ("A", "S"), []),
        (
            {"coordinates": ["displacement", "displacement"]},
            ("A", "S"),
            [("c.joints", "'A' is revolute, which has no displacement to be coupled")],
        ),
        (
            {"coordinates": ["angle", "angle"]},
            ("A", "S"),
            [("c.joints", "'S' is translational, which has no angle to be coupled")],
        ),
        ({"coordinates": ["speed", "angle"]}, ("A", "B"), []),
        ({"coordinates": ["angle", "displacement"]}, ("C", "C"), []),
        ({}, ("C", "C"), []),
        (
            {"coordinates": ["angle", "angle"]},
            ("C", "C"),
            [("c.joints", "must be two different coordinates, got the angle of 'C' twice")],
        ),
        ({}, ("A", "A"), [("c.joints", "'A' is revolute, which has no displacement to be coupled")]),
        ({"offset": "3 mm"}, ("A", "S"), []),
        ({"offset": 0.5}, ("A", "S"), []),
        ({"offset": "3 deg"}, ("A", "S"), [("c.offset", "is of the displacement of 'S', got '3 deg'")]),
        ({"offset": "3 mm"}, ("S", "A"), [("c.offset", "is of the angle of 'A', got '3 mm'")]),
        ({"coordinates": ["angle"], "offset": "3 deg"}, ("A", "B"), []),
    ],
)
def test_coordinates_of_couplings(coupling, names, faults):
    types = {"A": "revolute", "B": "revolute", "S": "translational", "C": "cylindrical"}
    assert list(validation._coordinate_faults("c.joints", coupling, names, types)) == faults


def test_faults_of_couplings():
    types = {"A": "revolute", "B": "spherical", "C": "revolute"}
    data = {
        "coupling": [
            {"name": "A", "joints": ["A", "C"]},
            {"name": "g", "joints": ["A", "B"]},
            {"name": "g", "joints": ["A"]},
            {"name": "", "joints": ["A", "Z"]},
            {"name": "h", "joints": ["A", "A"]},
            {"name": "i", "joints": "AZ"},
            {"name": "j", "joints": ["A", 3]},
        ]
    }
    able = "revolute, translational, cylindrical, planar, inline"
    assert list(validation._coupling_faults(data, types)) == [
        ("coupling[2].name", "'g' is already the name of coupling[1]"),
        ("coupling[0].name", "'A' is already the name of a joint"),
        ("coupling[1].joints[1]", f"'B' is spherical; only {able} joints can be coupled"),
        ("coupling[3].joints[1]", "unknown joint 'Z'; known: A, B, C"),
        ("coupling[4].joints", "'A' is revolute, which has no displacement to be coupled"),
    ]


def test_faults_of_drivers():
    types = {"A": "revolute", "B": "spherical", "C": "revolute"}
    table = [[0.5, 0.0], [1.0, 1.0], [1.5, 1.0], [2.0, 1.0]]
    data = {
        "duration": 3.0,
        "driver": [
            {"joint": "A"},
            {"joint": "B"},
            {"joint": "A", "table": table},
            {"joint": 3},
            {"joint": "C", "polynomial": ["3 mm"]},
        ],
    }
    able = "revolute, translational, cylindrical"
    assert list(validation._driver_faults(data, types)) == [
        ("driver[1].joint", f"'B' is spherical; only {able} joints can be driven"),
        ("driver[2].joint", "'A' already has a driver"),
        ("driver[2].table", "leaves a gap: its first row is at 0.5 s, but it acts from 0 s on"),
        ("driver[2].table", "leaves a gap: its last row is at 2 s, but it acts until 3 s"),
        (
            "driver[4].polynomial[0]",
            "prescribes the angle of a revolute joint, a unit of angle, got '3 mm'",
        ),
    ]


def test_faults_between_entries():
    data: dict[str, Any] = {
        "ground": "body",
        "body": [
            {"name": "a", "mass": 1.0},
            {"name": "b", "inertia": [1.0, 1.0, 1.0]},
            {"name": "c", "mass": 0.0, "inertia": [[0, 0, 0], [0, 1, 0], [0, 0, 0]]},
            {"name": "d", "mass": 0.0, "inertia": [0.0, 0.0, 0.0]},
            {"name": "the fixed frame"},
        ],
        "joint": [
            {"name": "S", "type": "translational", "bodies": ["a", "z"]},
            {"name": "ground", "type": "revolute", "bodies": ["ground", "a"]},
        ],
        "coupling": [{"name": "g", "joints": ["S", "Z"]}],
        "driver": [{"joint": "Z"}],
        "load": [
            {"type": "force", "body": "ground"},
            {"type": "moment", "body": "z"},
            {"type": "force", "body": 3},
            {"type": "spring", "bodies": ["a", "z"]},
            {"type": "torsion_spring", "joint": "S"},
            {"type": "slide_spring", "joint": "S"},
            {"type": "force", "body": "a", "factor": {"sine": {"amplitude": "3 mm"}}},
        ],
    }
    known = "a, b, c, d, ground, the fixed frame"
    assert list(validation.reference_faults(data)) == [
        ("body[4].name", "'the fixed frame' is reserved for the fixed frame"),
        ("joint[1].name", "'ground' is reserved for the fixed frame"),
        ("body[0].inertia", "is missing; give mass and inertia, or neither (kinematics)"),
        ("body[1].mass", "is missing; give mass and inertia, or neither (kinematics)"),
        ("body[2].mass", "is 0, but the inertia is not; a massless link has neither"),
        ("joint[0].bodies[1]", f"unknown body 'z'; known: {known}"),
        ("coupling[0].joints[1]", "unknown joint 'Z'; known: S, ground"),
        ("driver[0].joint", "unknown joint 'Z'; known: S, ground"),
        ("load[0].body", "a load cannot act on the ground"),
        ("load[1].body", "unknown body 'z'; known: a, b, c, d, the fixed frame"),
        ("load[3].bodies[1]", f"unknown body 'z'; known: {known}"),
        (
            "load[4].joint",
            "'S' is translational; only revolute, cylindrical joints can carry a torsion_spring",
        ),
        ("load[6].factor.sine.amplitude", "multiplies the load, so it has no unit, got '3 mm'"),
    ]
    del data["ground"]
    assert "joint[1].name" not in dict(validation.reference_faults(data))


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("x", "must be three numbers or a 3x3 matrix"),
        ([1.0, 2.0], "must be three numbers or a 3x3 matrix, got"),
        ([math.nan, 1.0, 1.0], "must be finite"),
        ([2e40, 1.0, 1.0], "must be at most 1e[+]40 in size"),
        ([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "must be symmetric"),
        ([1.0, 1.0, 1e-41], "must be at least 1e-40 in size, got 1e-41"),
        ([1.0, 1.0, -0.5], "must have no negative principal moment, got -0.5"),
        ([1.0, 2.0, 3.5], r"violates the triangle inequality: 3.5 > 1 [+] 2; a flat body across z"),
        ([[2.0, 1.5, 0.0], [1.5, 2.0, 0.0], [0.0, 0.0, 1.0]], "triangle inequality: 3.5 > 0.5 [+] 1;"),
    ],
)
def test_inertias_that_are_refused(value, says):
    with pytest.raises(ValueError, match=says):
        validation.checked_inertia(value)


@pytest.mark.parametrize(
    "value",
    [
        (1.0, 2.0, 3.0),
        (1.0, 2.0, 3.0 + 2e-9),
        (0.0, 0.0, 0.0),
        (0.0, 1e-40, 1e-40),
        ((2.0, 0.5, 0.0), (0.5, 2.0, 0.0), (0.0, 0.0, 1.5)),
    ],
)
def test_inertias_that_are_taken(value):
    assert validation.checked_inertia(value) == value
    assert validation.checked_inertia(np.array(value)) == value


# --- functions of time --------------------------------------------------------------------------------------
ROWS = [[0.5, 1.0], [1.0, 2.0]]


@pytest.mark.parametrize(
    ("factor", "faults"),
    [
        (None, []),
        ({"table": ROWS}, ["first row is at 0.5 s, but it acts from 0 s on", "until 2 s"]),
        ({"table": ROWS, "start": 0.5}, ["last row is at 1 s, but it acts until 2 s"]),
        ({"table": ROWS, "start": 0.5, "stop": 1.0}, []),
        ({"table": ROWS, "start": 0.25, "stop": 1.5}, ["acts from 0.25 s on", "it acts until 1.5 s"]),
        ({"table": ROWS, "start": 0.5, "stop": "soon"}, ["it acts until 2 s"]),
        ({"table": [*ROWS, [3.0]]}, []),
        ({"table": [*ROWS, [3.0, "x"]]}, []),
    ],
)
def test_gaps_of_the_table_of_a_factor(factor, faults):
    found = list(function_faults.factor_faults("f", factor, {"duration": 2.0}))
    assert [path for path, _ in found] == ["f.table"] * len(faults)
    assert all(fault in says for fault, (_, says) in zip(faults, found, strict=True))


def test_numbers_of_functions():
    assert function_faults._number("30 mm") == pytest.approx(0.03) and function_faults._number(2) == 2.0
    assert function_faults._number(1e40) == 1e40 and function_faults._number(2e40) == 0.0
    assert function_faults._number("x") == 0.0 and function_faults._number(None) == 0.0
    assert list(function_faults.table_faults("t", {"table": ROWS}, {}, 0.5, math.inf)) == []
    late = list(function_faults.table_faults("t", {"table": ROWS}, {"duration": 1.5}, 0.5, math.inf))
    assert late == [("t", "leaves a gap: its last row is at 1 s, but it acts until 1.5 s")]
    revolute: Any = Revolute(name="A", bodies=("a", "b"), anchor=(0, 0, 0), axis=(0, 0, 1))
    assert function_faults.rows_of(revolute) == [] and function_faults.rows_of({"table": ROWS}) == [
        (0.5, 1.0),
        (1.0, 2.0),
    ]
