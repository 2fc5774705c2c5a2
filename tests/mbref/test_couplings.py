"""Couplings of joint coordinates and armatures: closed forms, equations, reactions, faults."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import mbref
from mbref.equations.along_trajectory import violations
from mbref.equations.model import Model, displaced
from mbref.scene import JOINT_TYPES, Scene, SceneError
from tests.helpers import coupled_mechanisms
from tests.helpers.coupled_mechanisms import EVERY, G, gear_pair, pendulum, rack, screw, slide_with_motor

METHODS = ("taylor", "alf-dual+projection/dop853")
NO_SLIDE = "is revolute, which has no displacement to be coupled"
CLOSED_FORM = 1e-12  # relative to the largest value


def coordinates(scene: Scene, method: str, name: str, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle and displacement of a joint."""
    motion = mbref.simulate(scene, method=method, times=times, rtol=1e-13)
    assert motion.outcome.name == "COMPLETED", motion.message
    found = motion.joint(name)
    return found.angle, found.displacement


def agree(found: np.ndarray, exact: np.ndarray) -> None:
    off = np.abs(found - exact).max() / np.abs(exact).max()
    assert off <= CLOSED_FORM, f"{off:.1e} from the closed form"


@pytest.mark.parametrize("method", METHODS)
def test_gear_pair_turns_as_its_closed_form_over_many_turns(method):
    times = np.linspace(0, 3, 61)
    inertia = 0.03 + 0.5**2 * 0.2
    angle = 2.0 / inertia * times**2 / 2
    assert angle[-1] > 15 * 2 * np.pi
    agree(coordinates(gear_pair(), method, "A", times)[0], angle)
    agree(coordinates(gear_pair(), method, "B", times)[0], -0.5 * angle)


def test_violation_counts_full_turns_of_coupled_angles():
    motion = mbref.simulate(gear_pair(), times=np.linspace(0, 3, 61), rtol=1e-13)
    turned = motion.joint("A").angle
    assert turned[-1] > 15 * 2 * np.pi and motion.violation.position.max() < 1e-12
    other = gear_pair().with_("coupling[teeth].ratio", -0.51)
    assert violations(other, motion).position == pytest.approx(0.01 * turned, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_rack_falls_as_its_closed_form(method):
    times = np.linspace(0, 2, 21)
    falls = -1.5 * G / (1.5 + 0.2 / 0.05**2) * times**2 / 2
    agree(coordinates(rack(), method, "B", times)[1], falls)
    agree(coordinates(rack(), method, "A", times)[0], falls / 0.05)


@pytest.mark.parametrize("method", METHODS)
def test_nut_turns_down_a_screw_as_its_closed_form(method):
    times = np.linspace(0, 2, 21)
    turns = -2.0 * G * 0.01 / (0.02 + 2.0 * 0.01**2) * times**2 / 2
    angle, displacement = coordinates(screw(), method, "S", times)
    agree(angle, turns)
    agree(displacement, 0.01 * turns)


@pytest.mark.parametrize("method", METHODS)
def test_pendulum_with_armature_swings_as_jacobi_has_it(method):
    """From rest at 90° the angle from below φ has sin(φ/2) = k cd(ω t), k = sin 45°."""
    times = np.linspace(0, 3, 16)
    frequency = np.sqrt(1.2 * G * 0.5 / (0.03 + 1.2 * 0.5**2 + 0.3))
    sn = ellipj(frequency * times + ellipk(0.5), 0.5)[0]
    exact = 2 * np.arcsin(np.sqrt(0.5) * sn) - np.pi / 2
    agree(coordinates(pendulum(), method, "A", times)[0], exact)


@pytest.mark.parametrize("method", METHODS)
def test_reflected_mass_slows_a_slide(method):
    times = np.linspace(0, 1, 6)
    exact = 2.0 * G * 0.6 / (2.0 + 1.5) * times**2 / 2
    agree(coordinates(slide_with_motor(), method, "A", times)[1], exact)


def test_counts_have_couplings_and_rotors():
    counts = mbref.diagnose(coupled_mechanisms.planetary()).counts
    assert counts.rows_by_joint == {"A": 5, "B": 5, "armature of A": 6, "armature of B": 6, "mesh": 1}
    assert counts.degrees_of_freedom == 1


@pytest.mark.parametrize("make", EVERY, ids=lambda make: make.__name__)
def test_jacobian_and_gamma_are_derivatives_of_phi_anywhere(make):
    """Also off the constraints, where the axes of a joint are not parallel."""
    model, rng, e = Model(make()), np.random.default_rng(3), 1e-6
    q = displaced(model.start(), 0.3 * rng.normal(size=model.n))
    v = rng.normal(size=model.n)
    found = model.terms(0.0, q, v)
    slopes = [
        (model.terms(0.0, displaced(q, d), v).phi - model.terms(0.0, displaced(q, -d), v).phi) / (2 * e)
        for d in e * np.eye(model.n)
    ]
    assert np.abs(np.array(slopes).T - found.jacobian).max() < 2e-9
    ahead, behind = (model.terms(0.0, displaced(q, s * e * v), v).jacobian @ v for s in (1, -1))
    assert np.abs((ahead - behind) / (2 * e) + found.gamma).max() < 2e-8


def test_teeth_carry_the_torque_that_turns_the_wheel():
    motion = mbref.simulate(gear_pair(), times=[0.0, 1.0])
    change = 2.0 / (0.03 + 0.5**2 * 0.2)
    assert motion.joint("B").moment[:, 2] == pytest.approx(-0.5 * change * 0.2, rel=1e-12)
    assert motion.joint("A").moment[:, 2] == pytest.approx(change * 0.03 - 2.0, rel=1e-12)


def test_armature_acts_on_its_joint():
    motion = mbref.simulate(pendulum(), times=[0.0])
    change = motion.angular_acceleration[0, 0, 2]
    assert motion.joint("A").moment[0, 2] == pytest.approx(-0.3 * change, rel=1e-12)


@pytest.mark.parametrize(
    ("kind", "coordinate"),
    [
        ("revolute", "angle"),
        ("cylindrical", "angle"),
        ("planar", "angle"),
        ("translational", "displacement"),
        ("inline", "displacement"),
    ],
)
def test_default_coordinate_of_a_coupled_joint(kind, coordinate):
    axle = JOINT_TYPES[kind].at("A", ("ground", "disc"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    scene = gear_pair()
    scene = scene.with_(joint=(axle.model_copy(update={"bodies": scene.joint[0].bodies}), scene.joint[1]))
    assert [end for _, end in scene.coupled(scene.coupling[0])] == [coordinate, "angle"]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"joints": ["A", "C"]}, "coupling[teeth].joints[1]: unknown joint 'C'; known: A, B"),
        ({"joints": ["A", "A"]}, f"coupling[teeth].joints: 'A' {NO_SLIDE}"),
        ({"ratio": 0.0}, "coupling[teeth].ratio: must not be 0, which would lock the second joint"),
        ({"coordinates": ["angle", "displacement"]}, f"coupling[teeth].joints: 'B' {NO_SLIDE}"),
        ({"name": "A"}, "coupling[A].name: 'A' is already the name of a joint"),
        ({"joints": ["A"]}, "coupling[teeth].joints: must be two names of joints, got ['A']"),
        ({"ratios": 1.0}, "coupling[teeth].ratios: is not a known field; did you mean 'ratio'?"),
    ],
)
def test_faulty_couplings_are_named(change, fault):
    entry = {"name": "teeth", "joints": ["A", "B"], "ratio": -0.5} | change
    with pytest.raises(SceneError) as found:
        gear_pair(coupling=[entry])
    assert found.value.faults == [fault]


def test_armature_must_not_be_negative():
    with pytest.raises(SceneError, match=r"joint\[A\].armature: must not be negative, got -1"):
        pendulum().with_("joint[A].armature", -1.0)


def test_files_keep_couplings_and_armatures(tmp_path):
    for make in EVERY:
        make().save(tmp_path / "scene.toml")
        assert Scene.from_file(tmp_path / "scene.toml") == make()


def test_velocities_that_contradict_a_coupling_are_refused():
    bodies = [body.model_copy(update={"angular_velocity": (0.0, 0.0, 1.0)}) for body in gear_pair().body]
    with pytest.raises(SceneError, match=r"teeth.*velocities given to bodies violate it"):
        mbref.simulate(gear_pair().with_(body=tuple(bodies)), times=[0.0])


def test_drawing_shows_a_coupling():
    assert 'stroke-dasharray="1 5"' in gear_pair()._repr_html_()
    assert 'stroke-dasharray="1 5"' not in pendulum()._repr_html_()
