"""Two parts of one kind at one place: each engine against the motion by Gauss's principle."""

import functools
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from crosscheck.engine import BUILT_IN, GENERATORS, OPTIONAL, Setting, engine, installed
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.metrics import error_series, in_scene_order
from crosscheck.judge.tolerances import LIKE_TRUTH
from crosscheck.processes.serve import run_once
from mbref.motions.trajectory import Outcome
from mbref.scene import Body, Cylindrical, Distance, Driver, Force, Moment, Revolute, Scene, TorsionSpring
from tests.helpers.parts import spring
from tests.helpers.side_by_side import side_by_side

GRAVITY = (0.0, -9.81, 0.0)  # m/s²
TIMES = (0.0, 0.05, 0.1)
ARM = Body(name="arm", mass=1.0, inertia=(0.01, 0.09, 0.09), position=(0.5, 0.0, 0.0))
BOB = Body(name="bob", mass=0.4, inertia=(0.02, 0.03, 0.04), position=(1.0, -0.4, 0.1))
A = Revolute(name="A", bodies=("ground", "arm"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
B = Revolute(name="B", bodies=("arm", "bob"), anchor=(1.0, 0.0, 0.0), axis=(0.0, 0.6, 0.8))
C = Cylindrical(name="B", bodies=("arm", "bob"), anchor=(1.0, 0.0, 0.0), axis=(0.0, 0.6, 0.8))


def twist(joint: str, stiffness: float, damping: float, natural_angle: float) -> TorsionSpring:
    return TorsionSpring(joint=joint, stiffness=stiffness, damping=damping, natural_angle=natural_angle)


def pull(point: tuple, force: tuple) -> Force:
    return Force(body="bob", point=point, force=force)


TOP, TIP = (0.0, 1.0, 0.0), (1.0, -0.4, 0.0)
tie = partial(spring, "ground", TOP, "bob", damping=0.3)
PAIRS = {
    "two torsion springs": (twist("A", 13.0, 0.1, 1.4), twist("A", 22.0, 0.2, 0.7)),
    "torsion springs of two joints": (twist("A", 13.0, 0.1, 1.4), twist("B", 5.0, 0.2, -0.7)),
    "a torsion spring and a torsion damper": (twist("B", 13.0, 0.0, 1.4), twist("B", 0.0, 0.7, 0.3)),
    "a torsion damper and a torsion spring": (twist("B", 0.0, 0.7, 0.3), twist("B", 13.0, 0.0, 1.4)),
    "two springs between the same points": (tie(TIP, 30.0, 1.0), tie(TIP, 50.0, 2.5)),
    "two springs between the same bodies": (tie(TIP, 30.0, 1.0), tie((1.0, 0.0, 0.4), 9.0, 0.0)),
    "two moments": (Moment(body="bob", moment=(1.0, 0.0, 2.0)), Moment(body="bob", moment=(0.5, -1.0, 0.0))),
    "two forces at one point": (pull(TIP, (1.0, 2.0, 0.0)), pull(TIP, (0.0, -5.0, 3.0))),
    "two forces at two points": (pull(TIP, (1.0, 2.0, 0.0)), pull((1.0, 0.0, 0.5), (0.0, -5.0, 3.0))),
}
ROBUST = ("alpha",)  # where Exudyn's best family stops at redundant rows
ACCURATE = ("dart", "drake")  # large engines whose accelerations are integrated to small tolerances
ENGINES = [name for name in (*BUILT_IN, *OPTIONAL, *GENERATORS, *ACCURATE) if installed(name)]


def scene(**parts: object) -> Scene:
    given = {"body": (ARM, BOB), "joint": (A, B), "gravity": GRAVITY, **parts}
    return Scene(name="pair", duration=TIMES[-1], **given)


def error(name: str, mechanism: Scene) -> float:
    """Return the error of an engine's completed run by the motion of Gauss's principle (m, rad). The test is
    skipped if the engine refuses the mechanism."""
    simulator = engine(name)
    if name == "casadi" and "opensim" in sys.modules:
        pytest.skip("OpenSim has loaded a CasADi library of its own into this process")
    if reason := simulator.cannot(mechanism):
        pytest.skip(str(reason))
    finest = {setting.family: setting for setting in simulator.settings(mechanism)}
    best = simulator.best_settings(mechanism)[-1]
    for setting in (best, *(s for s in finest.values() if s.family in ROBUST)):
        run = run_once(name, mechanism, np.array(TIMES), setting)
        if run.outcome is Outcome.COMPLETED:
            break
    assert run.outcome is Outcome.COMPLETED, run.message
    return error_series(mechanism, run, gauss_motion(mechanism, TIMES)).max()


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("pair", PAIRS)
def test_engine_moves_a_mechanism_by_both_of_two_loads_at_one_place(name, pair):
    """The error from the motion of Gauss's principle with both loads is below LIKE_TRUTH, 1e-5 of the length
    or rad; with one load alone the principle's motion is off by over 100 times as much."""
    assert error(name, scene(load=PAIRS[pair])) < LIKE_TRUTH < least_effect(pair) / 100


@functools.cache
def least_effect(pair: str) -> float:
    """Return the smaller error (m, rad) of the motions by Gauss's principle with one load of a pair."""
    both = gauss_motion(scene(load=PAIRS[pair]), TIMES)
    alone = [gauss_motion(scene(load=(load,)), TIMES) for load in PAIRS[pair]]
    return min(error_series(scene(), motion, both).max() for motion in alone)


DRIVEN_SPRUNG: dict = {"driver": (Driver(joint="A", polynomial=(0.0, 2.0, 1.0)),)}
DRIVEN_SPRUNG["load"] = twist("A", 13.0, 0.1, 1.4), twist("B", 3.0, 0.1, 0.5)
TWO_DRIVERS = Driver(joint="A", polynomial=(0.0, 2.0)), Driver(joint="B", polynomial=(0.0, -1.0, 3.0))
SECOND_JOINTS = {
    "and a distance": Distance(name="D", bodies=("arm", "bob"), anchors=((0.5, 0.2, 0.0), (1.0, -0.4, 0.1))),
    "and a coaxial hinge": Revolute(
        name="D", bodies=("arm", "bob"), anchor=(1.0, 0.3, 0.4), axis=(0.0, 0.6, 0.8)
    ),
}


BESIDE = {
    "driver and torsion spring of one joint": DRIVEN_SPRUNG,
    "two drivers of one body's joints": {"driver": TWO_DRIVERS},
    **{f"cylinder {words}": {"joint": (A, C, second)} for words, second in SECOND_JOINTS.items()},
}


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("parts", BESIDE.values(), ids=BESIDE)
def test_engine_moves_a_mechanism_with_drivers_and_joints_side_by_side(name, parts):
    """Errors from the motion of Gauss's principle are below LIKE_TRUTH, 1e-5; refusals are skipped."""
    assert error(name, scene(**parts)) < LIKE_TRUTH


# engines of first order, in single precision, or without J' v in closures, at a fine step
STEPPERS = {
    "bullet": Setting("iterated", {"step": 1e-4, "iterations": 1000}),
    "mjx": Setting("stock", {"step": 1e-3}),
    "warp": Setting("stock", {"step": 1e-3}),
    "newton": Setting("padmm, moreau", {"step": 5e-4, "alpha": 0.1}),
}
DRIVEN = {"a driver and a torsion spring", "two drivers"}
OF_TORSION = {pair for pair in PAIRS if "torsion" in pair}
REFUSED = {"bullet": set(), "mjx": DRIVEN, "warp": DRIVEN, "newton": DRIVEN | OF_TORSION}


@pytest.mark.slow
@pytest.mark.parametrize("name", STEPPERS)
def test_engines_with_own_steps_move_by_both_parts_of_every_pair_that_they_accept(name):
    """All pairs but REFUSED are in one scene. Errors are below a tenth of the effect of losing a part."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    alone = {pair: [scene(load=(load,)) for load in loads] for pair, loads in PAIRS.items()}
    pairs = {pair: (scene(load=loads), alone[pair]) for pair, loads in PAIRS.items()}
    for key, second in SECOND_JOINTS.items():
        pairs[key] = scene(joint=(A, C, second)), [scene(joint=(A, C))]
    either = [scene(driver=DRIVEN_SPRUNG["driver"]), scene(load=DRIVEN_SPRUNG["load"])]
    pairs["a driver and a torsion spring"] = scene(**DRIVEN_SPRUNG), either
    pairs["two drivers"] = scene(driver=TWO_DRIVERS), [scene(driver=(driver,)) for driver in TWO_DRIVERS]
    served = {pair: both for pair, (both, _) in pairs.items() if engine(name).cannot(both) is None}
    assert set(pairs) - set(served) == REFUSED[name]
    together = side_by_side(served, GRAVITY)
    run = in_scene_order(together, run_once(name, together, np.array(TIMES), STEPPERS[name]))
    assert run.outcome is Outcome.COMPLETED, run.message
    shares = {}
    for pair, mechanism in served.items():
        own = [together.body_index(f"{pair} {body.name}") for body in mechanism.body]
        fields = ("position", "orientation", "velocity", "angular_velocity")
        moved = {name: getattr(run, name)[:, own] for name in fields}
        exact = gauss_motion(mechanism, TIMES)
        found = replace(exact, acceleration=None, angular_acceleration=None, **moved)
        effects = [error_series(mechanism, gauss_motion(lost, TIMES), exact).max() for lost in pairs[pair][1]]
        shares[pair] = float(error_series(mechanism, found, exact).max() / min(effects))
    assert all(share < 0.1 for share in shares.values()), shares
