"""Singular positions: how many runs of a sweep end right, honestly failed, or falsely completed.

    python benchmarks/singular_positions.py [SWEEP …] [--count N] [--method NAME] [--code KIND] [--rtol X]

Sweeps: light and cart_poles (inertias of 1e-11 … 1e-4 kg m²), turning (parallelograms that turn back before
the flat position), gaps (slider-cranks whose rod is longer than the crank by 1e-1 … 1e-12 m), driven (rhombi
and five-bars from random angles), starts (the same just before the flat position), heavy (the equal
slider-crank with a flywheel).  Turning points that rounding of the joints' positions may hide behind a gap
are counted separately if their runs do not complete.  A false success is COMPLETED with an error against the
scene's truth, which shares no code with mbref, above max(1e3 rtol, 1e-6); cart-poles are judged by their
energy.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref import Limits, simulate
from mbref.scene import Body, Revolute, Scene, Translational
from mbref.scenes.five_bar import five_bar, five_bar_gravity
from mbref.scenes.four_bar import four_bar, four_bar_gravity
from mbref.scenes.planar_slider_crank import planar_slider_crank_heavy, slider_crank

GRAVITY = (0.0, 0.0, -9.81)


def pendulum(inertia: float, mass: float, arm: float) -> Scene:
    """A bead on a massless arm, let go level."""
    body = Body(name="bead", mass=mass, inertia=(inertia,) * 3, position=(arm, 0.0, 0.0))
    joint = Revolute(name="J", bodies=("ground", "bead"), anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    return Scene(name="pendulum", gravity=GRAVITY, duration=1.0, body=(body,), joint=(joint,))


def light(count: int) -> Iterator[tuple[Scene, float]]:
    """Pendulums of random inertia, mass and arm."""
    rng = np.random.default_rng(1)
    for _ in range(count):
        yield pendulum(10 ** rng.uniform(-11, -4), 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-1, 0.5)), 1.0


def cart_poles(count: int) -> Iterator[tuple[Scene, float]]:
    """A bead on a cart that slides along x: no truth, judged by energy alone in ``outcome_of``."""
    rng = np.random.default_rng(2)
    for _ in range(count):
        moment = 10 ** rng.uniform(-11, -4)
        cart = Body(name="cart", mass=1.0, inertia=(1e-2,) * 3, position=(0.0, 0.0, 0.0))
        bead = Body(name="bead", mass=1.0, inertia=(moment,) * 3, position=(1.0, 0.0, 0.0))
        origin = (0.0, 0.0, 0.0)
        joints = (
            Translational(name="T", bodies=("ground", "cart"), anchor=origin, axis=(1.0, 0.0, 0.0)),
            Revolute(name="J", bodies=("cart", "bead"), anchor=origin, axis=(0.0, 1.0, 0.0)),
        )
        yield Scene(name="cart_pole", gravity=GRAVITY, duration=1.0, body=(cart, bead), joint=joints), 1.0


def turning(count: int) -> Iterator[tuple[Scene, float]]:
    """Return parallelograms released at a given distance below the flat position, which they reach again
    after half a swing."""
    for k, distance in enumerate(np.geomspace(1e-1, 1e-8, max(2, count // 2))):
        for make in (four_bar_gravity, five_bar_gravity):
            yield make(-distance, f"turning{k}"), 1.5


def turning_is_determined(scene: Scene) -> bool:
    """Return whether rounding of the joints' positions cannot hide the turning point of a parallelogram.

    Links of length l whose sides differ by Δ = AB + AD - BC - CD come no nearer to the flat position than √(4
    Δ / l) rad before they change to another branch; they turn back at the distance at which they began.
    """
    a, b, c, d = (np.array(next(j.anchor for j in scene.joint if j.name == name)) for name in "ABCD")
    unit = lambda one, other: (one - other) / np.linalg.norm(one - other)  # noqa: E731
    slopes = (
        unit(a, b) + unit(a, d),
        unit(b, a) - unit(b, c),
        -unit(c, b) - unit(c, d),
        unit(d, a) - unit(d, c),
    )
    rounding = sum(
        float(np.abs(slope) @ np.spacing(np.abs(at))) / 2
        for slope, at in zip(slopes, (a, b, c, d), strict=True)
    )
    length = float(np.linalg.norm(b - a))
    return bool(math.asin(abs(b[1]) / length) > math.sqrt(4.0 * rounding / length))


def gaps(count: int) -> Iterator[tuple[Scene, float]]:
    """Slider-cranks that miss the singular position by a gap."""
    for gap in np.geomspace(1e-1, 1e-12, count):
        yield slider_crank(0.308, 0.308 + gap, 0.3, "gap", rate=30.0), 0.5


def driven(count: int) -> Iterator[tuple[Scene, float]]:
    """Driven rhombi and five-bars from random angles."""
    rng = np.random.default_rng(3)
    for k in range(count):
        yield (four_bar, five_bar)[k % 2](rng.uniform(-math.pi, math.pi)), 20.0


def starts(count: int) -> Iterator[tuple[Scene, float]]:
    """The same from just before the flat positions."""
    for k, distance in enumerate(np.geomspace(3e-2, 1e-6, count)):
        yield (four_bar, five_bar)[k % 2](distance + math.pi * (k // 2 % 2)), 0.2


def heavy(count: int) -> Iterator[tuple[Scene, float]]:
    """The equal crank with a flywheel."""
    yield planar_slider_crank_heavy(), 20.0


SWEEPS = {
    "light": (light, 922),
    "cart_poles": (cart_poles, 100),
    "turning": (turning, 48),
    "gaps": (gaps, 24),
    "driven": (driven, 200),
    "starts": (starts, 72),
    "heavy": (heavy, 1),
}


def outcome_of(scene: Scene, end: float, method: str, limits: Limits) -> tuple[str, float]:
    """The outcome, and the error of the samples reached: of poses where a truth is known, else of energy."""
    trajectory = simulate(scene, method, np.linspace(0.0, end, 21), limits)
    truth = truth_for(scene)
    found = measure(scene, trajectory, truth)
    error = found["error"] if truth else found["energy_drift"]
    return trajectory.outcome.label, math.nan if error is None else float(error)


def report(name: str, runs: Iterator[tuple[Scene, float]], method: str, limits: Limits) -> None:
    """Print one row."""
    allowed, false, worst, failed, hidden = max(1e3 * limits.rtol, 1e-6), 0, 0.0, Counter(), 0
    total = 0
    for scene, end in runs:
        label, error = outcome_of(scene, end, method, limits)
        total += 1
        if label != "COMPLETED":
            is_hidden = name == "turning" and not turning_is_determined(scene)
            hidden += is_hidden
            failed[label] += not is_hidden
            continue
        false += not error <= allowed
        worst = max(worst, error)
    count = sum(failed.values())
    print(
        f"{name:12} {total:5} runs {false:4} false {count:4} failed {hidden:4} hidden by rounding "
        f"{worst:9.1e} worst {dict(+failed)}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sweep", nargs="*", metavar="SWEEP", default=list(SWEEPS))
    parser.add_argument("--count", type=int)
    parser.add_argument("--method", default="taylor")
    parser.add_argument("--code", default="auto", help="generic, generated or auto, the default")
    parser.add_argument("--rtol", type=float, default=1e-9)
    given = parser.parse_args()
    limits = Limits(rtol=given.rtol, most_steps=100_000, code=given.code)
    for name in given.sweep:
        make, count = SWEEPS[name]
        report(name, make(given.count or count), given.method, limits)


if __name__ == "__main__":
    main()
