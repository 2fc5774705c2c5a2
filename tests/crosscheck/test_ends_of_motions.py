"""End of a motion that a command line requests: the last time, or the option of the duration."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.cli import request
from crosscheck.cli.request import RequestError
from mbref.scene import Body, Scene

BLOCK = Body(name="b", mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.0, 0.0, 0.0))
SCENE = Scene(name="s", duration=2.0, body=(BLOCK,))


@pytest.mark.parametrize(
    ("times", "duration", "end"),
    [(None, None, 2.0), (None, 2.0, 2.0), (None, 3.0, 3.0), ([0.5, 1.5], None, 1.5), ([0.5], 0.5, 0.5)],
)
def test_motion_ends_at_the_last_time_or_at_the_duration_option(times, duration, end):
    """Without both options the scene's own duration of 2 s stays."""
    assert request.lasting(SCENE, times, duration).duration == end


def test_duration_before_the_last_time_or_not_positive_is_refused():
    with pytest.raises(RequestError, match=r"--times: must end by --duration 0\.5, got 0\.6"):
        request.lasting(SCENE, [0.6], 0.5)
    for end in (0.0, np.inf, np.nan):
        with pytest.raises(RequestError, match="--duration: must be positive"):
            request.lasting(SCENE, None, end)
