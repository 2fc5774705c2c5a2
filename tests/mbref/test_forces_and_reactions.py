"""Terms, loads and reactions of small systems / numbers worked out by hand from the laws of motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mbref.cli.run import show
from mbref.equations.joint_reactions import reactions
from mbref.equations.model import Model
from mbref.formulations import FORMULATIONS
from mbref.linear_algebra.elimination import determinant, product_of_pivots
from mbref.motion import Motion
from mbref.scene import (
    Body,
    Driver,
    Force,
    Moment,
    Revolute,
    Scene,
    Sine,
    Spring,
    TorsionSpring,
    Translational,
)
from mbref.stabilisation import STABILISATIONS
from mbref.trajectory import Cost, Outcome, Trajectory
from tests.one_system import solve

SINE = Sine(amplitude=0.3, frequency=2.0, phase=0.4)
POLYNOMIAL = (-0.3 * math.sin(0.4), 0.7, -0.2, 0.05)
BALL = Body(name="ball", mass=2.0, inertia=(0.3, 0.4, 0.5), position=(1.0, 0.0, 0.0))


def driven(t: float) -> tuple[float, float, float]:
    """Value, rate and acceleration of the driver: its derivatives by hand."""
    argument = 2.0 * t + 0.4
    value = POLYNOMIAL[0] + 0.7 * t - 0.2 * t**2 + 0.05 * t**3 + 0.3 * math.sin(argument)
    rate = 0.7 - 0.4 * t + 0.15 * t**2 + 0.6 * math.cos(argument)
    return value, rate, -0.4 + 0.3 * t - 1.2 * math.sin(argument)


@pytest.mark.parametrize("t", [0.0, 0.3, 1.7])
def test_body_on_a_driven_hinge(t: float):
    hinge = Revolute(name="J", bodies=("ground", "ball"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    model = Model(
        Scene(
            name="s",
            body=(BALL,),
            joint=(hinge,),
            driver=(Driver(joint="J", polynomial=POLYNOMIAL, sine=SINE),),
        )
    )
    angle, rate, acceleration = driven(t)
    c, s = math.cos(angle), math.sin(angle)
    q = np.array([c, s, 0.0, math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])
    v = np.array([-s * rate, c * rate, 0.0, 0.0, 0.0, rate])
    a = np.array([-s * acceleration - c * rate**2, c * acceleration - s * rate**2, 0, 0, 0, acceleration])
    terms = model.terms(t, q, v)
    assert np.abs(terms.phi).max() < 1e-14
    assert np.abs(terms.jacobian @ v - terms.nu).max() < 1e-14
    assert np.abs(terms.jacobian @ a - terms.gamma).max() < 1e-13


@pytest.mark.parametrize("t", [0.0, 0.3, 1.7])
def test_body_on_a_driven_slide(t: float):
    slide = Translational(name="J", bodies=("ground", "ball"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 3.0, 4.0))
    model = Model(
        Scene(
            name="s",
            body=(BALL,),
            joint=(slide,),
            driver=(Driver(joint="J", polynomial=POLYNOMIAL, sine=SINE),),
        )
    )
    along, still = np.array([0.0, 0.6, 0.8, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    value, rate, acceleration = driven(t)
    q = still + value * np.append(along, 0.0)
    terms = model.terms(t, q, rate * along)
    assert np.abs(terms.phi).max() < 1e-14
    assert np.abs(terms.jacobian @ (rate * along) - terms.nu).max() < 1e-14
    assert np.abs(terms.jacobian @ (acceleration * along) - terms.gamma).max() < 1e-14


@pytest.mark.parametrize(
    ("rows", "negative"),
    [
        ([[2.0, 1.0], [1.0, 3.0]], False),
        ([[0.0, 1.0], [1.0, 0.0]], True),
        ([[1.0, 2.0], [2.0, 1.0]], True),
        ([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], False),
        ([[-1.0, 5.0, 2.0], [0.0, 2.0, 7.0], [0.0, 0.0, 3.0]], True),
    ],
)
def test_the_sign_of_a_determinant(rows, negative):
    sign, size = determinant(np.array(rows), len(rows))
    assert sign == negative and np.exp(size) == pytest.approx(abs(np.linalg.det(rows)))


@pytest.mark.parametrize("pivots", ([2.0, -3.0, 0.5], [-1.0, -2.0], [1e-120, -1e-120, 4.0], []))
def test_the_product_of_pivots(pivots):
    negative, size = product_of_pivots(np.array(pivots), len(pivots))
    assert negative == (np.prod(np.sign(pivots)) < 0.0)
    assert size == pytest.approx(np.sum(np.log(np.abs(pivots))))


@pytest.mark.parametrize(
    ("method", "shown"),
    [("alf-dual+projection/taylor", "taylor"), ("lm1+none/rk4[step=1e-4]", "lm1+none/rk4[step=1e-4]")],
)
def test_outcome_and_cost_that_a_run_prints(method, shown, capsys):
    cost = Cost(1.25, 2.5, steps=11, rejected=22, rhs=33, factorisations=44, newton=55)
    none = Trajectory.failed(
        scene="s",
        engine="e",
        version="1",
        method=method,
        settings={},
        bodies=("ball",),
        outcome=Outcome.TIMED_OUT,
        message="",
    )
    scene = Scene(name="s", body=(BALL,))
    show(scene, Motion.of(scene, replace(none, cost=cost)))
    assert capsys.readouterr().out.splitlines() == [
        f"s by {shown}: TIMED_OUT at t = 0 s",
        "11 steps, 22 rejected, 33 evaluations",
        "44 factorisations, 55 Newton iterations",
        "1.25 s of stepping, 2.5 s of building",
    ]


def test_gains_of_baumgarte():
    assert STABILISATIONS["baumgarte"].feedback({"alpha": 3.0, "beta": 7.0}) == (6.0, 49.0)


def force_of(*loads, velocity=(0.0,) * 6, gravity=(0.0, 0.0, 0.0), body=BALL, joint=()) -> np.ndarray:
    """g of a body that stands as the scene has it."""
    model = Model(Scene(name="s", body=(body,), joint=joint, load=loads, gravity=gravity))
    return model.terms(0.0, model.start(), np.array(velocity)).force


def test_weight_and_gyroscopic_moment():
    """m g; -ω × J ω = -(w_y w_z (J_z - J_y), w_z w_x (J_x - J_z), w_x w_y (J_y - J_x))."""
    g = force_of(velocity=(0.0, 0.0, 0.0, 1.0, 2.0, 3.0), gravity=(0.1, 0.2, -9.81))
    assert g == pytest.approx([0.2, 0.4, -19.62, -2 * 3 * 0.1, -3 * 1 * -0.2, -1 * 2 * 0.1])


def test_force_beside_the_centre_and_moment():
    push = Force(body="ball", point=(1.0, 0.5, 0.0), force=(2.0, 0.0, 3.0))
    assert force_of(push) == pytest.approx([2.0, 0.0, 3.0, 1.5, 0.0, -1.0])
    quarter = BALL.model_copy(update={"orientation": (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))})
    twist = Moment(body="ball", moment=(5.0, 0.0, 0.0))
    assert force_of(twist, body=quarter) == pytest.approx([0, 0, 0, 0, -5.0, 0], abs=1e-12)


def test_damped_spring_between_ground_and_body():
    """Stretched by 0.5 m and growing at 2 m/s, it pulls back with 10 · 0.5 + 3 · 2 N."""
    spring = Spring(
        bodies=("ground", "ball"),
        points=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        stiffness=10.0,
        damping=3.0,
        natural_length=0.5,
    )
    assert force_of(spring, velocity=(2.0, 0.0, 0.0, 0.0, 0.0, 0.0)) == pytest.approx([-11.0, 0, 0, 0, 0, 0])
    other = spring.model_copy(update={"bodies": ("ball", "ground"), "points": spring.points[::-1]})
    assert force_of(other, velocity=(2.0, 0.0, 0.0, 0.0, 0.0, 0.0)) == pytest.approx([-11.0, 0, 0, 0, 0, 0])


@pytest.mark.parametrize("pair", [("ground", "ball"), ("ball", "ground")])
def test_damped_torsion_spring(pair):
    """At angle 0, natural angle 0.25 rad, rate 2 rad/s of the second body against the first."""
    hinge = Revolute(name="J", bodies=pair, anchor=(1.0, 0.0, 0.0), axis=(0.0, 0.0, 2.0))
    twist = TorsionSpring(joint="J", stiffness=8.0, damping=0.5, natural_angle=0.25)
    sign = 1.0 if pair[1] == "ball" else -1.0
    g = force_of(twist, velocity=(0.0, 0.0, 0.0, 0.0, 0.0, 2.0), joint=(hinge,))
    assert g == pytest.approx([0, 0, 0, 0, 0, sign * (8.0 * 0.25 - 0.5 * sign * 2.0)])


@pytest.mark.parametrize(("pair", "sign"), [(("ground", "ball"), 1.0), (("ball", "ground"), -1.0)])
def test_reaction_on_the_second_body_of_a_cantilever(pair, sign: float):
    """A weight of 20 N, 1 m beside its clamp: 20 N up and 20 N m hold it; the ground feels the opposite."""
    from mbref.scene import Fixed

    clamp = Fixed(name="J", bodies=pair, anchor=(0.0, 0.0, 0.0))
    model = Model(Scene(name="s", body=(BALL,), joint=(clamp,), gravity=(0.0, -10.0, 0.0)))
    q, v = model.start(), np.zeros(6)
    terms = model.terms(0.0, q, v)
    lm1 = FORMULATIONS["lm1"]
    _, _, multipliers = solve(lm1, terms.mass, terms.jacobian, terms.force, terms.gamma)
    q = q.reshape(1, 1, 7)
    found = reactions(model, q, model.terms(np.zeros(1), q).blocks, multipliers[None])["J"][0]
    assert found == pytest.approx(sign * np.array([0.0, 20.0, 0.0, 0.0, 0.0, 20.0]), abs=1e-9)
