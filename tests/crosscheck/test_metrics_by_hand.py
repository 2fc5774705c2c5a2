"""Metrics, limits of steps and first panels of truths / numbers and texts worked out by hand."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from crosscheck.judge import metrics
from crosscheck.judge.metrics import METRICS
from crosscheck.judge.richardson import _beyond, limit
from crosscheck.judge.truth.free_body import FreeBody, free_body
from crosscheck.judge.truth.one_dof import Reduced
from crosscheck.judge.truth.parallelogram import parallelogram
from mbref import rotations
from mbref.scene import Body, Force, Moment, Revolute, Scene
from mbref.trajectory import Trajectory

O = (0.0, 0.0, 0.0)
TURNED = np.array([0.8, 0.0, 0.6, 0.0])


@pytest.mark.parametrize(
    ("name", "unit", "label"),
    [
        ("error", "", "error (position/length or rotation angle)"),
        ("position_error", "", "position error / scene length"),
        ("rotation_error", "rad", "rotation error"),
        ("scd", "digits", "significant correct digits"),
        ("velocity_error", "", "relative velocity error"),
        ("violation_position", "rad", "violation of position constraints"),
        ("violation_velocity", "rad/s", "violation of velocity constraints"),
        ("violation_acceleration", "rad/s²", "violation of acceleration constraints"),
        ("energy_error", "", "drift of the energy balance / largest energy"),
        ("reaction_error", "", "error of unique reactions / largest true reaction"),
    ],
)
def test_units_and_labels_of_metrics(name, unit, label):
    assert (METRICS[name].unit, METRICS[name].label) == (unit, label)
    assert len(METRICS) == 10 and METRICS["reaction_error"].function is metrics.reaction_error


# --- three bodies at two times ----------------------------------------------------------------------------
BODIES = tuple(
    Body(name=name, mass=1.0, inertia=(1.0, 1.0, 1.0), position=(x, 0.0, 0.0))
    for name, x in (("a", 0.0), ("b", 1.0), ("c", 4.0))
)
SCENE = Scene(name="s", body=BODIES, gravity=O)


def run(**parts: Any) -> Trajectory:
    """Three bodies, 4 m from the first to the last, at two times; parts replace arrays of zeros."""
    zero = np.zeros((2, 3, 3))
    still = {"velocity": zero, "angular_velocity": zero, "orientation": np.tile(TURNED, (2, 3, 1))}
    place = np.tile([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [4.0, 0.0, 0.0]], (2, 1, 1))
    return Trajectory(
        "s", "e", "1", "m", {}, np.array([0.0, 1.0]), ("a", "b", "c"), **{"position": place, **still, **parts}
    )


def shifted(*entries: tuple[int, int, tuple[float, ...]]) -> np.ndarray:
    found = np.zeros((2, 3, 3))
    for sample, body, vector in entries:
        found[sample, body] = vector
    return found


def test_errors_are_of_the_body_that_is_farthest_off():
    """1 m of a body and 5 m of another over 4 m at one time, 2 m at the other time."""
    moved = shifted((0, 1, (1.0, 0.0, 0.0)), (0, 2, (3.0, 0.0, 4.0)), (1, 0, (0.0, 2.0, 0.0)))
    exact, found = run(), run(position=run().position + moved)
    assert metrics.position_error_series(SCENE, found, exact) == pytest.approx([1.25, 0.5])
    turns = shifted((0, 0, (0.0, 0.1, 0.0)), (0, 1, (0.0, 0.0, -0.3)), (1, 2, (0.7, 0.0, 0.0)))
    turned = rotations.multiply(rotations.from_vector(turns), exact.orientation)
    both = run(position=found.position, orientation=turned)
    assert metrics.rotation_error_series(SCENE, both, exact) == pytest.approx([0.3, 0.7])
    assert metrics.error_series(SCENE, both, exact) == pytest.approx([1.25, 0.7])
    assert METRICS["error"].function(SCENE, both, exact) == pytest.approx(1.25)
    assert METRICS["position_error"].function(SCENE, both, exact) == pytest.approx(1.25)
    assert METRICS["rotation_error"].function(SCENE, both, exact) == pytest.approx(0.7)
    assert METRICS["scd"].function(SCENE, both, exact) == pytest.approx(-math.log10(1.25))
    assert METRICS["scd"].function(SCENE, exact, exact) == pytest.approx(-math.log10(2.0**-52))
    assert METRICS["error"].function(SCENE, both, None) is METRICS["scd"].function(SCENE, both, None) is None


def test_errors_of_velocities_over_the_largest_true_velocity():
    """The largest true velocity is 5 m/s; an angular velocity counts times 4 m: 2.5 rad/s are 10 m/s."""
    exact = run(velocity=shifted((1, 2, (3.0, 4.0, 0.0))), angular_velocity=shifted((0, 1, (0.5, 0.0, 0.0))))
    faster = exact.velocity + shifted((0, 0, (0.6, 0.0, 0.8)), (1, 1, (0.0, 0.5, 0.0)))
    found = run(velocity=faster, angular_velocity=exact.angular_velocity)
    assert metrics._velocity_error(SCENE, found, exact) == pytest.approx(1 / 5)
    spun = exact.angular_velocity + shifted((1, 0, (0.0, 0.9, 1.2)))
    found = run(velocity=faster, angular_velocity=spun)
    assert metrics._velocity_error(SCENE, found, exact) == pytest.approx(4 * 1.5 / 5)
    quick = run(velocity=exact.velocity, angular_velocity=5 * exact.angular_velocity)
    assert metrics._velocity_error(SCENE, exact, quick) == pytest.approx(4 * 2.0 / 10)
    assert metrics._velocity_error(SCENE, exact, exact) == 0.0
    lost = run(velocity=exact.velocity * np.nan, angular_velocity=exact.angular_velocity)
    assert metrics._velocity_error(SCENE, lost, exact) == math.inf
    assert metrics._velocity_error(SCENE, run(), run()) is None is metrics._velocity_error(SCENE, run(), None)


@pytest.mark.parametrize(
    ("series", "largest"),
    [
        (None, None),
        ([], None),
        ([1.0, 3.0, 2.0], 3.0),
        ([1.0, math.nan], math.inf),
        ([[1.0, math.inf]], math.inf),
    ],
)
def test_the_largest_number_of_a_series(series, largest):
    assert metrics._largest(None if series is None else np.array(series)) == largest


def test_some_samples_of_a_run():
    """Arrays that the run lacks stay away; reactions are taken at the same samples."""
    given = run(velocity=shifted((1, 2, (3.0, 4.0, 0.0))), reactions={"A": np.arange(12.0).reshape(2, 6)})
    found = metrics._at(given, np.array([1]))
    assert found.times.tolist() == [1.0] and found.velocity.tolist() == [given.velocity[1].tolist()]
    assert found.reactions["A"].tolist() == [[6.0, 7.0, 8.0, 9.0, 10.0, 11.0]] and found.acceleration is None
    assert metrics._at(run(), np.array([0])).reactions is None
    assert metrics._known(given, given) is given and metrics._known(given, found).times.tolist() == [0.0]


# --- limits of steps --------------------------------------------------------------------------------------
def test_quaternions_beyond_the_finest_run():
    """Angles about z in steps of 0.2 and 0.1 rad of several bodies and times; signs may differ."""
    angles = np.arange(6.0).reshape(2, 3) / 7

    def turn(more: float) -> np.ndarray:
        half = (angles + more) / 2
        return np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=2)

    before, last = turn(0.0), turn(1e-4)
    signs = np.array([[1.0, -1.0, 1.0], [-1.0, 1.0, -1.0]])[..., None]
    found = _beyond(last, signs * before, 0.5)
    assert found == pytest.approx(turn(1.5e-4), abs=1e-8) and np.linalg.norm(found, axis=2) == pytest.approx(
        1
    )


def test_limits_of_positions_and_orientations_together():
    """Errors h² of a position (m) and an angle; the run with 0.1 s is last, at any place of the list."""
    runs = []
    for h in (0.2, 0.1, 0.4):
        place = run().position + shifted((0, 1, (0.0, h**2, 0.0)), (1, 2, (h**2 / 2, 0.0, 0.0)))
        turn = rotations.from_vector(shifted((0, 0, (0.0, 0.0, h**2 / 8))))
        runs.append(run(position=place, orientation=rotations.multiply(turn, run().orientation)))
    found = limit(SCENE, (0.2, 0.1, 0.4), runs)
    assert found.order == pytest.approx(2.0) and found.motion.position == pytest.approx(run().position)
    assert found.motion.orientation == pytest.approx(run().orientation, abs=1e-9)
    assert found.discretisation == pytest.approx(0.01 / 4) and found.motion.acceleration is None


# --- first panels and rates of truths ---------------------------------------------------------------------
@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Derivative, start and first panel of each solution."""
    found: list[Any] = []
    for name in ("free_body", "one_dof"):
        module = import_module(f"crosscheck.judge.truth.{name}")
        monkeypatch.setattr(module, "Solution", lambda *parts: found.append(parts))
    return found


SPUN = Body(
    name="b",
    mass=2.0,
    inertia=((0.6, 0.1, 0.0), (0.1, 0.7, 0.05), (0.0, 0.05, 0.8)),
    position=(1.0, 2.0, 3.0),
    orientation=tuple(TURNED),
    velocity=(3.0, 0.0, 4.0),
    angular_velocity=(0.0, 1.2, 1.6),
)
FLYING = Scene(
    name="f",
    body=(SPUN,),
    gravity=(0.0, 0.0, -10.0),
    duration=4.0,
    load=(
        Force(body="b", point=(1.5, 2.0, 3.0), force=(0.0, 6.0, 0.0)),
        Moment(body="b", moment=(0.1, 0.2, -0.3)),
    ),
)


def test_the_first_panel_of_a_free_body(asked, monkeypatch):
    """Half of the time of 1 rad, of a scene's length and of the duration together: 2 + 5 / 2.5 + 1 / 4."""
    monkeypatch.setattr(import_module(FreeBody.__module__), "scene_length", lambda scene: 2.5)
    FreeBody(FLYING)
    [(_, start, first)] = asked
    turn = rotations.to_matrix(TURNED)
    inertia = turn @ np.array(SPUN.inertia) @ turn.T
    momentum = inertia @ SPUN.angular_velocity
    assert first == pytest.approx(0.5 / (2.0 + 2.0 + 0.25))
    wanted = [*SPUN.position, *SPUN.velocity, *TURNED, *momentum]
    assert start.astype(float) == pytest.approx(wanted, abs=1e-15) and start.dtype == np.longdouble
    resting = FLYING.with_(body=(SPUN.model_copy(update={"velocity": None, "angular_velocity": None}),))
    FreeBody(resting)
    assert asked[1][2] == pytest.approx(0.5 * 4.0) and not asked[1][1][3:6].any()


def test_rates_of_a_free_body_at_any_state(asked):
    """The force at 0.5 m along x of the body at its start moves with the body."""
    FreeBody(FLYING)
    rates = asked[0][0]
    turns = np.array([[0.5, 0.5, -0.5, 0.5], [0.1, -0.7, 0.1, 0.7], list(TURNED)])
    momenta = np.array([[0.3, -0.2, 0.5], [1.0, 2.0, -3.0], [0.0, 0.4, 0.1]])
    places = np.arange(9.0).reshape(3, 3)
    state = np.concatenate([places, places[::-1] + 0.5, turns, momenta], axis=1)
    found = rates(state.astype(np.longdouble)).astype(float)
    arm = rotations.to_matrix(TURNED).T @ [0.5, 0.0, 0.0]
    for row, turn, momentum, velocity in zip(found, turns, momenta, places[::-1] + 0.5, strict=True):
        matrix = rotations.to_matrix(turn / np.linalg.norm(turn))
        spin = np.linalg.solve(matrix @ np.array(SPUN.inertia) @ matrix.T, momentum)
        assert row[:3] == pytest.approx(velocity) and row[3:6] == pytest.approx([0.0, 3.0, -10.0])
        assert row[6:10] == pytest.approx(rotations.multiply(np.array([0.0, *spin]), turn) / 2, abs=1e-14)
        pushed = np.cross(matrix @ arm, [0.0, 6.0, 0.0]) + np.array([0.1, 0.2, -0.3])
        assert row[10:] == pytest.approx(pushed, abs=1e-14)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_moments_of_free_bodies_are_relative(scale):
    """A ratio of 2e-9 of the least moment to the largest one is enough for any size."""
    body = SPUN.model_copy(update={"inertia": (2e-9 * scale, scale, scale)})
    assert free_body(FLYING.with_(body=(body,))) is not None


def test_the_first_panel_of_a_pendulum(asked):
    """2 kg at 2 m and 0.5 kg m²: I = 8.5; its weight along x gives 2 · 5 · 2 = 20 N m; -3 rad/s."""
    bar = Body(
        name="bar",
        mass=2.0,
        inertia=(0.3, 0.4, 0.5),
        position=(0.0, -2.0, 0.5),
        angular_velocity=(0.0, 0.0, -3.0),
    )
    hinge = Revolute(name="A", bodies=("ground", "bar"), anchor=(0.0, 0.0, 0.5), axis=(0.0, 0.0, 1.0))
    scene = Scene(name="p", body=(bar,), joint=(hinge,), gravity=(5.0, 0.0, 0.0), duration=4.0)
    Reduced(scene, parallelogram(scene), -3.0)
    [(rates, start, first)] = asked
    root = math.sqrt(8.5)
    assert first == pytest.approx(0.3 / ((3.0 + math.sqrt(20) / root + 0.25) * root))
    assert start.astype(float) == pytest.approx([0.0, -3.0 * root, 0.0]) and start.dtype == np.longdouble
    found = rates(np.array([[0.0, 2.0, 9.0], [math.pi / 2, -1.0, 9.0]], dtype=np.longdouble))
    assert found.astype(float) == pytest.approx(np.array([[2.0, 20.0, root], [-1.0, 0.0, root]]), abs=1e-14)


def test_accelerations_of_a_free_body_at_its_start():
    """Newton's and Euler's equations: the force acts at 0.5 m along x, J ω' = M - ω × J ω."""
    found = FreeBody(FLYING).poses(np.zeros(1))
    turn = rotations.to_matrix(TURNED)
    inertia = turn @ np.array(SPUN.inertia) @ turn.T
    spin = np.array(SPUN.angular_velocity)
    moment = np.cross([0.5, 0.0, 0.0], [0.0, 6.0, 0.0]) + np.array([0.1, 0.2, -0.3])
    wanted = np.linalg.solve(inertia, moment - np.cross(spin, inertia @ spin))
    assert found.angular_acceleration[0, 0] == pytest.approx(wanted)
    assert found.acceleration[0, 0] == pytest.approx([0.0, 3.0, -10.0])
    assert found.velocity[0, 0].tolist() == [3.0, 0.0, 4.0] and found.position[0, 0].tolist() == [
        1.0,
        2.0,
        3.0,
    ]
    assert found.angular_velocity[0, 0] == pytest.approx(spin) and found.orientation[0, 0] == pytest.approx(
        TURNED
    )
