"""Effect of tolerances on a slider-crank: 200 variants on every core, beside first-order theory."""

import numpy as np

from mbref import Variation, ensemble, find_scene, simulate, variants

METHOD, COUNT = "alf-dual+projection", 200
TIMES = np.linspace(0.0, 0.1, 6)
VARIED = [
    Variation("joint[B].anchor[0]", 0.304, 5e-5, normal=True),  # crank pin, m
    Variation("joint[C].anchor[0]", 0.7088, 5e-5, normal=True),  # rod end, m
    Variation("body[slider].mass", 1.0, 0.005, normal=True),  # kg
]


def slider(run) -> np.ndarray:
    """Place (k,) of the slider on its line, m."""
    return run.position[:, run.bodies.index("slider"), 0]


def first_order(scene) -> np.ndarray:
    """Standard deviation (k,) of the place, each number's share from a central difference."""
    total = np.zeros_like(TIMES)
    for varied in VARIED:
        at = [Variation(varied.path, *[varied.low + s * varied.high] * 2) for s in (-1, 1)]
        less, more = (simulate(next(variants(scene, [one], 1)), METHOD, TIMES) for one in at)
        total += ((slider(more) - slider(less)) / 2) ** 2
    return np.sqrt(total)


def main() -> None:
    scene = find_scene("planar_slider_crank")
    runs = ensemble(variants(scene, VARIED, COUNT), TIMES, METHOD)
    places = np.array([slider(run) for _, run in runs])
    print(f"{COUNT} variants of {scene.name}: the slider's place")
    for row in zip(TIMES, places.mean(axis=0), places.std(axis=0), first_order(scene), strict=True):
        print("t = {:.2f} s  mean {:8.5f} m  deviation {:.1e} m  (first order: {:.1e} m)".format(*row))
    counts, edges = np.histogram(places[:, -1], bins=12)
    for count, edge in zip(counts, edges, strict=False):
        print(f"{edge:9.5f} m {'#' * int(count)}")


if __name__ == "__main__":
    main()
