"""The settings of a family in a comparison of speeds, and the families that miss a level of error.

The grid has half decades, so that no family drops out because it ends just short of a level. MuJoCo's
closures have several rates, because stiff closures make integration expensive. Only scenes with singular
positions have a shortest step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from crosscheck.engine import Setting
from crosscheck.study.words.speed import COMPILED
from mbref.scene import Scene
from mbref.simulation.simulate import simulate

COARSEST, FINEST = -3.0, -12.0  # decades of a relative tolerance
BETAS = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  # 1/s, beside the engine's own
SCANS = (1e-6, 1e-10)  # relative tolerances at which rates of closures are compared
SHORTER = (
    1.0,
    0.25,
)  # shortest steps of compiled families at singular positions / shortest step of the engine's own family
ORDER = 8  # order of the integrator by which errors are converted to costs at singular positions
SHORTEST = 1e-9  # step over the duration, where no position is singular
NEAR = 30.0  # error / level of error: a smaller ratio misses the level by little


def half_decades() -> list[float]:
    """Relative tolerances, coarse to fine."""
    count = round(2 * (COARSEST - FINEST)) + 1
    return [float(f"{10.0 ** (COARSEST - 0.5 * k):.2g}") for k in range(count)]


def passes_singular_position(scene: Scene) -> bool:
    """Return whether the motion passes a singular position, as counted by mbref's projection."""
    return "singular positions passed" in simulate(scene, times=[scene.duration]).message


def refined(
    settings: Sequence[Setting], scene: Scene, singular: bool, score: Callable[[Setting], float]
) -> Iterator[Setting]:
    """Return settings by tolerance in half decades, and all other settings unchanged; coarse to fine in each
    family.

    ``score`` is the cost of a run at one error, by which the rates of closures are chosen.
    """
    done = set()
    for setting in settings:
        if "rtol" not in setting.options:
            yield setting
        elif setting.family not in done:
            done.add(setting.family)
            for first in _variants(setting, scene, singular, score):
                yield from (_with(first, rtol=rtol) for rtol in half_decades())


def _variants(
    setting: Setting, scene: Scene, singular: bool, score: Callable[[Setting], float]
) -> Iterator[Setting]:
    """Return the shortest steps and the rates of closures with which a family is swept over the
    tolerances."""
    steps = [setting if singular else _without_shortest_step(setting, scene.duration)]
    if singular and setting.family.endswith(COMPILED):
        steps = [_with(setting, min_step=setting.options["min_step"] * factor) for factor in SHORTER]
    for first in steps:
        if "beta" not in first.options:
            yield first
            continue
        rates = {min(_with_rates(first, scan), key=score).options["beta"] for scan in SCANS}
        yield from (_with(first, beta=beta) for beta in sorted(rates))


def cost_at_one_error(seconds: float, error: float) -> float:
    """Seconds that an integrator of order ORDER would need for an error of one."""
    return seconds * error ** (1 / ORDER) if math.isfinite(error) else math.inf


def misses(rows: Sequence[dict[str, Any]], levels: Sequence[float]) -> Iterator[str]:
    """Return a sentence for each engine whose best family at a level misses the next level, with the ratio of
    error to level.

    ``rows`` have an engine, a family, the costs at the levels and the least error with its seconds.
    """
    for name in dict.fromkeys(row["engine"] for row in rows):
        own = [row for row in rows if row["engine"] == name]
        for k, level in enumerate(levels[1:], 1):
            before = min(own, key=lambda row: row["cost"][k - 1])
            if math.isfinite(before["cost"][k - 1]) and math.isinf(before["cost"][k]):
                error, seconds = before["least"]
                little = ", by little" if error <= NEAR * level else ""
                best = f"{before['family']}, the best at {levels[k - 1]:.0e}, misses {level:.0e}{little}"
                yield f"{name}: {best}; least error {error:.1e} at {seconds * 1e3:.3g} ms/s"


def _without_shortest_step(setting: Setting, duration: float) -> Setting:
    return _with(setting, min_step=SHORTEST * duration) if "min_step" in setting.options else setting


def _with_rates(setting: Setting, rtol: float) -> Iterator[Setting]:
    for beta in (setting.options["beta"], *BETAS):
        yield _with(setting, rtol=rtol, beta=beta)


def _with(setting: Setting, **options: float) -> Setting:
    return replace(setting, options={**setting.options, **options})
