"""Recorded motions / differences that equal a limit, motions that begin late, and searches on paper."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.recorded import (
    changed_scenes,
    columns,
    explanations,
    judgement,
    pairs_of_explanations,
    reading,
)
from crosscheck.recorded.changed_scenes import Change, _fitted
from crosscheck.recorded.columns import kind_of
from crosscheck.recorded.exact import Exact
from crosscheck.recorded.explanations import Difference, Explanation, ranked, with_signs
from crosscheck.recorded.judgement import ColumnError, _column, _judged
from crosscheck.recorded.reading import Recording
from mbref import rotations
from mbref.scene import Body, Revolute, Scene, SceneError
from mbref.trajectory import Trajectory

BLOCK = Body(name="a", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0.0, 0.0))
SCENE = Scene(name="s", body=(BLOCK,), duration=2.0)
TIMES = 0.5 + 0.25 * np.arange(13)


def difference(times: np.ndarray = TIMES, **recorded: Any) -> Difference:
    """Columns whose exact motion is t², recorded as given, from 0.5 s on."""
    exact = dict.fromkeys(recorded, times**2)
    return Difference(
        times, recorded, exact, dict.fromkeys(recorded, 1.0), lambda t: dict.fromkeys(recorded, t**2), 0.5
    )


# --- explanations -------------------------------------------------------------------------------------------
def test_a_motion_that_begins_late_is_interpolated():
    """Every second of 13 samples is half a second apart."""
    found = {s: c["A.angle"] for s, _, c in explanations._interpolations(difference(**{"A.angle": TIMES}))}
    assert list(found) == [
        f"all columns: {what} 0.{x} s{apart}"
        for x in ("5", "75")
        for what, apart in (("straight lines between samples", " apart"), ("each value is repeated for", ""))
    ]
    lines = found["all columns: straight lines between samples 0.5 s apart"]
    assert lines == pytest.approx(np.interp(TIMES, TIMES[::2], TIMES[::2] ** 2))
    steps = found["all columns: each value is repeated for 0.75 s"]
    assert steps == pytest.approx(np.repeat(TIMES[::3] ** 2, 3)[:13])


def test_the_last_sample_ends_the_last_interval():
    """Every second sample of twelve is a node, and the last sample is a node."""
    given = difference(TIMES[:12], **{"A.angle": TIMES[:12]})
    found = {s: c["A.angle"] for s, _, c in explanations._interpolations(given)}
    lines, steps = (found[name] for name in list(found)[:2])
    assert lines[-1] == steps[-1] == TIMES[11] ** 2 and steps[-2] == TIMES[10] ** 2


@pytest.mark.parametrize("shift", [0.06, -0.13, 0.29])
def test_a_shift_of_a_motion_that_begins_late(shift):
    """Samples before the begin or after the end keep their recorded values."""
    inside = (TIMES - shift >= 0.5) & (TIMES - shift <= TIMES[-1])
    moved = np.where(inside, (TIMES - shift) ** 2, 7.0)
    [(sentence, count, predicted)] = explanations._shifts(difference(**{"A.angle": moved}))
    assert sentence == f"all columns: later by {shift:.6g} s" and count == 1
    assert predicted["A.angle"] == pytest.approx(moved, abs=1e-6)


def test_sizes_of_shifts():
    assert (
        explanations.SHIFTS[0] == -0.1 and explanations.SHIFTS[-1] == 0.1 and len(explanations.SHIFTS) == 41
    )


def cause(left: float, complexity: int = 1, name: str = "") -> tuple[str, int, dict[str, np.ndarray]]:
    return name or f"{left}", complexity, {"A.angle": np.full(2, 1.0 - left)}


def best(*causes: Any, noise: float = 0.0) -> list[str]:
    given = Difference(
        np.arange(2.0), {"A.angle": np.ones(2)}, {"A.angle": np.zeros(2)}, {"A.angle": 1.0}, lambda t: {}
    )
    return [e.sentence for e in ranked(given, causes, noise)]


def test_causes_at_the_limits():
    """Twenty times the best fit, or three times the noise, is as good; half of the difference is too much."""
    assert best(cause(0.015625, 2), cause(0.3125, 1)) == ["0.3125", "0.015625"]
    assert best(cause(0.015625, 2), cause(0.3126, 1)) == ["0.015625", "0.3126"]
    assert best(cause(0.0, 2), cause(0.375, 1), noise=0.125) == ["0.375", "0.0"]
    assert best(cause(0.0, 2), cause(0.376, 1), noise=0.125) == ["0.0", "0.376"]
    assert best(cause(0.5)) == [] and best(cause(0.49)) == ["0.49"]
    assert best(*(cause(k / 64) for k in (20, 4, 3, 2))) == ["0.03125", "0.046875", "0.0625"], (
        "the best three"
    )
    assert best(cause(0.25, 2, "two"), cause(0.375, 1, "one"), cause(0.125, 2, "near")) == [
        "one",
        "near",
        "two",
    ]


def test_a_quaternion_across_the_recorded_one_keeps_its_sign():
    names = [f"a.orientation.{axis}" for axis in "wxyz"]
    recorded = dict(zip(names, np.array([[1.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]), strict=True))
    predicted = dict(zip(names, np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]), strict=True))
    found = np.array([with_signs(recorded, predicted)[name] for name in names]).T
    assert found.tolist() == [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]


def test_sets_of_columns():
    names = ["a.position.x", "a.position.y", "b.position.x", "b.velocity.z", "A.angle"]
    scopes = list(explanations._scopes(difference(**dict.fromkeys(names, TIMES))))
    assert scopes == [
        ("all columns of position", names[:3]),
        ("b.velocity.z", names[3:4]),
        ("A.angle", names[4:]),
        ("a.position", names[:2]),
        ("b.position.x", names[2:3]),
        ("a.position.x", names[:1]),
        ("a.position.y", names[1:2]),
    ]


def vectors(kind: str, values: np.ndarray, body: str = "a") -> dict[str, np.ndarray]:
    return dict(zip([f"{body}.{kind}.{axis}" for axis in explanations.VECTORS[kind]], values.T, strict=True))


CURVE = np.stack([TIMES, TIMES**2, np.sin(TIMES)], axis=1)


def test_exchanged_components_and_their_numbers_of_parameters():
    """Five orders have eight signs each; the order itself has the three signs with two reversals."""
    exact = vectors("position", CURVE)
    given = Difference(TIMES, exact, exact, dict.fromkeys(exact, 1.0), lambda t: {})
    found = {s: (n, c) for s, n, c in explanations._axes(given) if s.startswith("a.position")}
    assert len(found) == 5 * 8 + 3
    count, predicted = found["a.position: x, y, z hold -y, -z, -x of the exact motion"]
    assert count == 5 and [c[3] for c in predicted.values()] == pytest.approx(-CURVE[3, [1, 2, 0]])
    count, predicted = found["a.position: x, y, z hold x, -y, -z of the exact motion"]
    assert count == 4 and [c[3] for c in predicted.values()] == pytest.approx(CURVE[3] * [1, -1, -1])
    assert found["a.position: x, y, z hold y, z, x of the exact motion"][0] == 2
    titles = {s.partition(":")[0] for s, *_ in explanations._axes(given)}
    assert titles == {"all bodies", "a", "all columns of position", "a.position"}


def test_a_world_frame_of_a_mirror_is_none():
    """The frame that fits is a rotation, also where a reflection would fit better."""
    exact, recorded = vectors("position", CURVE), vectors("position", CURVE * [1, 1, -1] + [1.0, 2.0, 3.0])
    given = Difference(TIMES, recorded, exact, dict.fromkeys(exact, 1.0), lambda t: {})
    [(sentence, count, predicted)] = explanations._frames(given)
    found = np.array(list(predicted.values())).T
    turn = np.linalg.lstsq(CURVE - CURVE.mean(axis=0), found - found.mean(axis=0), rcond=None)[0]
    assert np.linalg.det(turn) == pytest.approx(1.0) and count == 6
    assert found.mean(axis=0) == pytest.approx(CURVE.mean(axis=0) * [1, 1, -1] + [1.0, 2.0, 3.0])
    assert sentence.startswith("all bodies: another world frame, turned by ")


def test_a_frame_that_is_turned_by_a_right_angle_about_z():
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = rotations.from_vector(np.outer(TIMES, [0.2, 0.1, 0.4]))
    exact = vectors("position", CURVE) | vectors("orientation", turns) | vectors("velocity", 2 * CURVE)
    turned = rotations.multiply(np.array([0.5**0.5, 0.0, 0.0, 0.5**0.5]), turns)
    recorded = vectors("position", CURVE @ quarter.T + [3.0, -1.0, 2.0]) | vectors("orientation", turned)
    recorded |= vectors("velocity", 2 * CURVE @ quarter.T)
    given = Difference(TIMES, recorded, exact, dict.fromkeys(exact, 1.0), lambda t: {})
    [(sentence, _, predicted)] = explanations._frames(given)
    assert sentence == "all bodies: another world frame, turned by 90 degrees, origin at (3, -1, 2) m"
    assert given.size(predicted) < 1e-12


def test_another_point_with_orientations_at_the_samples():
    """The orientation is not recorded; the orientation of the exact motion is used."""
    turns = rotations.from_vector(np.outer(TIMES, [0.0, 0.0, 0.5]))
    arm = rotations.rotate(turns, np.array([0.25, 0.5, 0.0]))
    exact = vectors("position", CURVE) | vectors("velocity", CURVE)
    recorded = {**exact, **vectors("position", CURVE + arm)}
    later = lambda t: vectors("orientation", rotations.from_vector(np.outer(t, [0.0, 0.0, 0.5])))  # noqa: E731
    given = Difference(TIMES, recorded, exact, dict.fromkeys(exact, 1.0), later)
    [(sentence, count, predicted)] = explanations._points(given)
    assert (
        sentence == "a: a point at (0.25, 0.5, 0) m in the body's frame, not the centre of mass"
        and count == 4
    )
    assert set(predicted) == set(vectors("position", CURVE)) and given.size(predicted) < 1e-12


# --- changed scenes -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("value", "says"),
    [
        (9.8, "9.8"),
        (9.81, "9.81"),
        (9.80665, "9.80665"),
        (10.0, "10"),
        (9.8 + 9e-7, "9.8"),
        (9.8 + 1.1e-6, "9.800001"),
    ],
)
def test_known_values_of_gravity(value, says):
    assert changed_scenes._gravity(value) == says


def fitted(effect: Any, recorded: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, list[float]]:
    tried: list[float] = []
    exact = {"A.angle": 0 * TIMES}
    given = Difference(TIMES, {"A.angle": recorded}, exact, {"A.angle": 2.0}, lambda t: {})
    monkeypatch.setattr(
        changed_scenes, "_moved", lambda change, x, d: tried.append(x) or {"A.angle": effect(x)}
    )
    return _fitted(Change(lambda x: SCENE, 0.125, str), given), tried


def test_a_linear_change_is_fitted_in_one_step(monkeypatch):
    (value, predicted), tried = fitted(lambda x: x * TIMES, TIMES, monkeypatch)
    assert value == pytest.approx(1.0) and tried == pytest.approx([0.125, 1.0])
    assert predicted["A.angle"] == pytest.approx(TIMES)


def test_five_steps_at_most(monkeypatch):
    """(x + x² / 2) t reaches t at √3 - 1; each step leaves a quarter of the error."""
    (value, predicted), tried = fitted(lambda x: (x + 0.5 * x**2) * TIMES, TIMES, monkeypatch)
    assert len(tried) == 1 + 5 and value == tried[-1] == pytest.approx(math.sqrt(3) - 1, abs=1e-2)
    assert predicted["A.angle"] == pytest.approx((value + 0.5 * value**2) * TIMES)


@pytest.mark.parametrize(("share", "count"), [(0.69, 2), (0.71, 1)])
def test_a_change_that_leaves_seven_tenths_is_not_fitted_further(monkeypatch, share, count):
    """The recorded difference has a part across the effect of the change."""
    along, across = np.zeros(13), np.zeros(13)
    along[0], across[1] = math.sqrt(1 - share**2), share
    (value, _), tried = fitted(lambda x: x * along, along + across, monkeypatch)
    assert len(tried) == count and value == (pytest.approx(1.0) if count > 1 else 0.125)


def test_scenes_are_changed_while_there_is_time(monkeypatch):
    clock = iter([0.0, 3.0, 3.1])
    monkeypatch.setattr(changed_scenes, "time", SimpleNamespace(thread_time=lambda: next(clock)))
    monkeypatch.setattr(changed_scenes, "changes", lambda scene: [Change(None, 1.0, lambda x: f"by {x}")] * 3)
    monkeypatch.setattr(changed_scenes, "_fitted", lambda change, d: (0.5 * change.small, {"A": d}))
    assert list(changed_scenes.changed(SCENE, 1, 3.0)) == [("by 0.5", 2, {"A": 1})]


def test_a_damper_to_begin_with(monkeypatch):
    """A thousandth of the mass of 2 kg times the square of the length over the duration of 2 s; a link has no
    mass."""
    monkeypatch.setattr(changed_scenes, "scene_length", lambda scene: 4.0)
    hinge = Revolute(name="H", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    link = Body(name="link", mass=0.0, inertia=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0))
    damper, mass, *_ = changed_scenes.changes(SCENE.with_(body=(BLOCK, link), joint=(hinge,)))
    assert damper.small == pytest.approx(1e-3 * 2.0 * 16.0 / 2.0) and mass.small == -0.05
    assert damper.of(0.25).load[0].damping == 0.25 and damper.of(0.25).load[0].stiffness == 0.0


def test_a_mass_that_is_none():
    change = changed_scenes._mass(SCENE, "a")
    assert change.says(-0.98) == "mass and inertia of body 'a' times 0.02" or "no mass" in change.says(-0.98)
    assert change.says(-0.985) == "body 'a' has no mass" and change.says(-0.975).endswith("times 0.025")
    assert change.of(-0.5).body[0].inertia == (0.5, 0.5, 0.5)


# --- two causes ---------------------------------------------------------------------------------------------
def test_causes_that_are_completed_by_a_second_one(monkeypatch):
    """The best six that leave less than nine tenths; parameters add up, and one for the pair."""
    given = Difference(
        TIMES,
        {"A.angle": np.ones(13)},
        {"A.angle": np.zeros(13)},
        {"A.angle": 1.0},
        lambda t: {"A.angle": 0 * t},
    )
    asked: list[Difference] = []
    second = "second", 2, {"A.angle": np.full(13, 5.0)}
    monkeypatch.setattr(pairs_of_explanations, "simple", lambda d: asked.append(d) or [second])
    lefts = [0.95, 0.875, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.9]
    singles = [(f"{left}", k, {"A.angle": np.full(13, 1.0 - left)}) for k, left in enumerate(lefts)]
    found = list(pairs_of_explanations.pairs(given, singles, 60.0))
    assert [s for s, _, _ in found] == [f"{left}; and second" for left in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)]
    assert [n for _, n, _ in found] == [7 + 3, 6 + 3, 5 + 3, 4 + 3, 3 + 3, 2 + 3]
    assert found[0][2]["A.angle"][0] == 5.0
    assert asked[0].exact["A.angle"].tolist() == [0.7] * 13 and asked[0].begin == 0.5
    assert asked[0].later(np.array([1.0]))["A.angle"] == pytest.approx([0.7])
    few = list(pairs_of_explanations.pairs(given, [("edge", 1, {"A.angle": np.full(13, 0.1)})], 60.0))
    assert len(few) <= 1 and list(pairs_of_explanations.pairs(given, singles[:1], 60.0)) == []


def test_pairs_end_with_their_time(monkeypatch):
    given = difference(**{"A.angle": TIMES})
    monkeypatch.setattr(pairs_of_explanations, "simple", lambda d: [("second", 2, {})] * 5)
    single = ("first", 1, {"A.angle": TIMES + 0.1})
    for limit, count in ((2.0, 2), (3.0, 3), (1.5, 1)):
        clock = iter(float(k) for k in range(99))
        process = SimpleNamespace(process_time=lambda clock=clock: next(clock))
        monkeypatch.setattr(pairs_of_explanations, "time", process)
        assert len(list(pairs_of_explanations.pairs(given, [single], limit))) == count


# --- columns ------------------------------------------------------------------------------------------------
def test_quaternions_across_each_other_keep_their_sign():
    q = np.array([[1.0, 0, 0, 0], [0.0, 1, 0, 0], [0.0, -1, 0, 0], [0.0, -0.8, 0.6, 0], [0.0, 0.8, 0.6, 0]])
    assert columns._continuous(q)[:, 1].tolist() == [0.0, 1.0, 1.0, 0.8, 0.8]


def test_sizes_of_quantities(monkeypatch):
    """The fastest of two bodies by the length of its velocity, and the scene's length over its duration."""
    monkeypatch.setattr(columns, "scene_length", lambda scene: 4.0)
    velocity, spin = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    velocity[1, 1], spin[0, 1] = (3.0, 4.0, 0.0), (0.0, 0.6, 0.8)
    moving = SimpleNamespace(velocity=velocity, angular_velocity=spin)
    assert columns.scales(SCENE, moving) == {
        "position": 4.0,
        "displacement": 4.0,
        "orientation": 1.0,
        "angle": 1.0,
        "velocity": 5.0,
        "angular_velocity": 1.0,
    }
    slow = SimpleNamespace(velocity=velocity / 5, angular_velocity=spin / 5)
    found = columns.scales(SCENE, slow)
    assert (found["velocity"], found["angular_velocity"]) == (2.0, 0.5)


# --- tables -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("cells", "count"),
    [
        (["0.00120"], 3),
        (["-1.5e-12", "+2.25"], 3),
        (["100"], 3),
        (["0", "0.0"], 0),
        (["12345678901234.5"], 15),
    ],
)
def test_significant_digits(cells, count):
    assert reading._digits(cells) == count


@pytest.mark.parametrize(
    ("cells", "numbers", "whole", "wanted"),
    [
        (["1.5", "2.25"], [1.5, 2.25], False, 0.1),
        (["1.5e2", "2.25e3"], [150.0, 2250.0], False, 10.0),
        (["1.5", "-4.0"], [1.5, -4.0], True, 4.0 * 2.0**-52),
        (["0.0"], [0.0], False, 0.0),
        (["3"], [3.0], False, 1.0),
    ],
)
def test_last_digits(cells, numbers, whole, wanted):
    assert reading._last_digit(cells, np.array(numbers), whole) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("times", "is_valid"), [([0.0, 1.0], True), ([0.0, 100.0], True), ([0.0, 100.1], False)]
)
def test_times_up_to_fifty_durations(tmp_path, times, is_valid):
    given = np.array(times)
    if is_valid:
        assert reading._checked_times(given, SCENE, tmp_path) is given
    else:
        with pytest.raises(SceneError, match=r"times end at 100\.1 s, and the scene's duration is 2 s"):
            reading._checked_times(given, SCENE, tmp_path)


def test_rows_that_are_no_numbers(tmp_path):
    rows = [["1", "2"], ["3", "inf"], ["4", "nan"]]
    assert reading._numbers(rows[:1], 2, tmp_path).tolist() == [[1.0, 2.0]]
    with pytest.raises(SceneError, match="row 2 is not finite"):
        reading._numbers(rows, 2, tmp_path)
    for row in (["3"], ["3", "x"], ["3", "4", "5"]):
        with pytest.raises(SceneError, match="row 3 of numbers is not 2 numbers"):
            reading._numbers([*rows[:2], row], 2, tmp_path)


# --- judgements ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("largest", "bound", "allowed", "begins"),
    [(1.0, 1.0, 0.5, None), (1.0, 0.9, 0.5, 2.0), (1.0, 0.5, 1.0, None)],
)
def test_the_begin_of_an_error(largest, bound, allowed, begins):
    """The error exceeds a hundredth of its largest value for the first time at the third sample."""
    error = np.array([0.0, -0.01, 0.0101, -largest])
    found = _column("c", error, np.arange(4.0), bound, allowed)
    assert found == ColumnError("c", largest, bound, max(bound, allowed), begins)
    assert found.is_right is (begins is None)


def judged(monkeypatch: pytest.MonkeyPatch, off: float, times: np.ndarray, **more: Any) -> Any:
    """A block at (1 + t, 0, 0), known to 2 s at quarters of a second; the recording is off along y."""
    known = 0.25 * np.arange(9)
    place, still = np.zeros((9, 1, 3)), np.zeros((9, 1, 3))
    place[:, 0, 0] = 1.0 + known
    still[:, 0, 0] = 1.0
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (9, 1, 1))
    run = Trajectory("s", "truth", "1", "m", {}, known, ("a",), place, turn, still, 0 * still)
    bound = np.full(9, 1e-9)
    bound[4] = 3e-9
    asked: list[Any] = []
    monkeypatch.setattr(
        judgement,
        "_explanations",
        lambda scene, d, noise: asked.append((d, noise)) or [Explanation("e", 0.1, 1)],
    )
    given = {"a.position.y": np.full(len(times), off), "a.position.x": 1.0 + times, "a.gap": times}
    recording = Recording(times, {n: c for n, c in given.items() if kind_of(n)}, **more)
    return _judged(SCENE, recording, Exact(run, bound, "it ends"), 1e-6), asked


def test_a_recording_within_its_tolerance(monkeypatch):
    found, asked = judged(monkeypatch, 1e-7, np.array([0.0, 0.5, 2.0, 2.5]))
    assert (
        found.is_right
        and not found.explanations
        and not asked
        and (found.until, found.reason) == (2.0, "it ends")
    )
    first, second = found.columns
    assert (first.name, first.largest, second.largest) == ("a.position.y", 1e-7, 0.0)
    length = columns.scales(
        SCENE, SimpleNamespace(velocity=np.zeros((1, 1, 3)), angular_velocity=np.zeros((1, 1, 3)))
    )
    assert (
        first.bound == pytest.approx(1e-9 * length["position"]) and first.allowed == 1e-6 * length["position"]
    )


def test_a_recording_that_is_off(monkeypatch):
    """The largest bound at its samples, and the last digit of the table, count as its noise."""
    found, [(given, noise)] = judged(
        monkeypatch, 0.25, np.array([0.0, 1.0]), resolution={"a.position.x": 4e-9, "other": 1.0}
    )
    assert not found.is_right and [e.sentence for e in found.explanations] == ["e"]
    y, x = found.columns
    size = given.scale["a.position.x"]
    assert y.bound == pytest.approx(3e-9 * size) and x.bound == pytest.approx(3e-9 * size + 4e-9)
    assert noise == pytest.approx(math.hypot(y.bound, x.bound) / size / math.sqrt(2))
    assert given.times.tolist() == [0.0, 1.0] and given.exact["a.position.x"].tolist() == [1.0, 2.0]
    assert given.recorded["a.position.y"].tolist() == [0.25, 0.25]
    assert given.later(np.array([0.3]))["a.position.x"] == pytest.approx([1.3])


@pytest.mark.parametrize(
    ("simple_left", "changed_left", "noise", "tried"),
    [
        (0.9e-5, 0.0, 0.0, ["simple"]),
        (1.1e-5, 0.9e-5, 0.0, ["simple", "changed"]),
        (0.25, 0.9e-3, 0.0, ["simple", "changed"]),
        (0.25, 1.1e-3, 0.0, ["simple", "changed", "pairs"]),
        (0.25, 0.25, 0.25 / 3, ["simple"]),
        (0.25, 0.25, 0.24 / 3, ["simple", "changed", "pairs"]),
        (0.9, 0.9, 0.0, ["simple", "changed", "pairs"]),
    ],
)
def test_what_is_tried_in_turn(monkeypatch, simple_left, changed_left, noise, tried):
    """Changed scenes where simpler causes leave more than 1e-5, pairs where all leave more than 1e-3."""
    seen: list[str] = []
    given = Difference(
        np.arange(2.0), {"A.angle": np.ones(2)}, {"A.angle": np.zeros(2)}, {"A.angle": 1.0}, lambda t: {}
    )

    def causes(name: str, left: float) -> Any:
        def asked(*of: Any) -> list[Any]:
            seen.append(name)
            assert name == "simple" or of[-1] == 20.0, "s of CPU time"
            assert {"simple": of[0] is given, "changed": of[:2] == (SCENE, given), "pairs": of[0] is given}[
                name
            ]
            return [cause(left, 1, name)]

        return asked

    monkeypatch.setattr(judgement, "simple", causes("simple", simple_left))
    monkeypatch.setattr(judgement, "changed", causes("changed", changed_left))
    monkeypatch.setattr(judgement, "pairs", causes("pairs", 0.0))
    found = judgement._explanations(SCENE, given, noise)
    assert seen == tried and (not found or found[0].sentence in tried)


@pytest.mark.parametrize(("left", "tried"), [(2.0**-17, 1), (2.0**-10, 2), (2.0**-9, 3)])
def test_what_is_tried_at_the_limits(monkeypatch, left, tried):
    monkeypatch.setattr(judgement, "EXACT", 2.0**-17)
    monkeypatch.setattr(judgement, "EXPLAINED", 2.0**-10)
    seen: list[str] = []
    given = Difference(
        np.arange(2.0), {"A.angle": np.ones(2)}, {"A.angle": np.zeros(2)}, {"A.angle": 1.0}, lambda t: {}
    )
    for name in ("simple", "changed", "pairs"):
        monkeypatch.setattr(
            judgement, name, lambda *of, name=name: seen.append(name) or [cause(left, 1, name)]
        )
    judgement._explanations(SCENE, given, 0.0)
    assert len(seen) == tried


def test_a_motion_without_a_reference(monkeypatch):
    empty = SimpleNamespace(times=np.zeros(0))
    monkeypatch.setattr(
        judgement, "exact", lambda scene, times, seconds: Exact(empty, np.zeros(0), "no time")
    )
    with pytest.raises(SceneError, match="s: has no reference: no time"):
        judgement.judge_motion(SCENE, {"time": [0.0, 1.0], "a.position.x": [1.0, 1.0]})


def test_a_recording_by_its_file_or_its_columns(monkeypatch, tmp_path):
    """The exact motion is asked for the scene, at the times of the recording and between them."""
    asked: list[Any] = []
    recording = Recording(np.array([0.0, 1.0]), {"a.position.x": np.ones(2)})
    monkeypatch.setattr(judgement, "read", lambda *of: asked.append(of) or recording)
    known = Exact(SimpleNamespace(times=np.array([0.0, 1.0])), np.zeros(2), "")
    monkeypatch.setattr(judgement, "exact", lambda *of: asked.append(of) or known)
    monkeypatch.setattr(judgement, "_judged", lambda *of: of)
    scene, judged_recording, found, tolerance = judgement.judge_motion(
        SCENE, str(tmp_path / "t.csv"), 7.0, 0.5
    )
    assert asked[0] == (tmp_path / "t.csv", SCENE, {}) and asked[1][::2] == (SCENE, 7.0)
    assert len(asked[1][1]) == 401 and scene == SCENE and found is known and tolerance == 0.5
    assert judged_recording.columns["a.position.x"].tolist() == [1.0, 1.0]


@pytest.mark.parametrize(("sample", "count"), [(1.9991, 401), (2.0009, 401), (1.9989, 402), (2.0011, 402)])
def test_further_times_before_and_after_a_sample(sample, count):
    """Hundredths of a second that are a thousandth from a sample, on either side, are left out."""
    found = judgement._with_dense(np.array([0.0, sample, 4.0]))
    assert len(found) == count and sample in found
