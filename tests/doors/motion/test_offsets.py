"""Offsets of couplings: closed forms, the assembled start, loads that move with it, and faults."""

import numpy as np
import pytest

import mbref
from mbref.ensembles.simulate_all import simulate_all
from mbref.equations.model import Model
from mbref.motions.drawing.shapes import at_rest
from mbref.scene import Scene, SceneError
from mbref.simulation.simulate import Limits
from tests.helpers.coupled_mechanisms import (
    G,
    coupled_loops,
    gear_pair,
    planetary,
    rack,
    screw,
    shifted,
    spatial_chain,
)

METHODS = ("taylor", "alf-dual+projection/dop853")
CLOSED_FORM = 1e-12  # of the largest value, and of constraints (m, rad)
STEPS = 5e-3  # relative; the least displacement is found in finite steps, each the least one
EVERY = (
    (gear_pair, "teeth", 0.4),
    (gear_pair, "teeth", -7.0),
    (rack, "teeth", 0.3),
    (screw, "thread", -0.2),
    (planetary, "mesh", 1.2),
    (spatial_chain, "cable", 0.4),
    (coupled_loops, "gears", 0.1),
)
every = pytest.mark.parametrize(
    ("make", "name", "offset"), EVERY, ids=[f"{make.__name__} {offset}" for make, _, offset in EVERY]
)


def error(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest difference over the largest exact value, if that is above 1."""
    return float(np.abs(found - exact).max() / max(1.0, np.abs(exact).max()))


# maker, coupling, offset, ratio r; end (s); inertias J of the first and m of the second coordinate, and the
# constant force on the first: a torque, or the weight of rack or nut times -r
STARTS = {
    "gear pair": (gear_pair, "teeth", 0.4, -0.5, 2.0, 0.03, 0.2, 2.0),
    "rack": (rack, "teeth", 0.003, 0.05, 1.0, 0.2, 1.5, -1.5 * G * 0.05),
    "screw": (screw, "thread", 0.2, 0.01, 1.0, 0.02, 2.0, -2.0 * G * 0.01),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("of", STARTS)
def test_coupled_coordinates_start_by_the_least_displacement_and_move_from_there(of, method):
    """The least J a² + m b² with b = c + r a, c the offset, has a = -r m c / J' and b = J c / J', to 0.5 %
    (STEPS), as it is found in finite steps. From there the force in STARTS moves a with the constant
    acceleration force / J', J' = J + r² m, to rounding (CLOSED_FORM), by two methods."""
    make, name, offset, ratio, end, first, second, force = STARTS[of]
    times, inertia = np.linspace(0, end, 11), first + ratio**2 * second
    motion = mbref.simulate(shifted(make, name, offset), method=method, times=times, rtol=1e-13)
    ends = motion.mechanism.coupled(motion.mechanism.coupling[0])
    a, b = (getattr(motion.joint(joint.name), coordinate) for joint, coordinate in ends)
    assert a[0] == pytest.approx(-ratio * second / inertia * offset, rel=STEPS)
    assert b[0] == pytest.approx(first / inertia * offset, rel=STEPS)
    assert max(error(a - a[0], force / inertia * times**2 / 2), error(b, offset + ratio * a)) <= CLOSED_FORM
    assert motion.violation.position.max() < CLOSED_FORM


@every
def test_assembled_scene_has_no_offset_and_moves_as_the_scene_with_offset(make, name, offset):
    """The assembled scene satisfies its joints to rounding (CLOSED_FORM), has the counts of the scene without
    offset, and is its own assembly. A run of the scene with offset begins at this pose, so that both motions
    are equal to the bit."""
    scene = shifted(make, name, offset)
    found = mbref.assembled(scene)
    assert mbref.assembled(found) is found and mbref.counts(found) == mbref.counts(make())
    assert [c.offset for c in found.coupling] == [0.0] * len(found.coupling)
    model = Model(found)
    assert np.abs(model.terms(0.0, model.start()).phi).max() < CLOSED_FORM
    motions = [mbref.simulate(each, times=[0.0, 0.2]) for each in (scene, found)]
    assert np.array_equal(motions[0].position, motions[1].position)


def test_offset_moves_the_wheel_that_is_not_driven():
    """A driver turns A by t; B is at 0.4 - 0.5 t, the offset and the ratio, to rounding (CLOSED_FORM)."""
    scene = shifted(gear_pair, "teeth", 0.4).with_(driver=[{"joint": "A", "polynomial": [0.0, 1.0]}])
    motion = mbref.simulate(scene, times=[0.0, 0.5])
    assert error(motion.joint("A").angle, np.array([0.0, 0.5])) <= CLOSED_FORM
    assert error(motion.joint("B").angle, np.array([0.4, 0.4 - 0.5 * 0.5])) <= CLOSED_FORM


@pytest.mark.parametrize("offset", [0.4, 8.0])
def test_natural_angle_of_a_spring_counts_from_the_pose_in_the_file(offset):
    """A spring of 3 N m/rad, relaxed at the assembled start, leaves the wheels at rest, also for an offset of
    over a turn. There A is at -r J_B c / J, r = -0.5, J_B = 0.2 kg m², J = 0.08 kg m², to 0.5 % (STEPS)."""
    scene = shifted(gear_pair, "teeth", offset)
    at = mbref.simulate(scene, times=[0.0]).joint("A").angle[0]
    assert at == pytest.approx(0.5 * 0.2 / 0.08 * offset, rel=STEPS)
    spring = {"type": "torsion_spring", "joint": "A", "stiffness": 3.0, "natural_angle": at}
    motion = mbref.simulate(scene.with_(load=[spring]), times=[0.0, 1.0])
    assert np.abs(motion.angular_velocity).max() < 1e-11  # rad/s, of rounded angles of 10 rad in 1 s


def test_ends_of_springs_move_with_their_bodies_into_the_assembled_pose():
    """The offset c = 3 mm lifts the rack, m = 1.5 kg, and turns the pinion, J = 0.2 kg m², r = 0.05 m, by the
    least displacement: the rack by c / (1 + r² m / J), to 0.5 % (STEPS). The spring's end on the rack moves
    with it, the end on the ground does not."""
    ends = {"bodies": ["ground", "rack"], "points": [[0.5, 0.2, 0.0], [0.05, 0.2, 0.0]]}
    spring = {"type": "spring", **ends, "stiffness": 10.0, "natural_length": 0.1}
    scene = shifted(rack, "teeth", 0.003).with_(load=[spring])
    rise = mbref.assembled(scene).body[1].position[1] - scene.body[1].position[1]
    assert rise == pytest.approx(0.003 / (1 + 0.05**2 * 1.5 / 0.2), rel=STEPS)  # m
    assert mbref.assembled(scene).load[0].points == ((0.5, 0.2, 0.0), (0.05, pytest.approx(0.2 + rise), 0.0))


def test_offset_that_no_pose_obeys_is_refused():
    """The rocker of a four-bar turns back before it reaches the offset of 200°, 3.49 rad."""
    gears = {"name": "g", "joints": ["left D", "right D"], "ratio": -1.0, "offset": "200 deg"}
    scene = coupled_loops().with_(coupling=[gears])
    with pytest.raises(SceneError, match=r"no pose obeys the offsets of g \(3\.49\d*\); after \d+ %"):
        mbref.simulate(scene)


def test_every_scene_of_an_ensemble_starts_at_its_own_offset():
    """Runs of three scenes together equal single runs to the bit."""
    scenes = [shifted(gear_pair, "teeth", offset).with_(duration=0.5) for offset in (0.0, 0.1, 0.2)]
    together = simulate_all(scenes, "taylor", np.array([0.0, 0.5]), Limits())
    for k, scene in enumerate(scenes):
        alone = mbref.simulate(scene, times=[0.0, 0.5])
        assert np.array_equal(together[k].orientation, alone.orientation)


@pytest.mark.parametrize("cause", ["stop", "when", "active"])
def test_wheels_with_an_offset_are_held_where_their_angle_counts_from_the_files_poses(cause):
    """2 N m turn the pinion by 25 t²/2 from its assembled angle a, so that it is at a + 2 rad at 0.4 s, where
    an end stop without restitution, a weld by its condition or a weld by its interval holds it."""
    scene = shifted(gear_pair, "teeth", 7.0)
    a = mbref.simulate(scene, times=[0.0]).joint("A").angle[0]
    weld = {"name": "weld", "type": "fixed", "bodies": ["ground", "wheel"], "anchor": [0.0, 0.0, 0.0]}
    found = scene.to_dict()
    if cause == "stop":
        found["joint"][0]["stop"] = {"upper": a + 2.0, "restitution": 0.0}
    else:
        begins = {"when": {"joint": "A", "reaches": a + 2.0}, "active": [[0.4, 9.0]]}
        found["joint"] = [*found["joint"], {**weld, cause: begins[cause]}]
    motion = mbref.simulate(Scene(**found), times=[0.2, 0.6, 1.0])
    assert [event.time for event in motion.events] == pytest.approx([0.4], abs=CLOSED_FORM)
    np.testing.assert_allclose(motion.joint("A").angle, [a + 0.5, a + 2.0, a + 2.0], rtol=0, atol=1e-11)


def test_drawing_shows_the_assembled_pose():
    """``at_rest`` is the motion of one sample that a drawing shows, ``still`` the drawing as SVG."""
    scene = shifted(rack, "teeth", 0.05)
    assert np.array_equal(at_rest(scene).position, at_rest(mbref.assembled(scene)).position)
    assert mbref.still(scene) != mbref.still(rack())
