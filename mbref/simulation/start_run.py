"""Starts of runs: a scene by a method, with the stepper that the method needs."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from mbref.method import Method
from mbref.scene import Scene
from mbref.stepping.explicit import ExplicitStepper
from mbref.stepping.limits import Limits
from mbref.stepping.run import Run, Stepper


def start_run(scene: Scene, method: Method, times: np.ndarray, limits: Limits) -> Run:
    """Return the run of a scene, ready to be advanced; its stepper may raise NoGeneratedCode."""
    began = time.process_time()
    run = Run(scene, method, times, limits, _series_stepper() if method.is_series else ExplicitStepper)
    run.built = time.process_time() - began - run.making
    return run


def _series_stepper() -> Callable[[Run], Stepper]:
    """Return the stepper of Taylor series, with its kernels loaded; other methods do not import it."""
    from mbref.taylor.preparation import prepare_series
    from mbref.taylor.stepper import SeriesStepper

    prepare_series()
    return SeriesStepper
