"""Parts of the command line and checks of scenes / lines and limits worked out by hand."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mbref.cli import ensemble, exchange, main, output
from mbref.cli.pictures import path_of
from mbref.scene import Body, Distance, Driver, Moment, Revolute, Scene, Sine, TorsionSpring, Translational
from mbref.scene_fields import SMALLEST, checked_length, checked_mass, checked_size, is_some, meant, shown
from mbref.scene_slips import link_lengths, probable_slips
from mbref.scene_validation import checked_inertia
from mbref.trajectory import Cost, Outcome, Trajectory

Z = (0.0, 0.0, 1.0)


def body(name: str, x: float = 0.0, **parts: object) -> Body:
    given = {"mass": 1.0, "inertia": (1.0, 1.0, 1.0), "position": (x, 0.0, 0.0), **parts}
    return Body(name=name, **given)


def hinge(name: str, first: str, second: str, x: float, axis=Z, y: float = 0.0) -> Revolute:
    return Revolute(name=name, bodies=(first, second), anchor=(x, y, 0.0), axis=axis)


def pair(**parts: object) -> Scene:
    """Two bars of 1 m and 2 m in line."""
    given = {
        "body": (body("rod", 0.5), body("bar", 2.0)),
        "joint": (
            hinge("A", "ground", "rod", 0.0),
            hinge("B", "rod", "bar", 1.0),
            hinge("C", "bar", "ground", 3.0),
        ),
        **parts,
    }
    return Scene(name="pair", duration=1.0, **given)


# --- probable slips ---------------------------------------------------------------------------------------
def test_distances_between_the_joints_of_each_body():
    assert link_lengths(pair()) == {"rod": {"A–B": 1.0}, "bar": {"B–C": 2.0}, "ground": {"A–C": 3.0}}
    assert link_lengths(pair(joint=pair().joint[:1])) == {}
    assert probable_slips(pair()) == []


@pytest.mark.parametrize(
    ("angle", "reported"), [(2 * math.pi, False), (6.3, True), (-6.3, True), (-2 * math.pi, False)]
)
def test_an_angle_of_more_than_a_turn(angle, reported):
    load = (Moment(body="rod", moment=Z), TorsionSpring(joint="A", stiffness=1.0, natural_angle=angle))
    wanted = [f"load[1].natural_angle: {angle:g} rad is more than a turn; is it in degrees?"] * reported
    assert probable_slips(pair(load=load)) == wanted
    sine = Sine(amplitude=0.0, frequency=1.0, phase=angle)
    driver = Driver(joint="B", polynomial=(0.0,), sine=sine)
    assert (
        probable_slips(pair(driver=(driver,)))
        == [f"driver[B].sine.phase: {angle:g} rad is more than a turn; is it in degrees?"] * reported
    )
    turn = Driver(joint="B", sine=Sine(amplitude=angle, frequency=1.0))
    slide = Translational(name="B", bodies=("rod", "bar"), anchor=(1.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    assert (
        probable_slips(pair(driver=(turn,)))
        == [f"driver[B].sine.amplitude: {angle:g} rad is more than a turn; is it in degrees?"] * reported
    )
    sliding = pair(driver=(turn,), joint=(pair().joint[0], slide, pair().joint[2]))
    assert probable_slips(sliding) == [], "an amplitude of a displacement is a length"


@pytest.mark.parametrize(("rate", "turns"), [(90.0, "14.3"), (-90.0, "-14.3"), (89.0, ""), (0.0, "")])
def test_a_rate_that_may_be_in_degrees(rate, turns):
    driver = Driver(joint="A", polynomial=(0.0, rate))
    wanted = [f"driver[A].polynomial: {rate:g} rad/s is {turns} turns a second; is it in degrees?"] * bool(
        turns
    )
    assert probable_slips(pair(driver=(driver,))) == wanted
    assert probable_slips(pair(driver=(Driver(joint="A"),))) == []


@pytest.mark.parametrize(("rate", "reported"), [(99.0, False), (101.0, True), (-101.0, True)])
def test_a_driver_that_turns_far(rate, reported):
    driver = Driver(joint="A", polynomial=(0.0, rate))
    wanted = ["driver[A].polynomial: turns the joint by 101 rad, 16.1 turns, within 1 s; is it in degrees?"]
    assert probable_slips(pair(driver=(driver,))) == wanted * reported


def test_lengths_300_times_apart():
    def with_length(x: float) -> list[str]:
        joints = (
            hinge("A", "ground", "rod", 0.0),
            hinge("B", "rod", "bar", 1.0),
            hinge("C", "bar", "ground", x),
        )
        return probable_slips(pair(joint=joints, body=(body("rod", 0.5), body("bar", 1.0))))

    assert with_length(300.0) == []
    assert with_length(301.0) == ["body[bar]: B–C is 300 m, A–B 1 m; is one in millimetres?"]


def test_an_inertia_of_a_body_far_larger_than_the_mechanism():
    """Radius of gyration √(trace / 2 / mass) of 90 m is 30 times 3 m."""
    for size, count in ((90.0, 0), (90.01, 1)):
        moment = 2 * size**2 / 3
        found = probable_slips(pair(body=(body("rod", 0.5, inertia=(moment,) * 3), body("bar", 2.0))))
        assert len(found) == count, found
    assert found == [
        "body[rod].inertia: suits a body 90 m across, the mechanism measures 3 m; is it in kg m²?"
    ]
    full = ((5400.0, 0.0, 0.0), (0.0, 5400.0, 0.0), (0.0, 0.0, 5402.0))
    assert len(probable_slips(pair(body=(body("rod", 0.5, inertia=full), body("bar", 2.0))))) == 1
    point = Scene(name="p", body=(body("b"),), joint=(hinge("A", "ground", "b", 0.0),))
    assert probable_slips(point) == [], "all in one point"


def test_gravity_in_millimetres_and_no_joints():
    assert probable_slips(pair(gravity=(0.0, 60.0, -80.0))) == []
    assert probable_slips(pair(gravity=(0.0, 60.0, -80.1))) == [
        "gravity: 100.08 m/s² is 10.2 times the earth's; is it in mm/s²?"
    ]
    assert probable_slips(pair(joint=())) == ["joint: there is none, so nothing connects rod, bar"]


def test_an_axis_in_the_plane_of_a_mechanism():
    y = (0.0, 1.0, 0.0)
    joints = [*pair().joint[:2], hinge("C", "bar", "ground", 3.0, axis=y)]
    wrong = ["joint[C].axis: lies in the plane of the mechanism; other axes are across it"]
    assert probable_slips(pair(joint=joints)) == wrong
    first = [hinge("A", "ground", "rod", 0.0, axis=y), *pair().joint[1:]]
    assert probable_slips(pair(joint=first)) == [
        "joint[A].axis: lies in the plane of the mechanism; other axes are across it"
    ]
    assert (
        probable_slips(pair(joint=[*joints[:1], hinge("B", "rod", "bar", 1.0, axis=y), joints[2]])) != wrong
    )
    inclined = [*pair().joint[:2], hinge("C", "bar", "ground", 3.0, axis=(0.0, 1.0, 1e-3))]
    assert probable_slips(pair(joint=inclined)) == []
    spatial = (body("rod", 0.5), body("bar", 2.0, position=(2.0, 0.0, 0.1)))
    assert probable_slips(pair(joint=joints, body=spatial)) == [], "the centres do not lie in one plane"
    opened = [*pair().joint[:2], hinge("C", "bar", "tip", 3.0, axis=y)]
    bodies = (*pair().body, body("tip", 3.5))
    assert probable_slips(pair(joint=opened, body=bodies)) == [], "a hinge of an open chain"


# --- checks of fields -------------------------------------------------------------------------------------
def test_sizes_of_numbers():
    assert checked_mass(0) == 0 and checked_size(-1e40) == -1e40 and checked_length(SMALLEST) == SMALLEST
    for check, value in (
        (checked_size, 1e300),
        (checked_size, -1e300),
        (checked_length, 1e-300),
        (checked_mass, -1.0),
    ):
        with pytest.raises(ValueError, match="in size, got"):
            check(value)
    assert is_some([[0, 0.0], [0, 1e-9]]) and not is_some([[0, 0.0], []]) and is_some(2) and not is_some(0.0)
    assert meant("Lenght", ("length", "mass")) == "; did you mean 'length'?" and meant("zzz", ("a",)) == ""
    assert meant("k", ("stiffness",)) == "; did you mean 'stiffness'?"
    assert meant("k", ("damping",)) == "" and len(shown("x" * 500)) < 90
    assert shown(10**5000) == "a number of thousands of digits"


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("abc", "must be three numbers or a 3x3 matrix"),
        ((1.0, 2.0), "must be three numbers or a 3x3 matrix, got"),
        ((1.0, 1.0, math.inf), "must be finite"),
        (((1.0, 0.1, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), "must be symmetric"),
        ((1.0, -1e-8, 1.0), "must have no negative principal moment, got -1e-08"),
        ((1.0, 2.0, 3.0 + 1e-8), "violates the triangle inequality: 3 > 1 [+] 2;"),
        ((1e-300, 1.0, 1.0), "in size"),
    ],
)
def test_inertias_that_are_refused(value, says):
    with pytest.raises(ValueError, match=says):
        checked_inertia(value)


def test_inertias_that_are_accepted():
    assert checked_inertia((1.0, 2.0, 3.0 + 1e-9)) == (1.0, 2.0, 3.0 + 1e-9)
    assert checked_inertia((0.0, 1.0, 1.0)) == (0.0, 1.0, 1.0)
    rows = ((2.0, 0.5, 0.0), (0.5 + 1e-9, 2.0, 0.0), (0.0, 0.0, 3.0))
    assert checked_inertia(np.array(rows)) == rows and checked_inertia((0, 0, 0)) == (0.0, 0.0, 0.0)


# --- import, export, pictures -----------------------------------------------------------------------------
def test_a_file_is_imported_to_a_scene_file(monkeypatch, tmp_path, capsys):
    read = SimpleNamespace(scene=pair(), left_out=["contacts"], notes=["closed"])
    asked = []
    monkeypatch.setattr(exchange.formats, "read", lambda *given: asked.append(given) or read)
    monkeypatch.setattr(exchange.formats, "import_options", lambda options: "its options")
    file = str(tmp_path / "robot.xml")
    for out, path in (
        (None, tmp_path / "robot.toml"),
        (str(tmp_path / "other.toml"), tmp_path / "other.toml"),
    ):
        assert exchange._import(argparse.Namespace(file=file, out=out)) == 0
        assert capsys.readouterr().out == f"{path}\nleft out: contacts\nnote: closed\n"
        assert Scene.from_file(path) == pair()
    assert asked == [(file, "its options")] * 2
    with pytest.raises(ValueError, match=r"--out: must end in \.toml, got 'a\.xml'"):
        exchange._import(argparse.Namespace(file=file, out="a.xml"))


def test_a_scene_is_exported(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(exchange.formats, "write", lambda *given: asked.append(given) or ["damping"])
    monkeypatch.setattr(exchange, "find_scene", lambda name: f"scene {name}")
    assert exchange._export(argparse.Namespace(scene="s", out="o.xml")) == 0
    assert asked == [("scene s", "o.xml")] and capsys.readouterr().out == "o.xml\nleft out: damping\n"


def test_the_file_of_a_picture():
    def asked(out: str | None, scene: str) -> Path:
        return path_of(argparse.Namespace(out=out, scene=scene), "-moving", (".svg", ".gif"))

    assert asked(None, "folder/a.toml") == Path("a-moving.svg") and asked(None, "four_bar") == Path(
        "four_bar-moving.svg"
    )
    assert asked("x.gif", "a") == Path("x.gif")
    with pytest.raises(ValueError, match=r"must end in \.svg or \.gif, got 'x\.png'"):
        asked("x.png", "a")


# --- ensembles --------------------------------------------------------------------------------------------
def run(x: float, outcome: Outcome = Outcome.COMPLETED, message: str = "") -> Trajectory:
    place = np.array([[[0.0, 0.0, 0.0]], [[x, 2 * x, 0.0]]])
    turn, still = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1, 1)), np.zeros((2, 1, 3))
    return Trajectory(
        "s",
        "e",
        "1",
        "m",
        {},
        np.array([0.0, 1.0]),
        ("b",),
        place,
        turn,
        still + x,
        still,
        outcome=outcome,
        message=message,
        cost=Cost(0.25, 0.0),
    )


ONE = Scene(name="one", body=(body("b"),))


def test_mean_and_deviation_of_variants(capsys):
    runs = [run(1.0), run(2.0), run(6.0)]
    ensemble._show_spread(ONE, 1.5, runs, 8.0, argparse.Namespace(json=True, count=5))
    found = json.loads(capsys.readouterr().out)
    assert (found["scene"], found["time"], found["completed"]) == ("one", 1.5, 3)
    assert found["mean_position"]["b"] == [3.0, 6.0, 0.0]
    assert found["deviation_position"]["b"] == pytest.approx([math.sqrt(14 / 3), 2 * math.sqrt(14 / 3), 0.0])
    assert found["mean_velocity"]["b"] == [3.0] * 3 and found["mean_angular_velocity"]["b"] == [0.0] * 3
    ensemble._show_spread(ONE, 1.5, runs, 8.0, argparse.Namespace(json=False, count=5))
    printed = capsys.readouterr().out
    assert printed.startswith("one: 3 of 5 variants completed, 0.75 s of stepping in all, 8 runs a second")
    assert "mean ± standard deviation at t = 1.5 s" in printed
    mean, deviation, *_ = (line.split("│")[3:6] for line in printed.splitlines() if line.startswith("│"))
    assert [cell.strip() for cell in mean + deviation] == ["3", "6", "0", "± 2.2", "± 4.3", "± 0"]
    ensemble._show_spread(ONE, 1.5, [], 8.0, argparse.Namespace(json=False, count=5))
    assert (
        capsys.readouterr().out == "one: 0 of 5 variants completed, 0 s of stepping in all, 8 runs a second\n"
    )
    ensemble._show_spread(ONE, 1.5, [], 8.0, argparse.Namespace(json=True, count=5))
    assert json.loads(capsys.readouterr().out) == {"scene": "one", "time": 1.5, "completed": 0}


def test_ends_of_variants_by_outcome():
    runs = {
        7: run(1.0, Outcome.STEP_FAILED, "late"),
        2: run(1.0, Outcome.NOT_FINITE, "infinite"),
        0: run(1.0),
        3: run(1.0, Outcome.STEP_FAILED, "early"),
    }
    assert list(ensemble._early_ends(runs)) == [
        "NOT_FINITE: 1, the first of them variant 2: infinite",
        "STEP_FAILED: 2, the first of them variant 3: early",
    ]


# --- output -----------------------------------------------------------------------------------------------
def test_outcomes_are_printed_and_give_the_status(capsys):
    assert output.exit_status(run(1.0), run(2.0)) == 0 and capsys.readouterr().out == ""
    assert output.exit_status(run(1.0), run(2.0, Outcome.STEP_FAILED, "why")) == 1
    assert capsys.readouterr().out == "STEP_FAILED: why\n"


def test_rounding_errors_of_zeros_are_printed_as_zeros():
    found = output.rounded(np.array([-1e-13, 0.6e-12, 1.0]))
    assert found.tolist() == [0.0, 1e-12, 1.0] and not np.signbit(found).any()


def test_a_progress_line_every_ten_seconds(capsys):
    now = iter([0.0, 9.9, 10.0, 19.9, 20.0, 8000.0])
    lines = output.Lines("running", 4.0, lambda: next(now))
    for done in (1.0, 1.0, 1.5, 2.0, 2.0):
        lines(done)
    assert capsys.readouterr().err.splitlines() == [
        "running: 25 %, about 30 s left",
        "running: 50 %, about 20 s left",
        "running: 50 %, more than an hour left",
    ]
    still = iter([0.0, 50.0])
    output.Lines("running", 4.0, lambda: next(still))(0.0)
    assert capsys.readouterr().err == ""


def test_a_distance_joint_has_two_anchors():
    rod = Distance(name="D", bodies=("ground", "rod"), anchors=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    assert link_lengths(pair(joint=(*pair().joint, rod)))["rod"] == {"A–B": 1.0, "A–D": 1.0, "B–D": 0.0}


# --- whole command lines ----------------------------------------------------------------------------------
def test_import_and_export_from_the_command_line(monkeypatch, tmp_path, capsys):
    read = SimpleNamespace(scene=pair(), left_out=[], notes=[])
    asked, written = [], []
    monkeypatch.setattr(exchange.formats, "read", lambda *given: asked.append(given) or read)
    monkeypatch.setattr(exchange.formats, "write", lambda *given: written.append(given) or [])
    file, out = str(tmp_path / "r.xml"), str(tmp_path / "s.toml")
    assert main(["import", file, "--out", out, "--keyframe", "home"]) == 0 and Scene.from_file(out) == pair()
    [(path, options)] = asked
    assert path == file and options.keyframe == "home"
    assert main(["export", out, "--out", "x.xml"]) == 0 and written == [(pair(), "x.xml")]
    assert capsys.readouterr().out == f"{out}\nx.xml\n"


def test_an_ensemble_from_the_command_line(monkeypatch, tmp_path, capsys):
    """Three of the variants complete; the scene's gravity is a probable mistake."""
    scene = ONE.with_(gravity=(0.0, 0.0, -9810.0), duration=1.0)
    scene.save(tmp_path / "s.toml")
    given = []

    def runs(scenes, times, method, limits, pool, out):
        given.append((len(list(scenes)), times.tolist(), method, limits.rtol, out))
        yield 1, run(2.0)
        yield 0, run(1.0)
        yield 2, run(6.0, Outcome.STEP_FAILED if len(given) > 1 else Outcome.COMPLETED, "why")

    monkeypatch.setattr("mbref.ensembles.ensemble.ensemble", runs)
    words = [
        "ensemble",
        str(tmp_path / "s.toml"),
        "--vary",
        "body[b].mass=1:2",
        "--count",
        "3",
        "--workers",
        "1",
    ]
    assert main([*words, "--samples", "3", "--rtol", "1e-6", "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["mean_position"]["b"] == [3.0, 6.0, 0.0] and "mm/s²" in printed.err
    assert given == [(3, [0.0, 0.5, 1.0], None, 1e-6, None)]
    assert main([*words, "--out", "runs.jsonl"]) == 1
    printed = capsys.readouterr()
    assert (
        "2 of 3 variants completed" in printed.out
        and "STEP_FAILED: 1, the first of them variant 2" in printed.err
    )
    assert given[1][4] == "runs.jsonl" and len(given[1][1]) == 101
    for fault in (["--count", "0"], ["--workers", "0"]):
        assert main([*words, *fault]) == 2
        assert "--count and --workers: must be at least 1" in capsys.readouterr().err


# --- refusals ---------------------------------------------------------------------------------------------
def test_the_command_line_reports_refused_input_alone_and_raises_a_defect(monkeypatch, capsys):
    """A ValueError of another kind is a defect of the program, so its traceback stays."""
    assert main(["run", "four_bar", "--duration=-1"]) == 2
    assert capsys.readouterr().err == "--duration: must be positive, got -1\n"

    def fail(*_: object) -> None:
        raise ValueError("operands of other shapes")

    monkeypatch.setattr("mbref.cli.options.sample_times", fail)
    with pytest.raises(ValueError, match="operands"):
        main(["run", "four_bar"])
