"""Drift of momentum of two free bodies, by hand; violations of the suite as files, and their reduction."""

import shlex
from dataclasses import replace

import numpy as np
import pytest

from crosscheck.conformance import findings
from crosscheck.conformance.suite import FAIL, Verdict
from crosscheck.judge.constraints import scene_length
from crosscheck.judge.momentum import momentum_series
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Force, Moment, Revolute, Scene, Spherical
from tests.helpers.parts import spring

FIRST = Body(name="a", mass=2.0, inertia=(1.0, 1.0, 2.0), position=(0.0, 0.0, 0.0), velocity=(3.0, 0.0, 0.0))
SECOND = Body(name="b", mass=4, inertia=(3, 3, 5), position=(3, 0, 0), angular_velocity=(0, 0, 2))
SCENE = Scene(name="free", body=(FIRST, SECOND), duration=1.0)
TIMES = np.array([0.0, 0.5, 1.0])
ROUNDED = 1e-15  # of momentum, relative: exact sums of few numbers


def motion() -> Trajectory:
    """The first body moves at 3 m/s, the second turns in place at 2 rad/s about z."""
    place, rate = np.zeros((3, 2, 3)), np.zeros((3, 2, 3))
    place[:, 0, 0], place[:, 1, 0], rate[:, 0, 0] = 3.0 * TIMES, 3.0, 3.0
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (3, 2, 1))
    turn[:, 1] = np.stack([np.cos(TIMES), 0 * TIMES, 0 * TIMES, np.sin(TIMES)], axis=1)
    spin = np.zeros((3, 2, 3))
    spin[:, 1, 2] = 2.0
    return Trajectory("free", "e", "1", "m", {}, TIMES, ("a", "b"), place, turn, rate, spin)


def test_angular_momentum_drift_is_relative_to_spin_and_linear_momentum():
    """Body b, 5 kg m² at 2 rad/s, gains 0.7 rad/s at the second sample only: 3.5 N m s. The scale is its
    largest spin, 13.5 N m s, and the momentum of body a, 6 kg m/s, times the scene's length."""
    run = motion()
    run.angular_velocity[1, 1, 2] += 0.7
    found = momentum_series(SCENE, run)
    assert found[1] == pytest.approx(3.5 / (13.5 + 6.0 * scene_length(SCENE))) and found[2] < ROUNDED


def test_impulses_of_gravity_forces_and_moments_are_no_drift():
    """Under gravity of 1 m/s² each body falls at the velocity t: the drift is rounding, but over 0.1 by a
    scene without gravity. A moment of 5 N m adds the spin t to body b (5 kg m²), and a force of 6 N adds the
    velocity 3 t to body a (2 kg): in scenes with these loads the drift is rounding, too."""
    run = motion()
    fall = np.zeros((3, 2, 3))
    fall[:, :, 2] = -TIMES[:, None]
    run = replace(run, velocity=run.velocity + fall, position=run.position + fall * TIMES[:, None, None] / 2)
    assert momentum_series(SCENE.with_(gravity=(0.0, 0.0, -1.0)), run).max() < ROUNDED
    assert momentum_series(SCENE, run).max() > 0.1
    pushed = SCENE.with_(gravity=(0.0, 0.0, -1.0), load=(Moment(body="b", moment=(0.0, 0.0, 5.0)),))
    run.angular_velocity[:, 1, 2] += TIMES
    assert momentum_series(pushed, run).max() < ROUNDED
    forced = pushed.with_(load=(Force(body="a", force=(0.0, 6.0, 0.0), point=(0.0, 0.0, 0.0)),))
    run.velocity[:, 0, 1] += 3.0 * TIMES
    assert momentum_series(forced, run).max() < ROUNDED


@pytest.mark.parametrize(
    "change",
    [
        {"joint": (Spherical(name="S", bodies=("ground", "a"), anchor=(0.0, 0.0, 0.0)),)},
        {"load": (spring("ground", (1.0, 0.0, 0.0), "a", (0.0, 0.0, 0.0), 1.0, 1.0),)},
        {"load": (Moment(body="b", moment=(0.0, 0.0, 1.0), factor={"polynomial": [0.0, 1.0]}),)},
        {"body": tuple(b.model_copy(update={"mass": None, "inertia": None}) for b in (FIRST, SECOND))},
    ],
    ids=["joint to the ground", "spring to the ground", "load over time", "no masses"],
)
def test_scene_without_a_momentum_balance_has_no_drift(change):
    """None stands for no drift; the two free bodies, without the change, have one."""
    assert momentum_series(SCENE, motion()) is not None
    assert momentum_series(SCENE.with_(**change), motion()) is None


def test_run_at_rest_has_no_momentum_drift():
    """No momentum of the motion could be the scale: None stands for no drift. Moving bodies have one, also
    where they turn in place, without linear momentum."""
    assert momentum_series(SCENE, motion()) is not None
    run = motion()
    run.velocity[:] = 0.0
    assert np.isfinite(momentum_series(SCENE, run)).all()
    run.angular_velocity[:] = 0.0
    assert momentum_series(SCENE, run) is None


@pytest.mark.parametrize("probe", [None, "heavy top"], ids=["random scene", "probe of the suite"])
def test_stored_violation_states_its_numbers_and_the_command_that_repeats_it(probe, tmp_path):
    """ "my engine" fails the check truth by 0.25 where 1e-5 is allowed. It is stored as a scene file whose
    comments have these numbers and a command of verify, with the probe's name or this file."""
    verdict = Verdict("truth", "free", FAIL, 0.25, 1e-5, "off")
    path = findings.keep(SCENE, verdict, "my engine", tmp_path / "new", *([probe] if probe else []))
    numbers, command, *_ = path.read_text().splitlines()
    assert numbers.startswith("# my engine: truth/") and numbers.endswith(" fails 0.25, allowed 1e-05 off")
    words = ["#", "crosscheck", "verify", "my engine", "--scene", probe or str(path)]
    assert shlex.split(command) == words and Scene.from_file(path) == SCENE


HINGE = Revolute(name="H", bodies=("a", "b"), anchor=(1.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
HINGED = SCENE.with_(joint=(HINGE,), gravity=(0, 0, -9.81), load=(Moment(body="a", moment=(0, 0, 1)),))


def needs_b_and_gravity(smaller: Scene) -> bool:
    return any(body.name == "b" for body in smaller.body) and any(smaller.gravity)


def test_violation_is_reduced_to_the_parts_that_it_needs():
    """The check fails as long as body b is there and gravity is not zero. Within 40 trials the hinge, the
    moment, body a and the spin are removed, and the duration of 1 s falls below a tenth."""
    small = findings.shrunk(HINGED, needs_b_and_gravity, 40)
    assert [body.name for body in small.body] == ["b"] and not small.joint and not small.load
    assert small.gravity == HINGED.gravity and small.body[0].angular_velocity is None and small.duration < 0.1


def test_violation_that_needs_all_parts_is_not_reduced():
    """The made-up check fails for the whole scene only: no smaller one has the violation."""
    assert findings.shrunk(HINGED, lambda smaller: False) is HINGED


def test_reduction_of_a_violation_ends_after_the_trials_allowed():
    """3 smaller scenes are tried where 3 are allowed; the reduction above needs more."""
    tried: list[Scene] = []
    findings.shrunk(HINGED, lambda smaller: not tried.append(smaller) and needs_b_and_gravity(smaller), 3)
    assert len(tried) == 3
