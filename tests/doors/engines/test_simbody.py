"""Simbody's runs against truths, and drivers that OpenSim cannot prescribe."""

from importlib.util import find_spec

import numpy as np
import pytest

from crosscheck.engine import Owner, Setting, engine
from mbref.scene import Driver, Scene, Sine
from mbref.scenes import SCENES
from tests.helpers.measured import MARGIN, ROUNDING, completed_error
from tests.helpers.tree_scenes import BODIES, every_joint

if find_spec("opensim") is None:
    pytest.skip("the optional engine Simbody needs opensim", allow_module_level=True)

FAMILIES = ("merson", "feldberg", "cpodes")


def simulate(scene, duration, accuracy, family="merson", samples=6):
    setting = Setting(family, {"accuracy": accuracy})
    return engine("simbody").run(scene, np.linspace(0, duration, samples), setting)


@pytest.mark.parametrize(
    ("name", "duration", "measured"),  # s, error (m, rad)
    [
        ("spatial_slider_crank", 0.02, 1.1e-8),
        ("spatial_slider_crank_gravity", 0.5, 4.5e-8),
        ("four_bar", 0.012, ROUNDING),
        ("four_bar_gravity", 0.15, 9.2e-11),
        ("planar_slider_crank_equal", 0.06, 5.6e-10),  # singular at 0.0612 s
    ],
)
def test_simbody_stays_within_its_measured_error_of_the_truth(name, duration, measured) -> None:
    """The error from the judge's truth at an accuracy of 1e-9 is at most ten times the measured one."""
    scene = SCENES[name]()
    run = simulate(scene, duration, 1e-9)
    assert completed_error(run, scene) < MARGIN * measured


@pytest.mark.parametrize("family", FAMILIES)
def test_accuracy_of_a_hundredth_reduces_simbody_s_error_fivefold(family: str) -> None:
    """Errors from the judge's truth at accuracies of 1e-4, 1e-6 and 1e-8. An accuracy without effect would
    leave the error, one to which it is proportional would reduce it a hundredfold; five is between."""
    scene = SCENES["spatial_slider_crank"]()
    runs = (simulate(scene, 0.02, accuracy, family) for accuracy in (1e-4, 1e-6, 1e-8))
    errors = [completed_error(run, scene) for run in runs]
    assert errors[1] < errors[0] / 5 and errors[2] < errors[1] / 5, f"{family}: errors {errors}"


def prescribed(*drivers: Driver) -> Scene:
    still = tuple(b.model_copy(update={"angular_velocity": None}) for b in BODIES)
    return every_joint(name="prescribed", body=still, driver=drivers)


def test_simbody_refuses_a_driver_by_polynomial_and_sine_at_once() -> None:
    """OpenSim's functions are one or the other; the refusal names the joint and the engine as the owner."""
    sine = Sine(amplitude=0.1, frequency=3.0)
    scene = prescribed(Driver(joint="cyl", polynomial=(0.0, 1.0), sine=sine))
    refusal = engine("simbody").cannot(scene)
    assert refusal is not None and refusal.owner is Owner.ENGINE and "cyl" in refusal.reason, refusal
