"""Limits of adapters / numbers just on either side of each, with the rest of the engine left out."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn import singular_crossing
from crosscheck.engines.mujoco import projection
from crosscheck.engines.mujoco.importing.couplings import of_equalities
from crosscheck.engines.mujoco.importing.groups import Groups, Piece
from crosscheck.engines.mujoco.importing.posing import JointRow
from crosscheck.engines.mujoco.importing.urdf import _enough
from crosscheck.engines.ondsel import adapter as ondsel
from crosscheck.engines.pinocchio.simulation import Simulation
from crosscheck.engines.sampling import Failed
from crosscheck.engines.sdf import gearing
from mbref.scene import Body, Revolute, Scene, SceneError
from mbref.trajectory import Outcome

BODY = Body(name="b", mass=4.0, inertia=(1.0, 2.0, 2.5), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
SCENE = Scene(name="s", body=(BODY,), joint=(HINGE,), duration=2.0)


# --- Pinocchio's projection -------------------------------------------------------------------------------
def pinocchio_run(residuals: list[float]) -> tuple[Any, list[float]]:
    """A run whose closure has these residuals in turn, the last one from then on; and the changes of q."""
    left, moved = list(residuals), []
    found: Any = object.__new__(Simulation)

    def closure_errors(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([left.pop(0) if len(left) > 1 else left[0]]), np.eye(1)

    def integrate(model: Any, q: np.ndarray, change: np.ndarray) -> np.ndarray:
        moved.append(float(change[0]))
        return q + change

    found.split = lambda t, y: (y[:1], y[1:])
    found.closures, found.model = ["closure"], SimpleNamespace(nv=1)
    found.free, found.pin = np.array([0]), SimpleNamespace(integrate=integrate)
    found._root_of_mass = lambda t, q: np.eye(1)
    found.closure_errors = closure_errors
    return found, moved


def test_pinocchio_s_projection_ends_at_small_residuals() -> None:
    """Newton's method ends at 1e-13 or after ten steps, and a residual below 1e-8 is accepted then."""
    found, moved = pinocchio_run([0.5, 1.5e-13, 0.9e-13])
    assert found.projected(0.5, np.array([3.0, 7.0])) == pytest.approx([3.5, 0.0]) and moved == [0.5, 1.5e-13]
    found, moved = pinocchio_run([0.9e-8])
    found.projected(0.5, np.array([3.0, 7.0]))
    assert len(moved) == 10
    found, _ = pinocchio_run([1.1e-8])
    with pytest.raises(Failed, match=r"the closures could not be met at 0\.5 s") as failed:
        found.projected(0.5, np.array([3.0, 7.0]))
    assert failed.value.outcome is Outcome.NOT_CONVERGED and failed.value.t == 0.5
    found.closures = []
    assert found.projected(0.5, np.array([3.0, 7.0])).tolist() == [3.0, 7.0]


@pytest.mark.parametrize(("small", "wanted"), [(1.5e-7, 1 / 1.5e-7), (0.9e-7, 0.0)])
def test_redundant_rows_of_pinocchio_and_mujoco(small: float, wanted: float) -> None:
    rows = np.diag([1.0, small])
    found: Any = object.__new__(Simulation)
    found.model, found.free = SimpleNamespace(nv=3), np.array([0, 2])
    wide = np.zeros((2, 3))
    wide[:, [0, 2]] = rows
    assert found._least_change(0.0, np.eye(2), wide, np.ones(2)) == pytest.approx([1.0, 0.0, wanted])
    assert projection._least(np.eye(2), rows, np.ones(2), 0.0) == pytest.approx([1.0, wanted])


def test_rows_of_rounding_are_relative_to_the_scene() -> None:
    options = {"rtol": 1e-6, "min_step": 1e-4}
    assert Simulation(SCENE, Setting("tuned", options)).least == pytest.approx(1e-12)
    far = SCENE.with_(body=(BODY.model_copy(update={"position": (50.0, 0.0, 0.0)}),))
    assert Simulation(far, Setting("tuned", options)).least > 1e-11


def test_solvers_of_pinocchio() -> None:
    found = Simulation(SCENE, Setting("tuned", {"rtol": 1e-6, "min_step": 1e-4}))
    assert (found.sampler.absolute_accuracy, found.sampler.mu, found.sampler.max_iter) == (1e-9, 1e-6, 50)


# --- MuJoCo's projection ----------------------------------------------------------------------------------
SLIDES = """<mujoco><worldbody>
<body><joint name="a" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</worldbody><equality><joint joint1="a" polycoef="0 0 0 0 0"/></equality></mujoco>"""


class Still:
    """MuJoCo whose positions do not move."""

    def __init__(self) -> None:
        self.moved: list[float] = []

    def __getattr__(self, name: str) -> Any:
        if name == "mj_integratePos":
            return lambda model, q, change, dt: self.moved.append(float(change[0]))
        return getattr(mujoco, name)


def projected(gap: float) -> list[float]:
    model, still = mujoco.MjModel.from_xml_string(SLIDES), Still()
    data = mujoco.MjData(model)

    def load(t: float, y: np.ndarray) -> None:
        data.qpos[:], data.qvel[:] = y[:1], y[1:]

    projection.projected(still, model, data, lambda: (), 0.5, load, np.array([gap, 0.0]))
    return still.moved


def test_mujoco_s_projection_ends_at_small_residuals() -> None:
    assert projected(0.9e-13) == [] and len(projected(1.5e-13)) == 10 and len(projected(0.9e-8)) == 10
    with pytest.raises(Failed, match=r"the closures could not be met at 0\.5 s"):
        projected(1.1e-8)


# --- Files ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("small", "row"), [(0.9e-12, (0, -1)), (1.5e-12, (0, 1))])
def test_coefficients_of_tendons_that_are_rounding(small: float, row: tuple[int, int]) -> None:
    lump = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    bodies = "".join(f'<body><joint name="{name}"/>{lump}</body>' for name in "xy")
    tendon = f'<fixed name="t"><joint joint="x" coef="1"/><joint joint="y" coef="{small}"/></fixed>'
    text = f"<worldbody>{bodies}</worldbody><tendon>{tendon}</tendon>"
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco>{text}<equality><tendon tendon1="t"/></equality></mujoco>'
    )
    [found] = of_equalities(mujoco, model, frozenset())
    assert isinstance(found, JointRow) and found.joints == row


@pytest.mark.parametrize(("product", "shape"), [(0.9e-15, (3,)), (1.5e-15, (3, 3))])
def test_products_of_inertia_that_are_rounding(product: float, shape: tuple[int, ...]) -> None:
    lump = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    text = f"<mujoco><worldbody><body><joint/>{lump}</body></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    found: Any = Groups(mujoco, model)
    found._inertia = lambda data, group, centre: np.array([[1.0, product, 0], [product, 1.0, 0], [0, 0, 1.0]])
    assert np.shape(found.body(data, Piece(1), None).inertia) == shape


def robot_link(mass: float, *moments: float) -> ET.Element:
    values = " ".join(f'i{axis}{axis}="{value!r}"' for axis, value in zip("xyz", moments, strict=True))
    return ET.fromstring(f'<link><inertial><mass value="{mass!r}"/><inertia {values}/></inertial></link>')


@pytest.mark.parametrize(
    ("link", "added"),
    [
        (robot_link(1.5e-12, 1.0, 1.0, 1.0), (0.0, 0.0)),
        (robot_link(0.9e-12, 1.0, 1.0, 1.0), (1.0, 0.0)),
        (robot_link(1.0, 1.5e-9, 1.0, 1.0), (0.0, 0.0)),
        (robot_link(1.0, 0.9e-9, 1.0, 1.0), (0.0, 1.0)),
        (robot_link(1.0, 1.5e-12, 1.5e-12, 1.5e-12), (0.0, 0.0)),
        (robot_link(1.0, 0.9e-12, 0.9e-12, 0.9e-12), (0.0, 0.9e-12)),
        (robot_link(1.0, 0.0, 0.0, 0.0), (0.0, 1.0)),
    ],
)
def test_inertia_that_mujoco_refuses(link: ET.Element, added: tuple[float, float]) -> None:
    assert _enough(link) == pytest.approx(added)


@pytest.mark.parametrize(("sine", "is_hinge"), [(0.9e-6, True), (1.5e-6, False)])
def test_a_gearbox_needs_a_parallel_hinge(sine: float, is_hinge: bool) -> None:
    axis = np.array([sine, 0.0, math.sqrt(1 - sine**2)])
    if is_hinge:
        assert gearing._hinge("g", "ground", "b", axis, [HINGE]) == (HINGE, 1)
        assert gearing._hinge("g", "b", "ground", axis, [HINGE]) == (HINGE, -1)
        assert gearing._hinge("g", "ground", "b", -axis, [HINGE]) == (HINGE, -1)
        return
    with pytest.raises(SceneError, match="joint 'g': a gearbox needs a hinge along its axis"):
        gearing._hinge("g", "ground", "b", axis, [HINGE])


# --- OndselSolver -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(("late", "count"), [(0.9e-10, 2), (1.5e-10, 1)])
def test_samples_that_are_equally_spaced(late: float, count: int) -> None:
    """The second interval of 0.1 s is longer by a fraction of 0.9e-9 or 1.5e-9."""
    asked: list[int] = []
    found: Any = object.__new__(ondsel._OndselSimulation)
    vars(found).update(times=np.array([0.1, 0.2 + late]), samples={}, hindered=False)
    found._analyse = lambda t0, many: asked.append(len(many))
    found.advance(0.0, 0.1)
    assert asked == [count]


@pytest.mark.parametrize(("cosine", "is_second"), [(1.5e-3, False), (0.9e-3, True)])
def test_angles_that_are_locked(cosine: float, is_second: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the cosine of the second angle is below 1e-3, another world frame is tried."""
    angles = {"first": math.acos(cosine), "second": 0.0}
    found: Any = object.__new__(ondsel._OndselSimulation)
    made = [SimpleNamespace(text=lambda *given, name=name: name) for name in angles]
    pose = (np.zeros((1, 3)), np.zeros((1, 4)))
    vars(found).update(assemblies=made, pose=pose, scene=SCENE, counts=SimpleNamespace(steps=0))
    found.solve = lambda text: text

    def table(name: str, frames: int) -> Any:
        middle = np.full((frames + 1, 3), angles[name])
        return SimpleNamespace(three=lambda *given: middle, name=name)

    def reader(assembly: Any, answer: Any, frame: int) -> Any:
        return SimpleNamespace(sample=lambda: (answer.name, frame))

    monkeypatch.setattr(ondsel, "table", table)
    monkeypatch.setattr(ondsel, "_Reader", reader)
    assert found._samples(0.0, 1.0, 4, [2, 4]) == [("second" if is_second else "first", k) for k in (2, 4)]
    assert found.counts.steps == (8 if is_second else 4)


# --- Exudyn -----------------------------------------------------------------------------------------------
def exudyn_projected(gap: float, monkeypatch: pytest.MonkeyPatch, moves: bool = True) -> tuple[float, int]:
    """The displacement of a body along x whose joint's residual is its own and a gap; the number of steps."""
    steps: list[float] = []

    def least(scene: Scene, orientation: Any, rows: Any, wanted: np.ndarray) -> np.ndarray:
        if len(wanted) == 1:
            steps.append(float(wanted[0]))
        found = np.zeros((1, 6))
        found[0, 0] = wanted[0] if moves and len(wanted) == 1 else 0.0
        return found

    start = BODY.position[0]
    residual = lambda scene, t, position, turn: {"H": np.array([position[0, 0] - start - gap])}  # noqa: E731
    monkeypatch.setattr(singular_crossing, "closure", residual)
    monkeypatch.setattr(singular_crossing, "jacobian", lambda *given: (np.zeros((2, 6)), np.zeros(2)))
    monkeypatch.setattr(singular_crossing, "_least", least)
    coordinates, _ = singular_crossing.projected(SCENE, 0.5, np.zeros((1, 7)), np.zeros((1, 7)))
    return float(coordinates[0, 0]), len(steps)


def test_exudyn_s_projection_ends_at_small_residuals(monkeypatch: pytest.MonkeyPatch) -> None:
    assert exudyn_projected(0.5, monkeypatch) == (0.5, 1)
    assert exudyn_projected(0.5, monkeypatch, moves=False) == (0.0, 8)
    assert exudyn_projected(0.9e-15, monkeypatch, moves=False)[1] == 0
    assert exudyn_projected(1.5e-15, monkeypatch, moves=False)[1] == 8
