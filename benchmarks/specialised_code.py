"""The cost of making and loading specialised code, and the simulated seconds after which it pays.

    python benchmarks/specialised_code.py [SCENE …]

Process CPU time.  Made, then loaded: in a fresh process each, of a scene whose first mass is changed in the
last digits, so that no stored code fits.  General and specialised: milliseconds per simulated second at a
tolerance of 1e-7, medians of REPEATS interleaved runs.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from statistics import median

import numpy as np

from mbref.method import Method
from mbref.scene import Scene
from mbref.scenes import find_scene
from mbref.simulation.simulate import Limits, simulate, why_no_code

METHOD = "alf-dual+projection"
SCENE_NAMES = ("spatial_slider_crank", "planar_slider_crank", "four_bar", "five_bar")
RTOL, REPEATS = 1e-7, 9
CODES = ("generic", "specialised")
BUILD = """
import sys
from mbref.scene import Scene
from mbref.simulation.simulate import Limits, simulate
scene = Scene.from_file(sys.argv[1])
for code in ("generic", "generic", "specialised"):
    print(simulate(scene, sys.argv[2], [1e-9], Limits(code=code)).cost.build_seconds)
"""


def main(names: Sequence[str]) -> None:
    """Measure and print."""
    print(f"{'':24}{'made':>10}{'loaded':>10}{'generic':>12}{'own':>12}{'pays after':>14}")
    for name in names:
        scene = find_scene(name)
        if reason := why_no_code(scene, Method.parse(METHOD)):
            print(f"{name:24}none: {reason}")
            continue
        made, loaded = _builds(_another(scene))
        generic, own = _per_second(scene)
        pays = made / (generic - own) if own < generic else np.inf
        building = f"{made * 1e3:7.0f} ms{loaded * 1e3:7.1f} ms"
        print(f"{name:24}{building}{generic * 1e3:7.2f} ms/s{own * 1e3:7.2f} ms/s{pays:12.2f} s")


def _another(scene: Scene) -> Scene:
    """The scene with its first mass changed by less than matters."""
    first, *others = scene.body
    mass = first.mass * (1.0 + 1e-9 * random.SystemRandom().random())
    return scene.with_(body=(first.model_copy(update={"mass": mass}), *others))


def _builds(scene: Scene) -> tuple[float, float]:
    """Seconds to make the code, and to load it, beyond what building the scene takes."""
    with tempfile.NamedTemporaryFile(suffix=".toml") as file:
        scene.save(file.name)
        command = [sys.executable, "-c", BUILD, file.name, METHOD]
        runs = [subprocess.run(command, capture_output=True, text=True, check=True) for _ in range(2)]
    made, loaded = ([float(line) for line in run.stdout.split()] for run in runs)
    return made[2] - made[1], loaded[2] - loaded[1]


def _per_second(scene: Scene) -> tuple[float, float]:
    """CPU seconds of stepping per simulated second, generic and own."""
    times = np.linspace(0.0, scene.duration, 11)
    rounds = [
        [simulate(scene, METHOD, times, Limits(rtol=RTOL, code=code)).cost.seconds for code in CODES]
        for _ in range(REPEATS + 1)
    ]
    generic, own = (median(seconds) for seconds in zip(*rounds[1:], strict=True))
    return generic / scene.duration, own / scene.duration


if __name__ == "__main__":
    main(sys.argv[1:] or SCENE_NAMES)
