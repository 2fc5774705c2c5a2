"""Random mechanisms whose joints and couplings hold in random intervals of time."""

from typing import Any

import numpy as np

from crosscheck.conformance.mechanisms.geared import geared_mechanism
from crosscheck.conformance.mechanisms.random_scenes import mechanism
from mbref.scene import Scene

DURATION = 0.3  # s
CHANGES = (0.07, 0.13, 0.2, 0.26)  # s; times at which constraints can begin or cease to hold
SHARE = 0.6  # fraction of the joints without drivers, couplings and armatures that have intervals


def intermittent_mechanism(seed: int) -> Scene:
    """Return a mechanism with closed loops, of which joints and couplings come and go; it depends on the seed
    only. Universal joints always hold: their axes may be parallel where they would begin to hold."""
    rng = np.random.default_rng([seed, 5])
    scene = geared_mechanism(seed) if seed % 3 == 1 else mechanism(seed)
    busy = {name for coupling in scene.coupling for name in coupling.joints}
    busy |= {driver.joint for driver in scene.driver}
    busy |= {joint.name for joint in scene.joint if joint.reflected_inertia or joint.type == "universal"}
    free = [joint.name for joint in scene.joint if joint.name not in busy]
    chosen = {name for name in free if rng.random() < SHARE} or set(free[:1])
    loads = [load for load in scene.load if getattr(load, "joint", None) not in chosen]
    joints = [
        joint.model_copy(update=_intervals(rng) if joint.name in chosen else {}) for joint in scene.joint
    ]
    couplings = [each.model_copy(update=_intervals(rng)) for each in scene.coupling]
    return scene.with_(
        name=f"intermittent_{seed}", duration=DURATION, joint=joints, coupling=couplings, load=loads
    )


def _intervals(rng: np.random.Generator) -> dict[str, Any]:
    """Return one or two intervals between some of CHANGES, the start and a time after the end."""
    times = sorted(rng.choice([0.0, *CHANGES, 1.0], 2 if rng.random() < 0.6 else 4, replace=False).tolist())
    return {"active": tuple(zip(times[::2], times[1::2], strict=True))}
