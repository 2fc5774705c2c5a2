"""Consistent starts of two bodies, worked out by hand, by dense and by sparse matrices; perturbed scenes."""

import re

import numpy as np
import pytest

from mbref.equations.initial_state import LARGE, Start, consistent_start, solve_positions
from mbref.equations.model import Model, displaced
from mbref.scene import Body, Scene, Spherical
from mbref.scenes import SCENES

ARM, INERTIA = 0.5, 0.2  # m, kg m²
ACCURACY = 1e-9  # relative; Newton's method and least squares leave rounding, below 1e-12
PAIRS = (1, LARGE // 3 + 1)  # three rows a pair: one pair is solved by dense, many by sparse matrices


def pairs(count, gap=0.0, **of_first):
    """Return pairs of a mass of 1 kg at a ball joint with a rod of 3 kg, its centre ARM above."""
    bodies, joints = [], []
    for k in range(count):
        x = 2.0 * k
        first = Body(name=f"a{k}", mass=1.0, inertia=(0.1,) * 3, position=(x, 0.0, 0.0), **of_first)
        rod = Body(name=f"b{k}", mass=3.0, inertia=(INERTIA, INERTIA, 0.0), position=(x + gap, 0.0, ARM))
        bodies += [first, rod]
        anchors = {"anchor": (x, 0.0, 0.0)}
        joints.append(Spherical(name=f"J{k}", bodies=(first.name, rod.name), **anchors))
    return Model(Scene(name="pairs", body=tuple(bodies), joint=tuple(joints)))


@pytest.mark.parametrize("count", PAIRS)
def test_gap_closes_by_displacements_in_inverse_ratio_of_the_masses(count):
    """A gap g between masses 1 and 3 closes by 3/4 g and 1/4 g: least Σ m |x|², with x₁ - x₂ = g, to
    ACCURACY. One pair is solved by dense matrices, many pairs by sparse ones (PAIRS)."""
    model, gap = pairs(count), 1e-3
    q = model.start().copy().reshape(-1, 2, 7)
    q[:, 1, 2] += gap
    found, phi = solve_positions(model, 0.0, q.ravel())
    moved = found.reshape(-1, 2, 7) - q
    assert np.abs(phi).max() < ACCURACY * gap
    assert moved[:, 0, 2] == pytest.approx(0.75 * gap, rel=ACCURACY)
    assert moved[:, 1, 2] == pytest.approx(-0.25 * gap, rel=ACCURACY)
    assert np.abs(np.delete(moved, 2, axis=2)).max() < ACCURACY * gap


@pytest.mark.parametrize("count", PAIRS)
def test_missing_velocities_minimise_the_kinetic_energy(count):
    """The mass is given 1 m/s across the rod, the rod nothing. By least kinetic energy its centre has the
    velocity I / (I + m l²) and the rod the rate -m l / (I + m l²), to ACCURACY. One pair is solved by dense
    matrices, many by sparse ones (PAIRS)."""
    found = consistent_start(pairs(count, velocity=(1.0, 0.0, 0.0)))
    v = found.v.reshape(-1, 2, 6)
    effective = INERTIA + 3.0 * ARM**2
    assert v[:, 0, 0] == pytest.approx(1.0, rel=ACCURACY)
    assert v[:, 1, 0] == pytest.approx(INERTIA / effective, rel=ACCURACY)
    assert v[:, 1, 4] == pytest.approx(-3.0 * ARM / effective, rel=ACCURACY)
    v[:, 0, 0] = v[:, 1, 0] = v[:, 1, 4] = 0.0
    assert np.abs(v).max() < ACCURACY, "all other velocities are zero"


def test_report_of_a_start_names_corrections_of_more_than_a_billionth():
    """``off`` has relative violations of given positions and velocities; up to 1e-9 none is reported."""
    state = dict.fromkeys(("q", "v", "given"), np.zeros(0))
    for off, says in (
        ((1e-10, 1e-10), "^$"),
        ((2e-9, 0.0), r"^initial positions .* 2.00e-09 .*; corrected$"),
        ((0.0, 3e-9), r"^initial velocities by 3.00e-09.*; corrected$"),
        ((2e-3, 3e-4), r"^initial positions .* 2.00e-03 .*and velocities by 3.00e-04.*; corrected$"),
    ):
        report = Start(**state, position_violation=off[0], velocity_violation=off[1]).report()
        assert re.search(says, report), report


# at the bifurcation itself Φ is quadratic in one direction, which Newton's method does not correct
@pytest.mark.parametrize("name", [n for n in SCENES if n != "four_bar_straight"])
def test_positions_that_are_off_by_millimetres_are_corrected_by_centimetres_at_most(name):
    """Coordinates are moved at random by 1 mm or 1 mrad (standard deviation), which violates constraints by
    more than 1e-5. Newton's method leaves |Φ| < 1e-10, and moves no coordinate by more than 0.02 m or rad."""
    model = Model(SCENES[name]())
    rng = np.random.default_rng(5)
    perturbed = displaced(model.start(), 1e-3 * rng.normal(size=model.n))
    before = np.max(np.abs(model.terms(0.0, perturbed, np.zeros(model.n)).phi))
    q, violations = solve_positions(model, 0.0, perturbed)
    after = np.max(np.abs(violations))
    moved = np.max(np.abs(q - perturbed))
    assert before > 1e-5, f"{name}: the perturbation violates nothing ({before:.1e})"
    assert after < 1e-10, f"{name}: a violation of {after:.1e} is left"
    assert moved < 0.02, f"{name}: corrected by {moved:.1e}, which is not near"
