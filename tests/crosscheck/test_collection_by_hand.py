"""Records of a report / stand-ins for the runs: what is asked for, stored and put together."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck.cli import collection
from crosscheck.cli.collection import Runs
from crosscheck.cli.request import RequestError
from crosscheck.study.comparison import Wanted
from crosscheck.study.grid import Unable
from mbref.scene import Body, Scene


def still(name: str, duration: float = 0.5) -> Scene:
    block = Body(name="block", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 2.0, 3.0))
    return Scene(name=name, body=(block,), duration=duration)


@pytest.fixture
def asked(monkeypatch) -> dict[str, Any]:
    """The arguments of a comparison, and what its plan chooses."""
    found: dict[str, Any] = {"notices": []}

    def collected(scenes, engines, wanted, plan, notice):
        found.update(scenes=scenes, engines=engines, wanted=wanted, notice=notice)
        found["cases"] = plan()
        return "the collection"

    monkeypatch.setattr(collection, "collected", collected)
    monkeypatch.setattr(collection, "find_engines", lambda names, notice: [*(names or ["default"])])
    for name in ("quick", "whole"):
        scenes = [still(f"{name} a"), still(f"{name} b", 2.0)]
        monkeypatch.setattr(collection.sweep, f"{name}_scenes", lambda scenes=scenes: scenes)
        monkeypatch.setattr(
            collection.sweep,
            name,
            lambda scenes, engines, name=name: ([name, [s.name for s in scenes], *engines], []),
        )
    return found


@pytest.mark.parametrize(("is_quick", "kind", "samples"), [(True, "quick", 31), (False, "whole", 101)])
def test_scenes_and_times_by_depth(is_quick, kind, samples, asked, tmp_path):
    found = collection.comparison(tmp_path, Runs(None, None, is_quick, 7.0), print)
    assert found == "the collection" and asked["notice"] is print and asked["engines"] == ["default"]
    assert asked["cases"] == [kind, [f"{kind} a", f"{kind} b"], "default"]
    wanted = asked["wanted"]
    assert isinstance(wanted, Wanted) and wanted[1:4] == (7.0, is_quick, tmp_path)
    assert [(len(t), t[0], t[-1]) for t in wanted[0]] == [(samples, 0.0, 0.5), (samples, 0.0, 2.0)]


def test_named_scenes_and_engines_and_a_refusal(asked, tmp_path, monkeypatch):
    lines: list[str] = []
    refusal = Unable(still("mine"), "e", "no loop")
    monkeypatch.setattr(collection.sweep, "quick", lambda scenes, engines: (["case"], [refusal]))
    collection.comparison(tmp_path, Runs([still("mine")], ["e"], True, 1.0), lines.append)
    assert [s.name for s in asked["scenes"]] == ["mine"] and asked["engines"] == ["e"]
    assert asked["cases"] == ["case"] and lines == ["e cannot run mine: no loop"]
    monkeypatch.setattr(collection.sweep, "quick", lambda scenes, engines: ([], [refusal]))
    with pytest.raises(RequestError, match="no engine can run these scenes"):
        collection.comparison(tmp_path, Runs([still("mine")], ["e"], True, 1.0), lines.append)


def test_ladders_are_stored_in_a_folder_that_need_not_exist(asked, tmp_path, monkeypatch):
    monkeypatch.setattr(collection.stability, "run", lambda path, engines: (path, engines))
    for _ in range(2):
        path, engines = collection.stability_ladders(tmp_path / "a" / "b", ["e"], print)
    assert path == tmp_path / "a" / "b" / collection.stability.FILE and engines == ["e"]
    with pytest.raises(FileNotFoundError, match=r"b: has no stability.jsonl of a report"):
        collection.stored_ladders(tmp_path / "a" / "b")
    path.write_text('{"key": "one", "x": 1}\n{"key": "one", "x": 2}\n{"key": "two", "x": 3}\n')
    assert [r["x"] for r in collection.stored_ladders(tmp_path / "a" / "b")] == [2, 3]


@pytest.mark.parametrize("is_whole", [True, False])
def test_runs_of_the_paper(is_whole, tmp_path, monkeypatch):
    """Cells, timed runs and studies run first, then runs whose settings follow from their records; only the
    timed runs take turns."""
    calls: list[Any] = []
    cases = {"cell": "case of the cell"}
    timed = {"timed 1": "case 1", "timed 2": "case 2"}
    studies = {"study": "case of the study"}

    def run(path, chosen, progress):
        calls.append((path, list(chosen), progress))
        return {label: f"record of {label}" for label in chosen}

    @contextmanager
    def shown(what, count):
        yield f"{what}: {count}"

    def with_timings(chosen, records, path, notice, repeats):
        calls.append((chosen, records, path, notice, repeats))
        return [f"time of {record}" for record in records]

    made = SimpleNamespace(
        timed=lambda: timed,
        cases=lambda: cases,
        studies=lambda: studies,
        follow_ups=lambda records: {"more": f"after {len(records)}"},
    )
    monkeypatch.setattr(collection, "runs", made)
    monkeypatch.setattr(
        collection,
        "store",
        SimpleNamespace(FILE="paper.jsonl", run=run, index=lambda path, chosen: calls.append((path, chosen))),
    )
    monkeypatch.setattr(collection, "shown", shown)
    monkeypatch.setattr(collection, "with_timings", with_timings)
    monkeypatch.setattr(collection, "illustration", lambda path: f"illustration in {path.name}")
    out = tmp_path / "new" / "folder"
    found = collection.paper(out, is_whole, print)
    first, more, turns, index = calls
    expected = ["cell", "timed 1", "timed 2", *(["study"] if is_whole else [])]
    assert first == (out / "paper.jsonl", expected, f"the paper's runs: {len(expected)}")
    assert more == (out / "paper.jsonl", ["more"], "their errors: 1")
    records = ["record of timed 1", "record of timed 2"]
    assert turns == (["case 1", "case 2"], records, out / "paper-timings.jsonl", print, 3)
    assert index[0] == out / "paper.jsonl" and list(index[1]) == [*expected, "more"]
    assert index[1]["more"] == f"after {len(expected)}"
    assert found.illustration == "illustration in paper-illustration.jsonl"
    assert found.records == {
        **{label: f"record of {label}" for label in (*expected, "more")},
        "timed 1": "time of record of timed 1",
        "timed 2": "time of record of timed 2",
    }


def test_stored_runs_of_the_paper_have_their_times(tmp_path, monkeypatch):
    monkeypatch.setattr(collection.store, "indexed", lambda out: {"a": out.name, "b": "other"})
    monkeypatch.setattr(collection, "looked_at", lambda path: path.name)
    monkeypatch.setattr(collection, "with_time", lambda record, times: f"{record} with {times}")
    monkeypatch.setattr(collection, "illustration", lambda path: path.name)
    records, illustration = collection.stored_paper(tmp_path / "f")
    assert records == {"a": "f with paper-timings.jsonl", "b": "other with paper-timings.jsonl"}
    assert illustration == "paper-illustration.jsonl"
    with pytest.raises(FileNotFoundError):
        monkeypatch.undo()
        collection.stored_paper(tmp_path)
