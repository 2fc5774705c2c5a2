"""Ends, settings and first calls of engines' runs / what they are given and what they report, by hand."""

from __future__ import annotations

import contextlib
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines import compiler, constraint_equations, generalised_forces, terms
from crosscheck.engines import mbref as of_mbref
from crosscheck.engines.compiled import dop853, newton
from crosscheck.engines.compiled import run as compiled
from crosscheck.engines.exudyn import adapter as exudyn
from crosscheck.engines.exudyn import static
from crosscheck.engines.mujoco import adapter as mujoco
from crosscheck.engines.pinocchio import adapter as pinocchio
from crosscheck.engines.simbody.model import _angles, _joint
from mbref import rotations
from mbref.scene import Body, Driver, Moment, Revolute, Scene
from mbref.trajectory import Outcome

BODY = Body(name="b", mass=2.0, inertia=(0.3, 0.4, 0.5), position=(1.0, 2.0, 3.0))
HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
SCENE = Scene(name="s", body=(BODY,), joint=(HINGE,), duration=2.0, gravity=(0.0, 0.0, -9.0))


# --- terms ------------------------------------------------------------------------------------------------
def failed(call: Any, *given: Any) -> tuple[Outcome, float, str]:
    with pytest.raises(terms.Failed) as caught:
        call(*given)
    return caught.value.outcome, caught.value.t, str(caught.value)


def test_states_of_terms_that_are_not_finite() -> None:
    made: Any = SimpleNamespace(free=np.array([0, 2]))
    mass = np.diag([4.0, np.nan, 9.0])
    root = terms.Simulation._root(made, 0.25, SimpleNamespace(mass=mass))  # type: ignore[arg-type]
    assert root.tolist() == [[2.0, 0.0], [0.0, 3.0]], "a driven coordinate does not count"
    mass[2, 0] = np.inf
    assert failed(terms.Simulation._root, made, 0.25, SimpleNamespace(mass=mass)) == (
        Outcome.NOT_FINITE,
        0.25,
        "the state is not finite at 0.25 s",
    )
    rows = np.array([[2.0, 7.0, 3.0]])
    assert terms.Simulation._spread(made, 0.25, root, rows) == pytest.approx(np.array([[1.0, 1.0]]))
    rows[0, 1] = np.nan
    assert failed(terms.Simulation._spread, made, 0.25, root, rows) == (
        Outcome.NOT_FINITE,
        0.25,
        "the closures are not finite at 0.25 s",
    )


def test_forces_of_terms_that_are_not_finite() -> None:
    """And closures that cannot be met."""
    given = terms.Terms(np.eye(1), np.array([np.inf]), *[np.zeros(1)] * 4)
    made: Any = SimpleNamespace(
        _terms=lambda q, v: given,
        _motion=lambda t, terms_, q, v: "motion",
        _rows=lambda terms_, q, v: SimpleNamespace(drift=np.zeros(1), jacobian=np.ones((1, 1))),
        at=SimpleNamespace(nv=1),
        driven=(),
        _forces=lambda terms_, motion: np.zeros(1),
        _root=lambda t, terms_: np.eye(1),
    )
    assert failed(terms.Simulation.accelerations, made, 1.5, None, None) == (
        Outcome.NOT_FINITE,
        1.5,
        "the forces are not finite at 1.5 s",
    )
    rows = SimpleNamespace(residual=np.array([0.5]), jacobian=np.ones((1, 1)))
    made = SimpleNamespace(
        split=lambda t, y: (y[:1], y[1:]),
        tree=SimpleNamespace(closures=True),
        _terms=lambda q, v: None,
        _root=lambda t, terms_: None,
        _rows=lambda terms_, q, v: rows,
        _least=lambda *given: np.zeros(1),
        at=SimpleNamespace(moved=lambda q, change: q),
    )
    assert failed(terms.Simulation.settled, made, 0.75, np.zeros(2)) == (
        Outcome.NOT_CONVERGED,
        0.75,
        "the closures could not be met at 0.75 s",
    )


def test_changes_of_least_energy_leave_driven_coordinates() -> None:
    """x + 2 z = 3 with 4 kg and 9 kg: x / z = (1 / 4) / (2 / 9)."""
    made: Any = SimpleNamespace(free=np.array([0, 2]), at=SimpleNamespace(nv=3))
    made._spread = lambda *given: terms.Simulation._spread(made, *given)
    root, rows = np.diag([2.0, 3.0]), np.array([[1.0, 5.0, 2.0]])
    found = terms.Simulation._least(made, 0.0, root, rows, np.array([3.0]))
    share = 3.0 / (1 / 4 + 4 / 9)
    assert found == pytest.approx([share / 4, 0.0, 2 * share / 9])


# --- forces -----------------------------------------------------------------------------------------------
def test_bodies_without_masses_have_unit_masses_and_no_forces() -> None:
    bare = SCENE.with_(
        body=(Body(name="b", position=(1.0, 2.0, 3.0)), Body(name="c", position=(0.0, 0.0, 0.0))),
        driver=(Driver(joint="A", polynomial=(0.0, 1.5)),),
    )
    found = generalised_forces.Forces(bare)
    assert (found.mass == np.eye(12)).all() and found.inertia.shape == (2, 3, 3)
    at = constraint_equations.frames(
        np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), np.zeros((2, 3)), np.ones((2, 3))
    )
    assert found(at, np.ones((2, 3)), np.zeros(0)).tolist() == [0.0] * 12


def test_masses_weights_and_moments_in_body_axes() -> None:
    """A quarter turn about z: the moment (1, 2, 3) of the world is (2, -1, 3) of the body."""
    loads = (Moment(body="b", moment=(1.0, 2.0, 3.0)),)
    found = generalised_forces.Forces(SCENE.with_(load=loads))
    assert np.diag(found.mass).tolist() == [2.0, 2.0, 2.0, 0.3, 0.4, 0.5]
    assert not (found.mass - np.diag(np.diag(found.mass))).any()
    turn = rotations.from_vector(np.array([[0.0, 0.0, np.pi / 2]]))
    spin = np.array([[1.0, 2.0, 4.0]])
    at = constraint_equations.frames(np.zeros((1, 3)), turn, np.zeros((1, 3)), spin)
    gyroscopic = np.cross(spin[0], np.array([0.3, 0.4, 0.5]) * spin[0])
    wanted = [0.0, 0.0, -18.0, *(np.array([2.0, -1.0, 3.0]) - gyroscopic)]
    assert found(at, spin, np.zeros(0)) == pytest.approx(wanted)


# --- compiled code ----------------------------------------------------------------------------------------
def test_integrators_are_compiled_by_runs_without_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[tuple[Any, ...]] = []
    for stepper in (dop853, newton):
        monkeypatch.setattr(stepper, "integrate", lambda *parts, of=stepper: given.append((of, *parts)))
    compiled.prepare()
    (first, system, *parts), (second, other, *others) = given
    assert first is dop853 and second is newton and isinstance(system, dop853.System)
    assert system[:2] == (0, 0) and system.quaternions.shape == (0,)
    assert system.quaternions.dtype == np.int64 and all(isinstance(n, float) for n in system[3:7])
    assert system[7:] == (0, 0) and isinstance(other, newton.System)
    assert [type(n) for n in other] == [int, int, float, float]
    for times, samples, memory in (parts, others):
        assert times.shape == (0,) and samples.shape == (0, 2) and isinstance(memory, dop853.Memory)
        assert (
            all(len(array) != 1 for array in memory if getattr(array, "ndim", 0) == 1) or memory is not None
        )


# --- Exudyn -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("before", "after"), [(1.0, 2.0), (2.0, 1.0), (-2.0, 1.0), (1.0, -2.0)])
@pytest.mark.parametrize(("missed", "stops"), [(0.5, False), (-0.5, False), (0.501, True), (-0.501, True)])
def test_jumps_are_measured_by_the_fastest_coordinate(
    before: float, after: float, missed: float, stops: bool
) -> None:
    """Other coordinates are at rest; at most 2 m/s for 0.5 s move by 1 m, of which half may be missed."""
    position = np.zeros(7)
    position[2] = 5.0 + 0.25 * (before + after) + missed
    data = SimpleNamespace(GetODE2Coordinates=position.tolist)
    rates = np.zeros(7)
    rates[2] = after
    found: Any = object.__new__(static.Drive)
    found.now, found.steps, found.state = 1.0, 6, np.zeros((2, 7))
    found.state[:, 2] = 5.0, before
    found._solve, found._rates = lambda t, h: None, lambda t: rates
    found.system = SimpleNamespace(mbs=SimpleNamespace(systemData=data))
    if stops:
        with pytest.raises(static.Stopped, match="jumped"):
            found._step(1.5)
        assert found.steps == 6 and found.now == 1.0
        return
    found._step(1.5)
    assert (found.now, found.steps) == (1.5, 7) and found.state.shape == (2, 7)
    assert found.state[0].tolist() == position.tolist() and found.state[1].tolist() == rates.tolist()


def test_the_first_rates_of_a_static_analysis() -> None:
    found: Any = object.__new__(static.Drive)
    found.state, asked = np.zeros((2, 7)), []
    found._rates = lambda t: asked.append(t) or np.arange(7.0)
    found.start()
    assert asked == [0.0] and found.state.tolist() == [[0.0] * 7, list(range(7))]


def test_settings_and_jacobian_of_a_static_analysis() -> None:
    """Exudyn's rows of the algebraic equations are below, its coordinates to the left."""
    calls: list[tuple[Any, ...]] = []
    matrix = np.arange(100.0).reshape(10, 10)

    class Solver:
        def __getattr__(self, name: str) -> Any:
            return lambda *given: calls.append((name, *given)) or matrix.tolist()

    part = SimpleNamespace

    def settings() -> Any:
        newton_ = part(relativeTolerance=0.0, absoluteTolerance=0.0)
        solver = part(verboseMode=1, adaptiveStep=True, newton=newton_)
        linear = part(solverType="", ignoreSingularJacobian=False)
        return part(solution=part(file=part(write=True)), staticSolver=solver, linearSolver=linear)

    found: Any = object.__new__(static.Drive)
    found.exu = part(
        SimulationSettings=settings, LinearSolverType=part(EigenDense="dense"), MainSolverStatic=Solver
    )
    found.system, found.state = part(mbs="mbs"), np.zeros((2, 7))
    made = found._settings()
    assert not made.solution.file.write and made.staticSolver.verboseMode == 0
    assert made.staticSolver.adaptiveStep is False and made.linearSolver.ignoreSingularJacobian is True
    assert (made.staticSolver.newton.relativeTolerance, made.staticSolver.newton.absoluteTolerance) == (
        1e-10,
        1e-12,
    )
    assert made.linearSolver.solverType == "dense"
    assert found._jacobian().tolist() == matrix[7:, :7].tolist()
    assert [call[:1] + call[1:2] for call in calls if call[0] != "GetSystemJacobian"] == [
        ("InitializeSolver", "mbs"),
        ("ComputeJacobianODE2RHS", "mbs"),
        ("ComputeJacobianAE", "mbs"),
        ("FinalizeSolver", "mbs"),
    ]
    assert calls[1][2:] == (0, 0, 0) and calls[2][2:] == (1, 0, 1, False)


@pytest.mark.parametrize(("duration", "finest"), [(0.2, 0.2 / 25600), (0.12, 0.12 / 6400)])
def test_steps_of_exudyn_are_not_shorter_than_five_microseconds(
    duration: float, finest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exudyn.Exudyn, "_tuned_steps", lambda self, scene: [0.25])
    found = exudyn.ENGINE.settings(SCENE.with_(duration=duration))
    assert [s.family for s in found if s.options["step"] == 0.25] == ["tuned"]
    for family in ("defaults", "trapezoidal", "alpha"):
        assert min(s.options["step"] for s in found if s.family == family) == finest


def test_statements_that_set_up_a_solver_of_exudyn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Redundant rows or a driver make the equations singular."""
    monkeypatch.setattr(Scene, "counts", lambda self: SimpleNamespace(redundant=6 * (len(self.joint) - 1)))
    plain = exudyn.ENGINE.own_code(SCENE, Setting("trapezoidal", {"step": 0.5}))
    assert plain == (
        "settings.timeIntegration.endTime = 2.0; settings.timeIntegration.numberOfSteps = 4; "
        "settings.timeIntegration.newton.relativeTolerance = 1e-10; "
        "settings.timeIntegration.newton.absoluteTolerance = 1e-12; "
        "settings.timeIntegration.adaptiveStep = False; "
        "mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
    )
    singular = plain.replace(
        "mbs.Solve",
        "settings.linearSolver.solverType = exu.LinearSolverType.EigenDense; "
        "settings.linearSolver.ignoreSingularJacobian = True; mbs.Solve",
    )
    driven = SCENE.with_(driver=(Driver(joint="A", polynomial=(0.0, 1.5)),))
    double = SCENE.with_(joint=(HINGE, HINGE.model_copy(update={"name": "B"})))
    for scene in (driven, double):
        assert exudyn.ENGINE.own_code(scene, Setting("trapezoidal", {"step": 0.5})) == singular
    defaults = exudyn.ENGINE.own_code(driven, Setting("defaults", {"step": 0.5}))
    assert defaults.endswith(
        "numberOfSteps = 4; mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)"
    )


def test_exudyn_prints_nothing_and_reads_no_settings_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[Any] = []
    interface = SimpleNamespace(SuppressAll=said.append)
    library: Any = SimpleNamespace(
        special=SimpleNamespace(userInterface=interface),
        config=SimpleNamespace(printToConsole=True),
        itemInterface=None,
        __path__=[],
    )
    monkeypatch.setitem(sys.modules, "exudyn", library)
    monkeypatch.setitem(sys.modules, "exudyn.itemInterface", SimpleNamespace())
    monkeypatch.setenv("EXUDYN_NO_USER_SETTINGS", "0")
    assert exudyn._exudyn() is library and said == [True] and library.config.printToConsole is False
    assert exudyn.os.environ["EXUDYN_NO_USER_SETTINGS"] == "1"


def test_a_static_analysis_begins_at_rest_at_time_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """And Exudyn is imported before the clock of a run."""
    given: list[Any] = []
    monkeypatch.setattr(static, "build", lambda exu, scene, forces: given.append((exu, scene, forces)) or "s")
    found = static.Drive("exu", SCENE)
    assert given == [("exu", SCENE, False)] and found.system == "s"  # type: ignore[comparison-overlap]
    assert (found.now, found.steps, found.newton, found.factorisations) == (0.0, 0, 0, 0)
    assert found.state.shape == (2, 7) and not found.state.any()
    monkeypatch.setattr(exudyn, "_exudyn", lambda: given.append("imported"))
    exudyn.ENGINE.prepare(())
    assert given[1:] == ["imported"]


def test_compilers_and_their_variables() -> None:
    for made, language, variable, first in (
        (compiler.C, "C", "CC", ("cc", "gcc", "clang")),
        (compiler.CXX, "C++", "CXX", ("c++", "g++", "clang++")),
    ):
        assert (made.language, made.variable, made.commands) == (language, variable, first)
    assert compiler.TIME_LIMIT == 500.0


# --- Pinocchio --------------------------------------------------------------------------------------------
def test_families_that_pinocchio_serves(monkeypatch: pytest.MonkeyPatch) -> None:
    """The one family that every scene has is known without a search for settings."""
    asked: list[Any] = []

    def settings(self: Any, scene: Any) -> list[Setting]:
        asked.append(scene)
        return [Setting("dop853", {})]

    monkeypatch.setattr(pinocchio.Pinocchio, "settings", settings)
    assert pinocchio.ENGINE.serves(SCENE, "tuned") and not asked
    assert pinocchio.ENGINE.serves(SCENE, "dop853") and not pinocchio.ENGINE.serves(SCENE, "other")
    assert asked == [SCENE, SCENE]


@pytest.mark.parametrize("families", [(), ("tuned", "dop853"), pinocchio.COMPILED[:1], pinocchio.COMPILED])
def test_a_library_is_prepared_for_compiled_families(
    families: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared: list[int] = []
    monkeypatch.setattr(pinocchio.compiled_run, "prepare", lambda: prepared.append(1))
    pinocchio.ENGINE.prepare(families)
    assert len(prepared) == bool(set(families) & set(pinocchio.COMPILED))


# --- MuJoCo and mbref -------------------------------------------------------------------------------------
def test_families_that_mujoco_runs_without_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock began before the construction; labels name the settings."""
    given: list[Any] = []

    class Run:
        def __init__(self, scene: Scene, setting: Setting) -> None:
            given.append((scene, setting))

        def installed(self) -> Any:
            return contextlib.nullcontext()

        def integrated(self, times: Any, start: float, labels: Any) -> str:
            given.append((times, start, labels))
            return "the trajectory"

    monkeypatch.setattr(mujoco, "Simulation", Run)
    monkeypatch.setattr(mujoco, "planar_scene", lambda scene: scene)
    monkeypatch.setattr(mujoco.time, "process_time", lambda: 4.5)
    monkeypatch.setattr(mujoco.MuJoCo, "version", lambda self: "3.0")
    setting = Setting(mujoco.COMPILED[0], {"rtol": 1e-6})
    times = np.array([0.0, 1.0])
    found: Any = mujoco.ENGINE.run(SCENE, times, setting)
    (asked, with_setting), (at, start, labels) = given
    assert found == "the trajectory" and asked is SCENE and with_setting is setting and at is times
    assert start == 4.5 and labels == {
        "engine": "mujoco",
        "version": "3.0",
        "method": mujoco.COMPILED[0],
        "settings": {"rtol": 1e-6},
    }


def test_bodies_that_lack_a_moment_of_inertia(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter of the largest moment, exactly, or zero in all directions."""
    monkeypatch.setattr(of_mbref, "ROUNDING", 0.25)
    for inertia, lacks in (
        ((4.0, 1.0, 4.0), True),
        ((4.0, 1.000001, 4.0), False),
        ((0.0, 0.0, 0.0), True),
        (((2.0, 1.5, 0.0), (1.5, 2.0, 0.0), (0.0, 0.0, 2.0)), True),
        (((2.0, 1.0, 0.0), (1.0, 2.0, 0.0), (0.0, 0.0, 2.0)), False),
        (None, False),
    ):
        bodies = (SimpleNamespace(inertia=(2.0, 2.0, 2.0)), SimpleNamespace(inertia=inertia))
        assert of_mbref._has_singular_mass(SimpleNamespace(body=bodies)) is lacks, inertia  # type: ignore[arg-type]


def test_tolerances_and_features_of_mbref() -> None:
    assert of_mbref.TOLERANCES == (1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11)
    assert of_mbref.ENGINE.supports.massless_links is True


# --- Simbody ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "vector", [(0.3, -0.7, 1.1), (0.0, 1.2, 0.0), (2.5, 0.3, -0.2), (0.0, 0.0, -2.0), (0.0, 0.0, 0.0)]
)
def test_angles_about_body_fixed_axes(vector: tuple[float, ...]) -> None:
    turn = rotations.to_matrix(rotations.from_vector(np.array(vector)))
    x, y, z = (rotations.from_vector(a * e) for a, e in zip(_angles(turn), np.eye(3), strict=True))
    assert rotations.to_matrix(rotations.multiply(x, rotations.multiply(y, z))) == pytest.approx(turn)


@pytest.mark.parametrize(("cosine", "is_locked"), [(0.999e-12, True), (1e-12, False), (1.5e-12, False)])
def test_angles_where_two_axes_coincide(cosine: float, is_locked: bool) -> None:
    """At a quarter turn about y only the sum of the other angles is known, which the first one takes."""
    turn = np.array([[cosine, 0.0, 1.0], [0.6, 0.8, 0.5 * cosine], [-0.8, 0.6, cosine]])
    first, second, third = _angles(turn)
    assert second == pytest.approx(np.pi / 2) and third == 0.0
    assert first == pytest.approx(np.arctan2(0.6, 0.8) if is_locked else np.arctan2(-0.5, 1.0))


def test_frames_of_simbody_s_joints() -> None:
    def made(kind: str, *axes: Any) -> Any:
        return _joint(SimpleNamespace(kind=kind, axes=np.array(axes, float)))  # type: ignore[arg-type]

    kind, frame, order = made("universal", (0, 0, 1), (0, 1, 0.2))
    assert (kind, order) == ("UniversalJoint", (0, 1))
    assert frame == pytest.approx(np.column_stack([(0, 0, 1), (0, 1, 0), (-1, 0, 0)]))
    kind, frame, order = made("translational", (0, 1, 0))
    assert (kind, order) == ("SliderJoint", (0,)) and frame[:, 0] == pytest.approx((0, 1, 0))
    assert np.linalg.det(frame) == pytest.approx(1.0)
    for name, wanted in (("revolute", "PinJoint"), ("cylindrical", "CylindricalJoint")):
        kind, frame, _ = made(name, (0, 0.6, 0.8))
        assert kind == wanted and frame[:, 2] == pytest.approx((0, 0.6, 0.8))
    kind, frame, order = _joint(SimpleNamespace(kind="spherical", axes=np.zeros((0, 3))))  # type: ignore[arg-type]
    assert (kind, order) == ("BallJoint", (0, 1, 2)) and frame.tolist() == np.eye(3).tolist()
