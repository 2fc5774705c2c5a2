"""Runs whose stepping is one call of compiled code / what they hand over and what they make of the answer."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pinocchio
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.casadi import adapter as casadi_adapter
from crosscheck.engines.casadi import library as casadi_library
from crosscheck.engines.compiled import run as compiled
from crosscheck.engines.heyoka import adapter as heyoka
from crosscheck.engines.mujoco import compiled_run as of_mujoco
from crosscheck.engines.mujoco import context as contexts
from crosscheck.engines.mujoco.context import Context
from crosscheck.engines.mujoco.families import NEWTON, PROJECTED_COMPILED
from crosscheck.engines.mujoco.model import compiled as built_by_mujoco
from crosscheck.engines.pinocchio import adapter as pinocchio_adapter
from crosscheck.engines.pinocchio import compiled_run as of_pinocchio
from crosscheck.engines.pinocchio import library
from crosscheck.engines.pinocchio.model import Loads, Mechanism
from crosscheck.engines.pinocchio.simulation import Simulation
from crosscheck.engines.sampling import Failed, Sample
from mbref.scene import (
    Body,
    Driver,
    Force,
    JointTorque,
    Moment,
    Revolute,
    Scene,
    Spherical,
    TorsionSpring,
    Translational,
)
from mbref.trajectory import Outcome

BODY = Body(name="b", mass=4.0, inertia=(1.0, 2.0, 2.5), position=(1.0, 0.0, 0.0))
HINGE = Revolute(name="H", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
DRIVER = Driver(joint="H", polynomial=(0.0, 2.0, 3.0))
TURNING = BODY.model_copy(update={"velocity": (0.0, 3.0, 0.0), "angular_velocity": (0.0, 0.0, 3.0)})


def scene(**parts: Any) -> Scene:
    given = {"name": "s", "body": (BODY,), "joint": (HINGE,), "duration": 2.0, "gravity": (0.0, -9.0, 0.0)}
    return Scene(**{**given, **parts})


def at(t: float) -> Sample:
    zero = np.zeros((1, 3))
    return Sample(np.full((1, 3), t), np.array([[1.0, 0, 0, 0]]), zero, zero, zero, zero)


# --- The call of an integrator ----------------------------------------------------------------------------
LABELS = {"engine": "e", "version": "1", "method": "m", "settings": {}}


@pytest.mark.parametrize(
    ("status", "outcome", "says"),
    [
        (1, Outcome.NOT_FINITE, "the motion is not finite after 0.75 s"),
        (3, Outcome.STEP_FAILED, "7 steps have only reached 0.75 s"),
    ],
)
def test_samples_of_a_call_and_its_end(
    status: int, outcome: Outcome, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two of three samples are reached after the start."""
    loaded: list[Any] = []

    def stepped(system: Any, times: np.ndarray, samples: np.ndarray, memory: Any) -> tuple[int, int]:
        assert system == "system" and times.tolist() == [0.0, 0.5, 1.0] and samples.shape == (3, 2)
        samples[:] = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]
        memory.counts[:], memory.clock[0] = (7, 1, 2), 0.75
        return status, 2

    monkeypatch.setattr(compiled, "_stepped", stepped)
    found = compiled.trajectory(
        scene(),
        np.array([0.0, 0.5, 1.0]),
        "system",  # type: ignore[arg-type]
        np.array([8.0, 9.0]),
        lambda t, y: loaded.append((t, y.tolist())),
        at,
        0.25,
        LABELS,
    )
    assert loaded == [(0.0, [8.0, 9.0]), (0.5, [3.0, 4.0])]
    assert (found.outcome, found.t_end, found.message) == (outcome, 0.75, says)
    assert found.times.tolist() == [0.0, 0.5] and found.position[:, 0, 0].tolist() == [0.0, 0.5]
    assert (found.cost.steps, found.cost.rejected, found.cost.rhs) == (7, 1, 2)
    assert found.cost.build_seconds == 0.25 and 0.0 <= found.cost.seconds < 60.0


# --- MuJoCo's context -------------------------------------------------------------------------------------
LUMP = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
MIXED = f"""<mujoco><worldbody><body><freejoint/>{LUMP}</body>
<body name="p"><joint type="ball"/>{LUMP}</body><body name="q" pos="0 0 3"><joint name="h"/>{LUMP}</body>
</worldbody><equality><connect body1="p" body2="q" anchor="0 0 1"/></equality></mujoco>"""


def reals(address: int, count: int) -> list[float]:
    return list((ctypes.c_double * count).from_address(address))


def integers(address: int, count: int) -> list[int]:
    return list((ctypes.c_int64 * count).from_address(address))


@pytest.fixture
def mixed() -> tuple[Any, Any, Context]:
    """The context of a free body, a ball and a driven hinge."""
    model = mujoco.MjModel.from_xml_string(MIXED)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    sine = {"amplitude": 0.5, "frequency": 4.0, "phase": math.pi}
    drivers = [(2, DRIVER), (2, DRIVER.model_copy(update={"polynomial": (0.0,), "sine": sine}))]
    drivers[1] = (2, Driver(joint="H", polynomial=(0.0, 7.0), sine=sine))
    return model, data, contexts.context(model, data, drivers)


def test_places_of_coordinates(mixed: tuple[Any, Any, Context]) -> None:
    _, _, found = mixed
    c = found.numbers.tolist()
    assert (c[contexts.NQ], c[contexts.NV]) == (12, 10) and len(c) == contexts.WIDTH == 28
    assert c[contexts.SINGLES] == 4 and c[contexts.TURNS] == 2
    assert integers(c[contexts.SINGLE], 8) == [0, 0, 1, 1, 2, 2, 11, 9]
    assert integers(c[contexts.TURN], 4) == [3, 3, 7, 6] and found.quaternions.tolist() == [3, 7]
    assert found.address == found.numbers.ctypes.data


def test_addresses_of_mujoco_s_data(mixed: tuple[Any, Any, Context]) -> None:
    _, data, found = mixed
    c = found.numbers.tolist()
    for place, array in (
        (contexts.QPOS, data.qpos),
        (contexts.QVEL, data.qvel),
        (contexts.QACC, data.qacc),
        (contexts.FORCE, data.qfrc_applied),
    ):
        assert c[place] == array.ctypes.data
    assert ctypes.c_int.from_address(c[contexts.COUNT]).value == data.ne == 3
    assert ctypes.c_size_t.from_address(c[contexts.RESIDUALS]).value == data.efc_pos.ctypes.data
    assert ctypes.c_size_t.from_address(c[contexts.JACOBIAN]).value == data.efc_J.ctypes.data
    functions = [c[k] for k in range(7)]
    assert functions == [contexts.function(name) for name in contexts.FUNCTIONS] and len({*functions}) == 7
    assert c[contexts.MODEL] == mixed[0]._address and c[contexts.DATA] == data._address


def test_memory_of_closures(mixed: tuple[Any, Any, Context]) -> None:
    """At most 7 rows for each equality; entries below 1e-12 of the extent, of 1 m at least, are rounding."""
    model, data, found = mixed
    c = found.numbers.tolist()
    assert c[contexts.MOST_ROWS] == 7 and c[contexts.WEIGHTED] == 1
    size = 7 * 11 + 10 * 12 + 1
    assert found.kept[-1].shape == (size,) and found.kept[-1].ctypes.data == c[contexts.WORK]
    assert model.stat.extent > 1.0 and found.kept[-1][-1] == pytest.approx(1e-12 * model.stat.extent)
    model.stat.extent = 0.5
    plain = contexts.context(model, data, [], is_weighted=False)
    assert plain.kept[-1][-1] == 1e-12 and plain.numbers[contexts.WEIGHTED] == 0
    assert plain.numbers[contexts.DRIVES] == 0 and plain.numbers[contexts.DRIVE_WIDTH] == 6


def test_numbers_of_drivers(mixed: tuple[Any, Any, Context]) -> None:
    """Places, 1e15 mean inertias, amplitude, frequency and phase, then the polynomial with zeros behind."""
    model, _, found = mixed
    c = found.numbers.tolist()
    assert (c[contexts.DRIVES], c[contexts.DRIVE_WIDTH]) == (2, 9)
    heavy = 1e15 * model.stat.meaninertia
    rows = np.array(reals(c[contexts.DRIVE], 18)).reshape(2, 9)
    assert rows[0] == pytest.approx([11, 9, heavy, 0, 0, 0, 0, 2, 3])
    assert rows[1] == pytest.approx([11, 9, heavy, 0.5, 4.0, math.pi, 0, 7, 0])
    assert model.dof_armature[9] == heavy and not model.dof_armature[:9].any()


def test_the_library_of_mujoco(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = contexts.library(Path(mujoco.__file__).parent)
    address = ctypes.cast(ctypes.CDLL(str(found)).mj_forward, ctypes.c_void_p).value
    assert contexts.function("mj_forward") == address and contexts.function("mj_comPos") != address
    for maps, is_there in (
        ([SimpleNamespace(path="/x/libmujoco.so.9")], True),
        ([SimpleNamespace(path="/x/y")], False),
    ):
        monkeypatch.setattr(
            contexts.psutil, "Process", lambda maps=maps: SimpleNamespace(memory_maps=lambda: maps)
        )
        if is_there:
            assert contexts.library(tmp_path) == Path("/x/libmujoco.so.9")
        else:
            with pytest.raises(
                FileNotFoundError, match="Reinstall the package mujoco, or use another family"
            ):
                contexts.library(tmp_path)
    monkeypatch.setattr(contexts.psutil, "Process", SimpleNamespace)
    with pytest.raises(FileNotFoundError):
        contexts.library(tmp_path)
    for name in ("libmujoco.so.2", "libmujoco.so.1", "mujoco.dll"):
        (tmp_path / name).touch()
    assert contexts.library(tmp_path) == tmp_path / "libmujoco.so.1"


# --- MuJoCo's runs ----------------------------------------------------------------------------------------
def test_drivers_of_a_compiled_run_are_coordinates(monkeypatch: pytest.MonkeyPatch) -> None:
    given = scene(driver=(DRIVER,))
    built = built_by_mujoco(given)
    data = mujoco.MjData(built.model)
    data.qpos[0], data.qvel[0] = 0.25, 2.0
    asked: list[Any] = []

    def context(model: Any, data: Any, drivers: Any, is_weighted: bool) -> str:
        asked.append((model, data, drivers, is_weighted))
        return "context"

    monkeypatch.setattr(contexts, "context", context)
    for family, is_weighted in ((PROJECTED_COMPILED, True), (NEWTON, False)):
        found = of_mujoco.compiled_run(given, built, data, family, {"rtol": 1e-6}, 0.5)
        assert asked.pop() == (built.model, data, [(0, DRIVER)], is_weighted)
        assert (found.family, found.options, found.context, found.longest) == (
            family,
            {"rtol": 1e-6},
            "context",
            0.5,
        )
        assert found.start.tolist() == [0.25, 2.0] and data.eq_active.tolist() == [0]
    with pytest.raises(
        ValueError, match="newton, compiled cannot run s: joints and drivers do not prescribe"
    ):
        of_mujoco.compiled_run(scene(), built_by_mujoco(scene()), data, NEWTON, {}, 0.5)
    of_mujoco.compiled_run(scene(), built_by_mujoco(scene()), data, PROJECTED_COMPILED, {}, 0.5)


@pytest.mark.parametrize(("family", "kind"), [(NEWTON, "newton"), (PROJECTED_COMPILED, "dop853")])
def test_a_compiled_run_steps_and_loads_its_states(
    family: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from crosscheck.engines.mujoco import rates

    run = of_mujoco.CompiledRun(family, {}, "context", np.array([1.0, 2.0]), 0.5)  # type: ignore[arg-type]
    monkeypatch.setattr(of_mujoco.CompiledRun, "_newton", lambda self: "newton")
    monkeypatch.setattr(of_mujoco.CompiledRun, "_dop853", lambda self: "dop853")
    loaded: list[Any] = []
    monkeypatch.setattr(rates, "load", lambda *given: loaded.append(given))

    def trajectory(*given: Any) -> Any:
        given[4](0.25, "state")
        return given[:4] + given[5:]

    monkeypatch.setattr(compiled, "trajectory", trajectory)
    found = run.trajectory("scene", "times", "sample", 3.0, LABELS)  # type: ignore[arg-type]
    assert found == ("scene", "times", kind, run.start, "sample", 3.0, LABELS)  # type: ignore[comparison-overlap]
    assert loaded == [("context", 0.25, "state")]


# --- Pinocchio's runs -------------------------------------------------------------------------------------
def numbers(pointer: ctypes.c_void_p, count: int) -> list[float]:
    return reals(int(pointer.value or 0), count)


class Library:
    """Records what a mechanism hands over to the compiled library."""

    def __init__(self, address: int = 77) -> None:
        self.opened: dict[str, Any] = {}
        self.drives: list[Any] = []
        self.twists: list[Any] = []
        self.open_mechanism: Any = lambda *given: self._open(address, *given)

    def _open(self, address: int, *given: Any) -> int:
        counts = integers(int(given[0].value or 0), 2)
        self.opened = {
            "counts": counts,
            "joints": numbers(given[1], 21 * counts[0]),
            "closures": numbers(given[2], 9 * counts[1]),
            "gravity": numbers(given[3], 3),
            "constant": numbers(given[4], 1),
            "armature": numbers(given[5], 1),
            "solver": numbers(given[6], 5),
        }
        return address

    def close_mechanism(self, address: Any) -> None:
        pass

    def add_drive(self, address: Any, drive: Any, count: Any, polynomial: Any) -> None:
        self.drives.append((address.value, numbers(drive, 6), numbers(polynomial, count.value)))

    def add_twist(self, address: Any, twist: Any) -> None:
        self.twists.append((address.value, numbers(twist, 5)))


SOLVER = of_pinocchio.Solver(1e-9, 1e-7, 5, 0.5, 1e-12)


def compiled_mechanism(
    given: Scene, made: Library, monkeypatch: pytest.MonkeyPatch
) -> of_pinocchio.CompiledRun:
    monkeypatch.setattr(library, "library", lambda: made)
    mechanism = Mechanism(given)
    return of_pinocchio.CompiledRun(mechanism, Loads(mechanism), SOLVER)


def test_a_mechanism_is_handed_over_with_its_drivers_and_springs(monkeypatch: pytest.MonkeyPatch) -> None:
    loads = (
        TorsionSpring(joint="H", stiffness=3.0, damping=0.25, natural_angle=0.5),
        JointTorque(joint="H", torque=7.0),
    )
    made = Library()
    compiled_mechanism(scene(load=loads, driver=(DRIVER,)), made, monkeypatch)
    assert made.opened["counts"] == [1, 0] and made.opened["gravity"] == [0.0, -9.0, 0.0]
    assert made.opened["constant"] == [7.0] and made.opened["armature"] == [1e18]
    assert made.opened["solver"] == [1e-9, 1e-7, 5.0, 0.5, 1e-12]
    assert made.opened["joints"][:12] == [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0, 1.0, 0.0, 0.0]
    assert made.drives == [(77, [0.0, 0.0, 1e18, 0.0, 0.0, 0.0], [0.0, 2.0, 3.0])]
    assert made.twists == [(77, [0.0, 0.0, 3.0, 0.5, 0.25])]
    with pytest.raises(ValueError, match="Pinocchio refuses the mechanism s"):
        compiled_mechanism(scene(), Library(0), monkeypatch)


def test_quaternions_of_a_mechanism_are_in_its_coordinates(monkeypatch: pytest.MonkeyPatch) -> None:
    bodies = tuple(BODY.model_copy(update={"name": name}) for name in "bcd")
    ball = Spherical(name="B", bodies=("ground", "c"), anchor=(0.0, 0.0, 0.0))
    made = Library()
    found = compiled_mechanism(scene(body=bodies, joint=(HINGE, ball)), made, monkeypatch)
    kinds = [row[0] for row in np.array(made.opened["joints"]).reshape(-1, 21)]
    assert sorted(kinds) == [0.0, 2.0, 3.0]
    place, wanted = 0, []
    for kind in kinds:
        wanted += {0.0: [], 2.0: [place], 3.0: [place + 3]}[kind]
        place += {0.0: 1, 2.0: 4, 3.0: 7}[kind]
    assert found.quaternions.tolist() == wanted


@pytest.mark.parametrize("is_projected", [True, False])
def test_a_compiled_mechanism_steps_by_dop853(is_projected: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Library()
    run = compiled_mechanism(scene(body=(TURNING,)), made, monkeypatch)
    run._function = lambda name: {"rates": 11, "settle": 22}[name]  # type: ignore[method-assign]
    monkeypatch.setattr(compiled, "trajectory", lambda *given: given)
    options = {"rtol": 1e-6, "min_step": 1e-4}
    given: Any = run.trajectory("times", options, is_projected, 0.5, "load", "sample", 3.0, LABELS)  # type: ignore[arg-type]
    system, start = given[2], given[3]
    assert (given[0].name, given[1], *given[4:]) == ("s", "times", "load", "sample", 3.0, LABELS)
    assert system[:2] == (11, 77) and system.quaternions.tolist() == []
    assert system[3:] == (1e-6, 1e-6, 1e-4, 0.5, 10**6, 22 if is_projected else 0)
    assert start == pytest.approx([0.0, 3.0])


def test_loads_that_compiled_code_does_not_have(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "why_not", lambda: "")
    pull = Force(body="b", point=(1.0, 0.0, 0.0), force=(0.0, 1.0, 0.0))
    moment = Moment(body="b", moment=(0.0, 0.0, 1.0))
    assert of_pinocchio.why_not(scene(load=(moment,))) == ""
    reason = "load[1] of type 'force' is not mapped to compiled code"
    assert of_pinocchio.why_not(scene(load=(moment, pull))) == reason
    monkeypatch.setattr(library, "why_not", lambda: "no compiler")
    assert of_pinocchio.why_not(scene(load=(pull,))) == "no compiler"
    made: list[str] = []
    monkeypatch.setattr(compiled, "prepare", lambda: made.append("integrators"))
    monkeypatch.setattr(library, "library", lambda: made.append("library"))
    of_pinocchio.prepare()
    assert made == ["integrators", "library"]
    monkeypatch.setattr(of_pinocchio, "prepare", lambda: made.append("prepared"))
    pinocchio_adapter.ENGINE.prepare(["tuned"])
    assert len(made) == 2
    pinocchio_adapter.ENGINE.prepare(["tuned", "tuned, compiled"])
    assert made[2:] == ["prepared"]


@pytest.mark.parametrize(("family", "is_projected"), [("tuned, compiled", True), ("dop853, compiled", False)])
def test_a_run_without_python(family: str, is_projected: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    options = {"rtol": 1e-6, "min_step": 1e-4, **({} if is_projected else {"beta": 0.5})}
    found = Simulation(scene(driver=(DRIVER,)), Setting("dop853", options))
    seen: list[Any] = []

    class Run:
        def __init__(self, *given: Any) -> None:
            seen.append(given)

        def trajectory(self, *given: Any) -> Any:
            seen.append(given)
            given[4](0.5, "state")
            return "trajectory"

    monkeypatch.setattr(of_pinocchio, "CompiledRun", Run)
    monkeypatch.setattr("time.process_time", lambda: 9.0)
    times = np.zeros(2)
    assert found.without_python(times, Setting(family, options), 2.0, LABELS) == "trajectory"
    mechanism, loads, solver = seen[0]
    assert (mechanism, loads) == (found.mechanism, found.loads)
    assert solver == (
        1e-9,
        1e-7,
        5,
        0.0 if is_projected else 0.5,
        pytest.approx(1e-12 * max(1.0, found.least * 1e12)),
    )
    given = seen[1]
    assert given[0] is times and given[1:3] == (options, is_projected) and given[6:] == (7.0, LABELS)
    assert given[3] == pytest.approx(0.25 / 14.0) and given[5] == found.sample  # 2 + 6 t is 14 rad/s at 2 s
    assert found.y == "state"  # type: ignore[comparison-overlap]


def test_states_of_pinocchio_are_normalised_and_driven() -> None:
    ball = Spherical(name="B", bodies=("ground", "c"), anchor=(0.0, 0.0, 0.0))
    bodies = (BODY, BODY.model_copy(update={"name": "c"}))
    options = {"rtol": 1e-6, "min_step": 1e-4}
    found = Simulation(scene(body=bodies, joint=(HINGE, ball), driver=(DRIVER,)), Setting("dop853", options))
    assert not found.flat and found.nq == 5 and len(found.free) == 3
    [(iq, iv, _)] = found.driven
    y = np.arange(1.0, 10.0)
    q, v = found.split(0.5, y)
    assert q[iq] == pytest.approx(1.0 + 0.75) and v[iv - 5] == pytest.approx(2.0 + 3.0)
    assert y.tolist() == np.arange(1.0, 10.0).tolist()
    rest = np.delete(q, iq)
    assert (
        np.linalg.norm(rest) == pytest.approx(1.0)
        and np.delete(v, iv - 5).tolist() == np.delete(y[5:], iv - 5).tolist()
    )
    assert found.on_spheres(0.5, y) == pytest.approx(np.concatenate((q, v)))
    flat = Simulation(scene(), Setting("dop853", options))
    state = np.array([3.0, 4.0])
    assert flat.flat and flat.on_spheres(0.5, state) is state and flat._max_step() == math.inf
    assert flat.rhs(0.0, np.array([0.0, 4.0])) == pytest.approx([4.0, -36.0 / 6.5])
    with pytest.raises(ValueError, match="pinocchio has no family of settings 'quick'"):
        Simulation(scene(), Setting("quick", {}))
    lost = Simulation(scene(), Setting("defaults", {"step": 0.5}))
    lost.y[:] = math.nan
    with pytest.raises(Failed, match=r"not finite at 0\.5 s: the default solver settings fail") as failed:
        lost.advance(0.5, 1.0)
    assert failed.value.outcome is Outcome.NOT_FINITE and failed.value.t == 0.5


def test_states_of_pinocchio_are_moved_onto_the_closures() -> None:
    """A body on a hinge and on a slide along x at its tip: the tip at (1, 0) comes to y = 0."""
    rail = Translational(name="S", bodies=("ground", "c"), anchor=(2.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    pin = Revolute(name="P", bodies=("b", "c"), anchor=(2.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    bodies = (BODY, BODY.model_copy(update={"name": "c", "position": (2.0, 0.0, 0.0)}))
    options = {"rtol": 1e-6, "min_step": 1e-4}
    found = Simulation(scene(body=bodies, joint=(HINGE, pin, rail)), Setting("tuned", options))
    assert len(found.closures) == 1
    moved = found.projected(0.0, found.y + 1e-3)
    residual, jacobian = found.closure_errors(moved[: found.nq])
    assert np.abs(residual).max() < 1e-12 and np.abs(jacobian @ moved[found.nq :]).max() < 1e-12
    same = found.projected(0.0, moved)
    assert same == pytest.approx(moved, abs=1e-12)
    with pytest.raises(Failed, match=r"the state is not finite at 0\.5 s"):
        found._root_of_mass(0.5, np.full(found.nq, math.nan))
    root, bad = np.eye(len(found.free)), np.full((1, found.model.nv), math.nan)
    with pytest.raises(Failed, match=r"the closure errors are not finite at 0\.5 s"):
        found._least_change(0.5, root, bad, np.zeros(1))


def test_the_coarse_run_of_pinocchio() -> None:
    class Seen(pinocchio_adapter.Pinocchio):
        def run(self, scene: Scene, times: np.ndarray, setting: Setting) -> Any:
            return times, setting

    times, setting = Seen()._coarse(scene(), 0.25)  # type: ignore[misc]
    assert times == pytest.approx(np.linspace(0.0, 2.0, 41))
    assert setting == Setting("tuned", {"rtol": 1e-5, "min_step": 0.25})
    assert pinocchio.__version__ == pinocchio_adapter.ENGINE.version()
    run = pinocchio_adapter.ENGINE.run(
        scene(), np.array([0.0, 0.5]), Setting("tuned", {"rtol": 1e-6, "min_step": 1e-3})
    )
    assert (run.engine, run.method, run.settings) == ("pinocchio", "tuned", {"rtol": 1e-6, "min_step": 1e-3})
    assert run.outcome is Outcome.COMPLETED and run.times.tolist() == [0.0, 0.5]


@pytest.fixture
def versions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Engines that need not be installed: each package has the version 1."""
    monkeypatch.setattr("crosscheck.engine.metadata.version", lambda package: "1")


# --- heyoka -----------------------------------------------------------------------------------------------
class Integrator:
    """Answers with states of the hinge, and the end of the last step."""

    def __init__(self, states: Any, steps: int = 7, time: float = 0.75) -> None:
        self.states, self.steps, self.ended = np.array(states, dtype=float), steps, time
        self.time, self.state = 9.0, np.zeros(2)

    def propagate_grid(self, grid: np.ndarray, max_delta_t: float, max_steps: int) -> Any:
        self.asked = grid.tolist(), max_delta_t, max_steps, self.time, self.state.tolist()
        self.time = self.ended
        return SimpleNamespace(name="time_limit"), 0.1, 0.2, self.steps, None, self.states


def test_states_at_the_samples_of_heyoka() -> None:
    found = Integrator([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])
    states, ending, steps = heyoka._propagated(found, np.array([0.0, 0.5, 0.75]), np.zeros(2))
    assert states.tolist() == [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]] and (ending, steps) == ("time_limit", 7)
    assert found.asked[:3] == ([0.0, 0.5, 0.75], 0.5, 10**6)
    states, *_ = heyoka._propagated(found, np.array([0.25, 0.75]), np.zeros(2))
    assert states.tolist() == [[2.0, 3.0], [4.0, 5.0]] and found.asked[0] == [0.0, 0.25, 0.75]
    only = heyoka._propagated(found, np.array([0.0]), np.array([8.0, 9.0]))
    assert only[0].tolist() == [[8.0, 9.0]] and only[1:] == ("", 0)


@pytest.mark.usefixtures("versions")
@pytest.mark.parametrize("last", [math.nan, 3.0])
def test_a_run_of_heyoka(last: float, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Integrator([[0.0, 3.0], [math.pi / 2, 3.0], [math.pi, last]])
    asked: list[Any] = []
    monkeypatch.setattr(heyoka, "_integrator", lambda scene, rtol: asked.append(rtol) or made)
    given = scene(body=(TURNING,))
    found = heyoka.ENGINE.run(given, np.array([0.0, 0.5, 1.0]), Setting("taylor", {"rtol": 1e-6}))
    assert asked == [1e-6] and made.asked[3:] == (0.0, [0.0, pytest.approx(3.0)])
    assert found.cost.steps == 7 and found.engine == "heyoka" and found.method == "taylor"
    assert found.position[1, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert found.velocity[1, 0] == pytest.approx([-3.0, 0.0, 0.0], abs=1e-15)
    if math.isnan(last):
        assert (found.outcome, found.t_end, len(found.times)) == (Outcome.STEP_FAILED, 0.75, 2)
        assert found.message == "the integrator ended at 0.75 s with time_limit"
    else:
        assert found.outcome is Outcome.COMPLETED and len(found.times) == 3
    with pytest.raises(ValueError, match="heyoka has no family of settings 'x'"):
        heyoka.ENGINE.run(given, np.zeros(1), Setting("x", {}))


@pytest.mark.usefixtures("versions")
def test_a_state_that_is_lost_ends_the_run_of_heyoka(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Integrator([[0.0, 3.0], [math.nan, 3.0], [1.0, 3.0]])
    monkeypatch.setattr(heyoka, "_integrator", lambda scene, rtol: made)
    found = heyoka.ENGINE.run(scene(), np.array([0.0, 0.5, 1.0]), Setting("taylor", {"rtol": 1e-6}))
    assert len(found.times) == 1 and found.outcome is Outcome.STEP_FAILED


def test_equations_for_heyoka(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pendulum of 4 kg at 1 m with 6.5 kg m² about its hinge: q'' = -36 cos q / 6.5."""
    import sys

    module = SimpleNamespace(
        sin=math.sin,
        cos=math.cos,
        make_vars=lambda *names: {"y0": 0.5, "y1": 3.0}[names[0]] if len(names) == 1 else [0.5, 3.0],
        expression=float,
        taylor_adaptive=lambda system, start, tol: (system, start, tol),
    )
    monkeypatch.setitem(sys.modules, "heyoka", module)
    system, start, tolerance = heyoka._made(scene(body=(TURNING,)), 1e-9)
    assert [symbol for symbol, _ in system] == [0.5, 3.0] and tolerance == 1e-9
    assert [rate for _, rate in system] == pytest.approx([3.0, -36.0 * math.cos(0.5) / 6.5])
    assert start == pytest.approx([0.0, 3.0])


def test_an_integrator_of_heyoka_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "heyoka", SimpleNamespace(__version__="1"))
    made: list[Any] = []
    monkeypatch.setattr(heyoka, "_made", lambda scene, rtol: made.append(rtol) or {"rtol": rtol})

    def made_once(folder: str, origin: str, suffix: str, make: Any) -> Path:
        path = tmp_path / f"{folder}{origin}{suffix}"
        if not path.exists():
            make(path)
        return path

    monkeypatch.setattr(heyoka, "kept", SimpleNamespace(made_once=made_once))
    for _ in range(2):
        heyoka._integrator.cache_clear()
        assert heyoka._integrator(scene(), 1e-3) == {"rtol": 1e-3}
    assert heyoka._integrator(scene(), 1e-4) == {"rtol": 1e-4} and made == [1e-3, 1e-4]
    heyoka._integrator.cache_clear()
    assert {path.suffix for path in tmp_path.iterdir()} == {".pickle"}


# --- CasADi -----------------------------------------------------------------------------------------------
class Integrate:
    """Stands for the compiled library of a scene; writes states and counts."""

    def __init__(self, states: Any, reached: int, status: int = 0) -> None:
        self.states, self.reached, self.status = np.array(states, dtype=float), reached, status
        self.asked: list[Any] = []

    def integrate(self, *given: Any) -> int:
        count = given[2].value
        start, times = numbers(given[0], 2), numbers(given[1], count)
        self.asked.append((start, times, given[3].value, given[4].value, given[5].value))
        ctypes.memmove(given[6], self.states.ctypes.data, self.states.nbytes)
        counts = np.array([7, 1, 2, self.reached], dtype=np.int64)
        ctypes.memmove(given[7], counts.ctypes.data, counts.nbytes)
        ctypes.memmove(given[8], np.array([0.75]).ctypes.data, 8)
        return self.status


@pytest.mark.usefixtures("versions")
@pytest.mark.parametrize(("family", "is_projected"), [("projected, compiled", 1), ("dop853, compiled", 0)])
def test_a_run_of_casadi(family: str, is_projected: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Integrate([[0.0, 3.0], [math.pi / 2, 3.0], [0.0, 0.0]], 2, 2)
    asked: list[float] = []
    monkeypatch.setattr(casadi_adapter, "library", lambda scene, beta: asked.append(beta) or made)
    options = {"rtol": 1e-6, "min_step": 1e-4, **({} if is_projected else {"beta": 0.5})}
    found = casadi_adapter.ENGINE.run(
        scene(body=(TURNING,)), np.array([0.0, 0.5, 1.0]), Setting(family, options)
    )
    assert asked == [0.0 if is_projected else 0.5]
    [(start, times, *numbers_of)] = made.asked
    assert start == pytest.approx([0.0, 3.0]) and times == [0.0, 0.5, 1.0]
    assert numbers_of == [1e-6, 1e-4, is_projected]
    assert (found.cost.steps, found.cost.rejected, found.cost.rhs) == (7, 1, 2)
    assert found.velocity[1, 0] == pytest.approx([-3.0, 0.0, 0.0], abs=1e-15) and len(found.times) == 2
    assert found.message == "no step after 0.75 s is short enough for the tolerance" and found.t_end == 0.75
    with pytest.raises(ValueError, match="casadi has no family of settings 'x'"):
        casadi_adapter.ENGINE.run(scene(), np.zeros(1), Setting("x", {}))


def test_the_fastest_rate_of_a_coarse_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rates of samples that were reached and are finite, but at least the rate that the scene states."""
    states = np.zeros((101, 2))
    states[:4] = [[0.0, 3.0], [50.0, -8.0], [1.0, math.nan], [0.0, 99.0]]
    made = Integrate(states, 3)
    asked: list[float] = []
    monkeypatch.setattr(casadi_adapter, "library", lambda scene, beta: asked.append(beta) or made)
    casadi_adapter._fastest.cache_clear()
    assert casadi_adapter._fastest(scene()) == 8.0 and asked == [0.0]
    [(_, times, rtol, shortest, is_projected)] = made.asked
    assert times == pytest.approx(np.linspace(0.0, 2.0, 101).tolist())
    assert (rtol, shortest, is_projected) == (1e-6, pytest.approx(2e-5), 1)
    fast = scene(
        body=(BODY.model_copy(update={"velocity": (0.0, 20.0, 0.0), "angular_velocity": (0.0, 0.0, 20.0)}),)
    )
    assert casadi_adapter._fastest(fast) == pytest.approx(20.0)
    casadi_adapter._fastest.cache_clear()
    monkeypatch.setattr(casadi_adapter, "_fastest", lambda scene: 7.0)
    settings = casadi_adapter.ENGINE.settings(scene())
    rtols = [10.0**-k for k in range(3, 12)]
    assert [s.options["rtol"] for s in settings] == pytest.approx([*rtols, *rtols])
    assert {s.options["min_step"] for s in settings} == {0.0043}
    assert [s.family for s in settings] == ["projected, compiled"] * 9 + ["dop853, compiled"] * 9
    assert [s.options.get("beta") for s in settings] == [None] * 9 + [0.1] * 9


def test_the_library_of_a_scene_is_made_once_for_each_rate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def made_once(folder: str, origin: str, suffix: str, make: Any) -> Path:
        make(tmp_path / "x")
        asked.append((folder, origin, suffix))
        return tmp_path / "x.so"

    monkeypatch.setattr(casadi_library, "kept", SimpleNamespace(made_once=made_once))
    monkeypatch.setattr(casadi_library, "_origin", lambda scene, beta: f"origin {beta}")
    monkeypatch.setattr(casadi_library, "_source", lambda scene, beta: f"source {beta}")
    monkeypatch.setattr(casadi_library, "_compile", lambda text, target: asked.append((text, target)))
    monkeypatch.setattr(casadi_library.ctypes, "CDLL", lambda path: path)
    casadi_library.library.cache_clear()
    assert casadi_library.library(scene(), 0.5) == str(tmp_path / "x.so")  # type: ignore[comparison-overlap]
    assert asked == [("source 0.5", tmp_path / "x"), ("casadi", "origin 0.5", ".so")]
    casadi_library.library.cache_clear()


def test_c_code_of_a_pendulum() -> None:
    """The code has a wrapper for rates and for settled states, the coefficients, and the integrator."""
    pytest.importorskip("casadi")
    text = casadi_library._source(scene(), 0.5)
    assert "#define N 2\n" in text and "static void RATES(" in text and "static void SETTLED(" in text
    assert "#define SETTLE(y) SETTLED(y, y)\n" in text and text.endswith(
        casadi_library.INTEGRATOR.read_text()
    )
    assert text.index("static void RATES(") < text.index("static void SETTLED(")
    assert "#define STAGES 12\n" in casadi_library._tableau()
    assert casadi_library._c(np.array([1.0, 0.5])) == "{1.0, 0.5}"
