"""Equilibria to which a mechanism falls: from its first pose, and from unstable equilibria, both ways.

A slow fall follows the accelerations.  A step is the acceleration along each direction over the size of the
tangent stiffness, so that the potential energy falls along soft and stiff directions alike, whereas Newton's
method climbs along a direction of negative stiffness.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mbref.design.balance import STRIDE, Newton, balanced
from mbref.design.joint_angles import slots
from mbref.design.linearisation import OffConstraints, Tangent
from mbref.equations.model import Model
from mbref.scene import Spring, TorsionSpring

SPRINGS = (Spring, TorsionSpring)  # without its own spring a slide falls without end
MOST_FALLS = 100  # largest number of steps of a fall
MOST_HALVINGS = 12  # largest number of times that a step is halved
ARRIVED = 1e-3  # step, lengths or rad, from which Newton's method goes on


def fallen(found: Sequence[Newton], first: Tangent, freedoms: int, count: int) -> Iterator[Newton]:
    """Yield the equilibria to which a mechanism falls from its first pose, from the pose at which it hangs
    without springs, and from ``found`` ones, which may grow: at most ``count`` falls.

    Newton's method begins at the hanging pose, too.
    """
    if count < 1:
        return
    hanging = _hanging(first, freedoms)
    if hanging is not None and (settled := balanced(hanging, freedoms, found)):
        yield settled
    for start, _ in zip(_starts(found, [first, hanging], freedoms), range(count), strict=False):
        end = _end_of_fall(start, freedoms, [each for each in found if each.most_unstable is None])
        if end is not None and (settled := balanced(end, freedoms, found)):
            yield settled


def _starts(found: Sequence[Newton], given: Sequence[Tangent | None], freedoms: int) -> Iterator[Tangent]:
    """Yield the given poses, and poses aside of unstable equilibria, both ways."""
    yield from (pose for pose in given if pose is not None)
    for here in found:
        direction = here.most_unstable if here.tangent.freedoms == freedoms else None
        for way in () if direction is None else (direction, -direction):
            moved = here.moved(STRIDE / 2 * way)
            if moved is not None and moved.freedoms == freedoms:
                yield moved


def _hanging(first: Tangent, freedoms: int) -> Tangent | None:
    """Return the pose to which the mechanism falls without SPRINGS; None if it has none, or no such pose."""
    scene = first.model.scene
    loads = tuple(load for load in scene.load if not isinstance(load, SPRINGS))
    if len(loads) == len(scene.load):
        return None
    model = Model(scene.with_(load=loads))
    end = _end_of_fall(Tangent(model, first.q, first.frame, np.zeros(slots(model))), freedoms, ())
    return end and Tangent(first.model, end.q, first.frame, first.angles, first)


def _end_of_fall(tangent: Tangent, freedoms: int, known: Sequence[Newton]) -> Tangent | None:
    """Return the pose at the end of a fall, or a pose from which a Newton step leads to a known stable
    equilibrium; None at a singular position."""
    share = 1.0
    try:
        here = Newton(tangent)
        for _ in range(MOST_FALLS):
            if here.is_balanced or any(here.leads_to(other) for other in known):
                break
            step = here.fall()
            lower, share = _lower(here, step, share)
            if lower is None or lower.freedoms != freedoms:
                break
            here = Newton(lower)
            if np.linalg.norm(here.tangent.basis @ step) < ARRIVED:
                break
    except OffConstraints:
        return None
    return here.tangent


def _lower(here: Newton, step: np.ndarray, share: float) -> tuple[Tangent | None, float]:
    """Return the pose after a share of a step y (f,) over which the accelerations do work, and the next
    share."""
    for _ in range(MOST_HALVINGS):
        moved = here.moved(share * step)
        if moved is not None and _work(here.tangent, moved) > 0.0:
            return moved, min(2.0 * share, 1.0)
        share /= 2.0
    return None, share


def _work(start: Tangent, end: Tangent) -> float:
    """Return the work of the accelerations from a pose to another, by the trapezoidal rule."""
    way = start.coordinates(start.to(end))
    return float(way @ start.coordinates(start.off_balance() + end.off_balance()))
