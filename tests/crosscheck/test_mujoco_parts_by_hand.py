"""Files and small motions by MuJoCo, ports and projections / settings and refusals worked out by hand."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.mujoco import adapter, families, linearised, ports, projection, simulation, writing
from crosscheck.engines.mujoco.files import FORMAT
from crosscheck.engines.mujoco.model import compiled
from crosscheck.engines.ondsel import adapter as ondsel
from crosscheck.engines.pinocchio import adapter as of_pinocchio
from crosscheck.engines.sampling import Failed
from mbref.formats import ImportOptions
from mbref.scene import Body, Revolute, Scene, SceneError, Spherical
from mbref.trajectory import Outcome

BODY = Body(name="b", mass=2.0, inertia=(0.3, 0.4, 0.5), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
PIN = Spherical(name="P", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", body=(BODY,), joint=(HINGE, PIN), duration=2.0, gravity=(0.0, -9.0, 0.0))


# --- files ------------------------------------------------------------------------------------------------
def test_files_need_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    for call, given in ((FORMAT.read, (Path("a.xml"), ImportOptions())), (FORMAT.write, (SCENE,))):
        with pytest.raises(SceneError) as caught:
            call(*given)  # type: ignore[operator]
        assert list(caught.value.faults) == ["MJCF and URDF need MuJoCo: pip install 'mbref[engines]'"]


def test_a_file_is_read_with_its_own_runs(tmp_path: Path) -> None:
    lump = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    path = tmp_path / "m.xml"
    path.write_text(f"<mujoco><worldbody><body><joint/>{lump}</body></worldbody></mujoco>")
    found = FORMAT.read(path, ImportOptions())
    assert found.scene.name == "m" and found.originals and found.originals[0].engine == "mujoco"
    assert FORMAT.reads == (".xml", ".urdf") and FORMAT.writes == (".xml",)
    assert "<mujoco" in FORMAT.write(SCENE).text


# --- small motions ----------------------------------------------------------------------------------------
def test_the_step_of_a_small_motion_and_its_closures(monkeypatch: pytest.MonkeyPatch) -> None:
    """An eigenvalue exp(s h) of the step h = 1e-4 s gives s; closures are as stiff as h allows."""
    seen: list[Any] = []

    def transition(model: Any, data: Any, increment: float, centred: bool, a: Any, *others: Any) -> None:
        seen.append((model, data.qpos.copy(), data.time, increment, centred, a.shape, others))
        a[:] = np.diag(np.exp(1e-4 * np.array([-2.0, 3.0])))

    monkeypatch.setattr(mujoco, "mjd_transitionFD", transition)
    found = linearised.Linearised().own_eigenvalues(SCENE)
    assert sorted(found.real) == pytest.approx([-2.0, 3.0]) and not found.imag.any()
    [(model, qpos, _, increment, centred, shape, others)] = seen
    assert (increment, centred, shape, others) == (1e-5, True, (2, 2), (None, None, None))
    assert (model.opt.timestep, model.opt.tolerance) == (1e-4, 0.0) and qpos.tolist() == [0.0]
    assert len(model.eq_solref) == 1 and model.eq_solref[0, 0] == 2e-4
    assert model.eq_solimp[0].tolist()[:2] == [0.9999, 0.9999]
    assert model.eq_solimp[0].tolist()[2:] == compiled(SCENE).model.eq_solimp[0].tolist()[2:]


@pytest.mark.parametrize("family", ["defaults", "euler", "stock"])
def test_settings_of_a_ported_model(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Closures of two steps, which defaults leave as they are; drivers stand at the start."""
    applied: list[float] = []
    built = compiled(SCENE)
    soft = built.model.eq_solref.copy()

    class Built:
        def __getattr__(self, name: str) -> Any:
            return getattr(built, name)

        def apply(self, data: Any, t: float) -> None:
            applied.append(t)

    monkeypatch.setattr(ports, "compiled", lambda scene: Built())
    model = ports.PortedModel(SCENE, Setting(family, {"step": 0.01})).model
    assert applied == [0.0] and model.opt.timestep == 0.01
    if family == "defaults":
        assert (model.eq_solref == soft).all()
        return
    assert model.eq_solref.tolist() == [[0.02, 1.0]] and model.eq_solimp[0].tolist() == [*ports.STIFFEST]
    kinds = mujoco.mjtIntegrator
    assert model.opt.integrator == (kinds.mjINT_EULER if family == "euler" else kinds.mjINT_RK4)


# --- projection -------------------------------------------------------------------------------------------
def failed(call: Any, *given: Any) -> tuple[Outcome, float, str]:
    with pytest.raises(Failed) as caught:
        call(*given)
    return caught.value.outcome, caught.value.t, str(caught.value)


def test_masses_and_closures_that_are_not_finite() -> None:
    """One entry is enough."""
    masses = np.diag([4.0, 9.0])

    def full(model: Any, data: Any, mass: np.ndarray) -> None:
        mass[:] = masses

    library, model = SimpleNamespace(mj_fullM=full), SimpleNamespace(nv=2)
    root = projection._root_of_mass(library, model, None, 0.5)
    assert root.tolist() == [[2.0, 0.0], [0.0, 3.0]]
    masses[1, 0] = np.nan
    said = Outcome.NOT_FINITE, 0.5, "the state is not finite at 0.5 s"
    assert failed(projection._root_of_mass, library, model, None, 0.5) == said
    rows, wanted = np.array([[1.0, 2.0], [0.0, 0.0]]), np.array([3.0, 0.0])
    share = 3.0 / (1 / 4 + 4 / 9)
    found = projection._least(root, rows, wanted, 0.5)
    assert found == pytest.approx([share / 4, 2 * share / 9])
    said = Outcome.NOT_FINITE, 0.5, "the closure errors are not finite at 0.5 s"
    for place in ((rows, (1, 1)), (wanted, (1,))):
        array, at = place
        before, array[at] = array[at], np.inf
        assert failed(projection._least, root, rows, wanted, 0.5) == said
        array[at] = before


@pytest.mark.parametrize("extent", [0.5, 1.0, 4.0])
def test_rows_of_rounding_are_zero(extent: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows up to a quarter of the extent, or of 1 m where it is smaller."""
    monkeypatch.setattr(projection, "NOTHING", 0.25)
    limit = 0.25 * max(1.0, extent)
    rows = np.array([[limit, 0.1, 0.0], [0.1, -1.1 * limit, 0.0]])
    assert projection._unrounded(rows, extent).tolist() == [[0.0, 0.0, 0.0], rows[1].tolist()]
    assert projection._unrounded(np.zeros((0, 3)), extent).shape == (0, 3)


# --- scenes in a plane ------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Found:
    """A trajectory by its scene and its reactions."""

    scene: Scene
    reactions: str | None = "reactions"


def test_compiled_families_run_the_scene_in_its_plane(monkeypatch: pytest.MonkeyPatch) -> None:
    """The planar scene has other joints; their reactions are not reactions of the scene."""
    plane = SCENE.with_(name="plane")

    class Run:
        def __init__(self, scene: Scene, setting: Setting) -> None:
            self.scene, self.counts, self.advance, self.sample = scene, None, None, None

        def installed(self) -> Any:
            return contextlib.nullcontext()

        def integrated(self, *given: Any) -> Found:
            return Found(self.scene)

        def without_python(self, *given: Any) -> Found:
            return Found(self.scene)

    for place, engine in ((adapter, adapter.ENGINE), (of_pinocchio, of_pinocchio.ENGINE)):
        monkeypatch.setattr(place, "Simulation", Run)
        monkeypatch.setattr(place, "planar_scene", lambda scene: plane)
        monkeypatch.setattr(place, "run_through", lambda scene, *given: Found(scene))
        monkeypatch.setattr(type(engine), "version", lambda self: "1")
        found: Any = engine.run(SCENE, np.zeros(1), Setting(place.COMPILED[0], {}))
        assert found == Found(plane, None)
        found = engine.run(SCENE, np.zeros(1), Setting("tuned", {}))
        assert found == Found(SCENE)
        found = engine.run(plane, np.zeros(1), Setting(place.COMPILED[0], {}))
        assert found == Found(plane)


def test_the_coarse_run_of_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """41 samples of the tuned family; closure errors decay within two steps."""
    asked: list[Any] = []
    monkeypatch.setattr(adapter.MuJoCo, "run", lambda self, *given: asked.append(given))
    adapter.ENGINE._coarse(SCENE, 0.01)
    [(scene, times, setting)] = asked
    assert scene is SCENE and times == pytest.approx(np.linspace(0.0, 2.0, adapter.SCOUT_SAMPLES))
    assert setting == Setting("tuned", {"step": 0.01, "beta": 50.0, "hard": families.HARD})


@pytest.mark.parametrize("family", ["tuned", "other"])
def test_families_that_mujoco_serves(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(
        adapter.MuJoCo, "settings", lambda self, scene: asked.append(1) or [Setting("stock", {})]
    )
    assert adapter.ENGINE.serves(SCENE, family) is (family == "tuned")
    assert adapter.ENGINE.serves(SCENE, "stock") and len(asked) == (1 if family == "tuned" else 2)


def test_rates_of_a_state_by_mujoco() -> None:
    """A rod of 2 kg and 0.5 kg m² beside its hinge, 1 m away: (0.5 + 2) q'' = -18 cos q, whatever the data
    had before."""
    scene = SCENE.with_(joint=(HINGE,))
    options = {"rtol": 1e-6, "min_step": 1e-6, "beta": 5.0, "hard": 1e-7}
    run = simulation.Simulation(scene, Setting("forward", options))
    for q, rate in ((0.0, 0.0), (0.5, 2.0), (-1.0, 3.0)):
        found = run._rhs(0.25, np.array([q, rate]))
        assert found == pytest.approx([rate, -18.0 * np.cos(q) / 2.5], rel=1e-6)
        assert run.data.time == 0.25


@pytest.mark.parametrize("inertia", [(1.0, 2.0, 3.0), (0.5, 2.0, 2.5), (1.0, 2.0, 7.0)])
def test_the_largest_moment_is_less_than_the_sum(inertia: tuple[float, ...]) -> None:
    """By the last digits, since the compiler of MJCF compares with rounding."""
    body: Any = SimpleNamespace()
    link: Any = SimpleNamespace(inertia=np.diag(inertia), mass=3.0, offset=np.zeros(3))
    writing._true_inertia(body, link)
    total = body.inertia[0] + body.inertia[1]
    assert body.inertia[2] < total and body.inertia[2] == pytest.approx(total, rel=1e-14)


def test_the_second_assembly_of_ondsel_is_tilted(monkeypatch: pytest.MonkeyPatch) -> None:
    library = SimpleNamespace(solve_asmt_raw="solve")
    monkeypatch.setitem(sys.modules, "pyondsel", SimpleNamespace(solve_raw=library))
    monkeypatch.setitem(sys.modules, "pyondsel.solve_raw", library)
    monkeypatch.setattr(ondsel, "Assembly", lambda scene, tilted=False: (scene, tilted))
    made = ondsel._OndselSimulation(SCENE, np.array([0.0, 1.0]), 0.25)
    assert made.assemblies == [(SCENE, False), (SCENE, True)] and made.solve == "solve"
    assert made.step == 0.25 and made.times.tolist() == [0.0, 1.0] and made.hindered is False
    assert made.samples == {} and made.pose[0].tolist() == [[1.0, 0.0, 0.0]]
