"""Exudyn's reactions satisfy the equations of Newton and Euler of the body that the joint holds."""

import numpy as np
import pytest

from crosscheck.engine import Setting
from crosscheck.engines.exudyn.adapter import ENGINE
from crosscheck.judge.reaction_balance import balance
from mbref.motions.trajectory import Outcome
from mbref.scene import HOLONOMIC_JOINTS, Driver, Moment, Revolute, Scene, Sine
from tests.helpers.measured import MARGIN
from tests.helpers.parts import X
from tests.helpers.tree_scenes import body

SIDEWAYS = (0.6, 0.0, 0.8)  # an axis along no coordinate axis
BODY = body("b", (0.0, 0.2, 0.0), (0.3, -0.5, 0.8), mass=2.0)
ANCHOR, OTHER = (0.1, 0.1, -0.2), (0.3, -0.1, 0.1)
PLACES = {"anchor": ANCHOR, "anchors": (ANCHOR, OTHER), "axis": SIDEWAYS, "axes": (X, (0.0, 1.0, 1.0))}
HOLDING = {name: kind for name, kind in HOLONOMIC_JOINTS.items() if kind.facts.rows}  # not free joints
UNDRIVEN = [(name, False) for name in HOLDING]
DRIVEN = [(name, True) for name, kind in HOLDING.items() if kind.facts.driven]


@pytest.mark.parametrize("bodies", [("ground", "b"), ("b", "ground")])
@pytest.mark.parametrize(("kind", "driven"), [*UNDRIVEN, *DRIVEN])
def test_exudyns_reaction_causes_the_acceleration_of_the_body(kind, driven, bodies):
    """One body on one joint under gravity and a moment. ``balance`` is what Newton's and Euler's equations
    leave of reaction, loads and acceleration: at most ten times the measured 1.6e-10 of the largest force, or
    of the largest moment over the length."""
    parts = {
        "joint": (HOLONOMIC_JOINTS[kind].at("J", bodies, **PLACES),),
        "driver": (Driver(joint="J", polynomial=(0.0, 3.0)),) if driven else (),
        "load": (Moment(body="b", moment=(0.3, 0.5, -0.4)),),
    }
    scene = Scene(name="held", body=(BODY,), gravity=(1.0, -9.81, 2.0), **parts)
    trajectory = ENGINE.run(scene, np.linspace(0, 0.4, 5), Setting("tuned", {"step": 1e-3}))
    assert trajectory.outcome is Outcome.COMPLETED, trajectory.message
    assert balance(scene, trajectory, trajectory) < MARGIN * 1.6e-10


def test_exudyn_gives_no_accelerations_and_reactions_with_an_accelerating_driver():
    """Exudyn's initial multipliers lack the driver's acceleration. Its run with a driver by a sine has
    neither accelerations nor reactions; with a driver of constant rate it has both."""
    joint = Revolute.at("J", ("ground", "b"), **PLACES)
    shaken, turned = (
        ENGINE.run(
            Scene(name="driven", body=(BODY,), joint=(joint,), driver=(Driver(joint="J", **law),)),
            np.linspace(0, 0.1, 3),
            Setting("tuned", {"step": 1e-3}),
        )
        for law in ({"sine": Sine(amplitude=0.1, frequency=3.0)}, {"polynomial": (0.0, 3.0)})
    )
    assert shaken.reactions is None and shaken.acceleration is None
    assert turned.reactions is not None and turned.acceleration is not None
