"""Options of the command lines / stand-ins for the work: each option reaches it, and sets the exit status."""

from __future__ import annotations

import json
import os
import signal
from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck.cli import closed_loops as loops
from crosscheck.cli import commands, comparing, convergence, findings, main, modes, running
from crosscheck.closed_loops.matrix import LEGEND
from crosscheck.findings.finding import Answer, Status
from mbref.scenes import SCENES


@pytest.fixture
def asked(monkeypatch) -> dict[str, Any]:
    """The arguments of the last call of each stand-in."""
    calls: dict[str, Any] = {}

    def stand_in(place: Any, name: str, value: Any = None) -> None:
        def called(*given: Any, **named: Any) -> Any:
            calls[name] = (*given, *named.values())
            return value(*given) if callable(value) else value

        monkeypatch.setattr(place, name, called)

    calls["stand_in"] = stand_in
    return calls


def test_modes_of_a_scene_and_of_the_stored_mechanisms(asked, capsys, tmp_path):
    stand_in, pose = asked["stand_in"], {"scene": "s"}
    stand_in(modes, "all_engines", ["dart", "mujoco", "other"])
    stand_in(modes.records, "measured", [pose])
    stand_in(modes.records, "read", lambda: [pose, pose])
    stand_in(modes.records, "of_mechanisms", ["new"])
    stand_in(modes.records, "merged", ["merged"])
    stand_in(modes.records, "write")
    stand_in(modes.document, "page", "the page\n")
    assert main(["modes", "four_bar_gravity", "--starts", "5", "--json"]) == 0
    scene, engines, starts, _ = asked["measured"]
    assert (scene.name, engines, starts) == ("four_bar_gravity", ["mujoco", "dart"], 5)
    assert json.loads(capsys.readouterr().out) == {"poses": [pose]} and "read" not in asked
    page = tmp_path / "page.md"
    assert main(["modes", "--page", str(page), "--json"]) == 0
    assert page.read_text() == "the page\n" and "write" not in asked
    captured = capsys.readouterr()
    assert len(json.loads(captured.out)["poses"]) == 2 and captured.err == f"written: {page}\n"
    assert main(["modes", "--run", "--json"]) == 0
    assert asked["of_mechanisms"][0] == ["mujoco", "dart"] and asked["write"] == (["merged"],)
    assert asked["merged"] == (["new"], [pose, pose])
    stand_in(modes.records, "read", list)
    assert main(["modes"]) == 1
    assert "finds no equilibrium" in capsys.readouterr().out


def test_closed_loops_are_measured_only_if_asked(asked, capsys, tmp_path):
    stand_in = asked["stand_in"]
    stand_in(loops.records, "read", [])
    stand_in(loops.records, "cases", (["case"], ["unable"]))
    stand_in(loops.records, "measure")
    stand_in(loops.document, "page", "the page\n")
    stand_in(loops.request, "find_engines", ["mbref"])
    path, page = tmp_path / "records.jsonl", tmp_path / "page.md"
    assert main(["closed-loops", "--records", str(path)]) == 0
    assert "measure" not in asked and asked["read"] == (path,)
    out = capsys.readouterr().out
    words = " ".join(out.split())
    assert "at its best settings" in words and "by the library's defaults" in words
    assert all(meaning in out for meaning in LEGEND.values())
    assert main(["closed-loops", "--records", str(path), "--run", "--page", str(page)]) == 0
    assert asked["find_engines"][0] == ["all"] and page.read_text() == "the page\n"
    assert asked["cases"][0] == ["mbref"] and asked["measure"][:3] == (["case"], ["unable"], path)
    assert main(["closed-loops", "--records", str(path), "--run", "--engine", "mbref"]) == 0
    assert asked["find_engines"][0] == ["mbref"]


def test_orders_of_convergence_are_measured_only_if_asked(asked, capsys, tmp_path):
    stand_in = asked["stand_in"]
    stand_in(convergence, "read", [])
    stand_in(convergence.ladders, "measure")
    stand_in(convergence.document, "page", "the page\n")
    stand_in(convergence.request, "find_engines", ["mbref"])
    path, page = tmp_path / "records.jsonl", tmp_path / "page.md"
    assert main(["convergence", "--records", str(path)]) == 0
    assert "measure" not in asked and asked["read"] == (path,)
    assert "least errors" in capsys.readouterr().out
    assert main(["convergence", "--records", str(path), "--run", "--page", str(page)]) == 0
    assert asked["find_engines"][0] == ["all"] and page.read_text() == "the page\n"
    assert asked["measure"][:2] == (["mbref"], path)
    assert main(["convergence", "--run", "--engine", "mbref"]) == 0
    assert asked["find_engines"][0] == ["mbref"]


def finding(name: str) -> SimpleNamespace:
    answer = (
        Answer(Status.PRESENT, "2.0", 3.0, "off by 3 m")
        if name == "first"
        else Answer(Status.ABSENT, "", None, "")
    )
    return SimpleNamespace(name=name, engine="e", version="1.0", does="it drifts", recheck=lambda: answer)


def test_findings_are_rechecked_only_if_asked(monkeypatch, capsys):
    monkeypatch.setattr(findings, "findings", lambda: [finding("first"), finding("second")])
    assert main(["findings"]) == 0
    out = capsys.readouterr().out
    assert "first" in out and "second" in out and "status" not in out
    assert main(["findings", "first", "--recheck"]) == 0
    out = capsys.readouterr().out
    assert "second" not in out and "status" in out and "2.0" in out and "off by 3 m" in out
    assert main(["findings", "second", "--recheck"]) == 0
    assert "–" in capsys.readouterr().out
    assert main(["findings", "frist"]) == 2
    assert "unknown finding 'frist'; known: first, second" in capsys.readouterr().err


def compared(difference: str | None = None, differences: tuple[str, ...] = ()) -> SimpleNamespace:
    scene = SCENES["four_bar"]()
    judged = SimpleNamespace(scene=scene, differences=dict.fromkeys(differences))
    return SimpleNamespace(
        difference=difference,
        judged=judged,
        document=lambda: {"scene": scene.name},
        print=lambda console: None,
    )


def test_options_of_a_comparison(asked, capsys):
    stand_in = asked["stand_in"]
    stand_in(comparing, "collected", "records")
    stand_in(comparing, "comparisons", [compared()])
    options = ["--samples", "4", "--reference-time", "7", "--repeats", "6", "--depth", "whole"]
    assert main(["compare", "four_bar", "--engine", "mbref", "--json", *options]) == 0
    [scene], [engine], wanted, *_ = asked["collected"]
    assert (scene.name, engine) == ("four_bar", "mbref") and len(wanted.times[0]) == 4
    assert wanted[1:] == (7.0, False, None, 6, False)
    assert asked["comparisons"] == ("records", {"four_bar": "four_bar"}, 7.0)
    assert json.loads(capsys.readouterr().out) == {"scene": "four_bar"}
    named = ["--setting", "taylor", "--depth", "quick"]
    assert main(["compare", "four_bar", "--engine", "mbref", "--json", *named]) == 0
    wanted = asked["collected"][2]
    assert (wanted.is_quick, wanted.is_named, wanted.repeats) == (True, True, comparing.REPEATS)
    assert main(["compare", "four_bar", "--repeats", str(comparing.REPEATS - 1)]) == 2
    assert f"--repeats: must be at least {comparing.REPEATS}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("found", "says"),
    [
        (
            compared("a mass"),
            "four_bar: the engines simulate different mechanisms, so times are not compared: a mass",
        ),
        (compared("a mass", ("a", "b")), "four_bar: a, b: the adapter or the scene differs: a mass"),
    ],
)
def test_a_comparison_of_different_mechanisms_is_not_done(asked, capsys, found, says):
    asked["stand_in"](comparing, "collected", "records")
    asked["stand_in"](comparing, "comparisons", [compared(), found])
    assert main(["compare", "four_bar", "--engine", "mbref"]) == 1
    assert capsys.readouterr().err == says + "\n"


def test_options_of_tune(asked, capsys):
    stand_in = asked["stand_in"]
    record = {"family": "own", "cost": {"seconds": 2.0}, "key": "k"}
    ours = {"family": "ours", "cost": {"seconds": 1.0}, "key": "l"}
    stand_in(comparing, "scouted")
    stand_in(comparing.request, "plan", [])
    stand_in(comparing, "engine", SimpleNamespace(integrated_here=("ours",)))
    stand_in(comparing, "tuned", SimpleNamespace(cases=[], reached=[ours, record], records=[]))
    stand_in(comparing, "with_timings", [ours, record])
    for name in ("public", "command"):
        stand_in(comparing, name, lambda r, *_: {"family": r["family"]} if len(_) == 0 else "the command")
    stand_in(comparing.tables, "own_code", "code")
    assert main(["tune", "mbref", "four_bar", "--error", "1e-7", "--duration", "0.05", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["error"] == 1e-7 and [r["family"] for r in printed["records"]] == ["own", "ours"]
    assert [r["integrated_here"] for r in printed["records"]] == [False, True]
    assert asked["tuned"][1] == 1e-7 and asked["tuned"][3] == ("ours",)
    [scene], [name], choice, [times], *_ = asked["plan"]
    assert (scene.duration, name, choice.is_quick, times[-1]) == (0.05, "mbref", False, 0.05)
    assert main(["tune", "mbref", "four_bar", "--closure", "2mm", "--time-limit", "3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["closure"] == pytest.approx(2e-3)
    assert asked["tuned"][1] == pytest.approx(2e-3) and asked["plan"][4] == 3.0
    stand_in(comparing, "with_timings", [])
    assert main(["tune", "mbref", "four_bar", "--json"]) == 1


@pytest.mark.parametrize(("outcome", "status"), [("COMPLETED", 0), ("STEP_FAILED", 1)])
def test_status_of_runs_and_their_documents(monkeypatch, capsys, outcome, status):
    cases = [SimpleNamespace(scene=SimpleNamespace(name="s"), key=k) for k in ("1", "2", "1")]
    monkeypatch.setattr(commands, "cases_of", lambda arguments: cases)
    monkeypatch.setattr(commands, "key", lambda case: case.key)
    monkeypatch.setattr(running, "public", lambda record: record["key"])

    def studied(cases: Any, finished: list) -> None:
        finished += [{"key": k, "outcome": o, "scene": "s"} for k, o in (("2", outcome), ("1", "COMPLETED"))]

    monkeypatch.setattr(commands, "studied", studied)
    assert main(["run", "four_bar", "--json"]) == status
    assert json.loads(capsys.readouterr().out) == {"scene": "s", "records": ["1", "2"]}


def test_finished_runs_are_printed_after_an_interrupt(monkeypatch, capsys):
    monkeypatch.setattr(
        commands, "cases_of", lambda arguments: [SimpleNamespace(scene=SimpleNamespace(name="s"))]
    )
    monkeypatch.setattr(commands, "key", lambda case: "1")
    monkeypatch.setattr(running, "public", lambda record: record["key"])

    def studied(cases: Any, finished: list) -> None:
        finished.append({"key": "1", "outcome": "COMPLETED", "scene": "s"})
        raise KeyboardInterrupt

    monkeypatch.setattr(commands, "studied", studied)
    assert main(["run", "four_bar", "--json"]) == 130
    captured = capsys.readouterr()
    assert json.loads(captured.out)["records"] == ["1"] and captured.err == "interrupted\n"


def test_options_of_verify(asked, capsys):
    from crosscheck.conformance import deep, deep_table, suite

    stand_in = asked["stand_in"]
    found = SimpleNamespace(conforms=False, to_record=lambda: {"verdicts": []})
    stand_in(commands.request, "find_specimens", ["one", "two"])
    stand_in(suite, "runner", "the runner")
    stand_in(suite, "held_against", found)
    stand_in(suite, "tables", ["the table"])
    assert main(["verify", "mbref", "--time-limit", "9", "--in-process", "--family", "taylor", "--json"]) == 1
    assert asked["runner"] == ("mbref", 9.0, True) and asked["held_against"][0] == "the runner"
    assert asked["held_against"][1] == ["one", "two"] and asked["held_against"][3] == "taylor"
    assert json.loads(capsys.readouterr().out)["verdicts"] == []
    found.conforms = True
    assert main(["verify", "mbref", "--scene", "heavy top", "--reference-time", "3"]) == 0
    assert capsys.readouterr().out == "the table\n" and asked["runner"][2] is False
    assert asked["find_specimens"] == (["heavy top"], 3.0, "mbref")
    stand_in(deep, "examined", found)
    stand_in(deep_table, "tables", ["the deep table"])
    drawn = ["--mechanisms", "7", "--first-seed", "40", "--records", "somewhere"]
    assert main(["verify", "mbref", *drawn]) == 0
    plan, records, _ = asked["examined"]
    assert plan == deep.Plan("mbref", 7, 40, "", ()) and str(records) == "somewhere"
    assert capsys.readouterr().out == "the deep table\n"


def test_a_report_runs_as_a_program_of_its_own(monkeypatch):
    ran: list[Any] = []

    class Program:
        def __init__(self, words: list[str], process_group: int) -> None:
            ran.append(words[1:])

        def __enter__(self) -> Program:
            return self

        def __exit__(self, *_: Any) -> None:
            pass

        def wait(self) -> int:
            return 5 if len(ran) < 3 else -signal.SIGTERM

    monkeypatch.setattr(commands.subprocess, "Popen", Program)
    options = [
        "--engine",
        "mbref",
        "--engine",
        "mujoco",
        "--section",
        "summary",
        "--out",
        "o",
        "--depth",
        "quick",
    ]
    assert main(["report", "four_bar", *options, "--reference-time", "2", "--render", "r"]) == 5
    assert ran[0] == [
        *("-m", "reports", "four_bar", "--out", "o", "--engine", "mbref", "--engine", "mujoco"),
        *("--depth", "quick", "--reference-time", "2", "--render", "r", "--section", "summary"),
    ]
    assert main(["paper", "--out", "p", "--depth", "whole"]) == 5
    assert ran[1] == ["-m", "reports", "--section", "paper", "--out", "p", "--depth", "whole"]
    assert main(["report"]) == 143, "128 and the number of the signal that ended the program"
    assert "--render" not in ran[2]


def test_what_an_engine_prints_stays_out_of_the_standard_output(capfd):
    """Libraries write to file descriptors, and their bytes would spoil the JSON object of `verify --json`."""
    with pytest.raises(KeyboardInterrupt), running.standard_output_kept():
        os.write(1, b"Module loaded\n")
        raise KeyboardInterrupt
    os.write(1, b"{}\n")
    assert capfd.readouterr() == ("{}\n", "Module loaded\n")


PLACES = [
    "certify four_bar --out",
    "reference four_bar --out",
    "verify mbref --mechanisms 1 --records",
    "modes --page",
    "closed-loops --page",
    "convergence --page",
    "report --out",
    "paper --out",
]


@pytest.mark.parametrize("line", PLACES)
def test_a_place_that_cannot_be_written_is_refused_before_the_work(line, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as caught:
        main([*line.split(), f"{tmp_path}/file/below"])
    assert caught.value.code == 2
    assert f"argument {line.split()[-1]}: " in capsys.readouterr().err


def test_a_file_that_cannot_be_written_later_is_reported_in_a_line(monkeypatch, capsys):
    """A full disk is reported, and an error of the system that names no file keeps its traceback."""
    errors = [OSError(28, "No space left on device", "run.csv"), OSError(12, "Cannot allocate memory")]

    def fail(*_: Any) -> None:
        raise errors.pop(0)

    monkeypatch.setitem(commands.COMMANDS, "diff", fail)
    assert main(["diff", "old", "new"]) == 2
    assert capsys.readouterr().err == "run.csv: No space left on device\n"
    with pytest.raises(OSError, match="allocate"):
        main(["diff", "old", "new"])


@pytest.mark.parametrize(("changed", "status"), [(True, 1), (False, 0)])
def test_a_difference_sets_the_status(monkeypatch, changed, status):
    asked = []
    monkeypatch.setattr("crosscheck.cli.differences.show", lambda out, *given: asked.append(given) or changed)
    assert main(["diff", "old", "new", "--all"]) == main(["diff", "old", "new"]) == status
    assert asked == [("old", "new", True), ("old", "new", False)]


def test_a_command_is_required(capsys):
    with pytest.raises(SystemExit) as caught:
        main([])
    assert caught.value.code == 2 and "COMMAND" in capsys.readouterr().err


def test_a_pipe_that_its_reader_closes_is_no_failure(monkeypatch):
    def closed(arguments: Any) -> int:
        raise BrokenPipeError

    monkeypatch.setitem(commands.COMMANDS, "list", closed)
    redirected = []
    monkeypatch.setattr(commands.os, "dup2", lambda *given: redirected.append(given))
    monkeypatch.setattr(commands.os, "open", lambda *given: 99)
    monkeypatch.setattr(commands.sys, "stdout", SimpleNamespace(fileno=lambda: 1, write=print, flush=int))
    assert main(["list"]) == 1 and redirected == [(99, 1)]
