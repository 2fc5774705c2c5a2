"""Thresholds at singular positions: which runs of a small sweep change when one of them is moved.

python benchmarks/thresholds.py [NAME …] [--factor 10]

Each threshold of ``mbref.taylor.crossing.thresholds`` is divided and multiplied by the factor (a logarithm
by 3), and the sweep is run again, interpreted, in one process.  Printed are the runs that change their
outcome, become wrong against the closed form of the scene, or need half as many steps again.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterator

os.environ["NUMBA_DISABLE_JIT"] = "1"

import numpy as np

from crosscheck.judge.metrics import measure
from crosscheck.judge.truth import truth_for
from mbref import Limits, simulate
from mbref.scene import Body, Revolute, Scene
from mbref.scenes.five_bar import five_bar, five_bar_gravity
from mbref.scenes.four_bar import four_bar, four_bar_gravity, two_rhombi
from mbref.scenes.planar_slider_crank import planar_slider_crank_heavy, slider_crank
from mbref.taylor.crossing import thresholds

MORE_STEPS = 1.5  # times the steps of the usual thresholds: the step rule suffers
WRONG = 1e-6  # error (lengths or rad) of a run that is no longer right
LOGARITHM = 3.0  # factor of a logarithm
END = 0.8  # s, longest motion of the sweep


def with_pendulum(scene: Scene) -> Scene:
    """A scene and a pendulum that nothing connects with it: two degrees of freedom."""
    bob = Body(name="bob", mass=1.0, inertia=(1e-2,) * 3, position=(2.0, -0.5, 0.0))
    joint = Revolute(name="P", bodies=("ground", "bob"), anchor=(2.1, 0.0, 0.0), axis=(0.0, 0.0, 1.0))
    return scene.with_(body=(*scene.body, bob), joint=(*scene.joint, joint))


def sweep() -> Iterator[tuple[str, Scene, float]]:
    """Name, scene and end (s) of each run."""
    for distance in (1e-1, 1e-3, 1e-5, 1e-7, 1e-8):
        yield f"turn back at {distance:g} rad", four_bar_gravity(-distance), END
    for gap in (1e-3, 1e-6, 1e-9, 1e-12):
        yield f"gap of {gap:g} m", slider_crank(0.308, 0.308 + gap, 0.3, "gap", rate=30.0), 0.1
    for distance in (1e-2, 1e-4, 1e-6):
        yield f"driven from {distance:g} rad", four_bar(distance), 0.3
    yield "driven five-bar", five_bar(math.pi - 1e-3), 0.3
    for distance in (1e-4, 3e-6, 1e-6):
        yield f"at rest {distance:g} rad before", four_bar_gravity(distance), 0.2
    yield "falling rhombus", four_bar_gravity(), END
    yield "slow rhombus", four_bar_gravity(3e-3), END
    yield "falling five-bar", five_bar_gravity(), END
    yield "heavy slider-crank", planar_slider_crank_heavy(), 0.5
    yield "two freedoms", with_pendulum(four_bar_gravity()), END
    for apart in (2e-2, 3e-4):
        yield f"two loops {apart:g} rad apart", two_rhombi(apart), 0.6


def fingerprint(scene: Scene, end: float) -> tuple[str, int, int, float]:
    """Outcome, number of crossings, steps, and the error against the truth (0 without one)."""
    run = simulate(
        scene, "taylor", np.linspace(0.0, end, 5), Limits(rtol=1e-9, code="generic", most_steps=2000)
    )
    truth = truth_for(scene)
    error = measure(scene, run, truth)["error"] if truth else 0.0
    return (
        run.outcome.label,
        len(run.crossings or ()),
        run.cost.steps + run.cost.rejected,
        float(error or 0.0),
    )


def move(name: str, value: float) -> None:
    """Set a threshold in every module that uses it."""
    for module in [
        m for key, m in sys.modules.items() if key.startswith("mbref.taylor") and hasattr(m, name)
    ]:
        setattr(module, name, value)


def changes(before: dict[str, tuple]) -> list[str]:
    """Return the first run of the sweep that differs from before."""
    found = []
    for name, scene, end in sweep():
        usual = before[name]
        try:
            label, crossings, steps, error = fingerprint(scene, end)
        except (ArithmeticError, ValueError, RuntimeWarning) as fault:
            found.append(f"{name}: {type(fault).__name__}")
        else:
            if label != usual[0]:
                found.append(f"{name}: {label}")
            elif error > max(WRONG, 10.0 * usual[3]) and label == "COMPLETED":
                found.append(f"{name}: error {error:.0e}")
            elif crossings != usual[1]:
                found.append(f"{name}: {crossings} crossings")
            elif steps > MORE_STEPS * usual[2]:
                found.append(f"{name}: {steps} steps")
        if found:
            return found
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "name", nargs="*", metavar="NAME", default=[name for name in vars(thresholds) if name.isupper()]
    )
    parser.add_argument("--factor", type=float, default=10.0)
    given = parser.parse_args()
    before = {name: fingerprint(scene, end) for name, scene, end in sweep()}
    for name, found in before.items():
        print(f"{name:28} {found}", flush=True)
    for name in given.name:
        usual = getattr(thresholds, name)
        factor = LOGARITHM if name.startswith("LOG_") else given.factor
        found = {}
        for word, value in (("smaller", usual / factor), ("larger", usual * factor)):
            move(name, type(usual)(value) if isinstance(usual, float) else max(1, round(value)))
            found[word] = changes(before)
        move(name, usual)
        print(
            f"{name:24} smaller: {'; '.join(found['smaller']) or '-':45} larger: "
            f"{'; '.join(found['larger']) or '-'}",
            flush=True,
        )


if __name__ == "__main__":
    main()
