"""Sentences on a file at its own settings / lengths, gaps and grades on 4 m, worked out by hand."""

from __future__ import annotations

from typing import Any

from crosscheck.setting import AS_IN_FILE
from crosscheck.study.file_sentences import OFF, as_in_file
from crosscheck.study.verdict import Judged
from mbref.scene import Body, Revolute, Scene

SCENE = Scene(
    name="leg",
    body=(Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0)),),
    joint=(Revolute(name="A", bodies=("ground", "b"), anchor=(4.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),),
    duration=1.0,
)


def said(error: float | None, gap: float, turned: float = 0.0, **changes: Any) -> str:
    """The sentence on a run whose bodies are off by ``error`` and whose joints open by ``gap`` lengths."""
    metrics = {"error": error, "position_error": error, "rotation_error": turned, "violation_position": gap}
    record = {
        "engine": "mujoco",
        "family": AS_IN_FILE,
        "outcome": "COMPLETED",
        "t_end": 1.0,
        "message": "",
        "settings": {"step": 0.002, "integrator": "Euler", "file": FILE, "import": "--hold 'left hip'"},
        "metrics": metrics,
        **changes,
    }
    found = as_in_file([Judged(SCENE, {}, [record, {**record, "family": "stock"}])])
    assert found.endswith(f" {OFF}")
    return found.removesuffix(f" {OFF}")


START = "leg at its own settings (time step 0.002 s, Euler)"
FILE = "/robots/leg.xml"
TUNE = f" `crosscheck tune mujoco {FILE} --hold 'left hip'"
BETTER = "finds a solref and a time step that are ten times better."
SETTINGS = "finds settings that are ten times better."  # without open closures


def test_lengths_are_of_the_scene_and_in_millimetres():
    off = "bodies are off by up to 80 mm and 0.05 rad, and its closures open by up to 4 mm."
    assert said(2e-2, 1e-3, 0.05) == f"{START} is wrong: {off}{TUNE} --closure 0.4mm` {BETTER}"
    off = "bodies are off by up to 8 mm and 0.0012 rad, and its closures open by up to 0.4 mm."
    assert said(2e-3, 1e-4, 0.0012) == f"{START} is inaccurate: {off}{TUNE} --closure 0.04mm` {BETTER}"


def test_a_file_without_closures_is_tuned_for_an_error():
    assert f"{TUNE} --error 2e-04` {SETTINGS}" in said(2e-3, 1e-14)


def test_a_gap_far_below_the_error_is_not_tuned():
    assert f"{TUNE} --error 2e-03` {SETTINGS}" in said(2e-2, 1.9e-5)
    assert f"{TUNE} --closure 0.008mm` {BETTER}" in said(2e-2, 2.1e-5)


def test_gaps_of_rounding_and_accurate_files_need_no_advice():
    assert said(1e-9, 1e-13) == f"{START} is right: bodies are off by up to 4e-06 mm and 0 rad."
    assert "open by up to 8e-09 mm" in said(1e-9, 2e-12)


def test_without_a_truth_the_gap_alone():
    assert said(None, 1e-3) == f"{START} has no known error: its closures open by up to 4 mm."
    assert said(None, 1e-14) == f"{START} has no known error."


def test_a_run_that_failed_and_no_run_of_a_file():
    lost = said(None, 1.0, outcome="NOT_FINITE", t_end=0.25, message="a velocity is not finite")
    assert lost == f"{START} is not finite at 0.25 s: a velocity is not finite."
    assert as_in_file([Judged(SCENE, {}, [])]) == ""
