"""The judge of scenes whose constraints come and go: reference, balances of impacts, wrong runs, engines."""

from dataclasses import replace

import numpy as np
import pytest

import mbref
from crosscheck.engine import Setting, engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref import Scene
from tests.helpers.intermittent_mechanisms import carts, conditional_mechanism, intermittent_mechanism, rotors
from tests.helpers.parts import hinge, joint, rod

FORMULATIONS = {"A": natural_motion, "B": tree_motion}
ROUNDING = 1e-13  # of the references, in m, m/s and rad/s of mechanisms of about 1 m
TIMES = np.linspace(0.0, 0.3, 7)
BALANCES = (
    *("impact_error", "impulse_error", "impact_energy_error", "violation_position", "violation_velocity"),
)
SETTINGS = {
    "mujoco": Setting("tuned", {"step": 1e-3, "beta": 50.0, "hard": 1e-7}),
    "pinocchio": Setting("tuned", {"rtol": 1e-10, "min_step": 1e-5}),
}
CLOSE = 1e-10  # of mbref's balances and violations, whose rounding grows with the singular values of rows


def caught() -> Scene:
    """Two falling rods that a ball joint catches at 0.3 s, so that they come to rest, and that move again."""
    return Scene(
        name="caught",
        gravity=(0.0, -9.81, 0.0),
        duration=1.0,
        body=[rod("a", (0, 0, 0), (1, 0, 0), 2.0), rod("b", (1, 0, 0), (1.8, 0, 0), 1.0)],
        joint=[
            hinge("A", "ground", "a", (0.0, 0.0, 0.0)),
            joint("B", "spherical", "a", "b", (1.0, 0.0, 0.0), active=[[0.0, 0.6]]),
            joint("C", "spherical", "b", "ground", (1.6, 0.0, 0.0), active=[[0.3, 0.7]]),
            joint("W", "fixed", "a", "b", (1.0, 0.0, 0.0), active=[[0.5, 0.6]]),
        ],
    )


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_reference_has_closed_forms_of_a_latch_and_a_clutch(formulation):
    """Carts of 1 kg at 2 m/s and 3 kg at -1 m/s latch: v = (m₁ v₁ + m₂ v₂) / (m₁ + m₂). A clutch of the ratio
    r = 0.5 couples I₂ = 0.3 kg m² to I₁ = 0.3 kg m² at 6 rad/s: ω = I₁ ω₁ / (I₁ + r² I₂)."""
    found = motion_by(FORMULATIONS[formulation], carts(), [0.05, 0.1, 0.3, 0.5], EXTENDED)
    assert np.abs(doubles(found.velocity)[:, :, 0] - [[2, -1], *[[-0.25, -0.25]] * 3]).max() <= ROUNDING
    assert np.abs(doubles(found.position)[-1, :, 0] - [0.1, 0.8]).max() <= ROUNDING
    found = motion_by(FORMULATIONS[formulation], rotors(), [0.1, 0.2, 0.4], EXTENDED)
    after = 0.3 * 6.0 / (0.3 + 0.25 * 0.3)
    wanted = [[6.0, 0.0], *[[after, after / 2]] * 2]
    assert np.abs(doubles(found.angular_velocity)[:, :, 2] - wanted).max() <= ROUNDING


DRAWN = [(intermittent_mechanism, 0), (intermittent_mechanism, 1), (intermittent_mechanism, 3)]
DRAWN += [(conditional_mechanism, 2), (conditional_mechanism, 3)]


@pytest.mark.parametrize(("make", "seed"), DRAWN)
def test_momentum_and_energy_balance_by_the_judge_in_random_impacts_of_mbref(make, seed):
    """The judge measures from the run alone how far each body's momentum and the energy are out of balance at
    each event, and constraints are violated between the events: BALANCES are at most CLOSE."""
    scene = make(seed)
    run = mbref.simulate(scene, times=TIMES)
    found = measure(scene, run)
    assert run.events and found["impact_error"] is not None
    assert {name: found[name] for name in BALANCES if not (found[name] or 0.0) <= CLOSE} == {}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200))
def test_many_random_motions_through_impacts_agree_with_the_reference(seed):
    """Positions agree to 1e-8 m, 1000 rtol, as impacts magnify errors. A motion may end early with a reason.
    Every fourth mechanism has conditions, of which the reference finds its own events."""
    scene = (intermittent_mechanism if seed % 4 else conditional_mechanism)(seed)
    run = mbref.simulate(scene, times=TIMES, rtol=1e-11)
    found = measure(scene, run)
    assert {name: found[name] for name in BALANCES if not (found[name] or 0.0) <= CLOSE} == {}
    one = motion_by(natural_motion, scene, TIMES, EXTENDED)
    reached = min(len(one.times), len(run.times))
    assert reached == len(TIMES) or one.reason or run.message
    assert np.abs(doubles(one.position)[:reached] - run.position[:reached]).max() <= 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(0, 200, 10))
def test_both_formulations_of_the_reference_move_random_mechanisms_alike_through_impacts(seed):
    """The formulations share no equations. Positions agree to 1e-11 m, 100 times a reference's rounding."""
    scene = intermittent_mechanism(seed)
    one, other = (motion_by(f, scene, TIMES, EXTENDED) for f in FORMULATIONS.values())
    k = min(len(one.times), len(other.times))
    assert np.abs(doubles(one.position[:k] - other.position[:k])).max() <= 100 * ROUNDING


def test_wrong_impulse_velocity_and_energy_of_an_impact_are_measured_by_a_metric_each():
    """Right impacts are off by rounding. Faults are 1 % of an impulse, and 10 % of velocities or energy."""
    scene, run = carts(), mbref.simulate(carts(), times=[0.0, 0.2, 0.5])
    latched = run.events[0]
    changes = {
        "impulse_error": {"impulses": {name: 1.01 * wrench for name, wrench in latched.impulses.items()}},
        "impact_error": {"velocity_after": 1.1 * latched.velocity_after},
        "impact_energy_error": {"energy_after": 1.1 * latched.energy_after},
    }
    assert all(measure(scene, run)[name] <= ROUNDING for name in changes)
    for name, change in changes.items():
        wrong = replace(run, events=(replace(latched, **change), *run.events[1:]))
        assert measure(scene, wrong)[name] > 1e-3, name  # a tenth of the least change, 0.01


# m, m/s, rad/s; five times the error of MuJoCo's steps of 1 ms with soft equalities
SWITCHED = {"position": 1e-8, "velocity": 1e-7, "angular_velocity": 1e-7}


@pytest.mark.parametrize(
    ("name", "make"),
    [("mujoco", carts), ("mujoco", rotors), ("mujoco", caught), ("pinocchio", carts), ("pinocchio", caught)],
)
def test_engine_with_switched_constraints_moves_as_the_judges_reference(name, make):
    """MuJoCo switches equalities, Pinocchio constraint models; the judge's reference has no engine's code."""
    scene, times = make(), np.linspace(0.0, make().duration, 5)
    run = engine(name).run(scene, times, SETTINGS[name])
    exact = motion_by(natural_motion, scene, times, EXTENDED)
    for field, limit in SWITCHED.items():
        assert np.abs(getattr(run, field) - doubles(getattr(exact, field))).max() <= limit, field


HINGED = carts(type="revolute", anchor=[0, 0, 0], axis=[0, 0, 1])  # the latch L is a hinge


@pytest.mark.parametrize(
    ("name", "scene", "says"),
    [
        ("pinocchio", rotors(), "coupling 'clutch': constraintDynamics couples no joint coordinates"),
        ("exudyn", rotors(), "coupling[clutch].active has intervals,"),
        ("exudyn", carts(), "joint[L].active has intervals,"),
        ("mujoco", HINGED, "joint 'L' of type 'revolute' has intervals"),
        ("pinocchio", HINGED, "joint 'L' of type 'revolute' has intervals"),
    ],
)
def test_engine_refuses_a_part_with_intervals_that_its_adapter_does_not_map_by_name(name, scene, says):
    """Pinocchio's constraint models join frames, and none joins coordinates. The adapter of Exudyn maps no
    intervals; the others switch constraints of a point or a frame, and a hinge has an axis. All take the
    carts if their latch always holds."""
    assert str(engine(name).cannot(scene)).startswith(says)
    assert engine(name).cannot(carts(active=None)) is None
