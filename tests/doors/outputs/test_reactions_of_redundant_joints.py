"""Reactions that equilibrium does not determine are the ones of least norm, whatever rounding enters."""

from __future__ import annotations

import numpy as np
import pytest

from mbref import Scene, find_scene, simulate
from tests.helpers.parts import SKEW, block, hinge

TIMES = np.linspace(0.0, 0.4, 5)
ROUNDING = 1e-12  # difference of reactions / largest one


def door() -> Scene:
    """Return a door on two hinges about one skew axis, with a flap: five components are open."""
    joints = [
        hinge("low", "ground", "door", (0.0, 0.0, 0.0), SKEW),
        hinge("high", "ground", "door", SKEW, SKEW),
        hinge("flap", "door", "flap", (0.7, 0.2, 0.4), (0.3, 0.5, -0.2)),
    ]
    bodies = [block("door", (0.4, 0.1, 0.2)), block("flap", (0.9, 0.3, 0.5))]
    return Scene(name="door", gravity=(0.3, -2.0, -9.0), body=bodies, joint=joints)


@pytest.mark.parametrize("scene", [door(), find_scene("four_bar").with_(gravity=(1.0, -9.0, 3.0))], ids=str)
def test_undetermined_reactions_do_not_depend_on_the_order_of_bodies_and_joints(scene):
    """Equilibrium leaves components of redundant joints open (`open_reactions`). Of all reactions that
    balance the bodies, those of least norm are unique: both orders of a scene must have them, to rounding."""
    first = simulate(scene, times=TIMES)
    other = simulate(scene.with_(body=scene.body[::-1], joint=scene.joint[::-1]), times=TIMES)
    assert any(opened.any() for opened in first.open_reactions.values())
    largest = max(np.abs(wrench).max() for wrench in first.reactions.values())
    for name, wrench in first.reactions.items():
        assert np.abs(wrench - other.reactions[name]).max() <= ROUNDING * largest
