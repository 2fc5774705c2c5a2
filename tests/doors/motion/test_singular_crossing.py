"""Singular positions are crossed, turned back from or missed as the motion does, or runs end UNDECIDED."""

from itertools import product

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.parts import linkage
from crosscheck.judge.reaction_balance import with_exact_reactions
from crosscheck.judge.truth import closed_form
from crosscheck.study import stability
from mbref.scene import GROUND, Body, Driver, Fixed, Revolute, Scene, Translational
from mbref.scenes import find_scene
from mbref.scenes.five_bar import five_bar_gravity
from mbref.scenes.four_bar import four_bar, four_bar_gravity, parallelogram
from mbref.scenes.planar_slider_crank import slider_crank
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.measured import relative_error
from tests.helpers.truth_scenes import door

SWINGING = {"four": four_bar_gravity, "five": five_bar_gravity}  # released from rest at an angle (rad)
RTOL = 1e-9  # the default of runs


def error_of(scene: Scene, end: float, **limits: object) -> float:
    """Return the error of a completed run against the judge's closed form, relative to the scene's length."""
    return relative_error(simulate(scene, "taylor", np.linspace(0.0, end, 9), Limits(**limits)), scene)


@pytest.mark.parametrize(("ratio", "allowed"), [("1e+09", 10 * RTOL), ("1e+12", 500 * RTOL)])
def test_light_crank_turns_through_dead_centres_of_a_heavy_slider(ratio, allowed):
    """At a dead centre rounding is magnified by the ratio of masses, 1e9 or 1e12. Errors against the judge's
    closed form are below 10 and 500 rtol: five times the largest found."""
    scene = next(scene for scene in stability.scenes() if scene.name == f"mass_ratio[{ratio}]")
    assert error_of(scene, scene.duration) < allowed


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("tilt", [1e-3, 1e-5, 1e-7, 1e-8, 1e-9, 3e-10])
def test_door_on_tilted_hinges_is_held_or_its_run_is_undecided(tilt, seed):
    """Two hinges on different axes leave no freedom. Rounding may turn a held door by the rounding unit over
    the tilt (rad), and move it by about 1e-12 m at any tilt. Below 1e-8 rad a run may be UNDECIDED."""
    scene = door(tilt, seed)
    run = simulate(scene, "taylor", [0.1, 0.2])
    if tilt < 1e-8 and run.outcome.label == "UNDECIDED":
        assert "nearly dependent at the start" in run.message and len(run.times) == 0
    else:
        assert run.outcome.label == "COMPLETED", run.message
        moved = np.abs(run.position - scene.body[0].position).max()
        assert moved < 1e-12 + np.finfo(float).eps / tilt


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(("tilt", "reported"), [(1e-11, True), (1e-15, False)])
def test_door_on_hinges_tilted_by_rounding_swings_and_a_tilt_above_rounding_is_reported(tilt, reported, seed):
    """A free door falls by over 0.1 m in 0.2 s. 1e-11 rad is above the rounding of the axes, 1e-15 is not."""
    scene = door(tilt, seed)
    run = simulate(scene, "taylor", [0.1, 0.2])
    assert run.outcome.label == "COMPLETED", run.message
    assert np.abs(run.position - scene.body[0].position).max() > 0.1
    assert ("count as redundant" in run.message) == reported


@pytest.mark.parametrize("tilt", [1e-5, 1e-7, 1e-8])
def test_flap_on_a_door_that_tilted_hinges_hold_swings_as_on_a_welded_door(tilt):
    """The held door does not move, so that the flap is a pendulum on a fixed hinge; welding the door to the
    ground removes the tilted hinges. Positions agree to rtol (m)."""
    held = door(tilt, seed=1)
    at, turn = held.body[0].position, held.body[0].orientation
    there = (at[0] + 0.3, at[1], at[2] + 0.1)
    flap = Body(name="flap", mass=0.7, inertia=(0.02, 0.01, 0.02), position=there, orientation=turn)
    hinge = Revolute(name="flap", bodies=("door", "flap"), anchor=at, axis=(0.0, 0.6, 0.8))
    wall = Fixed(name="wall", bodies=(GROUND, "door"), anchor=at)
    times = np.linspace(0.0, 0.5, 6)
    bodies = (held.body[0], flap)
    tilted = simulate(held.with_(body=bodies, joint=(*held.joint, hinge)), "taylor", times)
    fixed = simulate(held.with_(body=bodies, joint=(wall, hinge)), "taylor", times)
    assert tilted.outcome.label == fixed.outcome.label == "COMPLETED", tilted.message
    assert np.abs(tilted.position - fixed.position).max() < RTOL


@pytest.mark.parametrize("inertia", [1e-8, 1e-6])
def test_small_bead_on_an_arm_swings_without_a_singular_position(inertia):
    """Whatever the bead's inertia (kg m²), it keeps its distance of 1 m to 1e-12, and energy to ten rtol."""
    bead = Body(name="bead", mass=1.0, inertia=(inertia,) * 3, position=(1.0, 0.0, 0.0))
    arm = Revolute(name="J", bodies=(GROUND, "bead"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    scene = Scene(name="bead", gravity=(0.0, 0.0, -9.81), body=(bead,), joint=(arm,))
    run = simulate(scene, "taylor", np.linspace(0.0, 1.0, 11))
    radius = np.linalg.norm(run.position[:, 0], axis=1)
    assert run.outcome.label == "COMPLETED" and run.crossings == () and np.abs(radius - 1.0).max() < 1e-12
    assert np.ptp(run.energy) < 10 * RTOL * run.kinetic_energy.max()


@pytest.mark.parametrize("loop", SWINGING)
@pytest.mark.parametrize("distance", [1e-2, 1e-4, 1e-6])
def test_swing_that_turns_back_before_the_flat_position_meets_its_closed_form_uncrossed(loop, distance):
    """SWINGING are parallelograms of four and five bars, released ``distance`` (rad) from the flat pose, on
    the side where they swing back. Errors against the judge's closed form are below ten rtol."""
    scene = SWINGING[loop](-distance)
    run = simulate(scene, "taylor", np.linspace(0.0, 1.5, 9))
    assert relative_error(run, scene) < 10 * RTOL and run.crossings == ()


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
def test_crossings_of_a_chain_flat_in_both_loops_are_all_recorded(rtol):
    """Crossings are where the first upright of the judge's closed form is level, to 1000 rtol (m), as many as
    its height changes sign in 10 s. At each both loops are flat, and the determinant keeps its sign."""
    scene = find_scene("four_bar_chain[2]")
    run, exact = simulate(scene, "taylor", [10.0], Limits(rtol=rtol)), closed_form(scene)
    assert run.outcome.name == "COMPLETED", run.message
    heights = exact.poses(np.linspace(0.0, 10.0, 2001)).position[:, 0, 1]
    assert len(run.crossings) == np.count_nonzero(np.diff(np.sign(heights))) > 5
    level = exact.poses(np.array([crossing.time for crossing in run.crossings])).position[:, 0, 1]
    assert np.abs(level).max() < 1000 * rtol


@pytest.mark.parametrize("loop", SWINGING)
def test_release_very_near_the_flat_position_is_right_or_undecided(loop):
    """SWINGING are parallelograms of four and five bars, released 1e-8 to 1e-5 rad from flat. Below 5e-6 rad
    rounding may turn the motion from rest, and a run may end UNDECIDED; its message says so if it ends at the
    start. Right means off by at most 1000 rtol from the judge's closed form."""
    for distance in np.geomspace(1e-8, 1e-5, 16):
        scene = SWINGING[loop](-distance)
        run = simulate(scene, "taylor", np.linspace(0.0, 1.5, 21))
        if run.outcome.label == "COMPLETED":
            assert relative_error(run, scene) < 1000 * RTOL, distance
        else:
            assert run.outcome.label == "UNDECIDED", run.message
            told = "begins near a singular position, rounding changes its motion" in run.message
            assert told == ("at t = 0 s" in run.message), run.message
            assert distance < 5e-6, f"{distance}: {run.message}"


@pytest.mark.parametrize("rate", [-5.0, -0.5])
@pytest.mark.parametrize("distance", [-1e-6, -1.8e-7, -5.6e-9, -1e-9, 3e-9, 1e-5])
def test_parallelogram_that_starts_moving_near_the_flat_position_meets_its_closed_form(distance, rate):
    """Crank and rocker start ``distance`` (rad) from the flat pose with a rate (rad/s), the coupler at rest.
    Errors against the judge's closed form are below 100 rtol."""
    scene = parallelogram(distance, "parallelogram").with_(gravity=(0.0, -9.81, 0.0))
    turning = {"crank": rate, "coupler": 0.0, "rocker": rate}
    bodies = (b.model_copy(update={"angular_velocity": (0.0, 0.0, turning[b.name])}) for b in scene.body)
    assert error_of(scene.with_(body=tuple(bodies)), 1.0) < 100 * RTOL


@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
def test_swing_that_turns_back_within_its_tolerance_is_right_or_undecided(rtol):
    """Released 1e-9 to 1e-6 rad before the flat position, a motion faster by rtol might cross it, so that at
    least one of the eight runs is undecided. A run that completes is within 1000 rtol of the closed form."""
    undecided = 0
    for distance in (1e-6, 1e-7, 1e-8, 1e-9):
        for swing in SWINGING.values():
            scene = swing(-distance)
            run = simulate(scene, "taylor", np.linspace(0.0, 1.5, 9), Limits(rtol=rtol))
            if run.outcome.label == "COMPLETED":
                assert relative_error(run, scene) < 1000 * rtol
            else:
                assert run.outcome.label == "UNDECIDED" and "singular position at t = " in run.message
                undecided += 1
    assert undecided > 0


@pytest.mark.parametrize("loop", SWINGING)
@pytest.mark.parametrize("distance", [3e-5, 1e-4])
def test_swing_through_two_flat_positions_from_near_one_meets_its_closed_form(loop, distance):
    """SWINGING are parallelograms of four and five bars, released from rest ``distance`` (rad) behind a flat
    position, on the side on which they fall to the other one and come back. Nearer than 1e-5 rad rounding may
    decide on the branch. The judge's closed form is met to ten rtol."""
    assert error_of(SWINGING[loop](distance), 1.5) < 10 * RTOL


@pytest.mark.parametrize("loop", SWINGING)
@pytest.mark.parametrize("distance", [1e-7, 1e-8])
def test_motion_from_very_near_the_flat_position_is_undecided_at_its_start(loop, distance):
    """SWINGING are parallelograms of four and five bars, released from rest ``distance`` (rad) from the flat
    pose. Rounding of 1e-16 over the squared distance decides their branch."""
    run = simulate(SWINGING[loop](distance), "taylor", [0.0, 1.5])
    assert run.outcome.label == "UNDECIDED" and not len(run.times)
    assert "singular position at t = 0 s" in run.message


LOOSE = 1e-5  # rtol of long steps


@pytest.mark.parametrize(
    ("gap", "rtol"),
    [*product([1e-2, 1e-5, 1e-8, 1e-10], [RTOL]), *product([1e-12, 7.4e-10, 2.2e-9, 6.7e-9, 2e-8], [LOOSE])],
)
def test_slider_crank_with_a_longer_rod_keeps_its_branch_past_the_upright_crank(gap, rtol):
    """The rod is longer than the crank by the gap (m). At the upright crank, the two places that the slider
    could have are not equal then: they are about √gap (m) apart. A long step, of a loose tolerance (LOOSE),
    must not change to the other place, from which the slider goes up to 0.6 m away. The error against the
    judge's closed form is below rtol."""
    scene = slider_crank(0.308, 0.308 + gap, 0.3, "gap", rate=30.0)
    assert error_of(scene, 0.25, rtol=rtol) < rtol


@pytest.mark.parametrize(("gap", "passed"), [(2e-15, 1), (3e-14, 0)])
def test_only_a_gap_of_the_size_of_rounding_counts_as_a_crossing(gap, passed):
    """The rod is longer than the crank by the gap (m). Rounding of a length is 3e-17 m, of a pose 1e-15 m."""
    scene = slider_crank(0.308, 0.308 + gap, 0.3, "gap", rate=30.0)
    run = simulate(scene, "taylor", [0.25], Limits())
    assert run.outcome.label == "COMPLETED" and len(run.crossings) == passed


@pytest.mark.parametrize("inertia", [1e-11, 1e-9])
def test_small_bead_on_a_cart_keeps_the_energy(inertia):
    """With a bead of 1e-11 kg m², unit rows in the metric of the masses are nearly parallel, which magnifies
    rounding, 1e-16, by up to 1e11: to 1e-5 of the kinetic energy."""
    cart = Body(name="cart", mass=1.0, inertia=(1e-2,) * 3, position=(0.0, 0.0, 0.0))
    bead = Body(name="bead", mass=1.0, inertia=(inertia,) * 3, position=(1.0, 0.0, 0.0))
    joints = (
        Translational(name="T", bodies=(GROUND, "cart"), anchor=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0)),
        Revolute(name="J", bodies=("cart", "bead"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
    )
    scene = Scene(name="cart_pole", gravity=(0.0, 0.0, -9.81), body=(cart, bead), joint=joints)
    run = simulate(scene, "taylor", np.linspace(0.0, 1.0, 9), Limits())
    assert run.outcome.label == "COMPLETED"
    assert np.ptp(run.energy) < 1e-5 * np.ptp(run.kinetic_energy)


def turned_back(angle: float, distance: float) -> Scene:
    """Return a parallelogram of 0.5 m and 0.7 m on a base line at an angle (rad) to the x axis, its crank at
    this angle to the base. Its driver stands still at a distance (rad) from the flat position after 0.5 s,
    and has turned it back after 1 s."""
    base, crank = 0.7 * np.exp(1j * angle), 0.5 * np.exp(2j * angle)
    pins = [(z.real, z.imag, 0.0) for z in (0j, crank, crank + base, base)]
    turn = 4.0 * (distance - angle)
    driver = Driver(joint="P0", polynomial=(0.0, turn, -turn))
    return linkage("leaning", pins).with_(gravity=(0.0, 0.0, 0.0), driver=(driver,))


@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-8])
def test_no_run_whose_driver_turns_back_at_the_flat_position_completes_on_another_branch(distance):
    """After 1 s the driver has its angle of the start, and the bodies are at their first places, to 1e-6 m. A
    run in which rounding changes the branch where the driver turns back must end UNDECIDED."""
    for angle in np.linspace(0.3, 0.9, 20):
        scene = turned_back(float(angle), distance)
        run = simulate(scene, "taylor", [1.0])
        if run.outcome.label == "COMPLETED":
            assert np.abs(run.position[-1] - [body.position for body in scene.body]).max() < 1e-6, angle
        else:
            assert run.outcome.label == "UNDECIDED", run.message


@pytest.mark.parametrize("distance", [1e-6, 1e-4])
def test_driver_that_turns_back_before_the_flat_position_returns_to_the_start(distance):
    """The driver is at its first angle after 1 s, and so is the parallelogram, to rounding of its
    coordinates, 1e-14 m, over the distance; nothing is crossed."""
    for angle in np.linspace(0.3, 0.9, 10):
        scene = turned_back(float(angle), distance)
        run = simulate(scene, "taylor", [1.0])
        assert run.outcome.label == "COMPLETED" and not run.crossings, run.message
        moved = np.abs(run.position[-1] - [body.position for body in scene.body]).max()
        assert moved < 1e-14 / distance


@pytest.mark.parametrize(
    "scene",
    [four_bar(), four_bar_gravity(0.3), four_bar_gravity(0.35)],
    ids=["driven", "swinging", "swinging from higher"],
)
def test_accelerations_velocities_and_reactions_near_a_crossing_are_exact(scene):
    """Samples are up to 0.1 rad of the crank from the crossing. The truth are the judge's closed form and its
    reactions. Errors over the largest value: accelerations ten rtol; velocities 3e-11, rounding over a
    crossing; reactions 1e-6 if driven. Those of a swing grow as rtol / distance, up to 3e-5 rad from the
    crossing. Within 1e-7 rad the judge's rank leaves reactions open: they are the sample before, to 1e-5."""
    (crossing, *_) = simulate(scene, "taylor", [0.3]).crossings
    rate = np.abs(crossing.angular_velocity[0]).max()
    distances = np.array([1e-1, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 1e-9])
    times = crossing.time + np.concatenate([-distances, [0.0], distances[::-1]]) / rate
    run = simulate(scene, "taylor", times)
    exact = with_exact_reactions(scene, closed_form(scene).poses(times))
    scale = np.abs(exact.acceleration).max()
    assert np.abs(run.acceleration - exact.acceleration).max() < 10 * RTOL * scale
    assert np.abs(run.velocity - exact.velocity).max() < 3e-11 * np.abs(exact.velocity).max()
    away = np.concatenate([distances, [0.0], distances[::-1]])
    allowed = 1e-6 if scene.driver else RTOL + RTOL / np.maximum(away, 3e-5)
    beside = away < 1e-7
    for name, true in exact.reactions.items():
        found, largest = run.reactions[name], np.abs(true).max()
        off = np.abs(found - true).max(axis=1)
        assert (off < allowed * largest)[~beside].all(), name
        assert np.abs(found[beside] - found[np.flatnonzero(beside)[0] - 1]).max() < 1e-5 * largest, name
