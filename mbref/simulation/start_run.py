"""Starts of runs: a scene by a method, with the stepper that the method needs."""

from __future__ import annotations

import time

import numpy as np

from mbref.method import Method
from mbref.scene import Scene
from mbref.stepping.explicit import ExplicitStepper
from mbref.stepping.limits import Limits
from mbref.stepping.run import Run
from mbref.taylor.preparation import prepare_series
from mbref.taylor.stepper import SeriesStepper


def start_run(scene: Scene, method: Method, times: np.ndarray, limits: Limits) -> Run:
    """Return the run of a scene, ready to be advanced; its stepper may raise NoGeneratedCode."""
    began = time.process_time()
    if method.is_series:
        prepare_series()
    stepper = SeriesStepper if method.is_series else ExplicitStepper
    run = Run(scene, method, times, limits, stepper)
    run.built = time.process_time() - began - run.making
    return run
