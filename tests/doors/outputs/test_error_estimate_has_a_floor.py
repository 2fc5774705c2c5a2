"""The true error is at most ten error estimates: an estimate is at least the error by rounding."""

import math
from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

import mbref
from mbref import rotations
from mbref.scene import Scene

ORIGIN, Z = [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]
TIMES = np.linspace(0.0, 5.0, 6)
Truth = tuple[np.ndarray, np.ndarray]  # position along x (k,), angle about z (k,)


def wheel(**parts) -> dict:
    """Return the fields of a scene of one wheel about z."""
    body = {"name": "b", "mass": 1.5, "inertia": [1.5, 1.5, 2.0], "position": ORIGIN, **parts.pop("body", {})}
    joint = {"name": "J", "type": "revolute", "bodies": ["ground", "b"], "anchor": ORIGIN, "axis": Z}
    return {"name": "floor", "duration": 5.0, "gravity": ORIGIN, "body": [body], "joint": [joint], **parts}


def turning(rate: float, **parts) -> Scene:
    """Return a wheel with an angular velocity (rad/s) at the start."""
    return Scene(**wheel(body={"angular_velocity": [0.0, 0.0, rate]}, **parts))


def moving(rate: float, **parts) -> Scene:
    """Return a body with a velocity (m/s) along x, on a slide along x or free."""
    fields = wheel(body={"velocity": [rate, 0.0, 0.0]}, **parts)
    slide = {**fields["joint"][0], "type": "translational", "axis": [1.0, 0.0, 0.0]}
    return Scene(**{**fields, "joint": [slide] if "load" in parts else []})


TWIST = {"type": "torsion_spring", "joint": "J", "stiffness": 2.0}  # frequency 1 rad/s with 2 kg m²
PULL_FREQUENCY = 1.2  # rad/s, of 1.5 kg
PULL = {"type": "slide_spring", "joint": "J", "stiffness": 1.5 * PULL_FREQUENCY**2}
STILL = 0.0 * TIMES
# maker of a scene from a speed or distance w, and the closed form of its position and angle
MAKERS: dict[str, tuple[Callable[[float], Scene], Callable[[float], Truth]]] = {
    "spinning": (turning, lambda w: (STILL, w * TIMES)),
    "driven": (
        lambda w: Scene(**wheel(driver=[{"joint": "J", "polynomial": [0.0, w]}])),
        lambda w: (STILL, w * TIMES),
    ),
    "twisted": (lambda w: turning(w, load=[TWIST]), lambda w: (STILL, w * np.sin(TIMES))),
    "resting": (lambda w: Scene(**wheel(body={"position": [w, 0.0, 0.0]})), lambda w: (w + STILL, STILL)),
    "flying": (
        lambda w: moving(w, gravity=[-1.7, 0.0, 0.0]),
        lambda w: (w * TIMES - 1.7 / 2 * TIMES**2, STILL),
    ),
    "sliding": (
        lambda w: moving(w, load=[PULL]),
        lambda w: (w / PULL_FREQUENCY * np.sin(PULL_FREQUENCY * TIMES), STILL),
    ),
}
RATES, RTOLS = (0.07, 1.0, 19.0, 410.0), (1e-6, 1e-9, 1e-13)


def true_error(scene: Scene, motion: mbref.Motion, truth: Truth) -> np.ndarray:
    """Return the larger of distance over length and angle (k,), rad, from the closed form."""
    place = np.stack([truth[0], 0.0 * TIMES, 0.0 * TIMES], axis=1)
    half = truth[1] / 2
    turned = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=1)
    points = [[0.0, 0.0, 0.0], *(body.position for body in scene.body)] if scene.joint else [ORIGIN]
    length = max(math.dist(p, q) for p in points for q in points) or 1.0
    apart = np.linalg.norm(motion.position[:, 0] - place, axis=1) / length
    return np.maximum(apart, rotations.angle_between(motion.orientation[:, 0], turned))


def errors_over_estimates(name: str, rate: float, method: str | None, rtol: float) -> np.ndarray:
    """Return the ratios at TIMES of a motion; ``rate`` is a speed (rad/s, m/s) or distance (m)."""
    make, truth = MAKERS[name]
    scene = make(rate)
    motion = mbref.simulate(scene, method, TIMES, rtol=rtol)
    assert motion.outcome.name == "COMPLETED", motion.message
    estimate = mbref.with_error_estimate(motion).error_estimate.error
    with np.errstate(divide="raise", invalid="raise"):  # an estimate is never zero
        return true_error(scene, motion, truth(rate)) / estimate


@pytest.mark.parametrize(
    ("rate", "method", "rtol"),
    [
        (3.3, None, 1e-12),
        *(pytest.param(*each, marks=pytest.mark.slow) for each in product(RATES, ["taylor"], RTOLS)),
    ],
)
@pytest.mark.parametrize("name", MAKERS)
def test_true_error_is_at_most_ten_estimates(name, rate, method, rtol):
    """The error is the difference from the closed form of each maker. An estimate gives the order of size:
    ten estimates are also the limit of the counts in docs/error-estimate.md."""
    assert errors_over_estimates(name, rate, method, rtol).max() <= 10


@pytest.mark.parametrize("name", ["resting", "spinning"])
def test_estimate_of_a_motion_without_error_is_its_rounding_and_not_zero(name):
    """A body at rest, or one that spins steadily: the two runs that the estimate compares are equal. The
    estimate is at least the rounding of one number, 2⁻⁵³, and at most some hundred roundings, 1e-13."""
    scene = MAKERS[name][0](1.0)
    largest = mbref.with_error_estimate(mbref.simulate(scene, times=TIMES)).error_estimate.largest
    assert 2.0**-53 < largest < 1e-13
