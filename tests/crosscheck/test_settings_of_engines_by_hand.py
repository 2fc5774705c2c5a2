"""Settings of engines, Exudyn's solvers and OndselSolver's analyses / numbers worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn import adapter as exudyn
from crosscheck.engines.ondsel import adapter as ondsel
from crosscheck.engines.sampling import Counts, Failed, Sample
from crosscheck.engines.simbody import adapter as simbody
from crosscheck.engines.sundials import adapter as sundials
from mbref import rotations
from mbref.scene import Body, Driver, Revolute, Scene, Sine
from mbref.trajectory import Outcome

BODY = Body(name="b", mass=2.0, inertia=(0.3, 0.4, 0.5), position=(1.0, 2.0, 3.0))
HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
SCENE = Scene(name="s", body=(BODY,), joint=(HINGE,), duration=2.0)
TURNING = SCENE.with_(driver=(Driver(joint="A", polynomial=(0.0, 1.5)),))


def options(settings: Any, family: str, name: str) -> list[float]:
    return [setting.options[name] for setting in settings if setting.family == family]


# --- settings ---------------------------------------------------------------------------------------------
def test_settings_by_tolerance():
    for family in ("merson", "feldberg", "cpodes"):
        found = options(simbody.ENGINE.settings(SCENE), family, "accuracy")
        assert found == [1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10]
    found = options(sundials.ENGINE.settings(SCENE), "ggl", "rtol")
    assert found == [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9]
    code = simbody.ENGINE.own_code(SCENE, Setting("feldberg", {"accuracy": 1e-4}))
    assert code == (
        "manager.setIntegratorMethod(opensim.Manager.IntegratorMethod_RungeKuttaFeldberg); "
        "manager.setIntegratorAccuracy(0.0001)"
    )


def test_settings_by_numbers_of_steps(monkeypatch):
    """Over 2 s; a driven mechanism is analysed statically, too, and one without masses only so."""
    monkeypatch.setattr(exudyn, "fastest_rate", lambda scene, coarse, counts: 5.0)
    found = exudyn.ENGINE.settings(SCENE)
    steps = [2.0 / n for n in (100, 400, 1600, 6400, 25600)]
    for family in ("defaults", "trapezoidal", "alpha"):
        assert options(found, family, "step") == steps
    assert options(found, "tuned", "step") == [0.08, 0.03, 0.01, 0.003, 0.0012]
    assert options(found, "static", "step") == []
    driven = exudyn.ENGINE.settings(TURNING)
    assert options(driven, "static", "step") == options(ondsel.ENGINE.settings(TURNING), "kinematics", "step")
    assert options(driven, "static", "step") == [0.02, 0.005, 0.00125]
    bare = TURNING.with_(body=(Body(name="b", position=(1.0, 2.0, 3.0)),))
    assert {setting.family for setting in exudyn.ENGINE.settings(bare)} == {"static"}
    short = exudyn._sweep("f", SCENE.with_(duration=0.005), (100, 1000, 1001), 5e-6)
    assert options(short, "f", "step") == [0.005 / 100, 0.005 / 1000], "the shortest step is 5 µs"


# --- Exudyn -----------------------------------------------------------------------------------------------
def nested() -> Any:
    part = SimpleNamespace
    newton = part(relativeTolerance=0.0, absoluteTolerance=0.0)
    integration = part(newton=newton, generalizedAlpha=part(spectralRadius=0.0), adaptiveStep=True)
    return part(timeIntegration=integration, linearSolver=part(solverType="", ignoreSingularJacobian=False))


LIBRARY = SimpleNamespace(
    DynamicSolverType=SimpleNamespace(GeneralizedAlpha="alpha", TrapezoidalIndex2="trapezoidal"),
    LinearSolverType=SimpleNamespace(EigenDense="dense"),
)


@pytest.mark.parametrize("singular", [True, False])
@pytest.mark.parametrize(
    ("family", "kind", "relative", "absolute", "radius"),
    [
        ("defaults", "alpha", 0.0, 0.0, 0.0),
        ("trapezoidal", "trapezoidal", 1e-10, 1e-12, 0.0),
        ("alpha", "alpha", 1e-6, 1e-8, 0.9),
    ],
)
def test_solvers_of_exudyn(family, kind, relative, absolute, radius, singular):
    settings = nested()
    assert exudyn.DYNAMIC[family](LIBRARY, settings, singular) == kind
    integration, linear = settings.timeIntegration, settings.linearSolver
    assert (integration.newton.relativeTolerance, integration.newton.absoluteTolerance) == (
        relative,
        absolute,
    )
    assert integration.generalizedAlpha.spectralRadius == radius
    plain = family != "defaults"
    assert integration.adaptiveStep is not plain
    assert (linear.solverType, linear.ignoreSingularJacobian) == (
        ("dense", True) if plain and singular else ("", False)
    )


def test_python_of_a_solver():
    code = exudyn.ENGINE.own_code(SCENE, Setting("alpha", {"step": 0.3}))
    assert code.startswith(
        "settings.timeIntegration.endTime = 2.0; settings.timeIntegration.numberOfSteps = 7; "
    )
    assert code.endswith("mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)")
    assert "ignoreSingularJacobian" not in code and "spectralRadius = 0.9" in code
    driven = exudyn.ENGINE.own_code(TURNING, Setting("alpha", {"step": 0.3}))
    assert "ignoreSingularJacobian = True" in driven, "a driver adds a row"
    assert exudyn.ENGINE.own_code(SCENE, Setting("static", {"step": 0.3})) == ""


def test_drivers_whose_rate_changes():
    def accelerates(*polynomial: float, **parts: Any) -> bool:
        return exudyn._accelerates(Driver(joint="A", polynomial=polynomial, **parts))

    assert not accelerates(0.0, 2.0) and accelerates(0.0, 2.0, 0.5)
    assert accelerates(0.0, 2.0, sine=Sine(amplitude=0.5, frequency=3.0))
    assert not accelerates(0.0, 2.0, sine=Sine(amplitude=0.0, frequency=3.0))
    assert not exudyn._fully_driven(SCENE) and exudyn._fully_driven(TURNING)
    assert not exudyn._fully_driven(TURNING.with_(body=(BODY, BODY.model_copy(update={"name": "c"}))))


def test_angular_velocities_from_euler_parameters():
    """ω = 2 p' p* / |p|² of a body that turns about a skew axis; p is 1.5 long."""
    start, omega = rotations.from_vector(np.array([0.4, -0.7, 0.2])), np.array([0.3, 1.1, -0.6])
    rate = 0.5 * rotations.multiply(np.array([0.0, *omega]), start)
    assert exudyn._angular(1.5 * start[None], 1.5 * rate[None])[0] == pytest.approx(omega)
    assert exudyn._normalised(np.array([[3.0, 0.0, 4.0, 0.0]])).tolist() == [[0.6, 0.0, 0.8, 0.0]]


def test_a_trajectory_of_node_coordinates():
    """Displacements and Euler parameters less (1, 0, 0, 0), with rates and second rates."""
    turned = rotations.from_vector(np.array([0.0, 0.0, 0.5]))
    values = np.zeros((3, 1, 1, 7))
    values[:, 0, 0, :3] = [[0.1, 0.2, 0.3], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    values[0, 0, 0, 3:] = turned - [1.0, 0.0, 0.0, 0.0]
    values[1, 0, 0, 3:] = 0.5 * rotations.multiply(np.array([0.0, 0.0, 0.0, 2.0]), turned)
    values[2, 0, 0, 3:] = 0.5 * rotations.multiply(np.array([0.0, 0.0, 0.0, 7.0]), turned)
    motion = SimpleNamespace(
        times=np.array([0.5]),
        coordinates=values,
        forces=None,
        outcome=Outcome.COMPLETED,
        message="m",
        cost="c",
        t_end=0.5,
    )
    free = SCENE.with_(joint=())
    found = exudyn.ENGINE._trajectory(free, Setting("alpha", {"step": 0.3}), motion)
    assert found.position[0, 0] == pytest.approx([1.1, 2.2, 3.3]) and found.acceleration is None
    assert found.velocity[0, 0].tolist() == [1.0, 2.0, 3.0] and found.reactions is None
    assert found.angular_velocity[0, 0] == pytest.approx([0.0, 0.0, 2.0])
    assert found.orientation[0, 0] == pytest.approx(turned)
    motion.forces = np.zeros((1, 0))
    found = exudyn.ENGINE._trajectory(free, Setting("alpha", {"step": 0.3}), motion)
    assert found.acceleration[0, 0].tolist() == [4.0, 5.0, 6.0]
    assert found.angular_acceleration[0, 0] == pytest.approx([0.0, 0.0, 7.0]) and found.reactions == {}
    waved = TURNING.with_(driver=(Driver(joint="A", polynomial=(0.0, 1.0, 2.0)),))
    assert exudyn.ENGINE._trajectory(waved, Setting("alpha", {"step": 0.3}), motion).acceleration is None


# --- OndselSolver -----------------------------------------------------------------------------------------
def poses(times: list[float], failing: tuple[int, ...] = ()) -> tuple[Any, list[tuple]]:
    """A simulation whose analyses are noted; the numbers of those that fail are given."""
    made = object.__new__(ondsel._OndselSimulation)
    made.times, made.step, made.samples, made.hindered = np.array(times), 0.1, {}, False
    asked: list[tuple] = []

    def analyse(t0: float, targets: np.ndarray, keep_start: bool = False) -> None:
        asked.append((t0, targets.tolist(), keep_start))
        if len(asked) in failing:
            raise Failed(Outcome.NOT_CONVERGED, t0, "no pose")
        made.samples |= {t0: "start"} if keep_start else dict.fromkeys(targets.tolist(), "sample")

    made._analyse = analyse
    return made, asked


def test_equally_spaced_samples_are_one_analysis():
    made, asked = poses([0.0, 0.5, 1.0, 1.5, 1.75, 2.0])
    for t0, t1 in ((0.0, 0.5), (0.5, 1.0), (1.0, 1.5), (1.5, 1.75), (1.75, 2.0)):
        made.advance(t0, t1)
    assert asked == [(0.0, [0.5, 1.0, 1.5], False), (1.5, [1.75, 2.0], False)]
    near, asked = poses([0.5, 1.0 + 4e-10, 1.5])
    near.advance(0.0, 0.5)
    assert len(asked[0][1]) == 3, "a billionth of the interval"
    far, asked = poses([0.5, 1.0 + 6e-10, 1.5])
    far.advance(0.0, 0.5)
    assert len(asked[0][1]) == 1


def test_after_a_failure_each_sample_is_an_analysis():
    made, asked = poses([0.5, 1.0, 1.5], failing=(1,))
    made.advance(0.0, 0.5)
    made.advance(0.5, 1.0)
    assert asked == [(0.0, [0.5, 1.0, 1.5], False), (0.0, [0.5], False), (0.5, [1.0], False)]
    lost, _ = poses([0.5], failing=(1,))
    with pytest.raises(Failed):
        lost.advance(0.0, 0.5)


def test_the_sample_at_the_start_is_of_the_first_step():
    made, asked = poses([0.5])
    assert made.sample(0.0) == "start" and asked == [(0.0, [0.1], True)]
    assert made.sample(0.0) == "start" and len(asked) == 1


def sample_at(t: float) -> Sample:
    place = np.full((1, 3), t)
    return Sample(place, np.full((1, 4), t), place, place, place, place, {})


def test_frames_of_an_analysis():
    """From 0 to 0.5 and 1 s in steps of 0.2 s at most: three steps each. The last pose is kept."""
    made = object.__new__(ondsel._OndselSimulation)
    made.step, made.samples, made.pose, asked = 0.2, {}, "first", []

    def samples(t0: float, t1: float, frames: int, taken: list[int]) -> list[Sample]:
        asked.append((t0, t1, frames, list(taken)))
        return [sample_at(t0 + k * (t1 - t0) / frames) for k in taken]

    made._samples = samples
    made._analyse(0.0, np.array([0.5, 1.0]))
    assert asked == [(0.0, 1.0, 6, [3, 6])] and sorted(made.samples) == [0.5, 1.0]
    assert made.pose[0].tolist() == [[1.0] * 3] and made.pose[1].tolist() == [[1.0] * 4]
    made._analyse(2.0, np.array([2.1]), keep_start=True)
    assert asked[1] == (2.0, 2.1, 1, [0]) and made.samples[2.0].position[0, 0] == 2.0
    assert made.pose[0].tolist() == [[1.0] * 3], "the pose stays"


def test_a_second_world_frame_where_the_angles_lock(monkeypatch):
    """The second angle of the first assembly is a right angle; of both: the orientations are lost."""
    texts: list[Any] = []

    def assembly(name: str) -> Any:
        return SimpleNamespace(text=lambda *given: texts.append((name, given)) or name)

    made = object.__new__(ondsel._OndselSimulation)
    made.scene, made.pose, made.counts = SCENE, ("place", "turn"), Counts()
    made.assemblies, made.solve = [assembly("first"), assembly("second")], lambda text: text
    middle = {"first": np.pi / 2 - 0.9e-3, "second": np.pi / 2 - 1.1e-3}

    def table(answer: str, frames: int) -> Any:
        angles = np.zeros((frames + 1, 3))
        angles[frames, 1] = middle[answer]
        return SimpleNamespace(three=lambda name, *labels: angles, name=answer)

    monkeypatch.setattr(ondsel, "table", table)
    reader = lambda which, answer, frame: SimpleNamespace(sample=lambda: (answer.name, frame))  # noqa: E731
    monkeypatch.setattr(ondsel, "_Reader", reader)
    assert made._samples(0.25, 0.5, 4, [2, 4]) == [("second", 2), ("second", 4)]
    assert texts[0] == ("first", (0.25, 0.5, 4, "place", "turn")) and made.counts.steps == 8
    middle["second"] = np.pi / 2
    with pytest.raises(Failed, match=r"angles after 0\.25 s do not determine the orientations") as failed:
        made._samples(0.25, 0.5, 4, [4])
    assert failed.value.outcome is Outcome.NOT_FINITE

    def refuse(text: str) -> None:
        raise ValueError("why")

    made.solve = refuse
    with pytest.raises(Failed, match=r"no pose after 0\.25 s: why"):
        made._samples(0.25, 0.5, 4, [4])


def test_orientations_by_angles_about_x_y_and_z():
    found = rotations.to_matrix(ondsel._bryant(np.array([0.3, -0.7, 1.1])))
    x, y, z = (
        rotations.to_matrix(rotations.from_vector(a * e))
        for a, e in zip((0.3, -0.7, 1.1), np.eye(3), strict=True)
    )
    assert found == pytest.approx(x @ y @ z)
