"""Explanations of recorded motions / differences planted into columns that are written down."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from crosscheck.recorded import changed_scenes, pairs_of_explanations
from crosscheck.recorded.changed_scenes import Change, _fitted, changed, changes
from crosscheck.recorded.columns import UNITS, kind_of, names, scales, values
from crosscheck.recorded.explanations import Difference, ranked, simple, with_signs
from crosscheck.recorded.judgement import ColumnError, Judgement, _column, _with_dense
from crosscheck.recorded.reading import _last_digit, read
from mbref import rotations
from mbref.scene import Body, Revolute, Scene, SceneError, Translational
from mbref.trajectory import Outcome, Trajectory

TIMES = np.linspace(0.0, 0.4, 41)


def motion(t: np.ndarray) -> dict[str, np.ndarray]:
    """A body's columns at times: a curve in space, and a rotation about an inclined axis by 2 t."""
    q = np.stack([np.cos(t), 0.6 * np.sin(t), 0 * t, 0.8 * np.sin(t)])
    place = np.stack([1 + t, t**2 - 2, np.sin(5 * t)])
    speed = np.stack([1 + 0 * t, 2 * t, 5 * np.cos(5 * t)])
    spin = np.stack([1.2 + 0 * t, 0 * t, 1.6 + 0 * t])
    found = dict(zip([f"b.position.{a}" for a in "xyz"], place, strict=True))
    found |= dict(zip([f"b.orientation.{a}" for a in "wxyz"], q, strict=True))
    found |= dict(zip([f"b.velocity.{a}" for a in "xyz"], speed, strict=True))
    return found | dict(zip([f"b.angular_velocity.{a}" for a in "xyz"], spin, strict=True))


def difference(recorded: dict[str, np.ndarray], times: np.ndarray = TIMES) -> Difference:
    exact = {name: column for name, column in motion(times).items() if name in recorded}
    return Difference(times, recorded, exact, dict.fromkeys(recorded, 1.0), motion)


def first(recorded: dict[str, np.ndarray], times: np.ndarray = TIMES) -> tuple[str, int]:
    """Sentence and number of parameters of the best explanation, which leaves nothing."""
    d = difference(recorded, times)
    [best, *_] = ranked(d, simple(d), 0.0)
    assert best.remains < 1e-6, best
    return best.sentence, best.complexity


def kinds(*wanted: str) -> dict[str, np.ndarray]:
    return {name: column for name, column in motion(TIMES).items() if kind_of(name) in wanted}


def test_size_is_the_root_mean_square_over_columns_and_times():
    """1 of 2 in one column, and 2 of 5 at half of the times in the other: √((0.25 + 0.08) / 2)."""
    exact = {"A.angle": np.zeros(4), "A.displacement": np.ones(4)}
    recorded = {"A.angle": np.full(4, -1.0), "A.displacement": np.array([3.0, 1.0, 1.0, -1.0])}
    d = Difference(np.arange(4.0), recorded, exact, {"A.angle": 2.0, "A.displacement": 5.0}, motion)
    assert d.size({}) == pytest.approx(math.sqrt((0.25 + 0.08) / 2), rel=1e-14)
    assert d.size(recorded) == 0.0
    assert d.size({"A.angle": recorded["A.angle"]}) == pytest.approx(math.sqrt(0.04), rel=1e-14)


def test_a_quaternion_has_the_sign_nearer_to_the_recorded_one():
    exact = kinds("orientation")
    recorded = {n: np.where(TIMES < 0.2, -1.0, 1.0) * c for n, c in exact.items()}
    signed = with_signs(recorded, exact)
    assert all((signed[n] == recorded[n]).all() for n in exact)
    part = {n: -c for n, c in recorded.items() if not n.endswith("y")}
    assert with_signs(part, exact) == exact, "three of four components have no sign"
    across = {n: np.roll(c, 1) for n, c in zip(exact, np.eye(4), strict=True)}
    assert all((c >= 0).all() for c in with_signs(dict(zip(exact, np.eye(4), strict=True)), across).values())


@pytest.mark.parametrize(
    ("factor", "meaning"),
    [
        (1000.0, "in mm, not m"),
        (100.0, "in cm, not m"),
        (0.001, "in km, not m"),
        (57.29577951308232, "in degrees, not rad"),
        (0.017453292519943295, "in rad, read as degrees"),
        (0.15915494309189535, "in revolutions, not rad"),
        (9.549296585513721, "in revolutions a minute, not rad/s"),
        (-1.0, "of opposite sign"),
    ],
)
def test_factors_of_units(factor, meaning):
    recorded = kinds("position", "velocity")
    recorded |= {n: factor * c for n, c in recorded.items() if kind_of(n) == "velocity"}
    assert first(recorded) == (f"all columns of velocity: {meaning} (factor {factor:.6g})", 1)


def test_a_factor_without_a_unit_and_an_offset():
    recorded = kinds("position")
    assert first({**recorded, "b.position.y": 1.07 * recorded["b.position.y"]}) == (
        "b.position.y: a factor of 1.07",
        3,
    )
    moved = {n: c + x for (n, c), x in zip(recorded.items(), (0.1, -0.2, 0.3), strict=True)}
    exact = dict(simple_of(moved))
    assert exact["all columns of position: an offset of 0.1, -0.2, 0.3"][0] == 5
    assert exact["b.position.x: an offset of 0.1"][0] == 3
    assert (
        max(
            abs(exact["all columns of position: an offset of 0.1, -0.2, 0.3"][1][n] - moved[n]).max()
            for n in moved
        )
        < 1e-15
    )


def simple_of(recorded: dict[str, np.ndarray]) -> dict[str, tuple[int, dict[str, np.ndarray]]]:
    return {sentence: (count, columns) for sentence, count, columns in simple(difference(recorded))}


def test_each_set_of_columns_is_tried_once():
    """One body: all columns of its position are its position."""
    sentences = [s for s, _, _ in simple(difference(kinds("position", "velocity"))) if "in mm" in s]
    assert [s.partition(":")[0] for s in sentences] == [
        "all columns of position",
        "all columns of velocity",
        *(f"b.{kind}.{a}" for kind in ("position", "velocity") for a in "xyz"),
    ]
    assert first({"b.position.x": motion(TIMES)["b.position.x"] * 1e3})[0].startswith("b.position.x: in mm")


@pytest.mark.parametrize("shift", [0.0123, -0.0271])
def test_a_shift_in_time(shift):
    moved = motion(np.clip(TIMES - shift, 0.0, 0.4))
    sentence, count = first({n: c for n, c in moved.items() if kind_of(n) == "position"} | beyond(shift))
    assert (sentence, count) == (f"all columns: later by {shift:.6g} s", 1)


def beyond(shift: float) -> dict[str, np.ndarray]:
    """Positions outside of the known times are compared with themselves; any value does."""
    inside = (TIMES - shift >= 0) & (TIMES - shift <= 0.4)
    moved = motion(TIMES - shift)
    return {n: np.where(inside, c, 7.0) for n, c in moved.items() if kind_of(n) == "position"}


def test_exchanged_and_reversed_components():
    exact = motion(TIMES)
    recorded = kinds("position") | {
        "b.position.x": -exact["b.position.z"],
        "b.position.z": exact["b.position.x"],
    }
    sentence, count = first(recorded)
    assert sentence.endswith(": x, y, z hold -z, y, x of the exact motion") and count == 3
    both = kinds("position") | {n: -exact[n] for n in ("b.position.x", "b.position.y")}
    assert first(both)[0].endswith(": x, y, z hold -x, -y, z of the exact motion")
    assert first(both)[1] == 4


def test_components_exchanged_in_one_quantity_of_two():
    exact = motion(TIMES)
    recorded = kinds("position", "velocity")
    recorded |= {"b.velocity.x": exact["b.velocity.y"], "b.velocity.y": exact["b.velocity.x"]}
    assert first(recorded)[0] == "all columns of velocity: x, y, z hold y, x, z of the exact motion"


def test_orders_and_senses_of_quaternions():
    exact = np.array(list(kinds("orientation").values()))
    for order, meaning in (
        ([1, 2, 3, 0], "quaternions in the order x, y, z, w"),
        ([3, 0, 1, 2], "quaternions in the order w, x, y, z, read as x, y, z, w"),
    ):
        recorded = dict(zip(kinds("orientation"), exact[order], strict=True))
        assert first(recorded) == (f"all columns of orientation: {meaning}", 1)
    opposite = dict(zip(kinds("orientation"), exact * [[1], [-1], [-1], [-1]], strict=True))
    found = ranked(difference(opposite), simple(difference(opposite)), 0.0)
    same = [e for e in found if e.remains < 1e-6 and e.complexity == 1]
    assert "all columns of orientation: quaternions of the opposite rotation, world to body" in {
        e.sentence for e in same
    }, "the opposite sign of w alone means the same"


def test_another_world_frame():
    """Turned by 90° about z and moved by (3, -1, 2): x becomes y, y becomes -x."""
    x, y, z = (motion(TIMES)[f"b.position.{a}"] for a in "xyz")
    u, v, w = (motion(TIMES)[f"b.velocity.{a}"] for a in "xyz")
    recorded = dict(zip([f"b.position.{a}" for a in "xyz"], (3 - y, x - 1, z + 2), strict=True))
    recorded |= dict(zip([f"b.velocity.{a}" for a in "xyz"], (-v, u, w), strict=True))
    q = np.array(list(kinds("orientation").values())).T
    turned = rotations.multiply(np.array([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]), q)
    recorded |= dict(zip(kinds("orientation"), turned.T, strict=True))
    sentence, count = first(recorded)
    assert sentence == "all bodies: another world frame, turned by 90 degrees, origin at (3, -1, 2) m"
    assert count == 6


def test_another_point_of_a_body():
    """At (0.1, -0.2, 0.05) m in the body's axes; its velocity is v + ω × r."""
    exact = motion(TIMES)
    q = np.array([exact[n] for n in kinds("orientation")]).T
    arm = rotations.rotate(q, np.array([0.1, -0.2, 0.05]))
    across = np.cross([1.2, 0.0, 1.6], arm)
    recorded = dict(exact)
    for i, a in enumerate("xyz"):
        recorded[f"b.position.{a}"] = exact[f"b.position.{a}"] + arm[:, i]
        recorded[f"b.velocity.{a}"] = exact[f"b.velocity.{a}"] + across[:, i]
    assert first(recorded) == (
        "b: a point at (0.1, -0.2, 0.05) m in the body's frame, not the centre of mass",
        4,
    )
    alone = {n: c for n, c in recorded.items() if kind_of(n) == "position"}
    assert first(alone)[0].startswith("b: a point at (0.1, -0.2, 0.05) m"), (
        "orientations from the exact motion"
    )


def test_other_body_axes():
    q = np.array(list(kinds("orientation").values())).T
    turned = rotations.multiply(q, np.array([0.8, 0.0, 0.6, 0.0])) * np.where(TIMES > 0.2, -1.0, 1.0)[:, None]
    assert first(dict(zip(kinds("orientation"), turned.T, strict=True))) == (
        "b: other body axes, turned by a constant rotation",
        4,
    )


def test_interpolated_and_repeated_samples():
    """Every fourth sample, 0.04 s apart; of 39 samples the last interval is shorter."""
    for times in (TIMES, TIMES[:39]):
        exact = {n: c for n, c in motion(times).items() if kind_of(n) == "position"}
        nodes = [*range(0, len(times), 4), *([len(times) - 1] if len(times) % 4 != 1 else [])]
        lines = {n: np.interp(times, times[nodes], c[nodes]) for n, c in exact.items()}
        assert first(lines, times) == ("all columns: straight lines between samples 0.04 s apart", 2)
        steps = {n: c[[max(k for k in nodes if k <= i) for i in range(len(times))]] for n, c in exact.items()}
        assert first(steps, times) == ("all columns: each value is repeated for 0.04 s", 2)


def test_the_simplest_of_equal_fits_comes_first_then_the_best():
    exact = {"A.angle": np.zeros(2)}
    d = Difference(TIMES[:2], {"A.angle": np.ones(2)}, exact, {"A.angle": 1.0}, motion)

    def cause(name: str, complexity: int, left: float):
        return name, complexity, {"A.angle": np.ones(2) - left}

    given = [cause("rough", 1, 0.3), cause("fine", 4, 1e-3), cause("near", 2, 0.02), cause("far", 1, 0.021)]
    assert [e.sentence for e in ranked(d, given, 0.0)] == ["near", "fine", "far"], "within 20 times the best"
    assert [e.sentence for e in ranked(d, given, 0.1)] == ["far", "rough", "near"], "3 times the noise"
    assert ranked(d, [cause("no", 1, 0.5)], 0.0) == []
    [half] = ranked(d, [cause("half", 1, 0.499)], 0.0)
    assert half.remains == pytest.approx(0.499) and half.complexity == 1
    tiny = [cause("exact", 3, 0.0), cause("simple", 1, 0.9e-6)]
    assert [e.sentence for e in ranked(d, tiny, 0.0)] == ["simple", "exact"], "below 1e-6 counts as zero"
    assert ranked(d, [cause("exact", 3, 0.0), cause("simple", 1, 1.1e-6)], 0.0)[0].sentence == "exact"


def test_units_and_names_of_columns():
    assert {unit for unit, factor in UNITS.items() if factor == 1.0} == {
        "s",
        "m",
        "rad",
        "m/s",
        "rad/s",
        "1",
        "",
    }
    for unit, factor in {
        "ms": 0.001,
        "min": 60.0,
        "mm": 0.001,
        "cm": 0.01,
        "um": 1e-6,
        "in": 0.0254,
        "ft": 0.3048,
        "deg": 0.017453292519943295,
        "rev": 6.283185307179586,
        "mm/s": 0.001,
        "cm/s": 0.01,
        "deg/s": 0.017453292519943295,
        "rpm": 0.10471975511965977,
        "": 1.0,
        "1": 1.0,
    }.items():
        assert UNITS[unit] == pytest.approx(factor, rel=1e-15), unit
    assert [kind_of(n) for n in ("rod.position.x", "A.angle", "position.velocity.x", "A.gap")] == [
        "position",
        "angle",
        "velocity",
        "",
    ]
    found = names(two_bodies())
    assert found[:4] == ["a.position.x", "a.position.y", "a.position.z", "a.orientation.w"]
    assert found[-4:] == ["H.angle", "H.displacement", "S.angle", "S.displacement"] and len(found) == 30


def two_bodies() -> Scene:
    bodies = [
        Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))
        for name, x in (("a", 1.0), ("b", 3.0))
    ]
    hinge = Revolute(name="H", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    slide = Translational(name="S", bodies=("a", "b"), anchor=(2.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    return Scene(name="s", body=bodies, joint=(hinge, slide), duration=0.5, gravity=(0.0, -9.81, 0.0))


def turned_by(angles: tuple[float, ...], slid: tuple[float, ...]) -> Trajectory:
    """The arm turns by angles about z, and the second body slides out."""
    a, d = np.array(angles), 3.0 + np.array(slid)
    out = np.stack([np.cos(a), np.sin(a), 0 * a], axis=-1)
    q = np.stack([np.cos(a / 2), 0 * a, 0 * a, np.sin(a / 2)], axis=-1)
    q[1::2] *= -1
    still = np.zeros((len(a), 2, 3))
    return Trajectory(
        scene="s",
        engine="e",
        version="1",
        method="m",
        settings={},
        times=0.1 * np.arange(len(a)),
        bodies=("a", "b"),
        position=np.stack([out, d[:, None] * out], axis=1),
        orientation=np.stack([q, q], axis=1),
        velocity=still + np.array([0.0, 3.0, 4.0]),
        angular_velocity=still + np.array([0.0, 0.0, 7.0]),
        outcome=Outcome.COMPLETED,
        t_end=0.2,
        message="",
    )


def test_values_of_columns_are_continuous_and_scaled():
    run, scene = turned_by((0.0, 0.3, 0.8), (0.0, 0.1, 0.4)), two_bodies()
    found = values(scene, run)
    assert found["a.orientation.w"] == pytest.approx(np.cos([0.0, 0.15, 0.4]), abs=1e-15)
    assert found["b.orientation.z"] == pytest.approx(np.sin([0.0, 0.15, 0.4]), abs=1e-15)
    assert found["b.position.x"] == pytest.approx([3.0, 3.1 * math.cos(0.3), 3.4 * math.cos(0.8)])
    assert found["H.angle"] == pytest.approx([0.0, 0.3, 0.8])
    assert found["S.displacement"] == pytest.approx([0.0, 0.1, 0.4])
    assert found["a.velocity.z"] == pytest.approx([4.0] * 3)
    size = scales(scene, run)
    assert size["velocity"] == pytest.approx(max(5.0, size["position"] / 0.5))
    assert size["angular_velocity"] == 7.0 and size["orientation"] == size["angle"] == 1.0
    assert size["displacement"] == size["position"]
    assert scales(scene.with_(duration=100.0), run)["velocity"] == 5.0
    still = turned_by((0.0,), (0.0,))
    still.velocity[:] = still.angular_velocity[:] = 0.0
    assert scales(scene.with_(duration=100.0), still)["velocity"] == size["position"] / 100
    slow = scales(scene.with_(duration=0.01), run)
    assert slow["angular_velocity"] == pytest.approx(100.0)
    assert slow["velocity"] == pytest.approx(100 * size["position"])


def test_an_error_begins_where_it_exceeds_a_hundredth_of_its_largest():
    error = np.array([0.0, 0.01, -0.0101, 0.0, 1.0])
    found = _column("c", error, np.arange(5.0), 0.8, 0.9)
    assert found == ColumnError("c", 1.0, 0.8, 0.9, 2.0) and not found.is_right
    within = _column("c", error, np.arange(5.0), 1.0, 0.5)
    assert within == ColumnError("c", 1.0, 1.0, 1.0, None) and within.is_right
    tolerated = _column("c", error, np.arange(5.0), 0.5, 1.0)
    assert tolerated == ColumnError("c", 1.0, 0.5, 1.0, None) and tolerated.is_right
    both = Judgement((found, within), (), 4.0, "r")
    assert not both.is_right and Judgement((within,), (), 4.0, "").is_right
    assert both.to_record()["columns"][0] == {
        "name": "c",
        "largest": 1.0,
        "bound": 0.8,
        "allowed": 0.9,
        "begins": 2.0,
        "right": False,
    }


def test_further_times_of_the_exact_motion_are_apart_from_the_samples():
    """The times are the samples, and times 0.01 apart that are no nearer than 0.001 to a sample."""
    found = _with_dense(np.array([0.5, 2.0009, 4.0]))
    assert len(found) == 401 and {0.5, 2.0009, 4.0} <= set(found) and found[0] == 0.0
    assert np.diff(found).min() > 0.009
    assert len(_with_dense(np.array([2.0011, 4.0]))) == 402


@pytest.mark.parametrize(
    ("cells", "digit"),
    [
        (["0.12", "3.4"], 0.1),
        (["12", "3"], 1.0),
        (["1.5e-3", "2.25e-3"], 1e-4),
        (["1.50e2", "2.00e2"], 1.0),
        (["0.00123456789012", "0.5"], 0.1),
        (["0.0"], 0.0),
    ],
)
def test_the_last_digit_of_a_column(cells, digit):
    numbers = np.array([float(c) for c in cells])
    assert _last_digit(cells, numbers, whole=False) == pytest.approx(digit, rel=1e-12)
    rounding = np.finfo(float).eps * abs(numbers).max()
    assert _last_digit(cells, numbers, whole=True) == pytest.approx(rounding, rel=1e-12)


@pytest.mark.parametrize(
    ("time", "angle", "digit"),
    [
        ("0.1", "1.23456789012345", np.finfo(float).eps * 1.5),
        ("0.1", "1.2345678901234", 0.1),
        ("0.123456789012345678", "1.2345678901234", 0.1),
        ("0.1", "-0.00123456789012345e-3", np.finfo(float).eps * 1.5),
    ],
)
def test_a_table_with_all_digits_has_exact_short_numbers(tmp_path, time, angle, digit):
    path = tmp_path / "t.csv"
    path.write_text(f"time,a.x,H.angle\n{time},1.5,{angle}\n")
    found = read(path, two_bodies(), {}).resolution["a.position.x"]
    assert found == pytest.approx(digit, rel=1e-12)


def test_a_table_with_units_and_its_last_digits(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("T [ms],a.X [mm],b.vy (cm/s),H.angle / deg,note\n0,1000.5,3,90,1\n100,1001,4,180,2\n")
    found = read(path, two_bodies(), {})
    assert found.times == pytest.approx([0.0, 0.1]) and list(found.ignored) == ["note"]
    assert found.columns["a.position.x"] == pytest.approx([1.0005, 1.001])
    assert found.columns["b.velocity.y"] == pytest.approx([0.03, 0.04])
    assert found.columns["H.angle"] == pytest.approx([math.pi / 2, math.pi])
    assert found.resolution["a.position.x"] == pytest.approx(1e-3)
    assert found.resolution["time"] == pytest.approx(1e-3)
    two = read(path, two_bodies(), {"b.position.z": "5", "a.position.x": "b.vy (cm/s):in"}, ["cm", "mm"])
    assert two.columns["b.position.z"] == pytest.approx([0.001, 0.002]), "the last unit of a quantity counts"
    assert two.columns["a.position.x"] == pytest.approx([3 * 0.0254, 4 * 0.0254])


def test_times_that_are_too_late_or_fall(tmp_path):
    """Times may end at 50 durations of 0.5 s."""
    path = tmp_path / "t.csv"
    path.write_text("time,a.x\n0,1\n25,2\n")
    assert read(path, two_bodies(), {}).times[-1] == 25.0
    for rows in ("0,1\n25.001,2", "-0.1,1\n1,2", "0,1\n0,2"):
        path.write_text(f"time,a.x\n{rows}\n")
        with pytest.raises(SceneError):
            read(path, two_bodies(), {})


def test_changes_of_a_scene_and_their_sentences():
    gravity, hinge, first_mass, second = changes(two_bodies())
    assert gravity.of(0.5).gravity == pytest.approx((0.0, -14.715, 0.0))
    assert gravity.says(9.80665 / 9.81 - 1) == "gravity of 9.80665 m/s², not 9.81"
    assert gravity.says(0.5) == "gravity of 14.715 m/s², not 9.81"
    damper = hinge.of(0.25).load[-1]
    assert (damper.joint, damper.stiffness, damper.damping) == ("H", 0.0, 0.25)
    assert hinge.of(-1.0).load[-1].damping == 0.0
    assert hinge.says(0.25) == "damping of 0.25 N m s/rad in joint 'H'"
    length = scales(two_bodies(), turned_by((0.0,), (0.0,)))["position"]
    assert hinge.small == pytest.approx(1e-3 * 2.0 * length**2 / 0.5)
    heavier = first_mass.of(0.2).body
    assert (heavier[0].mass, heavier[1].mass) == pytest.approx((1.2, 1.0))
    assert np.asarray(heavier[0].inertia) == pytest.approx(1.2 * np.ones(3))
    assert second.of(-2.0).body[1].mass == pytest.approx(1e-3)
    assert first_mass.says(0.2) == "mass and inertia of body 'a' times 1.2"
    assert second.says(-0.981) == "body 'b' has no mass"
    assert second.says(-0.979) == "mass and inertia of body 'b' times 0.021"
    assert len(list(changes(two_bodies().with_(gravity=(0.0, 0.0, 0.0))))) == 3


def fitted(monkeypatch, effect, recorded: np.ndarray):
    d = Difference(TIMES, {"A.angle": recorded}, {"A.angle": 0 * TIMES}, {"A.angle": 2.0}, motion)
    monkeypatch.setattr(changed_scenes, "_moved", lambda change, x, d: {"A.angle": effect(x)})
    return _fitted(Change(lambda x: two_bodies(), 0.1, str), d)


def test_a_change_is_fitted_by_the_secant_method(monkeypatch):
    """(x + x² / 10) t reaches 0.6 t + 0.036 t at x = 0.6."""
    value, columns = fitted(monkeypatch, lambda x: (x + 0.1 * x**2) * TIMES, 0.636 * TIMES)
    assert value == pytest.approx(0.6, abs=1e-5)
    assert columns["A.angle"] == pytest.approx(0.636 * TIMES, abs=1e-5)
    value, _ = fitted(monkeypatch, lambda x: x * np.sin(20 * TIMES), TIMES)
    assert value == 0.1, "it explains little and is fitted no further"
    assert fitted(monkeypatch, lambda x: 0 * TIMES, TIMES) is None
    monkeypatch.setattr(changed_scenes, "_moved", lambda *_: None)
    d = Difference(TIMES, {"A.angle": TIMES}, {"A.angle": 0 * TIMES}, {"A.angle": 2.0}, motion)
    assert _fitted(Change(lambda x: two_bodies(), 0.1, str), d) is None


def test_changes_end_with_their_time(monkeypatch):
    clock = iter(range(100))
    monkeypatch.setattr(changed_scenes, "time", SimpleNamespace(thread_time=lambda: float(next(clock))))
    monkeypatch.setattr(changed_scenes, "_fitted", lambda change, d: (0.5, {}))
    d = difference(kinds("position"))
    assert [count for _, count, _ in changed(two_bodies(), d, 2.0)] == [2, 2], "asked at 1 s and 2 s"


def test_two_causes_of_positions_and_velocities_alone(monkeypatch):
    recorded = kinds("position", "velocity")
    recorded |= {n: 1e3 * c for n, c in recorded.items() if kind_of(n) == "position"}
    recorded |= {"b.velocity.z": -recorded["b.velocity.z"]}
    d = difference(recorded)
    both = {s: n for s, n, _ in pairs_of_explanations.pairs(d, list(simple(d)), 60.0)}
    wanted = (
        "all columns of position: in mm, not m (factor 1000); and b.velocity.z: of opposite sign (factor -1)"
    )
    assert both[wanted] == 3
    clock = iter(range(100))
    monkeypatch.setattr(pairs_of_explanations.time, "process_time", lambda: float(next(clock)))
    assert len(list(pairs_of_explanations.pairs(d, list(simple(d)), 4.0))) == 4
