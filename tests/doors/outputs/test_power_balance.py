"""Work of drivers and loads is the change of energy, of random mechanisms and by their outputs alone."""

import csv

import numpy as np
import pytest

from crosscheck.judge.energy import kinetic_energy
from mbref import Limits, Motion, Scene, simulate
from tests.helpers.power_balance import panel_times, unbalanced
from tests.helpers.powered_mechanisms import powered_mechanism

BALANCED = 1e-9  # imbalance / largest power: error of the quadrature over three panels
PANELS = 3
GATE = range(11)
# mechanisms of a slow test, and how many of them may be refused, or move too fast for the samples
MANY, WITHOUT_BALANCE = 20, 3
PLAIN = [0, 2, 6, 10]  # mechanisms without massless links
OTHERS = ("alf-dual+projection", "mpi-qr+partitioning", "alf-dual+baumgarte/adams")


def run(scene: Scene, method: str = "taylor", rtol: float = 1e-13) -> Motion:
    return simulate(scene, method, panel_times(scene.duration, PANELS), Limits(rtol=rtol))


def off(motion: Motion) -> float:
    """Return the imbalance over the largest power of a driver, load or weight; NaN without samples."""
    scene = motion.mechanism
    if not motion.times.size:
        return float("nan")
    falling = [body.mass * motion[body.name].velocity @ np.array(scene.gravity) for body in scene.body]
    return unbalanced(motion.columns(), float(np.abs(falling).max(initial=0.0)))


@pytest.mark.parametrize(
    ("seed", "method", "rtol"),
    [*((seed, "taylor", 1e-13) for seed in GATE), *((s, m, 1e-12) for s in PLAIN[:2] for m in OTHERS)],
)
def test_work_of_drivers_and_loads_is_the_change_of_energy(seed, method, rtol):
    """E(t) - E(0) = ∫ Σ P dt, by Gauss–Legendre over three panels of the run's columns, to BALANCED of the
    largest power. OTHERS are sparse matrices, partitioning, and Adams's method with feedback."""
    motion = run(powered_mechanism(seed), method, rtol)
    assert motion.outcome.name == "COMPLETED", motion.message
    assert off(motion) < BALANCED


@pytest.mark.slow
@pytest.mark.parametrize("first", range(100, 340, MANY))
def test_work_is_the_change_of_energy_of_many_mechanisms(first):
    """E(t) - E(0) = ∫ Σ P dt; 3 of 20 mechanisms may lack samples, or have powers too fast for the panels."""
    found = {seed: off(run(powered_mechanism(seed))) for seed in range(first, first + MANY)}
    moved = {seed: imbalance for seed, imbalance in found.items() if not np.isnan(imbalance)}
    assert len(moved) >= MANY - WITHOUT_BALANCE, f"balances from {first} on for {list(moved)} only"
    assert max(moved.values()) < BALANCED, moved


@pytest.mark.parametrize("seed", PLAIN)
def test_kinetic_energy_equals_the_judges_of_the_same_states(seed):
    """mbref and the judge have separate code for Σ (m v² + ω J ω) / 2 with armatures. Values may differ by
    1e-12 of the value and 1e-12 of the largest one, each some 5000 roundings."""
    motion = run(powered_mechanism(seed))
    assert motion.outcome.name == "COMPLETED", motion.message
    states = motion.position, motion.orientation, motion.velocity, motion.angular_velocity
    exact = kinetic_energy(motion.mechanism, *states)
    assert np.allclose(motion.kinetic_energy, exact, rtol=1e-12, atol=1e-12 * exact.max())


def test_powers_in_a_run_file_and_in_a_table_balance_the_energy(tmp_path):
    """E(t) - E(0) = ∫ Σ P dt by the columns of a mechanism with several drivers, as read back from files."""
    motion = run(powered_mechanism(11))
    assert motion.outcome.name == "COMPLETED" and len(motion.mechanism.driver) > 1
    motion.save(tmp_path / "run.json")
    motion.to_csv(tmp_path / "run.csv")
    with open(tmp_path / "run.csv", newline="") as file:
        names, *rows = csv.reader(file)
    table = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
    assert unbalanced(Motion.load(tmp_path / "run.json").columns()) < BALANCED
    assert unbalanced(table) < BALANCED
