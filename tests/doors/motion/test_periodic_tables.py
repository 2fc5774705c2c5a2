"""Periodic tables repeat with a smooth spline, also for the judge; the error of interpolation is stated."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import mbref
from crosscheck.engine import Setting, engine
from crosscheck.judge.arithmetic import EXTENDED, doubles
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from crosscheck.recorded.judgement import judge_motion
from mbref import rotations
from mbref.cli import main
from mbref.ensembles.simulate_all import simulate_all
from mbref.scene import Driver, Factor, JointForce, SceneError
from mbref.scene.interpolation import interpolation_error
from tests.helpers.loads_over_time import AXIS, slide, wheel

PERIOD = 0.8
TIMES = np.array([0.0, 0.1, 0.17, 0.4, 0.55, 0.7, 0.8])
VALUES = np.array([0.0, 0.5, 0.2, -0.6, 0.1, 0.4, 0.0])  # rad, and of a factor
TABLE = tuple(zip(TIMES.tolist(), VALUES.tolist(), strict=True))
SAMPLES = np.linspace(0.0, 2.5, 26)
EXACT = CubicSpline(TIMES, VALUES, bc_type="periodic")
FOUR_PERIODS = np.append((TIMES[:-1] + PERIOD * np.arange(4)[:, None]).ravel(), 4 * PERIOD)
REPEATED = CubicSpline(FOUR_PERIODS, np.append(np.tile(VALUES[:-1], 4), 0.0), bc_type="periodic")


def driven(duration: float = 2.5) -> mbref.Scene:
    """A wheel that a periodic table turns over more than three periods."""
    driver = Driver(joint="J", table=TABLE, periodic=True)
    return wheel().with_(load=(), driver=(driver,), duration=duration)


@pytest.mark.parametrize("method", ["taylor", "lm1+projection"])
@pytest.mark.parametrize("duration", [2.5, 0.8, 1.0])
def test_wheel_turns_by_the_periodic_spline_through_the_rows_of_its_driver(duration, method):
    """The truth is SciPy's spline, also at times beyond the scene's duration. Angles are exact to rounding,
    accelerations to 1e-9, 1000 times rtol."""
    motion = mbref.simulate(driven(duration), method, SAMPLES, rtol=1e-12)
    assert motion.joint("J").angle == pytest.approx(EXACT(SAMPLES % PERIOD), abs=1e-12)
    assert motion.angular_acceleration[:, 0, 2] == pytest.approx(EXACT(SAMPLES % PERIOD, 2), abs=1e-9)


def test_periodic_table_repeats_beyond_the_duration_in_batches_matrices_and_for_the_judge():
    """SciPy's spline is the truth to 2.5 s, in period 4; the judge finds it right, and Pinocchio has it."""
    scene, angle = driven(PERIOD), EXACT(SAMPLES % PERIOD)
    _, second = simulate_all([scene, scene], "taylor", SAMPLES, mbref.Limits(rtol=1e-12))
    assert second.joint("J").angle == pytest.approx(angle, abs=1e-12)
    assert second.joint("J").rate == pytest.approx(EXACT(SAMPLES % PERIOD, 1), abs=1e-10)
    assert mbref.terms(scene, 2.5).v[5] == pytest.approx(EXACT(2.5 % PERIOD, 1), abs=1e-8)
    assert judge_motion(scene, {"time": SAMPLES, "J.angle": angle}).is_right
    run = engine("pinocchio").run(scene, SAMPLES, engine("pinocchio").best_settings(scene)[0])
    assert rotations.to_vector(run.orientation[:, 0])[:, 2] == pytest.approx(angle, abs=1e-12)


def test_table_that_ends_before_the_last_time_is_refused_by_its_field(capsys, tmp_path):
    """Beyond its last row, at 0.8 s, a table says nothing: its cubic would go on."""
    scene = driven(PERIOD).with_(driver=[Driver(joint="J", table=TABLE)])
    doors = (
        lambda: mbref.simulate(scene, times=[0.0, 2.5]),
        lambda: simulate_all([scene], "taylor", SAMPLES, mbref.Limits()),
        lambda: mbref.terms(scene, 2.5),
        lambda: judge_motion(scene, {"time": SAMPLES, "J.angle": 0.0 * SAMPLES}),
        lambda: engine("mujoco").run(scene, SAMPLES, Setting("tuned", {"step": 0.1})),
        lambda: engine("pinocchio").run(scene, SAMPLES, Setting("tuned", {"rtol": 1e-3})),
    )
    for door in doors:
        with pytest.raises(SceneError, match=r"driver\[J\].table: leaves a gap: .* 0.8 s, .* until 2.5 s"):
            door()
    scene.save(tmp_path / "wheel.toml")
    assert main(["run", str(tmp_path / "wheel.toml"), "--duration", "2.5"]) == 2
    assert "acts until 2.5 s" in capsys.readouterr().err


def test_mass_under_a_periodic_force_moves_by_its_double_integral_in_mbref_and_both_formulations(tmp_path):
    """A force of 2 N · a(t) moves 2 kg from rest by ∬ a dt² (m): a is SciPy's spline through the rows of four
    periods, integrated by SciPy. mbref, which reads the scene from a file, moves it so to 1e-11, ten times
    rtol, and each formulation of the reference to 1e-13, rounding."""
    load = JointForce(joint="J", force=2.0, factor=Factor(table=TABLE, periodic=True))
    scene = slide(load).with_(duration=2.5)
    scene.save(tmp_path / "slide.toml")
    twice = REPEATED.antiderivative(2)
    exact = twice(SAMPLES) - twice(0.0) - twice(0.0, 1) * SAMPLES
    motion = mbref.simulate(mbref.Scene.from_file(tmp_path / "slide.toml"), times=SAMPLES, rtol=1e-12)
    assert motion.joint("J").displacement == pytest.approx(exact, abs=1e-11)
    for reference in (natural_motion, tree_motion):
        found = reference(scene, SAMPLES, EXTENDED, seconds=100.0)
        moved = (doubles(found.position[:, 0]) - scene.body[0].position) @ AXIS
        assert not found.reason and np.abs(moved - exact).max() < 1e-13


def sampled(rows: int, periodic: bool) -> Driver:
    """Return a driver by a table of 0.3 sin(2 π t)."""
    t = np.linspace(0.0, 1.0, rows)
    table = [(time, 0.3 * np.sin(2 * np.pi * time)) for time in t[:-1]] + [(1.0, 0.0)]
    return Driver(joint="J", table=table, periodic=periodic)


@pytest.mark.parametrize(("periodic", "ends"), [(True, "periodic"), (False, "not-a-knot")])
@pytest.mark.parametrize("rows", [9, 21, 40])
def test_stated_error_of_interpolation_is_right_to_a_factor_of_three(rows, periodic, ends):
    """The error is of second derivatives, up to 0.3 · 4 π²: SciPy's spline minus the sine of the table."""
    driver, fine = sampled(rows, periodic), np.linspace(0.0, 1.0, 500)
    spline = CubicSpline(*np.array(driver.table).T, bc_type=ends)
    error = np.abs(spline(fine, 2) + 0.3 * (2 * np.pi) ** 2 * np.sin(2 * np.pi * fine)).max()
    estimate, largest = interpolation_error(driver, 2)
    assert error / 3 < estimate < 3 * error and largest == pytest.approx(0.3 * 4 * np.pi**2, rel=0.3)


@pytest.mark.parametrize("rows", [6, 21, 41, 101])
def test_stated_error_between_rows_with_plateaus_is_right_to_a_factor_of_three(rows):
    """The law of straight lines through six rows; the spline through these rows alone errs by 3.4 of 7."""
    corners, fine = (
        ((0.0, 0.15, 0.2, 0.3, 0.4, 0.5), (0.0, 0.0, 2.0, 2.0, 7.0, 7.0)),
        np.linspace(0, 0.5, 9001),
    )
    times = corners[0] if rows == 6 else np.linspace(0.0, 0.5, rows)
    table = list(zip(times, np.interp(times, *corners), strict=True))
    error = np.abs(CubicSpline(*np.array(table).T)(fine) - np.interp(fine, *corners)).max()
    assert error / 3 < interpolation_error(Driver(joint="J", table=table))[0] < 3 * error


@pytest.mark.parametrize("periodic", [True, False])
def test_run_notes_the_error_of_interpolation_and_proposes_a_periodic_table(periodic, tmp_path, capsys):
    """A periodic spline is more accurate, so that it is proposed for a table that begins and ends alike."""
    scene = wheel().with_(load=(), driver=(sampled(9, periodic),), duration=1.0)
    scene.save(tmp_path / "wheel.toml")
    assert main(["run", str(tmp_path / "wheel.toml"), "--samples", "2", "--estimate", "no"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "driver(J): interpolation between 9 rows leaves acceleration uncertain by about" in said
    assert ("or periodic = true" in said) == (not periodic)


@pytest.mark.parametrize("duration", [0.3, 2.5])
def test_sensitivity_to_a_row_of_a_periodic_table_counts_all_its_periods(duration, tmp_path):
    """The derivative of the driven wheel's angle at 2.3 s by the value of the row at 0.4 s is the periodic
    spline that is 1 in this row and 0 in others, also of a scene whose rows were repeated and saved."""
    driven(duration).save(tmp_path / "wheel.toml")
    found = mbref.sensitivities(tmp_path / "wheel.toml", ["J.angle"], ["driver[J].table[3][1]"], [2.3])
    unit = CubicSpline(TIMES, np.eye(len(TIMES))[3], bc_type="periodic")
    assert found.values[0, 0, 0] == pytest.approx(unit(2.3 % PERIOD), abs=1e-12)


def test_another_table_in_place_of_a_repeated_one_has_a_period_of_its_own():
    """The new period of 1.6 s has the old rows, -0.6 rad at 0.4 s, and then their negatives: 0.6 rad at 1.2
    s. At 2 s, 0.4 s after the period, -0.6 rad is back."""
    table = [*TABLE[:-1], *((t + PERIOD, -x) for t, x in TABLE)]
    scene = driven().with_("driver[J].table", table)
    assert mbref.simulate(scene, times=[1.2, 2.0]).joint("J").angle == pytest.approx([0.6, -0.6], abs=1e-12)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ([*TABLE[:-1], (0.8, 0.1)], "periodic, but begins with 0 and ends with 0.1"),
        ([(t + 0.1, x) for t, x in TABLE], "its first row is at 0.1 s, but it acts from 0 s on"),
        ([(t * 1e-6, x) for t, x in TABLE], "has 2.5e.06 periods of 8e-07 s; at most 100000 are repeated"),
    ],
)
def test_periodic_table_that_does_not_close_or_cover_the_motion_is_refused(table, says):
    """The last value is not the first, the first row is after 0 s, or 2 s have 2 s / 0.8 µs periods."""
    with pytest.raises(SceneError, match=says):
        wheel().with_(driver=({"joint": "J", "table": table, "periodic": True},))


def test_row_of_a_repeated_table_that_was_edited_in_one_period_is_refused():
    """A file that mbref wrote has the six rows of each period: rows 3 and 9 are one row, of two periods."""
    found = driven().to_dict()
    found["driver"][0]["table"][9][1] = 0.7
    with pytest.raises(SceneError, match="period_rows: is 6, but rows 3 and 9 of the table differ"):
        mbref.Scene(**found)
