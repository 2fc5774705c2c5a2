"""Loops that the user closes / options, YAML files and frames that coincide, worked out by hand."""

from __future__ import annotations

import copy
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from crosscheck.engines.mujoco.importing import asked_closures  # noqa: E402
from crosscheck.engines.mujoco.importing.asked_closures import Frames, asked, unclosed  # noqa: E402
from crosscheck.engines.mujoco.importing.closures import TYPES, Closure, Frame  # noqa: E402
from crosscheck.engines.mujoco.importing.groups import Groups  # noqa: E402
from mbref.scene import Cylindrical, Fixed, Revolute, SceneError, Spherical, Translational  # noqa: E402

LUMP = '<inertial pos="0 0 0" mass="1" diaginertia="1 1.5 2"/>'
# tip and end are at (1, 2, 0); s is at (1, 1, 0), and t too; far is 3e-6 m beside w, at (5, 0, 0)
FILE = f"""<mujoco><worldbody><site name="w" pos="5 0 0"/><site pos="1 2 0"/>
<body name="a" pos="1 0 0"><joint pos="0 0.5 0" axis="0 0 1"/>{LUMP}
<site name="s" pos="0 1 0" quat="0 1 0 0"/><body name="tip" pos="0 2 0"/><body name="knot"><body name="end"
pos="0 2 0"/></body></body>
<body name="b" pos="0 1 0"><joint axis="0 0 1"/>{LUMP}<site name="t" pos="1 0 0"/><site pos="1 1 0"/>
<body name="toe" pos="1 1 0"/><body name="lead" pos="1 1 0">{LUMP}</body><body pos="1 1 0"/>
<site name="far" pos="5.000003 -1 0"/></body>
<body name="s" pos="0 7 0"><joint/>{LUMP}</body></worldbody></mujoco>"""
ORIGIN = [0.0, 0.0, 0.0]
NAMES = ["world", "a", "tip", "knot", "end", "b", "toe", "lead", "s", "w", "s", "t", "far"]


@pytest.fixture(scope="module")
def model() -> Any:
    return mujoco.MjModel.from_xml_string(FILE)


@pytest.fixture
def frames(model: Any) -> Frames:
    return Frames(mujoco, model, "base")


def found(text: str, frames: Frames) -> Closure:
    [closure] = asked([text], frames)
    return closure


def test_frames_by_their_names(model: Any, frames: Frames) -> None:
    """A site comes before a body of its name; the base of a URDF is the world."""
    assert list(frames.names()) == NAMES
    for name in ("ground", "world", "base"):
        frame = frames.find(name)
        assert frame.body == 0 and frame.origin.tolist() == ORIGIN and (frame.axes == np.eye(3)).all()
    tip, s = frames.find("tip"), frames.find("s")
    assert (
        tip.body == model.body("tip").id and tip.origin.tolist() == ORIGIN and (tip.axes == np.eye(3)).all()
    )
    assert s.body == model.body("a").id and s.origin.tolist() == [0.0, 1.0, 0.0]
    assert s.axes == pytest.approx(np.diag([1.0, -1.0, -1.0]))
    assert frames.find("w").body == 0 and frames.find("w").origin.tolist() == [5.0, 0.0, 0.0]
    assert frames.find("a").body == 1 and not frames.find("a").origin.any()
    with pytest.raises(SceneError, match=r"^--close: no link, body or site 'toes'; did you mean 'toe'\?$"):
        frames.find("toes")
    with pytest.raises(SceneError, match=f"no link, body or site '123'; known: {', '.join(NAMES)}$"):
        frames.find("123")
    with pytest.raises(SceneError, match="'base'"):
        Frames(mujoco, model, "other").find("base")


@pytest.mark.parametrize(
    ("text", "kind", "axis"),
    [
        ("tip=toe", Spherical, (0, 0, 1)),
        ("tip=toe:", Spherical, (0, 0, 1)),
        ("tip=toe:revolute", Revolute, (0, 0, 1)),
        ("tip=toe:Revolute", None, "type 'Revolute' is none of spherical, ball, .*, 3d, 6d"),
        ("tip=toe:revolute:x", Revolute, (1, 0, 0)),
        ("tip=toe:prismatic:y", Translational, (0, 1, 0)),
        ("tip=toe:cylindrical:", Cylindrical, (0, 0, 1)),
        ("tip=toe:3d", Spherical, (0, 0, 1)),
        ("tip=toe:3D", Spherical, (0, 0, 1)),
        ("tip=toe:6d", Fixed, (0, 0, 1)),
        ("tip=toe:FIXED", None, "type 'FIXED' is none of spherical"),
        ("tip=toe:revolute:w", None, "axis 'w' is none of x, y, z"),
        ("tip=nobody", None, "no link, body or site 'nobody'"),
    ],
)
def test_closures_of_options(frames: Frames, text: str, kind: Any, axis: Any) -> None:
    if kind is None:
        with pytest.raises(SceneError, match=axis):
            found(text, frames)
        return
    closure = found(text, frames)
    assert closure.name == "tip=toe" and closure.type is kind
    assert [frame.body for frame in closure.frames] == [frames.find("tip").body, frames.find("toe").body]
    for frame in closure.frames:
        assert frame.axes[:, 2] == pytest.approx(axis) and np.linalg.det(frame.axes) == pytest.approx(1)


def test_the_axis_is_an_axis_of_each_frame(frames: Frames) -> None:
    """The frame of s is turned by half a turn about x, so that its axis y is -y of the body."""
    first, second = found("s=tip:revolute:y", frames).frames
    assert first.axes[:, 2] == pytest.approx((0, -1, 0)) and second.axes[:, 2] == pytest.approx((0, 1, 0))
    assert first.origin.tolist() == [0.0, 1.0, 0.0] and not second.origin.any()


@pytest.mark.parametrize("text", ["tip", "tip=", "=toe", "=", "tip:toe"])
def test_options_without_two_frames(frames: Frames, text: str) -> None:
    with pytest.raises(SceneError) as caught:
        found(text, frames)
    assert list(caught.value.faults) == [
        f"--close {text}: must be frame_a=frame_b[:type[:axis]] or a .yaml file"
    ]


# --- YAML files -------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "closures"),
    [
        ("closed_loop: [[tip, toe], [s, t]]", [("tip=toe", Spherical, 2), ("s=t", Spherical, 2)]),
        (
            "closed_loop: [[tip, toe], [s, t]]\ntype: [3d, 6d]\naxis: [x, y]",
            [("tip=toe", Spherical, 0), ("s=t", Fixed, 1)],
        ),
        (
            "closed_loop: [[tip, toe], [tip, t]]\ntype: revolute\naxis: y",
            [("tip=toe", Revolute, 1), ("tip=t", Revolute, 1)],
        ),
        ("closed_loop: []", []),
    ],
)
@pytest.mark.parametrize("ending", ["yaml", "yml"])
def test_closures_of_a_yaml_file(
    frames: Frames, tmp_path: Path, text: str, closures: list[Any], ending: str
) -> None:
    pytest.importorskip("yaml")
    (tmp_path / f"loops.{ending}").write_text(text)
    made = list(asked(["tip=t:fixed", str(tmp_path / f"loops.{ending}"), "a=b"], frames))
    assert [c.name for c in made] == ["tip=t", *(name for name, _, _ in closures), "a=b"]
    for closure, (name, kind, axis) in zip(made[1:-1], closures, strict=True):
        assert closure.name == name and closure.type is kind
        assert closure.frames[1].axes[:, 2] == pytest.approx(np.eye(3)[axis])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("closed_loop: [[tip, toe]", "is no YAML: while parsing a flow sequence"),
        ("- tip", "closed_loop must be a list of pairs of frames"),
        ("type: 3d", "closed_loop must be a list of pairs of frames"),
        ("closed_loop: tip", "closed_loop must be a list of pairs of frames"),
        ("closed_loop: [[tip, toe], [tip]]", "closed_loop must be a list of pairs of frames"),
        ("closed_loop: [ab, [tip, toe]]", "closed_loop must be a list of pairs of frames"),
        ("closed_loop: [[tip], [s, t, tip]]", "closed_loop must be a list of pairs of frames"),
        ("closed_loop: [[tip, toe], ab]", "closed_loop must be a list of pairs of frames"),
        ("closed_loop: [[tip, toe]]\ntype: [3d, 6d]", "type has 2 entries for 1 loops"),
        ("closed_loop: [[tip, toe], [s, t]]\naxis: [z]", "axis has 1 entries for 2 loops"),
    ],
)
def test_faults_of_a_yaml_file(frames: Frames, tmp_path: Path, text: str, fault: str) -> None:
    pytest.importorskip("yaml")
    path = tmp_path / "loops.yaml"
    path.write_text(text)
    with pytest.raises(SceneError) as caught:
        list(asked([str(path)], frames))
    [sentence] = caught.value.faults
    assert sentence.startswith(f"{path}: {fault}") and "\n" not in sentence


# --- frames that coincide ---------------------------------------------------------------------------------
def test_named_sites_and_ends_without_mass(model: Any) -> None:
    """A body that carries another body is no end, neither is a body with mass or without a name."""
    marks = dict(asked_closures._marks(Groups(mujoco, model)))
    assert list(marks) == ["tip", "end", "toe", "w", "s", "t", "far"]
    assert [marks[n].body for n in ("tip", "end", "toe")] == [model.body(n).id for n in ("tip", "end", "toe")]
    assert marks["tip"].origin.tolist() == ORIGIN and (marks["tip"].axes == np.eye(3)).all()
    light = copy.copy(model)
    light.body_mass[light.body("s").id] = 0.0  # as in a URDF whose link has no mass
    assert sum(n == "s" for n, _ in asked_closures._marks(Groups(mujoco, light))) == 1, "its joint moves it"
    assert marks["t"].origin.tolist() == [1.0, 0.0, 0.0] and marks["w"].body == 0


def open_loops(model: Any, extent: float = 1.0, *closed: Closure) -> list[str]:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return list(unclosed(Groups(mujoco, model), data, closed, extent))


def sentence(first: str, on: str, second: str, under: str) -> str:
    return (
        f"frames {first!r} (on {on!r}) and {second!r} (on {under!r}) coincide without a joint; "
        f"--close {first}={second} closes the loop"
    )


TIP, END, SITES = (
    sentence("tip", "a", "toe", "b"),
    sentence("end", "a", "toe", "b"),
    sentence("s", "a", "t", "b"),
)


def test_frames_of_two_bodies_that_coincide(model: Any) -> None:
    """Frames of one body that coincide are no loop; nor are frames 3e-6 m apart, on an extent of 1 m."""
    assert open_loops(model) == [TIP, END, SITES]
    assert open_loops(model, 4.0) == [TIP, END, sentence("w", "ground", "far", "b"), SITES]
    assert open_loops(model, 2.5) == [TIP, END, SITES]


def test_frames_where_a_joint_is_already(model: Any) -> None:
    """A closure at (1, 2, 0) takes that place, a joint at (1, 1, 0) the other one."""
    at = Frame(0, np.array([1.0, 2.0, 0.0]), np.eye(3)), Frame(0, np.array([1.0, 1.0, 0.0]), np.eye(3))
    assert open_loops(model, 1.0, Closure("c", Spherical, at)) == [SITES]
    assert open_loops(model, 1.0, Closure("c", Spherical, at[::-1])) == [TIP, END]
    near = Frame(0, np.array([1.0, 2.0, 3e-6]), np.eye(3)), at[1]
    assert open_loops(model, 1.0, Closure("c", Spherical, near)) == [TIP, END, SITES]
    assert open_loops(model, 4.0, Closure("c", Spherical, near))[-1] == SITES
    other = mujoco.MjModel.from_xml_string(FILE.replace('pos="0 0.5 0" axis', 'pos="0 1 0" axis'))
    assert open_loops(other) == [TIP, END]


@pytest.mark.parametrize(("apart", "is_near"), [(0.5, True), (0.50000001, False)])
def test_the_limit_of_coincidence(monkeypatch: pytest.MonkeyPatch, apart: float, is_near: bool) -> None:
    """Half a metre is a quarter of the extent of 2 m; a joint just as far away is at the place, too."""
    monkeypatch.setattr(asked_closures, "COINCIDENT", 0.25)
    places = {"p": np.zeros(3), "q": np.array([apart, 0.0, 0.0])}
    ends = [(n, SimpleNamespace(body=k, place=lambda data, n=n: places[n])) for k, n in enumerate("pq")]
    monkeypatch.setattr(asked_closures, "_marks", lambda groups: ends)
    groups: Any = SimpleNamespace(of=[0, 1], names=["one", "two"])
    far = np.array([0.0, 0.6, 0.0])
    for joint, is_free in ((np.array([0.0, 0.5, 0.0]), False), (far, True)):
        data = SimpleNamespace(xanchor=[joint])
        found = list(unclosed(groups, data, (), 2.0))
        assert found == ([sentence("p", "one", "q", "two")] if is_near and is_free else [])
    groups.of = [1, 1]
    assert not list(unclosed(groups, SimpleNamespace(xanchor=[far]), (), 2.0))


def test_a_package_reads_yaml(frames: Frames, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(SceneError) as caught:
        list(asked(["loops.yml"], frames))
    assert list(caught.value.faults) == ["loops.yml: reading YAML needs pip install pyyaml"]


def test_every_type_of_a_urdf_closes_a_loop(frames: Frames) -> None:
    wanted = {"ball": Spherical, "continuous": Revolute, "translational": Translational, "fixed": Fixed}
    assert {kind: found(f"tip=toe:{kind}", frames).type for kind in wanted} == wanted
    assert set(TYPES) == {*wanted, "spherical", "revolute", "prismatic", "cylindrical"}
