"""mbref run, draw and animate with stand-ins for their runs / files, lines and exit status by hand."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mbref.cli import pictures, run
from mbref.cli.commands import parser
from mbref.input_error import InputError
from mbref.method import MethodError
from mbref.scene import Body, Scene
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
