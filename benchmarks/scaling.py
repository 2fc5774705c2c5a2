"""Cost over the number of loops of mbref's sparse and dense methods, MuJoCo and Pinocchio, on both chains.

    python benchmarks/scaling.py [LOOPS …]

Process CPU time of the stepping, medians of REPEATS rounds in which all take turns; the error, against the
scene's truth and relative to a link, stands beside every time.  The first tables, of 20 and 200 loops, have
the cost of an error; all other tables have milliseconds per step, for STEPS steps or a few more.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np
from mujoco_chain import EXACT, Chain
from rich.console import Console
from rich.table import Table

from crosscheck.engine import Setting, engine
from crosscheck.judge.metrics import cost_at_error
from crosscheck.judge.tolerances import ERROR_LEVELS
from crosscheck.judge.truth.crankshaft import crankshaft
from crosscheck.judge.truth.one_dof import OneDof
from crosscheck.judge.truth.parallelogram import parallelogram
from mbref.command_line import Parser
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import Limits, simulate

LOOPS = (1, 2, 5, 10, 20, 50, 100, 200)
REPEATS, STEPS = 5, 100
METHOD = "alf-dual+projection"
FAMILIES = {"four_bar_chain": (parallelogram, -1.0), "slider_crank_chain": (crankshaft, 30.0)}
DENSE_METHOD = "mpi-qr+projection"  # the cheapest of the dense formulations that bear redundant rows
DENSE_LOOPS = {"four_bar_chain": 20, "slider_crank_chain": 5}  # largest number of loops for dense factors
SPATIAL_LOOPS = 20  # most for the engines' own mapping of the scene
RTOLS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
MUJOCO_RTOLS = (1e-2, 1e-3, 3e-4, 1e-4, 1e-6, 1e-7, 3e-8, 1e-8, 3e-9)
RK4_STEPS = (2, 3, 4, 8, 16)
UNPROJECTED = "alf-dual+none"  # for few steps, in which constraints are violated by no more than the error
MUJOCO_STEPS = (2, 3, 4, 5, 10, 20, 40, 80, 160, 320, 640)

Attempt = Callable[[], tuple[float, int, float]]  # seconds, steps, error


@dataclass
class Rival:
    """A competitor on one scene: the function that runs it once, and the results of its rounds."""

    name: str
    attempt: Attempt
    seconds: list[float] = field(default_factory=list)
    steps: int = 0
    error: float = math.nan

    def run(self) -> None:
        """Run one more round."""
        seconds, self.steps, self.error = self.attempt()
        self.seconds.append(seconds)


def end_of(scene: Scene) -> np.ndarray:
    """True positions (nb, 3) of the centres at the scene's end."""
    family, rate = FAMILIES[scene.name.partition("[")[0]]
    truth = OneDof(scene, family(scene), rate)
    return truth.poses(np.array([scene.duration])).position[0]


def of_mbref(scene: Scene, truth: np.ndarray, method: str, **limits: float) -> Attempt:
    """By mbref's method."""

    def attempt() -> tuple[float, int, float]:
        run = simulate(scene, method, [scene.duration], Limits(**limits))
        return run.cost.seconds, run.cost.steps, np.abs(run.position[-1] - truth).max()

    return attempt


def of_rk4(scene: Scene, truth: np.ndarray, method: str) -> list[Attempt]:
    """By RK4 on mbref's formulation and stabilisation, coarse to fine."""
    return [of_mbref(scene, truth, f"{method}/rk4[step={scene.duration / steps!r}]") for steps in RK4_STEPS]


def of_engine(scene: Scene, truth: np.ndarray, name: str, family: str, steps: int) -> Attempt:
    """Return the competitor that runs the scene in an engine by crosscheck's adapter, in three dimensions."""
    setting = Setting(family, {"step": scene.duration / steps})

    def attempt() -> tuple[float, int, float]:
        run = engine(name).run(scene, np.array([scene.duration]), setting)
        return run.cost.seconds, run.cost.steps, np.abs(run.position[-1] - truth).max()

    return attempt


def of_chain(scene: Scene, truth: np.ndarray, loops: int, steps: int) -> Attempt:
    """By MuJoCo's RK4 on the planar model written by hand."""
    chain = Chain(loops, scene.duration / steps)

    def attempt() -> tuple[float, int, float]:
        seconds, found = chain.run(steps)
        return seconds, steps, np.abs(found - truth).max()

    return attempt


def of_chain_dop853(scene: Scene, truth: np.ndarray, loops: int, rtol: float) -> Attempt:
    """By MuJoCo's accelerations of that model in a compiled DOP853."""
    chain = Chain(loops, scene.duration, EXACT)

    def attempt() -> tuple[float, int, float]:
        seconds, steps, found = chain.run_dop853(scene.duration, rtol)
        return seconds, steps, np.abs(found - truth).max()

    return attempt


def rivals(chain: str, loops: int) -> list[Rival]:
    """Return the competitors that can run at this size in acceptable time."""
    scene = find_scene(f"{chain}[{loops}]")
    truth, step = end_of(scene), scene.duration / STEPS
    found = [
        Rival("mbref DOP853", of_mbref(scene, truth, METHOD, largest_step=step)),
        Rival("mbref RK4", of_mbref(scene, truth, f"{METHOD}/rk4[step={step!r}]")),
    ]
    if loops <= DENSE_LOOPS[chain]:
        dense = of_mbref(scene, truth, DENSE_METHOD, largest_step=step)
        found.append(Rival("dense accelerations (MPI-QR)", dense))
    if chain == "four_bar_chain":
        found.append(Rival("MuJoCo RK4, planar by hand", of_chain(scene, truth, loops, STEPS)))
    if loops <= SPATIAL_LOOPS:
        found.append(Rival("MuJoCo RK4", of_engine(scene, truth, "mujoco", "stock", STEPS)))
        found.append(Rival("Pinocchio RK4", of_engine(scene, truth, "pinocchio", "proximal", STEPS)))
    return found


def in_turns(competitors: Sequence[Rival]) -> None:
    """Run all competitors once untimed, then REPEATS times in turns."""
    for rival in competitors:
        rival.attempt()
    for _ in range(REPEATS):
        for rival in competitors:
            rival.run()


def scaling(console: Console, chain: str, sizes: Sequence[int]) -> None:
    """Milliseconds per step, and the slope over the last tenfold."""
    measured: dict[int, list[Rival]] = {}
    for loops in sizes:
        measured[loops] = rivals(chain, loops)
        in_turns(measured[loops])
    names = [rival.name for rival in measured[sizes[0]]]
    table = Table(title=f"{chain}: milliseconds per step (error at the end)")
    table.add_column("loops", justify="right")
    for name in names:
        table.add_column(name, justify="right")
    costs: dict[str, dict[int, float]] = {name: {} for name in names}
    for loops, found in measured.items():
        cells = dict.fromkeys(names, "")
        for rival in found:
            cost = median(rival.seconds) / rival.steps
            costs[rival.name][loops] = cost
            cells[rival.name] = f"{cost * 1e3:.3f} ({rival.error:.0e})"
        table.add_row(str(loops), *cells.values())
    console.print(table)
    for name in names:
        last = max(costs[name])
        if last // 10 in costs[name] and last >= 10:
            growth = costs[name][last] / costs[name][last // 10]
            slope = f"slope {math.log10(growth):.2f}"
            console.print(f"  {name}: {last} loops cost {growth:.1f} times {last // 10}, {slope}")


def at_errors(console: Console, loops: int) -> None:
    """The cost of an error on the chain of four-bars: mbref and MuJoCo's best model, by RK4 and DOP853."""
    scene = find_scene(f"four_bar_chain[{loops}]")
    truth = end_of(scene)
    curves = {
        "mbref DOP853": [of_mbref(scene, truth, METHOD, rtol=rtol) for rtol in RTOLS],
        "mbref DOP853, not projected": [of_mbref(scene, truth, UNPROJECTED, rtol=rtol) for rtol in RTOLS],
        "mbref RK4": of_rk4(scene, truth, METHOD),
        "mbref RK4, not projected": of_rk4(scene, truth, UNPROJECTED),
        "MuJoCo RK4, planar by hand": [of_chain(scene, truth, loops, steps) for steps in MUJOCO_STEPS],
        "MuJoCo DOP853, planar by hand": [
            of_chain_dop853(scene, truth, loops, rtol) for rtol in MUJOCO_RTOLS
        ],
    }
    runs = [Rival(name, attempt) for name, attempts in curves.items() for attempt in attempts]
    in_turns(runs)
    table = Table(title=f"four_bar_chain[{loops}], {scene.duration:g} s: milliseconds at an error of …")
    table.add_column("")
    for level in ERROR_LEVELS:
        table.add_column(f"{level:.0e}", justify="right")
    table.add_column("runs: error, ms")
    for name in curves:
        own = [rival for rival in runs if rival.name == name]
        seconds, errors = [median(rival.seconds) for rival in own], [rival.error for rival in own]
        costs = [cost_at_error(seconds, errors, level) for level in ERROR_LEVELS]
        cells = ["never" if cost is None else f"{cost * 1e3:.2f}" for cost in costs]
        listed = ", ".join(f"{e:.0e} {s * 1e3:.2f}" for s, e in zip(seconds, errors, strict=True))
        table.add_row(name, *cells, listed)
    console.print(table)


def main(sizes: Sequence[int]) -> None:
    """Measure and print."""
    console = Console(width=200)
    began = time.process_time()
    for loops in (size for size in sizes if size in (20, 200)):
        at_errors(console, loops)
    scaling(console, "four_bar_chain", sizes)
    scaling(console, "slider_crank_chain", [size for size in sizes if size > 1])
    console.print(f"{time.process_time() - began:.0f} s of CPU time in all")


if __name__ == "__main__":
    parser = Parser(description=__doc__)
    parser.add_argument("loops", nargs="*", type=int, metavar="LOOPS", help="numbers of loops")
    main(sorted({*parser.parse_args().loops}) or LOOPS)
