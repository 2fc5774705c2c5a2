"""CPU time of `mbref.sensitivities` over that of the run alone, interleaved in one process.

    python benchmarks/sensitivities.py

prints for each scene the CPU time of one run. The CPU times of one output's derivatives to 1 and to 10
numbers are multiples of it. A first call, which is not timed, finds the arrays of the scene and their
derivatives. Beside them stands the largest estimated error of a derivative over the largest
derivative.
"""

import time
from collections.abc import Callable
from statistics import median

import numpy as np

import mbref
from mbref import Limits
from mbref.scene import Scene

SCENES = {  # output, and end of the motion (s), before the first singular position
    "four_bar_gravity": ("A.angle", 0.1),
    "planar_slider_crank_gravity": ("slider.position.x", None),
    "spatial_slider_crank_gravity": ("slider.position.y", None),
    "four_bar_chain[5]": ("energy", 0.1),
    "four_bar_chain[20]": ("energy", 0.1),
    "flyball_governor": ("energy", 0.1),
    "sarrus": ("energy", None),
}
REPEATS = 3
ROUNDING = (
    1e-9  # derivative / largest one, in SI units, below which it is rounding, as by gravity across a plane
)
LIMITS = Limits(rtol=1e-12)


def seconds(call: Callable[[], object]) -> float:
    """Return the CPU time of a call, s."""
    began = time.process_time()
    call()
    return time.process_time() - began


def numbers_of(scene: Scene) -> list[str]:
    """Return ten numbers of a scene: masses, gravity and anchors."""
    masses = [f"body[{body.name}].mass" for body in scene.body]
    gravity = [f"gravity.{axis}" for axis in "xyz"]
    anchors = [f"joint[{joint.name}].anchor.{axis}" for joint in scene.joint[1:] for axis in "xyz"]
    return [*masses[:4], *gravity, *anchors][:10]


def main() -> None:
    """Print one line for each scene."""
    for name, (output, end) in SCENES.items():
        scene = mbref.find_scene(name)
        numbers, times = numbers_of(scene), np.linspace(0.0, end or scene.duration, 11)

        def run(scene=scene, times=times, output=output) -> object:
            return mbref.simulate(scene, times=times, limits=LIMITS).columns(output)

        def one(scene=scene, times=times, output=output, numbers=numbers) -> object:
            return mbref.sensitivities(scene, [output], numbers[:1], times, LIMITS)

        def ten(scene=scene, times=times, output=output, numbers=numbers) -> object:
            return mbref.sensitivities(scene, [output], numbers, times, LIMITS)

        found = mbref.sensitivities(scene, [output], numbers, times, LIMITS)
        largest = np.abs(found.values).max(axis=(0, 1))
        nonzero = largest > ROUNDING * largest.max()
        error = (found.errors.max(axis=(0, 1))[nonzero] / largest[nonzero]).max()
        times_of = [(seconds(run), seconds(one), seconds(ten)) for _ in range(REPEATS + 1)][1:]
        ratios = [median(each[k] / each[0] for each in times_of) for k in (1, 2)]
        print(
            f"{name}: {1e3 * median(each[0] for each in times_of):.1f} ms a run; "
            f"1 number {1e3 * median(each[1] for each in times_of):.0f} ms or {ratios[0]:.0f} runs, "
            f"{len(numbers)} numbers {1e3 * median(each[2] for each in times_of):.0f} ms or "
            f"{ratios[1]:.0f} runs, error {error:.0e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
