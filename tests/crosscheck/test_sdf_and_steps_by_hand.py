"""Parts of SDF files, stretches of samples and runs of Exudyn and Pinocchio / worked out by hand."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.exudyn import dynamic, extrapolation
from crosscheck.engines.pinocchio import simulation
from crosscheck.engines.sdf import flattening, frames, gearing, reading
from mbref import rotations
from mbref.scene import Revolute, SceneError

HINGE = Revolute(name="H", bodies=("a", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))


# --- SDF --------------------------------------------------------------------------------------------------
def test_a_quaternion_of_sdf_has_its_scalar_last() -> None:
    for wxyz in ((0.5, 0.5, -0.5, 0.5), (0.1, 0.7, 0.5, -0.5), (0.8, 0.0, 0.0, 0.6)):
        xyzw = np.array([*wxyz[1:], wxyz[0]])
        turn = frames._of_quaternion(xyzw, "pose")
        assert turn == pytest.approx(rotations.to_matrix(np.array(wxyz)))
        assert frames._of_quaternion(xyzw * (1 + 5e-7), "pose") == pytest.approx(turn)
        with pytest.raises(SceneError, match="pose: the quaternion must have length one, got 1"):
            frames._of_quaternion(xyzw * (1 + 2e-6), "pose")


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_rotation_about_a_coordinate_axis(axis: int) -> None:
    wanted = rotations.to_matrix(rotations.from_vector(0.7 * np.eye(3)[axis]))
    assert frames._about(axis, 0.7) == pytest.approx(wanted)


@pytest.mark.parametrize(("off", "is_hinge"), [(0.25, True), (0.2501, False)])
def test_how_nearly_a_hinge_has_the_axis_of_a_gearbox(
    off: float, is_hinge: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A quarter of unit vectors; the sense follows from the direction and the order of the links."""
    monkeypatch.setattr(gearing, "PARALLEL", 0.25)
    size = np.sqrt(1 - off**2)
    for sign in (1.0, -1.0):
        axis = sign * np.array([off, 0.0, size])
        if not is_hinge:
            with pytest.raises(SceneError, match="joint 'g': a gearbox needs a hinge along its axis between"):
                gearing._hinge("g", "a", "b", axis, [HINGE])
            continue
        monkeypatch.setattr(gearing, "PARALLEL", 0.25 + 1e-12)
        assert gearing._hinge("g", "a", "b", axis, [HINGE]) == (HINGE, int(sign))
        assert gearing._hinge("g", "b", "a", axis, [HINGE]) == (HINGE, -int(sign))


@pytest.mark.parametrize(
    ("text", "is_true"),
    [(None, False), ("<x/>", False), ("<x> True </x>", True), ("<x>1</x>", True), ("<x>0</x>", False)],
)
def test_switches_of_sdf(text: str | None, is_true: bool) -> None:
    assert reading._is_true(None if text is None else ET.fromstring(text)) is is_true


@pytest.mark.parametrize(
    ("inside", "link"),
    [
        ("", "world"),
        ('<link name="l"/><link name="k"/>', "m::l"),
        ('<joint name="j"/><link name="k"/>', "m::k"),
        ('<model name="n"><link name="k"/></model>', "m::n::k"),
        ('<model name="n"><model name="o"><link name="k"/></model></model>', "m::n::o::k"),
        ('<model name="n"/>', "world"),
        ('<model name="n"><link name="k"/></model><link name="l"/>', "m::l"),
    ],
)
def test_the_link_to_which_a_model_is_attached(inside: str, link: str) -> None:
    assert flattening._main_link(ET.fromstring(f'<model name="m">{inside}</model>'), "m::") == link
    named = ET.fromstring(f'<model name="m" canonical_link="c">{inside}</model>')
    assert flattening._main_link(named, "m::") == "m::c"


# --- Exudyn -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("second", "count"), [(2.1, 1), (2.13, 2)])
def test_samples_that_count_as_equally_spaced(
    second: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fraction of 1/32 of the end at 4 s: they may be 1/8 s off."""
    monkeypatch.setattr(dynamic, "SAME", 1 / 32)
    found = list(dynamic.stretches(np.array([0.0, 1.0, second, 3.0, 4.0])))
    assert (len(found) == 1) is (count == 1) and found[0][0] == 0.0 and found[-1][1] == 4.0
    if count == 1:
        assert found == [(0.0, 4.0, 4)]


def test_runs_continue_from_their_last_sample_with_the_finest_data() -> None:
    """Two samples of one body; the data are of the last solver."""
    made: Any = object.__new__(extrapolation._ExtrapolatedRuns)
    made.solvers = [
        SimpleNamespace(state=lambda name=name: SimpleNamespace(data=name)) for name in ("coarse", "fine")
    ]
    values = np.arange(28.0).reshape(2, 2, 1, 7)
    made.arrive((np.array([0.5, 1.5]), values, None))
    assert made.state.t == 1.5 and made.state.data == "fine"
    assert made.state.coordinates.tolist() == values[0, 1, 0].tolist()
    assert made.state.rates.tolist() == values[1, 1, 0].tolist()


# --- Pinocchio --------------------------------------------------------------------------------------------
def test_a_model_whose_joints_are_in_another_order_is_refused() -> None:
    made: Any = object.__new__(simulation.Simulation)
    made.pin = SimpleNamespace(StdVec_RigidConstraintModel=list, StdVec_RigidConstraintData=list)
    made.mechanism = SimpleNamespace(closures=[])
    made.model = SimpleNamespace(createData=lambda: "data", check=lambda data: False)
    with pytest.raises(AssertionError, match="Pinocchio's joints are not in depth-first order"):
        made._configure(SimpleNamespace(family="defaults", options={}))


@pytest.mark.parametrize(("family", "gains"), [("baumgarte", (100.0, 20.0)), ("defaults", (0.0, 0.0))])
def test_gains_of_pinocchio_s_closures(family: str, gains: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A double root of a fraction of 1/step, squared and doubled."""
    monkeypatch.setattr(simulation, "BAUMGARTE", 0.5)
    given: list[Any] = []
    made: Any = object.__new__(simulation.Simulation)
    made.pin = SimpleNamespace(
        BaumgarteCorrectorParameters=lambda *numbers: numbers,
        StdVec_RigidConstraintModel=list,
        StdVec_RigidConstraintData=list,
    )
    closure = SimpleNamespace(setBaumgarteCorrectorParameters=given.append, createData=lambda: "data")
    made.mechanism = SimpleNamespace(closures=[closure])
    made.model = SimpleNamespace(createData=lambda: "data", check=lambda data: False)
    with pytest.raises(AssertionError):
        made._configure(SimpleNamespace(family=family, options={"step": 0.05}))
    assert given == [gains] and made.closure_data == ["data"] and made.closures == [closure]
