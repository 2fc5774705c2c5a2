"""Certified references: the motion of a scene to a number of digits by both formulations, as a table.

The scene's doubles count as exact. Formulations A and B are computed with more digits, and the table has the
digits on which they agree. The bound is ten times their difference. If redundant rows contradict each other,
the table belongs to the mechanism without these rows and names the replaced joints. Tables are never edited,
but replaced.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.judge.arithmetic import EXTENDED, doubles, many_digits
from crosscheck.judge.deadline import TimeIsUp, within
from crosscheck.judge.reference.bound import SAFETY, differences
from crosscheck.judge.reference.cache import canonical
from crosscheck.judge.reference.isostatic import Pose, isostatic, replaced
from crosscheck.judge.reference.motion import Motion, Progress, no_progress
from crosscheck.judge.reference.taylor import natural_motion
from crosscheck.judge.reference.tree import tree_motion
from mbref.scene import Scene

# digits of a step's tolerance beyond the requested digits: first try, and second try if the first one fails
SPARE = (6, 12)
POSES = 101  # number of poses along a motion at which the rank is checked
METHODS = {
    "A": "natural coordinates, Taylor series",
    "B": "joint coordinates of a spanning tree, Chebyshev–Picard panels",
}
ACROSS = {"A": METHODS["A"], "A again": "with more digits and another order, because B loses too many digits"}
"""Through singular positions."""

FEWEST_DIGITS = 4  # series for fewer digits have too few terms
MOST_DIGITS = 100  # tolerances for many more digits are below the smallest double

Shown = Callable[[str], AbstractContextManager[Progress]]
"""Shows the progress of the formulation named while the context lasts."""

FOLDER = Path(__file__).with_name("certified")
RATES = ("velocity", "angular_velocity")


def unshown(_: str) -> AbstractContextManager[Progress]:
    """Ignore the progress."""
    return nullcontext(no_progress)


class NotCertified(ArithmeticError):
    """The formulations do not agree to the requested digits, or a formulation ends early."""


def certified(
    scene: Scene, times: np.ndarray, digits: int, seconds: float = np.inf, shown: Shown = unshown
) -> dict[str, Any]:
    """Return a table of positions (m), orientations (w, x, y, z), velocities (m/s) and angular velocities
    (rad/s; world) at increasing times (k,).

    All numbers are decimal strings. Further entries are ``id`` (of scene and times), ``digits``, ``bound``,
    ``rate_bound`` (for velocities, relative to the largest of their kind), both ``methods``, the ``replaced``
    joints if there are any, and the ``hash`` of all entries.

    ``seconds`` limits the CPU time of all formulations together.  Raises NotCertified, and ImportError
    without python-flint.
    """
    try:
        with within(seconds):
            return _agreed(scene, times, digits, shown)
    except TimeIsUp as end:
        raise NotCertified(f"{scene.name}: {end}") from None


def _agreed(scene: Scene, times: np.ndarray, digits: int, shown: Shown) -> dict[str, Any]:
    """Return the table of the digits on which the formulations agree; raises NotCertified."""
    for spare in SPARE:
        moved, a, b = _motions(scene, times, digits, spare, shown)
        bound = SAFETY * float(differences(scene, a, b).max(initial=0.0))
        if bound <= 10.0**-digits:
            least = 10.0 ** -(digits + spare)
            rates = SAFETY * max(_apart(getattr(a, name), getattr(b, name)) for name in RATES)
            return _table(scene, moved, a, digits, (max(bound, least), max(rates, least)))
    raise NotCertified(f"{scene.name}: the formulations agree to {bound:.0e} only")


def _motions(
    scene: Scene, times: np.ndarray, digits: int, spare: int, shown: Shown
) -> tuple[Scene, Motion, Motion]:
    """Return the mechanism without contradictory rows, its motion by A, and its motion by B.

    If B loses too many digits at singular positions, the second motion is by A with other digits and another
    order.
    """

    def by_a(of: Scene, order: int, places: int) -> Motion:
        with shown("formulation A") as progress:
            return _by_a(of, times, order, places, progress)

    moved, a = scene, by_a(scene, digits, digits + spare)
    if a.contradiction > 10.0**-digits:
        moved = isostatic(scene, _poses(scene, float(times[-1])))
        a = by_a(moved, digits, digits + spare)
    if a.crossings:
        orders = 3 * digits // 2, 7 * digits // 4
        a, b = (by_a(moved, order, 4 * order // 3) for order in orders)
    else:
        _refuse_ended(scene, a, "A")
        with shown("formulation B") as progress:
            b = tree_motion(moved, times, many_digits(digits + spare), seconds=np.inf, progress=progress)
    _refuse_ended(scene, a, "A")
    _refuse_ended(scene, b, "B")
    return moved, a, b


def _poses(scene: Scene, end: float) -> list[Pose]:
    """Return poses along the motion up to a time (s), in double precision."""
    motion = natural_motion(scene, np.linspace(0.0, end, POSES), EXTENDED)
    return list(
        zip(motion.times.tolist(), doubles(motion.position), doubles(motion.orientation), strict=True)
    )


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest difference of two arrays, relative to the largest entry of the first."""
    largest, apart = (np.abs(doubles(values)).max(initial=0.0) for values in (one, one - other))
    return float(apart / largest) if largest else float(apart)


def _refuse_ended(scene: Scene, motion: Motion, name: str) -> None:
    """Raise NotCertified if a formulation's motion ended early."""
    if motion.reason:
        raise NotCertified(f"{scene.name}: {name} ends at t = {motion.reached:.6g} s: {motion.reason}")


def _by_a(scene: Scene, times: np.ndarray, order: int, places: int, progress: Progress) -> Motion:
    """Return the motion by formulation A with a tolerance of ``places`` digits for a step, in arithmetic with
    twice as many digits as the order."""
    exact = many_digits(2 * order)
    return natural_motion(scene, times, exact, order=2 * order, tolerance=10.0**-places, progress=progress)


def _table(
    scene: Scene, moved: Scene, motion: Motion, digits: int, bound: tuple[float, float]
) -> dict[str, Any]:
    identity = canonical(scene) + json.dumps(motion.times.tolist())
    signs = np.where(np.asarray(motion.orientation[..., :1]).astype(float) < 0, -1, 1)
    table = {
        "scene": scene.name,
        "id": hashlib.sha256(identity.encode()).hexdigest()[:16],
        "version": 1,
        "digits": digits,
        "bound": f"{bound[0]:.0e}",
        "rate_bound": f"{bound[1]:.0e}",
        "methods": ACROSS if motion.crossings else METHODS,
        "times": motion.times.tolist(),
        "bodies": [body.name for body in scene.body],
        "position": _decimals(motion.position, digits),
        "orientation": _decimals(motion.orientation * signs, digits),
        **{name: _decimals(getattr(motion, name), digits) for name in RATES},
    }
    if others := replaced(scene, moved):
        table["replaced"] = others
    return table | {"hash": digest(table)}


def digest(table: dict[str, Any]) -> str:
    """Return the hash of a table without its entry ``hash``."""
    content = {key: value for key, value in table.items() if key != "hash"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _decimals(values: Any, digits: int) -> Any:
    """Return numbers as decimal strings with two digits more than requested, nested like the array."""
    if isinstance(values, np.ndarray):
        return [_decimals(value, digits) for value in values]
    return values.str(digits + 2, radius=False) if float(values) else "0"
