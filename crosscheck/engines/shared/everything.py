"""Features that most trees map: adapters declare them together, and name their own exceptions."""

from __future__ import annotations

from crosscheck.refusals import FACTOR, Supports
from mbref.scene import JOINT_TYPES, LOAD_TYPES

EVERYTHING = Supports(
    joints=tuple(kind for kind in JOINT_TYPES if kind not in ("inline", "free")),
    drivers=("angle", "displacement"),
    loads=tuple(LOAD_TYPES),
    couplings=("angle", "displacement"),
    armatures=("angle", "displacement"),
    over_time=(FACTOR,),
)
