"""Energies and works of one body in given states, against the numbers of their formulas (J)."""

import math
from typing import Any

import numpy as np
import pytest

from crosscheck.judge.energy import energy_drift, energy_series
from mbref.motions.trajectory import Trajectory
from mbref.scene import Body, Force, Moment, Revolute, Scene

HINGE = Revolute(name="A", bodies=("ground", "b"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
START = (2.0, 0.0, 0.0)  # m, of the centre of mass


def scene(*loads: Any, hinge: bool = True, **parts: Any) -> Scene:
    body = Body(name="b", mass=3.0, inertia=(0.2, 0.4, 0.6), position=START)
    given = {"gravity": (0.0, 0.0, 0.0), "joint": (HINGE,) if hinge else (), **parts}
    return Scene(name="s", body=(body,), load=loads, duration=1.0, **given)


def still(*places: tuple[float, float, float], angles: tuple[float, ...] = (), **rates: Any) -> Trajectory:
    """A run at rest at places, turned by angles (rad) about z, at times 0, 0.5, 1, … s."""
    k = len(places)
    turned = np.array([[math.cos(a / 2), 0.0, 0.0, math.sin(a / 2)] for a in angles or (0.0,) * k])
    rest = np.zeros((k, 1, 3))
    arrays = {"velocity": rest, "angular_velocity": rest, **rates}
    poses = np.array(places)[:, None], turned[:, None]
    return Trajectory("s", "e", "1", "m", {}, 0.5 * np.arange(k), ("b",), *poses, **arrays)


def drift(of: Scene, run: Trajectory) -> list[float]:
    found = energy_drift(of, run)
    assert found is not None
    return [float(value) for value in found]


def test_a_force_works_along_the_path_of_its_point():
    """A force of 5 N along y at 1 m beside the centre, which rises by 0.2 m and turns by a quarter."""
    force = Force(body="b", point=(3.0, 0.0, 0.0), force=(0.0, 5.0, 0.0))
    run = still(START, (2.0, 0.2, 0.0), angles=(0.0, math.pi / 2))
    assert drift(scene(force, hinge=False), run) == pytest.approx([0.0, 5.0 * (0.2 + 1.0)])


@pytest.mark.parametrize("hinge", [True, False])
def test_a_moment_works_along_the_angle_of_a_hinge_or_of_a_free_body(hinge):
    """2 N m over angles of 0.25 and 0.5 rad are 0.5 and 1 J, which a body with constant energy lacks: by the
    hinge's angle, or on a free body by the power 2 N m · 0.5 rad/s at samples 0.5 s apart."""
    spin = np.full((3, 1, 3), (0.0, 0.0, 0.5))
    body = scene().body[0].model_copy(update={"angular_velocity": (0.0, 0.0, 0.5)})
    of = scene(Moment(body="b", moment=(0.0, 0.0, 2.0)), hinge=hinge).with_(body=(body,))
    places = [(2.0 * math.cos(a), 2.0 * math.sin(a), 0.0) if hinge else START for a in (0.0, 0.25, 0.5)]
    velocity = np.zeros((3, 1, 3))
    if hinge:
        velocity[:, 0] = [(-p[1] * 0.5, p[0] * 0.5, 0.0) for p in places]
    run = still(*places, angles=(0.0, 0.25, 0.5), angular_velocity=spin, velocity=velocity)
    assert drift(of, run) == pytest.approx([0.0, 0.5, 1.0], abs=1e-12)  # J, rounding


def test_energy_error_is_the_drift_relative_to_the_largest_energy():
    """A body at rest that rises by 2 m against 10 m/s² drifts by 60 J, the largest energy of the run."""
    of = scene(gravity=(0.0, -10.0, 0.0), hinge=False)
    run = still(START, (2.0, 2.0, 0.0), (2.0, -1.0, 0.0))
    assert drift(of, run) == pytest.approx([0.0, 60.0, 30.0])
    assert energy_series(of, run) == pytest.approx([0.0, 1.0, 0.5])


def test_an_energy_below_rounding_has_no_error():
    """Relative to what weight and motion can cause, 2e-12 is an energy, and 0.5e-12 is rounding."""
    of = scene(gravity=(0.0, -10.0, 0.0))
    possible = (
        2.0 * 30.0 + 3.0 * (2.0 / 0.5) ** 2 / 2
    )  # J: 30 N over the scene's length 2 m, 3 kg at 2 m / 0.5 s
    for part, is_known in ((2e-12, True), (0.5e-12, False)):
        run = still(START, (2.0, part * possible / 30.0, 0.0))
        assert (energy_series(of, run) is not None) is is_known, part
