"""Commands of mbref with stand-ins for their runs / files, lines and exit status by hand."""

from __future__ import annotations

import json
import math
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.cli import diagnose, pictures, plotting, run, scene_files, statics
from mbref.cli.commands import parser
from mbref.input_error import InputError
from mbref.method import MethodError
from mbref.scene import Body, Scene, SceneError
from mbref.simulation import simulate as simulation
from mbref.stepping.limits import Limits
from mbref.trajectory import Cost, Outcome

SCENE = Scene(
    name="s",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),),
    duration=2.0,
)

TWO = "singular position 1 at t = 0.5 s: 2 branches"


def crossing(time: float, branches: int, taken: int = 1) -> Any:
    return SimpleNamespace(
        time=time,
        velocity=np.zeros((branches, 6)),
        sentence=f"{branches} branches",
        taken=taken,
        instants=lambda end, count: np.array([time, end, count]),
    )


def motion(*crossings: Any, outcome: Outcome = Outcome.COMPLETED, **more: Any) -> Any:
    given = {"crossings": crossings, "outcome": outcome, "t_end": 2.0, "method": "taylor", "mechanism": SCENE}
    return SimpleNamespace(**{**given, **more})


# --- pictures ---------------------------------------------------------------------------------------------
def test_the_singular_position_that_is_shown():
    """The second position has two branches; another one may be asked for."""
    several = motion(crossing(0.25, 1), crossing(0.5, 2), crossing(0.75, 3))
    assert pictures.of_several_branches(several) == [2, 3] and pictures.of_several_branches(motion()) == []
    found = [pictures.chosen_crossing(several, number) for number in (None, 1, 2, 3)]
    assert found == [2, 1, 2, 3]
    for number in (0, 4):
        with pytest.raises(InputError, match=r"--crossing: must be at most 3, .* up to t = 2 s, got"):
            pictures.chosen_crossing(several, number)
    with pytest.raises(InputError, match=r"has several branches: the motion passes none$"):
        pictures.chosen_crossing(motion(), None)
    with pytest.raises(
        InputError, match=r"branches: singular position 1 at t = 0.25 s: 1 branches; singular"
    ):
        pictures.chosen_crossing(motion(crossing(0.25, 1), crossing(0.5, 1)), None)
    with pytest.raises(MethodError, match="--branches: taylor does not detect"):
        pictures.chosen_crossing(motion(crossings=None), 1)


def test_motions_along_the_branches_of_a_singular_position(monkeypatch):
    """The second branch ends early; each run asks for its branch at the second position."""
    asked: list[Any] = []

    def simulated(*given: Any) -> Any:
        asked.append(given)
        return motion(outcome=Outcome.STEP_FAILED, t_end=0.123456) if len(asked) == 2 else motion()

    monkeypatch.setattr(simulation, "simulate", simulated)
    smooth, limits = motion(crossing(0.25, 1), crossing(0.5, 2)), Limits(rtol=1e-5)
    found = pictures.along_branches(smooth, "a method", limits, 2)
    assert list(found) == ["branch 1, smooth", "branch 2, ended at 0.1235 s"]
    assert [(scene, method) for scene, method, *_ in asked] == [(SCENE, "a method")] * 2
    assert [times.tolist() for _, _, times, _ in asked] == [[0.5, 2.0, 101.0]] * 2
    assert [given[3] for given in asked] == [replace(limits, branches={2: k}) for k in (1, 2)]


@pytest.fixture
def drawn(monkeypatch, tmp_path) -> list[Any]:
    """What is drawn by the stand-ins of a request and of pictures."""
    made: list[Any] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pictures, "find_scene", lambda name: SCENE)
    monkeypatch.setattr(pictures, "warn", lambda scene: made.append(scene.name))
    monkeypatch.setattr(pictures, "still", lambda scene, view: f"<svg>{scene.name} {view}</svg>")
    monkeypatch.setattr(pictures, "png", lambda picture: f"png of {picture}".encode())
    monkeypatch.setattr(pictures, "write_film", lambda *given: made.append(given))
    return made


def test_a_picture_of_a_scene(drawn, tmp_path, capsys):
    assert pictures._draw(parser().parse_args(["draw", "a/mine.toml"])) == 0
    assert (tmp_path / "mine.svg").read_text() == "<svg>s None</svg>" and drawn == ["s"]
    assert pictures._draw(parser().parse_args(["draw", "s", "--out", "x.png"])) == 0
    assert (tmp_path / "x.png").read_bytes() == b"png of <svg>s None</svg>"
    assert capsys.readouterr().out == "mine.svg\nx.png\n"
    with pytest.raises(InputError, match=r"--out: must end in \.svg or \.png"):
        pictures._draw(parser().parse_args(["draw", "s", "--out", "x.gif"]))


@pytest.mark.parametrize(
    ("words", "several", "said"),
    [
        ([], 1, "s-moving.svg\n"),
        (
            [],
            2,
            f"s-moving.svg\n{TWO}; --branches shows them side by side\n",
        ),
        (["--out", "x.gif"], 1, "x.gif\n"),
    ],
)
def test_an_animation_of_a_motion(drawn, monkeypatch, capsys, words, several, said):
    smooth = motion(crossing(0.5, several))
    request = SimpleNamespace(scene=SCENE, motion=lambda: smooth, method="m", limits="limits")
    monkeypatch.setattr(pictures, "request_of", lambda options: request)
    monkeypatch.setattr(pictures, "exit_status", lambda *motions: len(motions))
    assert pictures._animate(parser().parse_args(["animate", "s", *words])) == 1
    [(path, scene, shown, view)] = drawn
    assert (str(path), scene, shown, view) == (said.partition("\n")[0], SCENE, smooth, None)
    assert capsys.readouterr().out == said


@pytest.mark.parametrize(("words", "number"), [(["--branches"], 2), (["--crossing", "1"], 1)])
def test_an_animation_of_branches(drawn, monkeypatch, tmp_path, capsys, words, number):
    smooth = motion(crossing(0.25, 1), crossing(0.5, 2))
    request = SimpleNamespace(scene=SCENE, motion=lambda: smooth, method="m", limits="limits")
    asked: list[Any] = []
    monkeypatch.setattr(pictures, "request_of", lambda options: request)
    monkeypatch.setattr(
        pictures, "along_branches", lambda *given: asked.append(given) or {"1": "a", "2": "b"}
    )
    monkeypatch.setattr(pictures, "exit_status", lambda *motions: "".join(motions))
    monkeypatch.setattr(
        pictures, "side_by_side", lambda scene, motions, title, view: f"{scene.name} {motions} {title} {view}"
    )
    assert pictures._animate(parser().parse_args(["animate", "s", *words])) == "ab"
    assert asked == [(smooth, "m", "limits", number)] and not drawn
    title = f"s: singular position {number} at t = {0.25 * number:g} s: {number} branches"
    assert (tmp_path / "s-branches.svg").read_text() == f"s {{'1': 'a', '2': 'b'}} {title} None"
    assert capsys.readouterr().out == "s-branches.svg\n"
    with pytest.raises(InputError, match=r"--out: must end in \.svg, got"):
        pictures._animate(parser().parse_args(["animate", "s", *words, "--out", "x.gif"]))


# --- runs -------------------------------------------------------------------------------------------------
def test_branches_that_are_asked_for():
    assert run._branches(["1=2", "10=3"]) == {1: 2, 10: 3} and run._branches([]) == {}
    for word in ("1", "1=2=3", "a=1"):
        with pytest.raises(InputError, match=f"--branch: must be CROSSING=BRANCH, .* got '2=1 {word}'"):
            run._branches(["2=1", word])


def test_error_estimates_that_are_asked_for(monkeypatch):
    asked: list[Any] = []

    @contextmanager
    def bar(*given: Any):
        asked.append(given)
        yield "progress"

    monkeypatch.setattr(run, "progress_bar", bar)
    made = motion(with_error_estimate=lambda *given: asked.append(given) or "estimated")
    assert run._estimated(made, "no") is made and not asked
    assert run._estimated(made, "auto") == run._estimated(made, "yes") == "estimated"
    told = ("estimating the error", 2.0)
    assert asked == [told, (run.ESTIMATE_SECONDS, "progress"), told, (math.inf, "progress")]


def test_files_of_a_run(tmp_path):
    saved: list[Any] = []
    made: Any = SimpleNamespace(save=saved.append)
    run._writer("x.json")(made, "x.json", "a column")
    assert saved == ["x.json"] and run._writer("x.csv") is run.Motion.to_csv and run._writer(None) is None
    with pytest.raises(InputError, match=r"--out: must end in \.csv or \.json, got 'x\.txt'"):
        run._writer("x.txt")


@pytest.mark.parametrize(("outcome", "status"), [(Outcome.COMPLETED, 0), (Outcome.STEP_FAILED, 1)])
def test_a_run_is_checked_estimated_written_and_shown(monkeypatch, capsys, outcome, status):
    """Columns are looked up at the first sample, before the run goes on."""
    calls: list[Any] = []
    ended = motion(
        outcome=outcome, to_record=lambda: {"t": 1}, columns=lambda *names: calls.append(("columns", names))
    )

    def moved(check: Any) -> Any:
        calls.append("checked" if check else "unchecked")
        if check:
            check(ended)
        return ended

    monkeypatch.setattr(
        run, "request_of", lambda options, branches: SimpleNamespace(scene=SCENE, motion=moved)
    )
    monkeypatch.setattr(run, "_estimated", lambda made, wanted: calls.append(wanted) or made)
    monkeypatch.setattr(run, "_writer", lambda out: lambda *given: calls.append(given[1:]) if out else None)
    monkeypatch.setattr(run, "show", lambda scene, made, columns: calls.append((scene.name, columns)))
    asked = parser().parse_args(["run", "s", "--estimate", "no", "--out", "x.csv", "--columns", "energy"])
    assert run._run(asked) == status
    assert calls == ["checked", "no", ("columns", ("energy",)), "no", ("x.csv", "energy"), ("s", ["energy"])]
    calls.clear()
    assert run._run(parser().parse_args(["run", "s", "--json"])) == status
    assert calls == ["unchecked", "auto"]
    assert capsys.readouterr().out == '{"scene": "s", "records": [{"t": 1}]}\n'


def test_lines_of_a_run(capsys):
    """Thirteen positions, of which ten are shown; the force (3, 4, 0) N is the largest, at 0.5 s."""
    wrench = np.array([[0.0, 1.0, 0.0, 9.0, 9.0, 9.0], [3.0, 4.0, 0.0, 0.0, 0.0, 0.0]])
    levels = SimpleNamespace(_asdict=lambda: {"position": np.array([1e-9, 3e-9]), "velocity": None})
    made = motion(
        *(crossing(0.1 * k, 2, taken=k % 2) for k in range(1, 14)),
        message="a message",
        known_estimate=SimpleNamespace(sentence="an estimate"),
        cost=Cost(
            seconds=1.23456, steps=7, rhs=9, rejected=2, factorisations=3, newton=4, build_seconds=0.256
        ),
        times=np.array([0.0, 0.5]),
        bodies=("b",),
        violation=levels,
        reactions={"A": wrench / 2, "B": wrench},
        position=np.zeros((2, 1, 3)),
        orientation=np.zeros((2, 1, 4)),
        velocity=np.zeros((2, 1, 3)),
        angular_velocity=np.zeros((2, 1, 3)),
    )
    run.show(SCENE, made)
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert lines[:6] == [
        "s by taylor: COMPLETED at t = 2 s",
        "a message",
        "an estimate",
        "7 steps, 2 rejected, 9 evaluations",
        "3 factorisations, 4 Newton iterations",
        "1.23 s of stepping, 0.26 s of building",
    ]
    passed = [line for line in lines if line.startswith("singular position")]
    assert len(passed) == 10
    assert passed[0] == "singular position 1 at t = 0.1 s: 2 branches, number 1 taken"
    assert passed[1] == "singular position 2 at t = 0.2 s: 2 branches, none taken"
    assert "largest reaction 5 N in joint B at t = 0.5 s" in lines
    assert any(line.startswith("largest violation of a constraint row 3e-09 ") for line in lines)
    lost = replace_times(made)
    run.show(SCENE, lost)
    assert "largest" not in capsys.readouterr().out, "no sample, no state"


def replace_times(made: Any) -> Any:
    return SimpleNamespace(**{**vars(made), "times": np.zeros(0), "message": "", "known_estimate": None})


# --- diagnosis, plots, vibrations and scene files -----------------------------------------------------------
@pytest.mark.parametrize(
    ("words", "at_start", "along", "swaps"),
    [
        ([], 0, SimpleNamespace(redundant=0), []),
        ([], 1, SimpleNamespace(redundant=0), [{"A": "spherical"}]),
        ([], 0, SimpleNamespace(redundant=1), [{"A": "spherical"}]),
        ([], 0, "it is locked", []),
        (["--start"], 0, None, []),
    ],
)
def test_exchanges_are_searched_where_rows_are_redundant(monkeypatch, capsys, words, at_start, along, swaps):
    found = SimpleNamespace(counts=SimpleNamespace(redundant=at_start))
    warned: list[Any] = []
    monkeypatch.setattr(diagnose, "find_scene", lambda name: SCENE)
    monkeypatch.setattr(diagnose, "warn", warned.append)
    monkeypatch.setattr(diagnose, "_along", lambda scene: along)
    monkeypatch.setattr("mbref.equations.diagnosis.diagnose", lambda scene: found)
    monkeypatch.setattr("mbref.design.exchange.exchanges", lambda scene: [{"A": "spherical"}])
    monkeypatch.setattr(
        diagnose, "_record", lambda *given: {"given": [given[1] is found, given[2] is along, given[3]]}
    )
    assert diagnose._diagnose(parser().parse_args(["diagnose", "s", "--json", *words])) == 0
    assert json.loads(capsys.readouterr().out) == {"given": [True, True, swaps]} and warned == [SCENE]
    parts = ("scene", "unit", "start", "motion", "swap", "driver")
    for name in parts:
        monkeypatch.setattr(diagnose, f"_{name}_lines", lambda *given, name=name: [f"{name} {len(given)}"])
    assert diagnose._diagnose(parser().parse_args(["diagnose", "s", *words])) == 0
    assert capsys.readouterr().out.split("\n")[:-1] == [f"{name} {1 + (name == 'swap')}" for name in parts]


def test_a_motion_that_cannot_be_diagnosed(monkeypatch):
    def locked(scene: Scene) -> None:
        raise SceneError(["it is locked", "more"])

    monkeypatch.setattr("mbref.design.along_motion.along_motion", locked)
    assert diagnose._along(SCENE) == "it is locked"
    monkeypatch.setattr("mbref.design.along_motion.along_motion", lambda scene: scene)
    assert diagnose._along(SCENE) is SCENE


@pytest.mark.parametrize("columns", [[], ["energy", "b.position"]])
def test_a_plot_of_columns(monkeypatch, capsys, columns):
    calls: list[Any] = []
    figure = SimpleNamespace(savefig=lambda path, dpi: calls.append((str(path), dpi)))
    ended = motion(plot=lambda *names: calls.append(names) or figure)
    ended.columns = lambda *names: calls.append(("looked up", *names))

    def moved(check: Any) -> Any:
        if check:
            check(ended)
        return ended

    monkeypatch.setattr(plotting, "request_of", lambda options: SimpleNamespace(motion=moved))
    assert plotting._plot(parser().parse_args(["plot", "s", *columns])) == 0
    looked_up = [("looked up", *columns)] if columns else []
    assert calls == [*looked_up, tuple(columns), ("s-plot.svg", 150)]
    assert capsys.readouterr().out == "s-plot.svg\n"

    def missing(*names: str) -> None:
        raise ImportError

    ended.plot = missing
    with pytest.raises(InputError, match="a plot needs matplotlib"):
        plotting._plot(parser().parse_args(["plot", "s", *columns]))


@pytest.mark.parametrize(
    ("stabilities", "words", "number"),
    [
        (["unstable", "stable", "stable"], [], 2),
        (["unstable", "unstable"], [], 1),
        (["unstable", "stable", "unstable"], ["--number", "3"], 3),
    ],
)
def test_vibrations_about_the_first_stable_equilibrium(monkeypatch, capsys, stabilities, words, number):
    found = [SimpleNamespace(stability=s, scene=f"scene {k}") for k, s in enumerate(stabilities, 1)]
    films: list[Any] = []
    monkeypatch.setattr(statics, "_found", lambda options: found)
    monkeypatch.setattr(statics, "_record", lambda each: {"scene": each.scene})
    monkeypatch.setattr(statics, "_mode_lines", lambda k, each: [f"{k}: {each.scene}"])
    monkeypatch.setattr(statics, "write_film", lambda *given: films.append(given))
    monkeypatch.setattr("mbref.design.equilibrium.motion_of_mode", lambda each, mode: (each.scene, mode))
    assert statics._modes(parser().parse_args(["modes", "s", "--json", *words])) == 0
    assert json.loads(capsys.readouterr().out) == {"number": number, "scene": f"scene {number}"} and not films
    assert statics._modes(parser().parse_args(["modes", "s", "--mode", "4", "--out", "x.svg", *words])) == 0
    [(path, scene, shown, view)] = films
    assert (str(path), scene, shown, view) == ("x.svg", f"scene {number}", (f"scene {number}", 4), None)
    assert capsys.readouterr().out == f"{number}: scene {number}\nx.svg\n"


def test_lines_of_an_assembled_scene(monkeypatch, capsys, tmp_path):
    """Moves up to the limit are rounding; a body that turns has its angle."""
    limit = scene_files.UNMOVED
    saved: list[Any] = []
    found = SimpleNamespace(
        lengths={"A-B": (1.0, 1.25)},
        joints={"A": limit, "B": 0.25},
        bodies={"b": (0.5, limit), "c": (limit, limit), "d": (0.0, 0.75)},
        scene=SimpleNamespace(save=saved.append),
    )
    asked: list[Any] = []
    hinges = [SimpleNamespace(name=name) for name in ("A", "B")]
    scene: Any = SimpleNamespace(joint=hinges)
    monkeypatch.setattr(scene_files, "find_scene", lambda name: scene)
    monkeypatch.setattr("mbref.design.assemble.assemble", lambda *given: asked.append(given) or found)
    words = ["assemble", "s", "--length", "A-B=1.25", "--out", "x.toml"]
    assert scene_files._assemble(parser().parse_args(words)) == 0
    assert asked == [(scene, {("A", "B"): 1.25})] and saved == ["x.toml"]
    assert capsys.readouterr().out.splitlines() == [
        "length A-B: 1 m, now 1.25 m",
        "joint B: moved by 0.25 m",
        "body b: moved by 0.5 m",
        "body d: moved by 0 m, turned by 0.75 rad",
        "x.toml",
    ]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("A-B=0.5", ("A", "B")),
        ("A-B-C=0.5", ("A-B", "C")),
        ("C-A-B=0.5", ("C", "A-B")),
        ("x-y=0.5", ("x", "y")),
        ("x-y-z=0.5", ("x", "y-z")),
        ("A-B=0", None),
        ("A-B=inf", None),
        ("A-B=x", None),
        ("A-B", None),
        ("A=0.5", None),
    ],
)
def test_lengths_between_joints(text, found):
    scene: Any = SimpleNamespace(joint=[SimpleNamespace(name=name) for name in ("A", "B", "C", "A-B")])
    if found:
        assert scene_files._length(scene, text) == (found, 0.5)
        return
    with pytest.raises(InputError, match="--length: must be A-B=LENGTH with a positive length in m"):
        scene_files._length(scene, text)


def test_new_scene_files(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(scene_files, "find_scene", lambda name: SCENE.with_(name=name))
    assert scene_files._new(parser().parse_args(["new", "a.toml"])) == 0
    assert (tmp_path / "a.toml").read_text() == scene_files.template()
    assert scene_files._new(parser().parse_args(["new", "b.toml", "--like", "c"])) == 0
    assert Scene.from_file(tmp_path / "b.toml").name == "c"
    assert capsys.readouterr().out == "a.toml: next, mbref draw a.toml\nb.toml: next, mbref draw b.toml\n"
    with pytest.raises(InputError, match=r"a\.toml: exists already and was not changed"):
        scene_files._new(parser().parse_args(["new", "a.toml"]))
    with pytest.raises(InputError, match=r"FILE: must end in \.toml, got 'a\.txt'"):
        scene_files._new(parser().parse_args(["new", "a.txt"]))
