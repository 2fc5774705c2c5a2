"""Outcome, message and motion of a run do not depend on the size of the mechanism."""

import numpy as np
import pytest

from crosscheck.conformance.changes.units import in_other_units, scaled
from crosscheck.conformance.mechanisms.random_mechanisms import random_mechanism
from mbref import Outcome, Scene, find_scene, simulate
from tests.helpers.statics import ORIGIN, hinge, rod, slide


def ends(scene: Scene) -> tuple[tuple[Outcome, str, int], np.ndarray]:
    """Return outcome, message and number of singular positions of a run, and its last positions."""
    run = simulate(scene, times=[scene.duration])
    return (run.outcome, run.message, len(run.crossings)), run.position


@pytest.mark.parametrize(("length", "time"), [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e3)])
@pytest.mark.parametrize(
    "name", ["four_bar_quarter", "planar_slider_crank_equal", "flyball_governor", "bennett"]
)
def test_built_in_scenes_complete_with_proportional_positions_at_every_size(name, length, time):
    """Units of length and time are changed; outcome, message and number of crossings are equal."""
    scene = find_scene(name)
    scene = scene.with_(duration=min(scene.duration, 0.2))
    (expected, place), (found, other) = ends(scene), ends(in_other_units(scene, length, time))
    assert found == expected and expected[0] is Outcome.COMPLETED
    assert np.allclose(other / length, place, rtol=0.0, atol=1e-6)  # m; crossings magnify the tolerance


@pytest.mark.parametrize("method", ["alf-dual+projection", "mpi-svd+partitioning"])
def test_methods_that_correct_positions_complete_a_spatial_loop_of_ten_thousand_kilometres(method):
    scene, times = find_scene("spatial_slider_crank_gravity"), [0.0, 0.2]
    small, large = (simulate(each, method, times) for each in (scene, in_other_units(scene, 1e7, 1.0)))
    assert large.outcome is small.outcome is Outcome.COMPLETED
    assert large.position / 1e7 == pytest.approx(small.position, abs=1e-8)  # m, of steps with errors of 1e-9


def rack_and_pinion() -> Scene:
    """Return a driven pinion with armature, 2 rad/s and 6 rad/s², and a rack with armature on its slide."""
    guide = {"type": "translational", "bodies": ["ground", "rack"], "anchor": (0, 0.2, 0), "axis": (1, 0, 0)}
    motors = hinge("A", ("ground", "pinion")) | {"armature": 0.4}, {"name": "B", "armature": 0.7} | guide
    parts = {
        "body": [rod("pinion", ORIGIN), rod("rack", (0.0, 0.2, 0.0), mass=1.5)],
        "coupling": [{"name": "teeth", "joints": ("A", "B"), "ratio": -0.2, "offset": 0.01}],
        "driver": [{"joint": "A", "polynomial": (0.0, 2.0, 3.0)}],
    }
    return Scene(name="rack_and_pinion", joint=motors, **parts)


@pytest.mark.parametrize("mass", [1.0, 1e-9])
@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_torque_of_a_rack_and_pinion_is_its_closed_form_at_every_size(length, mass):
    """The torque is (J + I + r² (m + I')) φ'' with φ = 2 t + 3 t² rad at 0.5 s, J = 0.3, I = 0.4 kg m², r =
    0.2 m, m = 1.5, I' = 0.7 kg. The rack is at 0.01 - 0.2 φ m. Relative errors are at most rtol, 1e-9."""
    scene = in_other_units(scaled(rack_and_pinion(), mass), length, 1.0)
    run = simulate(scene, times=[0.5])
    angle, inertia = 2.0 * 0.5 + 3.0 * 0.5**2, 0.3 + 0.4 + 0.2**2 * (1.5 + 0.7)
    assert run.joint("B").displacement / length == pytest.approx([0.01 - 0.2 * angle], rel=1e-10)
    assert run.driver("A").torque / (mass * length**2) == pytest.approx([6.0 * inertia], rel=1e-9)


@pytest.mark.parametrize("length", [1e-6, 1e7])
def test_wave_of_a_driver_that_begins_at_zero_to_rounding_is_accepted_at_every_size(length):
    """The displacement is A (sin(t + p) - sin p), A = 0.12 m and p = 0.7 rad. The constant -A sin p has 14
    decimals, as in a file, so that the wave begins at 1e-15 m or so."""
    start = round(-0.12 * np.sin(0.7), 14)
    driver = {"joint": "S", "polynomial": [start], "sine": {"amplitude": 0.12, "phase": 0.7}}
    guide = slide("S", "block", ORIGIN, (1.0, 0.0, 0.0))
    scene = Scene(name="wave", body=[rod("block", ORIGIN)], joint=[guide], driver=[driver])
    run = simulate(in_other_units(scene, length, 1.0), times=[0.5])
    wave = 0.12 * (np.sin(0.5 + 0.7) - np.sin(0.7))
    assert run.joint("S").displacement / length == pytest.approx([wave], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200))
def test_random_mechanisms_end_with_equal_outcome_and_message_at_every_size(seed):
    """Each seed has one of four units of length from 1e-6 to 1e6 m."""
    scene = random_mechanism(seed)
    assert ends(in_other_units(scene, (1e-6, 1e-3, 1e3, 1e6)[seed % 4], 1.0))[0] == ends(scene)[0]
