"""Every family of each adapter follows two drivers with phases, whose motion is known in closed form."""

import numpy as np
import pytest

from crosscheck.engine import engine
from mbref.motions.trajectory import Outcome
from tests.crosscheck.driven_arm import END, ENGINES, SLIDE, TURN, able, driven_arm, middle

TIMES = np.array([0.0, 0.4 * END, END])
WITHIN = 2e-3  # rad and m; exchanged phases, frequencies or drivers move the bodies by more than 8e-3
RATES = 10 * WITHIN  # rad/s and m/s; drivers of 5 and 9 rad/s magnify errors of the coordinate by as much
ROUGH = ("cpodes",)  # off by more than 8e-3 on a prescribed motion; it runs the model of the other families


@pytest.mark.parametrize(("name", "part"), ENGINES)
def test_an_engine_follows_drivers_that_turn_an_arm_and_slide_a_block_along_it(name, part):
    """Arm at 0.5 m · e(φ), block at (1 m + s) · e(φ), with the drivers' φ(t) and s(t). Poses are allowed 2e-3
    m or rad and rates ten times this; exchanged drivers, frequencies or phases give over 8e-3."""
    scene = able(name, driven_arm())
    angle, rate = TURN.value(TIMES), TURN.rate(TIMES)
    along, speed = 1.0 + SLIDE.value(TIMES), SLIDE.rate(TIMES)
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    across = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)
    position = np.stack([0.5 * out, along[:, None] * out], axis=1)
    slid = speed[:, None] * out + (along * rate)[:, None] * across
    velocity = np.stack([0.5 * rate[:, None] * across, slid], axis=1)
    spin = np.stack([0 * rate, 0 * rate, rate], axis=-1)[:, None].repeat(2, axis=1)
    settings = [s for s in middle(name, scene, part) if s.family not in ROUGH]
    assert settings, "every family is in ROUGH"
    for setting in settings:
        run = engine(name).run(scene, TIMES, setting)
        assert run.outcome is Outcome.COMPLETED, (setting, run.message)
        assert abs(run.position - position).max() < WITHIN, setting
        assert abs(run.velocity - velocity).max() < RATES, setting
        assert abs(run.angular_velocity - spin).max() < RATES, setting
