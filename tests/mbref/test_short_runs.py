"""Short runs of every method with interpreted kernels: two derivations of the equations against each other.

Series are of natural coordinates, other methods of body coordinates; they share only the scene.
``test_thresholds.py`` runs this file in a process whose kernels are interpreted, so that nothing is compiled.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pytest

from mbref.kernels.compilation import PLAIN

if not PLAIN:
    pytest.skip("kernels are interpreted by test_thresholds.py", allow_module_level=True)

from mbref import energy, rotations
from mbref.kernels.layout import OK
from mbref.method import Method
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.scenes.five_bar import five_bar
from mbref.scenes.four_bar import four_bar, four_bar_gravity
from mbref.scenes.planar_slider_crank import slider_crank
from mbref.simulation.simulate import Limits, simulate
from mbref.simulation.start_run import start_run
from mbref.trajectory import Outcome, Trajectory
from tests.coupled_scenes import gear_pair, planetary
from tests.crosscheck.tree_scenes import every_joint
from tests.loads_over_time import arm, driven_arm

TIMES = np.array([0.0, 0.002])
SCENES: dict[str, Callable[[], Scene]] = {
    "arm": arm,
    "driven arm": driven_arm,
    "every joint": every_joint,
    "planetary gear": planetary,
    "gear pair": gear_pair,
    "redundant": lambda: find_scene("planar_slider_crank"),
}
METHODS = (
    "lm1+none/rk4[step=0.001]",
    "lm1+baumgarte/dop853",
    "lm2+none/dop853",
    "lm2+projection/adams",
    "alf+none/adams",
    "alf-dual+projection/dop853",
    "mpi-svd+partitioning/adams",
    "mpi-svd+none/dop853",
    "mpi-gs+none/dop853",
    "mpi-qr+baumgarte/rk4[step=0.001]",
)
RUNS = [
    *((name, method) for name in ("arm", "driven arm") for method in METHODS),
    *(("planetary gear", method) for method in ("lm1+none/rk4[step=0.001]", "alf-dual+projection/dop853")),
    ("every joint", "alf-dual+projection/dop853"),
    ("gear pair", "mpi-svd+partitioning/dop853"),
    *(
        ("redundant", method)
        for method in ("mpi-qr+partitioning/dop853", "mpi-svd+none/dop853", "alf+projection/dop853")
    ),
]


def ran(scene: Scene, method: str, rtol: float = 1e-10) -> Trajectory:
    run = simulate(scene, method, TIMES, Limits(rtol=rtol))
    assert run.outcome == Outcome.COMPLETED, run.message
    return run


@functools.cache
def series(name: str) -> Trajectory:
    return ran(SCENES[name](), "taylor")


@pytest.mark.parametrize(("name", "method"), RUNS)
def test_short_runs_agree_with_the_series(name, method):
    found, expected = ran(SCENES[name](), method), series(name)
    for field in ("position", "orientation", "velocity", "angular_velocity", "acceleration"):
        one, other = getattr(found, field), getattr(expected, field)
        size = max(1.0, np.abs(other).max())
        tolerance = 1e-8 if field == "acceleration" else 1e-10
        assert np.abs(one - other).max() <= tolerance * size, (field, np.abs(one - other).max())
    for joint, reaction in (found.reactions or {}).items():
        other = (expected.reactions or {})[joint]
        assert np.abs(reaction - other).max() <= 1e-7 * max(1.0, np.abs(other).max()), joint


@pytest.mark.parametrize(
    ("scene", "end", "crossings"),
    [
        (find_scene("planar_slider_crank_equal"), 0.1, 1),
        (find_scene("four_bar"), 0.1, 4),
        (four_bar_gravity(), 0.6, 1),
        (four_bar_gravity(-1e-3), 0.5, 0),
        (four_bar_gravity(1e-4), 0.3, 1),
    ],
    ids=["equal cranks", "four-bar", "falling", "turning back", "passing beside"],
)
def test_singular_positions_are_crossed_with_their_energy(scene, end, crossings):
    run = simulate(scene, "taylor", np.linspace(0.0, end, 9), Limits(rtol=1e-9))
    assert run.outcome == Outcome.COMPLETED, run.message
    assert len(run.crossings or ()) == crossings
    total = energy.kinetic(scene, run) + energy.potential(scene, run)
    for load in scene.load:  # moments about z, whose work is moment times angle
        orientation = run.orientation[:, [body.name for body in scene.body].index(load.body)]
        total -= load.moment[2] * np.unwrap(2.0 * np.arctan2(orientation[:, 3], orientation[:, 0]))
    size = energy.kinetic(scene, run).max()
    assert np.abs(total - total[0]).max() <= 1e-9 * size, (total - total[0]) / size


@pytest.mark.parametrize("linkage", [four_bar, five_bar])
def test_a_driven_loop_that_starts_on_its_flat_position(linkage):
    """The crank turns on at its rate, and the distances between the hinges of each bar are kept."""
    run = simulate(linkage(0.0), "taylor", np.linspace(0.0, 0.02, 5), Limits(rtol=1e-9))
    assert run.outcome == Outcome.COMPLETED, run.message
    turned = rotations.angle_between(run.orientation[:1, 0], run.orientation[:, 0])
    assert turned == pytest.approx(run.times * np.linalg.norm(run.angular_velocity[0, 0]), abs=1e-10)


def test_velocities_that_agree_with_no_branch_are_refused():
    """A crank and a rod of equal lengths lie on each other; 30 and 9 rad/s belong to no motion."""
    scene = slider_crank(0.308, 0.308, np.pi / 2, "upright", rate=30.0)
    crank, rod, slider = scene.body
    wrong = rod.model_copy(update={"angular_velocity": (0.0, 0.0, 9.0)})
    run = simulate(scene.with_(body=(crank, wrong, slider)), "taylor", [0.0, 0.01])
    assert run.outcome == Outcome.UNDECIDED and "agree with none of the branches" in run.message
    right = rod.model_copy(update={"angular_velocity": (0.0, 0.0, -30.0)})
    run = simulate(scene.with_(body=(crank, right, slider)), "taylor", [0.0, 0.001])
    assert run.outcome == Outcome.COMPLETED and run.angular_velocity[-1, 1, 2] == pytest.approx(
        -30.0, rel=1e-3
    )


SIZES = {  # natural variables, rows, functions that drivers prescribe, products
    "four_bar": (4, 4, 2, 8),
    "four_bar_gravity": (6, 5, 0, 12),
    "five_bar_gravity": (8, 8, 0, 16),
    "spatial_slider_crank": (8, 7, 0, 41),
    "spatial_slider_crank_driven": (8, 8, 2, 15),
    "planar_slider_crank": (3, 2, 0, 8),
    "slider_crank_chain": (5, 4, 0, 12),
    "point_pendulum": (2, 1, 0, 4),
    "andrews_squeezer": (14, 13, 0, 28),
    "bricard": (19, 19, 0, 107),
    "flyball_governor": (17, 13, 0, 82),
    "heavy_top": (9, 6, 0, 45),
    "bennett": (9, 14, 0, 75),
    "sarrus": (6, 5, 0, 16),
    "h_frame": (2, 1, 0, 4),
}


@pytest.mark.parametrize("name", SIZES)
def test_natural_coordinates_at_the_start(name):
    """Directions at rest need no variables, and the poses of the scene obey all rows to rounding."""
    scene = find_scene(name)
    run = start_run(scene, Method.parse("taylor"), np.array([0.1]), Limits())
    taylor = run.stepper.taylor
    nz, nr = taylor.solver.pivot_columns.size, taylor.solver.pivot_rows.size
    products = np.count_nonzero(taylor.polynomials.products.weight)
    assert (nz, nr, taylor.polynomials.given.driver.size, products) == SIZES[name]
    assert run.stepper.expand() == OK
    assert taylor.step.violation <= 1e-14
    freedoms = taylor.options.start_freedoms
    assert taylor.partition.rank == nz - freedoms
    run.stepper.release()
    if name not in ("sarrus", "bricard", "bennett", "point_pendulum"):  # where both methods serve
        series_, general = (
            simulate(scene, method, [0.0]) for method in ("taylor", "alf-dual+projection/dop853")
        )
        for field in ("acceleration", "angular_acceleration"):
            one, other = getattr(series_, field), getattr(general, field)
            assert np.abs(one - other).max() <= 1e-9 * max(1.0, np.abs(other).max()), field


@pytest.mark.parametrize("method", ["taylor", "lm1+none/dop853"])
def test_quaternions_of_turning_bodies_keep_their_signs(method):
    """The top turns by 150 rad/s, so that its quaternion changes its sign every 42 ms."""
    times = np.linspace(0.0, 0.1, 21)
    run = simulate(find_scene("heavy_top"), method, times, Limits(rtol=1e-8))
    orientation = run.orientation[:, 0]
    assert (np.einsum("ki,ki->k", orientation[1:], orientation[:-1]) > 0.9).all()
    assert np.dot(orientation[0], orientation[8]) < -0.9, "a turn later"
    momentum = np.array([0.234375, 0.46875, 0.234375]) + 15.0 * np.array([1.0, 0.0, 1.0])
    own = rotations.rotate(rotations.conjugate(orientation), run.angular_velocity[:, 0])
    vertical = rotations.rotate(orientation, momentum * own)[:, 2]
    assert vertical == pytest.approx(vertical[0], rel=1e-7), "gravity has no moment about z"


LONG = {  # s, about a step of the series
    "arm": 0.02,
    "driven arm": 0.05,
    "planetary gear": 0.1,
    "gear pair": 0.3,
    "andrews_squeezer": 0.002,
    "flyball_governor": 0.001,
    "heavy_top": 0.01,
    "bricard": 0.05,
    "spatial_slider_crank_driven": 0.005,
}


@pytest.mark.parametrize("name", LONG)
def test_long_steps_of_the_series_and_steps_of_a_quarter_agree(name):
    """Long steps need the high orders of all loads and rows."""
    scene, end = SCENES[name]() if name in SCENES else find_scene(name), LONG[name]
    long, short = (
        simulate(scene, "taylor", [0.0, end], Limits(rtol=1e-9, largest_step=length))
        for length in (0.0, end / 4)
    )
    assert long.outcome == short.outcome == Outcome.COMPLETED, long.message
    assert short.cost.steps >= 4 and short.cost.steps > long.cost.steps
    for field in ("position", "velocity", "angular_velocity", "acceleration"):
        one, other = getattr(long, field), getattr(short, field)
        assert np.abs(one - other).max() <= 1e-7 * max(1.0, np.abs(other).max()), field


def test_gears_that_have_turned_by_a_radian():
    """Angles of couplings need sines and cosines far from the start."""
    scene, times = gear_pair(), [0.0, 0.3]
    one, other = (
        simulate(scene, method, times, Limits(rtol=1e-9)) for method in ("taylor", "lm1+none/dop853")
    )
    assert one.outcome == other.outcome == Outcome.COMPLETED
    turned = rotations.angle_between(one.orientation[0], one.orientation[1])
    assert turned.max() > 1.0 and turned.max() == pytest.approx(2.0 * turned.min(), rel=1e-9)
    for field in ("position", "orientation", "angular_velocity", "angular_acceleration"):
        assert getattr(one, field) == pytest.approx(getattr(other, field), abs=1e-8), field
