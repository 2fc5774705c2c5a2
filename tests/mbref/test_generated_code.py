"""Machine code of a scene's series against the kernels that serve every scene."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mbref
from mbref.kernels.compilation import PLAIN

if PLAIN:
    pytest.skip("test_written_code.py compares the code with interpreted kernels", allow_module_level=True)

from crosscheck.conformance.random_mechanisms import random_mechanism
from mbref.kernels.layout import OK
from mbref.method import Method
from mbref.scene import Driver
from mbref.scenes import SCENES
from mbref.simulation.outcome import trajectory_of
from mbref.simulation.simulate import Limits, simulate
from mbref.simulation.start_run import start_run
from mbref.taylor.generated import build
from mbref.trajectory import Outcome

TAYLOR = Method.parse("taylor")
ORDER_16 = Method.parse("taylor[order=16]")
MECHANISMS = (
    "planar_slider_crank",
    "spatial_slider_crank",
    "spatial_slider_crank_driven",
    "bricard",
    "slider_crank_chain",
    "heavy_top",
)


def terms(scene, code):
    """Terms (orders, lanes) of the series about the start, each over t^order, t its own time (s)."""
    run = start_run(scene, ORDER_16, np.array([0.1]), Limits(code=code))
    assert run.stepper.expand() == OK
    found = run.stepper.taylor.series.terms.copy()
    sizes = np.abs(found[2:]).max(axis=1)
    time = (sizes[0] / sizes.max()) ** (1.0 / max(1, sizes.argmax()))
    found *= time ** np.arange(len(found))[:, None]
    return found, run


def agree(scene):
    """Whether the terms of a scene's code are those of the kernels; by power it gives those of variables."""
    (expected, _), (found, run) = (terms(scene, code) for code in ("generic", "generated"))
    by_power = run.stepper.taylor.step.deceleration > 0.0
    lanes = slice(run.stepper.taylor.solver.pivot_columns.size if by_power else None)
    return np.abs(found - expected)[:, lanes].max() <= 1e-11 * np.abs(expected).max()


def in_motion(scene, duration):
    """Coordinates and velocities of all bodies after a time (s)."""
    run = start_run(scene, TAYLOR, np.array([duration]), Limits(rtol=1e-10, code="generic"))
    run.stepper.advance(None)
    samples = run.memory.loop.samples
    return samples.coordinates[0].copy(), samples.velocities[0].copy()


@pytest.mark.parametrize("name", MECHANISMS)
def test_terms_are_those_of_the_kernels(name):
    assert agree(SCENES[name]())


@pytest.mark.parametrize(
    ("name", "joint"),
    (("planar_slider_crank", "A"), ("planar_slider_crank", "B"), ("bennett", "R1"), ("bricard", "P0")),
)
def test_terms_of_driven_mechanisms_are_those_of_the_kernels(name, joint):
    """Of 3, 5, 8 and 18 rows."""
    scene = SCENES[name]()
    at_rest = (
        b.model_copy(update={"velocity": (0.0, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 0.0)})
        for b in scene.body
    )
    driver = Driver(joint=joint, polynomial=(0.0, 0.0, 3.0))
    scene = scene.with_(body=tuple(at_rest), driver=(driver,))
    assert agree(scene)


@pytest.mark.parametrize("seed", (3, 11, 17, 21))
def test_terms_of_random_mechanisms_are_those_of_the_kernels(seed):
    scene = random_mechanism(seed)
    scene = scene.with_(load=tuple(load for load in scene.load if not hasattr(load, "stiffness")))
    assert agree(scene)


@pytest.mark.parametrize(
    ("name", "duration"),
    (
        ("spatial_slider_crank", 0.02),
        ("spatial_slider_crank_gravity", 0.1),
        ("four_bar_gravity", 0.05),
        ("sarrus", 0.05),
        ("bricard", 0.05),
        ("bennett", 0.05),
    ),
)
def test_power_gives_the_terms_of_one_freedom(name, duration):
    """With constant moments, rows that depend on others, variables in several blocks; most start at rest, the
    duration ago, which is how far the terms can be told."""
    scene, found = SCENES[name](), []
    state = in_motion(scene, duration)
    for code in ("generic", "generated"):
        run = start_run(scene, ORDER_16, np.array([0.1]), Limits(code=code))
        run.memory.state.coordinates[:], run.memory.state.velocities[:] = state
        run.memory.loop.clock.length = duration
        assert run.stepper.expand() == OK
        taylor = run.stepper.taylor
        found.append(taylor.series.terms[:17, : taylor.solver.pivot_columns.size].copy())
    assert run.stepper.taylor.step.deceleration > 0.0, "by power"
    sizes = np.abs(found[0]).max(axis=1)
    time = min(duration, (sizes[2:] ** (-1.0 / np.arange(2, 17))).min())
    off = np.abs(found[0] - found[1]).max(axis=1) * time ** np.arange(17)
    assert off.max() <= 1e-14 and (sizes * time ** np.arange(17))[2:].max() > 1e-4


@pytest.mark.parametrize("name", ("bricard", "bennett"))
def test_a_motion_that_turns_back_is_that_of_the_kernels(name):
    """By power, but where it is slow."""
    times = np.linspace(0.0, 4.0, 41)
    generic, own = (
        simulate(SCENES[name](), "taylor", times, Limits(rtol=1e-11, code=code))
        for code in ("generic", "generated")
    )
    along = (own.velocity * own.velocity[1]).sum(axis=(1, 2))
    assert own.outcome == Outcome.COMPLETED and along.min() < 0.0 < along.max(), "it turns back"
    assert np.abs(generic.position - own.position).max() < 1e-11


@pytest.mark.parametrize(
    "name", (*MECHANISMS[:4], "four_bar", "planar_slider_crank_equal", "four_bar_gravity")
)
def test_runs_agree_with_the_kernels(name):
    """In steps too, but for one a crossing: behind it they are as long as rounding lets them be."""
    times = np.linspace(0.0, 0.2, 5)
    generic, own = (
        simulate(SCENES[name](), ORDER_16, times, Limits(rtol=1e-11, code=code))
        for code in ("generic", "generated")
    )
    assert generic.outcome == own.outcome and len(own.times) == len(times), own.message
    assert np.abs(generic.position - own.position).max() < 1e-9
    for mine, theirs in ((own.acceleration, generic.acceleration), *_reactions(own, generic)):
        assert np.abs(mine - theirs).max() <= 1e-6 * max(1.0, np.abs(theirs).max())
    apart = abs(generic.cost.steps - own.cost.steps)  # behind a singular position rounding tells how far
    assert apart <= max(0.05 * generic.cost.steps, len(generic.crossings or ()))


def _reactions(one, other):
    """The reactions of each joint in two runs; none without masses."""
    return [(one.reactions[joint], other.reactions[joint]) for joint in one.reactions or ()]


def test_auto_takes_the_code_where_many_steps_are_ahead():
    scene, times = SCENES["planar_slider_crank"](), np.array([0.4])
    limits = Limits(rtol=1e-9, largest_step=1.2e-5)
    run = start_run(scene, TAYLOR, times, limits)
    auto = trajectory_of(run, *run.stepper.advance(None), 0.0)
    assert run.stepper.taylor.code.expand != 0
    generic = simulate(scene, "taylor", times, Limits(rtol=1e-9, code="generic"))
    assert np.abs(auto.position - generic.position).max() < 1e-6
    short = start_run(scene, TAYLOR, np.array([0.1]), limits)
    short.stepper.advance(None)
    assert short.stepper.taylor.code.expand == 0, "a short run does not make code"


def test_one_process_loads_the_code_of_a_scene_once():
    crank = SCENES["planar_slider_crank"]()
    first, again = (start_run(crank, TAYLOR, np.array([0.1]), Limits(code="generated")) for _ in "ab")
    assert first.stepper.taylor.code.expand == again.stepper.taylor.code.expand != 0
    finer = start_run(crank, TAYLOR, np.array([0.1]), Limits(rtol=1e-12, code="generated"))
    assert finer.stepper.taylor.mode.order > first.stepper.taylor.mode.order
    assert finer.stepper.taylor.code.expand == first.stepper.taylor.code.expand, "one code serves all orders"


def test_springs_are_left_to_the_kernels_and_long_eliminations_too():
    names = {}
    for scene in ("planar_slider_crank", "andrews_squeezer", "bricard"):
        run = start_run(SCENES[scene](), TAYLOR, np.array([0.01]), Limits(code="generated"))
        names[scene] = {name for name in build.CODE_NAMES if run.stepper.taylor.code[name]}
    corrections = {"violation", "close", "close_rate"}
    assert names["planar_slider_crank"] == {"expand", "factorise", *corrections}
    assert names["andrews_squeezer"] == {"factorise", *corrections}
    assert names["bricard"] == {"expand_by_power", "expand", *corrections}


@pytest.mark.parametrize("order", (4, 5, 12, 13, 30))
def test_every_order_is_that_of_the_kernels(order):
    method = Method.parse(f"taylor[order={order}]")
    generic, own = (
        start_run(SCENES["spatial_slider_crank_gravity"](), method, np.array([0.1]), Limits(code=code))
        for code in ("generic", "generated")
    )
    assert own.stepper.expand() == generic.stepper.expand() == OK
    variables = own.stepper.taylor.solver.pivot_columns.size
    found, expected = (run.stepper.taylor.series.terms[: order + 1, :variables] for run in (own, generic))
    assert np.abs(expected[order]).max() > 0.0
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(found - expected) <= 1e-9 * size).all()


@pytest.mark.parametrize("name", ("andrews_squeezer", "flyball_governor"))
def test_springs_with_code_move_as_by_the_kernels(name):
    times = np.linspace(0.0, 0.02, 5)
    generic, own = (
        simulate(SCENES[name](), ORDER_16, times, Limits(rtol=1e-11, code=code))
        for code in ("generic", "generated")
    )
    assert generic.outcome == own.outcome and len(own.times) == len(times), own.message
    assert np.abs(generic.position - own.position).max() < 1e-9


WITHOUT = """
import importlib.util
from mbref.method import MethodError
from mbref.scenes import SCENES
from mbref.simulation.simulate import Limits, simulate
from mbref.trajectory import Outcome
assert importlib.util.find_spec("mbref.taylor.generated") is None
for code in ("auto", "generic"):
    motion = simulate(SCENES["four_bar"](), "taylor", [0.0, 0.01], Limits(code=code))
    assert motion.outcome == Outcome.COMPLETED, motion.message
try:
    simulate(SCENES["four_bar"](), "taylor", [0.1], Limits(code="generated"))
except MethodError as reason:
    assert "mbref.taylor.generated is not installed" in str(reason)
else:
    raise AssertionError("generated code is optional, but asked for")
"""


def test_mbref_runs_without_the_subpackage(tmp_path):
    package = Path(mbref.__file__).parent
    shutil.copytree(package, tmp_path / "mbref", ignore=shutil.ignore_patterns("generated", "__pycache__"))
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-P", "-c", WITHOUT],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
