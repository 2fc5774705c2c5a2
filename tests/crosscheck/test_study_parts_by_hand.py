"""Parts of a study on records without runs / animated runs, repeated commands and sentences by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.cli import comparison, request, scene_request
from crosscheck.engine import Setting
from crosscheck.setting import BRANCHES
from crosscheck.study import pictures, progress, sentences, speed_sentences
from crosscheck.study.command import command
from crosscheck.study.grid import Case
from mbref.scene import Body, Scene

BODY = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", body=(BODY,), duration=2.0)


def case(engine: str = "e", scene: Scene = SCENE, **options: Any) -> Case:
    return Case(scene, np.array([0.0, 2.0]), engine, Setting("f", options))


def record(error: float | None, scene: str = "s", outcome: str = "COMPLETED", **more: Any) -> dict[str, Any]:
    return {"scene": scene, "outcome": outcome, "metrics": {"error": error}, "crossings": [], **more}


# --- Animated runs ----------------------------------------------------------------------------------------
@pytest.fixture
def studied(monkeypatch: pytest.MonkeyPatch) -> list[Case]:
    """The cases that are studied."""
    found: list[Case] = []

    def study(cases: Any, threads: Any, path: Any, run: Any) -> list[Any]:
        found.extend(cases)
        assert path == "path" and run is pictures._run
        return ["records"]

    monkeypatch.setattr(pictures, "study", study)
    return found


def test_the_completed_run_of_largest_error_is_animated(studied: list[Case]) -> None:
    other = SCENE.with_(name="o")
    runs = [
        (case(k=1), record(0.25)),
        (case(k=2), record(0.5)),
        (case(k=3), record(9.0, outcome="STEP_FAILED")),
        (case(k=4, scene=other), record(0.75, "o")),
    ]
    truths = [
        {"scene": "s", "motion": {"times": [0.0, 0.5]}},
        {"scene": "o", "motion": None},
        {"scene": "n", "motion": {"times": [0.0, 1.0]}},
    ]
    assert pictures.worst_runs(runs, truths, "path") == ["records"]  # type: ignore[arg-type]
    [found] = studied
    assert found.setting.options == {"k": 2} and found.times.tolist() == [0.0, 0.5]


def crossing(time: float, branches: int) -> dict[str, Any]:
    return {"time": time, "velocity": [[0.0]] * branches}


def test_branches_of_the_best_run_are_animated(studied: list[Case], monkeypatch: pytest.MonkeyPatch) -> None:
    """One with a single branch and two with several: the second and the third are shown on each branch."""
    engines = {"e": SimpleNamespace(options={BRANCHES: ""}), "plain": SimpleNamespace(options={})}
    monkeypatch.setattr(pictures, "engine", engines.__getitem__)
    instants = SimpleNamespace(
        from_record=lambda c: SimpleNamespace(
            velocity=c["velocity"], instants=lambda end, frames: np.array([c["time"], end, frames])
        )
    )
    monkeypatch.setattr(pictures, "Crossing", instants)
    passed = [crossing(0.25, 1), crossing(0.5, 2), crossing(0.75, 3), crossing(1.0, 2)]
    runs = [
        (case(k=1), record(0.5, crossings=passed)),
        (case(k=2), record(0.25, crossings=passed)),
        (case(k=3), record(0.1, crossings=[])),
        (case(k=4), record(0.1, outcome="STEP_FAILED", crossings=passed)),
        (case("plain", k=5), record(0.1, crossings=passed)),
    ]
    pictures.branches(runs, "path")  # type: ignore[arg-type]
    assert [found.setting.options for found in studied] == [
        {"k": 2, BRANCHES: [[number, branch]]} for number, branch in ((2, 1), (2, 2), (3, 1), (3, 2), (3, 3))
    ]
    assert [found.times.tolist() for found in studied] == [[0.5, 2.0, 75.0]] * 2 + [[0.75, 2.0, 75.0]] * 3
    assert {found.setting.family for found in studied} == {"f"}


def test_positions_that_are_shown() -> None:
    alone, several = crossing(0.0, 1), crossing(0.0, 2)
    assert pictures.shown([alone, several, several, several]) == [2, 3] and pictures.shown(
        [alone, alone]
    ) == [1]


def test_poses_have_six_digits_of_the_largest() -> None:
    turn = [[1.0, 0.0, 0.0, 0.0]]
    bodies = {
        "a": {"position": [[123.456789, 0.0004, 0.0]], "orientation": [[0.123456789, 0.0, 0.0, 0.0]]},
        "b": {"position": [[-0.0016, 0.0, 0.0]], "orientation": turn},
    }
    found = pictures.shortened(bodies)
    assert found["a"] == {"position": [[123.457, 0.0, 0.0]], "orientation": [[0.123457, 0.0, 0.0, 0.0]]}
    assert found["b"] == {"position": [[-0.002, 0.0, 0.0]], "orientation": turn}
    still = pictures.shortened({"a": {"position": [[0.0] * 3], "orientation": turn}})
    assert still["a"]["position"] == [[0.0] * 3]


def test_pictures_need_no_reactions(monkeypatch: pytest.MonkeyPatch) -> None:
    bodies = {
        "a": {"position": [[1.23456789] * 3], "orientation": [[1.0, 0.0, 0.0, 0.0]], "velocity": [[1.0] * 3]}
    }
    given = {"key": "k", "bodies": bodies, "reactions": {}, "open_reactions": {}}
    monkeypatch.setattr(pictures, "record_of", lambda case, trajectory: given)
    found = pictures._pictured("case", "trajectory")  # type: ignore[arg-type]
    assert found == {
        "key": "k",
        "bodies": {"a": {"position": [[1.23457] * 3], "orientation": [[1.0, 0.0, 0.0, 0.0]]}},
    }


# --- Commands ---------------------------------------------------------------------------------------------
def test_a_command_repeats_a_run_by_its_options() -> None:
    """The file of a scene stands in the scene's words, not among the options."""
    asked = {"engine": "mujoco", "options": {"file": "/x.xml", "import": "--hold b", "step": 0.5}, "end": 2.0}
    given = {"asked": {**asked, "samples": 3}, "family": "as in file, finer", "time_limit": 60.0}
    words = "--hold b --engine mujoco --setting 'as in file, finer' --option step=0.5"
    text = f"crosscheck run 'my file.xml' {words}"
    assert command(given, "'my file.xml' --hold b") == f"{text} --samples 3 --duration 2.0"
    timed = {"asked": {**asked, "times": [0.0, 0.25]}, "family": "as in file, finer", "time_limit": 5.0}
    assert (
        command(timed, "'my file.xml' --hold b") == f"{text} --times 0.0,0.25 --duration 2.0 --time-limit 5"
    )


# --- Sentences on defaults that fail ----------------------------------------------------------------------
def group(name: str, redundant: int, **defaults: Any) -> Any:
    return SimpleNamespace(scene=SimpleNamespace(name=name), redundant=redundant, defaults=lambda: defaults)


def failed(t: float, outcome: str = "STEP_FAILED") -> dict[str, Any]:
    return {"t_end": t, "outcome": outcome}


@pytest.mark.parametrize(
    ("scenes", "names", "says"),
    [
        ([group("s", 0, a=failed(0.25))], ["a"], "The defaults of a end at t = 0.25 s."),
        ([group("s", 0, a=failed(-1.0))], ["a"], "The defaults of a end at t = 0 s."),
        (
            [group("s", 1, a=failed(0.25))],
            ["a"],
            "The defaults of a end at t = 0.25 s, where a constraint is redundant.",
        ),
        (
            [group("s", 2, a=failed(0.25))],
            ["a"],
            "The defaults of a end at t = 0.25 s, where constraints are redundant.",
        ),
        (
            [group("s", 1, a=failed(0.25), b=failed(0.5))],
            ["a", "b"],
            "The defaults of a and b do not complete, where a constraint is redundant.",
        ),
        (
            [group("s", 1, a=failed(0.25)), group("t", 1, a=failed(0.25))],
            ["a"],
            "The defaults of a end at t = 0.25 s on both scenes, where constraints are redundant.",
        ),
        (
            [group("s", 1, a=failed(0.25)), group("t", 0, a=failed(0.5))],
            ["a"],
            "The defaults of a do not complete on both scenes.",
        ),
        (
            [group("s", 1, a=failed(0.25, "TIMED_OUT"))],
            ["a"],
            "The defaults of a do not end within the time limit.",
        ),
    ],
)
def test_defaults_that_fail(scenes: list[Any], names: list[str], says: str) -> None:
    assert sentences._failed(scenes, names, scenes) == says


def test_scenes_of_defaults_that_fail_are_named_among_others() -> None:
    one, other = group("s", 0, a=failed(0.25)), group("t", 0, a=failed(0.25))
    assert sentences._failed([one, other], ["a"], [other]) == "The defaults of a end at t = 0.25 s on t."


def test_wrong_defaults_with_their_errors() -> None:
    one, other = (group(n, 0, a=record(e)) for n, e in (("s", 0.25), ("t", 0.125)))
    assert sentences._wrong("a", [one], [one]) == "a's defaults complete, but with an error of 0.25 at best."
    both = sentences._wrong("a", [one, other], [one, other])
    assert both == "a's defaults complete on both scenes, but with an error of 0.12 to 0.25 at best."


def test_engines_that_fail_alike_share_a_sentence() -> None:
    one, other = group("s", 0), group("t", 0)
    found = sentences._merged({"a": [one], "b": [one, other], "c": [one]})
    assert found == {("a", "c"): [one], ("b",): [one, other]}


# --- Progress ---------------------------------------------------------------------------------------------
def test_a_terminal_has_a_bar_with_the_last_work(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []

    class Bar:
        def __init__(self, *columns: Any, console: Any, transient: bool) -> None:
            shown.append((len(columns), transient))

        def __enter__(self) -> Bar:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def add_task(self, what: str, total: int, last: str) -> str:
            shown.append((what, total, last))
            return "task"

        def update(self, task: str, completed: int, total: int, last: str) -> None:
            shown.append((task, completed, total, last))

    monkeypatch.setattr(progress, "Progress", Bar)
    monkeypatch.setattr(progress, "Console", lambda stderr: SimpleNamespace(is_terminal=stderr))
    with progress.counted("runs", 4) as advance:
        advance("first")
        advance("second")
    assert shown == [(7, True), ("runs", 4, ""), ("task", 1, 4, "first"), ("task", 2, 4, "second")]
    column = progress._Working(progress.UnderWay())
    assert column.render(SimpleNamespace(fields={"last": "first"})).plain == "first"  # type: ignore[arg-type]
    assert column.max_refresh == 1.0


# --- Speed ------------------------------------------------------------------------------------------------
def test_who_integrates(monkeypatch: pytest.MonkeyPatch) -> None:
    def engine(name: str) -> Any:
        if name == "gone":
            raise LookupError(name)
        return SimpleNamespace(integrated_here=("forward",))

    monkeypatch.setattr(speed_sentences, "engine", engine)
    of = {"family": "forward", "asked": {"engine": "here"}}
    assert speed_sentences.is_integrated_here(of)
    assert not speed_sentences.is_integrated_here({**of, "family": "own"})
    assert not speed_sentences.is_integrated_here({**of, "asked": {"engine": "gone"}})


# --- A comparison from Python -----------------------------------------------------------------------------
@pytest.mark.parametrize("is_file", [True, False])
def test_a_comparison_reports_to_its_caller_and_names_its_scene(
    is_file: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scene made in Python is named as the file that it would be saved in."""
    notices: list[str] = []
    paths: list[dict[str, str]] = []
    monkeypatch.setattr(scene_request, "find_scenes", lambda names: [SCENE.with_(name=names[0])])

    def find_engines(names: Any, tell: Any) -> list[str]:
        tell("left out")
        return ["e"]

    monkeypatch.setattr(request, "find_engines", find_engines)
    monkeypatch.setattr(comparison, "collected", lambda *given: "found")
    monkeypatch.setattr(
        comparison, "comparisons", lambda found, named, limit: paths.append(named) or ["compared"]
    )
    given: Any = "my.toml" if is_file else SCENE
    assert comparison.compare(given, notice=notices.append) == "compared"  # type: ignore[comparison-overlap]
    assert notices == ["left out"]
    assert paths == [{"my.toml": "my.toml"} if is_file else {"s": "s.toml"}]
    comparison.compare(given)
    assert notices == ["left out"]
