"""Runs of the paper / stand-ins: what is stored, its labels, and the explanation of Table I."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.paper import cells, illustration, singular, store
from crosscheck.paper import runs as paper_runs
from crosscheck.paper.runs import GROWTH, PEAKS, SPATIAL_DYNAMIC, Label
from crosscheck.paper.settings import LINKAGES
from crosscheck.study.grid import Case, key
from mbref.scene import Body, Scene
from mbref.scenes.four_bar import four_bar

BLOCK = Body(name="a", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", duration=1.0, body=(BLOCK, BLOCK.model_copy(update={"name": "b"})))


def case(step: float) -> Case:
    return Case(SCENE, np.array([0.0, 1.0]), "mbref", Setting("lm1", {"step": step}))


def test_runs_are_made_once_by_their_labels(monkeypatch, tmp_path):
    chosen = {Label("II", "LM2", "four-bar"): case(0.1), Label("figures", "ALF", "x"): case(0.2)}
    named: list[str] = []

    def study(cases, executor, path, progress, run):
        assert executor is None and path == tmp_path / "paper.jsonl" and progress.name == "progress"
        return [run(case) for case in cases]

    class UnderWay:
        def named(self, made, name):
            def run(case):
                named.append(name(case))
                return made(case)

            return run

    monkeypatch.setattr(store, "study", study)
    monkeypatch.setattr(store, "run_in_turn", lambda case: case.setting.options["step"])
    monkeypatch.setattr(store, "drawable", lambda *given: given)
    progress = SimpleNamespace(under_way=UnderWay(), name="progress")
    found = store.run(tmp_path / "paper.jsonl", chosen, progress)
    assert named == ["Table II, LM2, four-bar", "figures, ALF, x"]
    first, second = chosen
    assert found == {first: (first, SCENE, 0.1), second: (second, SCENE, 0.2)}
    store.index(tmp_path / "paper.jsonl", chosen)
    text = (tmp_path / "paper-runs.json").read_text()
    assert text.count("\n") == 4 and text.endswith("}\n")
    assert json.loads(text) == {json.dumps([*label]): key(case) for label, case in chosen.items()}


def record() -> dict[str, Any]:
    numbers = [[1.23456789, 0.0, 0.0]] * 2
    motion = {"position": numbers, "orientation": [[1.0, 0.0, 0.0, 0.0]] * 2, "velocity": numbers}
    return {
        "engine": "mbref",
        "version": "1",
        "method": "m",
        "settings": {},
        "times": [0.0, 1.0],
        "bodies": {name: dict(motion) for name in ("a", "b")},
        "reactions": {"A": 1},
        "open_reactions": 2,
        "crossings": 3,
        "outcome": "COMPLETED",
    }


def test_motions_are_kept_for_figures_alone(monkeypatch):
    monkeypatch.setattr(store, "_violation", lambda scene, record: [scene.name])
    made = record()
    assert store.drawable(Label("digits", "ALF", "1e4"), SCENE, made) is made, "all digits"
    for part in ("figures", "dynamic", "peaks"):
        drawn = store.drawable(Label(part, "ALF", "x"), SCENE, made)
        assert drawn["bodies"]["b"]["position"] == [[1.23457, 0.0, 0.0]] * 2, "six digits"
        assert drawn["times"] == [0.0, 1.0] and drawn["violation"] == ["s"]
        assert (drawn["reactions"], drawn["open_reactions"], drawn["crossings"]) == ({}, None, None)
    assert list(store.drawable(PEAKS, SCENE, made)["bodies"]) == ["a"], "the crank alone"
    grown = store.drawable(Label(GROWTH, "LM2", "x"), SCENE, made)
    assert grown["times"] == [0.0, 1.0] and grown["violation"] == ["s"]
    assert grown["bodies"] == {
        name: {field: [] for field in ("position", "orientation", "velocity")} for name in "ab"
    }
    plain = store.drawable(Label("II", "LM2", "x"), SCENE, made)
    assert plain["times"] == plain["violation"] == [] and plain["bodies"] == grown["bodies"]
    assert made["times"] == [0.0, 1.0] and made["crossings"] == 3, "the record stays as it is"


def test_violations_are_of_positions(monkeypatch):
    asked = []

    def series(scene, motion, level):
        asked.append((scene.name, motion.times.tolist(), level))
        return np.array([0.0, 1.23456789])

    monkeypatch.setattr(store, "violation_series", series)
    monkeypatch.setattr(
        store.Trajectory, "from_record", lambda name, r: SimpleNamespace(times=np.array(r["times"]))
    )
    assert store._violation(SCENE, record()) == [0.0, 1.23457] and asked == [("s", [0.0, 1.0], 0)]
    monkeypatch.setattr(store, "violation_series", lambda *_: None)
    assert store._violation(SCENE, record()) == []


def test_records_of_a_folder_by_label(tmp_path):
    labels = [Label("II", "LM2", "four-bar"), Label("III", "ALF", "x")]
    (tmp_path / "paper.jsonl").write_text('{"key": "k1", "x": 1}\n')
    known = {json.dumps([*label]): f"k{n}" for n, label in enumerate(labels, 1)}
    (tmp_path / "paper-runs.json").write_text(json.dumps(known))
    assert store.indexed(tmp_path) == {labels[0]: {"key": "k1", "x": 1}}, "the second has no record yet"


# --- the explanation of Table I ---------------------------------------------------------------------------
@pytest.fixture
def counted(monkeypatch) -> list[Any]:
    """Stand-ins for what takes seconds: singular values, crossings and iterations."""
    asked: list[Any] = []

    def values(scene, times):
        asked.append((scene, np.array(times)))
        return np.tile([3.0, 0.5, 0.25], (len(times), 1)) * (1 + np.array(times))[:, None]

    monkeypatch.setattr(singular, "scaled_singular_values", values)
    monkeypatch.setattr(singular, "crossings", lambda theta, last: [(0.0, 0), (0.02, 1), (last, 2)])
    monkeypatch.setattr(singular, "rank", lambda values: int(values[0] * 10))
    monkeypatch.setattr(singular, "alf_iterations", lambda distance, error: (distance, error))
    monkeypatch.setattr(singular, "fold_residual", lambda theta, turned: (theta, turned))
    return asked


def test_parts_of_the_explanation(counted):
    """One revolution from π/2; the two smallest values, the smallest first; both ends of the fold."""
    found = illustration._computed()
    assert found["fold"] == [(0.0, -0.1), (math.pi, -0.1)]
    scene, times = counted[0]
    assert scene == four_bar(math.pi / 2) and len(times) == 401
    assert times[-1] == pytest.approx(2 * math.pi / singular.CRANK_RATE) and times[0] == 0.0
    theta = np.array(found["theta"])
    assert theta[0] == math.pi / 2 and theta[-1] == pytest.approx(-3 * math.pi / 2)
    assert found["smallest"][0] == [0.25, 0.5] and len(found["smallest"]) == 401
    assert found["alf_iterations"][0] == [(1.0, e) for e in (0.0, 1e-10, 1e-8, 1e-6)]
    assert [row[0][0] for row in found["alf_iterations"]] == [1.0, 0.3, 0.1, 0.03, 0.01, 0.001]


def test_crossings_after_the_start_of_each_linkage(counted):
    rows = illustration._computed()["crossings"]
    assert [row[0] for row in rows] == [s for s in illustration.STARTS for _ in range(2)], "not at t = 0"
    for start, t, k, rank, least in rows:
        assert (t, k) in ((0.02, 1), (0.06, 2)) and rank == int(30 * (1 + t)) and least == 0.25 * (1 + t)
        assert any(
            scene == four_bar(LINKAGES[start][1]) and times.tolist() == [t] for scene, times in counted[1:]
        )


def test_an_explanation_is_computed_once(monkeypatch, tmp_path):
    made = []
    monkeypatch.setattr(illustration, "_computed", lambda: made.append(1) or {"fold": [len(made)]})
    path = tmp_path / "illustration.jsonl"
    first = illustration.illustration(path)
    assert first["fold"] == [1] and illustration.illustration(path) == first and len(made) == 1
    monkeypatch.setattr(illustration, "TURNED", 0.2)
    assert illustration.illustration(path)["fold"] == [2], "of another question"
    assert len(path.read_text().splitlines()) == 2


# --- printed numbers and planned runs ---------------------------------------------------------------------
def test_sums_of_the_printed_numbers():
    """Sums of the columns of Tables III and IV, and of all end times that the paper prints."""
    assert sum(steps for steps, _ in cells.COUNTS_III.values()) == 3 * 3303 + 3 * 3292 + 3286 + 4 * 103
    assert sum(seconds for _, seconds in cells.COUNTS_III.values()) == pytest.approx(659.03, abs=1e-9)
    assert sum(steps for steps, _ in cells.COUNTS_IV.values()) == 4 * 2428 + 1627 + 1768 + 1774 + 1368
    assert sum(seconds for _, seconds in cells.COUNTS_IV.values()) == pytest.approx(348.3, abs=1e-9)
    assert {row for row, (steps, _) in cells.COUNTS_III.items() if steps == 103} == {
        f"{row} + CP" for row in ("LM2", "ALF", "MPI (SVD)", "MPI (GS)")
    }
    assert sum(cell.end or 0.0 for cell in cells.CELLS) == pytest.approx(47.136, abs=1e-9)


def test_sample_times_of_the_paper_s_runs():
    steps = {"SAMPLES": 0.2, "TURNS": 0.1, "FINE": 0.01, "SHORT": 0.002, "SECOND": 0.2, "TEACHING": 0.02}
    ends = {"SHORT": 0.12, "SECOND": 1.0, "TEACHING": 2.0}
    for name, step in steps.items():
        times = getattr(paper_runs, name)
        assert times[0] == 0.0 and times[-1] == ends.get(name, 20.0), name
        assert np.diff(times) == pytest.approx(np.full(len(times) - 1, step)), name


def test_runs_for_lectures_vary_one_number():
    scene = SPATIAL_DYNAMIC
    gains = paper_runs.gains()
    assert list(gains) == [Label("gain", "LM2 + B", scene, f"{gain:g}") for gain in paper_runs.GAINS]
    growing = paper_runs.growth()
    assert list(growing) == [Label("growth", "LM2", scene, f"{rtol:g}") for rtol in paper_runs.ERRORS]
    assert [case.setting.options["rtol"] for case in growing.values()] == list(paper_runs.ERRORS)
    assert {case.setting.options["violation"] for case in growing.values()} == {1e9}
    assert all(np.array_equal(c.times, paper_runs.TEACHING) for c in (*gains.values(), *growing.values()))
    tight = paper_runs.tight()
    assert [label.row for label in tight] == list(cells.COUNTS_IV) and {label.column for label in tight} == {
        scene
    }
