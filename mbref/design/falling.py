"""Equilibria to which a mechanism falls: from its first pose, and from unstable equilibria, both ways.

A slow fall follows the accelerations.  A step is the acceleration along each direction over the size of the
tangent stiffness, so that the potential energy falls along soft and stiff directions alike, whereas Newton's
method climbs along a direction of negative stiffness.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mbref.design.balance import STEP_SHARES, STRIDE, Newton, balanced
from mbref.design.joint_angles import slots
from mbref.design.linearisation import OffConstraints, Tangent
from mbref.equations.model import Model
from mbref.scene import SlideSpring, Spring, TorsionSpring

SPRINGS = (Spring, TorsionSpring, SlideSpring)
MOST_FALLS = 60  # largest number of steps of a fall
ARRIVED = 1e-3  # step, lengths or rad, from which Newton's method goes on


def fallen(found: Sequence[Newton], first: Tangent, freedoms: int, count: int) -> Iterator[Newton]:
    """Yield the equilibria to which a mechanism falls from its first pose, from the pose at which it hangs
    without springs, and from ``found`` ones, which may grow: at most ``count`` falls.

    Newton's method begins at the hanging pose, too.
    """
    if count < 1:
        return
    hanging = _hanging(first, freedoms)
    if hanging is not None and (settled := balanced(hanging, freedoms)):
        yield settled
    for start, _ in zip(_starts(found, [first, hanging], freedoms), range(count), strict=False):
        end = _end_of_fall(start, freedoms)
        if end is not None and (settled := balanced(end, freedoms)):
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
    """Return the pose to which the mechanism falls without springs; None if it has none, or no such pose."""
    scene = first.model.scene
    loads = tuple(load for load in scene.load if not isinstance(load, SPRINGS))
    if len(loads) == len(scene.load):
        return None
    model = Model(scene.with_(load=loads))
    end = _end_of_fall(Tangent(model, first.q, first.frame, np.zeros(slots(model))), freedoms)
    return end and Tangent(first.model, end.q, first.frame, first.angles, first)


def _end_of_fall(tangent: Tangent, freedoms: int) -> Tangent | None:
    """Return the pose at the end of a fall; None at a singular position."""
    try:
        here = Newton(tangent)
        for _ in range(MOST_FALLS):
            if here.is_balanced:
                break
            step = here.fall()
            lower = _lower(here, step)
            if lower is None or lower.freedoms != freedoms:
                break
            here = Newton(lower)
            if np.linalg.norm(here.tangent.basis @ step) < ARRIVED:
                break
    except OffConstraints:
        return None
    return here.tangent


def _lower(here: Newton, step: np.ndarray) -> Tangent | None:
    """Return the pose after a share of a step y (f,) over which the accelerations do work on the whole."""
    for share in STEP_SHARES:
        moved = here.moved(share * step)
        if moved is None:
            continue
        before, after = (here.tangent.coordinates(off) for off in (here.off, moved.off_balance()))
        if step @ (before + after) > 0.0:
            return moved
    return None
