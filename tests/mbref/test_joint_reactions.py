"""Reactions that equilibrium leaves open at a singular position alone, and a body without joints."""

import numpy as np

from mbref.equations.joint_reactions import determined_components, open_dimensions
from mbref.equations.model import Model
from mbref.scene import Scene
from tests.helpers.parts import X, block, joint

UPRIGHT = block("b", (0.0, 0.0, 0.0), orientation=[1.0, 0.0, 0.0, 0.0])


def test_reactions_are_open_only_at_the_sample_of_the_singular_position():
    """A rod of 1 m along y stands across a slide along x at the second of three samples: the force along the
    rod, and its moment of 2 m at the slide, are open there."""
    slide = joint("slide", "translational", "ground", "b", axis=X)
    rod = joint("rod", "distance", "ground", "b", anchors=[[2.0, 1.0, 0.0], [2.0, 0.0, 0.0]])
    system = Model(Scene(name="s", body=[UPRIGHT], joint=[slide, rod]))
    q = np.array([[[x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]] for x in (-0.3, 0.0, 0.5)])
    blocks = system.terms(np.zeros(3), q).blocks
    found = open_dimensions(system, blocks)
    assert {name: k.tolist() for name, k in found.items()} == {"slide": [0, 1, 0], "rod": [0, 1, 0]}
    components = determined_components(system, q, blocks)
    assert components["slide"][1].tolist() == [True, False, True, True, True, False]
    assert components["rod"][1].tolist() == [True, False, True, True, True, True]
    assert all(c[[0, 2]].all() for c in components.values())
