"""Features that most trees map: adapters declare them together, and name their own exceptions."""

from __future__ import annotations

from crosscheck.refusals import FACTOR, Supports
from mbref.scene import HOLONOMIC_JOINTS, LOAD_TYPES

EVERYTHING = Supports(
    joints=tuple(kind for kind in HOLONOMIC_JOINTS if kind not in ("inline", "free")),
    drivers=("angle", "displacement"),
    loads=tuple(LOAD_TYPES),
    couplings=("angle", "displacement"),
    armatures=("angle", "displacement"),
    over_time=(FACTOR,),
)
