"""Exact states of the short motions, by the judge: python -m tests.helpers.exact_motions stores them."""

import functools
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.judge import constraints
from crosscheck.judge.gauss_principle import gauss
from crosscheck.judge.reaction_balance import with_exact_reactions
from crosscheck.judge.truth import truth_for
from mbref.motions.trajectory import Trajectory
from mbref.scene import Scene
from tests.helpers.short_motions import MOTIONS, times_of

STORED = Path(__file__).parents[1] / "doors" / "motion" / "exact_motions.json"
SECONDS = 60.0  # CPU time that a reference may take


def exact(scene: Scene) -> dict[str, Any]:
    """Return the judge's states at the sample times, and its bound on their errors."""
    truth = truth_for(scene, reference_time=SECONDS)
    assert truth is not None
    found = truth.poses(times_of(scene))
    names = ("position", "orientation", "velocity", "angular_velocity")
    states = {name: np.asarray(getattr(found, name)).tolist() for name in names}
    return {"by": truth.name, "bound": truth.accuracy, **states}


@functools.cache
def exact_start(scene: Scene) -> Trajectory:
    """Return the start of a scene with accelerations by Gauss's principle, and reactions by balances."""
    pose, twist = constraints.initial_poses(scene), constraints.initial_twists(scene)
    both, count = gauss(scene), len(scene.body)
    rates = both[:count], both[count:] / constraints.scene_length(scene)
    run = (scene.name, "judge", "", "", {}, np.zeros(1), tuple(body.name for body in scene.body))
    start = Trajectory(*run, *(np.array(state)[None] for state in (*pose, *twist, *rates)))
    return with_exact_reactions(scene, start)


@functools.cache
def stored() -> dict[str, dict[str, Any]]:
    """Return the stored exact states of all short motions by name."""
    return json.loads(STORED.read_text())


def main() -> None:
    """Compute the motions that are named, or those that are not stored yet; store them."""
    known = dict(stored()) if STORED.exists() else {}
    for name in sys.argv[1:] or [n for n in MOTIONS if n not in known]:
        known[name] = exact(MOTIONS[name]())
        print(f"{name}: {known[name]['by']}, bound {known[name]['bound']:.1e}", flush=True)
        lines = (f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(known.items()) if k in MOTIONS)
        STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
