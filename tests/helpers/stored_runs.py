"""Records of stored tables, made up: runs on the first mechanism of the closed loops, and refusals."""

from typing import Any

from crosscheck.closed_loops.mechanisms import DIFFICULTIES
from crosscheck.study.store import REFUSED

FIRST, SECOND = DIFFICULTIES[:2]


def measured(error: float | None, family: str = "tuned", engine: str = "mujoco", **changes: Any) -> dict:
    """Return the record of a run with an error; if its outcome is not COMPLETED it ends at 0.3 s of 1 s."""
    is_whole = changes.get("outcome", "COMPLETED") == "COMPLETED"
    record = {"scene": FIRST.scene, "engine": engine, "family": family, "version": "4.0.0"}
    record |= {"outcome": "COMPLETED", "message": "" if is_whole else "the Jacobian is singular"}
    record |= {"t_end": 1.0 if is_whole else 0.3, "metrics": {} if error is None else {"error": error}}
    asked = {"engine": engine, "options": {"step": 1e-3}, "end": 1.0, "samples": 21}
    key = f"{engine} {family} {error} {changes.get('scene', '')}"
    return {**record, "key": key, "asked": asked, "time_limit": 60.0, "cost": {"seconds": 0.5}, **changes}


def refused(engine: str = "mujoco") -> dict:
    """Return the record of an engine's refusal of the first mechanism."""
    said = {"outcome": REFUSED, "message": "no hinge", "owner": "missing in the engine"}
    return measured(None, engine=engine, key=f"{engine} refuses", **said)
