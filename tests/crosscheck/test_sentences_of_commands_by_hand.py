"""Help, sentences and progress of commands / what is printed and how, written out by hand."""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.cli import closed_loops, differences, judging, modes, request, running, support, tables
from crosscheck.cli.parser import parser
from crosscheck.cli.request import Choice, RequestError
from crosscheck.setting import ORIGIN


class Console:
    """A console that keeps what is printed, and the options."""

    def __init__(self) -> None:
        self.printed: list[tuple[Any, dict[str, Any]]] = []

    def print(self, what: Any, **options: Any) -> None:
        self.printed.append((what, options))

    def folded(self) -> list[str]:
        """Return the sentences that are not printed as one line."""
        return [what for what, options in self.printed if isinstance(what, str) and options != ONE_LINE]


ONE_LINE = {"soft_wrap": True}


# --- help -------------------------------------------------------------------------------------------------
def commands() -> dict[str, argparse.ArgumentParser]:
    [found] = [a for a in parser()._actions if isinstance(a, argparse._SubParsersAction)]
    return dict(found.choices)


def test_the_help_of_a_command_says_what_it_does_and_has_an_example() -> None:
    found = commands()
    shown = {
        choice.dest: choice.help for a in parser()._actions for choice in getattr(a, "_choices_actions", ())
    }
    assert shown.keys() == found.keys() and len(found) == 15
    for name, command in found.items():
        assert command.epilog is not None and command.epilog.startswith(f"example:\n  crosscheck {name}")
        about = " ".join(str(command.description).split())
        assert about == " ".join(str(shown[name]).split()) and "crosscheck " + name not in about
        assert max(map(len, str(command.description).splitlines())) <= 79
        with pytest.raises(SystemExit), contextlib.redirect_stderr(io.StringIO()):
            command.parse_args(["--hel"])  # no option is abbreviated


def test_numbers_that_commands_have_without_options() -> None:
    known = parser()
    for line, name, value in (
        (["modes"], "starts", 16),
        (["certify", "a"], "digits", 20),
        (["certify", "a"], "samples", 3),
        (["modes"], "run", False),
        (["diff", "a", "b"], "all", False),
        (["paper"], "depth", "quick"),
    ):
        assert getattr(known.parse_args(line), name) == value, line


# --- sentences --------------------------------------------------------------------------------------------
def test_sentences_of_a_difference_are_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    changed = SimpleNamespace(
        identity=("s", "a", "f", '{"step": 0.1}', "{}"), old={"a": 1}, new={"a": 1}, sentences=("slower",)
    )
    alone = SimpleNamespace(
        identity=("s", "a", "f", '{"step": 0.1}', "{}"), old={"a": 1}, new=None, sentences=("only in old",)
    )
    monkeypatch.setattr(differences, "load", lambda path: path)
    monkeypatch.setattr(differences, "changes", lambda old, new: [changed, alone])
    monkeypatch.setattr(differences, "circumstances", lambda old, new: [f"numpy: {old} → {new}"])
    console: Any = Console()
    assert differences.show(console, "1", "2", False) is True
    first, second, (table, options), last = console.printed
    assert first == ("numpy: 1 → 2", ONE_LINE) and second == ("a: 1 run only in old", ONE_LINE)
    assert options == {} and [column.header for column in table.columns] == list(differences.HEADER)
    assert table.title == "\nruns" and [list(c.cells) for c in table.columns] == [
        ["s"],
        ["a"],
        ["f"],
        ["step=0.1"],
        ["slower"],
    ]
    assert last[1] == ONE_LINE and last[0].startswith("1 of 1 runs of both sets changed.")
    monkeypatch.setattr(differences, "changes", lambda old, new: [])
    console = Console()
    assert differences.show(console, "1", "2", True) is False and not console.folded()
    assert console.printed[-1] == (differences.NONE_OF_BOTH, ONE_LINE)


def test_sentences_of_a_judgement_and_of_modes_are_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    console: Any = Console()
    monkeypatch.setattr(judging, "console", lambda: console)
    cause = SimpleNamespace(sentence="The unit is mm", remains=0.012)
    found: Any = SimpleNamespace(
        columns=(), reason="it ends", until=0.5, is_right=False, explanations=(cause,)
    )
    judging._show(found, ["x"])
    assert [what for what, _ in console.printed[1:]] == [
        "The reference ends at t = 0.5 s: it ends",
        "The unit is mm: 1.2 % of the difference remains",
        "not read: x",
    ]
    assert not console.folded()
    found.explanations, found.reason, console.printed = (), "", []
    judging._show(found, [])
    assert [what for what, _ in console.printed[1:]] == [
        "None of the tested explanations removes half of the difference."
    ]
    console = Console()
    closed_loops._legend(console)
    assert len(console.printed) == len(closed_loops.LEGEND) and not console.folded()
    console = Console()
    for name, text in (("heading", "at rest"), ("search", "found"), ("rows", [])):
        monkeypatch.setattr(modes.document, name, lambda record, text=text: text)
    modes._show(console, [{"scene": "s", "eigenvalues": []}])
    assert len(console.printed) == 4 and not console.folded()


@pytest.mark.parametrize("text", ["x", "x=", "", "="])
def test_a_column_needs_a_place(text: str) -> None:
    with pytest.raises(RequestError) as caught:
        judging._assigned(text)
    assert list(caught.value.faults) == [f"--column {text}: must be NAME=PLACE, such as rod.position.x=3"]
    assert str(caught.value) == caught.value.faults[0]
    assert judging._assigned("a=b=c") == ("a", "b=c")


def test_all_faults_of_a_request_are_told() -> None:
    assert str(RequestError("one", "two")) == "one\ntwo" and RequestError("one", "two").faults == (
        "one",
        "two",
    )


# --- progress ---------------------------------------------------------------------------------------------
def test_runs_that_end_are_kept_and_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[Any] = []

    @contextlib.contextmanager
    def shown(what: str, count: int) -> Any:
        said.append((what, count))
        yield lambda *given: said.append(given)

    def study(cases: Any, progress: Any, run: Any) -> str:
        progress(1, 2, "first")
        progress(2, 2, "second")
        return "records"

    monkeypatch.setattr(running, "shown", shown)
    monkeypatch.setattr(running, "study", study)
    finished: list[Any] = []
    found: Any = running.studied(["a", "b"], finished)  # type: ignore[list-item]
    assert found == "records" and finished == ["first", "second"]
    assert said == [("running", 2), (1, 2, "first"), (2, 2, "second")]


def test_the_copy_of_the_standard_output_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Descriptors 1 and 2 are the standard output and the standard error."""
    calls: list[Any] = []
    calls_of = SimpleNamespace(
        dup=lambda fd: calls.append(("dup", fd)) or 9,
        dup2=lambda a, b: calls.append(("dup2", a, b)),
        close=lambda fd: calls.append(("close", fd)),
    )
    monkeypatch.setattr(running, "os", calls_of)
    monkeypatch.setattr(sys, "stdout", SimpleNamespace(flush=lambda: calls.append("flush")))
    with running.standard_output_kept():
        calls.append("within")
    assert calls == ["flush", ("dup", 1), ("dup2", 2, 1), "within", "flush", ("dup2", 9, 1), ("close", 9)]


def test_runs_have_a_hundred_intervals_between_their_samples() -> None:
    assert running.SAMPLES == 101 and (running.COMPLETED, running.OTHERWISE) == (0, 1)


@pytest.mark.parametrize("is_terminal", [True, False])
def test_the_width_of_a_console(is_terminal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal has its own width; elsewhere lines are long, so that no cell is folded."""
    made: list[Any] = []
    monkeypatch.setattr(running, "Console", lambda **given: made.append(given))
    monkeypatch.setattr(sys, "stdout", SimpleNamespace(isatty=lambda: is_terminal))
    running.console()
    running.console(80)
    assert [given["width"] for given in made] == ([None, None] if is_terminal else [180, 80])
    assert all(given["markup"] is False and given["highlight"] is False for given in made)


def test_sentences_of_advice_are_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the options that only say where a setting comes from."""
    assert "file" in ORIGIN and "import" in ORIGIN
    record = {"asked": {"options": {"step": 0.25, "file": "a.xml", "kind": "x"}}}
    assert tables._options(record) == "step=0.25, kind=x"
    runs = {name: {"name": name} for name in ("one", "two", "lost")}
    monkeypatch.setattr(tables, "is_completed", lambda r: r["name"] != "lost")
    monkeypatch.setattr(tables, "error_text", lambda r: f"e {r['name']}")
    monkeypatch.setattr(tables, "_seconds", lambda r: "0.5")
    monkeypatch.setattr(tables, "command", lambda r, path: f"run {path} {r['name']}")
    group: Any = SimpleNamespace(cheapest=lambda level: {"two": {"name": "cheap"}}, best=lambda: runs)
    console: Any = Console()
    tables._print_advice(console, group, "s.toml")
    heading = f"\nsettings to use: the fastest run within {tables.SAID}, otherwise the most accurate run"
    assert console.printed == [
        (heading, {}),
        ("  error e one, 0.5 s: run s.toml one", ONE_LINE),
        ("  error e cheap, 0.5 s: run s.toml cheap", ONE_LINE),
    ]
    found = {"one": {"family": "f", "name": "one"}}
    group = SimpleNamespace(scene="scene", within=lambda level, has: found)
    monkeypatch.setattr(tables, "own_code", lambda scene, r: f"code of {scene}")
    console = Console()
    tables._print_own_code(console, group)
    assert console.printed[0][0].startswith("\nto copy into your model: settings that an engine itself has")
    assert console.printed[1] == (f"  {tables.title('one')}, f, error e one, 0.5 s: code of scene", ONE_LINE)
    group.within = lambda level, has: {}
    console = Console()
    tables._print_own_code(console, group)
    assert not console.printed


def test_support_is_asked_of_the_engines_or_of_a_stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(support, "_ask", lambda name, scene: asked.append(name))
    monkeypatch.setattr(support, "feature_scenes", lambda: {"hinge": "scene"})
    monkeypatch.setattr(support, "SCENES", {"one": lambda: "scene", "two": lambda: "scene"})
    found = support.of_features(["a"])
    assert list(found.answers) == [
        "hinge",
        "coupling of angles",
        "coupling of an angle and a displacement",
        "coupling within a joint",
        "armature",
        "massless link",
        "motion without masses",
    ]
    assert asked == ["a"] * 7 and list(support.of_scenes(["a"]).answers) == ["one", "two"] and len(asked) == 9
    for matrix in (support.of_features, support.of_scenes):
        other = matrix(["a", "b"], lambda name, scene: name)  # type: ignore[arg-type, return-value]
        assert all(answers == {"a": "a", "b": "b"} for answers in other.answers.values())
    assert len(asked) == 9


# --- plans ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("chosen", "wanted"),
    [
        (Choice(), "few ()"),
        (Choice(families=["f"]), "few ['f']"),
        (Choice(is_quick=False), "able"),
        (Choice(families=["f"], is_quick=False), "named"),
        (Choice(rtol=1e-6), "tolerance 1e-06"),
    ],
)
def test_a_plan_by_its_choice(chosen: Choice, wanted: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request, "_able", lambda *given: "able")
    monkeypatch.setattr(request, "_named", lambda cases, families, notice: "named")
    monkeypatch.setattr(request, "_at_tolerance", lambda cases, rtol: f"tolerance {rtol}")
    monkeypatch.setattr(request, "of_few_families", lambda cases, families: f"few {families}")
    found: Any = request.plan([], ["e"], chosen, [np.zeros(1)], 1.0, lambda sentence: None)
    assert found == wanted
    for limit in (0.0, -1.0, float("nan")):
        with pytest.raises(RequestError, match="--time-limit: must be positive"):
            request.plan([], ["e"], chosen, [], limit, lambda sentence: None)
