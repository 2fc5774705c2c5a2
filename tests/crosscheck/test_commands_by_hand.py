"""Commands of crosscheck / stand-ins for the work: what each asks for, prints, writes and returns."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.cli import (
    certifying,
    comparing,
    convergence,
    judging,
    listing,
    main,
    moving_picture,
    scene_request,
)
from crosscheck.cli import closed_loops as loops
from crosscheck.cli import modes as modes_of
from crosscheck.cli.request import RequestError
from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.engine import Setting
from crosscheck.judge.reference import certify as certificates
from crosscheck.recorded.judgement import ColumnError, Judgement
from crosscheck.study.grid import Case
from mbref.scene import Body, Scene
from mbref.scenes import SCENES

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", duration=2.0, body=(BLOCK,))


def given(**options: Any) -> argparse.Namespace:
    return argparse.Namespace(**options)


class Calls(dict[str, Any]):
    """The arguments of the last call of each stand-in."""

    def stand_in(self, patch: pytest.MonkeyPatch, place: Any, name: str, value: Any) -> None:
        def called(*asked: Any, **named: Any) -> Any:
            self[name] = (*asked, *named.values())
            return value(*asked) if callable(value) else value

        patch.setattr(place, name, called)


@pytest.fixture
def calls() -> Calls:
    return Calls()


# --- judge and reference ----------------------------------------------------------------------------------
def judged(is_right: bool) -> Judgement:
    column = ColumnError("b.position.x", 1.0 if not is_right else 0.0, 0.1, 0.5, 0.25)
    return Judgement((column,), (), 2.0, "")


@pytest.mark.parametrize(("is_right", "status"), [(True, 0), (False, 1)])
def test_a_table_is_judged(is_right, status, calls, monkeypatch, capsys):
    calls.stand_in(monkeypatch, judging.scene_request, "read_scenes", [SCENE])
    calls.stand_in(monkeypatch, judging, "read", SimpleNamespace(ignored=["id"]))
    calls.stand_in(monkeypatch, judging, "judge_motion", judged(is_right))
    asked = given(
        scene="s.toml",
        table="t.csv",
        column=["b.position.x=3"],
        unit="mm",
        quaternion="xyzw",
        reference_time=7.0,
        tolerance=1e-3,
        json=True,
    )
    assert judging.judge(asked) == status
    assert calls["read_scenes"] == (["s.toml"],)
    assert calls["read"] == (Path("t.csv"), SCENE, {"b.position.x": "3"}, "mm", "xyzw")
    assert calls["judge_motion"][0] == SCENE and calls["judge_motion"][2:] == (7.0, 1e-3)
    document = json.loads(capsys.readouterr().out)
    assert document["right"] is is_right and document["ignored"] == ["id"] and document["until"] == 2.0
    asked.json = False
    assert judging.judge(asked) == status
    out = capsys.readouterr().out
    assert "against the reference" in out and "not read: id" in out


def test_a_table_that_is_not_there(monkeypatch, calls):
    calls.stand_in(monkeypatch, judging.scene_request, "read_scenes", [SCENE])
    asked = given(scene="s", table="/nowhere/t.csv", column=[], unit="", quaternion="", json=False)
    with pytest.raises(RequestError, match=r"^/nowhere/t.csv: No such file or directory$"):
        judging.judge(asked)


def test_a_reference_is_written_as_a_table(monkeypatch, calls, capsys):
    times = np.array([0.0, 0.5, 1.0])
    table = {"time": times, "bound": np.array([0.0, 2e-9, 1e-9])}
    calls.stand_in(monkeypatch, judging.scene_request, "read_scenes", [SCENE])
    calls.stand_in(monkeypatch, judging, "reference_table", lambda *_: table)
    calls.stand_in(monkeypatch, judging, "write", None)
    asked = given(scene="s.toml", times=None, duration=1.0, samples=3, reference_time=5.0, out="o.csv")
    assert judging.write_reference(asked) == 0
    scene, sampled, seconds = calls["reference_table"]
    assert scene.duration == 1.0 and np.array_equal(sampled, times) and seconds == 5.0
    assert calls["write"] == (table, Path("o.csv"))
    assert capsys.readouterr().out == (
        "o.csv: 3 samples to t = 1 s, error at most 2.0e-09 of the mechanism's length or rad\n"
    )
    table = {"time": times[:2], "bound": np.array([0.0, 1e-9])}
    assert judging.write_reference(asked) == 1, "it ends before the end time"
    table = {"time": times[:0], "bound": times[:0]}
    with pytest.raises(RequestError, match=r"^s: no reference was found in 5 CPU seconds$"):
        judging.write_reference(asked)


# --- certify ----------------------------------------------------------------------------------------------
def test_certified_digits_are_printed_or_written(monkeypatch, calls, tmp_path, capsys):
    calls.stand_in(monkeypatch, certifying.scene_request, "find_certifiable", SCENE)
    calls.stand_in(monkeypatch, certificates, "certified", {"über": "1"})
    calls.stand_in(monkeypatch, certifying, "followed", "progress")
    calls.stand_in(monkeypatch, certifying.importlib.util, "find_spec", "found")
    asked = given(scene="random_3", duration=1.0, samples=3, digits=30, out=None)
    assert certifying.certify(asked) == 0 and calls["find_certifiable"] == ("random_3",)
    assert capsys.readouterr().out == '{\n "über": "1"\n}\n' and calls["find_spec"] == ("flint",)
    scene, times, digits, shown = calls["certified"]
    assert scene == SCENE and times.tolist() == [0.0, 0.5, 1.0] and digits == 30
    assert shown("the tree") == "progress" and calls["followed"] == ("the tree", 1.0)
    asked.out = str(tmp_path / "table.json")
    assert certifying.certify(asked) == 0 and capsys.readouterr().out == ""
    assert (tmp_path / "table.json").read_text() == '{\n "über": "1"\n}\n'


def test_what_certify_cannot_do(monkeypatch, calls):
    def differing(*_: Any, **__: Any) -> None:
        raise certificates.NotCertified("they differ in digit 12")

    calls.stand_in(monkeypatch, certifying.scene_request, "find_certifiable", SCENE)
    calls.stand_in(monkeypatch, certifying.importlib.util, "find_spec", "found")
    monkeypatch.setattr(certificates, "certified", differing)
    asked = given(scene="s", duration=None, samples=3, digits=30, out=None)
    with pytest.raises(RequestError, match=r"^they differ in digit 12$"):
        certifying.certify(asked)
    calls.stand_in(monkeypatch, certifying.importlib.util, "find_spec", None)
    with pytest.raises(RequestError, match=r"python-flint is not installed: pip install python-flint$"):
        certifying.certify(asked)


def test_random_mechanisms_are_named_by_their_seed(monkeypatch, calls):
    from crosscheck.conformance import random_mechanisms

    calls.stand_in(monkeypatch, random_mechanisms, "random_mechanism", lambda seed: f"seed {seed}")
    calls.stand_in(monkeypatch, scene_request, "find_scenes", lambda names: [f"named {names}"])
    assert scene_request.find_certifiable("random_12") == "seed 12"
    assert scene_request.find_certifiable("12") == "named ['12']"
    assert scene_request.find_certifiable("random_x") == "named ['random_x']"


# --- stored tables ----------------------------------------------------------------------------------------
def pose(**changes: Any) -> dict[str, Any]:
    made = {"scene": "arm", "rate": 0.0, "stability": "stable", "eigenvalues": [(-1.0, 2.0), (0.5, 0.0)]}
    made |= {
        "mbref_distance": 1e-13,
        "error": 1e-12,
        "uncertainty": 1e-15,
        "mbref_error": 2e-11,
        "results": [],
    }
    return made | changes


def test_poses_and_their_eigenvalues(monkeypatch, capsys):
    monkeypatch.setattr(
        modes_of.records, "read", lambda: [pose(), pose(scene="top", rate=3.0, mbref_distance=None)]
    )
    assert main(["modes"]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert lines[:2] == ["arm: Equilibrium, stable", "s = -1 + 2 i, 0.5 1/s"]
    assert lines[2] == "mbref equilibrium finds this pose, 1e-13 lengths or rad from the judge's."
    assert lines[3].split("  ")[0] == "method" and "error of the eigenvalues" in lines[3]
    assert [line.split() for line in lines[5:7]] == [["judge", "1e-12"], ["mbref", "modes", "2e-11"]]
    assert lines[7] == "top: Steady motion at 3 rad/s, stable"
    assert lines[9] == "The search of mbref equilibrium does not find this pose."


def test_engines_of_modes_by_name(monkeypatch, calls):
    calls.stand_in(monkeypatch, modes_of.request, "find_engines", ["dart"])
    assert modes_of._engines(["dart"]) == ["dart"]
    assert calls["find_engines"] == (["dart"], modes_of.notice)
    monkeypatch.setattr(modes_of, "all_engines", lambda: ["mbref", "simbody", "mujoco"])
    assert modes_of._engines(None) == ["mujoco", "simbody"]


def loop_run(engine: str, family: str, error: float | None) -> dict[str, Any]:
    outcome = "COMPLETED" if error is not None else "STEP_FAILED"
    return {
        **{"key": f"{engine}{family}", "scene": DIFFICULTIES[0].scene, "engine": engine, "version": "1"},
        **{"family": family, "asked": {"options": {"step": 1e-3}}, "outcome": outcome, "message": ""},
        **{"t_end": 1.0, "metrics": {} if error is None else {"error": error}, "cost": {"seconds": 0.5}},
    }


def test_tables_of_closed_loops(tmp_path, capsys):
    """An engine without a run of its defaults is in the table of best settings alone."""
    path = tmp_path / "records.jsonl"
    made = [
        loop_run("mujoco", "tuned", 1e-9),
        loop_run("mujoco", "defaults", 0.5),
        loop_run("dart", "balls", 1e-4),
    ]
    path.write_text("".join(json.dumps(record) + "\n" for record in made))
    assert main(["closed-loops", "--records", str(path)]) == 0
    best, defaults = capsys.readouterr().out.split("by the library's defaults")
    assert "at its best settings" in best
    assert any(line.split()[:3] == ["mujoco", "✓", "1e-09"] for line in best.splitlines())
    assert any(line.split()[:3] == ["dart", "≈", "1e-04"] for line in best.splitlines())
    assert any(line.split()[:3] == ["mujoco", "✗", "0.5"] for line in defaults.splitlines())
    assert not any(line.split()[:1] == ["dart"] for line in defaults.splitlines())
    table = loops._table(loops.matrix(made), True)
    assert [column.header for column in table.columns] == ["engine", *(d.heading for d in DIFFICULTIES)]


def test_table_of_convergence(tmp_path, capsys):
    first = convergence.ladders.MECHANISMS[0]
    errors = {0.1: 1e-2, 0.05: 1e-2 / 16, 0.025: 1e-2 / 256}
    records = [
        {
            **loop_run("mujoco", "stock", e),
            "scene": first.scene,
            "asked": {"options": {"step": h}},
            "key": str(h),
        }
        for h, e in errors.items()
    ]
    records = [{**r, "cost": {"seconds": 0.1, "steps": k}} for k, r in enumerate(records, 1)]
    path = tmp_path / "records.jsonl"
    path.write_text("".join(json.dumps(record) + "\n" for record in records))
    assert main(["convergence", "--records", str(path)]) == 0
    out = capsys.readouterr().out
    assert "4e-05" in out and "(4.0)" in out and "mujoco," in out and "drake" not in out


# --- lists and the picture --------------------------------------------------------------------------------
def test_versions_of_installed_engines_and_missing_packages(monkeypatch, capsys):
    monkeypatch.setattr(listing, "engine_names", lambda: ["one", "two"])
    monkeypatch.setattr(listing, "missing_package", lambda name: "" if name == "one" else f"{name}: not here")
    monkeypatch.setattr(listing, "engine", lambda name: SimpleNamespace(version=lambda: f"{name} 1.5"))
    assert main(["--version"]) == 0
    import mbref

    assert capsys.readouterr().out == f"crosscheck {mbref.__version__}\none one 1.5\ntwo two: not here\n"


def test_table_of_support(monkeypatch):
    monkeypatch.setattr(listing, "default_engines", lambda: ["a", "b"])
    features = listing.support.Support(("a", "b"), {"hinge": {"a": None, "b": "no hinge"}})
    scenes = listing.support.Support(("a", "b"), {"four_bar": {"a": "no loop", "b": None}})
    asked: list[Any] = []
    monkeypatch.setattr(listing.support, "of_features", lambda engines: asked.append(engines) or features)
    monkeypatch.setattr(listing.support, "of_scenes", lambda engines: asked.append(engines) or scenes)
    table = listing._support()
    assert asked == [["a", "b"]] * 2
    assert [column.header for column in table.columns] == ["feature or scene", "a", "b"]
    assert [list(column.cells) for column in table.columns] == [
        ["hinge", "four_bar"],
        ["✓", "– 2"],
        ["– 1", "✓"],
    ]
    assert table.caption == "1. b: no hinge\n2. a: no loop"


def test_runs_of_the_picture(monkeypatch, calls):
    """The finest step of MuJoCo's defaults beside mbref, at 161 times of the exact motion."""
    offered = [Setting("defaults", {"step": s}) for s in (0.1, 0.01)] + [Setting("stock", {"step": 0.001})]
    calls.stand_in(monkeypatch, moving_picture, "settings", offered)
    calls.stand_in(monkeypatch, moving_picture, "study", ["records"])
    calls.stand_in(monkeypatch, moving_picture, "singular_instants", [0.5])
    poses = SimpleNamespace(poses=lambda times: ("exact", times))
    calls.stand_in(monkeypatch, moving_picture, "truth_for", poses)
    found = moving_picture.moving_picture()
    scene = SCENES["planar_slider_crank_equal"]()
    assert found.scene == scene and found.records == ["records"] and found.singular == [0.5]
    times = np.linspace(0.0, scene.duration, 161)
    assert found.exact[0] == "exact" and np.array_equal(found.exact[1], times)
    cases: list[Case] = calls["study"][0]
    assert [(case.engine, case.setting) for case in cases] == [
        ("mbref", Setting("taylor", {"rtol": 1e-9})),
        ("mujoco", offered[1]),
    ]
    assert all(case.scene == scene and np.array_equal(case.times, times) for case in cases)
    assert calls["settings"] == ("mujoco", scene)


def test_singular_instants_are_small_minima_of_the_least_singular_value_of_rank(monkeypatch):
    """Values of 1001 times: 0.01 at t = 0.3 and 0.04 at 0.6 are minima; 0.06 at 0.9 is not small."""
    scene = SCENE.with_(duration=1.0)
    times = np.linspace(0.0, 1.0, 1001)
    value = np.minimum.reduce([0.01 + abs(times - 0.3), 0.04 + abs(times - 0.6), 0.06 + abs(times - 0.9)])
    values = np.stack([np.ones(1001), value, np.zeros(1001)], axis=1)
    monkeypatch.setattr(moving_picture, "scaled_singular_values", lambda *_: values)
    monkeypatch.setattr(moving_picture, "rank", lambda of: 2)
    assert moving_picture.singular_instants(scene) == pytest.approx([0.3, 0.6])
    values[299:302, 1] = 0.01
    assert moving_picture.singular_instants(scene) == pytest.approx([0.301, 0.6]), "the last of equal values"


# --- scenes of a command ----------------------------------------------------------------------------------
def test_faults_name_their_scene_where_there_are_several(tmp_path):
    (tmp_path / "bad.toml").write_text("gravity = 3\n")
    bad = str(tmp_path / "bad.toml")
    with pytest.raises(RequestError) as alone:
        scene_request.read_scenes([bad])
    with pytest.raises(RequestError) as beside:
        scene_request.read_scenes(["heavy_top", bad, "nothing"])
    faults = alone.value.faults
    assert not faults[0].startswith(f"{bad}: {bad}") and len(beside.value.faults) == len(faults) + 1
    assert beside.value.faults[: len(faults)] == tuple(f"{bad}: {fault}" for fault in faults)
    assert beside.value.faults[-1].startswith("nothing: ")


def test_scenes_are_asked_for_once(tmp_path):
    found = scene_request.read_scenes(["heavy_top", "four_bar"])
    assert [scene.name for scene in found] == ["heavy_top", "four_bar"]
    with pytest.raises(RequestError) as refused:
        scene_request.read_scenes(["four_bar", "heavy_top", "four_bar", "heavy_top", "five_bar"])
    assert refused.value.faults == (
        "scene 'four_bar' is asked for twice",
        "scene 'heavy_top' is asked for twice",
    )


def test_velocities_that_contradict_the_joints_are_refused_with_their_line(tmp_path):
    text = (
        'name = "rod"\nduration = 1.0\n\n[[body]]\nname = "a"\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n'
        "position = [1.0, 0.0, 0.0]\nvelocity = [1.0, 0.0, 0.0]\nangular_velocity = [0.0, 0.0, 0.0]\n\n"
        '[[joint]]\nname = "A"\ntype = "revolute"\nbodies = ["ground", "a"]\nanchor = [0.0, 0.0, 0.0]\n'
        "axis = [0.0, 0.0, 1.0]\n"
    )
    (tmp_path / "rod.toml").write_text(text)
    with pytest.raises(RequestError) as refused:
        scene_request.find_scenes([str(tmp_path / "rod.toml")])
    assert "line" in refused.value.faults[0] and "A" in refused.value.faults[0]
    (tmp_path / "rod.toml").write_text(text.replace("velocity = [1.0", "velocity = [0.0"))
    [scene] = scene_request.find_scenes([str(tmp_path / "rod.toml")])
    assert scene.name == "rod"


def test_files_of_other_programs_are_known_by_their_first_character(tmp_path, monkeypatch):
    (tmp_path / "a.scene").write_text("\n  <mujoco/>")
    (tmp_path / "b.scene").write_text("name = '<'")
    assert scene_request._is_xml(str(tmp_path / "a.scene")) and not scene_request._is_xml(
        str(tmp_path / "b.scene")
    )
    assert not scene_request._is_xml(str(tmp_path)) and not scene_request._is_xml(str(tmp_path / "none"))
    asked: list[Any] = []
    found = SimpleNamespace(left_out=["a sensor"], notes=["a note"], scene=SCENE, originals=("run",))
    monkeypatch.setattr(
        scene_request.formats, "read", lambda name, reading: asked.append((name, reading)) or found
    )
    monkeypatch.setattr(scene_request, "remember", lambda *given: asked.append(given))
    name = str(tmp_path / "a.scene")
    assert scene_request.read_scenes([name], notice=asked.append) == [SCENE]
    options, *lines, remembered = asked
    assert options[0] == name and lines == [f"{name}: left out: a sensor", f"{name}: a note"]
    assert remembered == (SCENE, ("run",))


# --- tune -------------------------------------------------------------------------------------------------
def test_tune_asks_for_the_cheapest_settings_of_one_engine(monkeypatch, calls, capsys):
    """The cheapest of the engine's own settings comes first, whatever crosscheck's integrators take."""
    made = [
        {"family": family, "cost": {"seconds": seconds}, "key": family}
        for family, seconds in (("ours", 0.1), ("slow", 3.0), ("fast", 2.0))
    ]
    case = Case(SCENE, np.linspace(0.0, 2.0, 31), "e", Setting("slow", {"step": 0.1}))
    found = SimpleNamespace(cases=["c"], reached=made, records=["all"])
    calls.stand_in(monkeypatch, comparing.scene_request, "find_scenes", [SCENE])
    calls.stand_in(monkeypatch, comparing.request, "find_engines", ["e"])
    calls.stand_in(monkeypatch, comparing, "scouted", None)
    calls.stand_in(monkeypatch, comparing, "engine", SimpleNamespace(integrated_here=("ours",)))
    calls.stand_in(monkeypatch, comparing.request, "plan", [case])
    calls.stand_in(monkeypatch, comparing, "study", lambda some, threads: ("records of", some))
    calls.stand_in(monkeypatch, comparing, "tuned", found)
    calls.stand_in(monkeypatch, comparing, "with_timings", list(made))
    calls.stand_in(monkeypatch, comparing.tables, "print_tuning", None)
    calls.stand_in(monkeypatch, comparing, "missing_truths", ["A sentence."])
    asked = ["tune", "e", "s.toml", "--error", "1e-5", "--time-limit", "7", "--reference-time", "3"]
    assert main(asked) == 0
    cases, level, run, ours, advance, measure = calls["tuned"]
    assert cases == [case._replace(reference_time=3.0)] and level == 1e-5 and ours == ("ours",)
    assert callable(advance) and measure({"metrics": {"error": 0.25}}) == 0.25
    assert run(["some"]) == ("records of", ["some"])
    scenes, engines, choice, [times], limit, _ = calls["plan"]
    assert (scenes, engines, limit, choice.is_quick, len(times)) == ([SCENE], ["e"], 7.0, False, 31)
    assert calls["with_timings"][:3] == (["c"], made, None) and calls["scouted"] == ([SCENE], ["e"])
    _, wanted, best, records, scene, path = calls["print_tuning"]
    assert [r["family"] for r in best] == ["fast", "slow", "ours"] and records == ["all"]
    assert (scene, path, wanted.level) == (SCENE, "s.toml", 1e-5)
    assert capsys.readouterr().out == "A sentence.\n"
    monkeypatch.setattr(comparing, "with_timings", lambda *_: [])
    assert main(asked) == 1
