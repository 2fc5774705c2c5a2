"""A failed run names a method or option that copes with the cause."""

import re

import numpy as np
import pytest

from crosscheck.conformance.mechanisms.parts import linkage
from mbref.scene import Driver
from mbref.scenes import SCENES
from mbref.scenes.four_bar import four_bar_gravity
from mbref.simulation.simulate import Limits, simulate
from tests.helpers.statics import pendulum, rod

ROD = {**rod("rod", (0.5, 0.0, 0.0), mass=1.0), "inertia": (0.0, 0.1, 0.1)}
SLENDER = pendulum(body=[ROD])


@pytest.mark.parametrize(
    ("scene", "method", "words"),
    [
        (SCENES["bricard"](), "lm1+none", r"rows are redundant \(1 of 30\); taylor completes this motion"),
        (SLENDER, "lm2+none", "body 'rod' lacks mass or a moment of inertia; taylor completes this motion"),
        (four_bar_gravity(0.3), "mpi-gs+none", "taylor completes this motion"),
        (SCENES["planar_slider_crank"](), "mpi-qr+none/rk4[step=1e-2]", r"\+projection corrects violations"),
    ],
)
def test_message_of_a_failed_run_names_its_cause_and_a_remedy(scene, method, words):
    """Causes are redundant rows, a rod without thickness (SLENDER), a flat position, growing violations."""
    run = simulate(scene, method, np.linspace(0.0, 1.5, 7), Limits(rtol=1e-6, most_steps=5_000))
    assert run.outcome.label != "COMPLETED"
    assert re.search("; .*" + words, run.message), run.message


@pytest.mark.parametrize("failing", ["lm2+none", "mpi-svd+none"])
def test_method_advised_for_a_rod_without_thickness_follows_the_pendulum(failing):
    """The rod has no moment of inertia about its axis: J θ'' = -m g l cos θ with J = 0.1 + 0.5² kg m²; after
    a short time t, θ = -m g l t² / 2 J = -7e-6 rad."""
    message = simulate(SLENDER, failing, [1e-3]).message
    [advised] = re.findall(r"; (\S+) completes this motion", message)
    run = simulate(SLENDER, advised, [1e-3])
    assert run.outcome.label == "COMPLETED", run.message
    fall = -9.81 * 0.5 / (0.1 + 0.5**2) * 1e-3**2 / 2
    assert run.position[0, 0, 1] == pytest.approx(0.5 * fall, rel=1e-9)  # θ² / 2, left out, is 2.5e-11


def test_singular_position_that_taylor_passes_is_not_called_a_dead_position():
    """The rhombus is flat at θ = -π, t = 3/2 π / (124.8 rad/s) = 37.76 ms, where branches meet and drift
    makes rates large. Without projection the run ends there, within 0.1 rad of the crank."""
    run = simulate("four_bar", "mpi-svd+none/dop853", np.linspace(0.0, 0.05, 11), Limits(rtol=1e-6))
    assert run.outcome.label != "COMPLETED"
    assert run.t_end == pytest.approx(1.5 * np.pi / 124.8, abs=0.1 / 124.8)
    assert "dead position" not in run.message and "taylor" in run.message, run.message


def test_method_that_fails_at_a_dead_position_as_well_is_not_advised():
    """A crank of a = 0.5 m is driven at 2 rad/s until the other bars, c = 0.5 m + 0.4 √2 m, are a straight
    line: its angle is acos((a² + b² - c²) / 2 a b) with the frame of b = 1.2 m, reached to 2e-5 rad."""
    bars = linkage("dead", ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.8, 0.4, 0.0), (1.2, 0.0, 0.0)))
    scene = bars.with_(driver=(Driver(joint="P0", polynomial=(0.0, 2.0)),))
    run = simulate(scene, "mpi-svd+projection", [0.7], Limits(rtol=1e-5))
    line = 0.5 + 0.4 * np.sqrt(2)
    angle = np.arccos((0.5**2 + 1.2**2 - line**2) / (2 * 0.5 * 1.2))
    assert run.t_end == pytest.approx(angle / 2.0, abs=2e-5 / 2.0)  # s
    assert "dead position" in run.message and "taylor" not in run.message, run.message
