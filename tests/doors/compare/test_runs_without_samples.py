"""A run without samples is a result: it has no numbers, and every command reports it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

import crosscheck
from crosscheck.cli import main
from crosscheck.conformance.specimens import specimens
from crosscheck.judge.openings import opening
from crosscheck.processes.pool import end_idle
from mbref.scene import Scene
from mbref.trajectory import Outcome, Trajectory
from tests.helpers.geared_arms import arms

FAILING = "tests.helpers.still_engines:FAILING"


@pytest.fixture(autouse=True)
def _own_children() -> Iterator[None]:
    yield
    end_idle()


@pytest.mark.parametrize("scene", [each.scene for each in specimens()], ids=lambda scene: scene.name)
def test_run_without_samples_has_no_metric(scene: Scene):
    run = Trajectory.failed(
        scene=scene.name, engine="by hand", version="", method="", settings={},
        bodies=tuple(body.name for body in scene.body), outcome=Outcome.TIMED_OUT, message="no result",
    )  # fmt: skip
    assert set(crosscheck.measure(scene, run).values()) == {None}
    assert opening(scene, run) == (math.inf, math.inf)


def test_comparison_has_runs_without_samples_as_results():
    scene = arms(1.0, coupled=True).with_(duration=0.1)
    found = crosscheck.compare(scene, FAILING, samples=3, reference_time=1.0)
    assert [row["outcome"] for row in found.rows] == ["CRASHED"] and found.rows[0]["error"] is None
    assert "still completes no run" in found.verdict.right and "crashed" in str(found)
    assert json.loads(json.dumps(found.document(), allow_nan=False))["records"][0]["times"] == []


@pytest.mark.parametrize(
    "command", [["run"], ["run", "--json"], ["tune"], ["tune", "--json"], ["tune", "--closure", "1mm"]]
)
def test_command_reports_runs_without_samples(command: list[str], tmp_path: Path, capsys):
    arms(1.0, coupled=True).with_(duration=0.1).save(tmp_path / "arms.toml")
    name, *options = command
    asked = {"run": ["arms.toml", "--engine", FAILING], "tune": [FAILING, "arms.toml"]}[name]
    asked = [str(tmp_path / word) if word.endswith(".toml") else word for word in asked]
    assert main([name, *asked, *options, "--reference-time", "0"]) == 1
    said = capsys.readouterr().out
    assert "crashed" in said.lower() or "no run completes" in said or json.loads(said)["records"] == []
