"""Findings, missing meshes and calls in children / answers, notes and refusals worked out by hand."""

from __future__ import annotations

import dataclasses
import math
import os
import pickle
import signal
import subprocess
from importlib import metadata
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.mujoco.importing import meshes
from crosscheck.findings import finding
from crosscheck.findings.finding import Finding, Status
from crosscheck.processes import serve
from mbref.scene import Body, Scene, SceneError
from mbref.trajectory import Outcome

# --- findings ---------------------------------------------------------------------------------------------
FOUND = Finding("drift", "mujoco", "a-package", "1.0", "does", "right", "cause", unit="m", wrong_above=0.5)


@pytest.fixture
def installed(monkeypatch) -> None:
    monkeypatch.setattr(metadata, "version", lambda package: f"2 of {package}")


def script(monkeypatch, text: str = "", status: int = 0, error: str = "", **parts: Any) -> Any:
    """The answer of a finding whose script prints a text."""
    asked = []

    def run(command: list[str], **options: Any) -> Any:
        asked.append((command[1:], options["timeout"]))
        return SimpleNamespace(stdout=text, stderr=error, returncode=status)

    monkeypatch.setattr(subprocess, "run", run)
    answer = dataclasses.replace(FOUND, script="a script", **parts).recheck()
    assert asked == [(["-c", "a script"], 900.0)]
    return answer


def test_a_package_that_is_not_installed(monkeypatch):
    def absent(package: str) -> str:
        raise metadata.PackageNotFoundError(package)

    monkeypatch.setattr(metadata, "version", absent)
    assert FOUND.recheck() == (Status.ABSENT, "", None, "pip install a-package")


def test_the_number_that_a_script_prints(monkeypatch, installed):
    """The last word counts; the limit itself is right, and no number is wrong."""
    version = "2 of a-package"
    assert script(monkeypatch, "so\nmuch 0.75") == (Status.PRESENT, version, 0.75, "0.75 m")
    assert script(monkeypatch, "0.5") == (Status.GONE, version, 0.5, "0.5 m")
    assert script(monkeypatch, "0.5001").status is Status.PRESENT
    found = script(monkeypatch, "nan")
    assert found.status is Status.PRESENT and math.isnan(found.measured)
    bare = script(monkeypatch, "0.123456", unit="")
    assert bare.words == "0.123"


def test_a_script_without_a_number(monkeypatch, installed):
    said = "the script gave no number: {}"
    answer = script(monkeypatch, "", error="first\nlast line\n")
    assert (answer.status, answer.measured, answer.words) == (Status.UNCLEAR, None, said.format("last line"))
    assert script(monkeypatch, "no number").words == said.format("nothing")


def test_a_script_that_crashes(monkeypatch, installed):
    for status, found in ((-11, Status.PRESENT), (0, Status.GONE), (1, Status.GONE)):
        answer = script(monkeypatch, "0.9", status, crashes=True)
        assert (answer.status, answer.measured) == (found, None)
        assert answer.words == f"the process ended with status {status}"


def test_a_script_that_takes_too_long(monkeypatch, installed):
    def late(*_: Any, **__: Any) -> None:
        raise subprocess.TimeoutExpired("x", 1.0)

    monkeypatch.setattr(subprocess, "run", late)
    answer = dataclasses.replace(FOUND, script="s").recheck()
    assert (answer.status, answer.words) == (Status.UNCLEAR, "no answer within 900 s")


def test_a_scene_that_proves_a_finding(monkeypatch, installed, tmp_path):
    """Eleven samples over the duration; the largest error counts. A run that fails proves nothing."""
    block = Body(name="b", mass=2.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
    Scene(name="s", body=(block,), duration=2.5).save(tmp_path / "s.toml")
    monkeypatch.setattr(finding, "FOLDER", tmp_path)
    asked, run = [], SimpleNamespace(outcome=Outcome.COMPLETED, message="")
    monkeypatch.setattr(finding, "run_isolated", lambda *given: asked.append(given) or run)
    truth = SimpleNamespace(poses=lambda times: ("exact", len(times), times[-1]))
    monkeypatch.setattr(finding, "truth_for", lambda scene: truth)
    errors = lambda scene, motion, exact: np.array([0.25, 0.75, 0.5]) if exact == ("exact", 11, 2.5) else None  # noqa: E731
    monkeypatch.setattr(finding, "error_series", errors)
    proof = dataclasses.replace(FOUND, scene="s.toml", family="f", options={"step": 0.1})
    assert proof.recheck() == (Status.PRESENT, "2 of a-package", 0.75, "0.75 m")
    [(name, scene, times, setting, limit)] = asked
    assert (name, scene.name, len(times), times[0], times[-1]) == ("mujoco", "s", 11, 0.0, 2.5)
    assert setting == Setting("f", {"step": 0.1}) and limit == 900.0
    run.outcome, run.message = Outcome.STEP_FAILED, "too short"
    assert proof.recheck() == (Status.UNCLEAR, "2 of a-package", None, "STEP_FAILED too short")
    assert proof.command() == "crosscheck findings --recheck drift"


# --- meshes -----------------------------------------------------------------------------------------------
RULE = SimpleNamespace(mjINERTIAFROMGEOM_FALSE=0, mjINERTIAFROMGEOM_TRUE=1, mjINERTIAFROMGEOM_AUTO=2)
MUJOCO = SimpleNamespace(mjtInertiaFromGeom=RULE)


@pytest.mark.parametrize(
    ("changes", "has_inertia"),
    [
        ({}, True),
        ({"rule": 0}, False),
        ({"rule": 2}, True),
        ({"rule": 2, "explicit": True}, False),
        ({"rule": 1, "explicit": True}, True),
        ({"mass": 0.0}, False),
        ({"mass": math.nan, "density": 0.0}, False),
        ({"mass": math.nan, "density": 1000.0}, True),
        ({"mass": 2.0, "density": 0.0}, True),
        ({"group": 1}, False),
        ({"group": 2}, True),
        ({"group": 4}, True),
        ({"group": 5}, False),
        ({"body": "world"}, False),
    ],
)
def test_shapes_that_give_a_body_its_inertia(changes, has_inertia):
    """Groups 2 to 4 count; a mass of zero, or no mass and a density of zero, are no inertia."""
    given = {"rule": 1, "explicit": False, "mass": 3.0, "density": 7.0, "group": 3, "body": "b"} | changes
    spec = SimpleNamespace(compiler=SimpleNamespace(inertiafromgeom=given["rule"], inertiagrouprange=(2, 4)))
    body = SimpleNamespace(name=given["body"], explicitinertial=given["explicit"])
    geom = SimpleNamespace(mass=given["mass"], density=given["density"], group=given["group"])
    assert bool(meshes._has_inertia(MUJOCO, spec, body, geom)) is has_inertia


def test_notes_on_missing_files():
    notes = [list(meshes._notes([f"{k}.stl" for k in range(n)])) for n in (0, 1, 3, 4, 6)]
    said = "files that are missing: {}; these shapes have no effect"
    assert notes == [
        [],
        [said.format("0.stl")],
        [said.format("0.stl, 1.stl, 2.stl")],
        [said.format("0.stl, 1.stl, 2.stl and 1 more")],
        [said.format("0.stl, 1.stl, 2.stl and 3 more")],
    ]


def asset(name: str, file: str) -> Any:
    return SimpleNamespace(name=name, file=file)


def model(tmp_path, mass: float = 0.0) -> Any:
    """A body with a mesh that is there, one and a height field that are missing, and a missing picture."""
    (tmp_path / "shapes").mkdir()
    (tmp_path / "pictures").mkdir()
    (tmp_path / "shapes" / "there.stl").write_text("")
    geoms = [
        SimpleNamespace(meshname=mesh, hfieldname=field, mass=mass, density=1.0, group=0, material=material)
        for mesh, field, material in (
            ("there", "", "wood"),
            ("gone", "", ""),
            ("", "hills", "stone"),
            ("", "", ""),
        )
    ]
    body = SimpleNamespace(name="b", geoms=geoms, explicitinertial=False)
    spec = SimpleNamespace(
        modelfiledir=str(tmp_path),
        meshdir="shapes",
        texturedir="pictures",
        bodies=[body],
        geoms=geoms,
        meshes=[asset("there", "there.stl"), asset("", "gone.stl"), asset("built in", "")],
        hfields=[asset("hills", "hills.png")],
        skins=[asset("skin", "skin.skn")],
        textures=[asset("grain", "grain.png"), asset("flat", "")],
        materials=[
            SimpleNamespace(name="wood", textures=["", "grain"]),
            SimpleNamespace(name="stone", textures=["flat"]),
        ],
        compiler=SimpleNamespace(inertiafromgeom=1, inertiagrouprange=(0, 5)),
        deleted=[],
    )
    spec.delete = spec.deleted.append
    return spec


def test_missing_shapes_and_pictures_are_deleted(tmp_path):
    spec = model(tmp_path)
    geoms = spec.geoms
    [note] = meshes.without_missing(MUJOCO, spec)
    assert note.startswith("files that are missing: gone.stl, hills.png, skin.skn and 1 more;")
    assert spec.deleted == [
        geoms[1],
        geoms[2],
        spec.materials[0],
        spec.meshes[1],
        spec.hfields[0],
        spec.skins[0],
        spec.textures[0],
    ]
    assert [geom.material for geom in geoms] == ["", "", "stone", ""]


def test_a_missing_shape_that_gives_inertia_is_refused(tmp_path):
    spec = model(tmp_path, mass=1.0)
    with pytest.raises(SceneError) as refused:
        meshes.without_missing(MUJOCO, spec)
    assert list(refused.value.faults) == [
        "body 'b': its inertia follows from the shape 'gone', whose file is missing; put the file into "
        f"{tmp_path / 'shapes'}"
    ]


# --- calls in children ------------------------------------------------------------------------------------
def test_the_answer_of_a_call():
    assert pickle.loads(serve._answer(divmod, (7, 2))) == (True, (3, 1))
    is_right, message = pickle.loads(serve._answer(int, ("seven",)))
    assert not is_right and message.startswith("ValueError: invalid literal for int()")
    assert pickle.loads(serve._answer_within(60.0, max, (3, 5))) == (True, 5)


def test_the_answer_of_a_copy_of_the_process():
    own = os.getpid()
    is_right, pid = pickle.loads(serve._answer_of_copy(60.0, os.getpid, ()))
    assert is_right and pid != own


@pytest.mark.parametrize(("call", "status"), [((os._exit, (3,)), 3), ((os.kill, (0, signal.SIGKILL)), -9)])
def test_a_copy_that_ends_without_an_answer(monkeypatch, call, status):
    """This process then ends in the same way."""
    function, arguments = call
    if function is os.kill:
        function, arguments = _killed, ()
    monkeypatch.setattr(serve, "_end_as", lambda found: ("ended", found))
    assert serve._answer_of_copy(60.0, function, arguments) == ("ended", status)


def _killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize(
    ("status", "done"), [(3, [("exit", 3)]), (0, [("exit", 0)]), (-9, [("kill", 9), ("exit", 0)])]
)
def test_a_process_ends_as_its_copy(monkeypatch, status, done):
    seen = []
    monkeypatch.setattr(os, "kill", lambda pid, number: seen.append(("kill", number)) or pid == os.getpid())
    monkeypatch.setattr(os, "_exit", lambda number: seen.append(("exit", number)))
    serve._end_as(status)
    assert seen == done


def test_a_run_that_gave_no_state():
    block = Body(name="b", position=(0.0, 0.0, 0.0))
    scene, setting = Scene(name="s", body=(block,)), Setting("f", {"step": 0.1})
    run = serve.failed("e", "1.2", scene, setting, Outcome.CRASHED, "it crashed")
    assert (run.scene, run.engine, run.version, run.method) == ("s", "e", "1.2", "f")
    assert (run.settings, run.bodies, run.outcome, run.message) == (
        {"step": 0.1},
        ("b",),
        Outcome.CRASHED,
        "it crashed",
    )
