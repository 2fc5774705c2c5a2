"""Rarely run parts of adapters and judges / decisions on stand-ins, and numbers worked out by hand."""

from __future__ import annotations

import ctypes
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn import adapter as exudyn
from crosscheck.engines.mujoco import projection, simulation, struct_layout
from crosscheck.engines.mujoco.importing import asked_closures
from crosscheck.engines.sampling import Failed
from crosscheck.judge.reference import reference
from crosscheck.study import stability
from mbref.scene import Driver, Revolute, SceneError, Spherical, Translational
from mbref.trajectory import Outcome


# --- layout of C structures -------------------------------------------------------------------------------
def test_types_of_fields_of_a_c_structure(monkeypatch):
    kind = SimpleNamespace
    assert struct_layout._type(kind(name="int")) is ctypes.c_int
    assert struct_layout._type(kind(inner_type=kind(name="double"))) is ctypes.c_void_p, (
        "a pointer has no name"
    )
    table = struct_layout._type(kind(inner_type=kind(name="mjtNum"), extents=(2, 3)))
    assert ctypes.sizeof(table) == 6 * 8 and len(table()) == 2 and len(table()[0]) == 3
    monkeypatch.setattr(struct_layout, "_structure", lambda name: f"structure {name}")
    assert struct_layout._type(kind(name="mjContact")) == "structure mjContact"
    sizes = {name: ctypes.sizeof(found) for name, found in struct_layout.SIMPLE.items()}
    assert sizes == {
        "int": 4,
        "double": 8,
        "mjtNum": 8,
        "size_t": 8,
        "uintptr_t": 8,
        "mjtSize": 8,
        "mjtBool": 1,
        "mjtByte": 1,
        "float": 4,
        "uint64_t": 8,
    }


@pytest.mark.parametrize("field", ["ne", "nefc", "time", "qpos", "qvel", "efc_J", "efc_pos"])
def test_offsets_in_mujoco_s_data(field):
    """The bytes at the offset are the field's value, or the address of its array."""
    hinged = """<mujoco><worldbody><body name='b' pos='0 0 1'><joint axis='0 1 0'/>
        <geom size='0.1' pos='1 0 0'/></body></worldbody>
        <equality><connect body1='b' anchor='0.3 0 0.2'/></equality></mujoco>"""
    model = mujoco.MjModel.from_xml_string(hinged)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    data.qpos[:], data.time = 0.3, 0.75
    mujoco.mj_forward(model, data)
    at, value = data._address + struct_layout.offset(field), getattr(data, field)
    if field in ("ne", "nefc"):
        assert ctypes.c_int.from_address(at).value == value > 0
    elif field == "time":
        assert ctypes.c_double.from_address(at).value == value == 0.75
    else:
        assert ctypes.c_size_t.from_address(at).value == value.ctypes.data


# --- projection -------------------------------------------------------------------------------------------
def test_rows_of_rounding_are_zero():
    """An entry of 1e-12, times the extent if that is more than a metre, is rounding."""
    rows = np.array([[1e-12, -0.5e-12], [0.0, 2e-12], [1.0, 1e-15]])
    assert projection._unrounded(rows, 0.5).tolist() == [[0.0, 0.0], [0.0, 2e-12], [1.0, 1e-15]]
    assert projection._unrounded(rows, 2.0).tolist() == [[0.0, 0.0], [0.0, 0.0], [1.0, 1e-15]]


def test_the_least_change_by_kinetic_energy():
    mass = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]])
    rows, wanted = np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 2.0]]), np.array([0.3, -0.7])
    found = projection._least(np.linalg.cholesky(mass), rows, wanted, 0.0)
    spread = np.linalg.solve(mass, rows.T)
    assert found == pytest.approx(spread @ np.linalg.solve(rows @ spread, wanted))
    for bad in ((rows * np.nan, wanted), (rows, wanted * np.inf)):
        with pytest.raises(Failed, match=r"the closure errors are not finite at 0\.25 s") as failed:
            projection._least(np.linalg.cholesky(mass), *bad, 0.25)
        assert failed.value.outcome is Outcome.NOT_FINITE and failed.value.t == 0.25


# --- drivers of MuJoCo ------------------------------------------------------------------------------------
def test_a_driver_moves_the_reference_of_its_first_row():
    """Equality 7 has rows 1 and 3; 2 t + 3 t² is 1.75 after 0.5 s, with rates 5 and 6."""
    driver = Driver(joint="A", polynomial=(0.0, 2.0, 3.0))
    data = SimpleNamespace(
        efc_type=np.array([0, 0, 5, 0]),
        efc_id=np.array([2, 7, 7, 7]),
        efc_aref=np.array([1.0, 10.0, 100.0, 1000.0]),
        efc_KBIP=np.array([[9.0] * 4, [40.0, 8.0, 0.5, 77.0], [9.0] * 4, [9.0] * 4]),
        time=0.5,
    )
    made = object.__new__(simulation.Simulation)
    made.mujoco = SimpleNamespace(mjtConstraint=SimpleNamespace(mjCNSTR_EQUALITY=0))
    applied: list[tuple] = []
    made.data, made.since = data, 0.25
    made.compiled = SimpleNamespace(
        drivers=[(7, driver)], timed=False, apply=lambda found, since: applied.append((found, since))
    )
    assert made._rows(7).tolist() == [1, 3] and made._rows(2).tolist() == [0] and not made._rows(3).size
    assert made._driven() == [(1, driver)]
    made._drive(None, data)
    assert data.efc_aref.tolist() == [1.0, 10.0 + 6.0 + 8.0 * 5.0 + 40.0 * 0.5 * 1.75, 100.0, 1000.0]
    assert not applied
    made.compiled.timed = True
    made._drive(None, data)
    assert applied == [(data, 0.25)]


# --- closures that are asked for --------------------------------------------------------------------------
TEXT = """<mujoco><worldbody><body name="arm" pos="1 2 3"><freejoint/><geom size="0.1"/>
    <site name="tip" pos="0.4 0.5 0.6" quat="0.6 0 0.8 0"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def frames() -> asked_closures.Frames:
    return asked_closures.Frames(mujoco, mujoco.MjModel.from_xml_string(TEXT), "base")


def test_frames_by_their_names(frames):
    arm, tip = frames.find("arm"), frames.find("tip")
    assert (arm.body, tip.body) == (1, 1) and arm.origin.tolist() == [0.0, 0.0, 0.0]
    assert tip.origin == pytest.approx([0.4, 0.5, 0.6]) and tip.axes[0, 2] == pytest.approx(0.96)
    for name in ("ground", "world", "base"):
        found = frames.find(name)
        assert found.body == 0 and not found.origin.any() and (found.axes == np.eye(3)).all()
    assert list(frames.names()) == ["world", "arm", "tip"]
    with pytest.raises(SceneError, match="no link, body or site 'arn'; did you mean 'arm'\\?"):
        frames.find("arn")
    with pytest.raises(SceneError, match="no link, body or site 'xyz'; known: world, arm, tip"):
        frames.find("xyz")


@pytest.mark.parametrize(
    ("text", "kind", "axis"),
    [
        ("tip=ground", Spherical, (0.0, 0.0, 1.0)),
        ("tip=ground:revolute", Revolute, (0.0, 0.0, 1.0)),
        ("tip=ground:revolute:y", Revolute, (0.0, 1.0, 0.0)),
        ("tip=ground:prismatic:x", Translational, (1.0, 0.0, 0.0)),
    ],
)
def test_texts_of_closures(frames, text, kind, axis):
    """Both frames have the joint's axis; the frame of the site is turned about y."""
    [found] = asked_closures.asked([text], frames)
    first, second = found.frames
    assert (found.name, found.type, first.body, second.body) == ("tip=ground", kind, 1, 0)
    assert second.axes[:, 2] == pytest.approx(axis)
    assert first.axes[:, 2] == pytest.approx(frames.find("tip").axes @ axis)
    assert first.origin == pytest.approx([0.4, 0.5, 0.6]) and not second.origin.any()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("tip", "--close tip: must be "),
        ("=arm", "--close =arm: must be "),
        ("tip=", "--close tip=: must be "),
        ("tip=arm:screw", "--close tip=arm: type 'screw' is none of spherical"),
        ("tip=arm:revolute:w", "--close tip=arm: axis 'w' is none of x, y, z"),
    ],
)
def test_texts_that_are_no_closures(frames, text, says):
    with pytest.raises(SceneError) as refused:
        list(asked_closures.asked([text], frames))
    assert str(refused.value.faults[0]).startswith(says), refused.value.faults


def test_closures_of_a_file(frames, tmp_path):
    pytest.importorskip("yaml")
    path = tmp_path / "loops.yaml"

    def read(text: str) -> list[Any]:
        path.write_text(text)
        return [(c.name, c.type) for c in asked_closures.asked([str(path)], frames)]

    pairs = "closed_loop: [[tip, ground], [arm, world]]\n"
    names = ["tip=ground", "arm=world"]
    assert read(pairs) == [(name, Spherical) for name in names]
    assert read(pairs + "type: revolute\n") == [(name, Revolute) for name in names]
    assert read(pairs + "type: [spherical, revolute]\naxis: [x, y]\n") == list(
        zip(names, (Spherical, Revolute), strict=True)
    )
    for text, says in (
        (pairs + "type: [revolute]\n", "type has 1 entries for 2 loops"),
        ("closed_loop: [[tip, ground, arm]]\n", "closed_loop must be a list of pairs of frames"),
        ("closed_loop: tip\n", "closed_loop must be a list of pairs of frames"),
        ("[1, 2]\n", "closed_loop must be a list of pairs of frames"),
        ("a: [", "is no YAML"),
    ):
        with pytest.raises(SceneError, match=says):
            read(text)


# --- runs of the reference --------------------------------------------------------------------------------
def motion(count: int, seconds: float, reason: str = "", contradiction: float = 0.0) -> Any:
    return SimpleNamespace(
        times=np.arange(float(count)), seconds=seconds, reason=reason, contradiction=contradiction
    )


def planned(monkeypatch, a: list[Any], b: list[Any]) -> list[tuple]:
    """Record the requests to the formulations; each returns the given motions in turn."""
    asked: list[tuple] = []

    def of(name: str, motions: list[Any]) -> Any:
        def run(scene: Any, times: np.ndarray, numbers: Any, **options: Any) -> Any:
            options["seconds"] = round(options["seconds"], 9)
            asked.append((name, len(times), options))
            return motions.pop(0)

        return run

    monkeypatch.setattr(reference, "natural_motion", of("A", a))
    monkeypatch.setattr(reference, "tree_motion", of("B", b))
    return asked


OTHER_A = {"order": reference.SECOND_RUN_ORDER, "seed": reference.SECOND_RUN_SEED}


def test_both_formulations_run_and_a_runs_twice(monkeypatch):
    """A gets its share of 100 s, the second run of A its share of the rest, and B what is left."""
    a, again, b = motion(5, 10.0), motion(5, 20.0), motion(5, 1.0)
    asked = planned(monkeypatch, [a, again], [b])
    assert reference.runs(None, np.arange(5.0), 100.0) == (a, again, b)
    share = reference.SHARE
    assert asked == [
        ("A", 5, {"seconds": round(share * 100.0, 9)}),
        ("A", 5, {"seconds": round(share * 90.0, 9), **OTHER_A, "displaced": 0.0}),
        ("B", 5, {"seconds": 70.0}),
    ]


@pytest.mark.parametrize(
    ("contradiction", "displaced"),
    [
        (reference.CONSISTENT, 0.0),
        (1.01 * reference.CONSISTENT, max(reference.DATA, 1.01 * reference.CONSISTENT)),
        (1e-6, 1e-6),
    ],
)
def test_contradictory_joints_are_displaced(monkeypatch, contradiction, displaced):
    asked = planned(
        monkeypatch, [motion(5, 1.0, contradiction=contradiction), motion(5, 1.0)], [motion(5, 1.0)]
    )
    reference.runs(None, np.arange(5.0), 100.0)
    assert asked[1][2]["displaced"] == displaced


def test_where_a_runs_out_of_time_b_runs_twice(monkeypatch):
    """A reaches three of eight samples in 40 s; B has half of the rest, its second run what is left."""
    a, b, again = motion(3, 40.0, reference.OVER), motion(7, 25.0), motion(7, 5.0)
    asked = planned(monkeypatch, [a], [b, again])
    assert reference.runs(None, np.arange(8.0), 100.0) == (b, again, a)
    assert [(name, count, options["seconds"]) for name, count, options in asked[1:]] == [
        ("B", 8, 30.0),
        ("B", 7, 35.0),
    ]
    assert asked[2][2]["nodes_per_digit"] == reference.SECOND_RUN_NODES and asked[2][2]["seed"] > 0
    a, b, second = motion(3, 40.0, reference.OVER), motion(3, 25.0), motion(3, 5.0)
    asked = planned(monkeypatch, [a, second], [b])
    assert reference.runs(None, np.arange(8.0), 100.0) == (a, second, b), "B comes no further"
    assert asked[2] == ("A", 3, {"seconds": 35.0, **OTHER_A, "displaced": 0.0})


def test_a_motion_without_a_sample_is_all_there_is(monkeypatch):
    a = motion(0, 1.0, "it is singular")
    asked = planned(monkeypatch, [a], [])
    assert reference.runs(None, np.arange(8.0), 100.0) == (a, a, a) and len(asked) == 1


# --- settings ---------------------------------------------------------------------------------------------
def test_settings_of_the_stability_ladders(monkeypatch):
    """Each engine by the last but one setting of its family; none of the ladder of ranks."""
    scene = SimpleNamespace(name="gap", duration=44.0)
    family = stability.FAMILIES["mujoco"]
    offered = {
        "mujoco": [Setting(family, {"rtol": 10.0**-k}) for k in range(4)] + [Setting("other", {})],
        "pinocchio": [Setting(stability.FAMILIES["pinocchio"], {"rtol": 0.5})],
        "exudyn": [Setting("other", {})],
    }
    monkeypatch.setattr(stability, "settings", lambda name, given: offered[name])
    monkeypatch.setattr(stability, "place", lambda name: (name, 0.125))
    found = list(stability._settings(scene, ["mujoco", "pinocchio", "exudyn"]))
    count = len(stability.METHODS)
    assert [setting.family for _, setting in found[:count]] == list(stability.METHODS)
    assert {name for name, _ in found[:count]} == {"mbref"}
    assert found[count:] == [("mujoco", offered["mujoco"][2]), ("pinocchio", offered["pinocchio"][0])]
    assert stability._options(scene) == {"rtol": 1e-9, "most_steps": stability.MOST_STEPS}
    scene.duration = 46.0
    assert stability._options(scene)["most_steps"] == 2 * stability.MOST_STEPS
    scene.name = stability.RANK_TOLERANCE
    assert stability._options(scene)["rank_tolerance"] == 0.125
    assert len(list(stability._settings(scene, ["mujoco"]))) == count


def test_steps_of_the_extrapolated_family(monkeypatch):
    """Angles over the rate, with two digits, none shorter than the shortest; each once, the longest first."""
    monkeypatch.setattr(exudyn, "fastest_rate", lambda scene, coarse, counts: 7.0)
    engine, scene = exudyn.ENGINE, SimpleNamespace(duration=1e-9)
    found = engine._tuned_steps(scene)
    shortest = exudyn.SHORTEST * max(exudyn.RICHARDSON)
    angles = [max(float(f"{angle / 7.0:.2g}"), shortest) for angle in exudyn.TUNED_STEPS]
    assert found == sorted(set(angles), reverse=True) and found[0] > found[-1] >= shortest
    slow = engine._tuned_steps(SimpleNamespace(duration=1e9))
    assert slow == [1e9 / exudyn.MOST_TUNED]
    monkeypatch.setattr(exudyn, "_fully_driven", lambda given: given.driven)
    massless = SimpleNamespace(has_mass=lambda: False, driven=False)
    assert "whole motion is driven" in engine.refuses(massless).reason
    assert not engine.serves(massless, "tuned")
    assert engine.serves(SimpleNamespace(has_mass=lambda: True), "tuned")
