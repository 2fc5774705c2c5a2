"""Loops with 6 or 8 digits, and nearly perpendicular axes: judge and engines read them alike."""

from typing import Any

import numpy as np
import pytest

import mbref
from crosscheck.conformance.initial_accelerations import PRINCIPLE, compare
from crosscheck.engine import Setting
from crosscheck.judge.constraints import closure, initial_poses
from crosscheck.judge.gauss_motion import gauss_motion
from crosscheck.judge.gauss_principle import gauss, rank, singular_values
from crosscheck.judge.model_identity import gate, gate_times
from crosscheck.processes.serve import run_once
from mbref import rotations, simulate
from mbref.method import Method
from mbref.motions.trajectory import Outcome
from mbref.scene import Body, Scene, Universal
from mbref.scenes import find_scene
from mbref.simulation.advice import advice_on_rounding
from mbref.simulation.runs import start_run
from mbref.simulation.simulate import Limits

TURN = rotations.from_vector(np.array([0.3, -0.7, 0.5]))
LOOPS = ("four_bar_gravity", "planar_slider_crank", "spatial_slider_crank_gravity")


def turned(name: str, digits: int | None) -> Scene:
    """A mechanism in a slanted frame, its places, axes and orientations rounded."""

    def vector(values: Any) -> list[float]:
        return shortened(rotations.to_matrix(TURN) @ np.array(values, dtype=float))

    def shortened(values: np.ndarray) -> list[float]:
        return (values if digits is None else np.round(values, digits)).tolist()

    data = find_scene(name).to_dict()
    if "gravity" in data:
        data["gravity"] = (rotations.to_matrix(TURN) @ data["gravity"]).tolist()
    for body in data["body"]:
        body["position"] = vector(body["position"])
        turn = np.array(body.get("orientation", (1.0, 0.0, 0.0, 0.0)))
        body["orientation"] = shortened(rotations.multiply(TURN, turn))
        for rate in {"velocity", "angular_velocity"} & set(body):
            body[rate] = (rotations.to_matrix(TURN) @ body[rate]).tolist()
    for load in data.get("load", ()):
        for key in {"force", "moment"} & set(load):
            load[key] = (rotations.to_matrix(TURN) @ load[key]).tolist()
    for joint in data["joint"]:
        for key in {"anchor", "axis"} & set(joint):
            joint[key] = vector(joint[key])
        for key in {"anchors", "axes"} & set(joint):
            joint[key] = [vector(values) for values in joint[key]]
    return Scene(**data)


@pytest.mark.parametrize("digits", [6, 8])
@pytest.mark.parametrize("name", LOOPS)
def test_rounded_loop_is_closed_and_keeps_its_redundant_rows(name, digits):
    """Both bodies of a joint get its rounded point and axis, so that the joint is closed to double rounding.
    Rank and redundant rows are those in full digits; the other singular values are rounding."""
    scene, whole = turned(name, digits), turned(name, None)
    gaps = closure(scene, np.zeros(1), *(a[None] for a in initial_poses(scene)))
    assert max(np.abs(rows).max() for rows in gaps.values()) < 1e-14  # m, rad: 50 roundings of 1
    assert (mbref.counts(scene).redundant, rank(scene)) == (mbref.counts(whole).redundant, rank(whole))
    dependent = singular_values(scene)[rank(scene) :]
    assert dependent.max(initial=0.0) < 1e-13  # of rows of length 1


@pytest.mark.parametrize("name", LOOPS)
def test_accelerations_change_by_the_rounding_of_the_file(name):
    """Numbers near 1 of n digits are off by up to 10⁻ⁿ / 2. Accelerations differ, relative to the largest, by
    0.01 to 1000 times 10⁻ⁿ (measured: 0.8 to 34); two more digits leave 1/100, to a factor of 20 (3.4)."""
    whole = gauss(turned(name, None))
    apart = {n: np.abs(gauss(turned(name, n)) - whole).max() / np.abs(whole).max() for n in (6, 8)}
    assert all(0.01 < difference / 10.0**-n < 1000 for n, difference in apart.items()), apart
    assert 100 / 20 < apart[6] / apart[8] < 100 * 20, apart


@pytest.mark.parametrize("name", ["four_bar_gravity", "spatial_slider_crank_gravity"])
def test_engines_accelerate_a_rounded_mechanism_as_the_judge(name):
    """Errors are magnified near a singular position: times the distance to it, they are below 1e-11 by
    rounding, and 1e-7 by MuJoCo's soft closures. A file read with 6 digits by one side would leave 1e-6."""
    found = compare(turned(name, 6), ("mujoco", "pinocchio"))
    assert found.errors[PRINCIPLE] < 1e-11 / found.distance
    assert found.errors["pinocchio"] < 1e-11 / found.distance
    assert found.errors["mujoco"] < 1e-7 / found.distance


def test_three_parallel_cranks_need_twelve_digits_to_move():
    """Rounded to 7 digits they are not parallel and locked: the run completes at rest, with a message. With 9
    digits the rank is uncertain, and the run asks for 12. With 12 digits they move by more than 0.1 mm, as
    without rounding to 1e-10 m."""
    runs = {d: simulate(turned("five_bar_gravity", d), "taylor", [0.0, 0.01]) for d in (7, 9, 12, None)}
    outcomes = [run.outcome for run in runs.values()]
    assert outcomes == [Outcome.COMPLETED, Outcome.UNDECIDED, Outcome.COMPLETED, Outcome.COMPLETED]
    assert np.abs(np.diff(runs[7].position, axis=0)).max() < 1e-15
    assert "nearly dependent at the start" in runs[7].message
    assert all("nearly" not in runs[digits].message for digits in (12, None))
    assert "give the axes and points of the joints with 12 digits" in runs[9].message
    assert np.abs(np.diff(runs[12].position, axis=0)).max() > 1e-4
    assert np.abs(runs[12].position - runs[None].position).max() < 1e-10


def test_run_that_ends_by_rounded_numbers_asks_for_twelve_digits():
    """A slider-crank in a slanted plane has redundant joints, which 6 digits make contradict each other."""
    run = simulate(turned("planar_slider_crank", 6))
    assert run.outcome != Outcome.COMPLETED
    assert "file's numbers seem to be rounded: give the axes and points of the joints with 12" in run.message
    assert simulate(turned("planar_slider_crank", 12)).outcome == Outcome.COMPLETED


@pytest.mark.parametrize("name", ["four_bar_straight", "four_bar_gravity", "sarrus"])
def test_scene_in_full_digits_gets_no_advice_on_rounding(name):
    """Scenes that start in a singular position, or have redundant rows, are no sign of rounded numbers."""
    run = start_run(find_scene(name), Method.parse("taylor"), np.array([0.1]), Limits())
    assert advice_on_rounding(run) == ""


FIRST = np.array([1.0, 0.2, -0.3])
ACROSS = np.array([0.2, -1.0, 0.0])  # perpendicular to FIRST
ROUNDED = 1e-14  # some roundings of numbers up to 2
SETTINGS = {
    "mbref": Setting("taylor", {"rtol": 1e-9}),
    "mujoco": Setting("tuned", {"step": 1e-5, "beta": 100.0, "hard": 1e-7}),
    "pinocchio": Setting("baumgarte", {"step": 1e-5}),
    "exudyn": Setting("trapezoidal", {"step": 1e-5}),
}


def pendulum(cosine: float) -> Scene:
    """A body on a universal joint whose second axis leans by a cosine towards the first."""
    first, across = FIRST / np.linalg.norm(FIRST), ACROSS / np.linalg.norm(ACROSS)
    second = 2.0 * (across + cosine * first)
    joint = Universal(name="U", bodies=("ground", "b"), anchor=(0, 0, 0), axes=(tuple(FIRST), tuple(second)))
    body = Body(name="b", mass=1.0, inertia=(0.01, 0.02, 0.03), position=(0.3, 0.1, 0.0))
    return Scene(name="u", body=(body,), joint=(joint,), gravity=(0.0, 0.0, -9.81), duration=0.2)


@pytest.mark.parametrize("cosine", [1e-14, 1e-6, 0.04, -0.04])
def test_second_axis_of_a_universal_joint_is_made_perpendicular(cosine):
    """The second axis, of length 2, leans by a cosine towards the first. It loses this part, to 1e-14, and
    keeps its length; the first stays, and the judge finds the joint closed to 1e-14 m or rad."""
    first, second = map(np.array, pendulum(cosine).joint[0].axes)
    assert tuple(first) == tuple(FIRST)
    assert abs(first @ second) <= ROUNDED * np.linalg.norm(first) * np.linalg.norm(second)
    assert second == pytest.approx(2.0 * ACROSS / np.linalg.norm(ACROSS), abs=ROUNDED)
    gap = closure(pendulum(cosine), np.zeros(1), *(a[None] for a in initial_poses(pendulum(cosine))))["U"]
    assert np.abs(gap).max() <= ROUNDED


@pytest.mark.parametrize("cosine", [1e-16, 0.04])
def test_second_reading_leaves_the_axes_unchanged(cosine):
    """A joint that is made from the axes of another one has them to the last bit."""
    joint = pendulum(cosine).joint[0]
    assert Universal(**dict(joint)).axes == joint.axes


@pytest.mark.parametrize("name", SETTINGS)
def test_engine_corrects_skew_axes_as_the_judge(name):
    """The axes of the universal joint lean by a cosine of 0.04. ``gate`` compares the engine's short motion
    with the judge's by Gauss's principle and finds no difference."""
    scene = pendulum(0.04)
    exact = gauss_motion(scene, tuple(gate_times(scene)))
    assert gate(scene, [exact, run_once(name, scene, gate_times(scene), SETTINGS[name])]) is None
