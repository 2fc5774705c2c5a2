"""Openings of joints: a gap is a distance of points, and angles do not depend on the size."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

import mbref
from crosscheck.cli import tables
from crosscheck.judge.metrics import measure
from crosscheck.judge.openings import opening
from crosscheck.judge.truth import truth_for
from crosscheck.study.search.cheapest import by_closure
from mbref import rotations
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from tests.helpers.geared_arms import arms
from tests.helpers.intermittent_mechanisms import carts
from tests.helpers.parts import hinge, slide
from tests.reports import synthetic

TIMES = np.array([0.0, 1.0])


def displaced(scene: Scene, moved: np.ndarray, turned: np.ndarray) -> Trajectory:
    """Return a run of two samples, the start and a pose in which the last body is turned by a rotation vector
    (rad) about the anchor of its hinge and then moved by a vector (m)."""
    position = np.array([[body.position for body in scene.body]] * 2)
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (2, len(scene.body), 1))
    turn = rotations.from_vector(turned)
    anchor = np.array(scene.joint[-1].anchor)
    position[1, -1] = anchor + rotations.to_matrix(turn) @ (position[0, -1] - anchor) + moved
    orientation[1, -1] = turn
    still = np.zeros_like(position)
    names = tuple(body.name for body in scene.body)
    return Trajectory(scene.name, "by hand", "", "", {}, TIMES, names, position, orientation, still, still)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("seed", range(4))
def test_opening_has_the_distance_of_the_joints_points_and_the_tilt_of_its_axis(size: float, seed: int):
    """An arm whose hinge turns about z is tilted about x through the hinge's anchor, and shifted by a random
    vector. Rounding of the arms is below 1e-9 of the shift and of the tilt."""
    random = np.random.default_rng(seed)
    moved, tilt = 0.01 * size * random.normal(size=3), random.uniform(0.1, 1.0)
    found = opening(arms(size), displaced(arms(size), moved, np.array([tilt, 0.0, 0.0])))
    assert found.gap == pytest.approx(np.linalg.norm(moved), rel=1e-9)
    assert found.angle == pytest.approx(tilt, rel=1e-9)


def test_coupling_that_is_off_by_an_angle_opens_by_that_angle_and_by_no_distance():
    """One of two geared arms is turned by 0.3 rad about its hinge, which allows this, and the other one
    stands. The gap is the rounding of arms of 2 m, at most ten units."""
    scene = arms(2.0, coupled=True)
    found = opening(scene, displaced(scene, np.zeros(3), np.array([0.0, 0.0, 0.3])))
    assert found.gap < 10 * np.finfo(float).eps * 2.0 and found.angle == pytest.approx(0.3, rel=1e-9)


def test_joint_opens_by_no_distance_while_it_does_not_hold():
    """Two carts approach by 3 m/s until a latch holds them from 0.1 s on: they are 0.3 m nearer than in the
    file. mbref's gap is rounding, 1e-12 m; a run without events does not say when the latch holds."""
    run = mbref.simulate(carts(), times=[0.0, 0.05, 0.2, 0.5])
    assert opening(run.mechanism, run).gap < 1e-12
    assert opening(run.mechanism, replace(run, events=None)).gap == math.inf


def test_gap_of_a_run_whose_positions_are_not_numbers_is_infinite():
    """NaN would compare as smaller than every limit."""
    scene = arms(1.0)
    assert opening(scene, displaced(scene, np.full(3, np.nan), np.zeros(3))).gap == math.inf


def test_rack_whose_pinion_turns_too_far_between_samples_has_no_known_gap():
    """A moment turns the pinion 32 times in a second, and its rate changes between samples: without angles of
    the run these turns are unknown, and a gap of 0 would be invented. mbref counts turns, and has no gap."""
    scene = arms(1.0).with_(
        joint=[
            hinge("pin", "ground", "a", (0.0, 0.0, 0.0)),
            slide("rail", "ground", "b", (0.0, 0.0, 0.0)),
        ],
        coupling=[{"name": "teeth", "joints": ["pin", "rail"], "ratio": 0.1}],
        load=[{"type": "moment", "body": "a", "moment": [0.0, 0.0, 400.0]}],
    )
    run = mbref.simulate(scene, times=[0.0, 0.5, 1.0])
    assert opening(scene, run).gap < 1e-9 and run.joint("pin").angle[-1] > 20 * np.pi
    found, wanted = opening(scene, replace(run, angles=None)), by_closure(1e-3, scene)
    assert found.gap == math.inf and found.uncounted == ("teeth",)
    metrics = measure(scene, replace(run, angles=None))
    assert metrics["violation_position"] is None and measure(scene, run)["violation_position"] < 1e-9
    record = {**synthetic.record("a", "x", 0.1, 0.1), **replace(run, angles=None).to_record()}
    console = Console(width=200, record=True, file=io.StringIO())
    tables.print_runs(console, [{**record, "scene": "arms", "metrics": metrics}], [scene])
    assert "closure –: full turns of coupling 'teeth' between samples" in console.export_text()
    assert wanted.measure(record) == math.inf and "coupling 'teeth'" in wanted.unknown(record)


def test_reactions_are_judged_alike_where_samples_are_many_turns_apart():
    """A wheel turns twice and more between samples, and drives another one by a polynomial of its angle.
    mbref's reactions are right to 1e-9 at any samples; without the run's turns its rates are unknown."""
    gears = {"name": "gears", "joints": ["hinge of a", "hinge of b"], "polynomial": [1.0, 0.3]}
    hub = {"angular_velocity": (0.0, 0.0, 40.0)}
    bodies = [b.model_copy(update=hub | {"position": (0.0, b.position[1], 0.0)}) for b in arms(1.0).body]
    scene = arms(1.0).with_(body=bodies, coupling=[gears], gravity=(0.0, 0.0, 0.0), duration=0.8)
    run, truth = mbref.simulate(scene, rtol=1e-11, times=[0.0, 0.4, 0.8]), truth_for(scene)
    assert run.joint("hinge of b").angle[1] > 4 * np.pi
    assert measure(scene, run, truth)["reaction_error"] < 1e-9
    without = measure(scene, replace(run, angles=None), truth)
    assert without["violation_velocity"] is None and without["violation_acceleration"] is None
