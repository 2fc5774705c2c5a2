"""Cost of derivatives over the run without, interleaved in one process.

    python benchmarks/sensitivities.py

prints for each scene the CPU time of `mbref.sensitivities` of one output to the masses of all bodies and the
components of gravity, as a ratio to one run at an equal tolerance.
"""

import time
from collections.abc import Callable
from statistics import median

import numpy as np

import mbref
from mbref import Limits

SCENES = {
    "heavy_top": "energy",
    "planar_slider_crank_gravity": "slider.position.x",
    "spatial_slider_crank_gravity": "slider.position.x",
    "sarrus": "energy",
}
REPEATS = 5
LIMITS = Limits(rtol=1e-12)


def seconds(call: Callable[[], object]) -> float:
    """Return the CPU time of a call, s."""
    began = time.process_time()
    call()
    return time.process_time() - began


def main() -> None:
    """Print one line for each scene."""
    for name, output in SCENES.items():
        scene = mbref.find_scene(name)
        numbers = [f"body[{body.name}].mass" for body in scene.body] + [f"gravity.{axis}" for axis in "xyz"]
        times = np.linspace(0.0, scene.duration, 11)

        def run(scene=scene, times=times) -> object:
            return mbref.simulate(scene, times=times, limits=LIMITS).columns("energy")

        def derivatives(scene=scene, times=times, output=output, numbers=numbers) -> object:
            return mbref.sensitivities(scene, [output], numbers, times, LIMITS)

        pairs = [(seconds(run), seconds(derivatives)) for _ in range(REPEATS + 1)][1:]
        ratio = median(own / one for one, own in pairs)
        print(f"{name}: {len(numbers)} numbers, {ratio:.0f} runs, {ratio / len(numbers):.1f} runs a number")


if __name__ == "__main__":
    main()
