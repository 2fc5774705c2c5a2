"""Angles, torques, energies and signs of quaternions at a time do not depend on other samples of a run."""

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import mbref
from crosscheck.judge.constraints import coupling_gaps
from crosscheck.judge.energy import energy_drift, energy_series
from mbref.cli import main
from mbref.scene import Scene
from tests.helpers.coupled_mechanisms import gear_pair
from tests.helpers.parts import hinge
from tests.helpers.spinning import spinning_mechanism

END = 3.0  # s, in which the fastest joints make some 20 turns
NATURAL, STIFFNESS, INERTIA = 40.0, 12.0, 3.0  # rad, N m/rad, kg m²
TIMES = np.linspace(0.0, END, 601)
OUTPUTS = (".angle", ".torque", "energy", *(f".orientation.{part}" for part in "wxyz"))
# taylor computes samples inside its steps. Other methods end steps at samples, so that their errors differ:
# up to 1e-4 of an output in 20 turns. A missed turn would change an angle by 0.05 of its size or more.
ROUNDING, STEPS = 1e-12, 1e-3  # relative differences of outputs: by rounding, and by steps of other lengths
CLOSE = 1e-9  # rad, or of the energy: rounding of angles of up to 100 rad over thousands of steps


def wound_wheel() -> Scene:
    """Return a wheel at rest on a torsion spring, wound up by 40 rad: φ = 40 (1 - cos 2 t) rad."""
    wheel = {"name": "wheel", "mass": 2.0, "inertia": [2.0, 2.0, INERTIA], "position": [0.0, 0.0, 0.0]}
    spring = {"type": "torsion_spring", "joint": "H", "stiffness": STIFFNESS, "natural_angle": NATURAL}
    joints = [hinge("H", "ground", "wheel", (0.0, 0.0, 0.0))]
    return Scene(name="wound", duration=END, body=[wheel], joint=joints, load=[spring])


def choices(random: np.random.Generator, count: int) -> Iterator[np.ndarray]:
    """Yield places of samples: the ends, a few at random, only late ones, a single one."""
    yield np.array([0, count - 1])
    yield np.sort(random.choice(count, 6, replace=False))
    yield np.array([count // 2, count - 1])
    yield np.array([count - 1])


def differences(dense: mbref.Motion, method: str, random: np.random.Generator) -> float:
    """Return the largest difference of an output between the run at TIMES and runs at some of its samples,
    over the output's size or 1. If the run at TIMES completes, the others must."""
    reached, table = len(dense.times), dense.columns()
    largest = 0.0
    for chosen in choices(random, reached):
        run = mbref.simulate(dense.mechanism, method, TIMES[chosen])
        if run.outcome is not mbref.Outcome.COMPLETED:
            assert dense.outcome is run.outcome, run.message
            continue
        found = run.columns()
        for name, column in table.items():
            if name.endswith(OUTPUTS):
                size = max(1.0, np.abs(column).max())
                largest = max(largest, np.abs(found[name] - column[chosen]).max() / size)
    return largest


@pytest.mark.parametrize(
    ("method", "tolerance"),  # relative, and rad
    [("taylor", 1e-6), ("alf-dual", 1e-6), ("mpi-svd+partitioning/rk4[step=5e-4]", 1e-2)],
)
@pytest.mark.parametrize("times", [[END], [0.4, 1.3, 2.9], [2.2, END]], ids=str)
def test_angle_of_a_wheel_on_a_spring_counts_full_turns_from_the_start(method, tolerance, times):
    """φ = 40 (1 - cos 2 t) rad, spring torque -12 (φ - 40), energy 12 · 40² / 2, a quaternion of
    cos φ/2 and sin φ/2, at samples that are turns apart. A missed turn is 6.28 rad."""
    motion = mbref.simulate(wound_wheel(), method, times)
    t = np.array(times)
    angle = NATURAL * (1.0 - np.cos(2.0 * t))
    assert motion.joint("H").angle == pytest.approx(angle, rel=tolerance, abs=tolerance)
    torque = -STIFFNESS * (angle - NATURAL)
    assert motion.load_at(0).torque == pytest.approx(torque, rel=tolerance, abs=STIFFNESS * tolerance)
    assert motion.energy == pytest.approx(STIFFNESS * NATURAL**2 / 2, rel=tolerance)
    quaternion = np.stack((np.cos(angle / 2), 0 * t, 0 * t, np.sin(angle / 2)), axis=1)
    assert np.abs(motion["wheel"].orientation - quaternion).max() < NATURAL * tolerance


@pytest.mark.parametrize("seed", range(8))
def test_outputs_of_random_mechanisms_are_equal_for_other_samples(seed):
    """A run with few samples, or one, has the outputs of a run with 601 samples, to rounding."""
    dense = mbref.simulate(spinning_mechanism(seed), "taylor", TIMES)
    assert dense.outcome is mbref.Outcome.COMPLETED, dense.message
    assert differences(dense, "taylor", np.random.default_rng(seed)) < ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8, 200))
def test_outputs_of_many_random_mechanisms_are_equal_for_other_samples(seed):
    """A motion that ends early, near a singular position or by a fixed step, is compared up to there."""
    scene = spinning_mechanism(seed)
    other = ("alf-dual", "mpi-svd+projection", "mpi-svd+partitioning/rk4[step=5e-4]", "lm1/adams")[seed % 4]
    for method, tolerance in (("taylor", ROUNDING), (other, STEPS)):
        dense = mbref.simulate(scene, method, TIMES)
        assert differences(dense, method, np.random.default_rng(seed)) < tolerance


@pytest.mark.parametrize("seed", range(4))
def test_angle_at_the_end_alone_is_the_angle_that_dense_samples_show(seed):
    """Between samples of 5 ms no joint makes half a turn, so that their poses show all turns."""
    scene = spinning_mechanism(seed)
    dense = mbref.simulate(scene, times=TIMES)
    late = mbref.simulate(scene, times=TIMES[[-1]])
    for joint in scene.joint:
        seen = np.unwrap(np.mod(dense.joint(joint.name).angle + np.pi, 2 * np.pi) - np.pi)
        assert late.joint(joint.name).angle[0] == pytest.approx(seen[-1], abs=CLOSE)


def test_run_file_table_and_json_have_the_angle_with_its_full_turns(tmp_path, capsys):
    """φ = 40 (1 - cos 2 t) rad at 3 s, to a relative 1e-6; the file has the angle to the bit."""
    scene, path = wound_wheel(), tmp_path / "wound.toml"
    scene.save(path)
    expected = NATURAL * (1.0 - math.cos(2.0 * END))
    motion = mbref.simulate(scene, times=[END])
    motion.save(tmp_path / "run.json")
    loaded = mbref.Motion.load(tmp_path / "run.json")
    assert loaded.joint("H").angle[0] == motion.joint("H").angle[0] == pytest.approx(expected)
    assert loaded.energy[0] == motion.energy[0]
    table = tmp_path / "run.csv"
    assert main(["run", str(path), "--times", str(END), "--out", str(table)]) == 0
    (row,) = csv.DictReader(table.read_text(encoding="utf-8").splitlines())
    assert float(row["H.angle"]) == pytest.approx(expected)
    capsys.readouterr()
    assert main(["run", str(path), "--times", str(END), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)["records"][0]
    assert record["angles"]["H"] == pytest.approx([expected])


def test_angle_of_an_engine_without_turns_is_nan_where_its_samples_are_too_far_apart():
    """Poses and rates at 5 ms determine the turns between them; samples at 0, 0.7 and 3 s do not, nor does a
    first sample at 2.9 s. The energy includes the spring's, so it is not known there either."""
    motion = mbref.simulate(wound_wheel(), times=TIMES)
    dense = mbref.Motion.of(motion.mechanism, replace(motion, angles=None))
    assert dense.joint("H").angle == pytest.approx(motion.joint("H").angle, abs=CLOSE)
    few = mbref.simulate(wound_wheel(), times=[0.0, 0.7, END])
    sparse = mbref.Motion.of(few.mechanism, replace(few, angles=None))
    assert np.isnan(sparse.joint("H").angle).tolist() == [False, True, True]
    assert np.isnan(sparse.energy).tolist() == [False, True, True]
    late = mbref.simulate(wound_wheel(), times=[2.9, 2.905])
    assert np.isnan(mbref.Motion.of(late.mechanism, replace(late, angles=None)).joint("H").angle).all()


def test_turns_of_steady_gears_are_counted_by_their_rates_where_samples_are_turns_apart():
    """The pinion turns at 9 rad/s, the wheel at half of it: several turns between samples. An engine that
    counts no turns has the closed form all the same, and the judge sees the gears obey their ratio."""
    times = np.array([0.0, 1.9, 2.7, 6.0])
    scene = gear_pair(load=[], driver=[{"joint": "A", "polynomial": [0.0, 9.0]}], duration=6.0)
    motion = replace(mbref.simulate(scene, times=times), angles=None)
    assert mbref.Motion.of(scene, motion).joint("A").angle == pytest.approx(9.0 * times, rel=1e-12)
    assert motion["pinion"].orientation[:, 0] == pytest.approx(np.cos(4.5 * times), abs=1e-12)
    state = motion.position, motion.orientation, motion.angular_velocity
    (gap,) = coupling_gaps(scene, times, *state).values()
    assert np.abs(gap).max() < 1e-10  # rad, of angles of 54 rad


def test_judge_sees_a_miscounted_turn_of_few_samples_as_a_change_of_energy():
    """With the run's own turns, kinetic energy and 12 (φ - 40)² / 2 J of the spring have a constant sum, to
    1e-9 of it (CLOSE). One turn more adds 2π to φ, and 12 · 2π (φ - 40 + π) J to the sum. Without turns it is
    None."""
    few = mbref.simulate(wound_wheel(), times=[0.7, END])
    assert energy_series(few.mechanism, few).max() < CLOSE
    assert energy_series(few.mechanism, replace(few, angles=None)) is None
    assert energy_series(few.mechanism, replace(few, times=1e-300 * few.times)) is None  # nothing moves
    turned = NATURAL * (1.0 - np.cos(2.0 * few.times))
    wrong = replace(few, angles={"H": few.angles["H"] + 2 * np.pi})
    change = STIFFNESS * 2 * np.pi * (turned - NATURAL + np.pi)
    assert energy_drift(few.mechanism, wrong) == pytest.approx(np.abs(change), rel=CLOSE)
