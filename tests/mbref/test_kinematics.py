"""The freedoms that drivers leave, and corrections of perturbed starts."""

import numpy as np
import pytest

import mbref
from mbref.equations.counts import undriven_freedoms
from mbref.equations.initial_state import solve_positions
from mbref.equations.model import Model, displaced
from mbref.scenes import SCENES


def test_driver_of_a_straight_four_bar_leaves_no_degree_of_freedom():
    """``counts`` counts at other poses, where the mechanism has one freedom, which the driver takes. At the
    straight pose the rank is lower."""
    scene = SCENES["four_bar_straight"]()
    assert mbref.counts(scene).degrees_of_freedom == 1
    assert undriven_freedoms(scene) == 0


# at the bifurcation itself Φ is quadratic in one direction, which Newton's method does not correct
@pytest.mark.parametrize("name", [n for n in SCENES if n != "four_bar_straight"])
def test_positions_that_are_off_by_millimetres_are_corrected_by_centimetres_at_most(name):
    """Coordinates are moved at random by 1 mm or 1 mrad (standard deviation), which violates constraints by
    more than 1e-5. Newton's method leaves |Φ| < 1e-10, and moves no coordinate by more than 20 standard
    deviations, 0.02 m or rad."""
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
