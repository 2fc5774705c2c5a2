"""Couplings by a polynomial, q₂ = P(q₁): closed forms, restarts, offsets, the judge, MJCF."""

import numpy as np
import pytest

import mbref
from crosscheck.engine import engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.driver_forces import driver_forces
from crosscheck.judge.metrics import measure
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref import Scene
from mbref.cli import main
from tests.helpers.coupled_mechanisms import body
from tests.helpers.parts import X, Z, hinge, slide

LAW = (0.5, 0.3, -0.02)
P = np.polynomial.Polynomial([0.0, *LAW])
SPEED, TIMES = 4.0, np.linspace(0.0, 2.0, 9)  # 8 rad, so that the slope depends on full turns
INERTIA = {"A": 0.3, "B": 2.0}  # kg m² about the hinge's axis, or kg along the slide
ROUNDED = 1e-12  # relative to the largest value, some thousand roundings
TOLERANCE = 1e-9  # m, rad, and relative to SPEED: the default rtol
METHODS = pytest.mark.parametrize("method", ["taylor", "alf-dual+projection/dop853"])


def cam(lead: str = "angle", follow: str = "displacement", **changes) -> Scene:
    """Two bodies on hinges or slides, coupled by the law P. Only the first has a given velocity."""
    fast = {"angular_velocity": [0.0, 0.0, SPEED]} if lead == "angle" else {"velocity": [SPEED, 0.0, 0.0]}
    parts = {"body": [], "joint": []}
    for name, kind, place, given in (("A", lead, (0, 0, 0), fast), ("B", follow, (0, 1, 0), {})):
        parts["body"].append(body(name.lower(), INERTIA[name], [INERTIA[name]] * 3, place, **given))
        maker, axis = (hinge, Z) if kind == "angle" else (slide, X)
        parts["joint"].append(maker(name, "ground", name.lower(), place, axis))
    coupling = [{"name": "cam", "joints": ["A", "B"], "polynomial": list(LAW)}]
    return Scene(**{"name": "cam", "duration": 2.0, **parts, "coupling": coupling, **changes})


def coordinate(motion, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a joint's angle or displacement, its rate, and the reaction along it."""
    found = motion.joint(name)
    if found.angle is not None:
        return found.angle, found.rate, found.moment[:, 2]
    return found.displacement, found.displacement_rate, found.force[:, 0]


@METHODS
@pytest.mark.parametrize("follow", ["angle", "displacement"])
def test_driven_leader_moves_its_follower_by_the_polynomial(follow, method):
    """q₁ = ω t gives q₂ = P, q₂' = P' ω, q₂'' = P'' ω², and the torque P' · I₂ P'' ω² of the driver."""
    scene = cam(follow=follow, driver=[{"joint": "A", "polynomial": [0.0, SPEED]}])
    motion, q = mbref.simulate(scene, method, times=TIMES), SPEED * TIMES
    second = motion.angular_acceleration[:, 1, 2] if follow == "angle" else motion.acceleration[:, 1, 0]
    torque = P.deriv()(q) * INERTIA["B"] * P.deriv(2)(q) * SPEED**2
    wanted = P(q), P.deriv()(q) * SPEED, P.deriv(2)(q) * SPEED**2, torque, torque
    forces = motion.driver("A").torque, driver_forces(scene, motion)["A"]
    for found, exact in zip((*coordinate(motion, "B")[:2], second, *forces), wanted, strict=True):
        assert np.abs(found - exact).max() <= ROUNDED * np.abs(exact).max()


@METHODS
@pytest.mark.parametrize("lead", ["angle", "displacement"])
def test_coupling_conserves_energy_and_the_powers_of_its_two_forces_cancel(lead, method):
    """(I₁ + P'² I₂) q₁'² is constant, which is the truth of q₁'. The coupling's forces -P' μ on the first
    body and μ on the second have opposite powers, as q₂' = P' q₁'."""
    motion = mbref.simulate(cam(lead), method, times=TIMES)
    (q, rate, force), (value, follower, push) = coordinate(motion, "A"), coordinate(motion, "B")
    reduced = INERTIA["A"] + P.deriv()(q) ** 2 * INERTIA["B"]
    assert np.abs(rate - rate[0] * np.sqrt(reduced[0] / reduced)).max() <= TOLERANCE * SPEED
    assert np.abs(value - P(q)).max() <= ROUNDED * np.abs(P(q)).max()
    assert np.abs(force * rate + push * follower).max() <= 10 * ROUNDED * np.abs(force * rate).max()


@pytest.mark.parametrize("lead", ["angle", "displacement"])
def test_scene_at_1_s_continues_the_motion_of_a_polynomial_coupling(lead):
    """At 1 s the angle is beyond half a turn, so that its full turns must be in the scene."""
    motion = mbref.simulate(cam(lead), times=TIMES)
    later = mbref.simulate(motion.scene_at(TIMES[4]), times=TIMES[4:] - TIMES[4])
    assert np.abs(later.position - motion.position[4:]).max() <= TOLERANCE


@pytest.mark.parametrize("lead", ["angle", "displacement"])
def test_polynomial_that_holds_for_a_while_has_the_slope_of_all_turns(lead):
    """It holds from q₁ = 7 rad or m on, by an impact: (I₁ + P'² I₂) q₁' = I₁ ω just after, then its energy
    is constant, also after it lets go, and q₂' = P' q₁' where it does, at 2 s."""
    law = {**cam(lead).coupling[0].model_dump(), "active": [[7.0 / SPEED, 2.0]]}
    motion = mbref.simulate(cam(lead, coupling=[law]), times=[7.0 / SPEED, 2.0, 3.0])
    (q, rate, _), (_, follower, _) = coordinate(motion, "A"), coordinate(motion, "B")
    slopes = P.deriv()(q[:2])
    reduced = INERTIA["A"] + slopes**2 * INERTIA["B"]
    wanted = INERTIA["A"] * SPEED / np.sqrt(reduced[0] * reduced[[0, 1, 1]])
    assert np.abs([rate - wanted, follower - slopes[[0, 1, 1]] * wanted]).max() <= TOLERANCE


def test_formulations_of_the_judge_agree_with_mbref_over_full_turns():
    """Both formulations agree to extended precision, and mbref with them to rounding; its joints, rates and
    accelerations obey the judge's equations of the coupling."""
    scene, times = cam(), TIMES[[0, 8]]
    one, other = natural_motion(scene, times, EXTENDED), tree_motion(scene, times, EXTENDED, seconds=60.0)
    assert np.abs(doubles(one.position - other.position)).max() <= 1e-16  # extended precision
    motion = mbref.simulate(scene, "taylor", times=times, rtol=1e-13)
    assert np.abs(motion.position - doubles(one.position)).max() <= 10 * ROUNDED
    found = measure(scene, motion, None)
    assert max(found[f"violation_{level}"] for level in ("position", "velocity", "acceleration")) <= ROUNDED


def test_offset_starts_at_a_pose_of_the_polynomial():
    """q₂ = 1.2 m + P(q₁) at the start and later; the file's poses do not satisfy it."""
    motion = mbref.simulate(cam("displacement").with_("coupling[cam].offset", 1.2), times=TIMES)
    q, value = (coordinate(motion, name)[0] for name in "AB")
    assert np.abs(q[0]) > 0.1  # m, by which the start moves A, too
    assert np.abs(value - 1.2 - P(q)).max() <= ROUNDED * np.abs(P(q)).max()


def test_mjcf_keeps_the_polynomial_and_engines_without_it_refuse(tmp_path):
    """An export and import give the polynomial back, MuJoCo maps it, and Pinocchio refuses it. A keyframe at
    q₁ = 1, q₂ = P(1) gives the polynomial from there: P', P''/2 and P'''/6."""
    scene, file = tmp_path / "cam.toml", tmp_path / "cam.xml"
    cam().save(scene)
    main(["export", str(scene), "--out", str(file)])
    main(["import", str(file), "--out", str(scene), "--force"])
    assert Scene.from_file(scene).coupling == cam().coupling
    key = f'<keyframe><key name="up" qpos="1 {P(1.0)}"/></keyframe></mujoco>'
    file.write_text(file.read_text().replace("</mujoco>", key))
    main(["import", str(file), "--keyframe", "up", "--out", str(scene), "--force"])
    at = np.array(Scene.from_file(scene).coupling[0].polynomial)
    assert np.abs(at - [P.deriv()(1.0), P.deriv(2)(1.0) / 2, LAW[2]]).max() <= ROUNDED
    assert engine("mujoco").supports.missing(cam()) is None
    assert "'cam' is a polynomial of degree 3" in str(engine("pinocchio").supports.missing(cam()))


@METHODS
@pytest.mark.parametrize("law", [(0.3, 0, 0, -0.4), (1.0, -1.0, 1 / 3), LAW], ids=["end", "tangent", "LAW"])
def test_driver_of_the_follower_beyond_the_first_end_of_the_polynomial_comes_to_a_dead_position(law, method):
    """From rest q₂ = 3 t² reaches the value of P at its first q₁ with P' = 0: no q₁ satisfies the coupling
    beyond, or, where P only has a level tangent, q₁' would be infinite. Projection ends up to 2e-6 s before,
    where P' is 1e-3 of its largest value."""
    polynomial = np.polynomial.Polynomial([0.0, *law])
    ends = [root.real for root in polynomial.deriv().roots() if abs(root.imag) < 1e-6 and root.real > 0.0]
    coupling = [{"name": "cam", "joints": ["A", "B"], "polynomial": list(law)}]
    driven = cam(coupling=coupling, driver=[{"joint": "B", "polynomial": [0.0, 0.0, 3.0]}], duration=5.0)
    still = driven.with_(body=[each.model_copy(update={"angular_velocity": None}) for each in driven.body])
    motion = mbref.simulate(still, method)
    assert "the drivers come to a dead position" in motion.message
    left = np.sqrt(polynomial(min(ends)) / 3.0) - motion.t_end
    assert abs(left) < 1e-9 if method == "taylor" else 0.0 < left < 2e-6


@pytest.mark.parametrize("start", [0.0, 0.5])
def test_driver_of_the_follower_meets_a_singular_position_where_the_slope_vanishes(start):
    """q₂ = (t - start)² - start², and P alike in q₁, so that q₁ = t. P' is 0 at ``start``, where projection
    ends. Velocities of no branch there, q₁' = 4, are refused."""
    coupling = [{"name": "cam", "joints": ["A", "B"], "polynomial": [-2 * start, 1.0]}]
    scene = cam(driver=[{"joint": "B", "polynomial": [0.0, -2 * start, 1.0]}], coupling=coupling)
    assert start or "agree with none of the branches" in mbref.simulate(scene).message
    scene = scene.with_("body[a].angular_velocity[2]", 1.0)
    motion = mbref.simulate(scene, times=TIMES)
    assert np.abs(motion.joint("A").angle - TIMES).max() <= TOLERANCE
    ended = mbref.simulate(scene, "alf-dual+projection")
    assert ended.outcome.name == "SINGULAR_POSITION" and ended.t_end == pytest.approx(start, abs=1e-9)
