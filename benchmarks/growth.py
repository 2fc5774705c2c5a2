"""Growth of cost, build and memory with the number of bodies: mbref and MuJoCo's planar models by hand.

    python benchmarks/growth.py [SCENE …] [--method METHOD …] [--repeats N] [--out FILE.json] [--plot PNG]

A row has milliseconds of stepping for each simulated second of a whole motion, with an error of the bodies'
centres at the end of at most ERROR (m): the cheapest tolerance of mbref, and MuJoCo's cheapest solver and
number of RK4 steps. Both take turns in one process, by one BLAS thread; times are medians of process CPU
time. The error stands beside every time, against mbref at TRUE_RTOL; MuJoCo's error confirms that motion.
Build (CPU seconds) and memory (MB above the imports) belong to a process of their own.
"""

from __future__ import annotations

import one_thread  # noqa: F401 - before NumPy

# isort: split
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from planar_mujoco import CLOSED, SOLVERS, Model

from crosscheck.study.provenance import machine, versions
from mbref import Limits, simulate
from mbref.command_line import Parser
from mbref.method import default_method
from mbref.scene import Revolute, Scene
from mbref.scenes import find_scene

ERROR = 1e-6  # m, largest error of a centre at the end
RTOLS = tuple(10 ** (-k / 2) for k in range(4, 19))
TRUE_RTOL = 1e-11
STEPS = tuple(round(4 * 2 ** (k / 2)) for k in range(24))  # of MuJoCo
MORE = 4  # settings that are tried beyond the first one that reaches ERROR
TOO_LONG = 20.0  # s of a run; no finer setting is tried
MOST_DENSE = 100  # bodies up to which MuJoCo's dense Jacobian is tried: its cost is cubic
OFFSET = 0.1  # m from the plane of a doubled hinge
ENGINES = ("mbref", "mujoco")
SCENES = (  # larger ones by their names, such as four_bar_chain[2000]
    *(f"four_bar_chain[{n}]" for n in (10, 40, 100, 200)),
    *(f"slider_crank_chain[{n}]" for n in (10, 40, 100)),
    *(f"lattice[{n},{n}]" for n in (3, 6, 10)),
    *(f"strandbeest[{n}]" for n in (4, 12, 30, 60)),
    *(f"doubled_hinges[{n}]" for n in (40, 100)),
    *(f"sarrus_stack[{n}]" for n in (10, 40)),
)


@dataclass
class Row:
    """The results of one competitor on one scene."""

    scene: str
    bodies: int
    who: str
    setting: str
    error: float
    seconds: list[float] = field(default_factory=list)
    per_second: float = math.nan  # ms of stepping for a simulated second
    build: float = math.nan  # CPU s
    memory: float = math.nan  # MB


Attempt = Callable[[], tuple[float, np.ndarray]]  # seconds, centres at the end


def scene_of(name: str) -> Scene:
    """Return a built-in scene, or a chain of four-bars in which every joint is a pair of hinges."""
    family, _, size = name.partition("[")
    if family != "doubled_hinges":
        return find_scene(name)
    single = find_scene(f"four_bar_chain[{size}")
    pairs = [
        Revolute(
            name=f"{joint.name}{side}", bodies=joint.bodies, anchor=(*joint.anchor[:2], z), axis=(0, 0, 1)
        )
        for joint in single.joint
        for side, z in (("left", -OFFSET), ("right", OFFSET))
    ]
    return single.with_(name=name, joint=tuple(pairs))


def of_mbref(scene: Scene, method: str, rtol: float) -> Attempt:
    """Return a run of mbref from start to end."""

    def attempt() -> tuple[float, np.ndarray]:
        run = simulate(scene, method, [scene.duration], Limits(rtol=rtol))
        if run.outcome.name != "COMPLETED":
            raise RuntimeError(f"{run.outcome.label} at {run.t_end:.3g} s")
        return run.cost.seconds, run.position[-1]

    return attempt


def cheapest(attempts: Iterable[tuple[str, Attempt]], truth: np.ndarray) -> tuple[str, float, Attempt] | None:
    """Return setting, error and run of the cheapest attempt that reaches ERROR, of the first and MORE finer
    ones; None if none reaches it. A coarse tolerance may cost more, by rejected steps."""
    found: list[tuple[float, str, float, Attempt]] = []
    left = MORE + 1
    for setting, attempt in attempts:
        seconds, centres = attempt()
        error = float(np.abs(centres - truth).max())
        if error <= ERROR:
            found.append((seconds, setting, error, attempt))
        left -= bool(found)
        if not left or seconds > TOO_LONG:
            break
    return min(found, key=lambda one: one[0])[1:] if found else None


def mujoco_runs(scene: Scene, truth: np.ndarray) -> list[tuple[str, float, Attempt]]:
    """Return the cheapest number of steps of every solver that reaches ERROR."""
    if scene.name.startswith("doubled"):
        scene = scene_of(scene.name.replace("doubled_hinges", "four_bar_chain"))
    if scene.name.partition("[")[0] not in CLOSED:
        return []
    start, found = simulate(scene, None, [0.0]), []
    for solver in SOLVERS:
        if solver.jacobian == "dense" and len(scene.body) > MOST_DENSE:
            continue

        def attempt(steps: int, solver: Any = solver) -> Attempt:
            model = Model(
                scene, start.velocity[0], start.angular_velocity[0, :, 2], solver, scene.duration / steps
            )
            return lambda: model.run(steps)

        attempts = ((f"{solver.jacobian} {solver.iterations} {n} steps", attempt(n)) for n in STEPS)
        if one := cheapest(attempts, truth):
            found.append(one)
    return found


def measured(name: str, methods: Sequence[str], repeats: int) -> list[Row]:
    """Return the rows of a scene."""
    scene = scene_of(name)
    truth = of_mbref(scene, methods[0] if methods else default_method(scene), TRUE_RTOL)()[1]
    competitors = []
    for method in methods or (default_method(scene),):
        attempts = [(f"{method} {rtol:.0e}", of_mbref(scene, method, rtol)) for rtol in RTOLS]
        if found := cheapest(attempts, truth):
            competitors.append((Row(name, len(scene.body), "mbref", *found[:2]), found[2]))
    theirs = [(Row(name, len(scene.body), "mujoco", *f[:2]), f[2]) for f in mujoco_runs(scene, truth)]
    competitors += theirs
    for _ in range(repeats):
        for row, attempt in competitors:
            row.seconds.append(attempt()[0])
    for row, _ in competitors:
        row.per_second = 1e3 * median(row.seconds) / scene.duration
    best = min((row for row, _ in theirs), key=lambda row: row.per_second, default=None)
    rows = [row for row, _ in competitors if row.who == "mbref" or row is best]
    for row in rows:
        row.build, row.memory = built_alone(name, row.who)
    return rows


def built_alone(name: str, who: str) -> tuple[float, float]:
    """Return CPU seconds and MB above the imports of a build in a process of its own; patterns are cached."""
    command = [sys.executable, __file__, name, "--build", who]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    seconds, memory = json.loads(done.stdout)
    return seconds, memory


def build(name: str, who: str) -> tuple[float, float]:
    """Build a scene for its start; return CPU seconds and MB above the imports."""
    simulate(find_scene("four_bar"), None, [0.0])  # kernels are loaded
    scene = scene_of(name.replace("doubled_hinges", "four_bar_chain") if who == "mujoco" else name)
    still = np.zeros((len(scene.body), 3))
    if who == "mujoco":
        Model(find_scene("lattice"), np.zeros((10, 3)), np.zeros(10), SOLVERS[0], 1e-3)  # imports
    Path("/proc/self/clear_refs").write_text("5")  # the peak of memory begins anew
    before, began = memory("VmRSS"), time.process_time()
    if who == "mujoco":
        Model(scene, still, still[:, 2], SOLVERS[0], 1e-3)
    else:
        simulate(scene, None, [0.0])
    return time.process_time() - began, memory("VmHWM") - before


def memory(which: str) -> float:
    """Return the process's present (VmRSS) or largest (VmHWM) memory in MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(which)) / 1024


def show(rows: Sequence[Row]) -> None:
    """Print rows, with the ratio to MuJoCo."""
    theirs = [row.per_second for row in rows if row.who == "mujoco"]
    for row in rows:
        ratio = f"{row.per_second / min(theirs):7.2f}" if theirs and row.who == "mbref" else " " * 7
        print(
            f"{row.scene:24} {row.bodies:6} {row.who:7} {row.per_second:10.3f} {ratio} {row.error:8.1e} "
            f"{row.build:8.3f} {row.memory:8.0f}  {row.setting}",
            flush=True,
        )


def exponents(rows: Sequence[Row]) -> None:
    """Print the exponents of stepping, build and memory in the number of bodies, over the last two sizes."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        method = row.setting.split()[0] if row.who == "mbref" else ""
        groups.setdefault((row.scene.partition("[")[0], f"{row.who} {method}"), []).append(row)
    for (family, who), group in groups.items():
        if len(group) > 1:
            first, last = group[-2:]
            step = math.log(last.bodies / first.bodies)
            found = [
                math.log(b / a) / step if a > 0 and b > 0 else math.nan
                for a, b in zip(_costs(first), _costs(last), strict=True)
            ]
            sizes = f"{first.bodies} to {last.bodies} bodies"
            named = zip(("stepping", "build", "memory"), found, strict=True)
            print(f"{family:20} {who:40} {sizes:22}", *(f"{kind} {value:.2f}" for kind, value in named))


def _costs(row: Row) -> tuple[float, float, float]:
    return row.per_second, row.build, row.memory


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw milliseconds for each simulated second over the number of bodies."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5.5))
    families = list(dict.fromkeys(row.scene.partition("[")[0] for row in rows))
    for k, family in enumerate(families):
        for who, style in zip(ENGINES, ("o-", "s:"), strict=True):
            own = [row for row in rows if row.scene.startswith(family) and row.who == who]
            if own:
                x, y = [row.bodies for row in own], [row.per_second for row in own]
                axes.loglog(x, y, style, color=f"C{k}", label=f"{family}, {who}")
    axes.set_xlabel("bodies")
    axes.set_ylabel(f"ms for a simulated second at an error of {ERROR:g} m")
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=120, bbox_inches="tight")


def main() -> None:
    """Measure, print, store, draw."""
    parser = Parser(description=__doc__)
    parser.add_argument("scene", nargs="*", help="default: all")
    parser.add_argument("--method", action="append", default=[], help="of mbref; may repeat")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--build", choices=ENGINES, help="build the scene alone, print seconds and MB")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    if options.build:
        print(json.dumps(build(options.scene[0], options.build)))
        return
    print(machine(), time.strftime("%Y-%m-%d", time.gmtime()))
    heads = f"{'ms/s':>10} {'ratio':>7} {'error':>8} {'build s':>8} {'MB':>8}  setting"
    print(f"{'scene':24} {'bodies':>6} {'':7} {heads}")
    rows: list[Row] = []
    for name in options.scene or SCENES:
        try:
            found = measured(name, options.method, options.repeats)
        except RuntimeError as error:
            print(f"{name}: {error}", flush=True)
            continue
        rows += found
        show(found)
        if options.out:
            data = {"machine": machine(), "versions": versions(), "rows": [asdict(row) for row in rows]}
            options.out.write_text(json.dumps(data))
    exponents(rows)
    if options.plot:
        plot(rows, options.plot)


if __name__ == "__main__":
    main()
