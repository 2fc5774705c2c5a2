"""The cost of the first run before it steps: imports, compilation, loading compiled kernels from the cache.

    python benchmarks/startup.py [METHOD …]

Each number is measured in fresh processes: process CPU seconds from the start of the interpreter, children of
the compiler included.  A cold start has an empty cache folder; a warm start uses the folder of a cold start
again. Python keeps the bytecode of modules, as it does unless PYTHONDONTWRITEBYTECODE is set.  Of ``mbref
run`` the first line says after how many seconds, of a clock, the result of a cold start is printed.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from crosscheck.engine import engine
from mbref.command_line import Parser
from mbref.scenes import SCENES

WARM = 3  # number of processes for each warm number
SCENE = "spatial_slider_crank"
COMMAND = ("mbref", "run", "four_bar_gravity")
IMPORTS = (
    "numpy",
    "mbref.scene",
    "mbref.simulation.simulate",
    "crosscheck.study.grid",
    "mujoco",
    "pinocchio",
    "exudyn",
)
RUN = """
from crosscheck.engine import Setting, engine
from mbref.scenes import SCENES
scene = SCENES[{scene!r}]()
engine("mbref").prepare([{family!r}])
engine("mbref").run(scene, [scene.duration], Setting({family!r}, {{"rtol": 1e-6}}))
"""


def main(methods: Sequence[str]) -> None:
    """Measure and print."""
    nothing = _median("pass", {})
    print(f"{'the interpreter alone':32}{nothing:8.2f} s")
    for module in IMPORTS:
        if _installed(module):
            print(f"{'import ' + module:32}{_median(f'import {module}', {}) - nothing:8.2f} s")
    _command()
    print(f"\n{'a short run of ' + SCENE:32}{'cold':>10}{'warm':>10}{'cache':>12}")
    offered = dict.fromkeys(setting.family for setting in engine("mbref").settings(SCENES[SCENE]()))
    for family in methods or offered:
        with tempfile.TemporaryDirectory() as folder:
            code, place = RUN.format(scene=SCENE, family=family), {"NUMBA_CACHE_DIR": folder}
            cold = _seconds(code, place)
            warm = _median(code, place)
            size = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
            print(f"{family:32}{cold:8.2f} s{warm:8.2f} s{size / 1e6:9.1f} MB")


def _command() -> None:
    """Return the CPU time of a command's first result with an empty cache, and with kernels in the cache."""
    with tempfile.TemporaryDirectory() as folder:
        place = {**os.environ, "NUMBA_CACHE_DIR": folder}
        began = time.perf_counter()
        with subprocess.Popen(
            COMMAND, env=place, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()
            first = time.perf_counter() - began
            process.stdout.read()
        warm = median(_seconds_of(COMMAND, {"NUMBA_CACHE_DIR": folder}) for _ in range(WARM))
    print(f"\n{' '.join(COMMAND)}: first result after {first:.1f} s, later {warm:.2f} s of CPU time")


def _installed(module: str) -> bool:
    run = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, check=False)
    return run.returncode == 0


def _median(code: str, environment: dict[str, str]) -> float:
    return median(_seconds(code, environment) for _ in range(WARM))


def _seconds(code: str, environment: dict[str, str]) -> float:
    return _seconds_of((sys.executable, "-c", code), environment)


def _seconds_of(command: Sequence[str], environment: dict[str, str]) -> float:
    """CPU seconds, user and system, of a fresh process that runs the command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run(command, env={**os.environ, **environment}, check=True, **quiet)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    parser = Parser(description=__doc__)
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="default: the methods of crosscheck")
    main(parser.parse_args().methods)
