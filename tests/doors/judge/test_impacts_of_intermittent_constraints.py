"""The judge of scenes whose constraints come and go: reference, balances of impacts, wrong runs."""

from dataclasses import replace

import numpy as np
import pytest

import mbref
from crosscheck.engine import BUILT_IN, engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.piecewise import motion_by
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref import Scene
from tests.helpers.intermittent_mechanisms import intermittent_mechanism
from tests.helpers.parts import block, hinge, joint, slide

FORMULATIONS = {"A": natural_motion, "B": tree_motion}
ROUNDING = 1e-13  # of the references, in m, m/s and rad/s of mechanisms of about 1 m
TIMES = np.linspace(0.0, 0.3, 7)
BALANCES = (
    "impact_error",
    "impulse_error",
    "impact_energy_error",
    "violation_position",
    "violation_velocity",
)
CLOSE = 1e-10  # of mbref's balances and violations, whose rounding grows with the singular values of rows


def carts() -> Scene:
    """Two carts on a line that latch at 0.1 s, and let go at 0.3 s."""
    return Scene(
        name="carts",
        duration=0.5,
        body=[
            block("one", (0.0, 0.0, 0.0), 1.0, velocity=[2.0, 0.0, 0.0]),
            block("two", (1.0, 0.0, 0.0), 3.0, velocity=[-1.0, 0.0, 0.0]),
        ],
        joint=[
            slide("A", "ground", "one", (0.0, 0.0, 0.0)),
            slide("B", "ground", "two", (1.0, 0.0, 0.0)),
            joint("L", "fixed", "one", "two", active=[[0.1, 0.3]]),
        ],
    )


def rotors() -> Scene:
    """Two rotors of 0.1 and 0.3 kg m², an armature of 0.2 kg m², and a clutch between them from 0.2 s on."""
    spins = {"angular_velocity": [0.0, 0.0, 6.0]}
    return Scene(
        name="rotors",
        duration=0.4,
        body=[
            block("a", (0.0, 0.0, 0.0), orientation=[1, 0, 0, 0], inertia=[0.1] * 3) | spins,
            block("b", (0.0, 0.0, 1.0), orientation=[1, 0, 0, 0], inertia=[0.3] * 3),
        ],
        joint=[
            hinge("A", "ground", "a", (0.0, 0.0, 0.0), armature=0.2),
            hinge("B", "ground", "b", (0.0, 0.0, 1.0)),
        ],
        coupling=[{"name": "clutch", "joints": ["A", "B"], "ratio": 0.5, "active": [[0.2, 1.0]]}],
    )


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_reference_has_closed_forms_of_a_latch_and_a_clutch(formulation):
    """v = (m₁ v₁ + m₂ v₂) / (m₁ + m₂); ω = I₁ ω₁ / (I₁ + r² I₂) with the ratio r."""
    found = motion_by(FORMULATIONS[formulation], carts(), [0.05, 0.1, 0.3, 0.5], EXTENDED)
    assert np.abs(doubles(found.velocity)[:, :, 0] - [[2, -1], *[[-0.25, -0.25]] * 3]).max() <= ROUNDING
    assert np.abs(doubles(found.position)[-1, :, 0] - [0.1, 0.8]).max() <= ROUNDING
    found = motion_by(FORMULATIONS[formulation], rotors(), [0.1, 0.2, 0.4], EXTENDED)
    after = 0.3 * 6.0 / (0.3 + 0.25 * 0.3)
    wanted = [[6.0, 0.0], *[[after, after / 2]] * 2]
    assert np.abs(doubles(found.angular_velocity)[:, :, 2] - wanted).max() <= ROUNDING


@pytest.mark.parametrize("seed", range(5))
def test_random_impacts_of_mbref_balance_by_the_judge(seed):
    """Momentum of each body and energy at each event; constraints of each piece between them."""
    scene = intermittent_mechanism(seed)
    run = mbref.simulate(scene, times=TIMES)
    found = measure(scene, run)
    assert run.events and found["impact_error"] is not None
    assert {name: found[name] for name in BALANCES if not (found[name] or 0.0) <= CLOSE} == {}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200))
def test_many_random_motions_through_impacts_agree_with_the_reference(seed):
    """Each tenth mechanism is moved by both formulations."""
    scene = intermittent_mechanism(seed)
    run = mbref.simulate(scene, times=TIMES, rtol=1e-11)
    found = measure(scene, run)
    assert {name: found[name] for name in BALANCES if not (found[name] or 0.0) <= CLOSE} == {}
    one = motion_by(natural_motion, scene, TIMES, EXTENDED)
    reached = min(len(one.times), len(run.times))
    assert reached == len(TIMES) or one.reason or run.message
    assert np.abs(doubles(one.position)[:reached] - run.position[:reached]).max() <= 1e-8
    if seed % 10 == 0:
        other = motion_by(tree_motion, scene, TIMES, EXTENDED)
        k = min(len(one.times), len(other.times))
        assert np.abs(doubles(one.position[:k] - other.position[:k])).max() <= 1e-11


def test_wrong_impacts_are_measured():
    """An impulse, a velocity after the latch, or an energy that is 1 % off."""
    scene, run = carts(), mbref.simulate(carts(), times=[0.0, 0.2, 0.5])
    latched = run.events[0]
    impulses = {name: 1.01 * wrench for name, wrench in latched.impulses.items()}
    changes = {
        "impulse_error": {"impulses": impulses},
        "impact_error": {"velocity_after": 1.1 * latched.velocity_after},
        "impact_energy_error": {"energy_after": 1.1 * latched.energy_after},
    }
    assert all(measure(scene, run)[name] <= ROUNDING for name in changes)
    for name, change in changes.items():
        wrong = replace(run, events=(replace(latched, **change), *run.events[1:]))
        assert measure(scene, wrong)[name] > 1e-3


def test_engines_without_intervals_refuse_them_by_name():
    refused = {name: engine(name).cannot(carts()) for name in BUILT_IN if name != "mbref"}
    assert refused and all("joint[L].active has intervals" in str(why) for why in refused.values())
