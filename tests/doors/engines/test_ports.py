"""MuJoCo's ports against MuJoCo in C and truths; their code is compiled for minutes first."""

import numpy as np
import pytest

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.conformance.mechanisms.closed_forms import screw
from crosscheck.conformance.mechanisms.features import feature_scenes
from crosscheck.engine import Owner, Setting, engine, installed
from crosscheck.engines.mujoco.ports import OWN_STEPS
from crosscheck.engines.warp.adapter import ENGINE
from crosscheck.findings.finding import FOLDER
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.metrics import error_series
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.truth import truth_for
from mbref import rotations
from mbref.motions.trajectory import Outcome
from mbref.scene import Scene
from mbref.scenes import SCENES
from tests.helpers.coupled_mechanisms import EVERY as COUPLED
from tests.helpers.measured import MARGIN
from tests.helpers.side_by_side import side_by_side

PORTS = ("mjx", "warp")  # of MuJoCo to JAX and to Warp
LOOP = {"mjx": 6.1e-6, "warp": 1.4e-7}  # MJX leaves J' v out of the closures; Warp rounds to single precision
GRAVITY = (1.0, -8.0, -5.0)  # m/s²


@pytest.mark.parametrize("name", PORTS)
def test_mujoco_s_ports_refuse_drivers(name: str) -> None:
    """The ports lack the callback by which the adapter drives; a four-bar without driver is accepted."""
    refusal = engine(name).cannot(SCENES["four_bar"]())
    assert refusal is not None and refusal.owner is Owner.ENGINE and "callback" in refusal.reason, refusal
    assert engine(name).cannot(SCENES["four_bar_gravity"]()) is None


def test_warp_sweeps_the_finest_step_only_with_loops_or_couplings() -> None:
    """In single precision the rounding of a tree's motion grows with the number of steps. MJX, in double
    precision, sweeps the finest step of every scene; a heavy top has neither loops nor couplings."""
    for scene, omitted in ((SCENES["heavy_top"](), 1), (SCENES["bennett"](), 0), (screw()[0], 0)):
        for family in OWN_STEPS:
            given = (engine(port).settings(scene) for port in PORTS)
            of_mjx, of_warp = ([s.options["step"] for s in all_ if s.family == family] for all_ in given)
            assert of_warp and of_warp == of_mjx[: len(of_mjx) - omitted], family


@pytest.mark.slow
@pytest.mark.parametrize("name", PORTS)
def test_port_and_mujoco_in_c_stay_within_their_measured_errors(name: str) -> None:
    """A four-bar with balls over 0.05 s at steps of 1 ms. Errors from the judge's truth are at most ten times
    the measured 8.2e-9 of MuJoCo in C, 6.1e-6 of MJX and 1.4e-7 of Warp, of the length or rad."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    scene = Scene.from_file(FOLDER / "ball_four_bar.toml").with_(duration=0.05)
    times, setting = np.linspace(0, scene.duration, 11), Setting("stock", {"step": 1e-3})
    exact = truth_for(scene).poses(times)
    for simulator, measured in (("mujoco", 8.2e-9), (name, LOOP[name])):
        run = engine(simulator).run(scene, times, setting)
        assert run.outcome is Outcome.COMPLETED, run.message
        assert float(error_series(scene, run, exact).max()) < MARGIN * measured


# measured differences of runs in single and in double precision over 0.2 s, at steps of 1 ms
APART = {"four_bar_free": {"mjx": 1.5e-6, "warp": 5.9e-7}, "bennett": {"mjx": 9.8e-8, "warp": 2.5e-7}}
OTHER = {"mjx": ("mjx", "stock, single"), "warp": ("mujoco", "stock")}  # a way in the other precision


@pytest.mark.slow
@pytest.mark.parametrize("name", PORTS)
@pytest.mark.parametrize("mechanism", APART)
def test_single_and_double_precision_differ_by_rounding(name: str, mechanism: str) -> None:
    """The port in one precision and the port, or MuJoCo in C, in the other. A difference above ten times the
    measured one (APART) is a defect of the port; one below 1e-9, less than single precision's rounding, means
    that both are double."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    column = next(column for column in DIFFICULTIES if column.scene == mechanism)
    scene, times = column.make().with_(duration=0.2), np.array([0.0, 0.1, 0.2])
    pair, step = ((name, "stock"), OTHER[name]), {"step": 1e-3}
    runs = [engine(simulator).run(scene, times, Setting(family, step)) for simulator, family in pair]
    difference = float(error_series(scene, *runs).max())
    assert 1e-9 < difference < MARGIN * APART[mechanism][name], f"{difference:.1e} apart"


def bare(scene: Scene) -> Scene:
    """The scene without loads, couplings and armatures."""
    without = {"armature": 0.0}
    joints = [j.model_copy(update=without if getattr(j, "armature", 0) else {}) for j in scene.joint]
    return scene.with_(load=(), coupling=(), joint=joints)


def at_the_end(scene: Scene, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (nb, 3) and orientations (nb, 4) at the last time, by the reference."""
    motion = natural_motion(scene, times, EXTENDED, seconds=100.0)
    assert not motion.reason, motion.reason
    return doubles(motion.position)[-1], doubles(motion.orientation)[-1]


def apart(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The larger of distance (m) and angle (rad) of each body's poses in two motions."""
    return np.maximum(np.abs(one[0] - other[0]).max(axis=1), rotations.angle_between(one[1], other[1]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mujoco", *PORTS])
def test_mujoco_and_its_ports_move_loads_couplings_and_armatures_as_the_reference(name: str) -> None:
    """Every body's error is below 1e-3 of the effect that its loads, couplings and armatures have on it, by
    the reference with and without them. A lost part leaves 1, a wrong ratio its relative error; single
    precision and the stiffness of couplings leave 3e-5."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    probes = {probe.name: probe for kind, probe in feature_scenes().items() if kind.endswith(" load")}
    scene = side_by_side(probes | {make.__name__: make() for make in COUPLED}, GRAVITY)
    times = np.array([0.0, scene.duration])
    run = engine(name).run(scene, times, Setting("stock", {"step": 1e-3}))
    assert run.outcome is Outcome.COMPLETED, run.message
    exact = at_the_end(scene, times)
    effect = apart(at_the_end(bare(scene), times), exact)
    off = apart((run.position[-1], run.orientation[-1]), exact)
    for body, wrong, by_parts in zip(scene.body, off, effect, strict=True):
        assert wrong < 1e-3 * by_parts, f"{body.name}: {wrong:.1e} of {by_parts:.1e}"


@pytest.mark.slow
@pytest.mark.parametrize("family", ["stock", "euler", "defaults"])
def test_recorded_graph_of_mujoco_warp_moves_as_its_single_steps(family: str) -> None:
    """20 steps of 1 ms by the adapter's graph and the library's own step function: equal to the last bit."""
    warp = pytest.importorskip("mujoco_warp")
    scene = DIFFICULTIES[0].make()
    recorded, plain = (ENGINE.world(scene, Setting(family, {"step": 1e-3})) for _ in range(2))
    recorded.step(0.0, 1e-3, 20)
    plain.model.opt.timestep.fill_(1e-3)
    for _ in range(20):
        warp.step(plain.model, plain.data)
    assert np.array_equal(recorded.motion().position, plain.motion().position)
