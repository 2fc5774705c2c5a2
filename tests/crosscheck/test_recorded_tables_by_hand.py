"""Recorded tables, exact motions and further explanations / cells, units and columns written down."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.truth.picard import NoSolution
from crosscheck.recorded import exact as exactly
from crosscheck.recorded import explanations
from crosscheck.recorded.changed_scenes import Change, _moved, changes
from crosscheck.recorded.columns import _continuous
from crosscheck.recorded.exact import exact, reference_table, write
from crosscheck.recorded.explanations import Difference
from crosscheck.recorded.judgement import Judgement, _as_recording
from crosscheck.recorded.pairs_of_explanations import _continuous as continuous_columns
from crosscheck.recorded.reading import _dimension, read
from mbref.scene import Body, Revolute, Scene, SceneError, Spherical

ONES = (1.0, 1.0, 1.0)
HINGE = Revolute(name="H", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
SCENE = Scene(
    name="s",
    body=[Body(name="a", mass=2.0, inertia=ONES, position=(1.0, 0.0, 0.0))],
    joint=[HINGE],
    gravity=(0.0, 0.0, 0.0),
    duration=2.0,
)


@pytest.fixture
def table(tmp_path: Path) -> Any:
    def make(text: str, columns: dict[str, str] | None = None, **more: Any) -> Any:
        path = tmp_path / "t.csv"
        path.write_text(text, encoding="utf-8")
        return read(path, SCENE, columns or {}, **more)

    return make


# --- tables -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "text",
    [
        "time,a.x\n0,1.5\n1,-2\n",
        "\ufefftime,a.x\n0,1.5\n1,-2\n",
        "time;a.x\n0;1,5\n1;-2,0\n",
        "time\ta.x\n0\t1.5\n1\t-2\n",
        "time a.x\n0 1.5\n1    -2\n",
        "# time a.x\n\n  +0 1.5\n1 -2\n\n",
        "made by hand\n%! time,a.x\n0,1.5\n1,-2\n",
        "'time',\"a.x\"\n0,'1.5'\n1,\"-2\"\n",
        "t,A.POSITION.X\n0,1.5\n1,-2\n",
        "time,  a.x  \n0,1.5\n1,-2\n",
    ],
)
def test_the_same_table_of_several_tools(table, text):
    found = table(text)
    assert found.times.tolist() == [0.0, 1.0] and found.ignored == []
    assert {n: c.tolist() for n, c in found.columns.items()} == {"a.position.x": [1.5, -2.0]}


def test_headers_that_do_not_fit_are_numbers_of_columns(table):
    """Three headers over two columns are no headers; without headers the columns are counted from 1."""
    for text in ("time,a.x,a.y\n0,1\n1,2\n", "0,1\n1,2\n", "-0.0 1\n1 2\n"):
        found = table(text, {"time": "1", "a.position.z": "column 2"})
        assert found.columns["a.position.z"].tolist() == [1.0, 2.0]
        assert found.resolution["a.position.z"] == 1.0


def test_a_short_header_begins_with_a_sign_or_a_point(table):
    assert table("time,a.x\n.5,1\n1,2\n").times.tolist() == [0.5, 1.0]


@pytest.mark.parametrize(
    ("header", "column", "factor"),
    [
        ("a.x [mm]", "a.position.x", 1e-3),
        ("a.x (mm)", "a.position.x", 1e-3),
        ("a.x/mm", "a.position.x", 1e-3),
        ("a.vx [cm/s]", "a.velocity.x", 1e-2),
        ("a.wz (rpm)", "a.angular_velocity.z", math.pi / 30),
        ("a.qw", "a.orientation.w", 1.0),
        ("a.qz [1]", "a.orientation.z", 1.0),
        ("H.angle [rev]", "H.angle", 2 * math.pi),
        ("H.Angle[deg]", "H.angle", math.pi / 180),
        ("a.VZ", "a.velocity.z", 1.0),
    ],
)
def test_headers_with_units(table, header, column, factor):
    found = table(f"time,{header}\n0,1\n1,3\n")
    assert list(found.columns) == [column]
    assert found.columns[column] == pytest.approx([factor, 3 * factor], rel=1e-15)
    assert found.resolution[column] == pytest.approx(factor, rel=1e-15)


def test_the_first_of_two_columns_counts_unless_another_is_named(table):
    text = "time,a.x,a.position.x\n0,1,2\n1,3,4\n"
    assert table(text).columns["a.position.x"].tolist() == [1.0, 3.0]
    assert table(text).ignored == ["a.position.x"]
    named = table(text, {"a.position.x": "3:cm"})
    assert named.columns["a.position.x"] == pytest.approx([0.02, 0.04]) and named.ignored == ["a.x"]
    both = table(text, {"a.position.y": "a.x", "a.position.x": "a.position.x"})
    assert both.columns["a.position.y"].tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("units", "factor"), [(("mm",), 1e-3), (("mm", "deg", "cm"), 1e-2), (("s", "deg"), 1.0), ((), 1.0)]
)
def test_units_of_a_quantity(table, units, factor):
    """The last unit of lengths counts for columns without a unit of their own."""
    found = table("time,a.x,a.y [in]\n0,1,1\n1,2,2\n", units=units)
    assert found.columns["a.position.x"] == pytest.approx([factor, 2 * factor])
    assert found.columns["a.position.y"] == pytest.approx([0.0254, 0.0508])


@pytest.mark.parametrize(
    ("si", "units"),
    [
        ("s", "s ms min"),
        ("m", "m mm cm um in ft"),
        ("rad", "rad deg rev"),
        ("m/s", "m/s mm/s cm/s"),
        ("rad/s", "rad/s deg/s rpm"),
        ("1", "1"),
    ],
)
def test_units_and_their_quantities(si, units):
    assert {_dimension(unit) for unit in units.split()} == {si}


@pytest.mark.parametrize(
    ("text", "columns", "more", "says"),
    [
        (
            "time,a.x\n0,1\n1,2\n",
            {"a.position.x": "0"},
            {},
            "--column a.position.x: no column '0'; columns: time, a.x",
        ),
        ("time,a.x\n0,1\n1,2\n", {"a.position.x": "-1"}, {}, "no column '-1'"),
        ("time,a.x\n0,1\n1,2\n", {"nothing": "1"}, {}, "--column nothing: the scene has no such column$"),
        ("time,b\n0,1\n1,2\n", {}, {}, "among time, b; --column a.position.x=2 gives one"),
        ("a.x,b\n0,1\n1,2\n", {}, {}, "has no column time; --column time=1 gives one"),
        ("time,a.x\n0,1\n1,2,3\n", {}, {}, "row 2 of numbers is not 2 numbers"),
        ("time,a.x\n0,1\n1,nan\n", {}, {}, "row 2 is not finite"),
        (
            "time,a.x\n0,1\n1,2\n",
            {},
            {"units": ("furlong",)},
            "unknown unit 'furlong'; known: s, ms, min, m, ",
        ),
        (
            "time,a.x\n0,1\n1,2\n",
            {},
            {"order": "zyxw"},
            "--quaternion: must be one of wxyz, xyzw, got 'zyxw'",
        ),
        ("time,a.x\n0,1\n200,2\n", {}, {}, "times end at 200 s, and the scene's duration is 2 s"),
        ("time,a.x\n1,1\n1,2\n", {}, {}, "times must not be negative and must increase"),
        ("time,a.x\n-1,1\n1,2\n", {}, {}, "times must not be negative and must increase"),
        ("time,a.x\n", {}, {}, "has no row of numbers"),
    ],
)
def test_tables_that_are_refused(table, text, columns, more, says):
    with pytest.raises(SceneError, match=says):
        table(text, columns, **more)


def test_a_table_may_begin_at_zero_and_end_at_fifty_durations(table):
    assert table("time,a.x\n0,1\n100,2\n").times[-1] == 100.0


def test_quaternions_with_w_last(table):
    """The columns are named w, x, y, z, but hold x, y, z, w."""
    text = "time,a.qw,a.qx,a.qy,a.qz,a.x\n0,1,2,3,4,5\n1,1,2,3,4,5\n"
    found = table(text, order="xyzw").columns
    assert [found[f"a.orientation.{axis}"][0] for axis in "wxyz"] == [4.0, 1.0, 2.0, 3.0]
    assert found["a.position.x"][0] == 5.0
    assert [table(text).columns[f"a.orientation.{axis}"][0] for axis in "wxyz"] == [1.0, 2.0, 3.0, 4.0]


# --- exact motions ----------------------------------------------------------------------------------------
def test_a_written_table_has_units(tmp_path):
    write(
        {
            "time": np.array([0.5]),
            "bound": np.array([1e-9]),
            "a.velocity.x": np.array([0.1]),
            "H.angle": np.array([2.0]),
        },
        tmp_path / "t.csv",
    )
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert lines == ["time [s],bound [1],a.velocity.x [m/s],H.angle [rad]", "0.5,1e-09,0.1,2.0"]


def test_the_exact_motion_of_a_body_that_turns_freely(monkeypatch):
    """1.5 rad/s about z without gravity, from a closed form: its bound is the accuracy of its family."""
    turning = SCENE.with_(body=[SCENE.body[0].model_copy(update={"angular_velocity": (0.0, 0.0, 1.5)})])
    monkeypatch.setattr(exactly, "reference", None)  # a closed form needs no reference
    found = exact(turning, [0.0, 0.5, 1.0])
    assert found.reason == "" and found.motion.times.tolist() == [0.0, 0.5, 1.0]
    assert found.bound.tolist() == [exactly.closed_form(turning).accuracy] * 3
    table = reference_table(turning, (0.0, 0.5))
    assert list(table)[:2] == ["time", "bound"] and table["time"].tolist() == [0.0, 0.5]
    assert table["H.angle"] == pytest.approx([0.0, 0.75]) and table["a.position.x"][1] == pytest.approx(
        math.cos(0.75)
    )


def test_an_exact_motion_that_ends_is_known_at_its_last_time(monkeypatch):
    class Family:
        accuracy = 1e-9

        def poses(self, times: np.ndarray) -> Any:
            if times[-1] > 0.5:
                raise NoSolution("it locks", 0.5)
            return SimpleNamespace(times=times)

    monkeypatch.setattr(exactly, "closed_form", lambda scene: Family())
    found = exact(SCENE, (0.0, 0.5, 0.75))
    assert found.motion.times.tolist() == [0.0, 0.5] and found.bound.tolist() == [1e-9] * 2
    assert "it locks" in found.reason and exact(SCENE, (0.0, 0.5)).reason == ""


def test_columns_of_a_recording_that_are_none_of_the_scene_are_left_out():
    found = _as_recording(SCENE, {"time": [0.0, 1.0], "a.position.x": [1.0, 2.0], "note": [3.0, 4.0]})
    assert list(found.columns) == ["a.position.x"] and found.times.tolist() == [0.0, 1.0]
    assert _as_recording(SCENE, found) is found


# --- explanations -----------------------------------------------------------------------------------------
def test_quaternions_have_one_sign_along_a_motion():
    q = np.array(
        [[1.0, 0, 0, 0], [-0.9, -0.1, 0, 0], [-0.8, -0.2, 0, 0], [0.7, 0.3, 0, 0], [-0.6, -0.4, 0, 0]]
    )
    assert _continuous(q)[:, 0].tolist() == [1.0, 0.9, 0.8, 0.7, 0.6]
    columns = {f"a.orientation.{axis}": q[:, k] for k, axis in enumerate("wxyz")}
    found = continuous_columns({**columns, "a.position.x": q[:, 0]})
    assert found["a.orientation.w"].tolist() == [1.0, 0.9, 0.8, 0.7, 0.6]
    assert found["a.orientation.x"].tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert found["a.position.x"] is not None and found["a.position.x"][1] == -0.9
    part = {n: c for n, c in columns.items() if not n.endswith("z")}
    assert continuous_columns(part)["a.orientation.w"].tolist() == q[:, 0].tolist()


def difference(**columns: Any) -> Difference:
    """A line 2 t + 1 at 0, 1, 2, 3 s, as recorded and as exact columns, and at any time."""
    times = np.arange(4.0)
    recorded = {name: np.asarray(c, dtype=float) for name, c in columns.items()}
    line = dict.fromkeys(recorded, 2 * times + 1)
    return Difference(
        times, recorded, line, dict.fromkeys(recorded, 1.0), lambda t: dict.fromkeys(recorded, 2 * t + 1), 0.0
    )


@pytest.mark.parametrize(
    ("shift", "wanted"),
    [
        (0.5, [9.0, 2.0, 4.0, 6.0]),
        (-0.5, [2.0, 4.0, 6.0, 9.0]),
        (1.0, [9.0, 1.0, 3.0, 5.0]),
        (0.0, [1, 3, 5, 7]),
    ],
)
def test_a_shift_leaves_samples_that_the_motion_does_not_have(shift, wanted):
    """Samples before the start or after the end keep the recorded 9."""
    d = difference(A=[9.0] * 4)
    assert explanations._later(d, shift)["A"].tolist() == wanted


def test_values_that_are_repeated_or_on_straight_lines():
    """Every second of seven samples; the last sample belongs to both."""
    times = np.arange(7.0) / 2
    d = Difference(times, {"A": times**2}, {"A": times**2}, {"A": 1.0}, lambda t: {"A": t**2})
    found = {s: c["A"].tolist() for s, _, c in explanations._interpolations(d)}
    assert list(found) == []
    times = np.arange(9.0) / 2
    d = Difference(times, {"A": times**2}, {"A": times**2}, {"A": 1.0}, lambda t: {"A": t**2})
    found = {s: (n, c["A"].tolist()) for s, n, c in explanations._interpolations(d)}
    assert found == {
        "all columns: straight lines between samples 1 s apart": (
            2,
            [0, 0.5, 1, 2.5, 4, 6.5, 9, 12.5, 16],
        ),
        "all columns: each value is repeated for 1 s": (2, [0, 0, 1, 1, 4, 4, 9, 9, 16]),
    }
    many = np.arange(400.0)
    d = Difference(many, {"A": many}, {"A": many}, {"A": 1.0}, lambda t: {"A": t})
    assert len(list(explanations._interpolations(d))) == 2 * 48, "every 2nd to every 49th sample"


def test_factors_and_offsets_of_a_column():
    found = {
        s: (n, c["A.angle"].tolist())
        for s, n, c in explanations._factors(difference(**{"A.angle": [2, 6, 10, 14]}))
    }
    assert found["A.angle: a factor of 2"] == (3, [2.0, 6.0, 10.0, 14.0])
    assert found["A.angle: of opposite sign (factor -1)"] == (1, [-1.0, -3.0, -5.0, -7.0])
    assert len(found) == len(explanations.FACTORS) + 1
    [(sentence, count, columns)] = explanations._offsets(difference(**{"A.angle": [2, 4, 6, 9]}))
    assert (sentence, count) == ("A.angle: an offset of 1.25", 3)
    assert columns["A.angle"].tolist() == [2.25, 4.25, 6.25, 8.25]
    zero = Difference(
        np.arange(2.0), {"A.angle": np.ones(2)}, {"A.angle": np.zeros(2)}, {"A.angle": 1.0}, None
    )
    assert not any("a factor of" in s for s, _, _ in explanations._factors(zero)), (
        "zero times a factor is zero"
    )


def test_an_offset_of_two_columns_has_two_numbers():
    d = difference(**{"a.position.x": [2, 4, 6, 8], "a.position.y": [0, 2, 4, 6]})
    first, *others = explanations._offsets(d)
    assert first[:2] == ("all columns of position: an offset of 1, -1", 4)
    assert [s for s, _, _ in others] == ["a.position.x: an offset of 1", "a.position.y: an offset of -1"]


def test_body_axes_that_differ_by_a_constant_rotation():
    """The recorded orientation is turned by 90° about z of the body; one sample has the opposite sign."""
    half = math.sqrt(0.5)
    exact_q = np.array([[1.0, 0.0, 0.0, 0.0], [half, half, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    recorded_q = np.array([[half, 0.0, 0.0, half], [-0.5, -0.5, 0.5, -0.5], [0.0, half, -half, 0.0]])
    names = [f"a.orientation.{axis}" for axis in "wxyz"]
    recorded, exact_columns = (dict(zip(names, q.T, strict=True)) for q in (recorded_q, exact_q))
    d = Difference(np.arange(3.0), recorded, exact_columns, dict.fromkeys(names, 1.0), None)
    [(sentence, count, columns)] = explanations._other_axes(d, "a")
    assert (sentence, count) == ("a: other body axes, turned by a constant rotation", 4)
    found = np.array([columns[n] for n in names]).T
    assert found == pytest.approx(np.array([[half, 0, 0, half], [0.5, 0.5, -0.5, 0.5], [0, half, -half, 0]]))
    assert list(explanations._other_axes(d, "b")) == []


# --- changed scenes ---------------------------------------------------------------------------------------
def test_changes_of_scenes_with_other_joints_and_masses():
    """Only joints that turn are damped; a scene without masses has no masses to change."""
    ball = Spherical(name="B", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0))
    assert len(list(changes(SCENE.with_(joint=[ball])))) == 1, "the mass"
    fall = SCENE.with_(gravity=(0.0, -3.0, -4.0))
    gravity, *_ = changes(fall)
    assert gravity.of(1.0).gravity == (0.0, -6.0, -8.0) and gravity.small == 1e-3
    assert gravity.says(1.0) == "gravity of 10 m/s², not 5"
    assert gravity.says(0.961330) == "gravity of 9.80665 m/s², not 5"
    assert gravity.says(0.9613) == "gravity of 9.8065 m/s², not 5"
    kinematic = SCENE.with_(body=[Body(name="a", position=(1.0, 0.0, 0.0))], gravity=(0.0, -10.0, 0.0))
    assert len(list(changes(kinematic))) == 1
    *_, mass = changes(SCENE)
    assert mass.small == -0.05 and mass.of(-0.9995).body[0].mass == pytest.approx(2e-3)


@pytest.mark.parametrize("error", [RuntimeError("no end"), SceneError(["no scene"])])
def test_a_scene_that_cannot_be_simulated_explains_nothing(monkeypatch, error):
    def fails(scene: Any, times: Any, rtol: float) -> Any:
        raise error

    monkeypatch.setattr("crosscheck.recorded.changed_scenes.gauss_motion", fails)
    assert _moved(Change(lambda x: SCENE, 0.1, str), 0.1, difference(A=[1, 2, 3, 4])) is None


def test_a_judgement_as_a_record():
    best = explanations.Explanation("in mm", 0.25, 1)
    assert Judgement((), (best,), 2.0, "why").to_record() == {
        "right": True,
        "until": 2.0,
        "reason": "why",
        "columns": [],
        "explanations": [{"sentence": "in mm", "remains": 0.25, "complexity": 1}],
    }
