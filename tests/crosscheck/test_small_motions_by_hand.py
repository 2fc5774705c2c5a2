"""Small motions / paired eigenvalues, records, sentences and posed scenes worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.small_motions.equilibria import Steady
from crosscheck.judge.small_motions.posed import posed
from crosscheck.judge.small_motions.turning import REST, Turning, turning
from crosscheck.small_motions import compare, document, records
from crosscheck.small_motions.compare import Result, error, of_engine
from crosscheck.small_motions.mechanisms import MECHANISMS
from mbref.scene import (
    Body,
    Cylindrical,
    Distance,
    Driver,
    Factor,
    Force,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    SceneError,
    Sine,
    SlideSpring,
    Spring,
    TorsionSpring,
    Universal,
)

X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
HALF = math.sqrt(0.5)
PAIR = ("ground", "b")


def body(**parts: Any) -> Body:
    return Body(
        **{"name": "b", "mass": 2.0, "inertia": (1.0, 1.0, 1.0), "position": (1.0, 2.0, 0.0), **parts}
    )


def hinge(bodies: tuple[str, str] = PAIR, axis: tuple[float, ...] = (0.0, 0.0, 3.0)) -> Revolute:
    return Revolute(name="H", bodies=bodies, anchor=(0.5, 0.0, 0.0), axis=axis)


def scene(**parts: Any) -> Scene:
    return Scene(
        **{"name": "s", "body": (body(),), "joint": (hinge(),), "gravity": (0.0, 0.0, -9.0), **parts}
    )


# --- eigenvalues ------------------------------------------------------------------------------------------
def test_errors_of_paired_eigenvalues():
    """The pairs with the least sum: 1 with 1.5, 2 with 2, 4 with 3; the largest gap over 4."""
    assert error(np.array([3.0, 1.5, 2.0]), np.array([4.0, 1.0, 2.0])) == pytest.approx(0.25)
    assert error(np.array([1.0 + 3j, 1.0]), np.array([1.0])) == 0.0, "further eigenvalues are left out"
    assert error(np.array([1.0]), np.array([1.0, 2.0])) == math.inf
    assert error(np.array([0.25]), np.array([0.0])) == 0.25, "the largest one is zero"
    assert error(np.zeros(0), np.zeros(0)) == 0.0


@pytest.mark.parametrize(
    ("values", "stability"),
    [
        ([-1.0 + 2j, -1.0 - 2j], "stable"),
        ([2j, -2j], "stable"),
        ([1e-6 + 0.5j, 1e-6 - 0.5j], "unstable"),
        ([0.4e-6 + 0.5j, -0.4e-6 - 0.5j], "stable"),
        ([1.0, -1.0], "unstable"),
        ([0.9e-6, 1.0], "indifferent"),
        ([0.0, 0.0], "indifferent"),
        ([], "indifferent"),
    ],
)
def test_stability_by_the_largest_real_part(values, stability):
    steady = Steady(O, O, np.array(values, dtype=complex), 0.0, None, None, None)
    assert steady.stability == stability


def engine(**parts: Any) -> Any:
    made = {"name": "e", "cannot": lambda scene: None, "version": lambda: "1.2"}
    return SimpleNamespace(**{**made, **parts})


def test_an_engine_that_refuses_a_scene(monkeypatch):
    monkeypatch.setattr(compare, "at_pose", lambda balance, state: scene())
    refusing = engine(cannot=lambda scene: SimpleNamespace(reason="no hinges"))
    steady = SimpleNamespace(balance=SimpleNamespace(motion=REST, scene=scene()), state=None)
    assert list(of_engine(refusing, scene(), steady)) == [Result("e", "", None, "no hinges")]
    without = engine(best_settings=lambda scene: [])
    assert list(of_engine(without, scene(), steady)) == [
        Result("e", "accelerations", None, "no setting serves the mechanism")
    ]


# --- records ----------------------------------------------------------------------------------------------
def test_exact_eigenvalues_of_a_pose():
    known = [(1.0, 2.0), (1.0, 3.0)]
    assert records._nearest(np.array([1.0, 3.002]), known).tolist() == [1.0, 3.0]
    assert (
        records._nearest(np.array([1.0, 3.004]), known) is None and records._nearest(np.ones(1), []) is None
    )
    assert records._nearest(np.array([1.0, 3.003003]), known) is None, "relative to the exact ones"
    assert records._nearest(np.array([1.0, 1001.0]), [(1.0, 1000.0)]) is not None
    assert records._nearest(np.array([1.0, 1001.1]), [(1.0, 1000.0)]) is None


def test_results_of_engines_in_turn(monkeypatch):
    said: list[str] = []
    monkeypatch.setattr(records, "engine", lambda name: f"engine {name}")
    monkeypatch.setattr(records, "of_engine", lambda *asked: iter([asked, "second"]))
    found = records._results("scene", "steady", ["a", "b"], said.append)
    assert found == [("engine a", "scene", "steady"), "second", ("engine b", "scene", "steady"), "second"]
    assert said == ["a", "b"]


def test_records_of_all_mechanisms(monkeypatch):
    said: list[str] = []

    def measured(scene: Any, engines: Any, known: Any, progress: Any) -> list[Any]:
        progress("begun")
        return [(scene, engines, known)] * 2

    made = [SimpleNamespace(name=name, make=lambda n=name: n, known=lambda n=name: [n]) for name in "xy"]
    monkeypatch.setattr(records, "measured", measured)
    monkeypatch.setattr(records, "MECHANISMS", made)
    found = records.of_mechanisms(["e"], said.append)
    assert found == [("x", ["e"], ["x"])] * 2 + [("y", ["e"], ["y"])] * 2 and said == ["x: begun", "y: begun"]
    assert records.of_mechanisms([]) == [("x", [], ["x"])] * 2 + [("y", [], ["y"])] * 2


def steady(values: Any = (-1.0 + 2j, -1.0 - 2j), rate: float = 0.0) -> Any:
    return SimpleNamespace(
        position=np.zeros((1, 3)),
        orientation=np.array([[1.0, 0.0, 0.0, 0.0]]),
        eigenvalues=np.array(values, dtype=complex),
        uncertainty=1e-12,
        stability="stable",
        balance=SimpleNamespace(motion=SimpleNamespace(rate=rate)),
        rate=rate,
    )


def own(shift: float, *values: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.full((1, 3), shift), np.array([[1.0, 0.0, 0.0, 0.0]]), np.array(values, dtype=complex)


def test_the_record_of_a_pose(monkeypatch):
    """The second pose of the search is the judge's; lengths are over the scene's length of 2 m."""
    monkeypatch.setattr(records, "engine", lambda name: engine())
    monkeypatch.setattr(compare, "scene_length", lambda scene: 2.0)
    poses = [own(0.5, 9.0, 9.0), own(1e-7, -1.0 + 2.5j, -1.0 - 2j), own(1e-6, 7.0, 7.0)]
    results = [Result("e", "w", np.array([-1.0 + 2j, -1.5 - 2j])), Result("f", "", None, "no")]
    exact = np.array([-1.0 + 2j, -1.0 - 2j])
    found = records._record(scene(), steady(rate=3.0), exact, poses, results)
    size = math.sqrt(5)
    assert found == {
        "scene": "s",
        "stability": "stable",
        "rate": 3.0,
        "eigenvalues": [[-1.0, 2.0], [-1.0, -2.0]],
        "uncertainty": 1e-12,
        "error": 0.0,
        "mbref_distance": pytest.approx(5e-8),
        "mbref_error": pytest.approx(0.5 / size),
        "results": [
            {"engine": "e", "version": "1.2", "way": "w", "reason": "", "error": pytest.approx(0.5 / size)},
            {"engine": "f", "version": "1.2", "way": "", "reason": "no", "error": None},
        ],
    }
    third = records._record(scene(), steady([1 / 3 + 2j / 3]), None, [], [])
    assert third["eigenvalues"] == [[0.3333333333333, 0.6666666666667]], "thirteen digits"
    off = records._record(scene(), steady([1.0, 2.5]), np.array([1.0, 2.0]), [], [])
    assert off["error"] == pytest.approx(0.25), "relative to the exact one"
    alone = records._record(scene(), steady(), None, [own(0.5, 1.0)], [])
    assert alone["error"] is alone["mbref_distance"] is alone["mbref_error"] is None
    assert records._record(scene(), steady(), None, [], [])["mbref_distance"] is None


@pytest.mark.parametrize(("shift", "is_found"), [(1.9e-6, True), (2e-6, False), (2.1e-6, False)])
def test_a_pose_counts_as_found_below_a_millionth_of_the_length(monkeypatch, shift, is_found):
    monkeypatch.setattr(compare, "scene_length", lambda scene: 2.0)
    found = records._record(scene(), steady(), None, [own(shift, 1.0, 1.0)], [])
    assert (found["mbref_distance"] is not None) is is_found


def test_poses_that_are_measured(monkeypatch):
    """With known eigenvalues only their poses have records."""
    said: list[str] = []
    monkeypatch.setattr(records, "steady_poses", lambda scene, starts: [steady([1.0]), steady([2.0])])
    monkeypatch.setattr(records, "search", lambda scene: "own")
    monkeypatch.setattr(
        records,
        "_results",
        lambda scene, each, engines, progress: [
            *("r" if (scene.name, each.rate) == ("s", 0) else ""),
            *engines,
        ],
    )
    monkeypatch.setattr(
        records, "_record", lambda scene, each, of, own, results: (each.eigenvalues[0], of, own, results)
    )
    every = records.measured(scene(), ["e"], progress=said.append)
    assert every == [(1.0, None, "own", ["r", "e"]), (2.0, None, "own", ["r", "e"])]
    assert said == ["the judge's search", "mbref's search"]
    [(value, exact, *_)] = records.measured(scene(), ["e"], [(2.0,)])
    assert value == 2.0 and exact.tolist() == [2.0]


def test_results_of_engines_that_were_not_measured_again():
    def record(name: str, *engines: str, values: Any = (1.0,)) -> dict[str, Any]:
        return {
            "scene": name,
            "eigenvalues": list(values),
            "results": [{"engine": e, "of": name} for e in engines],
        }

    old = [record("a", "e", "f"), record("b", "e", "g"), record("a", "h", values=(2.0,))]
    new = [record("a", "f"), record("b", "e", "g"), record("c", "e")]
    found = records.merged(new, old)
    assert [[each["engine"] for each in r["results"]] for r in found] == [["e", "f"], ["e", "g"], ["e"]]


def test_stored_records_are_one_a_line(tmp_path):
    path = tmp_path / "r.json"
    records.write([{"a": 1}, {"b": 2}], path)
    assert path.read_text() == '[\n{"a": 1},\n{"b": 2}\n]\n' and records.read(path) == [{"a": 1}, {"b": 2}]


# --- sentences --------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("value", "text"), [(0.9e-15, "< 1e-15"), (1e-15, "1e-15"), (0.0234, "2e-02"), (0.0, "< 1e-15")]
)
def test_sizes_of_errors(value, text):
    assert document.size(value) == text


@pytest.mark.parametrize(
    ("real", "imaginary", "text"),
    [
        (-1.5, 0.0, "-1.5"),
        (0.0, 2.0, "+2 i"),
        (0.0, -2.0, "-2 i"),
        (-1.0, 2.5, "-1 + 2.5 i"),
        (-1.0, -2.5, "-1 - 2.5 i"),
        (0.9e-12, 1.0, "+1 i"),
        (2.0, 1e-12, "2"),
        (1.1e-12, 1.0, "1.1e-12 + 1 i"),
        (1.0 / 3.0, 0.0, "0.3333333333"),
    ],
)
def test_complex_numbers(real, imaginary, text):
    assert document.written(real, imaginary) == text


def shown(**parts: Any) -> dict[str, Any]:
    made = {
        "scene": MECHANISMS[0].name,
        "stability": "stable",
        "rate": 0.0,
        "eigenvalues": [[0.0, 2.0], [0.0, -2.0]],
        "uncertainty": 3e-12,
        "error": 2e-11,
        "mbref_distance": 4e-10,
        "mbref_error": 5e-9,
        "results": [
            {"engine": "e", "version": "1", "way": "w", "reason": "", "error": 6e-8},
            {"engine": "f", "version": "", "way": "", "reason": "no springs", "error": None},
        ],
    }
    return {**made, **parts}


def test_sentences_on_a_pose():
    assert document.heading(shown()) == "Equilibrium, stable"
    assert document.heading(shown(rate=2.5, stability="unstable")) == "Steady motion at 2.5 rad/s, unstable"
    assert (
        document.search(shown())
        == "`mbref equilibrium` finds this pose, 4e-10 lengths or rad from the judge's."
    )
    assert (
        document.search(shown(mbref_distance=None))
        == "The search of `mbref equilibrium` does not find this pose."
    )
    assert document._pose(shown()) == (
        "- Equilibrium, stable: s = +2 i, -2 i 1/s. "
        "`mbref equilibrium` finds this pose, 4e-10 lengths or rad from the judge's."
    )


def test_rows_of_a_pose():
    found = [("mbref modes", "5e-09"), ("e 1, w", "6e-08"), ("f ", "no springs")]
    assert list(document.rows(shown())) == [("judge", "2e-11"), *found]
    assert list(document.rows(shown(error=None))) == [("judge (reference)", "± 3e-12"), *found]
    assert list(document.rows(shown(mbref_error=None)))[1][0] == "e 1, w"


def test_the_table_has_the_largest_error_of_each_mechanism():
    second = shown(error=None, mbref_error=9e-9, results=[])
    other = shown(scene=MECHANISMS[1].name, error=7e-3, results=[])
    head, ruler, *rows = document._table([shown(), second, other])
    rest = " | –" * (len(MECHANISMS) - 2) + " |"
    assert head.startswith("| method | " + MECHANISMS[0].name) and ruler.count("--:") == len(MECHANISMS)
    assert rows == [
        "| judge | 2e-11 | 7e-03" + rest,
        "| mbref modes | 9e-09 | 5e-09" + rest,
        "| e 1, w | 6e-08 | –" + rest,
    ]


def test_the_page_lists_each_pose_with_its_mechanism():
    names = [MECHANISMS[k].name for k in (1, 0)]
    lines = document.page([shown(scene=name, uncertainty=k) for k, name in enumerate(names)]).splitlines()
    poses = [k for k, line in enumerate(lines) if line.startswith("- Equilibrium, stable: s = +2 i, -2 i")]
    assert len(poses) == 2
    for k, mechanism in zip(poses, MECHANISMS, strict=False):
        assert lines[k - 2] == f"**{mechanism.name}**: {mechanism.about}."
    assert sum(line.startswith("**") for line in lines) == len(MECHANISMS)


def test_refusals_are_listed_once():
    other = shown(scene="another")
    name = MECHANISMS[0].name
    assert list(document._refusals([shown(), shown(), other])) == [
        f"- f without {scene}: no springs." for scene in sorted((name, "another"))
    ]


# --- steady motions ---------------------------------------------------------------------------------------
DRIVER = Driver(joint="H", polynomial=(0.0, 2.0))


@pytest.mark.parametrize(("bodies", "sign"), [(PAIR, 1.0), (PAIR[::-1], -1.0)])
def test_a_driver_turns_the_whole_mechanism(bodies, sign):
    found = turning(scene(joint=(hinge(bodies),), driver=(DRIVER,)))
    assert found.spin.tolist() == [0.0, 0.0, 2.0 * sign] and found.point.tolist() == [0.5, 0.0, 0.0]
    assert found.rate == 2.0
    twists = found.twists(np.array([[0.5, 3.0, 0.0], [1.5, 0.0, 7.0]]))
    assert twists == pytest.approx(sign * np.array([[-6, 0, 0, 0, 0, 2], [0, 2, 0, 0, 0, 2.0]]))
    assert REST.rate == 0.0 and Turning(np.array([3.0, 0.0, 4.0]), np.zeros(3)).rate == 5.0


def test_constant_drivers_and_loads_are_at_rest():
    still = Driver(joint="H", polynomial=(0.0,))
    steady_load = Moment(body="b", moment=Z, factor=Factor(polynomial=(2.0,)))
    assert turning(scene(driver=(still,), load=(steady_load,))) is REST and turning(scene()) is REST


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({"body": (Body(name="b", position=X),)}, r"body\[b\].mass: is missing"),
        (
            {"load": (Moment(body="b", moment=Z), Moment(body="b", moment=Z, factor=Factor(start=1.0)))},
            r"load\[1\].factor: varies",
        ),
        (
            {"driver": (Driver(joint="H", polynomial=(0.0, 1.0, 1.0)),)},
            r"driver\[H\]: small motions need drivers that stand still",
        ),
        ({"driver": (Driver(joint="H", polynomial=(0.0, 1.0), sine=Sine(amplitude=1.0)),)}, "constant rate"),
        (
            {"driver": (Driver(joint="H", table=((0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 4.0))),)},
            "constant rate",
        ),
        ({"driver": (DRIVER,), "gravity": (0.0, 1e-9, -9.0)}, "its axis is not along gravity"),
    ],
)
def test_motions_that_are_not_steady(parts, says):
    with pytest.raises(SceneError, match=says):
        turning(scene(**parts))


def test_a_driver_between_two_bodies_is_not_steady():
    other = body(name="c")
    between = Revolute(name="K", bodies=("b", "c"), anchor=O, axis=Z)
    two = scene(body=(body(), other), joint=(hinge(), between))
    with pytest.raises(SceneError, match=r"driver\[K\]"):
        turning(two.with_(driver=(Driver(joint="K", polynomial=(0.0, 1.0)),)))
    with pytest.raises(SceneError, match="constant rate"):
        turning(two.with_(driver=(DRIVER, Driver(joint="K", polynomial=(0.0, 1.0)))))
    assert turning(two.with_(driver=(DRIVER, Driver(joint="K", polynomial=(0.0,))))).rate == 2.0
    assert turning(scene(driver=(DRIVER,), gravity=O)).rate == 2.0, "without gravity any axis will do"


def test_a_scene_at_another_pose():
    """The body turns by 90° about z and moves to (4, 0, 5): the point (2, 2, 0) on it moves to (4, 1, 5)."""
    arm = (2.0, 2.0, 0.0)
    joints = (
        Revolute(name="R", bodies=PAIR, anchor=arm, axis=X),
        Revolute(name="S", bodies=PAIR[::-1], anchor=arm, axis=X),
        Universal(name="U", bodies=PAIR, anchor=arm, axes=(Z, X)),
        Distance(name="D", bodies=PAIR[::-1], anchors=(arm, Y)),
        Cylindrical(name="C", bodies=PAIR, anchor=arm, axis=Z),
    )
    loads = (
        Force(body="b", point=arm, force=X),
        Spring(bodies=PAIR, points=(Y, arm), stiffness=1.0, natural_length=0.5),
        TorsionSpring(joint="C", stiffness=2.0, natural_angle=0.75),
        SlideSpring(joint="C", stiffness=2.0, natural_displacement=1.5),
        TorsionSpring(joint="R", stiffness=0.0, damping=1.0, natural_angle=0.75),
        JointTorque(joint="R", torque=3.0),
        Moment(body="b", moment=X),
    )
    found = posed(
        scene(joint=joints, load=loads),
        np.array([[4.0, 0.0, 5.0]]),
        np.array([[HALF, 0.0, 0.0, HALF]]),
        np.arange(6.0)[None],
        {("angle", "C"): 0.5, ("displacement", "C"): 2.0},
    )
    [moved] = found.body
    assert moved.position == (4.0, 0.0, 5.0) and moved.orientation == pytest.approx((HALF, 0.0, 0.0, HALF))
    assert moved.velocity == (0.0, 1.0, 2.0) and moved.angular_velocity == (3.0, 4.0, 5.0)
    revolute, reverse, universal, distance, cylinder = found.joint
    there = pytest.approx((4.0, 1.0, 5.0))
    assert revolute.anchor == there and revolute.axis == X, "the second body carries the anchor"
    assert reverse.anchor == pytest.approx(arm) and reverse.axis == pytest.approx(Y, abs=1e-15)
    assert universal.axes[0] == Z and universal.axes[1] == pytest.approx(Y, abs=1e-15)
    assert distance.anchors[0] == there and distance.anchors[1] == Y and cylinder.axis == Z
    force, spring, twist, slide, damper, torque, moment = found.load
    assert force.point == there and force.force == X
    assert spring.points[0] == Y and spring.points[1] == there and spring.natural_length == 0.5
    assert (twist.natural_angle, slide.natural_displacement) == (0.25, -0.5)
    assert damper == loads[4] and torque == loads[5] and moment == loads[6]
