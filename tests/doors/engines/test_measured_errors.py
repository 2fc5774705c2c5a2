"""Engines at fine settings move built-in scenes as the judge's truth, to ten times the measured errors."""

from collections.abc import Callable

import numpy as np
import pytest

from crosscheck.engine import Setting, engine, installed
from crosscheck.engines.mujoco.families import ADAPTIVE, HARD
from crosscheck.judge.metrics import violation_series
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, completed_error, relative_error


def stepping(step: float, beta: float) -> dict[str, float]:
    """Return the options of MuJoCo's own steps (s) with a feedback gain (1/s)."""
    return {"step": step, "beta": beta, "hard": HARD}


def adaptive(hard: float) -> Callable[[float, float, float], dict[str, float]]:
    """Return the maker of options of MuJoCo's accelerations, integrated by crosscheck."""
    return lambda rtol, shortest, beta: {"rtol": rtol, "min_step": shortest, "beta": beta, "hard": hard}


def adapted(rtol: float, shortest: float) -> dict[str, float]:
    """Return the options of Pinocchio's accelerations with a tolerance and a shortest step (s)."""
    return {"rtol": rtol, "min_step": shortest}


WAYS = {  # engine, family, number of samples, and options by the numbers of a case
    "mujoco-tuned": ("mujoco", "tuned", 11, stepping),
    "mujoco-stiff": ("mujoco", "stiff", 11, stepping),
    "mujoco-projected": ("mujoco", "projected", 11, adaptive(ADAPTIVE["projected"])),
    "mujoco-forward": ("mujoco", "forward", 7, adaptive(1e-7)),
    "mujoco-forward-compiled": ("mujoco", "forward, compiled", 6, adaptive(1e-9)),
    "mujoco-projected-compiled": ("mujoco", "projected, compiled", 11, adaptive(1e-9)),
    "pinocchio-finest": ("pinocchio", "tuned", 11, lambda: {}),
    "pinocchio-tuned": ("pinocchio", "tuned", 7, adapted),
    "pinocchio-proximal": ("pinocchio", "proximal", 7, lambda step: {"step": step}),
    "pinocchio-tuned-compiled": ("pinocchio", "tuned, compiled", 11, adapted),
    "exudyn-alpha": ("exudyn", "alpha", 7, lambda step: {"step": step}),
    "simbody-merson": ("simbody", "merson", 6, lambda: {"accuracy": 1e-9}),
    "sundials-ggl": ("sundials", "ggl", 6, lambda: {"rtol": 1e-8}),
    "sundials-ggl-rough": ("sundials", "ggl", 26, lambda: {"rtol": 1e-6}),
}
IN_SI = [  # way, scene, duration (s), numbers of the options, measured error (m, rad)
    ("mujoco-tuned", "planar_slider_crank", 0.2, (1.2e-5, 2000.0), 3.7e-9),
    ("mujoco-tuned", "spatial_slider_crank_driven", 0.2, (2e-5, 1200.0), 1.8e-10),
    ("mujoco-tuned", "four_bar_gravity", 0.5, (2e-3, 40.0), 1.5e-10),
    ("mujoco-stiff", "four_bar_gravity", 1.0, (2e-4, 1000.0), 4.5e-14),  # flat at 0.162, 0.664 and 0.989 s
    ("mujoco-projected", "four_bar_gravity", 1.0, (1e-8, 4e-3, 40.0), 3.3e-9),
    ("pinocchio-finest", "planar_slider_crank", 0.08, (), 9e-13),
    ("pinocchio-finest", "planar_slider_crank_equal", 0.1, (), 2.8e-10),  # singular: rounding is magnified
    ("pinocchio-finest", "four_bar", 0.1, (), 6.5e-13),
    ("pinocchio-finest", "four_bar_gravity", 0.5, (), 5.1e-12),
    ("simbody-merson", "spatial_slider_crank", 0.02, (), 1.1e-8),
    ("simbody-merson", "spatial_slider_crank_gravity", 0.5, (), 4.5e-8),
    ("simbody-merson", "four_bar_gravity", 0.15, (), 9.2e-11),
    ("simbody-merson", "planar_slider_crank_equal", 0.06, (), 5.6e-10),  # singular at 0.0612 s
    ("sundials-ggl", "planar_slider_crank_gravity", 0.15, (), 1.5e-6),  # no singular position
    ("sundials-ggl", "spatial_slider_crank", 0.01, (), 1.2e-7),
    ("sundials-ggl", "four_bar_gravity", 0.15, (), 7.9e-8),
    ("sundials-ggl-rough", "planar_slider_crank", 0.25, (), 1.5e-3),  # more than a turn: rows are replaced
]
OF_LENGTH = [  # the same, with the error relative to the scene's length, or in rad
    ("mujoco-forward", "bricard", 0.6, (1e-10, 0.01, 10.0), 5.4e-10),
    ("pinocchio-proximal", "bricard", 0.6, (1e-3,), 2.7e-13),
    ("pinocchio-tuned", "bricard", 0.6, (1e-10, 0.01), 4.8e-11),
    ("exudyn-alpha", "bricard", 0.6, (1e-4,), 3e-9),
    ("mujoco-forward-compiled", "spatial_slider_crank_driven", None, (1e-10, 1e-12, 50.0), 7.5e-12),
    ("mujoco-forward-compiled", "bennett", None, (1e-10, 1e-12, 30.0), 1.3e-9),
    ("mujoco-forward-compiled", "heavy_top", None, (1e-10, 1e-12, 15.0), 8.2e-10),
    ("mujoco-forward-compiled", "andrews_squeezer", None, (1e-10, 1e-12, 330.0), 8.4e-10),
    ("mujoco-projected-compiled", "planar_slider_crank_equal", None, (1e-7, 1.7e-4, 0.0), 2.7e-7),
    ("mujoco-projected-compiled", "four_bar_gravity", None, (1e-9, 3.8e-3, 0.0), 4.3e-9),
    ("mujoco-projected-compiled", "four_bar", None, (1e-9, 2.4e-4, 0.0), 3.9e-13),
    ("mujoco-projected-compiled", "h_frame", None, (1e-10, 1e-9, 0.0), 1.3e-11),
    ("pinocchio-tuned-compiled", "spatial_slider_crank_driven", None, (1e-10, 1e-12), 1.2e-12),
    ("pinocchio-tuned-compiled", "heavy_top", None, (1e-10, 1e-12), 8.2e-10),
    ("pinocchio-tuned-compiled", "bennett", None, (1e-10, 5.5e-3), 1.1e-9),
    ("pinocchio-tuned-compiled", "planar_slider_crank_equal", None, (1e-9, 1.7e-4), 1.2e-9),
]
CASES = [*IN_SI, *OF_LENGTH]
CLOSED = {  # allowed violation of joints after a projection, of the length: ten times the measured one
    "mujoco-projected": MARGIN * 4.4e-14,
    **dict.fromkeys(("mujoco-projected-compiled", "pinocchio-tuned-compiled"), MARGIN * 1e-13),
}


@pytest.mark.parametrize("case", CASES, ids=[f"{way}-{scene}" for way, scene, *_ in CASES])
def test_engine_stays_within_its_measured_error_of_the_truth(case):
    """Poses differ from the judge's truth by at most ten times the measured errors, the largest with the
    settings of tests/machines.py. Integrated accelerations need feedback (beta, 1/s) or a projection."""
    way, scene_name, duration, numbers, measured = case
    name, family, samples, options = WAYS[way]
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    if way == "pinocchio-tuned-compiled":
        from crosscheck.engines.pinocchio.library import why_not

        if reason := why_not():
            pytest.skip(reason)
    scene = SCENES[scene_name]().with_(**{"duration": duration} if duration else {})
    given = Setting(family, options(*numbers))
    setting = engine(name).settings_of(scene, family)[-1] if way == "pinocchio-finest" else given
    run = engine(name).run(scene, np.linspace(0.0, scene.duration, samples), setting)
    error = completed_error(run, scene) if case in IN_SI else relative_error(run, scene)
    assert error < MARGIN * measured
    assert way not in CLOSED or violation_series(scene, run).max() < CLOSED[way]


@pytest.mark.parametrize(
    ("name", "family", "option", "duration"),
    [
        *(("simbody", family, "accuracy", 0.02) for family in ("merson", "feldberg", "cpodes")),
        ("sundials", "ggl", "rtol", 0.01),
    ],
)
def test_tolerance_of_a_hundredth_reduces_the_error_fivefold(name, family, option, duration):
    """Errors from the judge's truth at 1e-4, 1e-6 and 1e-8. A tolerance without effect would leave the error,
    one to which it is proportional would reduce it a hundredfold; five is between."""
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    scene, times = SCENES["spatial_slider_crank"](), np.linspace(0.0, duration, 6)
    runs = (engine(name).run(scene, times, Setting(family, {option: x})) for x in (1e-4, 1e-6, 1e-8))
    errors = [completed_error(run, scene) for run in runs]
    assert errors[1] < errors[0] / 5 and errors[2] < errors[1] / 5, errors
