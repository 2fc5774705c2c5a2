"""Error estimates: closed forms, sensitive motions, rounding, ends of second runs, records and commands."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.parts import linkage
from mbref import ErrorEstimate, Limits, Motion, Scene, simulate, with_error_estimate
from mbref.cli.commands import main
from mbref.motions.trajectory import Cost, Outcome
from mbref.records import strict_json
from mbref.scene import Driver
from mbref.scenes import SCENES
from mbref.simulation.second_run import perturbed
from tests.helpers.measured import relative_error
from tests.helpers.parts import slide, spring
from tests.helpers.statics import rod

TIMES = np.array([0.0, 0.5, 1.0, 1.5])
UNIT = 2.0**-52  # relative distance of neighbouring doubles


def estimate(*errors: float, rtol: float | None = 1e-9, **more) -> ErrorEstimate:
    return ErrorEstimate(TIMES, np.array(errors), rtol, "taylor", **more)


@pytest.fixture(scope="module")
def pendulums() -> Scene:
    """Three rods in a row, released from a horizontal line: chaotic."""
    row = linkage("pendulums", [(0.4 * k, 0.0, 0.0) for k in range(4)])
    return row.with_(joint=row.joint[:-1], duration=8.0)


@pytest.fixture(scope="module")
def oscillator() -> Scene:
    """A mass of 1 kg on a spring of 100 N/m, 0.2 m from its place of rest: x = 1 + 0.2 cos 10 t."""
    start, origin = (1.2, 0.0, 0.0), (0.0, 0.0, 0.0)
    body, guide = rod("mass", start, 1.0, 0.01), slide("D", "ground", "mass", origin)
    pull = spring("ground", origin, "mass", start, 100.0, 1.0)
    return Scene(name="oscillator", duration=1.0, body=[body], joint=[guide], load=[pull])


@pytest.fixture(scope="module")
def dead() -> Scene:
    """A driven crank of 0.5 m that cannot turn to the far side of the last hinge, 1.2 m away: the other bars
    reach 0.5 m + 0.57 m, less than 1.2 m + 0.5 m."""
    bars = linkage("dead", [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.8, 0.4, 0.0), (1.2, 0.0, 0.0)])
    return bars.with_(duration=1.0, driver=(Driver(joint="P0", polynomial=(0.0, 2.0)),))


@pytest.mark.parametrize(
    ("found", "continuation"),
    [
        (estimate(0.0, 5e-10, 3e-9, 2e-9), "3.0e-09, above rtol 1e-09 from t = 1 s on"),
        (estimate(0.0, 1e-10, 2e-10, np.nan, reason="the second run ended"), "2.0e-10; the second run ended"),
        (estimate(0.0, 0.1, 0.2, 0.3, rtol=None), "3.0e-01"),
    ],
    ids=["above rtol", "last sample missing", "fixed steps, without rtol"],
)
def test_sentence_of_an_estimate_states_the_largest_error_and_when_it_exceeds_rtol(found, continuation):
    """Errors are given at 0, 0.5, 1 and 1.5 s, with rtol 1e-9. None of them is so large that it needs a
    warning, and those of fixed steps have no rtol to be compared with."""
    assert found.sentence == f"largest estimated error: {continuation}" and not found.warning


@pytest.mark.parametrize(
    ("rtol", "error", "warns"),
    [
        (1e-9, 1e-6, False),
        (1e-9, 1.1e-6, True),
        (1e-12, 1e-8, False),
        (1e-5, 9e-3, False),
        (1e-5, 1.1e-2, True),
    ],
)
def test_warning_needs_an_error_above_a_thousand_tolerances_and_a_millionth(rtol, error, warns):
    """A thousand tolerances are 1e-6, 1e-9 and 1e-2; the third error is above this, but below a millionth."""
    assert bool(estimate(0.0, 0.0, error, 0.0, rtol=rtol).warning) == warns


@pytest.mark.parametrize(
    ("tighter", "says"),
    [
        ((1e-12, 6e-8), "sensitive motion: error about 3 from t = 1 s on; rtol 1e-12 gives 6e-08"),
        ((1e-12, 0.9e-9), "inaccurate run: error about 3 from t = 1 s on; rtol 1e-12 gives 9e-10"),
        (None, "sensitive motion: error about 3 from t = 1 s on"),
    ],
)
def test_warning_states_the_error_its_time_and_a_tighter_tolerance_with_its_error(tighter, says):
    """``tighter`` has a tolerance that was tried and its largest error. With rtol 1e-5, the error is above a
    thousand rtol from 1 s on. A run whose error falls below a thousand times the tighter tolerance was
    inaccurate; otherwise the motion is sensitive."""
    assert estimate(0.0, 1e-3, 0.5, 3.1, rtol=1e-5, tighter=tighter).warning == says


def test_estimate_is_the_true_error_of_an_oscillation(oscillator):
    """Closed form x = 1 + 0.2 cos 10 t; the length of the mechanism is 1.2 m, from the joint to the mass. The
    estimate is within a thousandth of the true error, which is a million times rounding at order 4."""
    motion = simulate(oscillator, "taylor[order=4]", limits=Limits(rtol=1e-4))
    assert motion.outcome is Outcome.COMPLETED
    true = np.abs(motion["mass"].position[:, 0] - 1 - 0.2 * np.cos(10 * motion.times)) / 1.2
    assert true.max() > 1e-10, "the run is too accurate for a test"
    assert np.abs(with_error_estimate(motion).error_estimate.error - true).max() < 1e-3 * true.max()


def test_message_warns_of_a_sensitive_motion_and_states_the_error_at_a_tighter_tolerance(pendulums):
    """A chaotic triple pendulum: with rtol 1e-4 the error exceeds 0.1. The error that the estimate states for
    the tighter tolerance 1e-12 is less than a hundredth of this. A run with rtol 1e-12 has an estimate of the
    same size, to a factor of ten."""
    motion = simulate(pendulums, "taylor", rtol=1e-4)
    warned = with_error_estimate(motion)
    found = warned.error_estimate
    assert motion.outcome is warned.outcome is Outcome.COMPLETED and motion.message == ""
    assert warned.message == found.warning and found.warning.startswith("sensitive motion: error about ")
    assert found.largest > 0.1 and found.tighter[1] < found.largest / 100
    accurate = with_error_estimate(simulate(pendulums, "taylor", rtol=1e-12)).error_estimate
    assert 0.1 < accurate.largest / found.tighter[1] < 10 and accurate.tighter is None


def test_estimate_at_the_smallest_tolerance_shows_the_growth_of_rounding_errors(pendulums):
    """In 8 s of a chaotic motion the rounding of the start grows by far more than the factor 20, from the
    first sample after the start to the last. Two runs from one start would not show it."""
    found = with_error_estimate(simulate(pendulums, "taylor", rtol=1e-15)).error_estimate
    assert found.error[-1] > 20 * found.error[1] > 0


@pytest.mark.parametrize(
    ("name", "duration"),
    [("planar_slider_crank_equal", 0.3), ("four_bar_straight", 0.1)],
    ids=["passes singular positions", "driven, begins at a singular position"],
)
def test_motion_at_a_singular_position_has_its_true_error_as_its_estimate(name, duration):
    """Errors are those from the judge's closed form. The passing motion is off by 4e-10, and its estimate by
    less than 20 % of this (2 % are found). Error and estimate of the driven motion are rounding alone."""
    rounding = 1e-12  # of the length, or rad; the driven motion has an estimate of 1e-13
    motion = with_error_estimate(simulate(name, duration=duration))
    found, true = motion.error_estimate, relative_error(motion, SCENES[name]())
    assert 0.8 * true < found.largest < 1.2 * true + rounding and not np.isnan(found.error).any()


def test_start_of_the_second_run_differs_by_rounding_and_keeps_zeros(pendulums):
    """Each number x changes by one to two roundings, at most 2.5 · 2⁻⁵² |x| (UNIT is 2⁻⁵²), so that zeros
    stay. More than ten numbers change, equally in each call."""

    def numbers(scene: Scene) -> np.ndarray:
        fields = [b.position + b.inertia for b in scene.body] + [j.anchor + j.axis for j in scene.joint]
        return np.array([x for numbers in (scene.gravity, *fields) for x in numbers])

    before, after = numbers(pendulums), numbers(perturbed(pendulums))
    assert (np.abs(after - before) <= 2.5 * UNIT * np.abs(before)).all() and (after != before).sum() > 10
    assert perturbed(pendulums) == perturbed(pendulums)


def test_samples_that_the_second_run_does_not_reach_have_no_estimate(dead):
    """The driven motion ends at a dead position before its 101 samples are reached. Its last state is
    appended three times, at 2, 3 and 4 s."""
    motion = with_error_estimate(simulate(dead))
    assert 2 < len(motion.times) < 101 and not np.isnan(motion.error_estimate.error).any()
    last = np.repeat([len(motion.times) - 1], 3)
    more = {
        name: np.concatenate([getattr(motion, name), getattr(motion, name)[last]])
        for name in ("position", "orientation", "velocity", "angular_velocity")
    }
    times = np.concatenate([motion.times, 2.0 + np.arange(3)])
    found = with_error_estimate(replace(motion, times=times, **more)).error_estimate
    assert np.isnan(found.error).tolist() == [False] * len(motion.times) + [True] * 3
    assert found.reason.startswith("the second run ended at t = ") and "dead position" in found.reason


def test_run_of_more_seconds_than_the_limit_is_not_repeated(pendulums):
    """The run's cost is set to 7 s, the limit is 5 s; without limit the run is repeated."""
    motion = replace(simulate(pendulums, duration=0.1), cost=Cost(seconds=7.0))
    found = with_error_estimate(motion, 5.0).error_estimate
    assert found.largest is None and found.second_run == "" and np.isnan(found.error).all()
    remedy = "--estimate yes and with_error_estimate have no time limit"
    assert found.sentence == f"no error estimate: the run took 7 s, more than 5 s; {remedy}"
    assert with_error_estimate(motion).error_estimate.largest is not None


def test_second_run_ends_at_its_time_limit(pendulums):
    """The limit is 0 s; the run's cost is set to 0 s, so that a second run begins."""
    motion = replace(simulate(pendulums), cost=Cost(seconds=0.0))
    found = with_error_estimate(motion, 0.0).error_estimate
    assert found.largest is None and found.reason.startswith("a second run takes longer than 0 s")


def test_error_of_a_motion_by_another_engine_cannot_be_estimated(pendulums):
    """A second run needs mbref; the motion states that MuJoCo made it."""
    motion = replace(simulate(pendulums, duration=0.1), engine="mujoco")
    with pytest.raises(ValueError, match="a motion of mujoco"):
        with_error_estimate(motion)


def test_estimate_is_written_only_after_it_was_requested(pendulums, tmp_path):
    """Record, columns and CSV file have no estimate before ``with_error_estimate``, its values after."""
    motion = simulate(pendulums, duration=0.5)
    assert motion.to_record()["error_estimate"] is None and "error_estimate" not in motion.columns()
    motion = with_error_estimate(motion)
    found = motion.error_estimate
    motion.save(tmp_path / "motion.json")
    read = Motion.load(tmp_path / "motion.json").error_estimate
    assert np.array_equal(read.error, found.error) and read.to_record() == found.to_record()
    motion.to_csv(tmp_path / "motion.csv")
    rows = list(csv.DictReader((tmp_path / "motion.csv").read_text().splitlines()))
    assert [float(row["error_estimate"]) for row in rows] == found.error.tolist()


def test_estimate_with_missing_samples_is_read_back_equal_from_its_json_text():
    """JSON has no NaN: a missing sample is written as null."""
    written = estimate(0.0, 1e-10, np.nan, np.nan, reason="the second run ended", tighter=(1e-12, 1e-9))
    text = strict_json(written.to_record())
    read = ErrorEstimate.from_record(TIMES, json.loads(text))
    assert "null" in text and np.array_equal(read.error, written.error, equal_nan=True)
    for field in ("rtol", "second_run", "reason", "tighter"):
        assert getattr(read, field) == getattr(written, field), field


def ran(pendulums: Scene, folder, capsys, *options: str) -> str:
    """Return the output of a run of the pendulums with rtol 1e-4."""
    path = folder / "pendulums.toml"
    pendulums.save(path)
    assert main(["run", str(path), "--rtol", "1e-4", *options]) == 0
    return capsys.readouterr().out


def test_command_prints_the_estimate_of_its_json_record_and_warns(capsys, pendulums, tmp_path):
    """The table shows two of its digits. The pendulums are chaotic: rtol 1e-4 leads to large errors."""
    said = " ".join(ran(pendulums, tmp_path, capsys).split())
    record = json.loads(ran(pendulums, tmp_path, capsys, "--json"))["records"][0]
    [printed] = re.findall(r"largest estimated error: ([-+.\de]+)", said)
    assert printed == f"{record['error_estimate']['largest']:.1e}"
    assert "sensitive motion: error about" in said and "sensitive motion" in record["message"]


def test_record_of_a_command_with_estimate_no_has_neither_estimate_nor_warning(capsys, pendulums, tmp_path):
    """The motion is sensitive, so that an estimate would warn."""
    record = json.loads(ran(pendulums, tmp_path, capsys, "--json", "--estimate", "no"))["records"][0]
    assert record["error_estimate"] is None and record["message"] == ""


def test_table_of_columns_shows_errors_far_below_one(capsys, oscillator, tmp_path):
    """After 0.01 s the error is of the size of rounding, less than 1e-12, and is not printed as zero."""
    path = tmp_path / "oscillator.toml"
    oscillator.save(path)
    assert main(["run", str(path), "--times", "0,0.01", "--columns", "error_estimate"]) == 0
    rows = [line.split("│") for line in capsys.readouterr().out.splitlines() if line.startswith("│ 0.01")]
    assert len(rows) == 1 and 0 < float(rows[0][2]) < 1e-12
