"""Ways in which MuJoCo solves the same equations: solvers, Jacobians, islands, warm starts, parts of a step.

They must agree on closures that are nearly rigid, where Gauss's principle decides which one is right, and on
the library's soft closures, on which also PGS converges.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from crosscheck.engine import Alternatives, Setting
from crosscheck.engines.mujoco.families import CHOSEN, HARD

SAFE = {"solver": "Newton", "iterations": 50, "jacobian": "dense", "islands": False, "warm": False}
NEARLY_RIGID = {"step": 1e-4, "beta": 50.0, "hard": HARD}  # beta in 1/s
SOFT = {"step": 1e-4}
MANY = 1000  # iterations of a first-order solver: errors then are rounding


def _ways(
    closures: Mapping[str, Any], within: float, changes: Mapping[str, Mapping[str, Any]]
) -> Alternatives:
    ways = {name: Setting(CHOSEN, {**closures, **SAFE, **own}) for name, own in changes.items()}
    return Alternatives(ways, within)


ALTERNATIVES = (
    _ways(
        NEARLY_RIGID,
        1e-5,  # measured: 6e-6 in forces near a singular position, mostly 1e-10
        {
            "Newton, dense": {},
            "Newton, sparse": {"jacobian": "sparse"},
            "Newton, dense, islands": {"islands": True},
            "Newton, sparse, islands, warm": {"jacobian": "sparse", "islands": True, "warm": True},
            "Newton, dense, forward twice": {"warm": True, "forward": 2},
            "Newton, dense, parts of a step": {"parts": True},
            "CG, dense": {"solver": "CG", "iterations": MANY},
            "CG, sparse": {"solver": "CG", "iterations": MANY, "jacobian": "sparse"},
        },
    ),
    _ways(
        SOFT,
        1e-5,  # measured: 3e-6, where PGS converges slowly
        {
            "soft, Newton, dense": {},
            "soft, PGS, dense": {"solver": "PGS", "iterations": MANY},
            "soft, PGS, sparse": {"solver": "PGS", "iterations": MANY, "jacobian": "sparse"},
        },
    ),
)
