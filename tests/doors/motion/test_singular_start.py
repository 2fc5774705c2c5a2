"""Starts in motion on a singular position: the motion continues on the branch of its velocities."""

import math

import numpy as np
import pytest

from mbref import Limits, find_scene, rotations, simulate
from mbref.scene import GROUND, Scene
from mbref.scenes.five_bar import five_bar
from mbref.scenes.four_bar import four_bar
from mbref.scenes.planar_slider_crank import slider_crank
from tests.helpers import parts
from tests.helpers.measured import relative_error
from tests.helpers.statics import rod

UPRIGHT = math.pi / 2  # rad: crank and rod of equal lengths lie on each other
RTOL = 1e-9  # of the runs; limits are 1, 100 or 1000 of it: errors of the steps of a run add up
ROUNDING = 1e-12  # of poses over the length


def upright_slider_crank(rod_rate: float | None) -> Scene:
    """Return equal crank and rod, both upright: 30 rad/s of the crank, a rate of the rod (rad/s) or None."""
    scene = slider_crank(0.308, 0.308, UPRIGHT, "upright", rate=30.0)
    crank, coupler, slider = scene.body
    if rod_rate is not None:
        coupler = coupler.model_copy(update={"angular_velocity": (0.0, 0.0, rod_rate)})
    return scene.with_(body=(crank, coupler, slider))


FLAT = [
    (linkage(angle), 0.1, ROUNDING, 3) for linkage in (four_bar, five_bar) for angle in (0, math.pi, -math.pi)
]


@pytest.mark.parametrize(
    ("scene", "end", "allowed", "passed"), [*FLAT, (upright_slider_crank(-30.0), 0.5, 100 * RTOL, 7)]
)
def test_start_at_a_singular_position_moves_as_the_closed_form(scene, end, allowed, passed):
    """Crank and rocker of driven loops turn by 12.5 rad and pass three more flat positions, to rounding. The
    rod of the upright crank turns against it at -30 rad/s, so that the slider moves; in 0.5 s the crank turns
    by 22.2 rad and is upright or hangs seven times more."""
    run = simulate(scene, "taylor", np.linspace(0.0, end, 21), Limits(rtol=1e-9))
    assert relative_error(run, scene) < allowed and len(run.crossings) == passed


def test_missing_velocities_choose_the_branch_of_the_least_kinetic_energy():
    """Equal crank and rod, upright, turn as one body about the ground's hinge; the slider rests: to rtol."""
    times = np.linspace(0.0, 0.5, 21)
    run = simulate(upright_slider_crank(None), "taylor", times, Limits(rtol=1e-9))
    assert run.outcome.name == "COMPLETED" and "branch with the least kinetic energy" in run.message
    exact = 0.154 * np.column_stack([np.cos(UPRIGHT + 30.0 * times), np.sin(UPRIGHT + 30.0 * times)])
    assert np.abs(run.position[:, :2, :2] - exact[:, None]).max() < RTOL  # m
    assert np.abs(run.position[:, 2]).max() < RTOL


def test_velocities_that_belong_to_no_branch_are_undecided():
    """Crank and rod of equal length are upright; the crank turns at 30 rad/s. A rate of the rod of 9 rad/s
    satisfies Φ_q v = 0; the branches have -30 and 30 rad/s."""
    run = simulate(upright_slider_crank(9.0), "taylor", [0.0, 0.1])
    assert run.outcome.name == "UNDECIDED" and "agree with none of the branches" in run.message


def falling_parallelogram(rate: float, length: float = 0.3) -> Scene:
    """Return two cranks and a coupler of 1 kg in one line, with a small rate (rad/s) of the first crank."""
    equal = {"mass": 1.0, "inertia": (0.01, 0.02, 0.02)}
    centres = {"crank": length / 2, "coupler": length + 0.25, "rocker": 0.5 + length / 2}
    crank, *others = [{"name": n, **equal, "position": (x, 0.0, 0.0)} for n, x in centres.items()]
    crank |= {"angular_velocity": (0.0, 0.0, rate), "velocity": (0.0, rate * length / 2, 0.0)}
    names = (GROUND, *centres, GROUND)
    places = enumerate((0.0, length, length + 0.5, 0.5))
    pins = [parts.hinge(f"P{k}", names[k], names[k + 1], (x, 0.0, 0.0)) for k, x in places]
    return Scene(name="falls", gravity=(0.0, -9.81, 0.0), body=[crank, *others], joint=pins)


@pytest.mark.parametrize("rate", [-1e-6, -1e-3, -1e-2, -0.03, -0.3])
def test_slow_start_along_the_weight_falls_with_its_energy(rate):
    """Cranks and coupler of m = 1 kg, cranks of l = 0.3 m, start flat. The cranks keep ½ I ω² + 2 m g l sin
    φ, I = 2 (0.02 kg m² + m l² / 4) + m l², to rtol, and the coupler does not turn. After 0.4 s they turn
    faster than 5 rad/s."""
    run = simulate(falling_parallelogram(rate), "taylor", np.linspace(0.0, 0.4, 9))
    assert run.outcome.name == "COMPLETED", run.message
    x, y = run["crank"].position[:, :2].T
    inertia, rates = 2 * (0.02 + 0.3**2 / 4) + 0.3**2, run["crank"].angular_velocity[:, 2]
    energy = 0.5 * inertia * rates**2 + 2 * 9.81 * 0.3 * np.sin(np.arctan2(y, x))
    assert rates[-1] < -5.0, "it falls"
    assert np.abs(energy - 0.5 * inertia * rate**2).max() < RTOL * inertia * rates[-1] ** 2
    assert np.abs(run["coupler"].angular_velocity).max() < RTOL * abs(rates[-1])


def test_slow_start_against_the_weight_is_undecided_at_its_singular_position():
    """The cranks of 0.3 m start flat at 0.01 rad/s. The weight stops them at φ = ½ I ω² / 2 m g l = 1.5e-6
    rad, from where they fall through the singular position again. Rounding, 2⁻⁵², changes the direction of
    velocities by 2⁻⁵² / φ² = 1e-4 there, and so would choose the branch. The run tries a tight rtol, and
    branch 2 at its crossing 1, in vain."""
    run = simulate(falling_parallelogram(0.01), "taylor", np.linspace(0.0, 1.0, 9))
    assert run.outcome.name == "UNDECIDED" and run.t_end == 0.0 and not run.times.size
    said = "at t = 0 s (taylor); neither rtol 1e-13 nor --branch 1=2 lets the motion go on"
    assert run.message.endswith(said)


def test_message_of_an_undecided_run_also_states_the_branch_at_its_start():
    """Released at rest in the flat position, the parallelogram swings through half a turn, under its weight,
    and comes to rest in the other flat position, after more than 0.1 s. There neither a tighter tolerance nor
    another branch helps."""
    run = simulate(falling_parallelogram(0.0), "taylor", np.linspace(0.0, 1.0, 9))
    assert run.outcome.name == "UNDECIDED" and run.t_end > 0.1
    cause, advice, start = run.message.split("; ")
    assert cause.startswith("rounding errors would decide the motion beyond a singular position")
    assert advice == "neither rtol 1e-13 nor --branch 1=2 lets the motion go on: end it before this time"
    assert "takes, of the 2 branches that meet there, the branch of Gauss's principle" in start


@pytest.mark.parametrize("before", [1e-8, 1e-10, 0.0])
def test_run_that_ends_at_a_singular_position_has_the_samples_of_a_run_that_goes_on(before: float):
    """Crank and rod of equal length L, at 2π rad/s, stand upright at 0.25 s: the slider is at 2 L cos 2πt.
    The run ends there, or some ns before, where no position is passed yet."""
    driver = [{"joint": "A", "polynomial": (0.0, 2 * np.pi)}]
    scene = find_scene("planar_slider_crank_equal").with_(driver=driver, load=[])
    times = np.array([0.1, 0.25 - before])
    run, further = (simulate(scene, "taylor", [*times, *more]) for more in ([], [0.28]))
    start = scene.body[scene.body_index("slider")].position[0]
    assert run.outcome.name == "COMPLETED" and run.t_end == times[-1]
    assert run["slider"].position[:, 0] == pytest.approx(start * np.cos(2 * np.pi * times), abs=1e-9)
    assert run["slider"].velocity == pytest.approx(further["slider"].velocity[:2], abs=1e-9)
    assert len(run.crossings) == (not before) == ("passed: 1" in run.message)


def test_branches_of_a_start_at_rest_are_listed_without_velocities():
    """A parallelogram starts flat, at rest, where two branches meet. The run by projection ends there."""
    [met] = simulate(falling_parallelogram(0.0), "mpi-svd+projection", [0.0, 0.1]).crossings
    assert met.sentence == "2 branches" and not np.any(met.angular_velocity)


def test_run_of_a_microsecond_from_a_singular_position_is_exact():
    """Equal crank and rod start upright. Runs of 1 and 100 µs have the closed form, to rounding."""
    scene = upright_slider_crank(-30.0)
    for end in (1e-6, 1e-4):
        times = np.linspace(0.0, end, 3)
        run = simulate(scene, times=times)
        assert relative_error(run, scene) < ROUNDING


@pytest.mark.parametrize("linkage", [four_bar, five_bar])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_driven_loop_that_starts_nearly_flat_moves_as_its_closed_form(linkage, side):
    """The loop starts 1e-11 to 1e-3 rad from flat, on either side. The driver, not rounding, decides the
    branch: no run is undecided, and the judge's closed form is met to rounding."""
    for distance in (1e-3, 1e-4, 1e-6, 1.6e-7, 1e-7, 4e-8, 1.6e-8, 6.3e-9, 1.6e-9, 1e-9, 4e-10, 1e-11):
        scene = linkage(math.pi + side * distance)
        run = simulate(scene, "taylor", np.linspace(0.0, 0.05, 6), Limits(rtol=1e-9))
        assert relative_error(run, scene) < ROUNDING, distance


def spherical_loop(crank: float, coupler: float, angle: float, rates: tuple[float, float]) -> Scene:
    """Return a spherical four-bar whose opposite arcs (rad) are equal, at an angle of the crank and with
    rates of crank and rocker; the half tangents of their angles have the greater of two constant ratios."""
    turned = lambda axis, turn, v: rotations.rotate(rotations.from_vector(turn * axis), v)  # noqa: E731
    first, last = arc(0.0), arc(coupler)
    a = turned(first, angle, arc(crank))
    c = turned(last, 2.0 * math.atan(ratio(crank, coupler) * math.tan(angle / 2)), arc(coupler + crank))
    ends = ("crank", first + a, rates[0] * first), ("rocker", last + c, rates[1] * last)
    links = (ends[0], ("rod", a + c, None), ends[1])
    bodies = [{**rod(name, 0.4 * place, 1.0, 0.1), "angular_velocity": rate} for name, place, rate in links]
    pairs = ((GROUND, "crank"), ("crank", "rod"), ("rod", "rocker"), (GROUND, "rocker"))
    places = zip("ABCD", pairs, (first, a, c, last), strict=True)
    pins = [parts.hinge(n, *pair, x, x) for n, pair, x in places]
    return Scene(name="spherical", gravity=(1.0, 2.0, -9.0), body=bodies, joint=pins)


def arc(angle: float) -> np.ndarray:
    """Return the point at an angle (rad) of the great circle on which the loop is flat."""
    turn = rotations.from_vector(np.array([0.3, -0.5, 0.8]))
    return rotations.rotate(turn, np.array([math.sin(angle), 0.0, math.cos(angle)]))


def ratio(crank: float, coupler: float) -> float:
    """Return tan(rocker / 2) / tan(crank / 2) on one of the two branches."""
    return math.sin((crank + coupler) / 2) / math.sin((crank - coupler) / 2)


@pytest.mark.parametrize("rate", [2.0, -5.0])
def test_spherical_loop_leaves_the_flat_position_on_the_branch_of_its_velocities(rate):
    """In the closed form tan(rocker / 2) is k tan(crank / 2) with the constant k of `ratio`, here to 100
    rtol. The energy is constant, to 1000 rtol."""
    for crank, coupler in ((0.7, 1.1), (1.2, 0.5), (0.9, 1.3)):
        k = ratio(crank, coupler)
        scene = spherical_loop(crank, coupler, 0.0, (rate, k * rate))
        run = simulate(scene, "taylor", np.linspace(0.0, 1.0, 6))
        assert run.outcome.label == "COMPLETED", run.message
        q = run.orientation
        first, last = q[:, 0, 1:] @ arc(0.0), q[:, 2, 1:] @ arc(coupler)
        assert np.abs(last * q[:, 0, 0] - k * first * q[:, 2, 0]).max() < 100 * RTOL
        assert np.ptp(first) > 0.1, "the crank moves"
        assert np.ptp(run.energy) < 1000 * RTOL * np.abs(run.energy).max()


def test_start_near_the_flat_position_of_a_spherical_loop_does_not_shorten_later_steps():
    """A run has fewer than 100 steps at rtol 1e-6; if rows counted as nearly dependent, it had 200 000."""
    scene = spherical_loop(0.3, 0.6, 1e-4, (2.0, 2.0 * ratio(0.3, 0.6)))
    centred = scene.with_("joint[B].anchor", (0.0, 0.0, 0.0)).with_("joint[D].anchor", (0.0, 0.0, 0.0))
    run = simulate(centred, "taylor", [1.0], Limits(rtol=1e-6))
    assert run.outcome.label == "COMPLETED" and run.cost.steps < 100, run.message
